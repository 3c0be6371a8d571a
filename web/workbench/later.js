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

let release = null;
let up = Promise.resolve();

/** When no click is under way: what is drawn again under a pointer that is down swallows its click. */
export const released = () => up;

addEventListener("pointerdown", () => {
  if (release) return;
  up = new Promise((done) => {
    release = () => { release = null; done(); };
    // who holds the pointer down for longer does not click
    setTimeout(release, 500);
  });
}, true);
// the click itself comes right after the pointer goes up
addEventListener("pointerup", () => setTimeout(() => release?.()), true);

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
