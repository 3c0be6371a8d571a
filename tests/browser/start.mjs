// The start page: from files of a person to the open study.

import { existsSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { HOSTILE, accessible, axiscal, equal, holds, measured, noHarm, startPage, watched } from "./tools.mjs";

async function opened(t, name) {
  const folder = join(t.dir, `start ${name}`);
  mkdirSync(folder, { recursive: true });
  const address = await startPage(folder, t.dir, t.atEnd);
  const [page, seen] = await watched(t.context);
  await page.goto(address);
  await page.waitForFunction(() => document.querySelector("#machine").options.length > 0);
  return { folder, page, seen };
}

/** Lets files fall on the page. */
async function drop(page, files, listed = files.length) {
  const given = files.map(([name, text]) => ({ name, text }));
  await page.evaluate((all) => {
    const data = new DataTransfer();
    for (const { name, text } of all) data.items.add(new File([text], name));
    for (const what of ["dragenter", "dragover", "drop"]) document.querySelector("#drop").dispatchEvent(new DragEvent(what, { dataTransfer: data, bubbles: true, cancelable: true }));
  }, given);
  await page.waitForFunction((n) => document.querySelectorAll("#chosen tbody tr").length === n, listed);
}

const isOpen = (page) => page.waitForSelector("body[data-version]", { timeout: 120_000 });

async function fromDroppedFiles(t) {
  const made = measured(t.dir, "to-drop");
  const text = (file) => readFileSync(join(made, file), "utf8");
  const { folder, page, seen } = await opened(t, "dropped");
  await accessible(page, "start page");
  await page.screenshot({ path: join(t.out, "start.png") });
  // in no order; the logs find their plans by name
  await drop(page, [["table.log", text("table.log")], ["head.plan.json", text("head.plan.json")], ["head.log", text("head.log")], ["table.plan.json", text("table.plan.json")]]);
  const runs = await page.locator("#chosen tbody tr").evaluateAll((all) => all.map((r) => `${r.cells[0].textContent} ${r.cells[1].querySelector("select").value} ${r.cells[2].textContent}`));
  equal(runs, ["table.log log 2", "head.plan.json plan 1", "head.log log 1", "table.plan.json plan 2"]);
  equal(await page.inputValue("#machine"), "swivel-head", "the machine of the plan");
  await page.fill("#name", "my first study");
  await accessible(page, "start page with files");
  await page.screenshot({ path: join(t.out, "start-files.png") });
  await page.emulateMedia({ colorScheme: "dark" });
  await accessible(page, "start page in the dark");
  await page.screenshot({ path: join(t.out, "start-dark.png") });
  await page.emulateMedia({ colorScheme: "light" });
  await page.setViewportSize({ width: 390, height: 844 });
  holds(await page.evaluate(() => document.documentElement.scrollWidth) <= 390, "wider than a telephone");
  await page.setViewportSize({ width: 1280, height: 900 });
  await page.click("#make");
  await isOpen(page);
  const study = readFileSync(join(folder, "my-first-study", "study.toml"), "utf8");
  holds(study.includes("head.log") && study.includes("table.log"), study);
  holds((await page.textContent("body")).includes("study.toml"), "the study is not shown");
  equal(readdirSync(join(folder, "my-first-study")).filter((f) => !f.startsWith(".")).sort(), ["head.log", "head.plan.json", "study.toml", "table.log", "table.plan.json"]);
  equal(seen.errors, [], "errors in the console");

  // the next start offers it
  const again = await opened(t, "dropped");
  await again.page.click("#recent button");
  await isOpen(again.page);
  holds((await again.page.textContent("body")).includes("study.toml"), "the earlier study is not shown");
  equal(again.seen.errors, [], "errors in the console");
}

/** What a reader refuses is shown with file, line, column and remedy, and leaves nothing behind. */
async function refused(t) {
  const made = measured(t.dir, "to-refuse");
  const text = (file) => readFileSync(join(made, file), "utf8");
  const { folder, page, seen } = await opened(t, "refused");
  const broken = text("head.plan.json").split("\n").map((line, k) => (k === 20 ? `<img src=x onerror=window.harmed=1> ${line}` : line)).join("\n");
  await drop(page, [["head.plan.json", broken], ["head.log", text("head.log")]]);
  await page.selectOption("#machine", "swivel-head");
  await page.fill("#name", "broken");
  await page.click("#make");
  await page.waitForFunction(() => document.querySelector("#messages").textContent.length > 0);
  const said = await page.textContent("#messages");
  holds(/broken\/head\.plan\.json:21:\d+: error/.test(said) && said.includes("help:"), said);
  await noHarm(page);
  equal(readdirSync(folder), [], "a refused study left files");
  await page.screenshot({ path: join(t.out, "start-refused.png") });
  // what is no file of a study is refused by name, and is not in the list
  for (const [name, content, says] of [["photo.png", "\u0089PNG\r\n\u001a\n", "it is no text"], ["study.toml", text("study.toml"), "it is a study already"], ["nothing.log", "", "it is empty"]]) {
    await drop(page, [[name, content]], 2);
    await page.waitForFunction((n) => document.querySelector("#messages").textContent.startsWith(n), name);
    const why = await page.textContent("#messages");
    holds(why.startsWith(`${name} is not taken: ${says}`), why);
  }
  await accessible(page, "start page with an error");
  // put right, and made under the same name
  await page.click('[aria-label="remove head.plan.json"]');
  await page.evaluate((plan) => {
    const data = new DataTransfer();
    data.items.add(new File([plan], "head.plan.json"));
    document.querySelector("#drop").dispatchEvent(new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
  }, text("head.plan.json"));
  await page.waitForFunction(() => document.querySelectorAll("#chosen tbody tr").length === 2);
  equal(await page.inputValue("#machine"), "swivel-head", "the machine of the plan");
  await page.click("#make");
  await isOpen(page);
  equal(seen.errors, [], "errors in the console");
}

/** Sphere centres alone make a study, by keyboard. */
async function centresByKeyboard(t) {
  const { folder, page, seen } = await opened(t, "centres");
  const file = join(process.env.AXISCAL_ROOT, "tests/centres/planted.csv");
  // the field of the files is reached with Tab; who waits for its dialogue must do so before it opens
  const asked = page.waitForEvent("filechooser");
  for (let k = 0; k < 6 && await page.evaluate(() => document.activeElement.id) !== "files"; k += 1) await page.keyboard.press("Tab");
  equal(await page.evaluate(() => document.activeElement.id), "files");
  await page.waitForTimeout(200);
  await page.keyboard.press("Enter");
  await (await asked).setFiles(file);
  await page.waitForSelector("#centres:not([hidden])");
  const reach = async (id, most = 40) => {
    for (let k = 0; k < most && await page.evaluate(() => document.activeElement.id) !== id; k += 1) await page.keyboard.press("Tab");
    equal(await page.evaluate(() => document.activeElement.id), id);
  };
  await reach("machine");
  await page.keyboard.type("swivel-table-b");
  equal(await page.inputValue("#machine"), "swivel-table-b");
  await reach("name");
  await page.keyboard.press("Control+a");
  await page.keyboard.type("spheres");
  await reach("kind");
  await page.keyboard.type("machine");
  await reach("unit");
  await page.keyboard.type("mm");
  await reach("sigma-um");
  await page.keyboard.type("0,8");
  await reach("make");
  await page.keyboard.press("Enter");
  await isOpen(page);
  holds(existsSync(join(folder, "spheres", "study.toml")), "no study");
  equal(seen.errors, [], "errors in the console");
}

/** Names that look like HTML, or like paths, are text on the page and plain signs on the disk. */
async function hostileFiles(t) {
  const made = measured(t.dir, "to-name");
  const text = (file) => readFileSync(join(made, file), "utf8");
  const { folder, page, seen } = await opened(t, "names");
  const machines = readFileSync(join(process.env.AXISCAL_ROOT, "machines.toml"), "utf8");
  writeFileSync(join(folder, "kept.txt"), "kept");
  await drop(page, [[`${HOSTILE.replaceAll("/", "")}.plan.json`, text("head.plan.json")], ["..<b>.log", text("head.log")], ["machines.toml", machines]]);
  await noHarm(page);
  equal(await page.inputValue("#machine"), "swivel-head", "the machine of the file");
  await page.fill("#name", `../../${HOSTILE}`);
  await page.click("#make");
  await isOpen(page);
  await noHarm(page);
  equal(readdirSync(folder).length, 2, "made elsewhere");
  const own = readdirSync(folder).find((f) => f !== "kept.txt");
  for (const name of [own, ...readdirSync(join(folder, own))]) holds(/^[\w.-]+$/.test(name), name);
  equal(seen.errors, [], "errors in the console");
}

/** Names that stand inside the files: of the machine, and of an effect of one's own. */
async function hostileMachine(t) {
  const made = measured(t.dir, "to-call-names");
  const text = (file) => readFileSync(join(made, file), "utf8");
  const { page, seen } = await opened(t, "machine-names");
  const machines = readFileSync(join(process.env.AXISCAL_ROOT, "machines.toml"), "utf8");
  // a log names the plan that it belongs to; a CSV of touches does not
  axiscal("parse", join(made, "head.log"), "--controller", "linuxcnc", "--plan", join(made, "head.plan.json"), "--out", join(made, "head.csv"));
  const { fields_sha256, ...plan } = { ...JSON.parse(text("head.plan.json")), machine: HOSTILE };
  const effect = `[[effect]]\nid = "my-square"\nname = ${JSON.stringify(HOSTILE)}\nsays = ${JSON.stringify(HOSTILE)}\nat = "Y"\n`
    + 'terms = [ { parameter = "mine", unit = "urad", dof = "dx", formula = "-Y", typical = 16 } ]\n';
  await drop(page, [
    ["head.plan.json", JSON.stringify(plan)], ["head.csv", text("head.csv")], ["effects.toml", effect],
    ["machines.toml", machines.replace('name = "swivel-head"', `name = ${JSON.stringify(HOSTILE)}`)],
  ]);
  await noHarm(page);
  equal(await page.inputValue("#machine"), HOSTILE, "the machine of the file");
  holds((await page.textContent("#machine")).includes(HOSTILE), "the machine's name is not shown");
  await page.fill("#name", "names");
  await page.click("#make");
  await page.waitForFunction(() => document.body.dataset.version || (document.querySelector("#messages-text") ?? document.querySelector("#messages"))?.textContent.length > 0, null, { timeout: 120_000 });
  equal((await page.locator("#messages-text").allTextContents()).join(""), "", "what was refused");
  await isOpen(page);
  await noHarm(page);
  holds((await page.textContent("body")).includes(HOSTILE), "the machine's name is not shown on the workbench");
  equal(seen.errors, [], "errors in the console");
}

async function demo(t) {
  const { folder, page, seen } = await opened(t, "demo");
  await page.click("#demo");
  await isOpen(page);
  holds(existsSync(join(folder, "axiscal-demo", "report.html")), "no demo");
  equal(seen.errors, [], "errors in the console");
}

export const startCases = [
  ["start_from_dropped_files", fromDroppedFiles],
  ["start_refused_files", refused],
  ["start_centres_by_keyboard", centresByKeyboard],
  ["start_hostile_names", hostileFiles],
  ["start_hostile_machine", hostileMachine],
  ["start_demo", demo],
];
