// Every touch in a table, the worst first; choosing touches and taking them out, each with a reason.

import { later } from "./later.js";
import { state, on, step } from "./talk.js";
import { choose, chosen, hover, onHover, onPick, unchoose } from "./plots.js";
import { byId, element, show, significant } from "./words.js";

const PAGE = 25;
let page = 0;
let by = "worst";
let order = [];
let rows = new Map();

const COLUMNS = [
  ["touch", (t, i) => `${t.run[i]}/${t.id[i]}`, (t, i) => t.run[i] * 1e9 + t.id[i]],
  ["residual, µm", (t, i) => significant(state.live.residual_um[i]), (t, i) => -Math.abs(state.live.residual_um[i]), "worst"],
  ["how unusual", (t, i) => significant(state.live.standardised[i]), (t, i) => -Math.abs(state.live.standardised[i])],
  ["block", (t, i) => t.words[t.block[i]], (t, i) => t.words[t.block[i]]],
  ["face", (t, i) => t.words[t.face[i]], (t, i) => t.words[t.face[i]]],
  ["stage", (t, i) => t.words[t.stage[i]], (t, i) => t.words[t.stage[i]]],
  ["rotary axes, °", (t, i) => ["A", "B", "C"].filter((a) => t.axes[a]).map((a) => `${a} ${significant(t.axes[a][i])}`).join(" "), (t, i) => i],
  ["line in the log", (t, i) => t.line[i], (t, i) => t.line[i]],
];

function sort() {
  const t = state.inputs.touches;
  const key = COLUMNS.find((c) => (c[3] ?? c[0]) === by)[2];
  const keys = Array.from({ length: t.n }, (_, i) => key(t, i));
  order = keys.map((_, i) => i).sort((a, b) => (keys[a] < keys[b] ? -1 : keys[a] > keys[b] ? 1 : a - b));
}

function draw() {
  const t = state.inputs.touches;
  const out = new Map(state.live.rejected);
  const picked = chosen();
  const table = byId("touch-table");
  const head = COLUMNS.map(([name, , , id]) => element("th", { scope: "col", "aria-sort": by === (id ?? name) ? "ascending" : null, title: name === "how unusual" ? "the residual over what the other touches let expect (studentised): beyond 4 chance alone seldom makes it" : null },
    element("button", { type: "button", click: () => { by = id ?? name; page = 0; sort(); draw(); } }, name)));
  rows = new Map();
  const body = order.slice(page * PAGE, (page + 1) * PAGE).map((i) => {
    const box = element("input", { type: "checkbox", "aria-label": `touch ${t.id[i]} of run ${t.run[i]}`, change: (e) => (e.target.checked ? choose([i], true) : unchoose(i)) });
    box.checked = picked.has(i);
    const cells = COLUMNS.map(([, text]) => element("td", {}, String(text(t, i))));
    const row = element("tr", { class: out.has(i) ? "out" : null, pointerenter: () => hover(i), pointerleave: () => hover(null), focusin: () => hover(i), focusout: () => hover(null) },
      element("td", {}, box), cells, element("td", { class: "word" }, out.get(i) ?? ""));
    rows.set(i, row);
    return row;
  });
  const at = document.activeElement;
  const label = at?.matches?.("#touch-table input") ? at.getAttribute("aria-label") : null;
  table.replaceChildren(table.caption,
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "choose"), head, element("th", { scope: "col", class: "word" }, "why it is not used"))),
    element("tbody", {}, body));
  if (label) table.querySelector(`[aria-label="${CSS.escape(label)}"]`)?.focus({ preventScroll: true });
  const pages = Math.max(1, Math.ceil(t.n / PAGE));
  show("touch-page", `page ${page + 1} of ${pages}, ${t.n} touches`);
  byId("earlier-touches").disabled = page === 0;
  byId("later-touches").disabled = page + 1 >= pages;
}

function count() {
  const n = chosen().size;
  const masked = new Set(state.live?.masked ?? []);
  const back = [...chosen()].filter((i) => masked.has(i)).length;
  show("chosen", n === 0 ? "no touch is selected" : `${n} ${n === 1 ? "touch is" : "touches are"} selected`);
  byId("take-out").disabled = n === back;
  byId("take-back").disabled = back === 0;
  byId("choose-none").disabled = n === 0;
}

const named = (touches) => touches.map((i) => [state.inputs.touches.run[i], state.inputs.touches.id[i]]);

byId("mask").addEventListener("submit", async (e) => {
  e.preventDefault();
  const reason = byId("reason").value.trim();
  if (!reason) {
    byId("reason").setAttribute("aria-invalid", "true");
    byId("reason").focus();
    show("chosen", "say why these touches are excluded: the reason is written into the study");
    return;
  }
  byId("reason").removeAttribute("aria-invalid");
  const masked = new Set(state.live.masked);
  if (await step({ mask: { touches: named([...chosen()].filter((i) => !masked.has(i))), reason } })) choose([]);
});
byId("take-back").addEventListener("click", async () => {
  const masked = new Set(state.live.masked);
  if (await step({ unmask: { touches: named([...chosen()].filter((i) => masked.has(i))) } })) choose([]);
});
byId("choose-none").addEventListener("click", () => choose([]));
byId("earlier-touches").addEventListener("click", () => { page = Math.max(0, page - 1); draw(); });
byId("later-touches").addEventListener("click", () => { page += 1; draw(); });

/** A long table is put in order when the plots are on the screen. */
function anew() {
  if (!state.live || !state.inputs) return;
  sort();
  page = Math.min(page, Math.max(0, Math.ceil(state.inputs.touches.n / PAGE) - 1));
  draw();
  count();
}
on("live", (live, newer) => { if (newer) later("touches", anew); });
onPick(() => { draw(); count(); });

onHover((i) => {
  for (const row of rows.values()) row.classList.remove("hot");
  rows.get(i)?.classList.add("hot");
});
