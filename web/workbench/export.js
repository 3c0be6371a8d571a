// The compensation as the control's own files: the same questions as `axiscal export`, and the files to download.

import { ask, download, lines, upload } from "./ask.js";
import { call, on, state } from "./talk.js";
import { element } from "./words.js";

const SHOWN = 12;
const some = (names) => (names.length > SHOWN ? `${names.slice(0, SHOWN).join(", ")} and ${names.length - SHOWN} more` : names.join(", "));

/** Options of the command line, as the page has them. */
const HERE = [[/--accept-unverified/g, "the box “Write entries that were not tried”"], [/--force/g, "the box under “if the export is refused”"],
  [/--(?:backup|ini) FILE/g, "the file above"], [/--old "[^"]*"/g, "“old values” above"], [/--unit inch/g, "the unit above"]];
const onThePage = (help) => HERE.reduce((text, [option, words]) => text.replace(option, words), help);

/**
 * Builds the form inside an element. The element needs nothing; the form asks the server what each control needs once the
 * first state is there.
 */
export function exportPanel(container) {
  const id = (name) => `export-${name}`;
  const field = (name, label, control) => element("p", { id: id(`${name}-field`) }, element("label", { for: id(name) }, label), " ", control);
  const box = (name, label) => element("p", { id: id(`${name}-field`) }, element("label", {}, element("input", { type: "checkbox", id: id(name) }), " ", label));
  const controller = element("select", { id: id("controller"), change: () => choose() });
  const says = element("p", { class: "hint", id: id("says") });
  const file = element("input", { type: "file", id: id("file"), "aria-describedby": id("file-hint") });
  const paste = element("textarea", { id: id("paste"), rows: 4, spellcheck: "false" });
  const version = element("select", { id: id("version") });
  const unit = element("select", { id: id("unit") }, element("option", { value: "mm" }, "mm"), element("option", { value: "inch" }, "inch"));
  const old = element("textarea", { id: id("old"), rows: 3, spellcheck: "false", placeholder: "NAME=VALUE", "aria-describedby": id("old-hint") });
  const fileLabel = element("label", { for: id("file") });
  const unverified = element("span");
  const write = element("button", { type: "submit", id: "export" }, "Write the compensation");
  const answer = element("div", { id: id("answer"), role: "status" });
  const form = element("form", { id: id("form"), autocomplete: "off", submit: (event) => { event.preventDefault(); begin(); } },
    field("controller", "control", controller), says,
    element("p", { id: id("file-field") }, fileLabel, " ", file),
    element("p", { class: "hint", id: id("file-hint") }, "The identified errors are added to the values that the control has now. Without them, changes are listed in place of some values."),
    element("details", {}, element("summary", {}, "paste it, or give old values one by one"),
      field("paste", "text of the file", paste), field("old", "old values, one a line", old), element("p", { class: "hint", id: id("old-hint") })),
    field("version", "version", version), field("unit", "unit of lengths in the control's tables", unit),
    box("unverified", unverified),
    element("details", {}, element("summary", {}, "if the export is refused"),
      box("force", "Write it all the same: values beyond the limits, values of a model that lacks something, and over an earlier export that holds other old values.")),
    element("p", {}, write));
  container.replaceChildren(element("h3", {}, "Write the compensation"), form, answer);

  let forms = [];
  let busy = false;
  const byName = (name) => container.querySelector(`#${id(name)}`);
  const chosen = () => forms.find((f) => f.name === controller.value);

  /** Fields that are asked only where the tables can describe the machine. */
  const questions = () => [...form.querySelectorAll(":scope > p, :scope > details")].filter((at) => at !== says && at.id !== id("controller-field"));

  function choose() {
    const now = chosen();
    if (!now) return;
    // what was said of another control is no answer for this one
    tell([]);
    for (const at of questions()) at.hidden = Boolean(now.cannot);
    if (now.cannot) byName("says").textContent = `${now.says}. ${now.cannot}`;
    write.disabled = Boolean(now.cannot) || busy;
    if (now.cannot) return;
    says.textContent = now.says;
    fileLabel.textContent = now.present === "ini" ? "the machine's INI file" : "the control's backup of the values that change";
    byName("version-field").hidden = now.versions.length < 2;
    version.replaceChildren(...now.versions.map((v) => element("option", { value: v.name }, `${v.name}: ${v.says}`)));
    byName("unit-field").hidden = !now.inch;
    byName("unverified-field").hidden = !now.unverified.length;
    byName("unverified").checked = false;
    unverified.textContent = `Write entries that were not tried on a real control (${some(now.unverified)}). I compare each with the control's manual and backup before I load it.`;
    byName("old-field").hidden = !now.values.length;
    byName("old-hint").hidden = !now.values.length;
    byName("old-hint").textContent = `names: ${some(now.values)}`;
  }

  on("live", async () => {
    if (forms.length || container.dataset.asked) return;
    container.dataset.asked = "yes";
    try {
      forms = await ask("/api/export");
    } catch (error) {
      tell(lines(error));
      return;
    }
    const runs = (state.inputs?.runs ?? []).map((r) => r.controller);
    controller.replaceChildren(...forms.map((f) => element("option", { value: f.name, selected: runs.at(-1) === f.name }, f.name)));
    choose();
  });

  const tell = (texts, ...more) => answer.replaceChildren(...texts.map((text) => element("p", { class: "said" }, text)), ...more);

  /** Why nothing was written: what must be answered first, with the same answer once. */
  function refused(findings, messages) {
    const errors = findings.filter((f) => f.severity === "error");
    const remedies = [...new Set(errors.map((f) => f.help ?? ""))];
    if (!errors.length) return tell(["Nothing was written.", ...messages]);
    tell(["Nothing was written:"], ...remedies.flatMap((help) => [
      element("ul", {}, ...errors.filter((f) => (f.help ?? "") === help).map((f) => element("li", {}, `${f.file ? `${f.file}:${f.line}:${f.column}: ` : ""}${f.says}`))),
      ...(help ? [element("p", {}, element("strong", {}, "What to do: "), onThePage(help))] : []),
    ]));
  }

  async function begin() {
    const now = chosen();
    if (!now) return;
    tell([]);
    try {
      const typed = paste.value.trim() ? await upload(new Blob([paste.value]), "the pasted text") : null;
      const answers = {
        accept_unverified: byName("unverified").checked && now.unverified.length > 0,
        force: byName("force").checked,
        inch: now.inch && unit.value === "inch",
        target: now.versions.length > 1 ? version.value : null,
        old: old.value.split("\n").map((line) => line.trim()).filter(Boolean),
        present: file.files[0] ? await upload(file.files[0]) : typed,
      };
      await call({ verb: "export", controller: now.name, answers });
    } catch (error) {
      tell(lines(error));
    }
  }

  on("job", (job) => {
    // one task at a time, whichever it is
    busy = Boolean(job && !job.answered && !job.failed.length);
    write.disabled = busy || Boolean(chosen()?.cannot);
    if (job?.verb !== "export") return;
    const running = !job.answered && !job.failed.length;
    container.dataset.state = running ? "running" : job.answered?.code === 0 ? "done" : "failed";
    if (running) return tell(["The compensation is being written …"]);
    if (job.failed.length) return tell(lines({ messages: job.failed }));
    const { code, answer: written, messages, folder } = job.answered;
    if (code !== 0) return refused(written?.findings ?? [], messages);
    const save = (path, name) => async () => { try { await download(path, name); } catch (error) { tell(lines(error)); } };
    const names = written?.files ?? [];
    tell([`Written into ${folder} beside the study. README.txt says how to load it and what must be set again.`],
      element("p", {}, element("button", { type: "button", id: id("zip"), click: save("/api/export/zip", `${folder}.zip`) }, "Download all as ZIP")),
      element("ul", { class: "files" }, ...names.map((name, k) => element("li", {}, element("button", { type: "button", "data-file": name, "aria-label": `download ${name}`, click: save(`/api/export/file/${k}`, name.split("/").at(-1)) }, name)))),
      ...(messages.length ? [element("details", { open: true }, element("summary", {}, "check before you load it"), ...messages.map((text) => element("p", { class: "said" }, text)))] : []));
  });
}
