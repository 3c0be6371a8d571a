// The results with their uncertainty against the tolerance, and the log of the session.

import { later } from "./later.js";
import { state, on } from "./talk.js";
import { byId, element, significant, stated, unitOf } from "./words.js";

const VERDICTS = { within: "within", beyond: "too large", open: "uncertain", none: "" };

function results() {
  const { live, behind } = state;
  const table = byId("parameters");
  const head = ["result", "value", "±, 95 %", "unit", "tolerance", "as bar"].map((h) => element("th", { scope: "col" }, h));
  const size = (p) => Math.abs(p.value) + (p.expanded ?? 0);
  const top = {};
  for (const p of live.parameters) top[p.unit] = Math.max(top[p.unit] ?? 0, size(p));
  const rows = live.parameters.map((p) => {
    const known = p.sigma !== null;
    const tolerance = p.tolerance === null ? "–" : `${known && VERDICTS[p.judgement] ? `${VERDICTS[p.judgement]}: ` : ""}${significant(p.tolerance)}`;
    return element("tr", {}, element("td", { class: "word" }, p.name, element("small", {}, p.says)), element("td", {}, known || p.status === "fixed" ? stated(p.value, p.sigma) : "not determined"),
      element("td", {}, significant(p.expanded, 2)), element("td", { class: "word" }, unitOf(p.unit)), element("td", { class: "word" }, tolerance), element("td", {}, known ? bar(p, top[p.unit]) : ""));
  });
  const t = live.tolerance;
  const complete = behind?.version === live.version && behind.diagnosis?.verdict === "adequate";
  table.caption.textContent = `Results with their 95 % uncertainty, against ${t.error_um} µm at ${t.radius_mm} mm${complete ? "" : "; while an effect is missing they may include part of it"}`;
  table.replaceChildren(table.caption, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows));
  const list = (texts) => texts.filter((r, i, all) => all.indexOf(r) === i).map((r) => element("li", {}, r));
  const cannot = live.undetermined.map((u) => `not determined: ${u.says}`);
  byId("warnings").replaceChildren(...list(cannot));
  byId("remarks").replaceChildren(...list([...state.inputs.remarks.map((m) => m.message), ...live.warnings, ...cannot]));
  byId("runs").replaceChildren(...state.inputs.runs.map((r, i) => element("li", {}, `run ${i + 1}: plan ${r.plan}, log ${r.log}, ${r.controller}`)));
}

/** Value and 95 % band on a line from −top to +top. */
function bar(p, top) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  for (const [k, v] of Object.entries({ viewBox: "-100 -8 200 16", width: 80, height: 14, "aria-hidden": "true" })) svg.setAttribute(k, v);
  const scaled = (v) => (95 * v) / (top || 1);
  const draw = (tag, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [k, v] of Object.entries(attributes)) made.setAttribute(k, v);
    svg.append(made);
  };
  draw("line", { x1: -100, x2: 100, y1: 0, y2: 0, stroke: "currentColor", "stroke-opacity": 0.3 });
  draw("line", { x1: 0, x2: 0, y1: -7, y2: 7, stroke: "currentColor", "stroke-opacity": 0.6 });
  draw("line", { x1: scaled(p.value - (p.expanded ?? 0)), x2: scaled(p.value + (p.expanded ?? 0)), y1: 0, y2: 0, stroke: "currentColor", "stroke-width": 5, "stroke-opacity": 0.45 });
  draw("circle", { cx: scaled(p.value), cy: 0, r: 5, fill: "currentColor" });
  return svg;
}

on("live", (live, newer) => { if (newer) later("results", results); });
on("behind", () => later("results", results));
