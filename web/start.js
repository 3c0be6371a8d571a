// The page before a study is open: files are given a part, and the server makes a study of them.

import { ask, lines, upload } from "./ask.js";
import { byId, element } from "./words.js";

const ROLES = { plan: "plan", log: "log or touches", centres: "sphere centres", machines: "machines file", effects: "own effects" };
const offer = await ask("/api/start").catch((error) => { trouble(error); return null; });

/** The files that were chosen: { file, role, text: its beginning }. */
let chosen = [];
let named = false;

function trouble(error) {
  byId("messages").textContent = error ? lines(error).join("\n") : "";
}

// ---------------------------------------------------------------- what a file is
const machinesIn = (text) => [...text.matchAll(/^\s*\[\[machine\]\][^[]*?^\s*name\s*=\s*("(?:[^"\\]|\\.)*")/gm)].map((m) => unquoted(m[1]));

/** A quoted word of TOML, whose escapes are those of JSON. */
function unquoted(word) {
  try {
    return JSON.parse(word);
  } catch {
    return word.slice(1, -1);
  }
}

/** Why a file cannot be taken, or nothing. */
function refusalOf(name, text) {
  if (text.includes("\0") || /\.(png|jpe?g|gif|webp|pdf|zip|docx?|xlsx?)$/i.test(name)) return "it is no text: plans, logs, CSV and TOML files are read";
  if (!text.trim()) return "it is empty";
  if (/\.toml$/i.test(name) && /^\s*\[\[data\]\]/m.test(text)) return `it is a study already: open it with “axiscal workbench ${name}” in its folder, or drop the plans and logs that it names`;
  return null;
}

function roleOf(name, text) {
  if (/\.json$/i.test(name)) return "plan";
  if (/\.toml$/i.test(name)) return /^\s*\[\[effect\]\]/m.test(text) ? "effects" : "machines";
  const head = text.split(/\r?\n/).find((line) => line.trim() && !line.startsWith("#")) ?? "";
  const columns = head.split(/[,;\t]/).map((c) => c.trim().toLowerCase());
  const isTable = ["x", "y", "z"].every((axis) => columns.some((c) => c === axis || c.startsWith(`${axis}_`)));
  return isTable && !columns.includes("id") ? "centres" : "log";
}

const isTouches = (text) => /^\W*(?:\w+,)*id\b/im.test(text.split(/\r?\n/).find((l) => l.trim() && !l.startsWith("#")) ?? "");

function planOf(text) {
  try {
    const plan = JSON.parse(text);
    return { machine: String(plan.machine ?? ""), program: String(plan.program ?? "") };
  } catch {
    return { machine: "", program: "" };
  }
}

async function add(files) {
  trouble(null);
  const refused = [];
  for (const file of files) {
    const text = /\.json$/i.test(file.name) ? await file.text() : await file.slice(0, 2_000_000).text();
    const why = refusalOf(file.name, text);
    if (why) {
      refused.push(`${file.name} is not taken: ${why}`);
      continue;
    }
    const role = roleOf(file.name, text);
    chosen.push({ file, role, text, ...(role === "plan" ? planOf(text) : {}) });
  }
  if (refused.length) trouble({ lines: refused });
  show();
}

// ---------------------------------------------------------------- runs
const stem = (name) => name.replace(/\.plan\.json$|\.[^.]*$/i, "");
const of = (role) => chosen.filter((c) => c.role === role);

/** Plans with their logs: by the same name first, the others in the order in which they came. */
function runs() {
  const logs = of("log");
  const taken = new Set();
  const take = (fits) => { const found = logs.find((l) => !taken.has(l) && fits(l)); taken.add(found); return found; };
  const plans = of("plan").map((plan) => ({ plan, log: take((l) => stem(l.file.name) === stem(plan.file.name)) }));
  for (const run of plans) run.log ??= take((l) => stem(l.file.name).startsWith(stem(run.plan.file.name)));
  for (const run of plans) run.log ??= take(() => true);
  return plans;
}

function show() {
  const all = runs();
  const numberOf = (c) => { const k = all.findIndex((r) => r.plan === c || r.log === c); return k < 0 ? "" : String(k + 1); };
  byId("chosen").hidden = !chosen.length;
  byId("chosen").tBodies[0].replaceChildren(...chosen.map((c) => element("tr", {},
    element("th", { scope: "row" }, c.file.name),
    element("td", {}, element("select", { "aria-label": `what ${c.file.name} is`, change: (e) => { c.role = e.target.value; show(); } },
      ...Object.entries(ROLES).map(([role, says]) => element("option", { value: role, selected: role === c.role }, says)))),
    element("td", {}, ["plan", "log"].includes(c.role) ? numberOf(c) || "–" : ""),
    element("td", {}, element("button", { type: "button", "aria-label": `remove ${c.file.name}`, click: () => { chosen = chosen.filter((o) => o !== c); show(); byId("files").focus(); } }, "×")))));

  const own = of("machines").flatMap((m) => machinesIn(m.text));
  const select = byId("machine");
  const wanted = select.dataset.chosen || of("plan")[0]?.machine || select.value;
  const choices = of("machines").length ? own.map((name) => ({ name, says: "" })) : offer?.machines ?? [];
  select.replaceChildren(...choices.map((m) => element("option", { value: m.name, selected: m.name === wanted }, m.says ? `${m.name}: ${m.says}` : m.name)));

  const centres = of("centres").length > 0;
  byId("centres").hidden = !centres;
  byId("controller-field").hidden = centres;
  byId("known-field").hidden = centres;
  if (!byId("controller").dataset.chosen) byId("controller").value = of("log").length && of("log").every((l) => isTouches(l.text)) ? "csv" : "linuxcnc";
  const first = of("plan")[0];
  if (!named) byId("name").value = centres ? stem(of("centres")[0].file.name) : first ? [first.machine, ...new Set(of("plan").map((p) => p.program))].filter(Boolean).join("-") : "study";
  byId("make").disabled = !(centres || all.length);
  const missing = all.filter((r) => !r.log).map((r) => r.plan.file.name);
  const used = new Set(all.map((r) => r.log));
  const alone = centres ? [] : of("log").filter((l) => !used.has(l)).map((l) => l.file.name);
  byId("status").textContent = [missing.length ? `No log yet for ${missing.join(", ")}.` : "",
    alone.length ? `No plan yet for ${alone.join(", ")}: drop the .plan.json that was written beside its program.` : ""].filter(Boolean).join(" ");
}

// ---------------------------------------------------------------- what is asked of the server
const number = (name) => { const text = byId(name).value.trim().replace(",", "."); return text ? Number(text) : null; };
const point = (name) => { const text = byId(name).value.trim(); return text ? text.split(/[\s,;]+/).map(Number) : null; };

async function open(what, work) {
  trouble(null);
  byId("status").textContent = what;
  const buttons = [...document.querySelectorAll("button")].filter((b) => !b.disabled);
  for (const b of buttons) b.disabled = true;
  try {
    await work();
    // the same address now shows the study
    location.reload();
  } catch (error) {
    trouble(error);
    byId("status").textContent = "";
    for (const b of buttons) b.disabled = false;
  }
}

async function make() {
  const centres = of("centres").length > 0;
  const inOrder = [...runs().flatMap((r) => [r.plan, r.log]).filter(Boolean), ...chosen.filter((c) => !["plan", "log"].includes(c.role))];
  const left = of("log").filter((l) => !inOrder.includes(l));
  const files = [];
  for (const c of [...inOrder, ...left]) files.push({ role: c.role, ...(await upload(c.file)) });
  for (const [name, value] of [["sigma-um", number("sigma-um")], ["tool-length", number("tool-length")], ["sphere-at", point("sphere-at")], ["zero-at", point("zero-at")]]) {
    if (centres && value !== null && ![value].flat().every(Number.isFinite)) throw { messages: [{ message: `${document.querySelector(`label[for="${name}"]`).textContent}: ${byId(name).value} is no number`, help: "write for example 1.5, or 200, 0, -250 for a position" }] };
    if (Array.isArray(value) && value.length !== 3) throw { messages: [{ message: `${byId(name).value}: three numbers are needed`, help: "write X, Y and Z, for example 200, 0, -250" }] };
  }
  const word = (name) => byId(name).value.trim() || null;
  await ask("/api/start/new", {
    name: byId("name").value, machine: byId("machine").value, controller: centres ? null : byId("controller").value,
    known_blocks: !centres && byId("known").checked, files,
    centres: centres ? { unit: word("unit"), kind: word("kind"), position_of: word("position-of"), carrier: word("carrier"), sigma_um: number("sigma-um"), tool_length: number("tool-length"), sphere_at: point("sphere-at"), zero_at: point("zero-at") } : null,
  });
}

if (offer) {
  byId("folder").textContent = offer.folder;
  byId("controller").replaceChildren(...offer.controllers.map((c) => element("option", { value: c }, c === "csv" ? "csv: touches in the form of axiscal" : c)));
  byId("recent").replaceChildren(...(offer.recent.length ? offer.recent.map((r, k) => element("li", {}, element("button", { type: "button", click: () => open(`Opening ${r.name} …`, () => ask("/api/start/recent", { number: k })) }, r.name, element("small", {}, r.folder ?? "")))) : [element("li", { class: "muted" }, "none yet")]));
  show();
}
for (const name of ["machine", "controller"]) byId(name).addEventListener("change", (e) => { e.target.dataset.chosen = e.target.value; });
byId("name").addEventListener("input", () => { named = true; });
byId("files").addEventListener("change", async (e) => { await add([...e.target.files]); e.target.value = ""; });
byId("demo").addEventListener("click", () => open("The demo is being measured and solved …", () => ask("/api/start/demo", {})));
byId("form").addEventListener("submit", (e) => { e.preventDefault(); open("The study is being made …", make); });

const over = (e) => { e.preventDefault(); byId("drop").classList.toggle("over", e.type !== "dragleave" && e.type !== "drop"); };
for (const what of ["dragenter", "dragover", "dragleave"]) addEventListener(what, over);
addEventListener("drop", (e) => { over(e); add([...(e.dataTransfer?.files ?? [])]).catch(trouble); });
