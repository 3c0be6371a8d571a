// The loop on one screen: what is in sight, what a click changes, and how many clicks lead to a hidden effect.

import { copyFileSync, existsSync, mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, number, openView, opened, text, told } from "./workbench.mjs";
import { axiscal, equal, holds, measured, picture, watched, workbench } from "./tools.mjs";

const PLOT = "#residuals .plot";

/** Everything that the loop needs is on the screen at 1280 × 800, and the pictures of three sizes are there to be looked at. */
async function oneScreen(t) {
  const { page, seen } = await opened(t, "screen");
  await told(page);
  await page.waitForSelector("#previewed:not([hidden])");
  for (const [width, height] of [[1280, 800], [1920, 1080], [390, 844]]) {
    await page.setViewportSize({ width, height });
    await page.waitForTimeout(600);
    await page.screenshot({ path: join(t.out, `workbench-${width}.png`), fullPage: width < 1000 });
    const sideways = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    holds(sideways <= 0, `at ${width} the page is ${sideways} px wider than the screen`);
    if (width < 1000) continue;
    const outside = await page.evaluate(() => ["#verdict", "#rms", "#ladder", "#undo", "#redo", "#candidates > li", "#own-formula", "#sketch", "#residuals .plot", "#multiples", "#where-table", "#main-step button", "#advice li", "#plan-next", "#open-export"]
      .filter((s) => { const r = document.querySelector(s).getBoundingClientRect(); return !(r.width > 0 && r.top >= 0 && r.bottom <= innerHeight + 1 && r.left >= 0 && r.right <= innerWidth + 1); }));
    equal(outside, [], `outside the screen at ${width} × ${height}`);
    holds(await page.evaluate(() => document.documentElement.scrollHeight <= innerHeight), "the page scrolls");
    const share = await page.evaluate(() => { const r = document.querySelector("#residuals").getBoundingClientRect(); return r.width * r.height / (innerWidth * innerHeight); });
    holds(share > 0.3, `the plot has ${(100 * share).toFixed(0)} % of the screen`);
  }
  equal(seen.errors, [], "errors in the console");
}

/** The table of shares and the small plots choose what the large one shows; names of axes are words with units. */
async function whereItFails(t) {
  const { page, seen } = await opened(t, "where");
  await page.waitForSelector("#where-table[data-version]");
  const shares = await page.evaluate(() => [...document.querySelectorAll("#where-table button")].map((b) => [b.getAttribute("aria-label"), parseFloat(b.textContent)]));
  const best = shares.reduce((a, b) => (b[1] > a[1] ? b : a));
  holds(best[1] > 50 && best[0].startsWith("angle of axis C, °"), `the largest share: ${best}`);
  const shown = () => page.evaluate(() => { const p = document.querySelector("#residuals .plot"); return [p.dataset.variable, p.layout.xaxis.title.text, p.data.filter((d) => ["X", "Y", "Z"].includes(d.name)).map((d) => d.name)]; });
  await page.click('#where-table button[aria-label^="position of axis Y, mm, direction X"]');
  equal(await shown(), ["Y", "position of axis Y, mm", ["X"]], "what a click in the table shows");
  await page.click("#multiples [data-variable=time]");
  equal(await shown(), ["time", "time since the first touch, h", ["X", "Y", "Z"]], "what a click on a small plot shows");
  equal(await page.getAttribute("#multiples [data-variable=time]", "aria-pressed"), "true");
  const medians = await page.evaluate((plot) => document.querySelector(plot).data.filter((d) => d.name?.startsWith("median")).length, PLOT);
  holds(medians >= 2, "no medians at 356 touches");
  const covered = await page.evaluate((plot) => {
    const boxes = [...document.querySelectorAll(["xtick text", "ytick text", "xtitle", "ytitle"].map((c) => `${plot} .${c}`).join())].map((e) => e.getBoundingClientRect());
    return boxes.flatMap((a, i) => boxes.slice(0, i).filter((b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom)).length;
  }, PLOT);
  equal(covered, 0, "labels that cover each other");
  equal(seen.errors, [], "errors in the console");
}

/** The small curve of a candidate, to first order, is what a fit with it takes away from each touch. */
async function smallCurves(t) {
  const { page, seen } = await opened(t, "curves");
  await told(page);
  const { small, fitted, expected } = await page.evaluate(async () => {
    const headers = { "x-axiscal-token": sessionStorage.getItem("axiscal-token"), "content-type": "application/json" };
    const behind = await (await fetch("/api/evidence", { headers })).json();
    const first = behind.scores.find((s) => s.effect === "squareness-xy");
    const tried = await (await fetch("/api/try", { method: "POST", headers, body: JSON.stringify({ version: behind.version, effect: "squareness-xy" }) })).json();
    const expected = await (await fetch("/api/expect", { method: "POST", headers, body: JSON.stringify({ version: behind.version, effect: "squareness-xy" }) })).json();
    return { small: first.curve_um, fitted: tried.curve_um, expected: expected.curve_um };
  });
  equal(small.length, fitted.length, "touches");
  const top = Math.max(...fitted.map(Math.abs));
  const off = Math.max(...small.map((v, i) => Math.abs(v - fitted[i])));
  holds(top > 5 && off < 0.1 * top, `the small curve is ${off.toFixed(3)} µm off, of ${top.toFixed(3)} µm`);
  const before = Math.max(...expected.map((v, i) => Math.abs(v - fitted[i])));
  holds(expected.length === fitted.length && before < 0.1 * top, `what is expected before the fit is ${before.toFixed(3)} µm off, of ${top.toFixed(3)} µm`);
  const shown = await page.locator("#candidates > li canvas:visible").count();
  holds(shown === await page.locator("#candidates > li").count(), `${shown} cards have a small curve`);
  equal(seen.errors, [], "errors in the console");
}

/** With motion the marks fall within 400 ms, from the old places to the new ones, and come to rest also where the state is read
 *  once more while they fall, as it is when the diagnosis ends early. */
async function marksFall(t) {
  const { page } = await opened(t, "fall");
  await told(page);
  await page.emulateMedia({ reducedMotion: "no-preference" });
  await page.evaluate(async (plot) => {
    const { refresh } = await import("/assets/talk.js");
    const before = document.body.dataset.version;
    const large = document.querySelector(plot);
    window.pictures = [];
    new MutationObserver(() => {
      window.pictures.push(performance.now());
      const of = large.dataset.framed;
      if (of && of !== before) window.readAgain ??= refresh();
    }).observe(large, { attributes: true, attributeFilter: ["data-framed"] });
    document.querySelector('[data-switch="squareness-xy"]').click();
  }, PLOT);
  await page.waitForFunction((plot) => document.querySelector(plot).dataset.ghosts === "true", PLOT);
  const times = await page.evaluate(async () => { await window.readAgain; return window.pictures; });
  holds(times.length >= 3, `the marks fall in ${times.length} pictures`);
  holds(times.at(-1) - times[0] <= 400, `the marks fall for ${(times.at(-1) - times[0]).toFixed(0)} ms`);
  // the old marks stay, also when the plot turns to another variable
  await page.waitForSelector("#advice[data-complete=true]", { timeout: 120_000 });
  await page.click("#multiples [data-variable=B]");
  const shown = await page.evaluate((plot) => { const p = document.querySelector(plot); return [p.dataset.variable, p.dataset.ghosts, p.data.filter((d) => d.name === "before").length > 0]; }, PLOT);
  equal(shown, ["B", "true", true], "the old marks against another variable");
}

/** A state that is read again while the page opens changes nothing: the marks of before are kept at the first step. */
async function readTwice(t) {
  const folder = measured(t.dir, "read-twice");
  const address = await workbench(join(folder, "study.toml"), t.atEnd);
  const [page, seen] = await watched(t.context);
  // the first answer with the touches waits for the third question, the others for the page
  let asked = 0;
  let answerFirst;
  const thirdAsks = new Promise((done) => { answerFirst = done; });
  await page.route("**/api/inputs", async (route) => {
    asked += 1;
    if (asked === 1) {
      await page.evaluate(async () => {
        const { refresh } = await import("/assets/talk.js");
        window.again = Promise.all([refresh(), refresh()]);
      });
      await thirdAsks;
      return route.continue();
    }
    if (asked === 3) answerFirst();
    await page.waitForSelector("body[data-version]");
    return route.continue();
  });
  await page.goto(address);
  await page.waitForSelector("body[data-version]");
  await page.evaluate(async () => { await window.again; });
  await page.unrouteAll({ behavior: "wait" });
  await told(page);
  await after(page, () => page.click("[data-switch=squareness-xy]"));
  equal(await page.getAttribute(PLOT, "data-ghosts"), "true", "the marks of before stay as ghosts");
  equal(seen.errors, [], "errors in the console");
}

/** The slider goes through the index positions, and every touch belongs to one. */
async function machineIn3d(t) {
  const { page, seen } = await opened(t, "machine");
  await openView(page, "machine");
  await page.waitForFunction(() => document.querySelector("#space").data?.length > 3);
  const count = () => page.evaluate(() => document.querySelector("#space").data.find((d) => d.name === "touches").x.length);
  const names = await page.evaluate(() => document.querySelector("#space").data.find((d) => d.name === "names").text);
  holds(names.includes("axis B") && names.includes("axis C") && names.length >= 4, `what is named: ${names}`);
  const all = await count();
  const steps = Number(await page.getAttribute("#pose", "max"));
  holds(steps >= 3, `${steps} index positions`);
  let sum = 0;
  for (let k = 1; k <= steps; k += 1) {
    await page.locator("#pose").fill(String(k));
    await page.waitForFunction((n) => document.querySelector("#pose-says").textContent.startsWith(`${n} of`), k);
    sum += await count();
  }
  equal(sum, all, "touches of all index positions");
  await page.screenshot({ path: join(t.out, "workbench-machine.png") });
  equal(seen.errors, [], "errors in the console");
}

/** Names that are markup show as text, in every view. */
async function hostileNames(t) {
  const { folder, page } = await opened(t, "hostile");
  await page.close();
  const name = `<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>"&`;
  const own = { id: "own-one", name, says: name, look: name, at: "Y" };
  const rows = Object.entries(own).map(([key, value]) => `${key} = '${value}'`).join("\n");
  writeFileSync(join(folder, "own.toml"), `[[effect]]\n${rows}\nterms = [{ parameter = "own_size", unit = "urad", dof = "dx", formula = "-Y" }]\n`);
  const log = "head <b>'x'.log";
  copyFileSync(join(folder, "head.log"), join(folder, log));
  const study = join(folder, "a <i>'study'.toml");
  writeFileSync(study, `effects_file = ["own.toml"]\n${text(folder).replace('"head.log"', `"${log}"`)}`);
  const address = await workbench(study, t.atEnd);
  const [other, seen] = await watched(t.context);
  await other.goto(address);
  await other.waitForSelector("body[data-version]");
  await told(other);
  await other.fill("#find", "own-one");
  await other.waitForFunction(() => document.querySelector("#previewed").textContent.includes("<script>"));
  await after(other, () => other.locator("[data-switch=own-one]").first().click());
  for (const id of ["machine", "touches", "results", "log", "plots"]) await openView(other, id);
  await told(other);
  equal(await other.evaluate(() => [window.hacked ?? null, document.querySelectorAll("img, body script, i, b").length]), [null, 0], "markup of a name became markup of the page");
  const words = await other.textContent("body");
  for (const part of ["<script>window.hacked=1</script>", log, "a <i>'study'.toml"]) holds(words.includes(part), `${part} is not shown as it is`);
  equal(seen.errors, [], "errors in the console");
}

/** Hidden effects, and none: what only the scenario of the virtual machine is told. */
const HIDDEN = [
  ["squareness-xy", "[effects.squareness-xy]\nEC0Y = 120\n"],
  ["scale-x", "[effects.scale-x]\nEXX = 60\n"],
  ["warm-up", "[effects.warm-up]\nwz = 12\ntau = 0.3\n", "time"],
  ["backlash-c", "[effects.backlash-c]\nbacklash_C = 160\n", "C"],
  ["radial-c-1", "[effects.radial-c-1]\nEXC1c = 6\n", "C"],
  [null, ""],
];

/** With the mouse alone, from the opened page to the named effect and the fallen error. */
async function tenClicks(t) {
  const folder = join(t.dir, "hidden");
  mkdirSync(folder);
  const at = (file) => join(folder, file);
  axiscal("generate", "--machine", "swivel-head", "--program", "full", "--controller", "linuxcnc", "--out", folder);
  const wrong = [];
  for (const [k, [truth, planted, axis]] of HIDDEN.entries()) {
    writeFileSync(at("wrong.toml"), `seed = ${20 + k}\n[effects.location-b]\nEX0B = 0.021\nEA0B = 0.0031\n[effects.location-c]\nEX0C = -0.014\n${planted}[noise]\ntouch_um = 1.0\n`);
    axiscal("simulate", "--plan", at("full.plan.json"), "--machine", "swivel-head", "--scenario", at("wrong.toml"), "--controller", "linuxcnc", "--out", at(`run-${k}.log`));
    axiscal("new", "--machine", "swivel-head", "--plan", at("full.plan.json"), "--log", at(`run-${k}.log`), "--controller", "linuxcnc", "--out", at(`study-${k}.toml`));
    const address = await workbench(at(`study-${k}.toml`), t.atEnd);
    const [page, seen] = await watched(t.context);
    await page.goto(address);
    const decided = () => page.waitForSelector("#advice[data-complete=true]", { timeout: 120_000 });
    await decided();
    const before = await number(page, "rms");
    const against = await page.getAttribute(PLOT, "data-variable");
    // the first candidate has the coloured button while one is proposed; where touches cannot separate several, they stand in its card
    const press = page.locator("#candidates > li.proposed [role=switch]").first();
    const named = [];
    let clicks = 0;
    while (clicks < 10 && await press.count()) {
      named.push(await page.evaluate(() => [...document.querySelectorAll("#candidates > li.proposed")].slice(0, 1).flatMap((e) => [e, ...e.querySelectorAll("[data-effect]")]).map((e) => e.dataset.effect)));
      if (clicks === 0 && truth === "warm-up") await picture(page, t, "workbench-missing");
      await after(page, () => press.click());
      clicks += 1;
      await decided();
      if (truth === "warm-up") await picture(page, t, "workbench-fallen");
    }
    const [left, noise] = [await number(page, "rms"), await number(page, "noise")];
    const verdict = await page.getAttribute("#verdict", "data-verdict");
    const row = `${truth ?? "nothing"}: ${clicks} clicks, ${before} → ${left} µm, noise ${noise} µm, ${verdict}, drawn against ${against}, named: ${named.map((g) => g.join(" or ")).join("; then ") || "none"}`;
    console.log(`  ${row}`);
    if (!truth && (clicks > 0 || verdict !== "adequate")) wrong.push(row);
    if (truth && !(before > 1.2 * noise && left < 1.15 * noise && clicks >= 1 && named[0].includes(truth))) wrong.push(row);
    if (axis && against !== axis) wrong.push(row);
    equal(seen.errors, [], "errors in the console");
    await page.close();
  }
  equal(wrong, [], "not led to the effect");
}

/** The whole loop without a mouse: look at another axis, add what is proposed, go back, forth again, and write the compensation. */
async function keyboardOnly(t) {
  const { folder, page, seen } = await opened(t, "keyboard");
  await page.waitForSelector("#advice[data-complete=true]", { timeout: 120_000 });
  /** Tabs to what `selector` finds, in the order of the page. */
  const to = async (selector) => {
    await page.evaluate(() => document.activeElement?.blur());
    for (let k = 0; k < 200; k += 1) {
      await page.keyboard.press("Tab");
      if (await page.evaluate((s) => document.activeElement?.matches(s), selector)) return;
    }
    throw new Error(`${selector} cannot be reached with the Tab key`);
  };
  await to("#multiples [data-variable=time]");
  await page.keyboard.press("Enter");
  equal(await page.getAttribute(PLOT, "data-variable"), "time", "the axis");
  const before = await number(page, "rms");
  await to("#main-step button");
  await after(page, () => page.keyboard.press("Enter"));
  const left = await number(page, "rms");
  holds(left < 0.5 * before, `${before} → ${left} µm`);
  await to("#ladder button");
  await after(page, () => page.keyboard.press("Space"));
  equal(await number(page, "rms"), before, "back");
  await after(page, () => page.keyboard.press("Control+z"));
  equal(await number(page, "rms"), left, "forth");
  await to("[role=tab][aria-selected=true]");
  for (const id of ["machine", "touches", "results", "log", "export-view"]) {
    await page.keyboard.press("ArrowRight");
    equal(await page.isVisible(`#${id}`), true, id);
  }
  // where the export is the first thing to do it has one button, the large one
  await to("#main-step [data-do=export], #open-export");
  await page.keyboard.press("Enter");
  await to("#export");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#export-panel[data-state=done]", { timeout: 60_000 });
  holds(existsSync(join(folder, "study-compensation-linuxcnc/compensation.json")), "no compensation is there");
  equal(seen.errors, [], "errors in the console");
}

/** What no known effect explains is sketched by a button: the form is filled, and its curve drawn. */
async function sketchForMe(t) {
  const { folder, page, seen } = await opened(t, "sketch");
  await told(page);
  await page.click("#sketch");
  await page.waitForFunction(() => document.querySelector("#draft-answer").textContent.startsWith("with it"), undefined, { timeout: 60_000 });
  equal(await page.isHidden("#previewed"), false, "the curve");
  await page.screenshot({ path: join(t.out, "workbench-sketch.png") });
  const before = await number(page, "rms");
  await after(page, () => page.click("#draft-save-on"));
  holds(await number(page, "rms") < 0.7 * before, `the sketch leaves ${await number(page, "rms")} of ${before} µm`);
  holds(existsSync(join(folder, "my-effects.toml")), "no effects file");
  equal(seen.errors, [], "errors in the console");
}

export const oneScreenCases = [
  ["workbench_one_screen", oneScreen],
  ["workbench_where_it_fails", whereItFails],
  ["workbench_small_curves", smallCurves],
  ["workbench_marks_fall", marksFall],
  ["workbench_read_twice_while_opening", readTwice],
  ["workbench_machine_in_3d", machineIn3d],
  ["workbench_hostile_names", hostileNames],
  ["workbench_ten_clicks", tenClicks],
  ["workbench_keyboard_only", keyboardOnly],
  ["workbench_sketch_for_me", sketchForMe],
];
