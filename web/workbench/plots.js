// The residual of every touch against what it may depend on, and the ladder. One touch is the same touch in every plot.

import { frame, unframe } from "./frame.js";
import { later, never } from "./later.js";
import { state, on, setPreview } from "./talk.js";
import { byId, colour, element, significant } from "./words.js";

const DIRECTIONS = ["X", "Y", "Z"];
const SYMBOLS = ["circle", "square", "triangle-up"];
/** Above so many touches the graphics card draws the marks, small and plain: elements of the page would take seconds. */
const MANY = 2500;

const cells = [];
let scale = 1;
/** By touch: direction in R, its sign, and place in its trace. */
let sides = [];
/** The touches of each direction, in their order. */
let members = [[], [], []];
const picked = new Set();
const pickListeners = [];
const hoverListeners = [];

export const onPick = (listener) => pickListeners.push(listener);
export const onHover = (listener) => hoverListeners.push(listener);
export const chosen = () => picked;

export function choose(touches, add = false) {
  if (!add) picked.clear();
  for (const i of touches) picked.add(i);
  cells.forEach((cell) => { cell.stale = true; });
  drawSeen();
  pickListeners.forEach((listener) => listener(picked));
}

export function unchoose(i) {
  picked.delete(i);
  choose([...picked]);
}

export function hover(i) {
  const t = state.inputs?.touches;
  for (const cell of cells) {
    const x = i === null || !t ? null : values(cell.variable.id)[i];
    const area = cell.plot._fullLayout;
    if (x === null || x === undefined || !area?.xaxis) {
      cell.ring.hidden = true;
      continue;
    }
    const y = state.live.residual_um[i] * sides[i].sign;
    const left = area.xaxis._offset + area.xaxis.l2p(x);
    const top = area.yaxis._offset + area.yaxis.l2p(y);
    cell.ring.hidden = !Number.isFinite(left + top);
    cell.ring.style.left = `${left}px`;
    cell.ring.style.top = `${top}px`;
  }
  hoverListeners.forEach((listener) => listener(i));
}

function values(id) {
  const t = state.inputs.touches;
  if (id === "time") return t.time_h;
  if (id === "approach") return t.approach_deg;
  if (id === "order") return cellsOrder(t.n);
  return t.axes[id];
}

let order = [];
function cellsOrder(n) {
  if (order.length !== n) order = Array.from({ length: n }, (_, i) => i + 1);
  return order;
}

export function layoutOf(more) {
  const ink = colour("ink");
  const axis = { gridcolor: colour("line"), zerolinecolor: colour("soft"), linecolor: colour("soft") };
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: 12 },
    margin: { l: 50, r: 10, t: 8, b: 40 }, showlegend: false, hovermode: "closest", ...more,
    xaxis: { ...axis, ...more.xaxis }, yaxis: { ...axis, ...more.yaxis },
  };
}

const CONFIG = {
  responsive: true, displaylogo: false,
  modeBarButtonsToRemove: ["toImage", "autoScale2d", "zoomIn2d", "zoomOut2d"],
};

function grid() {
  const box = byId("residuals");
  cells.forEach((cell) => Plotly.purge(cell.plot));
  cells.length = 0;
  box.replaceChildren();
  for (const variable of state.inputs.variables) {
    const plot = element("div", { class: "plot", role: "group", "aria-label": `residual against ${variable.title}` });
    const ring = element("div", { class: "ring", hidden: true });
    const around = element("div", { class: "cell" }, plot, ring);
    const cell = { variable, plot, ring, around, stale: true, seen: false, made: false };
    plot.dataset.variable = variable.id;
    // who points at a mark means that of the library, which knows its touch
    plot.addEventListener("pointerenter", () => { if (cell.stale && cell.made) draw(cell); });
    box.append(around);
    cells.push(cell);
    watcher.observe(plot);
  }
}

const watcher = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    const cell = cells.find((c) => c.plot === entry.target);
    if (!cell) continue;
    cell.seen = entry.isIntersecting;
    // a browser has few places for drawings by the graphics card: what is out of sight gives its own back
    if (!cell.seen && cell.made && isMany()) {
      Plotly.purge(cell.plot);
      cell.made = false;
      cell.stale = true;
    }
  }
  drawSeen();
}, { rootMargin: "40px" });

const isMany = () => (state.inputs?.touches.n ?? 0) > MANY;

/** Only what is on the screen is drawn; the rest when it comes into sight. */
function drawSeen() {
  if (!state.live || !state.inputs) return;
  for (const cell of cells) if (cell.seen && cell.stale) draw(cell);
}

/** The marks go to their new places at once; the library draws after the paint, one plot a turn. */
function moveSeen() {
  for (const cell of cells) {
    if (!cell.seen) continue;
    if (!cell.made || !frame(cell.plot, cell.around, traces(cell), 2 * state.live.noise_um)) {
      draw(cell);
      continue;
    }
    cell.plot.dataset.framed = state.live.version;
    later(`plot ${cell.variable.id}`, () => { if (cell.seen && cell.stale) draw(cell); });
  }
}

function traces(cell) {
  const { live, preview } = state;
  const x = values(cell.variable.id);
  const many = isMany();
  const marks = many ? "scattergl" : "scatter";
  const out = new Map(live.rejected);
  const shown = [];
  for (const [d, name] of DIRECTIONS.entries()) {
    const own = members[d].filter((i) => !out.has(i));
    const selected = picked.size ? own.flatMap((i, k) => (picked.has(i) ? [k] : [])) : null;
    shown.push({
      type: marks, mode: "markers", name, customdata: own, selectedpoints: selected,
      x: own.map((i) => x[i]), y: own.map((i) => live.residual_um[i] * sides[i].sign),
      marker: { color: colour(name.toLowerCase()), symbol: SYMBOLS[d], size: many ? 5 : 6, opacity: many ? 0.6 : 0.8 },
      hovertemplate: `%{y:.2f} µm in ${name}<extra></extra>`,
    });
  }
  for (const [d, name] of preview ? DIRECTIONS.entries() : []) {
    shown.push({
      type: marks, mode: "lines", name: `${name} with it`, hoverinfo: "skip",
      ...curve(members[d].filter((i) => !out.has(i)), x, preview.curve_um),
      line: { color: colour(name.toLowerCase()), width: 2.5, dash: ["solid", "dash", "dot"][d] },
    });
  }
  const gone = [...out.keys()];
  if (gone.length) {
    shown.push({
      type: marks, mode: "markers", name: "not used", customdata: gone,
      selectedpoints: picked.size ? gone.flatMap((i, k) => (picked.has(i) ? [k] : [])) : null,
      x: gone.map((i) => x[i]), y: gone.map((i) => live.residual_um[i] * sides[i].sign),
      marker: { color: colour("soft"), symbol: "x-thin-open", size: 8 },
      hovertemplate: "%{y:.2f} µm, not used<extra></extra>",
    });
  }
  return shown;
}

/** Mean of what an effect takes away at each value of the variable, in the direction that the touches show. */
function curve(own, x, um) {
  const at = new Map();
  const filled = own.filter((i) => x[i] !== null);
  if (!filled.length) return { x: [], y: [] };
  const low = filled.reduce((m, i) => Math.min(m, x[i]), Infinity);
  const high = filled.reduce((m, i) => Math.max(m, x[i]), -Infinity);
  const width = (high - low) / 60 || 1;
  for (const i of filled) {
    const bin = Math.round((x[i] - low) / width);
    const sum = at.get(bin) ?? { x: 0, y: 0, n: 0 };
    sum.x += x[i];
    sum.y += um[i] * sides[i].sign;
    sum.n += 1;
    at.set(bin, sum);
  }
  const sorted = [...at.values()].sort((a, b) => a.x / a.n - b.x / b.n);
  return { x: sorted.map((s) => s.x / s.n), y: sorted.map((s) => s.y / s.n) };
}

function draw(cell) {
  const { live } = state;
  cell.stale = false;
  never(`plot ${cell.variable.id}`);
  const band = 2 * live.noise_um;
  const layout = layoutOf({
    dragmode: "zoom", uirevision: "keep", selectionrevision: live.version,
    xaxis: { title: { text: cell.variable.title } },
    yaxis: { title: { text: "residual, µm" }, range: [-scale, scale] },
    shapes: [{ type: "rect", layer: "below", xref: "paper", x0: 0, x1: 1, y0: -band, y1: band, fillcolor: colour("band"), line: { width: 0 } }],
  });
  const config = { ...CONFIG, modeBarButtonsToAdd: ["select2d", "lasso2d"] };
  Plotly.react(cell.plot, traces(cell), layout, config);
  unframe(cell.around);
  cell.plot.dataset.version = live.version;
  if (!cell.made) {
    cell.made = true;
    cell.plot.on("plotly_hover", (e) => {
      const touch = e.points.find((p) => p.customdata !== undefined)?.customdata;
      if (touch !== undefined) hover(touch);
    });
    cell.plot.on("plotly_unhover", () => hover(null));
    cell.plot.on("plotly_selected", (e) => {
      if (e) choose(e.points.filter((p) => p.customdata !== undefined).map((p) => p.customdata), true);
    });
    cell.plot.on("plotly_click", (e) => {
      const touch = e.points.find((p) => p.customdata !== undefined)?.customdata;
      if (touch !== undefined) picked.has(touch) ? unchoose(touch) : choose([touch], true);
    });
  }
}

export function rescale() {
  const { live } = state;
  const out = new Set(live.rejected.map(([i]) => i));
  let top = 2 * live.noise_um;
  live.residual_um.forEach((r, i) => { if (!out.has(i)) top = Math.max(top, Math.abs(r)); });
  scale = 1.1 * top;
  cells.forEach((cell) => { cell.stale = true; });
  drawSeen();
}

function sort(t) {
  sides = t.normal_r.map((n) => {
    const size = n.map(Math.abs);
    // the last of equals, as the command line has it
    const d = size[2] >= Math.max(size[0], size[1]) ? 2 : size[1] >= size[0] ? 1 : 0;
    return { d, sign: n[d] < 0 ? -1 : 1 };
  });
  members = [[], [], []];
  sides.forEach((side, i) => members[side.d].push(i));
}

let drawnInputs = null;
let shown = 0;
on("live", (live, newer, first) => {
  if (drawnInputs !== state.inputs) {
    drawnInputs = state.inputs;
    sort(state.inputs.touches);
    picked.clear();
    grid();
    rescale();
  }
  if (newer) {
    cells.forEach((cell) => { cell.stale = true; });
    shown = live.version;
    moveSeen();
    hover(null);
  }
  later("ladder", showLadder);
});

/** The ladder is drawn when it is in sight and has changed. */
let ladderSeen = false;
let ladderDrawn = "";
function showLadder(again = false) {
  if (!state.live || !ladderSeen) return;
  const now = JSON.stringify(state.live.ladder);
  if (now === ladderDrawn && !again) return;
  ladderDrawn = now;
  ladder(state.live);
}
new IntersectionObserver((entries) => {
  ladderSeen = entries[entries.length - 1].isIntersecting;
  showLadder();
}, { rootMargin: "200px" }).observe(byId("ladder"));
on("preview", () => {
  // a step takes the curve away with all that it draws anew
  if (state.live?.version !== shown) return;
  cells.forEach((cell) => { cell.stale = true; });
  drawSeen();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  cells.forEach((cell) => { cell.stale = true; });
  drawSeen();
  showLadder(true);
});
document.addEventListener("keydown", (e) => {
  if (e.key === "Escape" && state.preview) setPreview(null);
});

function ladder(live) {
  const steps = live.ladder.steps;
  const label = (s, i) => {
    const parts = [...s.added.map((e) => `+${e}`), ...s.removed.map((e) => `−${e}`)];
    return `${i + 1}. ${parts.join(" ") || (i ? "the same effects" : "first model")}`;
  };
  const names = steps.map(label);
  const line = (name, key, dash, symbol) => ({
    type: "scatter", mode: "lines+markers", name, x: names, y: steps.map((s) => s[key] ?? null), line: { dash, color: colour(key === "rms_um" ? "x" : "y") },
    marker: { symbol, size: 8 }, hovertemplate: `%{y:.3f} µm<extra>${name}</extra>`,
  });
  const layout = layoutOf({
    showlegend: true, legend: { orientation: "h", y: 1.2 },
    xaxis: { tickangle: -20, type: "category", automargin: true },
    yaxis: { title: { text: "µm RMS" }, type: "log" },
    shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: live.noise_um, y1: live.noise_um, line: { dash: "dot", color: colour("soft") } }],
    annotations: [{ xref: "paper", x: 0, xanchor: "left", y: Math.log10(live.noise_um), yanchor: "bottom", bgcolor: colour("paper"), text: "noise of a touch", showarrow: false }],
  });
  Plotly.react(byId("ladder"), [line("residual", "rms_um", "solid", "circle"), line("cross-validated", "held_out_rms_um", "dash", "square")], layout, { ...CONFIG, displayModeBar: false });
  const head = element("tr", {}, ["model", "residual, µm", "cross-validated, µm", "χ²/dof"].map((h) => element("th", { scope: "col" }, h)));
  const rows = steps.map((s, i) => element("tr", {}, [names[i], significant(s.rms_um), significant(s.held_out_rms_um), significant(s.chi2_per_dof)].map((v) => element("td", {}, v))));
  const table = byId("ladder-table");
  table.replaceChildren(table.caption, element("thead", {}, head), element("tbody", {}, rows));
}
