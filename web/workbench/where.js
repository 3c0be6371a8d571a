// Where the model fails: a share for each variable and direction, and a small plot for each variable. A click sets the large plot.

import { later } from "./later.js";
import { state, on } from "./talk.js";
import { DIRECTIONS, curvePoints, lookAt, membersOf, onAxis, sides, values, variable } from "./plots.js";
import { byId, colour, element } from "./words.js";

const shortName = (v) => (v.id.length === 1 ? `axis ${v.id}` : v.id === "time" ? "time" : v.id === "order" ? "order" : v.id === "approach" ? "approach" : v.id);
const percent = (share) => `${Math.round(100 * share)} %`;

function shareOf(id) {
  return state.live.explained.find((e) => e.variable === id)?.share ?? [null, null, null];
}

function table() {
  const now = variable().id;
  const rows = state.inputs.variables.map((v) => {
    const cells = shareOf(v.id).map((share, d) => {
      if (share === null) return element("td", {}, "");
      const button = element("button", { type: "button", title: `${v.title}: ${percent(share)} of the residual in ${DIRECTIONS[d]}`, "aria-label": `${v.title}, direction ${DIRECTIONS[d]}: ${percent(share)}`, click: () => lookAt(v.id, [d]) }, percent(share));
      button.style.background = `color-mix(in srgb, var(--focus) ${Math.round(55 * share)}%, var(--raised))`;
      return element("td", {}, button);
    });
    return element("tr", {}, element("th", { scope: "row", title: v.title }, v.id === now ? element("strong", {}, shortName(v)) : shortName(v)), cells);
  });
  const at = byId("where-table");
  at.replaceChildren(at.caption, element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "depends on"), DIRECTIONS.map((d) => element("th", { scope: "col" }, d)))), element("tbody", {}, rows));
  at.dataset.version = state.live.version;
}

/** All marks, and the mean at each position, as a picture of a stamp's size. */
function stamp(canvas, id) {
  const [wide, high, dots] = [canvas.clientWidth || 80, canvas.clientHeight || 46, globalThis.devicePixelRatio || 1];
  canvas.width = wide * dots;
  canvas.height = high * dots;
  const pen = canvas.getContext("2d");
  pen.scale(dots, dots);
  const x = values(id);
  const r = state.live.residual_um;
  const out = new Set(state.live.rejected.map(([i]) => i));
  let [low, high_, top] = [Infinity, -Infinity, 1e-9];
  x.forEach((v, i) => { if (v !== null && !out.has(i)) { low = Math.min(low, v); high_ = Math.max(high_, v); top = Math.max(top, Math.abs(r[i])); } });
  const across = (v) => 2 + ((v - low) / (high_ - low || 1)) * (wide - 4);
  const up = (y) => high / 2 - (y / top) * (high / 2 - 2);
  pen.fillStyle = colour("grid");
  pen.fillRect(0, high / 2, wide, 1);
  const step = Math.max(1, Math.ceil(x.length / 700));
  for (const [d, name] of DIRECTIONS.entries()) {
    const own = membersOf(d).filter((i) => !out.has(i) && x[i] !== null);
    pen.fillStyle = colour(name.toLowerCase());
    pen.strokeStyle = pen.fillStyle;
    pen.globalAlpha = 0.35;
    own.forEach((i, k) => { if (k % step === 0) pen.fillRect(across(x[i]) - 1, up(r[i] * sides[i].sign) - 1, 2, 2); });
    pen.globalAlpha = 1;
    const line = curvePoints(own, x, r, 14);
    pen.beginPath();
    line.x.forEach((v, k) => (k ? pen.lineTo(across(v), up(line.y[k])) : pen.moveTo(across(v), up(line.y[k]))));
    pen.lineWidth = 1.5;
    pen.stroke();
  }
}

let made = null;
let buttons = [];

function multiples() {
  const box = byId("multiples");
  if (made !== state.inputs) {
    made = state.inputs;
    buttons = state.inputs.variables.map((v) => {
      const canvas = element("canvas", { "aria-hidden": "true" });
      return { v, canvas, button: element("button", { type: "button", "data-variable": v.id, title: v.title, click: () => lookAt(v.id, [0, 1, 2]) }, canvas, element("span", {}, shortName(v))) };
    });
    box.replaceChildren(...buttons.map((b) => b.button));
  }
  mark();
  for (const b of buttons) stamp(b.canvas, b.v.id);
}

function mark() {
  for (const b of buttons) {
    b.button.setAttribute("aria-pressed", String(b.v.id === variable().id));
    const best = Math.max(0, ...shareOf(b.v.id).map((s) => s ?? 0));
    b.button.setAttribute("aria-label", `${b.v.title}: up to ${percent(best)}`);
  }
}

on("live", (live, newer) => {
  if (!newer) return;
  later("where", table);
  later("multiples", multiples);
});
onAxis(() => { table(); mark(); });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (state.live) multiples(); });
addEventListener("resize", () => { if (state.live) later("multiples", multiples); });
