// The first frame after a step: all marks in their new places on a canvas above the plot, within a few milliseconds. The
// plotting library, which takes some ten times as long, draws the same afterwards and takes over.

import { colour, element } from "./words.js";

/** A triangle as wide as a square of the same area looks, points up. */
function triangle(pen, x, y, r) {
  pen.moveTo(x, y - 1.15 * r);
  pen.lineTo(x + r, y + 0.6 * r);
  pen.lineTo(x - r, y + 0.6 * r);
}

/** Marks up to this size, px, are drawn as squares: the library follows at once with their own shapes. */
const SMALL = 5;

const SHAPES = {
  circle: (pen, x, y, r) => { pen.moveTo(x + r, y); pen.arc(x, y, r, 0, 2 * Math.PI); },
  square: (pen, x, y, r) => pen.rect(x - r, y - r, 2 * r, 2 * r),
  "triangle-up": triangle,
  "x-thin-open": (pen, x, y, r) => {
    pen.moveTo(x - r, y - r);
    pen.lineTo(x + r, y + r);
    pen.moveTo(x - r, y + r);
    pen.lineTo(x + r, y - r);
  },
};

/**
 * Draws traces of marks as the library will, with the axes that are there; true where that was possible.
 * `plot` is a drawn plot, `box` what it stands in, `band` half the height of the noise's band.
 */
export function frame(plot, box, traces, band) {
  const area = plot._fullLayout;
  const [across, up] = [area?.xaxis, area?.yaxis];
  if (!across?.l2p || !up?.l2p || !(across._length > 0 && up._length > 0)) return false;
  let canvas = box.querySelector("canvas.frame");
  if (!canvas) {
    canvas = element("canvas", { class: "frame", "aria-hidden": "true" });
    box.append(canvas);
  }
  const dots = globalThis.devicePixelRatio || 1;
  const [wide, high] = [plot.clientWidth, plot.clientHeight];
  canvas.width = Math.round(wide * dots);
  canvas.height = Math.round(high * dots);
  canvas.style.width = `${wide}px`;
  canvas.style.height = `${high}px`;
  const pen = canvas.getContext("2d");
  pen.scale(dots, dots);
  const [left, top] = [across._offset, up._offset];
  pen.save();
  pen.beginPath();
  pen.rect(left, top, across._length, up._length);
  pen.clip();
  pen.fillStyle = colour("band");
  const [low, above] = [up.l2p(-band), up.l2p(band)];
  pen.fillRect(left, top + above, across._length, low - above);
  for (const trace of traces) {
    const { marker } = trace;
    const some = trace.selectedpoints ? new Set(trace.selectedpoints) : null;
    const shape = SHAPES[marker.symbol];
    const thin = marker.symbol === "x-thin-open";
    // thousands of them, for a moment
    const dot = marker.size <= SMALL;
    pen.fillStyle = marker.color;
    pen.strokeStyle = marker.color;
    pen.lineWidth = 1;
    // those that are not chosen are pale while some are
    for (const chosen of some ? [false, true] : [true]) {
      pen.globalAlpha = (marker.opacity ?? 1) * (chosen ? 1 : 0.2);
      for (let k = 0; k < trace.x.length; k += 1) {
        if (some && some.has(k) !== chosen) continue;
        const x = trace.x[k];
        if (x === null || x === undefined) continue;
        if (dot) {
          pen.fillRect(left + across.l2p(x) - 0.45 * marker.size, top + up.l2p(trace.y[k]) - 0.45 * marker.size, 0.9 * marker.size, 0.9 * marker.size);
          continue;
        }
        pen.beginPath();
        shape(pen, left + across.l2p(x), top + up.l2p(trace.y[k]), marker.size / 2);
        if (thin) pen.stroke();
        else pen.fill();
      }
    }
  }
  pen.restore();
  box.classList.add("framed");
  return true;
}

/** The library has drawn: its marks are shown again. */
export function unframe(box) {
  box.classList.remove("framed");
}
