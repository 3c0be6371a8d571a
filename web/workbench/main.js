// The head of the page, its messages and the keyboard.

import { listen, on, state, step, trouble } from "./talk.js";
import { onOpen, open } from "./tabs.js";
import { shownAgain } from "./plots.js";
import "./where.js";
import "./ladder.js";
import "./effects.js";
import "./next.js";
import "./results.js";
import "./space.js";
import "./correlation.js";
import "./touches.js";
import "./formula.js";
import { exportPanel } from "./export.js";
import { byId, element, show, significant } from "./words.js";

onOpen("plots", shownAgain);

on("live", (live, newer, first) => {
  show("study", `${live.study} · ${live.machine}`);
  document.title = `${live.study}: ${significant(live.rms_um)} µm – axiscal workbench`;
  show("rms", significant(live.rms_um));
  show("noise", significant(live.noise_um));
  const times = live.rms_um / live.noise_um;
  show("times", times > 1.3 ? `: ${significant(times, 2)} times the noise` : "");
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
    show("status", first ? "" : live.undo ?? "");
  }
  verdict();
  if (live.fault.length) trouble({ messages: [{ message: "the study on the disk cannot be used: the page shows it as it was" }, ...live.fault] });
  else if (newer) trouble(null);
});
on("behind", verdict);

/** The sentence of the program; before it is known, what the fit alone says. */
function verdict() {
  const { live, behind } = state;
  const known = behind?.version === live.version ? behind : null;
  const at = byId("verdict");
  const noise = live.explained_by_noise;
  // good is said only once it is known: what is small may still depend on something
  at.dataset.level = known?.headline?.level ?? (noise === false ? "act" : "");
  at.dataset.verdict = known?.diagnosis?.verdict ?? "";
  const soFar = noise === null ? "There are as many unknowns as touches: the model cannot be judged."
    : noise ? "The residual may be noise. Searching for a pattern in it …"
    : "The residual is larger than the noise. Searching for the missing effect …";
  show("verdict", known?.headline?.sentence ?? soFar);
  at.title = known?.headline?.detail ?? "";
  byId("why").hidden = !known?.headline?.why.length;
  byId("why-lines").replaceChildren(...(known?.headline?.why ?? []).map((line) => element("li", {}, line)));
  if (known?.failed.length) trouble({ messages: known.failed });
}

on("trouble", (error) => {
  const words = (error?.messages ?? error?.mistakes ?? (error ? [{ message: String(error.message ?? error) }] : []))
    .map((m) => `${m.place ? `${m.place}: ` : ""}${m.message}${m.help ? `\n  ${m.help}` : ""}`);
  show("messages-text", words.join("\n"));
  byId("messages").hidden = !words.length;
});
byId("messages-close").addEventListener("click", () => trouble(null));

byId("undo").addEventListener("click", () => step("undo"));
byId("redo").addEventListener("click", () => step("redo"));
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
for (const skip of document.querySelectorAll(".skip")) skip.addEventListener("click", () => { if (skip.hash === "#plots") open("plots"); });

exportPanel(byId("export-panel"));

listen();
