// Pictures of the guide with 256 colours: a screen has few, and the file becomes a third as long. PNG as the specification
// has it (W3C, Portable Network Graphics, third edition), as far as Chromium writes it: 8 bits, no interlace.

import { deflateSync, inflateSync } from "node:zlib";

const SIGN = Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]);

/** The check sum of a chunk: older Nodes have none of their own. */
function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let k = 0; k < 8; k += 1) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

function chunks(file) {
  const out = [];
  for (let at = 8; at < file.length;) {
    const length = file.readUInt32BE(at);
    out.push([file.toString("latin1", at + 4, at + 8), file.subarray(at + 8, at + 8 + length)]);
    at += 12 + length;
  }
  return out;
}

/** Width, height, and the colours of all pixels as 0xRRGGBB. */
export function decoded(file) {
  const all = chunks(file);
  const head = all.find(([kind]) => kind === "IHDR")[1];
  const [wide, high, bits, type] = [head.readUInt32BE(0), head.readUInt32BE(4), head[8], head[9]];
  if (bits !== 8 || ![2, 6].includes(type) || head[12] !== 0) throw new Error(`a picture of ${bits} bits, kind ${type}`);
  const n = type === 6 ? 4 : 3;
  const raw = inflateSync(Buffer.concat(all.filter(([kind]) => kind === "IDAT").map(([, data]) => data)));
  const pixels = new Uint32Array(wide * high);
  let above = Buffer.alloc(wide * n);
  for (let y = 0; y < high; y += 1) {
    const from = y * (wide * n + 1);
    const filter = raw[from];
    const row = Buffer.from(raw.subarray(from + 1, from + 1 + wide * n));
    for (let k = 0; k < row.length; k += 1) {
      const left = k >= n ? row[k - n] : 0;
      const up = above[k];
      const corner = k >= n ? above[k - n] : 0;
      const p = left + up - corner;
      const [a, b, c] = [Math.abs(p - left), Math.abs(p - up), Math.abs(p - corner)];
      const paeth = a <= b && a <= c ? left : b <= c ? up : corner;
      row[k] = (row[k] + [0, left, up, (left + up) >> 1, paeth][filter]) & 255;
    }
    for (let x = 0; x < wide; x += 1) pixels[y * wide + x] = (row[x * n] << 16) | (row[x * n + 1] << 8) | row[x * n + 2];
    above = row;
  }
  return { wide, high, pixels };
}

function distance(a, b) {
  const d = (shift) => ((a >> shift) & 255) - ((b >> shift) & 255);
  return d(16) ** 2 + 2 * d(8) ** 2 + d(0) ** 2;
}

/** The same picture with at most 256 colours: the most frequent ones that differ, and the nearest of them for the rest. */
export function smaller(file) {
  const { wide, high, pixels } = decoded(file);
  const count = new Map();
  for (const p of pixels) count.set(p, (count.get(p) ?? 0) + 1);
  const frequent = [...count].sort((a, b) => b[1] - a[1]).map(([colour]) => colour);
  let palette = frequent;
  for (let apart = 12; palette.length > 256; apart *= 2) {
    palette = [];
    for (const colour of frequent) {
      if (palette.every((p) => distance(p, colour) >= apart)) palette.push(colour);
      if (palette.length > 256) break;
    }
  }
  const nearest = new Map();
  for (const colour of frequent) {
    let best = 0;
    palette.forEach((p, i) => { if (distance(p, colour) < distance(palette[best], colour)) best = i; });
    nearest.set(colour, best);
  }
  const rows = Buffer.alloc(high * (wide + 1));
  for (let y = 0; y < high; y += 1) for (let x = 0; x < wide; x += 1) rows[y * (wide + 1) + 1 + x] = nearest.get(pixels[y * wide + x]);
  const head = Buffer.alloc(13);
  head.writeUInt32BE(wide, 0);
  head.writeUInt32BE(high, 4);
  head.set([8, 3, 0, 0, 0], 8);
  const colours = Buffer.from(palette.flatMap((p) => [p >> 16, (p >> 8) & 255, p & 255]));
  const chunk = (kind, data) => {
    const out = Buffer.alloc(12 + data.length);
    out.writeUInt32BE(data.length, 0);
    out.write(kind, 4, "latin1");
    data.copy(out, 8);
    out.writeUInt32BE(crc32(out.subarray(4, 8 + data.length)), 8 + data.length);
    return out;
  };
  return Buffer.concat([SIGN, chunk("IHDR", head), chunk("PLTE", colours), chunk("IDAT", deflateSync(rows, { level: 9 })), chunk("IEND", Buffer.alloc(0))]);
}
