// What the cases share: calling the program, a measured machine with a hidden effect, a workbench, and what a page must never do.

import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

/** Calls the program; "no" (1) is an answer. */
export function axiscal(...words) {
  try {
    return execFileSync(process.env.AXISCAL, words, { encoding: "utf8", stdio: ["ignore", "pipe", "pipe"] });
  } catch (error) {
    if (error.status === 1) return error.stdout;
    throw new Error(`axiscal ${words.join(" ")}: ${error.stderr}`);
  }
}

export function equal(found, expected, what = "") {
  if (JSON.stringify(found) !== JSON.stringify(expected)) throw new Error(`${what}: ${JSON.stringify(found)} instead of ${JSON.stringify(expected)}`);
}

export function holds(condition, what) {
  if (!condition) throw new Error(what);
}

/** What is wrong with the machine; no verb but `simulate` is told. */
const HIDDEN = `seed = 3
[effects.location-b]
EX0B = 0.021
EA0B = 0.0031
[effects.location-c]
EX0C = -0.014
EB0C = 0.0024
[effects.squareness-xy]
EC0Y = 900
[noise]
touch_um = 1.0
`;

/** A folder of its own with the paper's two programs, measured on a machine with a hidden effect. */
export function measured(dir, name) {
  const made = join(dir, "measured");
  if (!existsSync(made)) {
    mkdirSync(made);
    writeFileSync(join(made, "wrong.toml"), HIDDEN);
    const at = (file) => join(made, file);
    for (const program of ["head", "table"]) {
      axiscal("generate", "--machine", "swivel-head", "--program", program, "--controller", "linuxcnc", "--out", made);
      axiscal("simulate", "--plan", at(`${program}.plan.json`), "--machine", "swivel-head", "--scenario", at("wrong.toml"), "--controller", "linuxcnc", "--out", at(`${program}.log`));
    }
    axiscal("new", "--machine", "swivel-head", "--plan", at("head.plan.json"), "--log", at("head.log"), "--plan", at("table.plan.json"), "--log", at("table.log"), "--out", at("study.toml"));
  }
  const folder = join(dir, name);
  mkdirSync(folder);
  for (const file of ["head.plan.json", "head.log", "table.plan.json", "table.log", "study.toml"]) copyFileSync(join(made, file), join(folder, file));
  return folder;
}

/** A workbench of its own; ends with the case. */
export async function workbench(study, atEnd) {
  const child = spawn(process.env.AXISCAL, ["--json", "workbench", study, "--no-open"], { stdio: ["ignore", "pipe", "inherit"] });
  atEnd(() => child.kill("SIGKILL"));
  let said = "";
  for await (const part of child.stdout) {
    said += part;
    if (said.trimEnd().endsWith("}")) break;
  }
  return JSON.parse(said).address;
}

/** A page that remembers what went wrong in it, and every address that it asked for. */
export async function watched(context) {
  const page = await context.newPage();
  const seen = { errors: [], asked: [] };
  page.on("console", (m) => { if (m.type() === "error" && !refusal(m.text())) seen.errors.push(m.text()); });
  page.on("pageerror", (e) => seen.errors.push(String(e.stack ?? e)));
  page.on("request", (r) => seen.asked.push(r.url()));
  return [page, seen];
}

// an answer that says no (a stale state, a mistake in a formula) is shown in the page, and Chromium notes it as well
const refusal = (text) => /Failed to load resource: the server responded with a status of (409|422)/.test(text);

/** No fault that axe calls serious or critical. */
export async function accessible(page, what) {
  // scripts of others are forbidden in the page: this one comes through the driver
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  const bad = violations.filter((v) => ["serious", "critical"].includes(v.impact));
  const words = bad.map((v) => `${v.id} (${v.impact}): ${v.help}\n${v.nodes.slice(0, 4).map((n) => `    ${n.html.slice(0, 200)}\n      ${n.failureSummary?.split("\n").slice(1, 3).join(" ")}`).join("\n")}`);
  holds(!bad.length, `${what}: axe finds\n${words.join("\n")}`);
}
