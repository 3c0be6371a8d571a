//! Calls that are killed at random moments, and calls that change one study at the same time: what is left on the disk.

mod page;

use page::Page;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// The program under test: a path, and what its environment must hold to be it.
#[derive(Clone)]
pub struct Program {
    pub path: PathBuf,
    pub environment: Option<&'static str>,
}

impl Program {
    fn command(&self, at: &Path, words: &[&str]) -> Command {
        let mut command = Command::new(&self.path);
        command.current_dir(at).args(words).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        if let Some(name) = self.environment {
            command.env(name, "1");
        }
        command
    }

    fn start(&self, at: &Path, words: &[&str]) -> Child {
        self.command(at, words).spawn().unwrap()
    }

    fn call(&self, at: &Path, words: &[&str]) -> Output {
        self.command(at, words).stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap()
    }

    fn ok(&self, at: &Path, words: &[&str]) {
        let out = self.call(at, words);
        assert!(out.status.success(), "{words:?}: {}", String::from_utf8_lossy(&out.stderr));
    }
}

/// Numbers that look random and are the same in every run.
struct Draw(u64);

impl Draw {
    /// From 0 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A folder with a measured machine and its study.
fn measured(program: &Program) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path();
    let wrong = "seed = 3\n[effects.location-b]\nEX0B = 0.02\n[noise]\ntouch_um = 0.5\n";
    std::fs::write(at.join("wrong.toml"), wrong).unwrap();
    let machine = ["--machine", "swivel-head", "--controller", "linuxcnc", "--out"];
    program.ok(at, &[&["generate", "--program", "head"][..], &machine, &["."]].concat());
    let simulate = ["simulate", "--plan", "head.plan.json", "--scenario", "wrong.toml"];
    program.ok(at, &[&simulate[..], &machine, &["head.log"]].concat());
    let new = ["new", "--plan", "head.plan.json", "--log", "head.log", "--effects", "location-b,pretravel"];
    program.ok(at, &[&new[..], &["--known-blocks"], &machine, &["study.toml"]].concat());
    dir
}

/// The effects of the study's model.
fn effects(at: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let study: toml::Value = toml::from_str(&text).unwrap();
    let effects = study["model"]["effects"].as_array().unwrap().iter();
    effects.map(|e| e.as_str().unwrap().to_owned()).collect()
}

/// What became of changes that were made at the same time.
#[derive(Debug, Default, Clone, Copy)]
pub struct Races {
    pub changes: usize,
    pub done: usize,
    pub refused: usize,
    /// Said to be done, and not in the study.
    pub lost: usize,
}

impl Races {
    fn count(&mut self, at: &Path, wanted: &[(&str, bool, bool)]) {
        let now = effects(at);
        for (effect, on, done) in wanted {
            self.changes += 1;
            self.done += usize::from(*done);
            self.refused += usize::from(!done);
            self.lost += usize::from(*done && now.contains(*effect) != *on);
        }
    }
}

const PAIR: [&str; 2] = ["squareness-xy", "squareness-zx"];

fn verb(on: bool) -> &'static str {
    if on { "add" } else { "remove" }
}

/// Was the change made? One that was not must have been refused with one of the codes for that.
fn was_done(out: &Output) -> bool {
    if out.status.success() {
        return true;
    }
    let answer: Value = serde_json::from_slice(&out.stdout).unwrap_or_default();
    let code = answer["findings"][0]["code"].as_str().unwrap_or_default().to_owned();
    let known = ["file::busy", "study::changed"].contains(&code.as_str());
    assert!(known, "{answer}: {}", String::from_utf8_lossy(&out.stderr));
    false
}

/// Two calls of `add` (and of `remove`) at the same time.
pub fn two_adds(program: &Program, changes: usize) -> Races {
    let dir = measured(program);
    let mut races = Races::default();
    let mut on = true;
    while races.changes < changes {
        let call = |effect: &'static str| {
            let (program, at) = (program.clone(), dir.path().to_owned());
            std::thread::spawn(move || was_done(&program.call(&at, &["--json", verb(on), "study.toml", effect])))
        };
        let calls = PAIR.map(call);
        let [one, other] = calls.map(|call| call.join().unwrap());
        races.count(dir.path(), &[(PAIR[0], on, one), (PAIR[1], on, other)]);
        // where one was refused the next round begins as this one should have ended
        for effect in PAIR {
            if effects(dir.path()).contains(effect) != on {
                program.ok(dir.path(), &[verb(on), "study.toml", effect]);
            }
        }
        on = !on;
    }
    whole_and_clean(dir.path());
    races
}

/// Clicks in a workbench while `add` and `remove` are called.
pub fn workbench_and_add(program: &Program, changes: usize) -> Races {
    let dir = measured(program);
    let page = Page::open(program, dir.path());
    let mut races = Races::default();
    while races.changes < changes {
        let now = effects(dir.path());
        let [typed, clicked] = PAIR.map(|effect| !now.contains(effect));
        let (calling, at) = (program.clone(), dir.path().to_owned());
        let call =
            std::thread::spawn(move || was_done(&calling.call(&at, &["--json", verb(typed), "study.toml", PAIR[0]])));
        // over the time that the other call takes
        std::thread::sleep(Duration::from_millis((races.changes as u64 * 7) % 120));
        let click = page.switch(PAIR[1], clicked);
        races.count(dir.path(), &[(PAIR[0], typed, call.join().unwrap()), (PAIR[1], clicked, click)]);
    }
    drop(page);
    clear_and_look(program, dir.path());
    races
}

/// Clicks in two workbenches of one study.
pub fn two_workbenches(program: &Program, changes: usize) -> Races {
    let dir = measured(program);
    let pages = [Page::open(program, dir.path()), Page::open(program, dir.path())];
    let mut races = Races::default();
    while races.changes < changes {
        let now = effects(dir.path());
        let wanted = PAIR.map(|effect| !now.contains(effect));
        let done: Vec<bool> = std::thread::scope(|scope| {
            let clicks: Vec<_> = (0..2)
                .map(|i| (i, &pages[i]))
                .map(|(i, page)| scope.spawn(move || page.switch(PAIR[i], wanted[i])))
                .collect();
            clicks.into_iter().map(|click| click.join().unwrap()).collect()
        });
        races.count(dir.path(), &[(PAIR[0], wanted[0], done[0]), (PAIR[1], wanted[1], done[1])]);
    }
    drop(pages);
    clear_and_look(program, dir.path());
    races
}

/// A call after those that were killed clears what they left.
fn clear_and_look(program: &Program, at: &Path) {
    program.ok(at, &[verb(!effects(at).contains(PAIR[0])), "study.toml", PAIR[0]]);
    whole_and_clean(at);
}

/// The ladder can be read, and nothing temporary is left.
fn whole_and_clean(at: &Path) {
    let ladder = at.join("study.history.json");
    if ladder.exists() {
        let _: Value = serde_json::from_slice(&std::fs::read(ladder).unwrap()).unwrap();
    }
    assert_eq!(temporary(at), Vec::<String>::new());
}

fn temporary(at: &Path) -> Vec<String> {
    let names = std::fs::read_dir(at).unwrap().map(|e| e.unwrap().file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(".axiscal-")).collect()
}

/// What calls that were killed left behind.
#[derive(Debug, Default, Clone, Copy)]
pub struct Kills {
    pub kills: usize,
    /// All as before the call.
    pub before: usize,
    /// All as after it.
    pub after: usize,
    /// Some of the old files or some of the new ones, never both: no compensation, no program.
    pub unfinished: usize,
    /// Anything else.
    pub damaged: usize,
    /// The next call failed or left something behind.
    pub not_mended: usize,
}

/// Files of a folder that one call writes, by their names.
type Files = BTreeMap<String, Vec<u8>>;

fn files(at: &Path) -> Files {
    fn walk(root: &Path, at: &Path, out: &mut Files) {
        for entry in std::fs::read_dir(at).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(root, &path, out);
            } else {
                out.insert(path.strip_prefix(root).unwrap().display().to_string(), std::fs::read(&path).unwrap());
            }
        }
    }
    let mut out = Files::new();
    walk(at, at, &mut out);
    out
}

/// A verb that writes files into a folder of its own, in two ways that differ.
struct Victim {
    dir: tempfile::TempDir,
    calls: [Vec<&'static str>; 2],
    /// Where its files lie.
    out: &'static str,
    /// Names of its files.
    is_its: fn(&str) -> bool,
    /// Files of the user's that lie there as well.
    own: &'static [&'static str],
    /// What it writes in both ways.
    written: [Files; 2],
    takes: Duration,
}

impl Victim {
    fn new(
        program: &Program,
        dir: tempfile::TempDir,
        calls: [Vec<&'static str>; 2],
        out: &'static str,
        is_its: fn(&str) -> bool,
        own: &'static [&'static str],
    ) -> Self {
        let mut victim =
            Self { dir, calls, out, is_its, own, written: [Files::new(), Files::new()], takes: Duration::ZERO };
        for way in 0..2 {
            let began = Instant::now();
            program.ok(victim.dir.path(), &victim.calls[way]);
            victim.takes = began.elapsed();
            victim.written[way] = victim.its_files();
        }
        assert_ne!(victim.written[0], victim.written[1]);
        for name in own {
            std::fs::write(victim.folder().join(name), "mine").unwrap();
        }
        victim
    }

    fn folder(&self) -> PathBuf {
        self.dir.path().join(self.out)
    }

    fn its_files(&self) -> Files {
        // what is on its way to its place is no file of the folder yet
        let is_its = |name: &str| !name.starts_with(".axiscal-tmp-") && (self.is_its)(name);
        files(&self.folder()).into_iter().filter(|(name, _)| is_its(name)).collect()
    }

    /// Calls it in the way that it was not called last, kills it, looks, and calls it again.
    fn kill(&self, program: &Program, way: usize, draw: &mut Draw, kills: &mut Kills) {
        let (old, new) = (&self.written[1 - way], &self.written[way]);
        let mut child = program.start(self.dir.path(), &self.calls[way]);
        // mostly towards the end, where it writes
        let part = if draw.next() < 0.3 { draw.next() } else { 0.6 + 0.6 * draw.next() };
        std::thread::sleep(self.takes.mul_f64(part));
        let _ = child.kill();
        child.wait().unwrap();
        kills.kills += 1;
        let own =
            || self.own.iter().all(|name| std::fs::read(self.folder().join(name)).is_ok_and(|text| text == b"mine"));
        let found = self.its_files();
        // between the two names of a folder there is none
        let kept = own() || !self.folder().exists();
        let of = |all: &Files| found.iter().all(|(name, contents)| all.get(name) == Some(contents));
        match (&found == old, &found == new) {
            _ if !kept => kills.damaged += 1,
            (true, _) => kills.before += 1,
            (_, true) => kills.after += 1,
            _ if of(new) || of(old) => kills.unfinished += 1,
            _ => kills.damaged += 1,
        }
        let again = program.call(self.dir.path(), &self.calls[way]);
        let left = temporary(self.dir.path()).len()
            + temporary(&self.folder()).iter().filter(|n| !n.ends_with(".json")).count();
        if !again.status.success() || self.its_files() != *new || !own() || left > 0 {
            kills.not_mended += 1;
        }
    }
}

/// `export` of two studies, `generate` of two machines, and `add` with `remove`, each killed in turn.
pub fn kills(program: &Program, count: usize) -> Vec<(&'static str, Kills)> {
    let victims = [("export", exports(program)), ("generate", generates(program))];
    let mut draw = Draw(7);
    let mut out: Vec<(&'static str, Kills)> = victims.iter().map(|(name, _)| (*name, Kills::default())).collect();
    let third = count.div_ceil(3);
    for i in 0..third {
        for ((_, victim), (_, kills)) in victims.iter().zip(&mut out) {
            victim.kill(program, i % 2, &mut draw, kills);
        }
    }
    out.push(("add", killed_adds(program, third, &mut draw)));
    out
}

fn exports(program: &Program) -> Victim {
    let dir = measured(program);
    let other = std::fs::read_to_string(dir.path().join("study.toml")).unwrap();
    let other = other.replace("\"pretravel\"", "\"pretravel\", \"squareness-xy\"");
    assert!(other.contains("squareness-xy"));
    std::fs::write(dir.path().join("other.toml"), other).unwrap();
    let call =
        |study| vec!["export", study, "--controller", "linuxcnc", "--date", "2026-01-01", "--force", "--out", "comp"];
    let is_its = |name: &str| !name.contains("notes") && !name.contains(".earlier-");
    Victim::new(
        program,
        dir,
        [call("study.toml"), call("other.toml")],
        "comp",
        is_its,
        &["axiscal-notes.txt", "restore-notes.md"],
    )
}

fn generates(program: &Program) -> Victim {
    let dir = tempfile::tempdir().unwrap();
    let call = |tcp: &[&'static str]| {
        let call =
            ["generate", "--machine", "swivel-head", "--program", "head", "--controller", "sinumerik", "--out", "job"];
        [&call[..], tcp].concat()
    };
    let is_its = |name: &str| !name.contains("notes");
    Victim::new(program, dir, [call(&[]), call(&["--tcp"])], "job", is_its, &["head-notes.txt"])
}

/// `add` and `remove`, each of which leaves the study as it was or as it should be.
fn killed_adds(program: &Program, count: usize, draw: &mut Draw) -> Kills {
    let dir = measured(program);
    let (at, effect) = (dir.path(), PAIR[0]);
    let study = || std::fs::read(at.join("study.toml")).unwrap();
    let began = Instant::now();
    let without = study();
    program.ok(at, &["add", "study.toml", effect]);
    let takes = began.elapsed();
    let with = study();
    let mut kills = Kills::default();
    for i in 0..count {
        let on = i % 2 == 1;
        let (old, new) = if on { (&without, &with) } else { (&with, &without) };
        let mut child = program.start(at, &[verb(on), "study.toml", effect]);
        std::thread::sleep(takes.mul_f64(1.2 * draw.next()));
        let _ = child.kill();
        child.wait().unwrap();
        kills.kills += 1;
        let found = study();
        match (&found == old, &found == new) {
            (true, _) => kills.before += 1,
            (_, true) => kills.after += 1,
            _ => kills.damaged += 1,
        }
        if effects(at).contains(effect) != on {
            program.ok(at, &[verb(on), "study.toml", effect]);
        }
        program.ok(at, &["history", "study.toml"]);
        kills.not_mended += usize::from(&study() != new);
    }
    clear_and_look(program, at);
    kills
}

/// What a click asks for.
fn asked(version: u64, effect: &str, on: bool) -> String {
    json!({ "version": version, "ask": { "switch": { "effect": effect, "on": on } } }).to_string()
}
