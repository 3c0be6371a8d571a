// What need not be on the screen at once: done after the next paint, one job a turn, so that a click is never waited for.

const jobs = new Map();
let waiting = false;

/** Does a job after the next paint; another one of the same name takes its place. */
export function later(name, job) {
  jobs.delete(name);
  jobs.set(name, job);
  wake();
}

/** The same, before all that waits already. */
export function soonest(name, job) {
  const rest = [...jobs].filter(([other]) => other !== name);
  jobs.clear();
  jobs.set(name, job);
  rest.forEach(([other, of]) => jobs.set(other, of));
  wake();
}

/** Forgets a job. */
export const never = (name) => jobs.delete(name);

const LONGEST_PRESS_MS = 500;
let endOfPress = null;
let up = Promise.resolve();

/** Resolves when the pointer is up, after half a second at most: a list that is drawn again during a press loses the click. */
export const released = () => up;

addEventListener("pointerdown", () => {
  endOfPress?.();
  up = new Promise((done) => {
    const end = () => {
      clearTimeout(timer);
      if (endOfPress === end) endOfPress = null;
      done();
    };
    const timer = setTimeout(end, LONGEST_PRESS_MS);
    endOfPress = end;
  });
}, true);
addEventListener("pointerup", () => {
  const end = endOfPress;
  // the click itself comes right after the pointer goes up
  setTimeout(() => end?.());
}, true);

function wake() {
  if (waiting) return;
  waiting = true;
  let begun = false;
  const begin = () => {
    if (begun) return;
    begun = true;
    setTimeout(turn);
  };
  requestAnimationFrame(begin);
  // a page behind another one is not painted
  setTimeout(begin, 500);
}

async function turn() {
  await released();
  const [name, job] = jobs.entries().next().value ?? [];
  jobs.delete(name);
  try {
    job?.();
  } finally {
    if (jobs.size) setTimeout(turn);
    else waiting = false;
  }
}
