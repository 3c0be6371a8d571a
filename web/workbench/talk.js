// Talks with the server, and holds what it has said: `inputs` (touches, effects), `live` (the fit) and `behind` (evidence).

import { ask, headers } from "./ask.js";
import { listenTogether } from "./events.js";
import { later, released, soonest } from "./later.js";

export const state = { inputs: null, live: null, behind: null, preview: null };

const listeners = { live: [], behind: [], job: [], trouble: [], preview: [] };
export const on = (what, listener) => listeners[what].push(listener);
const tell = (what, ...words) => listeners[what].forEach((listener) => listener(...words));

/** Puts a new state in the place of the old one; an older one that arrives late is dropped. */
async function put(live) {
  const late = () => state.live && live.version < state.live.version;
  const known = () => state.inputs?.inputs === live.inputs;
  await released();
  if (late()) return;
  if (!known()) {
    const inputs = await ask("/api/inputs");
    await released();
    if (inputs.inputs !== live.inputs) return refresh();
    // two states that came together both ask; the touches that the plots hold are not exchanged for the same ones
    if (late()) return;
    if (!known()) state.inputs = inputs;
  }
  const first = !state.live;
  const newer = first || live.version !== state.live.version;
  state.live = live;
  if (newer) setPreview(null);
  tell("live", live, newer, first);
  tell("job", live.job);
}

export async function refresh() {
  await put(await ask("/api/state"));
}

async function refreshBehind() {
  const behind = await ask("/api/evidence");
  await released();
  if (!state.live || behind.version !== state.live.version) return;
  state.behind = behind;
  tell("behind", behind);
}

export function trouble(error) {
  tell("trouble", error);
}

let busy = false;
let last = Promise.resolve();
/** What the steps ask for that wait or are being made. */
const asked = new Set();

/** Makes a step. Steps follow one another, each from the state at its turn: no click is lost. A step that is asked for already is
 *  not made twice. `first` is done before it. */
export function step(what, first = null) {
  const own = JSON.stringify(what);
  if (asked.has(own)) return Promise.resolve(false);
  asked.add(own);
  const made = last.then(() => make(what, first)).finally(() => asked.delete(own));
  last = made.catch(() => {});
  return made;
}

async function make(what, first) {
  // a state that waits for the end of the press comes first
  await released();
  if (!state.live) return false;
  busy = true;
  const began = performance.now();
  try {
    tell("trouble", null);
    await first?.();
    const live = await ask("/api/step", { version: state.live.version, ask: what });
    const answered = performance.now();
    await put(live);
    const drawn = performance.now();
    const times = { answered: answered - began, drawn: drawn - began, fit: live.fit_ms };
    later("settled", () => { window.axiscalTimes = { ...times, settled: performance.now() - began }; });
    await new Promise((done) => soonest("painted", () => { times.painted = performance.now() - began; done(); }));
    return true;
  } catch (error) {
    if (error.error === "stale") await refresh().catch(trouble);
    trouble(error);
    return false;
  } finally {
    busy = false;
  }
}

let tries = 0;

/** What an effect would do, without a step: its curve over the residual. */
export async function tryOut(what) {
  const mine = ++tries;
  const found = await ask("/api/try", { version: state.live.version, ...what });
  if (mine === tries && found.version === state.live.version) setPreview(found);
  return found;
}

/** What an effect takes away from the residual of each touch, µm, to first order; null where only the fit can say it. */
export async function expectation(effect) {
  const { curve_um: curve } = await ask("/api/expect", { version: state.live.version, effect });
  return curve;
}

/** A starting formula for what no known effect explains. */
export const sketched = () => ask("/api/sketch", { version: state.live.version });

export function setPreview(found) {
  if (found === null) tries += 1;
  if (state.preview === found) return;
  state.preview = found;
  tell("preview", found);
}

export async function call(what) {
  await ask("/api/call", { version: state.live.version, ...what });
}

/** Hears of every change, in this tab, in another one, and on the disk. */
export const listen = () => listenTogether(headers["x-axiscal-token"], stream, heard);

/** Tells every event of the server; comes back by itself when the line breaks. */
async function stream(tell) {
  let pause = 500;
  for (;;) {
    let says = { messages: [{ message: "the workbench does not answer", help: "is it still running in the terminal? this page looks again by itself" }] };
    try {
      const response = await fetch("/api/events", { headers });
      if (!response.ok) throw await response.json();
      pause = 500;
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let text = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        text += value;
        const parts = text.split("\n\n");
        text = parts.pop();
        for (const part of parts) {
          const line = part.split("\n").find((l) => l.startsWith("data:"));
          if (line) tell(JSON.parse(line.slice(5)));
        }
      }
    } catch (error) {
      if (error.messages) {
        if (!state.live && error.error !== "streams") return trouble(error);
        says = { messages: error.messages };
      }
    }
    tell({ what: "lost", says });
    await new Promise((again) => setTimeout(again, pause));
    pause = Math.min(5000, pause * 2);
  }
}

function heard(event) {
  const known = state.live?.version ?? 0;
  const newer = event.version > known;
  const work = {
    hello: async () => { await refresh(); tell("trouble", null); await refreshBehind(); },
    lagged: async () => { await refresh(); await refreshBehind(); },
    // a step of this page brings its state itself
    state: async () => { if (newer && !busy) await refresh(); },
    scores: refreshBehind,
    evidence: async () => { if (!busy) await refresh(); await refreshBehind(); },
    job: refresh,
    lost: async () => trouble(event.says),
  }[event.what];
  if (work) work().catch(trouble);
}
