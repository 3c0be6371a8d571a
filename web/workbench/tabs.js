// The views in the middle of the page: one is shown, the others are drawn when they are opened.

import { byId } from "./words.js";

const tabs = [...byId("tabs").children];
const listeners = {};

/** Called when a view is opened. */
export const onOpen = (id, listener) => { (listeners[id] ??= []).push(listener); };
export const isOpen = (id) => !byId(id).hidden;

export function open(id) {
  for (const tab of tabs) {
    const isIt = tab.getAttribute("aria-controls") === id;
    tab.setAttribute("aria-selected", String(isIt));
    tab.tabIndex = isIt ? 0 : -1;
    byId(tab.getAttribute("aria-controls")).hidden = !isIt;
  }
  listeners[id]?.forEach((listener) => listener());
}

for (const tab of tabs) tab.addEventListener("click", () => open(tab.getAttribute("aria-controls")));
byId("tabs").addEventListener("keydown", (e) => {
  const way = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
  if (!way) return;
  e.preventDefault();
  const next = tabs[(tabs.indexOf(document.activeElement) + way + tabs.length) % tabs.length];
  next.focus();
  open(next.getAttribute("aria-controls"));
});
