// The formula box: an effect as a person types it, its curve over the residual, and the way into the effects file.

import { sketched, state, on, setPreview, step, tryOut } from "./talk.js";
import { shownAgain } from "./plots.js";
import { open } from "./tabs.js";
import { byId, element, show, significant, sized } from "./words.js";

let terms = 0;
let timer = null;

function dofs() {
  const at = byId("draft-at").value;
  return state.inputs.words.places.find((p) => p.at === at);
}

function fill(select, words, kept) {
  const before = kept ?? select.value;
  select.replaceChildren(...words.map((w) => element("option", { value: w }, w)));
  if (words.includes(before)) select.value = before;
}

function term(formula = "1 - cos(B)") {
  terms += 1;
  const n = terms;
  const label = (word, control, css) => element("label", { class: css }, word, control);
  const parameter = element("input", { "data-word": "parameter", value: n === 1 ? "size" : `size_${n}`, maxlength: 40, spellcheck: "false" });
  const unit = element("select", { "data-word": "unit" });
  const dof = element("select", { "data-word": "dof" });
  const typed = element("input", { "data-word": "formula", class: "formula", value: formula, maxlength: 500, spellcheck: "false", "aria-describedby": `caret-${n}` });
  const box = element("div", { class: "term" },
    element("div", { class: "row" }, label("factor", parameter), label("unit", unit), label("moves", dof), label("times the formula", typed, "grow"),
      n === 1 ? null : element("button", { type: "button", "aria-label": `take term ${n} away`, click: () => { box.remove(); typing(); } }, "×")),
    element("pre", { class: "caret", "aria-hidden": "true" }),
    element("p", { class: "mistake", id: `caret-${n}` }));
  fill(unit, state.inputs.words.units);
  byId("draft-terms").append(box);
  fill(dof, dofs().dofs, "dz");
  return box;
}

let shapes = 0;

/** A number inside the formulas that the fit looks for: a time constant, a period. */
function shape() {
  shapes += 1;
  const n = shapes;
  const label = (word, control) => element("label", {}, word, control);
  const typed = (word, more = {}) => element("input", { "data-word": word, "aria-describedby": `shape-${n}`, ...more });
  const number = (word, value) => typed(word, { type: "number", step: "any", size: 8, value });
  const unit = element("select", { "data-word": "unit", "aria-describedby": `shape-${n}` });
  const box = element("div", { class: "term" },
    element("div", { class: "row" }, label("number in the formula", typed("parameter", { value: n === 1 ? "tau" : `tau_${n}`, maxlength: 40, spellcheck: "false" })), label("unit", unit),
      label("the search begins at", number("start", 1)), label("not below", number("min")), label("not above", number("max")),
      element("button", { type: "button", "aria-label": `take number ${n} away`, click: () => { box.remove(); typing(); } }, "×")),
    element("p", { class: "mistake", id: `shape-${n}` }));
  fill(unit, state.inputs.words.units, "h");
  byId("draft-shapes").append(box);
  return box;
}

const word = (box, name) => box.querySelector(`[data-word=${name}]`).value;

/** An empty field is no number, and no limit. */
function limit(box, name) {
  const text = word(box, name).trim();
  return text === "" ? null : Number(text);
}

function draft() {
  const rows = [...byId("draft-terms").children];
  const numbers = [...byId("draft-shapes").children];
  const missing = numbers.flatMap((box, i) => (Number.isFinite(limit(box, "start") ?? NaN) ? []
    : [{ field: `shape.${i}.start`, message: "the search must begin somewhere", help: "write a number that may be about right" }]));
  if (missing.length) throw { mistakes: missing };
  return {
    ...(kept.per ? { per: kept.per } : {}), says: kept.says ?? "", look: kept.look ?? "",
    id: byId("draft-id").value.trim(), name: byId("draft-name").value.trim(), at: byId("draft-at").value,
    terms: rows.map((box) => ({ parameter: word(box, "parameter").trim(), unit: word(box, "unit"), dof: word(box, "dof"), formula: word(box, "formula"), ...(box.dataset.typical ? { typical: Number(box.dataset.typical) } : {}) })),
    shape: numbers.map((box) => ({ parameter: word(box, "parameter").trim(), unit: word(box, "unit"), start: limit(box, "start"), min: limit(box, "min"), max: limit(box, "max") })),
  };
}

/** What a sketch says beside the fields of the form. */
let kept = {};

export function openFormula() {
  open("plots");
  const isOpen = byId("formula").hidden;
  byId("formula").hidden = !isOpen;
  byId("multiples").hidden = isOpen;
  byId("own-formula").setAttribute("aria-expanded", String(isOpen));
  shownAgain();
  if (isOpen) {
    byId("draft-terms").querySelector("input.formula")?.focus();
    look();
  } else {
    looks += 1;
    setPreview(null);
    byId("own-formula").focus();
  }
}

/** Fills the form with the program's starting formula, and draws its curve. */
export async function sketch() {
  if (byId("formula").hidden) openFormula();
  clear();
  show("draft-answer", "looking for a formula …");
  looks += 1;
  try {
    const { draft: made, says } = await sketched();
    kept = made;
    byId("draft-id").value = made.id;
    byId("draft-name").value = made.name;
    byId("draft-at").value = made.at;
    show("draft-at-says", says);
    byId("draft-terms").replaceChildren();
    byId("draft-shapes").replaceChildren();
    for (const t of made.terms) {
      const box = term(t.formula);
      for (const field of ["parameter", "unit", "dof"]) box.querySelector(`[data-word=${field}]`).value = t[field];
      if (t.typical) box.dataset.typical = t.typical;
    }
    for (const s of made.shape) {
      const box = shape();
      for (const field of ["parameter", "unit", "start", "min", "max"]) box.querySelector(`[data-word=${field}]`).value = s[field] ?? "";
    }
    await look();
  } catch (error) {
    failed(error);
  }
}

function clear() {
  for (const at of byId("draft").querySelectorAll("[aria-invalid]")) at.removeAttribute("aria-invalid");
  for (const at of byId("draft").querySelectorAll(".caret, .mistake")) at.textContent = "";
}

/** Each mistake stands below the field that it is about, with a mark below the signs that are wrong. */
function mark(mistakes) {
  const rest = [];
  for (const m of mistakes) {
    const words = m.help ? `${m.message}: ${m.help}` : m.message;
    const [kind, n, field] = m.field.split(".");
    const rows = { terms: "draft-terms", shape: "draft-shapes" }[kind];
    const box = rows ? byId(rows).children[Number(n)] : null;
    const input = box ? box.querySelector(`[data-word=${field}]`) : kind ? byId(`draft-${kind}`) : null;
    if (input) input.setAttribute("aria-invalid", "true");
    if (box) {
      box.querySelector(".mistake").textContent = words;
      if (m.from !== undefined) {
        box.querySelector(".caret").textContent = `${[...input.value].join("")}\n${" ".repeat(m.from)}${"^".repeat(Math.max(1, m.to - m.from))}`;
      }
    } else {
      rest.push(words);
    }
  }
  show("draft-answer", rest.join("\n"));
}

/** What can be fitted and may not be what is meant stands below its row. */
function hint(hints) {
  for (const h of hints) {
    const [, n] = h.field.split(".");
    byId("draft-terms").children[Number(n)].querySelector(".mistake").textContent = `${h.message}: ${h.help}`;
  }
}

function failed(error) {
  if (error.mistakes) mark(error.mistakes);
  else show("draft-answer", (error.messages ?? [{ message: String(error) }]).map((m) => (m.help ? `${m.message}: ${m.help}` : m.message)).join("\n"));
}

let looks = 0;

/** What is shown belongs to the fields as they are: an answer to older ones is thrown away, and with a mistake in the fields goes the curve. */
async function look() {
  const mine = ++looks;
  clear();
  setPreview(null);
  try {
    const found = await tryOut({ draft: draft() });
    if (mine !== looks) return;
    const sizes = found.parameters.map(sized);
    hint(found.hints);
    show("draft-answer", `with it ${significant(found.rms_before_um)} → ${significant(found.rms_after_um)} µm RMS; ${sizes.join(", ")}`);
  } catch (error) {
    if (mine === looks) failed(error);
  }
}

function typing() {
  clearTimeout(timer);
  looks += 1; // what is on its way is about other fields
  timer = setTimeout(look, 250);
}

async function save(isOn) {
  clearTimeout(timer);
  looks += 1;
  clear();
  let wanted;
  try {
    wanted = draft();
    // mistakes are shown in their place before anything is written
    await tryOut({ draft: wanted });
  } catch (error) {
    failed(error);
    return;
  }
  const saved = await step({ save: { draft: wanted, on: isOn } });
  if (saved && isOn) openFormula();
  else if (saved) show("draft-answer", `saved in ${state.inputs.effects_file}`);
}

byId("formula-close").addEventListener("click", openFormula);
byId("formula").addEventListener("keydown", (e) => { if (e.key === "Escape") openFormula(); });
byId("draft").addEventListener("submit", (e) => { e.preventDefault(); look(); });
byId("draft-terms").addEventListener("input", typing);
byId("draft-shapes").addEventListener("input", typing);
byId("draft-at").addEventListener("change", () => {
  const place = dofs();
  show("draft-at-says", place.says);
  for (const select of byId("draft-terms").querySelectorAll("[data-word=dof]")) fill(select, place.dofs);
  typing();
});
byId("draft-more").addEventListener("click", () => term("1").querySelector("[data-word=formula]").focus());
byId("draft-shape").addEventListener("click", () => shape().querySelector("[data-word=parameter]").select());
byId("draft-save").addEventListener("click", () => save(false));
byId("draft-save-on").addEventListener("click", () => save(true));

let known = null;
on("live", () => {
  if (known === state.inputs) return;
  known = state.inputs;
  const { words } = known;
  const select = byId("draft-at");
  const rotary = known.machine.axes.find((a) => a.rotary)?.name;
  fill(select, words.places.map((p) => p.at), select.value || rotary);
  show("draft-at-says", dofs().says);
  if (terms === 0) term(rotary ? `1 - cos(${rotary})` : "1");
  const range = (r) => (r ? (r[0] === r[1] ? `always ${significant(r[0])}` : `${significant(r[0])} to ${significant(r[1])}`) : "");
  const rows = words.variables.map((v) => element("tr", {}, element("td", {},
    element("button", { type: "button", "aria-label": `put ${v.name} into the formula`, click: () => insert(v.name) }, v.name)),
    element("td", { class: "word" }, v.says), element("td", {}, range(v.range))));
  const table = byId("draft-words");
  table.replaceChildren(table.caption, element("thead", {}, element("tr", {}, ["word", "what it is", "in these touches"].map((h) => element("th", { scope: "col" }, h)))), element("tbody", {}, rows));
  show("draft-functions", `Functions: ${words.functions.join(" ")}; pi is a constant. Angles are in radians.`);
});

function insert(word) {
  const inputs = byId("draft-terms").querySelectorAll("input.formula");
  const at = inputs[inputs.length - 1];
  at.setRangeText(word, at.selectionStart, at.selectionEnd, "end");
  at.focus();
  typing();
}
