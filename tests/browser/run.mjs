// The report and the workbench in a real browser: Chromium as Debian has it, driven by Playwright.
//
// AXISCAL (the program), AXISCAL_CHROMIUM, AXISCAL_BROWSER_OUT (screenshots and times) and AXISCAL_ROOT come from main.rs.
// Words on the command line choose cases by their names.

import { chromium } from "playwright-core";
import { mkdirSync, mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { exportCases } from "./export.mjs";
import { reportCases } from "./report.mjs";
import { oneScreenCases } from "./one_screen.mjs";
import { startCases } from "./start.mjs";
import { workbenchCases } from "./workbench.mjs";

const out = process.env.AXISCAL_BROWSER_OUT;
mkdirSync(out, { recursive: true });
const pictures = process.env.AXISCAL_PICTURES ? join(process.env.AXISCAL_ROOT, "docs/pictures") : null;
if (pictures) mkdirSync(pictures, { recursive: true });

const wanted = process.argv.slice(2);
const cases = [...reportCases, ...oneScreenCases, ...startCases, ...workbenchCases, ...exportCases].filter(([name]) => !wanted.length || wanted.some((w) => name.includes(w)));
const dir = mkdtempSync(join(tmpdir(), "axiscal-browser-"));

const browser = await chromium.launch({
  executablePath: process.env.AXISCAL_CHROMIUM,
  headless: true,
  args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader"],
});

// what goes wrong beside a case (a page's request that a case answers, say) is a failure of that case or, while it is put away, of the
// next one, and does not end the others
const beside = [];
process.on("unhandledRejection", (error) => beside.push(error));

// until all cases have ended
process.exitCode = 1;
let failed = 0;
for (const [name, run] of cases) {
  const began = performance.now();
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, reducedMotion: "reduce" });
  const ends = [];
  try {
    await run({ context, dir, out, pictures, atEnd: (end) => ends.push(end) });
    if (beside.length) throw beside.shift();
    console.log(`test ${name} ... ok (${((performance.now() - began) / 1e3).toFixed(1)} s)`);
  } catch (error) {
    failed += 1;
    console.log(`test ${name} ... FAILED\n${[error, ...beside].map((e) => e.stack ?? e).join("\n")}`);
    beside.length = 0;
    let k = 0;
    for (const page of context.pages()) {
      await page.screenshot({ path: join(out, `failed-${name}-${k++}.png`) }).catch(() => {});
    }
  }
  for (const end of ends.reverse()) await end();
  await context.close();
}
await browser.close();
for (const error of beside) {
  failed += 1;
  console.log(`after the last case: ${error.stack ?? error}`);
}
rmSync(dir, { recursive: true, force: true });
console.log(`\ntest result: ${failed ? "FAILED" : "ok"}. ${cases.length - failed} passed; ${failed} failed; 0 ignored; 0 measured; 0 filtered out\n`);
process.exitCode = failed ? 1 : 0;
