// What to do next, as the program decided it, with a button where the page can do it itself.

import { state, on, call, trouble } from "./talk.js";
import { switchEffect } from "./effects.js";
import { openFormula, sketch } from "./formula.js";
import { open } from "./tabs.js";
import { byId, element } from "./words.js";

/** Steps that are shown at once; the rest is behind a fold. */
const FIRST = 3;

const BUTTONS = {
  add: (act) => [`Add ${state.inputs.effects.find((e) => e.id === act.effect)?.name ?? act.effect}`, () => switchEffect(act.effect, true)],
  "measure-more": () => [`Write the next program (${byId("minutes").value} min)`, () => byId("plan-next").click()],
  export: () => ["Export the compensation", () => byId("open-export").click()],
  sketch: () => ["Sketch it for me", sketch],
};

function button(next, isMain) {
  const [label, press] = BUTTONS[next.act.do]?.(next.act) ?? [];
  return label ? element("button", { type: "button", class: isMain ? "primary" : null, "data-do": next.act.do, click: press }, label) : null;
}

function card(next, isMain) {
  return element("li", {}, element("strong", {}, next.what), element("p", {}, next.how), isMain ? null : button(next, false));
}

function draw() {
  const { live, behind } = state;
  const known = behind?.version === live.version && behind.complete;
  const all = known ? behind.next : [];
  // the first that the page can do stands above the reasons, in reach without scrolling
  const main = all.findIndex((n) => n.act.do !== "nothing");
  const cards = all.map((n, i) => card(n, i === main));
  byId("main-step").replaceChildren(...(main < 0 ? [] : [button(all[main], true)]));
  const rest = cards.slice(FIRST);
  byId("advice").replaceChildren(...cards.slice(0, FIRST),
    ...(rest.length ? [element("li", {}, element("details", {}, element("summary", {}, `${rest.length} more`), element("ol", {}, rest)))] : []),
    ...(known ? [] : [element("li", {}, "searching …")]));
  byId("advice").dataset.complete = String(known);
  // one button for a thing
  byId("open-export").hidden = all[main]?.act.do === "export";
}
on("live", (live, newer) => { if (newer) draw(); });
on("behind", draw);

byId("plan-next").addEventListener("click", async () => {
  try {
    trouble(null);
    await call({ verb: "plan-next", controller: byId("controller").value, minutes: Number(byId("minutes").value) });
  } catch (error) {
    trouble(error);
  }
});
byId("open-export").addEventListener("click", () => open("export-view"));
on("live", () => {
  const select = byId("controller");
  if (select.options.length) return;
  const last = state.inputs.runs[state.inputs.runs.length - 1]?.controller;
  select.replaceChildren(...state.inputs.controllers.map((c) => element("option", { value: c, selected: c === last }, c)));
});
on("job", (job) => {
  const at = byId("job");
  at.dataset.state = !job ? "" : !job.answered && !job.failed.length ? "running" : job.answered?.code === 0 ? "done" : "failed";
  if (!job) {
    at.textContent = "";
  } else if (at.dataset.state === "running") {
    at.textContent = job.verb === "export" ? "The compensation is being written …" : "The next touches are being chosen …";
  } else if (job.verb === "export" && job.answered?.code !== 0) {
    // the reasons stand beside the questions that answer them
    at.textContent = "Nothing was written: the reason stands under Export.";
  } else if (job.failed.length) {
    at.textContent = job.failed.map((m) => m.message).join("\n");
  } else {
    const { answer, messages, folder, code } = job.answered;
    const says = code === 0 ? `${job.verb}: written into ${folder} beside the study` : `${job.verb} could not be done`;
    const more = job.verb === "plan-next" && answer?.touches ? `, ${answer.touches} touches, about ${Math.ceil(answer.time_s / 60)} min` : answer?.says ? `: ${answer.says}` : "";
    const separates = answer?.separates ? `\n${answer.separates.join("\n")}` : "";
    const files = answer?.files ? `\n${answer.files.join(", ")}` : "";
    at.textContent = job.verb === "export" ? `Written into ${folder}: see Export.` : `${says}${more}${separates}${files}${messages.length ? `\n${messages.join("\n")}` : ""}`;
  }
  byId("plan-next").disabled = at.dataset.state === "running";
});
byId("own-formula").addEventListener("click", openFormula);
byId("sketch").addEventListener("click", sketch);
