// The candidates, best first: those that these touches cannot separate stand together. Each has its small curve. Below: what is in the model.

import { later, never } from "./later.js";
import { expectation, state, on, setPreview, step, trouble, tryOut } from "./talk.js";
import { DIRECTIONS, curvePoints, expect, expectNothing, follow, membersOf, onAxis, values, variable } from "./plots.js";
import { byId, chance, colour, element, show, significant, sized, stated, unitOf } from "./words.js";

/** Cards that are shown at once. */
const FEW = 6;

let all = false;
let opened = null;
/** Did the person choose a candidate of this model, or close one? Otherwise the first one is shown. */
let chosenFor = 0;
/** What each candidate would take away, of the present model. */
let tried = new Map();

function toggle(effect, isOn, disabled) {
  return element("button", {
    type: "button", role: "switch", "aria-checked": String(isOn), "aria-label": `${effect.name} (${effect.id})`, "data-switch": effect.id, disabled,
    click: async (e) => {
      const id = e.currentTarget.dataset.switch;
      const byKey = e.detail === 0;
      await switchEffect(id, !isOn);
      // the row has moved to the other list: the keyboard goes along
      draw();
      if (byKey && !isOn) byId("model").open = true;
      document.querySelector(`[data-switch="${CSS.escape(id)}"]`)?.focus();
    },
  }, isOn ? "Remove" : "Add");
}

/** Puts an effect into the model, or takes it out. What one linear step leaves is what the marks show until it is fitted. */
export async function switchEffect(id, isOn) {
  let curve = isOn ? tried.get(id) : null;
  const began = performance.now();
  const made = step({ switch: { effect: id, on: isOn } }, async () => {
    if (isOn) curve ??= await expectation(id);
    if (!curve) return;
    expect(curve);
    requestAnimationFrame(() => { window.axiscalExpected = performance.now() - began; });
  });
  if (!await made && curve) expectNothing();
}

/** What the diagnosis says of an effect. */
const candidate = (id) => state.behind?.diagnosis?.candidates.find((c) => c.effect === id);

function opener(effect) {
  return element("button", { type: "button", class: "open", "aria-expanded": String(opened === effect.id), click: () => (opened === effect.id ? close() : look(effect.id)) }, effect.name);
}

/** How an effect stands: in words, with its expected size. */
function standing(effect, score) {
  if (!score) return "not tested yet";
  if (!score.visible) return "has no effect on these touches";
  const found = state.behind?.diagnosis;
  const first = found?.candidates[0];
  const isFirst = found?.candidates.some((c, k) => (k === 0 || c.proposed) && (c.effect === effect.id || c.same_as.includes(effect.id)));
  const named = candidate(effect.id);
  const extra = named?.proposed ? (named.together_with ? ", proposed together with another" : ", proposed") : score.passes && first?.proposed && !isFirst ? ", explains less than the first" : "";
  // of several sizes the one that stands out most
  const certainty = (p) => Math.abs(p.value) / p.sigma || 0;
  const size = score.parameters.reduce((best, p) => (!best || certainty(p) > certainty(best) ? p : best), null);
  return `${score.likely}${extra}${size ? `; ${size.name} about ${stated(size.value, size.sigma)} ± ${significant(size.sigma, 2)} ${unitOf(size.unit)}` : ""}`;
}

function card(effect, score, same, byName) {
  const isOpen = opened === effect.id;
  const canvas = element("canvas", { "aria-hidden": "true", "data-curve": effect.id, hidden: !tried.has(effect.id) });
  const item = element("li", { "data-effect": effect.id, class: [candidate(effect.id)?.proposed ? "proposed" : "", isOpen ? "chosen" : ""].join(" ").trim() || null },
    element("div", { class: "head" }, opener(effect), toggle(effect, false, false)),
    element("div", { class: "evidence" }, canvas, element("small", { title: score ? `probability of so much from noise alone, all effects counted in: ${chance(score.p_adjusted, score.ln_p)}` : null }, standing(effect, score))));
  if (isOpen) item.append(details(effect));
  if (same.length) {
    const others = same.map((id) => byName.get(id)).filter(Boolean);
    item.append(element("small", {}, "These touches cannot separate it from:"),
      element("ul", { class: "same" }, others.map((e) => element("li", { "data-effect": e.id }, opener(e), toggle(e, false, false)))));
    const other = others.find((e) => e.id === opened);
    if (other) item.append(details(other));
  }
  return item;
}

function details(effect) {
  const found = candidate(effect.id);
  const box = element("div", { class: "details" });
  const preview = state.preview;
  if (preview?.effect === effect.id) {
    const sizes = preview.parameters.map((p) => sized(p)).join(", ");
    box.append(element("p", {}, element("strong", {}, "With it: "), `${significant(preview.rms_before_um)} → ${significant(preview.rms_after_um)} µm RMS${sizes ? `; ${sizes}` : ""}`));
  }
  const lines = [["What it is", effect.says], ["Check", effect.look], ["How to correct it", effect.mends], ["What separates them", found?.tell_apart]].filter(([, text]) => text);
  box.append(element("details", {}, element("summary", {}, "Check at the machine"), lines.map(([word, text]) => element("p", {}, element("strong", {}, `${word}: `), text))));
  return box;
}

function inModel(effect) {
  const { live } = state;
  const own = live.parameters.filter((p) => p.effect === effect.id).slice(0, 3);
  const words = own.map((p) => (p.sigma || p.status === "fixed" ? `${p.name} ${stated(p.value, p.sigma)} ${unitOf(p.unit)}` : `${p.name} not determined`)).join(", ");
  const item = element("li", { "data-effect": effect.id }, element("div", { class: "head" }, opener(effect), toggle(effect, true, live.effects.length === 1)), words ? element("small", {}, words) : null);
  if (opened === effect.id) item.append(details(effect));
  return item;
}

async function look(id) {
  opened = id;
  chosenFor = state.live.version;
  draw();
  refocus(id);
  if (state.live.effects.includes(id)) return;
  try {
    await tryOut({ effect: id });
  } catch (error) {
    trouble(error);
  }
}

function close() {
  const id = opened;
  opened = null;
  chosenFor = state.live.version;
  setPreview(null);
  draw();
  refocus(id);
}

function refocus(id) {
  document.querySelector(`[data-effect="${CSS.escape(id)}"] .open`)?.focus();
}

/** The keyboard stays where it is when a list is drawn again. */
function keepFocus(work) {
  const at = document.activeElement;
  const id = at?.closest?.("[data-effect]")?.dataset.effect;
  const which = at?.matches?.("[role=switch]") ? "[role=switch]" : ".open";
  work();
  if (id) document.querySelector(`[data-effect="${CSS.escape(id)}"] ${which}`)?.focus({ preventScroll: true });
}

const searched = () => byId("find").value.trim().toLowerCase();
const matches = (e) => `${e.id} ${e.name} ${e.says} ${e.family}`.toLowerCase().includes(searched());

function drawModel() {
  const { live, inputs, behind } = state;
  const byName = new Map(inputs.effects.map((e) => [e.id, e]));
  const model = live.effects.map((id) => byName.get(id) ?? { id, name: id, says: "" });
  byId("in-model").replaceChildren(...model.filter((e) => !searched() || matches(e)).map(inModel));
  show("model-count", String(model.length));
  const working = behind?.version !== live.version || !behind.complete;
  const some = behind?.scores?.some((s) => s.passes);
  show("evidence-state", working ? "testing every effect on these touches …" : some ? "" : "No effect that is not in the model is beyond the noise.");
  byId("candidates").dataset.complete = String(!working);
}

function draw() {
  never("effects");
  if (!state.live) return;
  keepFocus(() => {
    const { live, inputs, behind } = state;
    const byName = new Map(inputs.effects.map((e) => [e.id, e]));
    const scores = behind?.version === live.version && behind.scores ? behind.scores : [];
    const ranked = rank(scores);
    const scoreOf = new Map(ranked.map((s) => [s.effect, s]));
    const grouped = new Set();
    const cards = [];
    const listed = [...ranked.map((s) => s.effect), ...inputs.effects.filter((e) => !scoreOf.has(e.id) && (!e.paper || searched())).map((e) => e.id)];
    for (const id of listed) {
      const effect = byName.get(id);
      if (!effect || live.effects.includes(id) || grouped.has(id)) continue;
      const found = candidate(id);
      const same = (found?.same_as ?? []).filter((s) => byName.has(s) && !live.effects.includes(s));
      if (searched() && !matches(effect) && !same.some((s) => matches(byName.get(s)))) continue;
      same.forEach((s) => grouped.add(s));
      cards.push([effect, scoreOf.get(id), same]);
    }
    const shown = all || searched() ? cards : cards.slice(0, FEW);
    byId("candidates").replaceChildren(...shown.map(([e, s, same]) => card(e, s, same, byName)));
    byId("more").hidden = Boolean(searched()) || cards.length <= FEW;
    show("more", all ? "Show the strongest only" : `Show all ${cards.length} effects`);
    drawModel();
    drawCurves();
  });
}

/** The diagnosis knows more than one score: its candidates come first, in its order. */
function rank(scores) {
  const first = state.behind?.diagnosis?.candidates.map((c) => c.effect) ?? [];
  const place = (s) => { const i = first.indexOf(s.effect); return i < 0 ? first.length : i; };
  return [...scores].sort((a, b) => place(a) - place(b));
}

/** What each of the first candidates takes away, against the variable of the large plot; all on one scale. */
function drawCurves() {
  const x = values(variable().id);
  const all = [...byId("candidates").querySelectorAll("canvas")].map((canvas) => {
    const um = tried.get(canvas.dataset.curve);
    canvas.hidden = !um;
    return um && { canvas, lines: DIRECTIONS.map((_, d) => curvePoints(membersOf(d), x, um, 12)) };
  }).filter(Boolean);
  const top = all.reduce((most, { lines }) => lines.reduce((m, l) => l.y.reduce((h, v) => Math.max(h, Math.abs(v)), m), most), 1e-9);
  for (const { canvas, lines } of all) {
    const [wide, high, dots] = [72, 30, globalThis.devicePixelRatio || 1];
    canvas.width = wide * dots;
    canvas.height = high * dots;
    const pen = canvas.getContext("2d");
    pen.scale(dots, dots);
    const xs = lines.flatMap((l) => l.x);
    const [low, far] = [Math.min(...xs), Math.max(...xs)];
    pen.fillStyle = colour("grid");
    pen.fillRect(0, high / 2, wide, 1);
    lines.forEach((line, d) => {
      pen.strokeStyle = colour(DIRECTIONS[d].toLowerCase());
      pen.lineWidth = 1.5;
      pen.beginPath();
      line.x.forEach((v, k) => {
        const [px, py] = [2 + ((v - low) / (far - low || 1)) * (wide - 4), high / 2 - (line.y[k] / top) * (high / 2 - 2)];
        if (k) pen.lineTo(px, py); else pen.moveTo(px, py);
      });
      pen.stroke();
    });
  }
}

byId("find").addEventListener("input", draw);
byId("more").addEventListener("click", () => { all = !all; draw(); });
on("live", (live, newer, first) => {
  if (newer) {
    tried = new Map();
    opened = null;
  }
  if (!newer || first) return draw();
  keepFocus(drawModel);
  later("effects", draw);
});
on("behind", (behind) => {
  for (const s of behind.scores ?? []) if (s.curve_um && !tried.has(s.effect)) tried.set(s.effect, s.curve_um);
  draw();
  if (!behind.complete) return;
  const best = behind.diagnosis?.candidates[0];
  // the curve of the best candidate is there without a click
  if (best?.proposed && chosenFor !== state.live.version && !state.preview && byId("formula").hidden) {
    opened = best.effect;
    follow();
    draw();
    tryOut({ effect: best.effect }).catch(trouble);
  }
});
on("preview", (preview) => {
  const box = byId("previewed");
  box.hidden = !preview;
  const name = state.inputs?.effects.find((e) => e.id === preview?.effect)?.name ?? preview?.effect;
  box.textContent = preview ? `Curve: ${name}, ${significant(preview.rms_before_um)} → ${significant(preview.rms_after_um)} µm RMS` : "";
  if (preview) tried.set(preview.effect, preview.curve_um);
  later("effects", draw);
});
onAxis(drawCurves);
