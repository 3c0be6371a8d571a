// What the cases share: calling the program, a measured machine with a hidden effect, a workbench, and what a page must never do.

import { execFileSync, spawn } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

import { smaller } from "./png.mjs";

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

/** A name that would run if it were HTML, closed an attribute, or ended a script. */
export const HOSTILE = "</script><img src=x onerror=window.harmed=1>\"'&amp;";

/** A study whose own name and the names of its machine, blocks and effects are hostile; the path of it. */
export function hostile(dir, name) {
  const folder = measured(dir, `hostile-${name}`);
  const at = (file) => join(folder, file);
  const machines = readFileSync(join(process.env.AXISCAL_ROOT, "machines.toml"), "utf8");
  const says = /(name = "swivel-head"\n(?:.*\n)*?says\s*= )"[^"\n]*"/;
  holds(says.test(machines), "the machine has no description");
  writeFileSync(at("machines.toml"), machines.replace(says, (_, before) => `${before}${JSON.stringify(HOSTILE)}`));
  for (const program of ["head", "table"]) {
    // a log names the plan that it belongs to; a CSV of touches does not
    axiscal("parse", at(`${program}.log`), "--controller", "linuxcnc", "--plan", at(`${program}.plan.json`), "--out", at(`${program}.csv`));
    const plan = JSON.parse(readFileSync(at(`${program}.plan.json`), "utf8"));
    delete plan.fields_sha256;
    const named = (block) => ({ ...block, name: `${block.name}${HOSTILE}` });
    writeFileSync(at(`${program}.plan.json`), JSON.stringify({ ...plan, blocks: plan.blocks.map(named), touches: plan.touches.map((t) => ({ ...t, block: `${t.block}${HOSTILE}` })) }));
  }
  writeFileSync(at("my-effects.toml"), `[[effect]]
id = "my-square"
name = ${JSON.stringify(HOSTILE)}
says = ${JSON.stringify(HOSTILE)}
at = "Y"
terms = [ { parameter = "mine", unit = "urad", dof = "dx", formula = "-Y", typical = 16 } ]
`);
  const study = at(`<img src=x onerror=window.harmed=1> "it's".toml`);
  const text = readFileSync(at("study.toml"), "utf8").replaceAll(".log\"", ".csv\"").replaceAll('"linuxcnc"', '"csv"');
  writeFileSync(study, `machines = "machines.toml"\neffects_file = ["my-effects.toml"]\n${text.replace(/(effects = \[\s*)/, '$1"my-square", ')}`);
  return study;
}

/** Nothing of a hostile name has become an element. */
export async function noHarm(page) {
  equal(await page.evaluate(() => [window.harmed ?? 0, document.querySelectorAll("img[src=x]").length]), [0, 0], "a name ran as HTML");
}

/** Time constant of the machine that warms up. */
export const RISE_H = 0.2;

/** A machine whose column rises while it warms up, measured with the program that comes back to its places. */
export function warming(dir) {
  const folder = join(dir, "warming");
  mkdirSync(folder);
  const at = (file) => join(folder, file);
  writeFileSync(at("wrong.toml"), `seed = 8
[effects.warm-up]
wz = 25
tau = ${RISE_H}
[noise]
touch_um = 0.5
`);
  axiscal("generate", "--machine", "swivel-head", "--program", "full", "--controller", "linuxcnc", "--out", folder);
  axiscal("simulate", "--plan", at("full.plan.json"), "--machine", "swivel-head", "--scenario", at("wrong.toml"), "--controller", "linuxcnc", "--out", at("full.log"));
  axiscal("new", "--machine", "swivel-head", "--plan", at("full.plan.json"), "--log", at("full.log"), "--controller", "linuxcnc", "--out", at("study.toml"));
  return folder;
}

/** The same touches again and again with fresh noise, until there are ten thousand: for times. */
export function many(dir) {
  const folder = measured(dir, "many");
  const at = (file) => join(folder, file);
  // a generator of its own, so that every run is the same
  let seed = 12345;
  const uniform = () => { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; return (seed + 0.5) / 2 ** 32; };
  const normal = () => Math.sqrt(-2 * Math.log(uniform())) * Math.cos(2 * Math.PI * uniform());
  for (const program of ["head", "table"]) {
    axiscal("parse", at(`${program}.log`), "--controller", "linuxcnc", "--plan", at(`${program}.plan.json`), "--out", at(`${program}.csv`));
    const plan = JSON.parse(readFileSync(at(`${program}.plan.json`), "utf8"));
    const [head, ...rows] = readFileSync(at(`${program}.csv`), "utf8").trim().split("\n");
    const names = head.split(",");
    const id = names.indexOf("id");
    const time = names.indexOf("time_s");
    const n = plan.touches.length;
    const duration = 1 + Math.max(...plan.touches.map((t) => t.time_s ?? 0));
    const touches = [], lines = [head];
    const byId = new Map(plan.touches.map((t) => [String(t.id), t]));
    for (let k = 0; touches.length < 5000; k += 1) {
      for (const row of rows) {
        const cells = row.split(",");
        const t = byId.get(cells[id]);
        const own = { ...t, id: t.id + k * 1000, time_s: (t.time_s ?? 0) + k * duration };
        if (t.visit !== undefined) own.visit = t.visit + k * 1000;
        touches.push(own);
        cells[id] = String(own.id);
        if (time >= 0 && cells[time]) cells[time] = String(Number(cells[time]) + k * duration);
        if (k > 0) for (const axis of ["X", "Y", "Z"]) {
          const column = names.indexOf(axis);
          cells[column] = (Number(cells[column]) + normal() * 1e-3).toFixed(6);
        }
        lines.push(cells.join(","));
      }
    }
    holds(n > 0, "an empty plan");
    // other touches than those that were generated: a plan without the digests of its fields, as earlier versions wrote it
    delete plan.fields_sha256;
    writeFileSync(at(`${program}.plan.json`), JSON.stringify({ ...plan, touches }));
    writeFileSync(at(`${program}.csv`), `${lines.join("\n")}\n`);
  }
  axiscal("new", "--machine", "swivel-head", "--plan", at("head.plan.json"), "--log", at("head.csv"), "--plan", at("table.plan.json"), "--log", at("table.csv"), "--controller", "csv", "--out", at("many.toml"));
  return at("many.toml");
}

/** A workbench of its own; ends with the case. */
export const workbench = (study, atEnd) => served([study], {}, join(study, "../.."), atEnd);

/** The page on which a study is made, started in a folder; `dir` keeps the list of earlier studies. */
export const startPage = (folder, dir, atEnd) => served([], { cwd: folder }, dir, atEnd);

async function served(study, options, dir, atEnd) {
  // the list of earlier studies is not that of the person who runs the tests
  const env = { ...process.env, XDG_DATA_HOME: join(dir, "data") };
  const child = spawn(process.env.AXISCAL, ["--json", "workbench", ...study, "--no-open"], { stdio: ["ignore", "pipe", "inherit"], env, ...options });
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
  page.on("console", (m) => { if (m.type() === "error") seen.errors.push(m.text()); });
  page.on("pageerror", (e) => seen.errors.push(String(e.stack ?? e)));
  page.on("request", (r) => seen.asked.push(r.url()));
  return [page, seen];
}

/** A screenshot for the eye, and for the guide where that is asked for. */
export async function picture(page, { out, pictures }, name) {
  const shot = await page.screenshot({ path: join(out, `${name}.png`) });
  if (pictures) writeFileSync(join(pictures, `${name}.png`), smaller(shot));
}

/** No fault that axe calls serious or critical. */
export async function accessible(page, what) {
  // scripts of others are forbidden in the page: this one comes through the driver
  await page.evaluate(AXE);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  const bad = violations.filter((v) => ["serious", "critical"].includes(v.impact));
  const words = bad.map((v) => `${v.id} (${v.impact}): ${v.help}\n${v.nodes.slice(0, 4).map((n) => `    ${n.html.slice(0, 200)}\n      ${n.failureSummary?.split("\n").slice(1, 3).join(" ")}`).join("\n")}`);
  holds(!bad.length, `${what}: axe finds\n${words.join("\n")}`);
}
