// The head of the page, its messages, the keyboard, and the verbs that write files.

import { call, listen, on, state, step, trouble } from "./talk.js";
import { rescale } from "./plots.js";
import "./space.js";
import "./correlation.js";
import "./effects.js";
import "./touches.js";
import "./formula.js";
import { byId, element, show, significant, stated } from "./words.js";

on("live", (live, newer, first) => {
  show("study", `${live.study} · ${live.machine}`);
  document.title = `${live.study}: ${significant(live.rms_um)} µm – axiscal workbench`;
  show("rms", significant(live.rms_um));
  show("noise", significant(live.noise_um));
  show("chi2", significant(live.chi2_per_dof));
  show("used", `${live.used} of ${live.touches}`);
  const steps = live.ladder.steps;
  show("held-out", significant(steps[steps.length - 1]?.held_out_rms_um));
  for (const [id, what] of [["undo", live.undo], ["redo", live.redo]]) {
    byId(id).disabled = !what;
    byId(id).title = what ?? "";
    byId(id).setAttribute("aria-label", what ? `${id}: ${what}` : id);
  }
  if (newer) {
    document.body.dataset.version = live.version;
    show("status", first ? "" : `${live.undo ? `done: ${live.undo}; ` : ""}${significant(live.rms_um)} µm RMS, noise ${significant(live.noise_um)} µm`);
    parameters(live);
  }
  verdict();
  if (live.fault.length) trouble({ messages: [{ message: "the study on the disk cannot be used: the page shows it as it was" }, ...live.fault] });
  else if (newer) show("messages", "");
});
on("behind", () => { verdict(); });

function verdict() {
  const { live, behind } = state;
  const found = behind?.version === live.version ? behind.diagnosis : null;
  const at = byId("verdict");
  const noise = live.explained_by_noise;
  const bad = found ? ["missing-effect", "unexplained"].includes(found.verdict) && !found.faint : noise === false;
  // good is said only once it is known: what is small may still depend on something
  at.className = bad ? "bad" : found?.verdict === "adequate" ? "good" : "";
  at.dataset.verdict = found?.verdict ?? "";
  const ratio = significant(Math.sqrt(live.chi2_per_dof), 2);
  const soFar = noise === null ? "There are as many unknowns as touches: the model cannot be judged."
    : noise ? "The residual is as small as the noise. Searching for a pattern in it …"
    : `The residuals are ${ratio} times the noise. Searching for the missing effect …`;
  const first = found?.candidates[0];
  // several effects would do, and no touches are left over to try one of them on
  const untried = (c) => c.p_adjusted < 0.05 && !(c.held_out_before_um > 0 || c.held_out_after_um > 0);
  const open = found?.verdict === "unexplained" && !found.faint && first && !first.proposed && untried(first)
    ? new Set(found.candidates.filter(untried).flatMap((c) => [c.effect, ...c.same_as])) : new Set();
  const which = open.size > 1 ? `one of ${open.size} known effects explains it; these poses cannot decide which.` : `one known effect explains it (${first?.name}); these poses cannot confirm it.`;
  const says = open.size ? `An effect is missing in the model (${found.rms_um.toFixed(2)} µm RMS against ${found.noise_um.toFixed(2)} µm noise): ${which}` : found?.says;
  show("verdict", says ?? soFar);
  show("advice", !found ? "" : found.verdict === "missing-effect" && first
    ? `Open ${first.name} in the list, look at its curve over the touches, and switch it on if it is what the machine shows.${first.same_as.length ? ` It cannot be separated from ${[...first.same_as, ...(first.or_else ? [first.or_else] : [])].join(", ")}: a further program can.` : ""}`
    : found.faint ? "The residual is as small as the noise, except for a weak pattern: write the program that shows whether it is real."
    : open.size ? "Measure further poses: write a program that separates more, or run the full program."
    : found.verdict === "unexplained" ? "No known effect explains the residual: try a formula of your own, or check the outliers."
    : found.verdict === "adequate" ? "The model is complete as far as these touches can measure: write the compensation." : "There are too few touches to judge: write a further program.");
  const t = live.tolerance;
  const partly = !found || found.verdict === "adequate" ? "" : `; these values ${found.faint || found.verdict === "too-little-data" ? "may include" : "include"} part of the missing error`;
  byId("parameters").caption.textContent = `Results with their 95 % uncertainty, against ${t.error_um} µm at ${t.radius_mm} mm${partly}`;
  if (behind?.version === live.version && behind.failed.length) trouble({ messages: behind.failed });
}

function parameters(live) {
  const table = byId("parameters");
  const VERDICTS = { within: "within", beyond: "too large", open: "uncertain", none: "" };
  const head = ["result", "value", "±, 95 %", "unit", "tolerance", "as bar"].map((h) => element("th", { scope: "col" }, h));
  const size = (p) => Math.abs(p.value) + (p.expanded ?? 0);
  const top = {};
  for (const p of live.parameters) top[p.unit] = Math.max(top[p.unit] ?? 0, size(p));
  const rows = live.parameters.map((p) => {
    const told = p.sigma !== null;
    return element("tr", {}, element("td", { class: "word" }, p.name, element("small", {}, p.says)), element("td", {}, told || p.status === "fixed" ? stated(p.value, p.sigma) : "not determined"),
      element("td", {}, significant(p.expanded, 2)), element("td", { class: "word" }, p.unit), element("td", { class: "word" }, p.tolerance === null ? "–" : `${told && VERDICTS[p.judgement] ? `${VERDICTS[p.judgement]}: ` : ""}${significant(p.tolerance)}`), element("td", {}, told ? bar(p, top[p.unit]) : ""));
  });
  table.replaceChildren(table.caption, element("thead", {}, element("tr", {}, head)), element("tbody", {}, rows));
  const remarks = [...live.warnings, ...live.undetermined.map((u) => `not determined: ${u.says}`)].filter((r, i, all) => all.indexOf(r) === i);
  byId("warnings").replaceChildren(...remarks.map((r) => element("li", {}, r)));
}

/** Value and 95 % band on a line from −top to +top. */
function bar(p, top) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  for (const [k, v] of Object.entries({ viewBox: "-100 -8 200 16", width: 80, height: 14, "aria-hidden": "true" })) svg.setAttribute(k, v);
  const scaled = (v) => (95 * v) / (top || 1);
  const draw = (tag, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [k, v] of Object.entries(attributes)) made.setAttribute(k, v);
    svg.append(made);
  };
  draw("line", { x1: -100, x2: 100, y1: 0, y2: 0, stroke: "currentColor", "stroke-opacity": 0.3 });
  draw("line", { x1: 0, x2: 0, y1: -7, y2: 7, stroke: "currentColor", "stroke-opacity": 0.6 });
  draw("line", { x1: scaled(p.value - (p.expanded ?? 0)), x2: scaled(p.value + (p.expanded ?? 0)), y1: 0, y2: 0, stroke: "currentColor", "stroke-width": 5, "stroke-opacity": 0.45 });
  draw("circle", { cx: scaled(p.value), cy: 0, r: 5, fill: "currentColor" });
  return svg;
}

on("trouble", (error) => {
  const words = (error?.messages ?? error?.mistakes ?? (error ? [{ message: String(error.message ?? error) }] : []))
    .map((m) => `${m.place ? `${m.place}: ` : ""}${m.message}${m.help ? `\n  ${m.help}` : ""}`);
  show("messages", words.join("\n"));
});

byId("undo").addEventListener("click", () => step("undo"));
byId("redo").addEventListener("click", () => step("redo"));
byId("rescale").addEventListener("click", rescale);
document.addEventListener("keydown", (e) => {
  const typing = e.target.matches?.("input:not([type=checkbox]), select, textarea");
  if (typing) return;
  const key = e.key.toLowerCase();
  if ((e.ctrlKey || e.metaKey) && (key === "z" || key === "y")) {
    e.preventDefault();
    step(key === "y" || e.shiftKey ? "redo" : "undo");
  } else if (key === "/" && !e.ctrlKey && !e.metaKey) {
    e.preventDefault();
    byId("find").focus();
  }
});

for (const verb of ["plan-next", "export"]) {
  byId(verb).addEventListener("click", async () => {
    const what = { verb, controller: byId("controller").value };
    if (verb === "plan-next") what.minutes = Number(byId("minutes").value);
    try {
      trouble(null);
      await call(what);
    } catch (error) {
      trouble(error);
    }
  });
}
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
    at.textContent = `${job.verb} is at work …`;
  } else if (job.failed.length) {
    at.textContent = job.failed.map((m) => m.message).join("\n");
  } else {
    const { answer, messages, folder, code } = job.answered;
    const says = code === 0 ? `${job.verb}: written into ${folder} beside the study` : `${job.verb} could not be done`;
    const more = job.verb === "plan-next" && answer?.touches ? `, ${answer.touches} touches, about ${Math.ceil(answer.time_s / 60)} min` : answer?.says ? `: ${answer.says}` : "";
    const files = answer?.files ? `\n${answer.files.join(", ")}` : "";
    at.textContent = `${says}${more}${files}${messages.length ? `\n${messages.join("\n")}` : ""}`;
  }
  for (const verb of ["plan-next", "export"]) byId(verb).disabled = at.dataset.state === "running";
});

listen();
