// The machine with the residual of every touch as an arrow, magnified; a slider goes through the index positions.

import { later } from "./later.js";
import { state, on } from "./talk.js";
import { layoutOf, onHover } from "./plots.js";
import { byId, colour, show, significant } from "./words.js";

const slider = byId("pose");

let stale = true;
let seen = false;
let possible = null;
const box = byId("space");

function webgl() {
  if (possible === null) {
    const canvas = document.createElement("canvas");
    possible = Boolean(canvas.getContext("webgl2") ?? canvas.getContext("webgl"));
  }
  return possible;
}

new IntersectionObserver((entries) => {
  seen = entries[entries.length - 1].isIntersecting;
  draw();
}).observe(box);

/** Edges of a box, or rims of a cylinder, as one broken line. */
function outline(solid) {
  const lines = [];
  const { at } = solid;
  if (solid.size) {
    const h = solid.size.map((s) => s / 2);
    const corner = (a, b, c) => [at[0] + a * h[0], at[1] + b * h[1], at[2] + c * h[2]];
    for (const z of [-1, 1]) lines.push(...[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]].map(([a, b]) => corner(a, b, z)), null);
    for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) lines.push(corner(a, b, -1), corner(a, b, 1), null);
  } else if (solid.radius_height) {
    const [radius, height] = solid.radius_height;
    const d = solid.direction;
    const help = Math.abs(d[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const cross = (p, q) => [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
    const raw = cross(help, d);
    const size = Math.hypot(...raw);
    const u = raw.map((v) => v / size);
    const w = cross(d, u);
    for (const along of [0, height]) {
      for (let k = 0; k <= 36; k += 1) {
        const t = (k / 36) * 2 * Math.PI;
        lines.push([0, 1, 2].map((i) => at[i] + along * d[i] + radius * (Math.cos(t) * u[i] + Math.sin(t) * w[i])));
      }
      lines.push(null);
    }
  }
  return lines;
}

/** A point, or with `turn` a direction, moved with its carrier into the frame of the machine. */
function moved(p, frame, turn = false) {
  if (!frame) return p;
  return [0, 1, 2].map((r) => frame[4 * r] * p[0] + frame[4 * r + 1] * p[1] + frame[4 * r + 2] * p[2] + (turn ? 0 : frame[4 * r + 3]));
}

/** What each thing is called: the artefacts, the parts of the machine, the rotary axes. */
function names(machine, frameOf, apart, atZero) {
  const above = (p, by) => [p[0], p[1], p[2] + by];
  const all = [
    ...machine.blocks.map((b) => ({ at: above(moved(b.centre, frameOf(b.carrier)), 25), says: b.name })),
    ...machine.solids.map((s) => ({ at: moved(s.at, frameOf(s.carrier)), says: s.name })),
    // one axis carries another: only with all axes at zero do they stand as the machine's description has them
    ...machine.axes.filter((a) => a.rotary && atZero).map((a) => ({ at: along(a, AXIS_LENGTH_MM), says: `axis ${a.name}` })),
  ];
  // what stands close to another one would cover its name
  const near = (p, q) => Math.hypot(...p.map((v, k) => v - q[k])) < apart;
  return all.filter((n, i) => !all.slice(0, i).some((other) => near(n.at, other.at)));
}

/** Half the length of the line that stands for a rotary axis. */
const AXIS_LENGTH_MM = 60;
const along = (axis, by) => axis.point.map((v, k) => v + by * axis.direction[k]);
const axisLines = (machine) => machine.axes.filter((a) => a.rotary).flatMap((a) => [along(a, -AXIS_LENGTH_MM), along(a, AXIS_LENGTH_MM), null]);

const columns = (points) => ({ x: points.map((p) => p && p[0]), y: points.map((p) => p && p[1]), z: points.map((p) => p && p[2]) });

function draw() {
  if (!stale || !seen || !state.live) return;
  stale = false;
  if (!webgl()) {
    box.textContent = "this browser draws no 3D (WebGL is off): the plot of residuals shows the same touches";
    return;
  }
  const { live, inputs } = state;
  const t = inputs.touches;
  const out = new Set(live.rejected.map(([i]) => i));
  const pose = Number(slider.value) > 0 ? inputs.machine.poses[Number(slider.value) - 1] : null;
  show("pose-says", pose ? `${slider.value} of ${inputs.machine.poses.length}: ${pose.says}` : "all, axes at zero");
  const frameOf = (carrier) => pose?.frames[carrier];
  const at = t.point.map((p, i) => moved(p, frameOf(t.words[t.carrier[i]])));
  const spread = [0, 1, 2].map((k) => {
    let low = Infinity, high = -Infinity;
    for (const p of t.point) { low = Math.min(low, p[k]); high = Math.max(high, p[k]); }
    return high - low;
  });
  let top = live.noise_um;
  live.residual_um.forEach((r, i) => { if (!out.has(i)) top = Math.max(top, Math.abs(r)); });
  // the largest residual is a sixth of the whole, in a round magnification
  const wish = (Math.max(...spread, 1) / 6) / (top * 1e-3);
  const power = 10 ** Math.floor(Math.log10(wish));
  const times = Math.floor(wish / power) * power;
  const arrows = [], tips = [];
  const kept = t.point.map((_, i) => i).filter((i) => !out.has(i) && (!pose || t.visit[i] === pose.visit));
  kept.forEach((i) => {
    const p = at[i];
    const normal = moved(t.normal[i], frameOf(t.words[t.carrier[i]]), true);
    const tip = p.map((v, k) => v + normal[k] * live.residual_um[i] * 1e-3 * times);
    arrows.push(p, tip, null);
    tips.push(tip);
  });
  const machine = inputs.machine.solids.flatMap((s) => outline(s).map((p) => p && moved(p, frameOf(s.carrier))));
  const line = (points, name, style) => ({ type: "scatter3d", mode: "lines", name, ...columns(points), line: style, hoverinfo: "skip" });
  const traces = [
    line(machine, inputs.machine.name, { color: colour("line"), width: 2 }),
    line(pose ? pose.tool : [], "probe from the pivot to the ball", { color: colour("muted"), width: 6 }),
    line(pose ? [] : axisLines(inputs.machine), "rotary axes", { color: colour("muted"), width: 3, dash: "dash" }),
    line(arrows, "residual", { color: colour("x"), width: 3 }),
    { type: "scatter3d", mode: "markers", name: "touches", ...columns(tips), customdata: kept, marker: { size: 2, color: colour("y") },
      text: kept.map((i) => `touch ${t.id[i]} of run ${t.run[i]}: ${significant(live.residual_um[i])} µm`), hoverinfo: "text" },
    { type: "scatter3d", mode: "markers", name: "the touch", x: [null], y: [null], z: [null], marker: { size: 8, color: colour("ink"), symbol: "circle-open" }, hoverinfo: "skip" },
  ];
  // touches and arrows stay large enough to be seen: of a large machine only the middle is shown
  const reach = machine.reduce((far, p) => (p ? Math.max(far, ...p.map((v, k) => Math.abs(v - at[0][k]))) : far), 0);
  const half = Math.max(0.75 * Math.max(...spread, 1), Math.min(reach, 2.5 * Math.max(...spread, 1)));
  const named = names(inputs.machine, frameOf, 0.25 * half, !pose);
  traces.push({ type: "scatter3d", mode: "text", name: "names", ...columns(named.map((n) => n.at)), text: named.map((n) => n.says), textfont: { size: 12, color: colour("ink") }, hoverinfo: "skip" });
  const middle = [0, 1, 2].map((k) => {
    let low = Infinity, high = -Infinity;
    for (const p of at) { low = Math.min(low, p[k]); high = Math.max(high, p[k]); }
    return (low + high) / 2;
  });
  const axis = (title, k) => ({ range: [middle[k] - half, middle[k] + half], title: { text: title }, color: colour("ink"), gridcolor: colour("line"), backgroundcolor: colour("paper") });
  const layout = layoutOf({
    uirevision: "keep", margin: { l: 0, r: 0, t: 0, b: 0 },
    scene: { aspectmode: "cube", xaxis: axis("X, mm", 0), yaxis: axis("Y, mm", 1), zaxis: axis("Z, mm", 2) },
  });
  delete layout.xaxis;
  delete layout.yaxis;
  Plotly.react(box, traces, layout, { responsive: true, displaylogo: false, displayModeBar: false });
  show("space-scale", `Each dot is a touch, at the end of its residual. Residuals are ${times.toLocaleString("en")} times as long as they are: ${significant(top)} µm are drawn as ${significant(top * 1e-3 * times)} mm. Touches as the plan has them.`);
}

slider.addEventListener("input", () => { stale = true; draw(); });

onHover((i) => {
  if (!seen || !possible || stale || box.data === undefined) return;
  const t = state.inputs.touches;
  const p = i === null ? [null, null, null] : t.point[i];
  Plotly.restyle(box, { x: [[p[0]]], y: [[p[1]]], z: [[p[2]]] }, [5]);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  stale = true;
  draw();
});
on("live", (live, newer) => {
  if (!newer) return;
  slider.max = state.inputs.machine.poses.length;
  stale = true;
  later("space", draw);
});
