// The one large plot: the residual of every touch against one variable, with the curve of the candidate that is looked at.
// When the model changes the marks fall to their new places, and the old ones stay as ghosts.

import { frame, unframe } from "./frame.js";
import { later, never } from "./later.js";
import { state, on, setPreview } from "./talk.js";
import { byId, colour, element, show } from "./words.js";

export const DIRECTIONS = ["X", "Y", "Z"];
const SYMBOLS = ["circle", "square", "triangle-up"];
/** Above so many touches the graphics card draws the marks, small and plain: elements of the page would take seconds. */
const MANY = 2500;
/** How long the marks fall, ms. */
const FALL = 350;
/** More different values than this are put into bins. */
const MOST_POSITIONS = 40;
/** A curve has no more corners: it says where the model goes, the marks say the rest. */
const MOST_CORNERS = 16;

const box = byId("residuals");
const plot = element("div", { class: "plot", role: "group" });
const ring = element("div", { class: "ring", hidden: true });
const cell = element("div", { class: "cell" }, plot, ring);
box.append(cell);

let scale = 1;
let made = false;
let stale = true;
/** The variable that the person chose; none: the program's choice. */
let wanted = null;
/** The program's choice. It stays while the marks fall, so that one sees them fall. */
let proposed = null;
let shownDirections = new Set([0, 1, 2]);
/** Residuals of the model before this one. */
let ghosts = null;
/** Residuals that the marks show, which may still be on their way. */
let shownAt = null;
/** By touch: direction in R and its sign. */
export let sides = [];
let members = [[], [], []];
const picked = new Set();
const pickListeners = [];
const hoverListeners = [];
const axisListeners = [];

export const onPick = (listener) => pickListeners.push(listener);
export const onHover = (listener) => hoverListeners.push(listener);
export const onAxis = (listener) => axisListeners.push(listener);
export const chosen = () => picked;
export const membersOf = (d) => members[d];

/** The variable on the horizontal axis. */
export function variable() {
  const all = state.inputs?.variables ?? [];
  const id = wanted ?? proposed;
  return all.find((v) => v.id === id) ?? all[0];
}

/** Takes the variable on which the residual of the present model depends most, where the person has chosen none. */
export function follow() {
  const { axis, version } = state.live;
  if (wanted || !axis || proposed === axis) return;
  // the marks come to rest first, so that one sees them fall; those of before stay as ghosts
  const still = restAt - performance.now();
  if (still > 0) {
    setTimeout(() => { if (state.live.version === version) follow(); }, still + 20);
    return;
  }
  proposed = axis;
  stale = true;
  drawIfSeen();
  axisListeners.forEach((listener) => listener());
}

/** Chooses what the residual is drawn against, and in which directions. */
export function lookAt(id, directions = null) {
  wanted = id;
  if (directions) shownDirections = new Set(directions);
  stale = true;
  drawDirections();
  drawIfSeen();
  axisListeners.forEach((listener) => listener());
}

export function choose(touches, add = false) {
  if (!add) picked.clear();
  for (const i of touches) picked.add(i);
  stale = true;
  drawIfSeen();
  pickListeners.forEach((listener) => listener(picked));
}

export function unchoose(i) {
  picked.delete(i);
  choose([...picked]);
}

export function hover(i) {
  const area = plot._fullLayout;
  const x = i === null || !state.inputs ? null : values(variable().id)[i];
  if (x === null || x === undefined || !area?.xaxis?.l2p) {
    ring.hidden = true;
  } else {
    const left = area.xaxis._offset + area.xaxis.l2p(x + shift(i));
    const top = area.yaxis._offset + area.yaxis.l2p(state.live.residual_um[i] * sides[i].sign);
    ring.hidden = !Number.isFinite(left + top);
    ring.style.left = `${left}px`;
    ring.style.top = `${top}px`;
  }
  hoverListeners.forEach((listener) => listener(i));
}

let order = [];

/** The variable at every touch. */
export function values(id) {
  const t = state.inputs.touches;
  if (id === "time") return t.time_h;
  if (id === "approach") return t.approach_deg;
  if (id === "stylus") return t.stylus_mm;
  if (id === "order") {
    if (order.length !== t.n) order = Array.from({ length: t.n }, (_, i) => i + 1);
    return order;
  }
  return t.axes[id];
}

export function layoutOf(more) {
  const axis = { gridcolor: colour("grid"), zerolinecolor: colour("muted"), linecolor: colour("muted") };
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: colour("ink"), size: 12 },
    margin: { l: 54, r: 10, t: 8, b: 42 }, showlegend: false, hovermode: "closest", ...more,
    xaxis: { ...axis, ...more.xaxis }, yaxis: { ...axis, ...more.yaxis },
  };
}

const CONFIG = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["toImage", "autoScale2d", "zoomIn2d", "zoomOut2d"], modeBarButtonsToAdd: ["select2d", "lasso2d"] };

const isMany = () => (state.inputs?.touches.n ?? 0) > MANY;
const seen = () => byId("plots").hidden === false;

/** The different values of the variable, ascending; none where there are too many. */
let positionsOf = { id: null, inputs: null, all: null };
export function positions(id) {
  if (positionsOf.id === id && positionsOf.inputs === state.inputs) return positionsOf.all;
  const sorted = Float64Array.from(values(id).filter((v) => v !== null)).sort();
  const same = 1e-3 * (sorted[sorted.length - 1] - sorted[0]);
  let all = [];
  for (const v of sorted) {
    if (!all.length || v - all[all.length - 1] > same) all.push(v);
    if (all.length > MOST_POSITIONS) { all = null; break; }
  }
  positionsOf = { id, inputs: state.inputs, all };
  return all;
}

/** Sideways step by direction of approach: marks at one position do not cover each other. */
function shift(i) {
  const all = positions(variable().id);
  if (!all || all.length < 2) return 0;
  const gap = Math.max((all[all.length - 1] - all[0]) / 60, Math.min(...all.slice(1).map((v, k) => v - all[k])) * 0.5);
  return gap * (((sides[i].d * 2 + (sides[i].sign < 0 ? 0 : 1)) - 2.5) / 6);
}

/** How well a mark may be seen: many marks are pale. */
function pale(n) {
  return n <= 250 ? 0.85 : n <= 1000 ? 0.5 : n <= MANY ? 0.35 : 0.18;
}

function traces(residual = state.live.residual_um) {
  const { live, preview } = state;
  const x = values(variable().id);
  const n = state.inputs.touches.n;
  const many = isMany();
  const marks = many ? "scattergl" : "scatter";
  const out = new Map(live.rejected);
  const shown = [];
  for (const [d, name] of DIRECTIONS.entries()) {
    if (!shownDirections.has(d)) continue;
    const own = members[d].filter((i) => !out.has(i) && x[i] !== null);
    const at = own.map((i) => x[i] + shift(i));
    if (ghosts) {
      shown.push({ type: marks, mode: "markers", name: "before", hoverinfo: "skip", x: at, y: own.map((i) => ghosts[i] * sides[i].sign),
        marker: { color: colour("ghost"), symbol: SYMBOLS[d], size: many ? 3 : 5, opacity: many ? 0.25 : 0.6 } });
    }
    shown.push({
      type: marks, mode: "markers", name, customdata: own, selectedpoints: picked.size ? own.flatMap((i, k) => (picked.has(i) ? [k] : [])) : null,
      x: at, y: own.map((i) => residual[i] * sides[i].sign),
      marker: { color: colour(name.toLowerCase()), symbol: SYMBOLS[d], size: many ? 4 : n > 300 ? 5 : 7, opacity: pale(n) },
      hovertemplate: `%{y:.2f} µm in ${name}<extra></extra>`,
    });
  }
  const gone = [...out.keys()].filter((i) => shownDirections.has(sides[i].d));
  if (gone.length) {
    shown.push({
      type: marks, mode: "markers", name: "not used", customdata: gone, selectedpoints: picked.size ? gone.flatMap((i, k) => (picked.has(i) ? [k] : [])) : null,
      x: gone.map((i) => x[i]), y: gone.map((i) => residual[i] * sides[i].sign),
      marker: { color: colour("muted"), symbol: "x-thin-open", size: 8 }, hovertemplate: "%{y:.2f} µm, not used<extra></extra>",
    });
  }
  return { marks: shown, lines: [...medians(x, residual, out), ...(preview ? curves(x, preview.curve_um, out) : [])] };
}

/** Touches of one position, or of one bin, with their mean position. */
export function groups(own, x, most = MOST_POSITIONS) {
  const filled = own.filter((i) => x[i] !== null);
  if (!filled.length) return [];
  const sorted = [...filled].sort((a, b) => x[a] - x[b]);
  const [low, high] = [x[sorted[0]], x[sorted[sorted.length - 1]]];
  const same = 1e-3 * (high - low);
  let all = [];
  for (const i of sorted) {
    const last = all[all.length - 1];
    if (last && x[i] - x[last[0]] <= same) last.push(i);
    else all.push([i]);
  }
  if (all.length > most) {
    const size = Math.ceil(sorted.length / Math.min(24, most));
    all = Array.from({ length: Math.ceil(sorted.length / size) }, (_, k) => sorted.slice(k * size, (k + 1) * size));
  }
  return all.map((of) => ({ of, x: of.reduce((s, i) => s + x[i], 0) / of.length }));
}

const quantile = (sorted, q) => sorted[Math.min(sorted.length - 1, Math.max(0, Math.round(q * (sorted.length - 1))))];

/** Medians with bars from the 16th to the 84th percentile, where many touches share a position. */
function medians(x, residual, out) {
  if (state.inputs.touches.n <= 150) return [];
  const shown = [];
  for (const [d, name] of DIRECTIONS.entries()) {
    if (!shownDirections.has(d)) continue;
    const each = groups(members[d].filter((i) => !out.has(i)), x).filter((g) => g.of.length >= 4);
    if (each.length < 2) continue;
    const ys = each.map((g) => g.of.map((i) => residual[i] * sides[i].sign).sort((a, b) => a - b));
    const y = ys.map((v) => quantile(v, 0.5));
    const lane = (k) => each[k].x + (positions(variable().id) ? shift(each[k].of[0]) : 0);
    shown.push({
      type: "scatter", mode: "markers", name: `median ${name}`, x: each.map((_, k) => lane(k)), y,
      error_y: { type: "data", symmetric: false, array: ys.map((v, k) => quantile(v, 0.84) - y[k]), arrayminus: ys.map((v, k) => y[k] - quantile(v, 0.16)), color: colour(name.toLowerCase()), thickness: 1.5, width: 3 },
      marker: { symbol: SYMBOLS[d], size: 9, color: colour("paper"), line: { color: colour(name.toLowerCase()), width: 2 } },
      hovertemplate: `median of ${name}: %{y:.2f} µm<extra></extra>`,
    });
  }
  return shown;
}

/** Mean of what an effect takes away at each value of the variable, in the direction that the touches show. */
export function curvePoints(own, x, um, most) {
  const each = groups(own, x, most);
  return { x: each.map((g) => g.x), y: each.map((g) => g.of.reduce((s, i) => s + um[i] * sides[i].sign, 0) / g.of.length) };
}

function curves(x, um, out) {
  return DIRECTIONS.flatMap((name, d) => (shownDirections.has(d) ? [{
    type: "scatter", mode: "lines", name: `${name} with it`, hoverinfo: "skip", ...curvePoints(members[d].filter((i) => !out.has(i)), x, um, MOST_CORNERS),
    line: { color: colour(name.toLowerCase()), width: 3, dash: ["solid", "dash", "dot"][d] },
  }] : []));
}

const bandOf = () => 2 * state.live.noise_um;

function draw() {
  const { live } = state;
  stale = false;
  falling += 1;
  shownAt = live.residual_um;
  never("plot");
  const { marks, lines } = traces();
  const layout = layoutOf({
    dragmode: "zoom", uirevision: variable().id, selectionrevision: live.version,
    xaxis: { title: { text: variable().title } }, yaxis: { title: { text: "measured − model, µm" }, range: [-scale, scale] },
    shapes: [{ type: "rect", layer: "below", xref: "paper", x0: 0, x1: 1, y0: -bandOf(), y1: bandOf(), fillcolor: colour("band"), line: { width: 0 } }],
    annotations: [{ xref: "paper", x: 1, xanchor: "right", y: bandOf(), yanchor: "bottom", text: "twice the noise", showarrow: false, font: { size: 11, color: colour("muted") }, bgcolor: colour("paper"), opacity: 0.8 }],
  });
  plot.setAttribute("aria-label", `residual against ${variable().title}`);
  plot.dataset.variable = variable().id;
  Plotly.react(plot, [...marks, ...lines], layout, CONFIG);
  unframe(cell);
  plot.dataset.version = live.version;
  plot.dataset.ghosts = String(Boolean(ghosts));
  plot.dataset.curves = String(lines.filter((l) => l.mode === "lines" && l.x.length > 1).length);
  if (made) return;
  made = true;
  const touchOf = (e) => e.points.find((p) => p.customdata !== undefined)?.customdata;
  plot.on("plotly_hover", (e) => { const i = touchOf(e); if (i !== undefined) hover(i); });
  plot.on("plotly_unhover", () => hover(null));
  plot.on("plotly_selected", (e) => { if (e) choose(e.points.filter((p) => p.customdata !== undefined).map((p) => p.customdata), true); });
  plot.on("plotly_click", (e) => { const i = touchOf(e); if (i !== undefined) picked.has(i) ? unchoose(i) : choose([i], true); });
}

export function drawIfSeen() {
  if (state.live && state.inputs && stale && seen()) draw();
}

/** The panel has come into sight. */
export function shownAgain() {
  stale = true;
  drawIfSeen();
}

// the large plot fills what the rest of the page leaves it
new ResizeObserver(() => { if (made && seen()) Plotly.Plots.resize(plot); }).observe(box);

const still = matchMedia("(prefers-reduced-motion: reduce)");
let falling = 0;
/** When the marks will have come to rest. */
let restAt = 0;

/** The marks fall from where they are to new residuals on a canvas; then the library draws the same, where these are not only expected. */
function fall(to, expected = false) {
  const mine = ++falling;
  const from = shownAt;
  const began = performance.now();
  // marks that are on their way already arrive when they would have
  const time = restAt > began ? Math.max(60, restAt - began) : FALL;
  restAt = began + time;
  const turn = () => {
    if (mine !== falling) return;
    const t = still.matches || !from ? 1 : Math.min(1, (performance.now() - began) / time);
    const eased = 1 - (1 - t) ** 3;
    const at = t === 1 ? to : to.map((r, i) => from[i] + (r - from[i]) * eased);
    shownAt = at;
    if (!frame(plot, cell, traces(at).marks, bandOf())) return draw();
    plot.dataset.framed = state.live.version;
    if (t < 1) requestAnimationFrame(turn);
    else if (!expected) later("plot", () => { if (stale && mine === falling) draw(); });
  };
  turn();
}

/**
 * Shows at once what a candidate would leave, by its curve, while the fit is under way; the fit's own residuals follow.
 * `taken` is µm by touch.
 */
export function expect(taken) {
  if (!made || !seen() || !state.live) return;
  ghosts = state.live.residual_um;
  stale = true;
  fall(state.live.residual_um.map((r, i) => r - taken[i]), true);
}

/** What was expected did not come: the marks go back. */
export function expectNothing() {
  ghosts = null;
  stale = true;
  drawIfSeen();
}

export function rescale() {
  const { live } = state;
  const out = new Set(live.rejected.map(([i]) => i));
  let top = 2 * live.noise_um;
  live.residual_um.forEach((r, i) => { if (!out.has(i)) top = Math.max(top, Math.abs(r)); });
  scale = 1.1 * top;
  ghosts = null;
  stale = true;
  drawIfSeen();
}

function drawDirections() {
  const only = (d) => shownDirections.size === 1 && shownDirections.has(d);
  const button = (name, isOn, directions, text) => element("button", { type: "button", class: name, "aria-pressed": String(isOn), click: () => lookAt(wanted, directions) }, text);
  byId("directions").replaceChildren(button("all", shownDirections.size === 3, [0, 1, 2], "all"),
    ...DIRECTIONS.map((name, d) => button(name, only(d), [d], `${"●■▲"[d]} ${name}`)));
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
let shownVersion = 0;
let last = null;
on("live", (live, newer) => {
  const anew = drawnInputs !== state.inputs;
  if (anew) {
    drawnInputs = state.inputs;
    sort(state.inputs.touches);
    picked.clear();
    last = null;
    wanted = null;
    proposed = live.axis;
    rescale();
    drawDirections();
  }
  if (!newer) return;
  const comparable = last && last.length === live.residual_um.length ? last : null;
  last = live.residual_um;
  shownVersion = live.version;
  ghosts = comparable;
  // a new model may depend on something else: what the person chose stays
  stale = true;
  hover(null);
  if (!seen()) return;
  if (made && comparable) fall(live.residual_um);
  else draw();
});
on("preview", () => {
  // a step takes the curve away with all that it draws anew
  if (state.live?.version !== shownVersion) return;
  stale = true;
  drawIfSeen();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { stale = true; drawIfSeen(); });
document.addEventListener("keydown", (e) => {
  if (e.key === "Escape" && state.preview) setPreview(null);
});
onHover((i) => {
  const t = state.inputs?.touches;
  show("hovered", i === null || !t ? "" : `touch ${t.id[i]} of run ${t.run[i]}: ${(state.live.residual_um[i]).toFixed(2)} µm, ${t.words[t.block[i]]}, face ${t.words[t.face[i]]}, log line ${t.line[i]}`);
});
byId("rescale").addEventListener("click", rescale);
