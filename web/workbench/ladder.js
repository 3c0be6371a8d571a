// The error of each model as falling steps above the noise. A click on a step goes back to its model.

import { later } from "./later.js";
import { state, on, step } from "./talk.js";
import { byId, element, significant } from "./words.js";

/** What a step changed, in words. */
export function nameOf(s, i) {
  const name = (id) => state.inputs.effects.find((e) => e.id === id)?.name ?? id;
  const parts = [...s.added.map((e) => `+ ${name(e)}`), ...s.removed.map((e) => `− ${name(e)}`)];
  return parts.join(", ") || (i ? "same effects" : "first model");
}

const same = (a, b) => a.length === b.length && a.every((e) => b.includes(e));
const HIGH = 44;

/** A model that was there before is no new step: who goes back to it stands on its step, with its newest figures. */
const different = (steps) => steps.filter((s, i) => !steps.slice(0, i).some((earlier) => same(earlier.effects, s.effects)))
  .map((s) => ({ ...steps.findLast((later) => same(later.effects, s.effects)), added: s.added, removed: s.removed }));

function draw() {
  const { live } = state;
  const steps = different(live.ladder.steps);
  const sizes = [...steps.map((s) => s.rms_um), live.noise_um].filter((v) => v > 0);
  const [low, high] = [0.8 * Math.min(...sizes), Math.max(...sizes)];
  // equal steps for equal ratios: a small remaining error stays visible beside a large one
  const top = (um) => 14 + HIGH * (1 - Math.log(Math.max(um, low) / low) / Math.log(high / low || 2));
  const now = steps.findIndex((s) => same(s.effects, live.effects));
  const each = steps.map((s, i) => {
    const name = nameOf(s, i);
    const line = element("span", { class: "step" });
    line.style.top = `${top(s.rms_um)}px`;
    const um = element("span", { class: "um" }, `${significant(s.rms_um)} µm`);
    um.style.top = `${top(s.rms_um) - 15}px`;
    const button = element("button", {
      type: "button", class: i === now ? (s.rms_um <= 1.15 * live.noise_um ? "now good" : "now") : null, title: `${name}: ${significant(s.rms_um)} µm RMS${s.held_out_rms_um ? `, cross-validated ${significant(s.held_out_rms_um)} µm` : ""}`,
      "aria-current": i === now ? "step" : null,
      "data-effects": s.effects.join(" "), click: () => { if (i !== now) step({ model: { effects: s.effects } }); },
    }, line, um, " ", element("span", { class: "name" }, name), element("span", { class: "unseen" }, i === now ? ", the present model" : ", go back to this model"));
    return button;
  });
  const noise = element("span", { class: "noise", "aria-hidden": "true" }, "noise");
  noise.style.top = `${top(live.noise_um)}px`;
  const box = byId("ladder");
  box.replaceChildren(...each, noise, element("span", { class: "space", "aria-hidden": "true" }));
  box.dataset.steps = steps.length;
  // the line of the noise goes below all steps, also below those that are out of sight
  noise.style.width = `${box.scrollWidth}px`;
  const present = each[now];
  if (present) box.scrollLeft = present.offsetLeft + present.offsetWidth - box.clientWidth + (now === each.length - 1 ? 40 : 0);
  table(steps);
}

function table(steps) {
  const head = element("tr", {}, ["model", "remaining error, µm", "cross-validated, µm", "χ²/dof"].map((h) => element("th", { scope: "col" }, h)));
  const rows = steps.map((s, i) => element("tr", {}, [`${i + 1}. ${nameOf(s, i)}`, significant(s.rms_um), significant(s.held_out_rms_um), significant(s.chi2_per_dof)].map((v) => element("td", {}, v))));
  const at = byId("ladder-table");
  at.replaceChildren(at.caption, element("thead", {}, head), element("tbody", {}, rows));
}

let drawn = "";
on("live", (live) => later("ladder", () => {
  const now = JSON.stringify([live.ladder, live.effects]);
  if (now !== drawn && live === state.live) { drawn = now; draw(); }
}));
