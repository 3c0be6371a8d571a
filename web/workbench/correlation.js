// How the results hang together: the correlation of every two of them.

import { later } from "./later.js";
import { layoutOf } from "./plots.js";
import { state, on } from "./talk.js";
import { byId, colour, show } from "./words.js";

const box = byId("correlation");
/** From here on only the difference, or the sum, of two results is known well. */
const STRONG = 0.9;
let stale = true;
let seen = false;

new IntersectionObserver((entries) => {
  seen = entries[entries.length - 1].isIntersecting;
  draw();
}, { rootMargin: "100px" }).observe(box);

function draw() {
  if (!stale || !seen || !state.live) return;
  stale = false;
  const { names, matrix } = state.live.correlation;
  const strong = [];
  matrix.forEach((row, i) => row.slice(0, i).forEach((r, k) => { if (Math.abs(r ?? 0) >= STRONG) strong.push([Math.abs(r), `${names[k]} and ${names[i]} (${r.toFixed(2)})`]); }));
  strong.sort((a, b) => b[0] - a[0]);
  const more = strong.length > 4 ? ` and ${strong.length - 4} more` : "";
  show("correlation-says", `Correlation of the results of the present model. Near 0 two results are independent; near 1 or −1 only their difference or sum is well known. ${strong.length
    ? `Hard to separate here: ${strong.slice(0, 4).map((s) => s[1]).join(", ")}${more}.` : `No two results correlate by ${STRONG} or more.`}`);
  box.style.height = `${Math.min(40, 9 + 1.7 * names.length)}em`;
  const traces = [{
    type: "heatmap", x: names, y: names, z: matrix, zmin: -1, zmax: 1, xgap: 1, ygap: 1,
    // blue over paper to orange: also for colour-blind people
    colorscale: [[0, colour("x")], [0.5, colour("paper")], [1, colour("y")]], colorbar: { thickness: 12, tickvals: [-1, -0.5, 0, 0.5, 1] },
    text: matrix.map((row) => row.map((r) => (r === null ? "" : r.toFixed(2).replace("-0.00", "0.00")))), texttemplate: names.length <= 12 ? "%{text}" : "",
    hovertemplate: "%{y} and %{x}: %{z:.2f}<extra></extra>",
  }];
  const layout = layoutOf({ xaxis: { type: "category", tickangle: -45, automargin: true }, yaxis: { type: "category", autorange: "reversed", automargin: true } });
  Plotly.react(box, traces, layout, { responsive: true, displaylogo: false, displayModeBar: false });
  box.dataset.version = state.live.version;
}

on("live", (live, newer) => {
  if (!newer) return;
  stale = true;
  later("correlation", draw);
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  stale = true;
  draw();
});
