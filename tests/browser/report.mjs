// The report: opened from disk, with the network off.

import { join } from "node:path";
import { statSync } from "node:fs";
import { pathToFileURL } from "node:url";
import { accessible, axiscal, equal, holds, measured, watched } from "./tools.mjs";

async function opensFromDisk({ context, dir, out, pictures }) {
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
  await page.screenshot({ path: join(out, "report.png") });
  if (pictures) await page.screenshot({ path: join(pictures, "report.png") });
  holds((await page.textContent("body")).includes("squareness-xy"), "the report does not name the hidden effect");
  // everything is drawn once it is in sight
  for (let y = 0; y < await page.evaluate(() => document.body.scrollHeight); y += 700) {
    await page.evaluate((to) => window.scrollTo(0, to), y);
    await page.evaluate(() => new Promise((done) => setTimeout(done, 150)));
  }
  holds(await page.locator(".js-plotly-plot").count() >= 5, "too few plots");
  await page.screenshot({ path: join(out, "report-whole.png"), fullPage: true });
  equal(seen.errors, [], "errors in the console");
  equal(seen.asked.filter((url) => url !== address && !/^(data|blob):/.test(url)), [], "addresses that were asked for");
  await accessible(page, "report");
  await page.emulateMedia({ colorScheme: "dark" });
  await accessible(page, "report in the dark");
  await page.screenshot({ path: join(out, "report-dark.png") });
}

export const reportCases = [["report_opens_from_disk_without_a_network", opensFromDisk]];
