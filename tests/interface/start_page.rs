//! The workbench without a study, over plain HTTP.

use crate::workbench::{Workbench, measured};
use base64::Engine;
use serde_json::{Value, json};

/// The start page takes files, and gives no word of a request to the disk as it is.
#[test]
fn the_start_page_writes_below_its_folder_alone() {
    let above = tempfile::tempdir().unwrap();
    let dir = above.path().join("here");
    std::fs::create_dir(&dir).unwrap();
    let w = Workbench::start(&dir);
    let host = w.host();
    for path in ["/api/start", "/api/state", "/api/start/new"] {
        assert!(matches!(w.send("GET", path, &[("Host", &host)], "").status, 401 | 404), "{path}");
    }
    assert_eq!(w.send("GET", "/api/start", &[("Host", "evil.example"), ("X-Axiscal-Token", &w.token)], "").status, 403);
    assert_eq!(w.get("/api/state").status, 404, "no study is open yet");
    let offer = w.get("/api/start").json();
    assert!(offer["machines"].as_array().unwrap().iter().any(|m| m["name"] == "swivel-head"), "{offer}");
    let text = |name: &str| std::fs::read(measured().join(name)).unwrap();
    let file = |role: &str, name: &str, from: &str| json!({ "role": role, "name": name, "data": base64::engine::general_purpose::STANDARD.encode(text(from)) });
    let asked = |name: &str, machine: &str, controller: &str, files: Value| {
        json!({ "name": name, "machine": machine, "controller": controller, "files": files }).to_string()
    };
    let both = || json!([file("plan", "../../../plan.json", "head.plan.json"), file("log", "/etc/x.log", "head.log")]);
    // what cannot be used is refused, and leaves nothing
    for (body, says) in [
        (asked("a", "swivel-head", "linuxcnc", json!([])), "nothing to make a study of"),
        (asked("a", "swivel-head", "linuxcnc", json!([file("plan", "p.json", "head.plan.json")])), "do not pair"),
        (asked("a", "no-such-machine", "linuxcnc", both()), "no machine is called"),
        (asked("a", "--out=/tmp/x", "linuxcnc", both()), "no machine is called"),
        (asked("a", "swivel-head", "../mine.toml", both()), "no controller has that name"),
        (asked("a", "swivel-head", "csv", both()), "error"),
        (json!({ "name": "a", "machine": "swivel-head", "files": [], "out": "/tmp/x" }).to_string(), "unknown field"),
        ("{".to_owned(), "cannot be read"),
    ] {
        let answer = w.post("/api/start/new", &body);
        assert_eq!(answer.status, 422, "{}", answer.body);
        assert!(answer.body.contains(says), "{says}: {}", answer.body);
    }
    for number in ["0", "-1", "\"x\""] {
        let status = w.post("/api/start/recent", &format!("{{\"number\":{number}}}")).status;
        assert!(matches!(status, 400 | 422), "{number}: {status}");
    }
    assert_eq!(std::fs::read_dir(&dir).unwrap().count(), 0, "a refused study leaves nothing");
    // a study of that name is not written over
    std::fs::create_dir(dir.join("taken")).unwrap();
    let answer = w.post("/api/start/new", &asked("taken", "swivel-head", "linuxcnc", both()));
    assert!(answer.status == 422 && answer.body.contains("exists already"), "{}", answer.body);
    let answer = w.post("/api/start/new", &asked("../..//over\u{0}there", "swivel-head", "linuxcnc", both()));
    assert_eq!(answer.status, 200, "{}", answer.body);
    let made = dir.join("over-there");
    let mut names: Vec<_> =
        std::fs::read_dir(&made).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.retain(|name| !name.starts_with('.'));
    names.sort();
    assert_eq!(names, ["etc-x.log", "plan.json", "study.toml"]);
    assert_eq!(std::fs::read_dir(above.path()).unwrap().count(), 1, "nothing beside the folder");
    assert_eq!(std::fs::read(made.join("etc-x.log")).unwrap(), text("head.log"));
    // and now the same address is its workbench
    assert_eq!(w.get("/api/state").json()["study"], "study.toml");
    assert_eq!(w.get("/api/start").status, 404);
}
