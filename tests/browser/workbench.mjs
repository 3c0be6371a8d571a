// The workbench: the whole loop on a machine with a hidden effect, and everything that a page may do to a study.

import { appendFileSync, existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { accessible, axiscal, equal, holds, many, measured, watched, workbench } from "./tools.mjs";

const number = async (page, id) => Number(await page.textContent(`#${id}`));
const text = (folder) => readFileSync(join(folder, "study.toml"), "utf8");
const version = (page) => page.evaluate(() => Number(document.body.dataset.version));

async function opened(t, name) {
  const folder = measured(t.dir, name);
  const address = await workbench(join(folder, "study.toml"), t.atEnd);
  const [page, seen] = await watched(t.context);
  await page.goto(address);
  await page.waitForSelector("body[data-version]");
  return { folder, address, page, seen };
}

const told = (page) => page.waitForSelector("#candidates[data-complete=true]", { state: "attached", timeout: 120_000 });

/** Waits for the state after this one, drawn in the plots that are in sight. */
async function after(page, work) {
  const before = await version(page);
  await work();
  await page.waitForFunction((v) => Number(document.body.dataset.version) > v, before);
  const now = await version(page);
  await page.waitForFunction((v) => {
    const inSight = (p) => { const r = p.getBoundingClientRect(); return r.bottom > 0 && r.top < innerHeight; };
    return [...document.querySelectorAll("#residuals .plot")].filter(inSight).every((p) => Number(p.dataset.version) === v);
  }, now);
}

/** Largest mark of the first plot in µm, and its place on the screen: what a person sees falling. */
const spread = (page) => page.evaluate(() => {
  const plot = document.querySelector("#residuals .plot[data-version]");
  const all = plot.data.slice(0, 3).flatMap((d) => [...d.y]);
  const marks = [...plot.querySelectorAll(".scatterlayer .points path")].map((p) => p.getBoundingClientRect());
  const tops = marks.map((m) => m.top + m.height / 2);
  return { um: Math.max(...all.map(Math.abs)), marks: all.length, px: Math.max(...tops) - Math.min(...tops) };
});

async function wholeLoop(t) {
  const { folder, page, seen } = await opened(t, "loop");
  await told(page);
  equal(await page.getAttribute("#verdict", "data-verdict"), "missing-effect", "verdict");
  const before = await number(page, "rms");
  const noise = await number(page, "noise");
  holds(before > 3 * noise, `the error before is ${before} µm against ${noise} µm`);
  const wide = await spread(page);
  await page.screenshot({ path: join(t.out, "workbench-before.png") });
  if (t.pictures) await page.screenshot({ path: join(t.pictures, "workbench-before.png") });

  // the first candidate is opened: what it is, and its curve over the touches
  const first = page.locator("#candidates > li").first();
  equal(await first.getAttribute("data-effect"), "squareness-xy", "the first candidate");
  await first.locator(".open").click();
  await page.waitForSelector("#previewed:not([hidden])");
  const curve = await page.evaluate(() => document.querySelector("#residuals .plot[data-version]").data.slice(3, 6).reduce((n, d) => n + d.y.length, 0));
  holds(curve > 3, "no curve is drawn");
  await page.screenshot({ path: join(t.out, "workbench-candidate.png") });

  // it is switched on
  await after(page, () => first.getByRole("switch").click());
  const left = await number(page, "rms");
  holds(left < 1.3 * noise, `${left} µm are left with a noise of ${noise} µm`);
  const narrow = await spread(page);
  equal(narrow.marks, wide.marks, "marks in the plot");
  holds(narrow.um < 0.4 * wide.um, `the largest mark falls from ${wide.um} to ${narrow.um} µm`);
  holds(narrow.px < 0.4 * wide.px, `on the screen the marks fall from ${wide.px} to ${narrow.px} px`);
  equal(await page.locator("#in-model [data-switch=squareness-xy]").getAttribute("aria-checked"), "true", "the switch");
  await page.locator("#ladder").scrollIntoViewIfNeeded();
  await page.waitForFunction(() => document.querySelector("#ladder").data?.[0].x.length === 2);
  await page.screenshot({ path: join(t.out, "workbench-ladder.png") });
  await page.evaluate(() => window.scrollTo(0, 0));
  holds(text(folder).includes('"squareness-xy"'), "the study on the disk does not follow");
  await told(page);
  equal(await page.getAttribute("#verdict", "data-verdict"), "adequate", "verdict after");
  holds(await number(page, "held-out") < 2 * noise, "the error on touches left out");
  await page.screenshot({ path: join(t.out, "workbench-after.png") });
  if (t.pictures) await page.screenshot({ path: join(t.pictures, "workbench-after.png") });

  // and the compensation is written beside the study
  await page.selectOption("#controller", "linuxcnc");
  await page.click("#export");
  await page.waitForSelector("#job[data-state=done]", { timeout: 60_000 });
  holds(existsSync(join(folder, "study-compensation-linuxcnc/compensation.json")), "no compensation is there");
  equal(seen.errors, [], "errors in the console");
}

async function undoAndRedo(t) {
  const { folder, page, seen } = await opened(t, "undo");
  const texts = [text(folder)];
  for (const effect of ["squareness-xy", "scale-x"]) {
    await page.fill("#find", effect);
    await after(page, () => page.click(`[data-switch=${effect}]`));
    texts.push(text(folder));
  }
  await page.fill("#find", "");
  holds(await page.isDisabled("#redo"), "there is nothing to make again yet");
  await after(page, () => page.click("#undo"));
  equal(text(folder), texts[1]);
  // the keyboard does the same
  await page.locator("h1").click();
  await after(page, () => page.keyboard.press("Control+z"));
  equal(text(folder), texts[0]);
  holds(await page.isDisabled("#undo"), "there is nothing to undo any more");
  await after(page, () => page.keyboard.press("Control+Shift+z"));
  equal(text(folder), texts[1]);
  await after(page, () => page.click("#redo"));
  equal(text(folder), texts[2]);
  equal(seen.errors, [], "errors in the console");
}

async function touchesAreTakenOut(t) {
  const { folder, page, seen } = await opened(t, "mask");
  const used = await page.textContent("#used");
  const before = text(folder);
  await page.waitForSelector("#touch-table input");
  // a touch that is pointed at shows in every plot
  await page.locator("#touch-table tbody tr").first().hover();
  holds(await page.evaluate(() => [...document.querySelectorAll("#residuals .ring")].filter((r) => !r.hidden).length) >= 2, "the touch does not show in the plots");
  holds(/^touch \d+ of run/.test(await page.textContent("#hovered")), "the touch is not named");
  // chosen in the table by keyboard, taken out with a reason
  await page.locator("#touch-table input").first().focus();
  await page.keyboard.press("Space");
  equal(await page.textContent("#chosen"), "1 touch is chosen");
  await page.click("#take-out");
  holds((await page.textContent("#chosen")).includes("why"), "a touch went without a reason");
  equal(text(folder), before);
  await page.fill("#reason", "a chip");
  await after(page, () => page.keyboard.press("Enter"));
  holds(/\[\[mask\]\]\nrun = \d\nid = \d+\nreason = "a chip"/.test(text(folder)), text(folder));
  holds(await page.textContent("#used") !== used, "the touch is still used");
  // several by a box in a plot
  const plot = page.locator("#residuals .plot").first();
  await plot.scrollIntoViewIfNeeded();
  await page.waitForSelector("#residuals .plot[data-version]");
  await plot.hover();
  await plot.locator('[data-val="select"]').click();
  const area = await plot.locator(".nsewdrag").first().boundingBox();
  await page.mouse.move(area.x + 5, area.y + 5);
  await page.mouse.down();
  await page.mouse.move(area.x + area.width / 3, area.y + area.height / 2, { steps: 5 });
  await page.mouse.move(area.x + area.width - 5, area.y + area.height - 5, { steps: 5 });
  await page.mouse.up();
  await page.waitForFunction(() => /^\d\d+ touches are chosen/.test(document.querySelector("#chosen").textContent));
  await page.click("#choose-none");
  // and back in
  await after(page, () => page.click("#undo"));
  equal(text(folder), before);
  equal(seen.errors, [], "errors in the console");
}

async function formulaBox(t) {
  const { folder, page, seen } = await opened(t, "formula");
  const before = await number(page, "rms");
  const formula = page.locator("#draft-terms input.formula");
  await page.fill("#draft-id", "my-square");
  await page.selectOption("#draft-at", "Y");
  await page.selectOption("#draft-terms [data-word=unit]", "urad");
  await page.selectOption("#draft-terms [data-word=dof]", "dx");
  // a mistake has its place below the formula
  await formula.fill("1e-3 * Q");
  await page.waitForFunction(() => document.querySelector("#draft .caret").textContent.includes("^"));
  const caret = (await page.textContent("#draft .caret")).split("\n");
  equal(caret[1].indexOf("^"), 7, "the mark");
  holds((await page.textContent("#draft .mistake")).includes('"Q"'), "the mistake is not named");
  equal(await formula.getAttribute("aria-invalid"), "true");
  // a good one draws its curve
  await formula.fill("-Y");
  await page.waitForSelector("#previewed:not([hidden])");
  holds((await page.textContent("#draft-answer")).startsWith("with it"), "no answer");
  equal(await page.textContent("#draft .caret"), "");
  holds(!text(folder).includes("my-square"), "drawing a curve writes nothing");
  await after(page, () => page.click("#draft-save-on"));
  const own = readFileSync(join(folder, "my-effects.toml"), "utf8");
  holds(own.includes('id = "my-square"') && own.includes('formula = "-Y"'), own);
  holds(text(folder).includes('effects_file = ["my-effects.toml"]') && text(folder).includes('"my-square"'), text(folder));
  holds(await number(page, "rms") < 0.4 * before, "the effect of one's own explains nothing");
  // the words of a formula are at hand
  await page.getByText("words of a formula").click();
  holds(await page.locator("#draft-words tbody tr").count() === 37, "words are missing");
  equal(seen.errors, [], "errors in the console");
}

async function changeOnDisk(t) {
  const { folder, page } = await opened(t, "disk");
  const file = join(folder, "study.toml");
  const before = text(folder);
  await after(page, async () => writeFileSync(file, before.replace('"pretravel"', '"pretravel", "squareness-xy"')));
  equal(await page.locator("#in-model [data-switch=squareness-xy]").count(), 1, "the effect from the disk");
  writeFileSync(file, "machine = \n");
  await page.waitForFunction(() => document.querySelector("#messages").textContent.includes("study.toml:1:"));
  writeFileSync(file, before);
  await page.waitForFunction(() => document.querySelector("#messages").textContent === "");
  equal(await page.locator("#in-model [data-switch=squareness-xy]").count(), 0);
}

async function twoTabs(t) {
  const { folder, address, page } = await opened(t, "tabs");
  const [other] = await watched(t.context);
  await other.goto(address);
  await other.waitForSelector("body[data-version]");
  // what one tab does shows in the other
  await after(other, () => page.click("#candidates >> nth=0 >> [role=switch] >> nth=0"));
  equal(await other.textContent("#rms"), await page.textContent("#rms"));
  // a step that was asked of an older state is refused, and the page shows the new one
  const held = [];
  await other.route("**/api/step", (route) => { held.push(route); });
  await other.click("#undo");
  await page.waitForTimeout(100);
  await after(page, () => page.click("#undo"));
  for (const route of held) await route.continue();
  await other.waitForFunction(() => document.querySelector("#messages").textContent.includes("changed meanwhile"));
  equal(await version(other), await version(page));
  holds(!text(folder).includes("squareness-xy"), "the study has two minds");
}

async function byKeyboardAndByEar(t) {
  const { page, seen } = await opened(t, "keys");
  await told(page);
  await accessible(page, "workbench");
  // an effect is found, opened and switched on without a mouse
  await page.locator("h1").click();
  await page.keyboard.press("/");
  equal(await page.evaluate(() => document.activeElement.id), "find");
  await page.keyboard.type("squareness-xy");
  await page.keyboard.press("Tab");
  for (let k = 0; k < 12 && await page.evaluate(() => document.activeElement.dataset.switch) !== "squareness-xy"; k += 1) await page.keyboard.press("Tab");
  equal(await page.evaluate(() => document.activeElement.getAttribute("role")), "switch");
  await after(page, () => page.keyboard.press("Space"));
  await page.waitForFunction(() => document.activeElement.dataset.switch === "squareness-xy" && document.activeElement.ariaChecked === "true");
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.waitForSelector(".details");
  await told(page);
  await accessible(page, "workbench with an effect opened");
  await page.emulateMedia({ colorScheme: "dark" });
  await accessible(page, "workbench in the dark");
  await page.screenshot({ path: join(t.out, "workbench-dark.png"), fullPage: true });
  equal(seen.errors, [], "errors in the console");
}

/** From the click to the new plots; printed, and judged by people: machines differ. */
async function timed(t, study, what) {
  const address = await workbench(study, t.atEnd);
  const [page, seen] = await watched(t.context);
  await page.goto(address);
  await page.waitForSelector("body[data-version]", { timeout: 300_000 });
  await page.waitForSelector("#candidates [data-switch=squareness-xy]", { timeout: 300_000 });
  const all = [];
  for (let k = 0; k < 9; k += 1) {
    // the evidence behind the last click is ready, as for a person who looks before the next one
    await page.waitForSelector("#candidates[data-complete=true]", { state: "attached", timeout: 300_000 });
    await page.waitForTimeout(200);
    await page.evaluate(() => { window.axiscalTimes = null; });
    await page.evaluate(() => document.querySelector("[data-switch=squareness-xy]").click());
    await page.waitForFunction(() => window.axiscalTimes?.painted, undefined, { timeout: 60_000 });
    all.push(await page.evaluate(() => window.axiscalTimes));
  }
  const touches = await page.textContent("#used");
  const plots = await page.evaluate(() => [...document.querySelectorAll("#residuals .plot")].filter((p) => p.getBoundingClientRect().top < innerHeight).length);
  const middle = (key) => all.map((a) => a[key]).sort((a, b) => a - b)[all.length >> 1].toFixed(0);
  const says = `${what}: ${touches} touches, ${plots} plots in sight, ms from the click, median of ${all.length}: fit ${middle("fit")}, answered ${middle("answered")}, drawn ${middle("drawn")}, painted ${middle("painted")}`;
  console.log(`  ${says}`);
  appendFileSync(join(t.out, "times.txt"), `${says}\n`);
  await page.screenshot({ path: join(t.out, `times-${what}.png`) });
  holds(all.every((a) => a.painted > 0), "no times");
  equal(seen.errors, [], "errors in the console");
}

async function times(t) {
  const folder = measured(t.dir, "times");
  const head = join(folder, "head.toml");
  axiscal("new", "--machine", "swivel-head", "--plan", join(folder, "head.plan.json"), "--log", join(folder, "head.log"), "--out", head);
  await timed(t, head, "head");
  await timed(t, join(folder, "study.toml"), "head-and-table");
}

async function timesOfMany(t) {
  await timed(t, many(t.dir), "many");
}

async function withoutToken(t) {
  const folder = measured(t.dir, "token");
  const address = await workbench(join(folder, "study.toml"), t.atEnd);
  const page = await t.context.newPage();
  await page.goto(address.split("#")[0]);
  await page.waitForFunction(() => document.querySelector("#messages").textContent.includes("open the address that the terminal shows"));
  holds(!(await page.textContent("body")).includes("swivel-head"), "the page shows the study without a token");
  // the token leaves the address line
  await page.goto("about:blank");
  await page.goto(address);
  await page.waitForSelector("body[data-version]");
  holds(!page.url().includes("token"), page.url());
  await page.reload();
  await page.waitForSelector("body[data-version]");
}

export const workbenchCases = [
  ["workbench_whole_loop", wholeLoop],
  ["workbench_undo_and_redo", undoAndRedo],
  ["workbench_touches_are_taken_out", touchesAreTakenOut],
  ["workbench_formula_box", formulaBox],
  ["workbench_change_on_disk", changeOnDisk],
  ["workbench_two_tabs", twoTabs],
  ["workbench_by_keyboard_and_by_ear", byKeyboardAndByEar],
  ["workbench_without_token", withoutToken],
  ["workbench_times", times],
  ["workbench_times_of_ten_thousand", timesOfMany],
];
