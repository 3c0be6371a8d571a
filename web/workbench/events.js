// One stream of events for all tabs of a session. A browser opens six connections to a server at most: with a stream in every tab the
// seventh tab would get no answer any more.
//
// The tabs elect one of them (Web Locks). It listens to the server, and passes every event on to the others (BroadcastChannel). When
// it is closed the lock goes to the next tab, which opens a stream of its own; the server greets it, and that greeting makes every
// tab look at the state again. In a browser without locks or channels each tab has its own stream.

/** A name for locks and channels that all tabs with this token share, and that does not show the token. */
async function nameOf(token) {
  const digest = await crypto.subtle.digest("SHA-256", new TextEncoder().encode(token));
  return `axiscal-events-${[...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("")}`;
}

/** `stream(tell)` listens to the server and ends only when that is useless; `heard` is called with every event. */
export async function listenTogether(token, stream, heard) {
  if (!navigator.locks || !globalThis.BroadcastChannel || !crypto.subtle) return stream(heard);
  const name = await nameOf(token);
  const channel = new BroadcastChannel(name);
  channel.onmessage = ({ data }) => heard(data);
  const lead = () => stream((event) => { channel.postMessage(event); heard(event); });
  let leads = false;
  await navigator.locks.request(name, { ifAvailable: true }, (lock) => { leads = lock !== null; return leads ? lead() : null; });
  if (leads) return;
  // another tab listens already: the server does not greet this one
  heard({ what: "hello", version: 0 });
  await navigator.locks.request(name, lead);
}
