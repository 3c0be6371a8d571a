//! The workbench from outside, over plain HTTP: how it is called, and what it must not break.

use crate::common::verbs;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// A measured machine with an error that no model of it holds, made once.
pub fn measured() -> &'static Path {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    MADE.get_or_init(|| {
        let wrong = "seed = 3\n[effects.location-b]\nEX0B = 0.02\n[effects.squareness-xy]\nEC0Y = 400\n[noise]\ntouch_um = 0.5\n";
        let dir = verbs::touched(&["head"], wrong, None);
        let new = ["new", "--plan", "head.plan.json", "--log", "head.log", "--effects", "location-b,pretravel"];
        verbs::ok(dir.path(), &[&new[..], &["--known-blocks"], &verbs::COMMON, &["study.toml"]].concat());
        dir
    })
    .path()
}

/// A copy of the measurement for one test.
pub fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["head.plan.json", "head.log", "study.toml"] {
        std::fs::copy(measured().join(name), dir.path().join(name)).unwrap();
    }
    dir
}

pub struct Workbench {
    child: Child,
    pub port: u16,
    pub token: String,
    study: PathBuf,
}

impl Drop for Workbench {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: String,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|e| panic!("{e}: {}", self.body))
    }
}

impl Workbench {
    pub fn open(dir: &Path) -> Self {
        let study = dir.join("study.toml").display().to_string();
        Self::called(dir, &[&study], &measured().join("data"))
    }

    /// The page before a study is open.
    pub fn start(dir: &Path) -> Self {
        Self::called(dir, &[], &dir.join(".data"))
    }

    fn called(dir: &Path, study: &[&str], data: &Path) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_axiscal"))
            .args(["--json", "workbench", "--no-open"])
            .args(study)
            .current_dir(dir)
            // the list of earlier studies is not that of the person who runs the tests
            .env("XDG_DATA_HOME", data)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut lines = String::new();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        while !lines.ends_with("}\n") {
            assert!(out.read_line(&mut lines).unwrap() > 0, "the workbench ended: {lines}");
        }
        let said: Value = serde_json::from_str(&lines).unwrap();
        let address = said["address"].as_str().unwrap();
        let (host, token) = address.strip_prefix("http://127.0.0.1:").unwrap().split_once("/#token=").unwrap();
        Self { child, port: host.parse().unwrap(), token: token.to_owned(), study: dir.join("study.toml") }
    }

    /// Sends bytes as they are.
    pub fn raw(&self, bytes: &[u8]) -> Answer {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        // a server that has seen enough may close before all is sent
        let _ = stream.write_all(bytes);
        let mut text = Vec::new();
        let _ = stream.read_to_end(&mut text);
        let text = String::from_utf8_lossy(&text).into_owned();
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
        let mut status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
        // a refusal is an answer with its kind; the tests write 409 for "changed meanwhile" and 422 for the rest
        let kind = serde_json::from_str::<Value>(body).ok().and_then(|v| v["error"].as_str().map(str::to_owned));
        if let (200, Some(kind)) = (status, kind) {
            status = if kind == "stale" { 409 } else { 422 };
        }
        Answer { status, head: head.to_owned(), body: body.to_owned() }
    }

    pub fn send(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\n");
        for (name, value) in headers {
            text += &format!("{name}: {value}\r\n");
        }
        if !body.is_empty() {
            text += &format!("Content-Length: {}\r\n", body.len());
        }
        self.raw(format!("{text}\r\n{body}").as_bytes())
    }

    pub fn host(&self) -> String {
        format!("127.0.0.1:{}", self.port)
    }

    pub fn get(&self, path: &str) -> Answer {
        self.send("GET", path, &[("Host", &self.host()), ("X-Axiscal-Token", &self.token)], "")
    }

    pub fn post(&self, path: &str, body: &str) -> Answer {
        let host = self.host();
        let origin = format!("http://{host}");
        let headers = [
            ("Host", host.as_str()),
            ("Origin", &origin),
            ("X-Axiscal-Token", &self.token),
            ("Content-Type", "application/json"),
        ];
        self.send("POST", path, &headers, body)
    }

    pub fn version(&self) -> u64 {
        self.get("/api/state").json()["version"].as_u64().unwrap()
    }

    pub fn step(&self, version: u64, ask: &Value) -> Answer {
        self.post("/api/step", &json!({ "version": version, "ask": ask }).to_string())
    }

    pub fn switch(&self, effect: &str, on: bool) -> Answer {
        self.step(self.version(), &json!({ "switch": { "effect": effect, "on": on } }))
    }

    pub fn text(&self) -> String {
        std::fs::read_to_string(&self.study).unwrap()
    }
}

#[test]
fn two_tabs_do_not_corrupt_the_study() {
    let dir = folder();
    let w = Arc::new(Workbench::open(dir.path()));
    let version = w.version();
    assert_eq!(w.step(version, &json!({ "switch": { "effect": "squareness-xy", "on": true } })).status, 200);
    let late = w.step(version, &json!({ "switch": { "effect": "zero-b", "on": true } }));
    assert_eq!(late.status, 409, "the other tab asked of an older state");
    assert_eq!(late.json()["version"], version + 1);
    assert!(!w.text().contains("zero-b"));
    // many at once, each of the state that it has just seen: every one is done whole or refused
    let threads: Vec<_> = (0..4)
        .map(|n: u64| {
            let w = w.clone();
            std::thread::spawn(move || {
                let mut done = 0;
                for k in 0..6 {
                    let touch = 1 + n * 10 + k;
                    let answer = w.step(
                        w.version(),
                        &json!({ "mask": { "touches": [[1, touch]], "reason": format!("tab {n}") } }),
                    );
                    assert!(matches!(answer.status, 200 | 409), "{} {}", answer.status, answer.body);
                    done += u64::from(answer.status == 200);
                }
                done
            })
        })
        .collect();
    let done: u64 = threads.into_iter().map(|t| t.join().unwrap()).sum();
    assert!(done >= 6);
    assert_eq!(w.text().matches("[[mask]]").count() as u64, done);
    assert_eq!(w.version(), version + 1 + done);
    let masked = w.get("/api/state").json()["masked"].as_array().unwrap().len() as u64;
    assert_eq!(masked, done);
}

#[test]
fn every_step_can_be_undone_to_the_byte() {
    let dir = folder();
    let text = std::fs::read_to_string(dir.path().join("study.toml")).unwrap();
    let text = format!("# mine, with a comment that stays\n{}", text.replace('\n', "\r\n"));
    std::fs::write(dir.path().join("study.toml"), &text).unwrap();
    let w = Workbench::open(dir.path());
    let draft = json!({ "id": "my-sag", "name": "Sag", "at": "B", "terms": [{ "parameter": "sag", "unit": "um", "dof": "dz", "formula": "1 - cos(B)" }] });
    let asks = [
        json!({ "switch": { "effect": "squareness-xy", "on": true } }),
        json!({ "mask": { "touches": [[1, 3], [1, 4]], "reason": "a chip \"here\"" } }),
        json!({ "save": { "draft": draft, "on": true } }),
        json!({ "unmask": { "touches": [[1, 3]] } }),
        json!({ "switch": { "effect": "pretravel", "on": false } }),
    ];
    let mut texts = vec![text.clone()];
    for ask in &asks {
        let answer = w.step(w.version(), ask);
        assert_eq!(answer.status, 200, "{ask}: {}", answer.body);
        texts.push(w.text());
    }
    let own = std::fs::read_to_string(dir.path().join("my-effects.toml")).unwrap();
    assert!(own.contains("id = \"my-sag\"") && w.text().contains("effects_file = [\"my-effects.toml\"]"), "{own}");
    for expected in texts.iter().rev().skip(1) {
        assert_eq!(w.step(w.version(), &json!("undo")).status, 200);
        assert_eq!(&w.text(), expected);
    }
    assert!(!dir.path().join("my-effects.toml").exists(), "the effects file is gone with its step");
    assert_eq!(w.step(w.version(), &json!("undo")).status, 422);
    for expected in texts.iter().skip(1) {
        assert_eq!(w.step(w.version(), &json!("redo")).status, 200);
        assert_eq!(&w.text(), expected);
    }
    assert_eq!(std::fs::read_to_string(dir.path().join("my-effects.toml")).unwrap(), own);
    // an effect that is not called on by the study any more cannot be lost from a file that somebody else has changed
    assert_eq!(w.step(w.version(), &json!("undo")).status, 200);
    assert_eq!(w.step(w.version(), &json!("undo")).status, 200);
    std::fs::write(dir.path().join("my-effects.toml"), format!("{own}\n# mine\n")).unwrap();
    let mut answer = w.step(w.version(), &json!("undo"));
    until("the change is seen", || {
        answer = w.step(w.version(), &json!("undo"));
        answer.status != 409
    });
    assert_eq!(answer.status, 422, "{}", answer.body);
    assert!(std::fs::read_to_string(dir.path().join("my-effects.toml")).unwrap().ends_with("# mine\n"));
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(120), "not in time: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn what_changes_on_the_disk_shows() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let (version, text) = (w.version(), w.text());
    std::fs::write(&w.study, text.replace("\"pretravel\"", "\"pretravel\", \"squareness-xy\"")).unwrap();
    until("a new effect", || w.version() > version);
    let state = w.get("/api/state").json();
    assert_eq!(state["effects"].as_array().unwrap().len(), 3);
    // a file that cannot be used is said, with its place, and nothing is written over it
    std::fs::write(&w.study, "machine = \n").unwrap();
    until("a fault", || {
        w.get("/api/state").json()["fault"][0]["place"].as_str().is_some_and(|p| p.contains("study.toml:1:"))
    });
    let refused = w.switch("zero-b", true);
    assert_eq!(refused.status, 422, "{}", refused.body);
    assert_eq!(w.text(), "machine = \n");
    std::fs::write(&w.study, &text).unwrap();
    until("mended", || w.get("/api/state").json()["fault"].as_array().is_some_and(Vec::is_empty));
    // the change of another can be undone like a step
    assert_eq!(w.step(w.version(), &json!("undo")).status, 200);
    assert!(w.text().contains("squareness-xy"));
    // a log that grows worse is read again
    let log = dir.path().join("head.log");
    let version = w.version();
    std::fs::write(&log, std::fs::read_to_string(&log).unwrap() + "\n").unwrap();
    until("a new log", || w.version() > version);
}

#[test]
fn a_killed_workbench_leaves_the_study_whole() {
    let dir = folder();
    for round in 0..6 {
        let mut w = Workbench::open(dir.path());
        let version = w.version();
        let (port, token, host) = (w.port, w.token.clone(), w.host());
        // steps as fast as they go, until the process is gone
        let began = w.text();
        let on = !began.contains("squareness-xy");
        let writer = std::thread::spawn(move || {
            for k in 0..10_000_u64 {
                let ask = if k % 2 == 0 {
                    json!({ "switch": { "effect": "squareness-xy", "on": on } })
                } else {
                    json!("undo")
                };
                let body = json!({ "version": version + k, "ask": ask }).to_string();
                let text = format!(
                    "POST /api/step HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nX-Axiscal-Token: {token}\r\nContent-Type: application/json\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
                    body.len()
                );
                let Ok(mut stream) = TcpStream::connect(("127.0.0.1", port)) else { return k };
                let mut answer = String::new();
                if stream.write_all(text.as_bytes()).is_err()
                    || stream.read_to_string(&mut answer).is_err()
                    || answer.is_empty()
                {
                    return k;
                }
            }
            10_000
        });
        until("a first step", || w.text() != began || writer.is_finished());
        std::thread::sleep(Duration::from_millis(37 * round));
        w.child.kill().unwrap();
        w.child.wait().unwrap();
        writer.join().unwrap();
        for entry in std::fs::read_dir(dir.path()).unwrap().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let known = ["head.plan.json", "head.log", "study.toml", "study.history.json"].contains(&name.as_str());
            // the temporary file of a write that was cut short is left, and the lock file, which locks nothing any more
            assert!(known || name.starts_with(".axiscal-") || name == ".study.toml.lock", "{name}");
        }
        let output = Command::new(env!("CARGO_BIN_EXE_axiscal"))
            .args(["--json", "history", &dir.path().join("study.toml").display().to_string()])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn a_model_at_hand_is_what_a_fresh_fit_says() {
    let dir = folder();
    let told =
        |state: &Value| (state["residual_um"].clone(), state["parameters"].clone(), state["correlation"].clone());
    let (off, on) = {
        let w = Workbench::open(dir.path());
        let off = w.get("/api/state").json();
        let on = w.switch("squareness-xy", true).json();
        assert!(on["rms_um"].as_f64().unwrap() < 0.5 * off["rms_um"].as_f64().unwrap());
        for expected in [&off, &on] {
            let again = w.switch("squareness-xy", expected == &on).json();
            assert_eq!(again["fit_ms"], 0.0, "this model was fitted before");
            assert_eq!(told(&again), told(expected));
        }
        // other touches are another fit, and the way back is none
        let masked = w.step(w.version(), &json!({ "mask": { "touches": [[1, 7]], "reason": "a chip" } })).json();
        assert!(masked["fit_ms"].as_f64().unwrap() > 0.0);
        assert_ne!(told(&masked), told(&on));
        let back = w.step(w.version(), &json!("undo")).json();
        assert_eq!((back["fit_ms"].as_f64(), told(&back)), (Some(0.0), told(&on)));
        (off, on)
    };
    let fresh = Workbench::open(dir.path()).get("/api/state").json();
    assert!(fresh["fit_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(told(&fresh), told(&on));
    assert_ne!(told(&fresh), told(&off));
}

#[test]
fn an_effect_that_changes_on_the_disk_is_fitted_anew() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let draft = |formula: &str| json!({ "id": "mine", "at": "Y", "terms": [{ "parameter": "mine", "unit": "urad", "dof": "dx", "formula": formula }] });
    let saved = w.step(w.version(), &json!({ "save": { "draft": draft("-Y"), "on": true } })).json();
    let value = |state: &Value| {
        let all = state["parameters"].as_array().unwrap();
        all.iter().find(|p| p["name"] == "mine").unwrap()["value"].as_f64().unwrap()
    };
    let file = dir.path().join("my-effects.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("formula = \"-Y\"", "formula = \"-0.25*Y\"")).unwrap();
    let began = Instant::now();
    loop {
        let now = w.get("/api/state").json();
        if now["version"] != saved["version"] {
            assert!((value(&now) / value(&saved) - 4.0).abs() < 1e-6, "{} and {}", value(&saved), value(&now));
            break;
        }
        assert!(began.elapsed() < Duration::from_secs(20), "the change is not seen");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// `plan-next` of the page asks about what each step of the page may have added wrongly, and not only about the last one.
#[test]
fn the_next_program_asks_about_every_step_of_the_page() {
    let wrong =
        "seed = 5\n[effects.backlash-y]\nbacklash_Y = 6.0\n[effects.scale-z]\nEZZ = 80.0\n[noise]\ntouch_um = 1.0\n";
    let dir = verbs::folder(&["head", "table"], wrong, None);
    let w = Workbench::open(dir.path());
    for effect in ["backlash-y", "scale-z"] {
        assert_eq!(w.switch(effect, true).status, 200);
    }
    let asked = json!({ "version": w.version(), "verb": "plan-next", "controller": "linuxcnc", "minutes": 10 });
    assert_eq!(w.post("/api/call", &asked.to_string()).status, 202);
    let mut answered = Value::Null;
    until("the next program", || {
        let job = w.get("/api/state").json()["job"].clone();
        assert_eq!(job["failed"], json!([]), "{job}");
        answered = job["answered"].clone();
        !answered.is_null()
    });
    assert_eq!(answered["code"], 0, "{answered}");
    let pairs = answered["answer"]["pairs"].as_array().unwrap();
    for id in ["backlash-x", "scale-z"] {
        assert!(pairs.iter().any(|pair| pair["one"] == id || pair["other"] == id), "{id}: {answered}");
    }
}
