// Small words: numbers with the digits that they deserve, and elements.

/** As many digits as the uncertainty has two of. */
export function stated(value, sigma) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (sigma > 0) {
    const digits = Math.min(9, Math.max(0, 1 - Math.floor(Math.log10(sigma))));
    return minus(value.toFixed(digits));
  }
  return significant(value);
}

const minus = (text) => text.replace("-", "−");

export function significant(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  return minus(size < -5 || size > 6 ? value.toExponential(digits - 1) : value.toFixed(Math.max(0, digits - 1 - size)));
}

/** A unit as people write it. */
export const unitOf = (unit) => unit.replace(/^u(?=m|rad)/, "µ").replace("deg", "°");

/** A result with its uncertainty; without one it is none. */
export function sized(p) {
  return p.sigma ? `${p.name} = ${stated(p.value, p.sigma)} ± ${significant(p.sigma, 2)} ${unitOf(p.unit)}` : `${p.name}: not determined`;
}

/** A probability; its natural logarithm where it is too small to be a number. */
export function chance(p, lnP) {
  if (p === null || p === undefined) return "–";
  if (p >= 0.0001) return p.toFixed(4);
  const power = Math.floor((p > 0 ? Math.log(p) : lnP ?? -Infinity) / Math.LN10);
  // smaller than any number that the computer knows
  if (!(power > -300)) return "below 10⁻³⁰⁰";
  return `10${[...String(power)].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c])).join("")}`;
}

/** An element; attributes that are functions are listeners. Text is always text, never markup. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === "function") made.addEventListener(name, value);
    else if (name === "class") made.className = value;
    else made.setAttribute(name, value === true ? "" : value);
  }
  for (const child of children.flat()) {
    if (child !== null && child !== undefined) made.append(child);
  }
  return made;
}

export const byId = (id) => document.getElementById(id);

export function show(id, text) {
  const at = byId(id);
  if (at.textContent !== text) at.textContent = text;
}

const colours = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

/** A style variable of the page: light and dark have their own. Asked once, because each question stops the page. */
export function colour(name) {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
}
