// The report: opened from disk, with the network off.

import { execFileSync } from "node:child_process";
import { dirname, join } from "node:path";
import { copyFileSync, existsSync, mkdirSync, readFileSync, readdirSync, statSync, writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { filled } from "./pdf.mjs";
import { HOSTILE, accessible, axiscal, equal, holds, hostile, measured, noHarm, picture, watched } from "./tools.mjs";

async function opensFromDisk(t) {
  const { context, dir, out } = t;
  const folder = measured(dir, "report");
  const file = join(folder, "report.html");
  axiscal("report", join(folder, "study.toml"), "--out", file);
  holds(statSync(file).size < 6e6, `the report has ${statSync(file).size} bytes`);
  await context.setOffline(true);
  const [page, seen] = await watched(context);
  const address = pathToFileURL(file).href;
  await page.goto(address);
  await page.waitForSelector(".js-plotly-plot .main-svg");
  await page.evaluate(() => new Promise((done) => setTimeout(done, 500)));
  await picture(page, t, "report");
  holds((await page.textContent("body")).includes("squareness-xy"), "the report does not name the hidden effect");
  // everything is drawn once it is in sight
  for (let y = 0; y < await page.evaluate(() => document.body.scrollHeight); y += 700) {
    await page.evaluate((to) => window.scrollTo(0, to), y);
    await page.evaluate(() => new Promise((done) => setTimeout(done, 150)));
  }
  holds(await page.locator(".js-plotly-plot").count() >= 5, "too few plots");
  // what passes the test is never called chance
  const cards = await page.evaluate(() => {
    const { candidates } = JSON.parse(document.querySelector("#view").textContent).diagnosis;
    return [...document.querySelectorAll(".card h3 .badge")].map((b, k) => [b.textContent, candidates[k].proposed, candidates[k].p_adjusted < 0.05]);
  });
  holds(cards.length > 1 && cards[0][0] === "proposed", JSON.stringify(cards));
  for (const [word, proposed, passes] of cards) equal([word === "proposed", word === "no more than noise"], [proposed, !passes], word);
  holds(!(await page.textContent("#compensation-title >> xpath=..")).includes("The remaining error is then"), "the figure of another model");
  await page.screenshot({ path: join(out, "report-whole.png"), fullPage: true });
  equal(seen.errors, [], "errors in the console");
  equal(seen.asked.filter((url) => url !== address && !/^(data|blob):/.test(url)), [], "addresses that were asked for");
  await accessible(page, "report");
  await page.emulateMedia({ colorScheme: "dark" });
  await accessible(page, "report in the dark");
  await page.screenshot({ path: join(out, "report-dark.png") });
}

/** The page and the files of --plots show the same numbers: every point, line and bar of a file is in the page's plot, and no other. */
async function sameAsFiles(t) {
  const folder = measured(t.dir, "same-as-files");
  const study = readFileSync(join(folder, "study.toml"), "utf8");
  holds(await drawnPoints(t, folder) > 300, "too few points");
  // with one model alone, and no result
  writeFileSync(join(folder, "study.toml"), study.replace(/effects = \[[^\]]*\]/, 'effects = ["block-setup", "pretravel"]'));
  holds(await drawnPoints(t, folder) > 100, "too few points of one model");
}

async function drawnPoints(t, folder) {
  const file = join(folder, "report.html");
  axiscal("report", join(folder, "study.toml"), "--out", file, "--plots", join(folder, "plots"));
  const [page, seen] = await watched(t.context);
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("#parameters .main-svg");
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.waitForTimeout(500);
  const ofFile = (name) => readFileSync(join(folder, "plots", `${name}.csv`), "utf8").trim().split("\n").slice(1).map((line) => line.match(/("(?:[^"]|"")*"|[^,]*)(?:,|$)/g).map((f) => f.replace(/,$/, "")));
  const ofPage = (id, kept) => page.evaluate(([at, mode]) => document.getElementById(at).data.filter((d) => d.mode === mode).flatMap((d) => d.x.map((x, i) => [x, d.y[i]])), [id, kept]);
  const sorted = (pairs) => pairs.map(([x, y]) => `${Number(x).toFixed(6)} ${Number(y).toFixed(6)}`).sort();
  // Z touches of a squareness: the points of both models and what lies between them
  let touches = 0;
  for (const id of await page.evaluate(() => [...document.querySelectorAll("[id^=residual-].plot")].map((e) => e.id))) {
    const rows = ofFile(id.toLowerCase());
    const points = rows.filter(([series]) => /(before|after)$/.test(series)).map(([, x, y]) => [x, y]);
    const lines = rows.filter(([series]) => /added$/.test(series)).map(([, x, y]) => [x, y]);
    equal(sorted(await ofPage(id, "markers")), sorted(points), `points of ${id}`);
    equal(sorted(await ofPage(id, "lines")), sorted(lines), `lines of ${id}`);
    touches = Math.max(touches, points.length);
  }
  const rungs = ofFile("ladder");
  const ladder = await ofPage("ladder-plot", "markers");
  for (const [step, , , rms, held] of rungs) for (const y of [rms, held]) holds(sorted(ladder).includes(sorted([[step, y]])[0]), `step ${step}: ${y} of ${JSON.stringify(ladder)}`);
  // the marks of "with the model as it is" are ticks
  const results = ofFile("results").filter((r) => r[6] !== "" && r[7] !== "").map((r) => Number(r[6]).toFixed(6)).sort();
  const marked = await page.evaluate(() => document.getElementById("parameters").data.filter((d) => d.mode === "markers" && d.marker.symbol !== "line-ns-open").flatMap((d) => d.x));
  equal(marked.map((x) => x.toFixed(6)).sort(), results, "results");
  const bars = await page.evaluate(() => document.getElementById("errors").layout.shapes.filter((s) => s.type === "rect").map((s) => s.x1));
  equal(bars.map((x) => x.toFixed(6)), ofFile("error").slice(0, -1).map((r) => Number(r[1]).toFixed(6)), "bars of the error");
  const used = ofFile("machine").filter((r) => r.includes("true")).length;
  equal(await page.evaluate(() => document.getElementById("machine-plot").data.filter((d) => d.mode === "markers" && d.marker.symbol === "diamond").reduce((n, d) => n + d.x.length, 0)), used, "arrows");
  equal(seen.errors, [], "errors in the console");
  return touches;
}

/** What a person must see without scrolling on a small screen: verdict, both pictures, what to do. */
async function firstScreen(t) {
  const folder = measured(t.dir, "first-screen");
  const file = join(folder, "report.html");
  axiscal("report", join(folder, "study.toml"), "--out", file);
  for (const colorScheme of ["light", "dark"]) {
    const [page, seen] = await watched(t.context);
    await page.setViewportSize({ width: 1366, height: 768 });
    await page.emulateMedia({ colorScheme });
    await page.goto(pathToFileURL(file).href);
    await page.waitForSelector("#parameters .main-svg");
    const ends = await page.evaluate(() => Object.fromEntries(["h1", "#errors", "#errors-says", "#parameters", "#parameters-says", "#next"].map((at) => [at, document.querySelector(at).getBoundingClientRect().bottom])));
    for (const [at, bottom] of Object.entries(ends)) holds(bottom <= 768, `${at} ends at ${bottom} px in ${colorScheme} colours`);
    await page.screenshot({ path: join(t.out, `report-first-screen-${colorScheme}.png`) });
    equal(seen.errors, [], "errors in the console");
  }
}

/** On A4: at most four sheets, none of them half empty, nothing wider than the paper, every plot, no button. */
async function printed(t) {
  const folder = measured(t.dir, "print");
  const file = join(folder, "report.html");
  for (const [what, effect] of [["effect-missing", null], ["complete", "squareness-xy"]]) {
    if (effect) axiscal("add", join(folder, "study.toml"), effect);
    axiscal("report", join(folder, "study.toml"), "--out", file);
    await sheets(t, file, what);
  }
}

async function sheets(t, file, what) {
  const [page, seen] = await watched(t.context);
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("#parameters .main-svg");
  const pdf = await page.pdf({ format: "A4", preferCSSPageSize: true, path: join(t.out, `report-${what}.pdf`) });
  const full = filled(pdf);
  console.log(`  ${what}: ${full.length} sheets, filled ${full.map((f) => f.toFixed(2)).join(", ")}`);
  holds(full.length >= 2 && full.length <= 4, `${what}: ${full.length} sheets`);
  holds(Math.min(...full) > 0.5, `${what}: sheets filled to ${full}`);
  // the page has been made ready as for paper, and is again as it was
  equal(await page.evaluate(() => document.documentElement.classList.contains("printing")), false);
  await page.emulateMedia({ media: "print" });
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.waitForTimeout(500);
  equal(await page.evaluate(() => [...document.querySelectorAll("button:not(th button), select, input")].filter((e) => e.getClientRects().length).map((e) => e.outerHTML.slice(0, 80))), [], "controls on paper");
  equal(await page.locator("#why > li").count(), 3, "lines of the grounds");
  holds(await page.isVisible("#why"), "the grounds are not printed");
  const paper = await page.evaluate(() => {
    const width = document.body.getBoundingClientRect().width;
    const titles = [...document.querySelectorAll(".js-plotly-plot")].flatMap((plot) => [...plot.querySelectorAll(".xtitle")].map((title) => [title.textContent, title.getBoundingClientRect().left - plot.getBoundingClientRect().left, plot.getBoundingClientRect().right - title.getBoundingClientRect().right]));
    return { width, wide: [...document.querySelectorAll("figure, table, .card")].filter((e) => e.getBoundingClientRect().right > width + 1).map((e) => e.outerHTML.slice(0, 80)), cut: titles.filter(([, left, right]) => left < -1 || right < -1), undrawn: [...document.querySelectorAll(".plot")].filter((p) => !p.querySelector(".main-svg")).map((p) => p.id) };
  });
  holds(/The \d+ largest of \d+ touches/.test(await page.textContent("#touches-title >> xpath=..")), "which touches are printed is not said");
  equal([paper.wide, paper.cut, paper.undrawn], [[], [], []], "wider than the paper, titles that are cut, plots that are not drawn");
  equal(seen.errors, [], "errors in the console");
}

/** On a telephone: nothing is wider than the screen, and the results show name, value and verdict. */
async function onATelephone(t) {
  const folder = measured(t.dir, "telephone");
  const file = join(folder, "report.html");
  axiscal("report", join(folder, "study.toml"), "--out", file);
  const [page, seen] = await watched(t.context);
  for (const before of [390, 1280]) {
    // opened there, and on a window that becomes as narrow
    await page.setViewportSize({ width: before, height: 844 });
    await page.goto(pathToFileURL(file).href);
    await page.waitForSelector("#parameters .main-svg");
    await page.setViewportSize({ width: 390, height: 844 });
    await page.waitForTimeout(400);
    const found = await page.evaluate(() => {
      const table = document.querySelector("#results-table");
      const seen = (e) => e.getClientRects().length > 0;
      return { wide: document.documentElement.scrollWidth, right: table.getBoundingClientRect().right, own: table.scrollWidth - table.clientWidth,
        heads: [...table.querySelectorAll("thead th")].filter(seen).map((e) => e.textContent),
        rows: [...table.querySelectorAll("tbody tr")].map((r) => [...r.children].filter(seen).map((e) => e.textContent)) };
    });
    holds(found.wide <= 390 && found.right <= 390 && found.own <= 0, `${JSON.stringify({ ...found, rows: 0 })} on 390 px`);
    equal(found.heads, ["error", "value ± 95 %", "verdict"]);
    const squareness = found.rows.find(([name]) => name.startsWith("EC0Y"));
    holds(/^\d+ ± \d+ µrad$/.test(squareness[1]), squareness[1]);
    equal(squareness[2], "too large");
  }
  await accessible(page, "report on a telephone");
  await page.screenshot({ path: join(t.out, "report-telephone.png"), fullPage: true });
  equal(seen.errors, [], "errors in the console");
}

/** What the button copies runs as it is, in a folder and with a study whose names have spaces. */
async function copiedCommand(t) {
  const made = measured(t.dir, "copied");
  const above = join(t.dir, "folder of a person");
  const folder = join(above, "my studies");
  mkdirSync(folder, { recursive: true });
  for (const file of readdirSync(made)) copyFileSync(join(made, file), join(folder, file === "study.toml" ? "my study.toml" : file));
  const path = `${dirname(process.env.AXISCAL)}:${process.env.PATH}`;
  const shell = (command) => execFileSync("sh", ["-c", command], { cwd: above, env: { ...process.env, PATH: path }, encoding: "utf8" });
  shell('axiscal report "my studies/my study.toml"');
  const [page, seen] = await watched(t.context);
  await t.context.grantPermissions(["clipboard-read", "clipboard-write"]);
  for (const verb of ["add", "export"]) {
    await page.goto(pathToFileURL(join(above, "report.html")).href);
    await page.click(`button[aria-label^="copy the command axiscal ${verb}"]`);
    await page.waitForFunction(() => [...document.querySelectorAll("#next button")].some((b) => b.textContent === "copied"));
    const command = await page.evaluate(() => navigator.clipboard.readText());
    holds(command.includes('"my studies/my study.toml"'), command);
    shell(command);
    if (verb === "add") shell('axiscal report "my studies/my study.toml"');
  }
  holds(readFileSync(join(folder, "my study.toml"), "utf8").includes('"squareness-xy"'), "the command did not add the effect");
  holds(existsSync(join(above, "compensation/compensation.json")), "the command did not export");
  equal(seen.errors, [], "errors in the console");
}

/** Names of a study, a plan, a machine and an effect that look like HTML are text. */
async function hostileNames(t) {
  const study = hostile(t.dir, "report");
  const file = join(t.dir, "hostile.html");
  axiscal("report", study, "--out", file);
  const [page, seen] = await watched(t.context);
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("#parameters .main-svg");
  for (let y = 0; y < await page.evaluate(() => document.body.scrollHeight); y += 700) {
    await page.evaluate((to) => window.scrollTo(0, to), y);
    await page.waitForTimeout(150);
  }
  await noHarm(page);
  holds((await page.textContent("#about")).includes(HOSTILE), "the machine's description is not shown");
  holds((await page.textContent("main")).includes(HOSTILE), "the effect's name is not shown");
  equal(seen.errors, [], "errors in the console");
}

export const reportCases = [
  ["report_opens_from_disk_without_a_network", opensFromDisk],
  ["report_draws_the_same_as_its_files", sameAsFiles],
  ["report_first_screen", firstScreen],
  ["report_printed", printed],
  ["report_on_a_telephone", onATelephone],
  ["report_copied_command_runs", copiedCommand],
  ["report_hostile_names", hostileNames],
];
