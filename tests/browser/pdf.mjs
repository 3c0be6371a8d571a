// Where a printed page has text: the content streams of a PDF as Chromium writes it (ISO 32000-1, clauses 7.3, 8.3, 9.4).

import { inflateSync } from "node:zlib";

function objects(pdf) {
  const text = pdf.toString("latin1");
  const out = new Map();
  for (const found of text.matchAll(/(?:^|\s)(\d+) 0 obj\b/g)) {
    const from = found.index + found[0].length;
    const end = text.indexOf("endobj", from);
    const begins = text.indexOf("stream", from);
    const head = text.slice(from, begins > 0 && begins < end ? begins : end);
    let stream = null;
    if (begins > 0 && begins < end) {
      const at = begins + (text[begins + 6] === "\r" ? 8 : 7);
      const length = Number(/\/Length (\d+)/.exec(head)[1]);
      const bytes = pdf.subarray(at, at + length);
      stream = /FlateDecode/.test(head) ? inflateSync(bytes).toString("latin1") : bytes.toString("latin1");
    }
    out.set(found[1], { head, stream });
  }
  return out;
}

const times = (a, b) => [a[0] * b[0] + a[1] * b[2], a[0] * b[1] + a[1] * b[3], a[2] * b[0] + a[3] * b[2], a[2] * b[1] + a[3] * b[3], a[4] * b[0] + a[5] * b[2] + b[4], a[4] * b[1] + a[5] * b[3] + b[5]];

/** Heights at which text is shown, in points from the foot of the sheet. */
function heights(all, resources, stream, matrix, out) {
  let [ctm, text] = [matrix, [1, 0, 0, 1, 0, 0]];
  const kept = [];
  let words = [];
  const six = () => words.slice(-6).map(Number);
  for (const [word] of stream.matchAll(/\((?:\\.|[^\\)])*\)|<[^>]*>|\[|\]|[^\s[\]()<>]+/g)) {
    switch (word) {
      case "q": kept.push(ctm); break;
      case "Q": ctm = kept.pop() ?? ctm; break;
      case "cm": ctm = times(six(), ctm); break;
      case "BT": text = [1, 0, 0, 1, 0, 0]; break;
      case "Tm": text = six(); break;
      case "Td": text = times([1, 0, 0, 1, ...words.slice(-2).map(Number)], text); break;
      case "Tj": case "TJ": out.push(times(text, ctm)[5]); break;
      case "Do": {
        const name = words.at(-1).slice(1);
        const form = all.get(new RegExp(`/${name} (\\d+) 0 R`).exec(resources)?.[1]);
        if (/\/Subtype \/Form/.test(form?.head ?? "")) {
          const own = /\/Matrix \[([^\]]*)\]/.exec(form.head)?.[1].trim().split(/\s+/).map(Number) ?? [1, 0, 0, 1, 0, 0];
          heights(all, form.head, form.stream, times(own, ctm), out);
        }
        break;
      }
      default: words.push(word); continue;
    }
    words = [];
  }
  return out;
}

/** For each sheet the share of its height, in bands of a twentieth between the margins, that has text. */
export function filled(pdf, margin = 12 * 72 / 25.4) {
  const all = objects(pdf);
  const pages = [...all.values()].filter(({ head }) => /\/Type \/Page\b(?!s)/.test(head));
  return pages.map(({ head }) => {
    const high = Number(/\/MediaBox \[\s*\S+ \S+ \S+ (\S+?)\s*\]/.exec(head)[1]);
    const refs = /\/Contents (?:\[([^\]]*)\]|(\d+) 0 R)/.exec(head);
    const numbers = refs[2] ? [refs[2]] : [...refs[1].matchAll(/(\d+) 0 R/g)].map((m) => m[1]);
    const at = heights(all, head, numbers.map((n) => all.get(n).stream).join("\n"), [1, 0, 0, 1, 0, 0], []);
    const bands = new Set(at.map((y) => Math.floor((20 * (high - margin - y)) / (high - 2 * margin))).filter((b) => b >= 0 && b < 20));
    return bands.size / 20;
  });
}
