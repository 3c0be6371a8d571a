// The compensation from the page: every control, with the questions of the command line, and the files as the user gets them.

import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { accessible, axiscal, equal, holds, watched, workbench } from "./tools.mjs";

/** A trunnion with location errors, as LinuxCNC measured it. */
function trunnion(dir, name) {
  const folder = join(dir, name);
  mkdirSync(folder);
  const at = (file) => join(folder, file);
  writeFileSync(at("wrong.toml"), "seed = 3\n[effects.location-a]\nEY0A = 0.021\n[effects.location-c]\nEX0C = 0.013\nEB0C = 0.006\n[noise]\ntouch_um = 0.5\n");
  axiscal("generate", "--machine", "trunnion", "--program", "basic", "--controller", "linuxcnc", "--out", folder);
  axiscal("simulate", "--plan", at("basic.plan.json"), "--machine", "trunnion", "--scenario", at("wrong.toml"), "--controller", "linuxcnc", "--out", at("basic.log"));
  axiscal("new", "--machine", "trunnion", "--plan", at("basic.plan.json"), "--log", at("basic.log"), "--effects", "location-a,location-c,block-setup,pretravel", "--out", at("study.toml"));
  return folder;
}

/** Names and contents of a ZIP without compression (PKWARE APPNOTE, 4.3): from its directory at the end. */
function unpacked(zip) {
  const end = zip.lastIndexOf(Buffer.from("PK\x05\x06", "latin1"));
  const out = new Map();
  let at = zip.readUInt32LE(end + 16);
  for (let k = zip.readUInt16LE(end + 10); k > 0; k -= 1) {
    const [method, size, name, extra, comment, from] = [zip.readUInt16LE(at + 10), zip.readUInt32LE(at + 24), zip.readUInt16LE(at + 28), zip.readUInt16LE(at + 30), zip.readUInt16LE(at + 32), zip.readUInt32LE(at + 42)];
    equal(method, 0, "compression");
    const data = from + 30 + zip.readUInt16LE(from + 26) + zip.readUInt16LE(from + 28);
    out.set(zip.toString("utf8", at + 46, at + 46 + name), zip.subarray(data, data + size));
    at += 46 + name + extra + comment;
  }
  return out;
}

const saved = async (page, click) => {
  const [download] = await Promise.all([page.waitForEvent("download"), click()]);
  return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
};

async function everyControl(t) {
  const folder = trunnion(t.dir, "export");
  const address = await workbench(join(folder, "study.toml"), t.atEnd);
  const [page, seen] = await watched(t.context);
  await page.goto(address);
  await page.click("#tab-export");
  await page.waitForSelector("#export-controller option", { state: "attached" });
  equal(await page.inputValue("#export-controller"), "linuxcnc", "the control of the log comes first");
  const done = (state) => page.waitForSelector(`#export-panel[data-state=${state}]`, { timeout: 60_000 });
  const begin = async (state) => {
    await page.evaluate(() => { document.querySelector("#export-panel").dataset.state = ""; });
    await page.click("#export");
    await done(state);
  };
  const names = await page.locator("#export-controller option").evaluateAll((all) => all.map((o) => o.value));
  for (const name of ["linuxcnc", "sinumerik", "fanuc", "heidenhain", "haas"]) holds(names.includes(name), `${name} is missing: ${names}`);
  for (const name of names) {
    await page.selectOption("#export-controller", name);
    const written = join(folder, `study-compensation-${name}`);
    const asked = await page.isVisible("#export-unverified");
    if (name === "fanuc" || name === "heidenhain") holds(asked, `${name}: nobody is asked about unverified entries`);
    if (name === "fanuc") {
      // without the tick nothing is written, and it is said why
      await begin("failed");
      holds(/not tried|not verified/.test(await page.textContent("#export-answer")), await page.textContent("#export-answer"));
      holds(!existsSync(join(written, "compensation.json")), "unverified entries were written");
      await page.setInputFiles("#export-file", join(process.env.AXISCAL_ROOT, "tests/tables/backups/fanuc.txt"));
    } else {
      await page.setInputFiles("#export-file", []);
    }
    if (asked) await page.check("#export-unverified");
    await begin("done");
    const zip = await saved(page, () => page.click("#export-zip"));
    equal(zip.name, `study-compensation-${name}.zip`);
    const files = unpacked(zip.bytes);
    const listed = await page.locator("#export-answer [data-file]").evaluateAll((all) => all.map((b) => b.dataset.file));
    equal([...files.keys()], listed.map((file) => `study-compensation-${name}/${file}`), "files of the ZIP");
    for (const file of listed) holds(files.get(`study-compensation-${name}/${file}`).equals(readFileSync(join(written, file))), `${name}: ${file} differs from what was written`);
    const one = await saved(page, () => page.click('[data-file="README.txt"]'));
    holds(one.name === "README.txt" && one.bytes.equals(readFileSync(join(written, "README.txt"))), "one file");
    // and it is what the command line writes
    const typed = join(folder, `typed-${name}`);
    axiscal("export", join(folder, "study.toml"), "--controller", name, "--out", typed, ...(asked ? ["--accept-unverified"] : []), ...(name === "fanuc" ? ["--backup", join(process.env.AXISCAL_ROOT, "tests/tables/backups/fanuc.txt")] : []));
    for (const file of listed.filter((f) => f !== "README.txt" && f !== "compensation.json")) equal(readFileSync(join(written, file), "utf8"), readFileSync(join(typed, file), "utf8"), `${name}: ${file}`);
    if (name === "fanuc") {
      await page.locator("#export-panel").scrollIntoViewIfNeeded();
      await page.locator("#export-panel").screenshot({ path: join(t.out, "export.png") });
      await accessible(page, "workbench after an export");
    }
  }
  equal(seen.errors, [], "errors in the console");
}

/** Old values: pasted, by hand, unusable ones with their place, and an earlier export that is not written over. */
async function oldValues(t) {
  const folder = trunnion(t.dir, "old-values");
  const address = await workbench(join(folder, "study.toml"), t.atEnd);
  const [page, seen] = await watched(t.context);
  await page.goto(address);
  await page.click("#tab-export");
  await page.waitForSelector("#export-controller option", { state: "attached" });
  await page.selectOption("#export-controller", "fanuc");
  const answer = async (state) => {
    await page.evaluate(() => { document.querySelector("#export-panel").dataset.state = ""; });
    await page.click("#export");
    await page.waitForSelector(`#export-panel[data-state=${state}]`, { timeout: 60_000 });
    return page.textContent("#export-answer");
  };
  await page.check("#export-unverified");
  await page.locator("#export-panel summary").first().click();
  const good = readFileSync(join(process.env.AXISCAL_ROOT, "tests/tables/backups/fanuc.txt"), "utf8");
  await page.fill("#export-paste", good.replace("N19700Q1M0.1;", "N19700Q1M0.1.2;"));
  const refused = await answer("failed");
  holds(/the pasted text:\d+:\d+: /.test(refused), refused);
  holds(!/--[a-z]/.test(refused), `an option of the command line in the page: ${refused}`);
  holds(!refused.includes("/tmp"), refused);
  await page.fill("#export-paste", good);
  await answer("done");
  const restoring = readFileSync(join(folder, "study-compensation-fanuc", "README.txt"), "utf8");
  holds(restoring.length > 100, "no README");
  // other old values would make the restoring file of the first export worthless
  await page.fill("#export-paste", good.replace("N19700Q1M0.1;", "N19700Q1M0.3;"));
  holds((await answer("failed")).includes("other values"), "an earlier export was written over");
  await page.locator("#export-panel summary").nth(1).click();
  await page.check("#export-force");
  await answer("done");
  equal(seen.errors, [], "errors in the console");
}

export const exportCases = [
  ["export_for_every_control", everyControl],
  ["export_with_old_values", oldValues],
];
