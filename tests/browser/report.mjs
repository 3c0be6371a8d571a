// The report: opened from disk, with the network off.

import { join } from "node:path";
import { statSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { accessible, axiscal, equal, holds, measured, picture, watched } from "./tools.mjs";

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

/** On A4: nothing is wider than the paper, every plot is there, and no page is nearly empty. */
async function printed(t) {
  const folder = measured(t.dir, "print");
  const file = join(folder, "report.html");
  axiscal("report", join(folder, "study.toml"), "--out", file);
  const [page, seen] = await watched(t.context);
  await page.goto(pathToFileURL(file).href);
  await page.waitForSelector("#parameters .main-svg");
  const pdf = await page.pdf({ format: "A4", preferCSSPageSize: true, path: join(t.out, "report.pdf") });
  const pages = (pdf.toString("latin1").match(/\/Type\s*\/Page\b(?!s)/g) ?? []).length;
  holds(pages >= 5 && pages <= 10, `${pages} pages`);
  // the page has been made ready as for paper, and is again as it was
  equal(await page.evaluate(() => document.documentElement.classList.contains("printing")), false);
  await page.evaluate(() => dispatchEvent(new Event("beforeprint")));
  await page.waitForTimeout(500);
  const paper = await page.evaluate(() => {
    const width = document.body.getBoundingClientRect().width;
    const titles = [...document.querySelectorAll(".js-plotly-plot")].flatMap((plot) => [...plot.querySelectorAll(".xtitle")].map((title) => [title.textContent, title.getBoundingClientRect().left - plot.getBoundingClientRect().left, plot.getBoundingClientRect().right - title.getBoundingClientRect().right]));
    return { width, wide: [...document.querySelectorAll("figure, table, .card")].filter((e) => e.getBoundingClientRect().right > width + 1).map((e) => e.outerHTML.slice(0, 80)), cut: titles.filter(([, left, right]) => left < -1 || right < -1), undrawn: [...document.querySelectorAll(".plot")].filter((p) => !p.querySelector(".main-svg")).map((p) => p.id) };
  });
  holds(/The 50 largest of \d+ touches/.test(await page.textContent("#touches-title >> xpath=..")), "which touches are printed is not said");
  equal([paper.wide, paper.cut, paper.undrawn], [[], [], []], "wider than the paper, titles that are cut, plots that are not drawn");
  equal(seen.errors, [], "errors in the console");
}

export const reportCases = [
  ["report_opens_from_disk_without_a_network", opensFromDisk],
  ["report_first_screen", firstScreen],
  ["report_printed", printed],
];
