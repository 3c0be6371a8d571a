// The list of effects: what is in the model, and what the touches say of every other one, with a switch for each.

import { later, never } from "./later.js";
import { state, on, setPreview, step, trouble, tryOut } from "./talk.js";
import { byId, chance, element, show, significant, sized, stated } from "./words.js";

const FEW = 12;
let all = false;
let opened = null;

function toggle(effect, isOn, disabled) {
  return element("button", {
    type: "button", role: "switch", "aria-checked": String(isOn), "aria-label": `${effect.name} (${effect.id})`,
    "data-switch": effect.id, disabled, click: async (e) => {
      const id = e.currentTarget.dataset.switch;
      await step({ switch: { effect: id, on: !isOn } });
      // the row has moved to the other list: the keyboard goes along
      draw();
      document.querySelector(`[data-switch="${CSS.escape(id)}"]`)?.focus();
    },
  }, element("span", { "aria-hidden": "true" }));
}

/** How an effect stands to the test with all of them counted in, and beside the first candidate. */
function standing(id, score) {
  if (!score.passes) return "no more than noise";
  const found = state.behind?.diagnosis;
  if (candidate(id)?.proposed) return "passes the test: proposed";
  const first = found?.candidates[0];
  if (!found || first?.effect === id || first?.same_as.includes(id)) return "passes the test";
  return first?.proposed ? "passes the test: explains part, less than the first" : "passes the test";
}

/** What the diagnosis adds to the score of an effect. */
function candidate(id) {
  return state.behind?.diagnosis?.candidates.find((c) => c.effect === id);
}

function row(effect, score) {
  const { live } = state;
  const isOn = live.effects.includes(effect.id);
  const item = element("li", { "data-effect": effect.id, class: score?.passes ? "proposed" : null });
  const isOpen = opened === effect.id;
  const open = element("button", {
    type: "button", class: "open", "aria-expanded": String(isOpen), click: () => (opened === effect.id ? close() : look(effect.id)),
  }, effect.name);
  const what = element("div", { class: "what" }, open, element("small", {}, effect.id));
  item.append(element("div", { class: "head" }, toggle(effect, isOn, isOn && live.effects.length === 1), what));
  if (isOn) {
    const own = live.parameters.filter((p) => p.effect === effect.id).slice(0, 6);
    if (own.length) what.append(element("small", {}, own.map((p) => (p.sigma || p.status === "fixed" ? `${p.name} ${stated(p.value, p.sigma)} ${p.unit}` : `${p.name} not determined`)).join(", ")));
  } else if (score) {
    const strength = score.visible ? Math.min(1, Math.max(0, -score.ln_p / Math.LN10 / 20)) : 0;
    const bar = element("i");
    bar.style.width = `${100 * strength}%`;
    const first = score.parameters[0];
    const words = score.visible
      ? `${standing(effect.id, score)}; probability ${chance(score.p_adjusted, score.ln_p)}${first ? `; ${first.name} about ${stated(first.value, first.sigma)} ± ${significant(first.sigma, 2)} ${first.unit}` : ""}`
      : "has no effect on these touches";
    const found = candidate(effect.id);
    const same = [...(found?.same_as ?? []), ...(found?.or_else ? [found.or_else] : [])];
    what.append(element("div", { class: "bar", "aria-hidden": "true" }, bar), element("small", {}, words));
    if (same.length) what.append(element("small", {}, `cannot be separated from ${same.join(", ")}`));
  }
  if (isOpen) item.append(details(effect, isOn));
  return item;
}

function details(effect, isOn) {
  const found = candidate(effect.id);
  const box = element("div", { class: "details" });
  const line = (word, text) => text && box.append(element("p", {}, element("strong", {}, `${word}: `), text));
  line("What it is", effect.says);
  line("Check at the machine", effect.look);
  line("How to correct it", effect.mends);
  line("What separates them", found?.tell_apart);
  const preview = state.preview;
  if (!isOn && preview?.effect === effect.id) {
    const sizes = preview.parameters.map((p) => sized(p)).join(", ");
    line("With it", `${significant(preview.rms_before_um)} → ${significant(preview.rms_after_um)} µm RMS${sizes ? `; ${sizes}` : ""}`);
  }
  return box;
}

async function look(id) {
  opened = id;
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

function matches(e) {
  const wanted = byId("find").value.trim().toLowerCase();
  return !wanted || `${e.id} ${e.name} ${e.says} ${e.family}`.toLowerCase().includes(wanted);
}

/** The list of what is in the model; the other one is long. */
function drawModel() {
  const { live, inputs, behind } = state;
  const byName = new Map(inputs.effects.map((e) => [e.id, e]));
  const effects = live.effects.map((id) => byName.get(id)).filter((e) => e && matches(e));
  byId("in-model").replaceChildren(...effects.map((e) => row(e, null)));
  const working = behind?.version !== live.version || !behind.complete;
  show("evidence-state", working ? "working out what the touches say of each effect …" : "");
  byId("candidates").dataset.complete = String(!working);
}

function draw() {
  never("effects");
  if (!state.live) return;
  keepFocus(() => {
    const { live, inputs, behind } = state;
    const wanted = byId("find").value.trim();
    const byName = new Map(inputs.effects.map((e) => [e.id, e]));
    const current = behind?.version === live.version;
    const scores = current && behind.scores ? behind.scores : [];
    const ranked = rank(scores);
    const known = new Set(ranked.map((s) => s.effect));
    let rest = ranked.map((s) => [byName.get(s.effect), s]).filter(([e]) => e);
    for (const e of inputs.effects) {
      if (!known.has(e.id) && !live.effects.includes(e.id) && (!e.paper || wanted)) rest.push([e, null]);
    }
    rest = rest.filter(([e]) => matches(e) && !live.effects.includes(e.id));
    const shown = all || wanted ? rest : rest.slice(0, FEW);
    byId("candidates").replaceChildren(...shown.map(([e, s]) => row(e, s)));
    byId("more").hidden = Boolean(wanted) || rest.length <= FEW;
    show("more", all ? "Show the strongest only" : `Show all ${rest.length} effects`);
    drawModel();
  });
}

/** The diagnosis knows more than one score: its candidates come first, in its order. */
function rank(scores) {
  const first = state.behind?.diagnosis?.candidates.map((c) => c.effect) ?? [];
  const place = (s) => { const i = first.indexOf(s.effect); return i < 0 ? first.length : i; };
  return [...scores].sort((a, b) => place(a) - place(b));
}

byId("find").addEventListener("input", draw);
byId("more").addEventListener("click", () => { all = !all; draw(); });
on("live", (live, newer, first) => {
  if (newer && opened && live.effects.includes(opened)) opened = null;
  if (!newer || first) {
    draw();
    return;
  }
  keepFocus(drawModel);
  later("effects", draw);
});
on("behind", draw);
on("preview", (preview) => {
  const box = byId("previewed");
  box.hidden = !preview;
  box.textContent = preview
    ? `Curve: what ${preview.effect} would explain, ${significant(preview.rms_before_um)} → ${significant(preview.rms_after_um)} µm RMS (Escape hides it)`
    : "";
  later("effects", draw);
});
