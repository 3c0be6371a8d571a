//! Requests to the workbench, over plain HTTP: what it must refuse, and what must neither end it nor hold others up.

use crate::workbench::{Workbench, folder};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

#[test]
fn foreign_hosts_origins_and_tokens_are_refused() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let before = w.text();
    let (host, port) = (w.host(), w.port);
    let own = format!("http://{host}");
    let body = r#"{"version":1,"ask":{"switch":{"effect":"squareness-xy","on":true}}}"#;
    let kind = ("Content-Type", "application/json");
    let token = ("X-Axiscal-Token", w.token.as_str());
    let post = |headers: &[(&str, &str)]| w.send("POST", "/api/step", headers, body).status;
    for foreign in ["evil.example", &format!("evil.example:{port}"), "127.0.0.1", "127.0.0.1:1", "localhost"] {
        assert_eq!(post(&[("Host", foreign), ("Origin", &own), token, kind]), 403, "{foreign}");
        assert_eq!(w.send("GET", "/", &[("Host", foreign)], "").status, 403, "{foreign}");
    }
    assert_eq!(post(&[("Host", &host), ("Host", "evil.example"), ("Origin", &own), token, kind]), 403);
    for foreign in ["http://evil.example", "null", &format!("https://{host}"), "http://127.0.0.1:1"] {
        assert_eq!(post(&[("Host", &host), ("Origin", foreign), token, kind]), 403, "{foreign}");
    }
    assert_eq!(post(&[("Host", &host), token, kind]), 403, "without an origin");
    assert_eq!(post(&[("Host", &host), ("Origin", &own), kind]), 401, "without a token");
    let other = "0".repeat(64);
    for wrong in ["", "x", &w.token[..63], &other] {
        assert_eq!(post(&[("Host", &host), ("Origin", &own), ("X-Axiscal-Token", wrong), kind]), 401, "{wrong}");
    }
    assert_eq!(post(&[("Host", &host), ("Origin", &own), token, ("Content-Type", "text/plain")]), 415);
    for path in ["/api/state", "/api/inputs", "/api/evidence", "/api/events"] {
        assert_eq!(w.send("GET", path, &[("Host", &host)], "").status, 401, "{path}");
        let with = format!("{path}?token={}", w.token);
        assert_eq!(w.send("GET", &with, &[("Host", &host)], "").status, 401, "a token in the path is none");
    }
    let cross = [("Host", host.as_str()), token, ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Mode", "cors")];
    assert_eq!(w.send("GET", "/api/state", &cross, "").status, 403);
    assert_eq!(w.text(), before, "nothing was written");
    assert_eq!(w.get("/api/state").status, 200, "and the right request is answered");
    let page = w.send("GET", "/", &[("Host", &host)], "");
    assert!(page.head.contains("content-security-policy: default-src 'none'; script-src 'self'"), "{}", page.head);
    assert!(page.head.contains("x-frame-options: DENY"), "{}", page.head);
    assert!(!page.head.to_lowercase().contains("access-control-allow"), "{}", page.head);
}

#[test]
fn no_path_of_a_request_reaches_the_disk() {
    let dir = folder();
    std::fs::write(dir.path().join("secret"), "the secret").unwrap();
    let w = Workbench::open(dir.path());
    for path in [
        "/study.toml",
        "/secret",
        "/../secret",
        "/assets/../secret",
        "/assets/..%2f..%2fsecret",
        "/assets/%2e%2e/secret",
        "/assets/%2fetc%2fpasswd",
        "//etc/passwd",
        "/assets//etc/passwd",
        "/assets/",
        "/assets/secret",
        "/assets/main.js%00",
        "/assets/%ff%fe",
        "/..\\secret",
        "/api/",
        "/api/../secret",
        "/assets/C:%5Cwindows%5Cwin.ini",
        "/.git/config",
    ] {
        let answer = w.get(path);
        assert!(matches!(answer.status, 400 | 404), "{path}: {} {}", answer.status, answer.body);
        assert!(
            !answer.body.contains("secret\"") && !answer.body.contains("the secret") && !answer.body.contains("root:"),
            "{path}"
        );
    }
    assert_eq!(w.get("/assets/main.js").status, 200);
    // nor does a word of a body: a controller is a name of the list, an effect an id, an effects file the study's
    std::fs::write(dir.path().join("mine.toml"), "name = \"mine\"").unwrap();
    let version = w.version();
    for controller in ["mine.toml", "../mine.toml", "/etc/passwd", "", "linuxcnc/../linuxcnc", "--out=/tmp/x"] {
        let body = json!({ "version": version, "verb": "export", "controller": controller }).to_string();
        assert_eq!(w.post("/api/call", &body).status, 422, "{controller}");
    }
    for id in ["../evil", "a/b", "A", "-x", "x\"]\nmachines = \"/etc/passwd\"", ""] {
        let draft =
            json!({ "id": id, "at": "B", "terms": [{ "parameter": "p", "unit": "um", "dof": "dz", "formula": "B" }] });
        let answer = w.step(version, &json!({ "save": { "draft": draft, "on": false } }));
        assert_eq!(answer.status, 422, "{id}: {}", answer.body);
        assert_eq!(answer.json()["mistakes"][0]["field"], "id", "{id}");
        assert_eq!(w.switch(id, true).status, 422, "{id}");
    }
    assert!(!dir.path().join("my-effects.toml").exists());
    let path_asked = w.post(
        "/api/call",
        &json!({ "version": version, "verb": "export", "controller": "linuxcnc", "out": "/tmp/x" }).to_string(),
    );
    assert_eq!(path_asked.status, 400, "{}", path_asked.body);
}

#[test]
fn rubbish_is_answered_and_changes_nothing() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let before = w.text();
    for body in [
        "",
        "{",
        "[]",
        "null",
        "\u{0}",
        "{\"version\":1}",
        "{\"version\":-1,\"ask\":\"undo\"}",
        "{\"version\":1,\"ask\":\"explode\"}",
        "{\"version\":1e99,\"ask\":\"undo\"}",
        "{\"version\":1,\"ask\":{\"switch\":{\"effect\":3,\"on\":true}}}",
        "{\"version\":1,\"ask\":{\"mask\":{\"touches\":[[1]],\"reason\":\"x\"}}}",
        "{\"version\":1,\"ask\":\"undo\",\"more\":1}",
    ] {
        assert_eq!(w.post("/api/step", body).status, 400, "{body}");
        // what cannot be tried is an answer with its reason: a formula is often unfinished while it is typed
        let tried = w.post("/api/try", body);
        assert!(tried.status == 400 || tried.body.contains("\"error\":\"unusable\""), "{body}: {}", tried.body);
        assert_eq!(w.post("/api/call", body).status, 400, "{body}");
    }
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert_eq!(w.post("/api/step", &deep).status, 400);
    let huge = format!("{{\"version\":1,\"ask\":\"{}\"}}", "x".repeat(2_000_000));
    assert_eq!(w.post("/api/step", &huge).status, 413);
    let promised = format!(
        "POST /api/step HTTP/1.1\r\nHost: {}\r\nOrigin: http://{}\r\nX-Axiscal-Token: {}\r\nContent-Type: application/json\r\nContent-Length: 99999999999\r\n\r\n{{",
        w.host(),
        w.host(),
        w.token
    );
    assert_eq!(w.raw(promised.as_bytes()).status, 413);
    let long_head = format!("GET / HTTP/1.1\r\nHost: {}\r\nX: {}\r\n\r\n", w.host(), "x".repeat(1_000_000));
    assert!(matches!(w.raw(long_head.as_bytes()).status, 0 | 400 | 431));
    for bytes in [
        &b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"[..],
        b"GET\r\n\r\n",
        b"\0\0\0\0\r\n\r\n",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ] {
        let _ = w.raw(bytes);
    }
    let version = w.version();
    for ask in [
        json!({ "switch": { "effect": "no-such-effect", "on": true } }),
        json!({ "switch": { "effect": "location-b", "on": true } }),
        json!({ "switch": { "effect": "squareness-xy", "on": false } }),
        json!({ "mask": { "touches": [], "reason": "none" } }),
        json!({ "mask": { "touches": [[1, 1]], "reason": " " } }),
        json!({ "mask": { "touches": [[0, 1]], "reason": "runs count from 1" } }),
        json!({ "mask": { "touches": [[1, 999_999]], "reason": "no such touch" } }),
        json!({ "mask": { "touches": [[usize::MAX, u64::MAX]], "reason": "no such touch" } }),
        json!({ "mask": { "touches": (1..=202).map(|id| (1, id)).collect::<Vec<_>>(), "reason": "all of them" } }),
        json!("undo"),
        json!("redo"),
    ] {
        let answer = w.step(version, &ask);
        assert_eq!(answer.status, 422, "{ask}: {:.300}", answer.body);
        assert!(!answer.json()["messages"][0]["message"].as_str().unwrap().is_empty());
    }
    assert_eq!(w.text(), before, "nothing was written");
    assert_eq!(w.version(), version);
    for method in ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"] {
        let origin = format!("http://{}", w.host());
        let status = w
            .send(method, "/api/step", &[("Host", &w.host()), ("Origin", &origin), ("X-Axiscal-Token", &w.token)], "")
            .status;
        assert_eq!(status, 405, "{method}");
    }
}

/// Streams of events take some of the connections only: requests are answered, and a place that is given back can be taken.
#[test]
fn streams_of_events_leave_room_for_requests() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let stream = || {
        let mut stream = TcpStream::connect(("127.0.0.1", w.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let head = format!("GET /api/events HTTP/1.1\r\nHost: {}\r\nX-Axiscal-Token: {}\r\n\r\n", w.host(), w.token);
        stream.write_all(head.as_bytes()).unwrap();
        let mut status = String::new();
        BufReader::new(stream.try_clone().unwrap()).read_line(&mut status).unwrap();
        (stream, status)
    };
    let mut open: Vec<(TcpStream, String)> = (0..24).map(|_| stream()).collect();
    assert!(open.iter().all(|(_, status)| status.contains(" 200 ")), "{open:?}");
    let refused = w.get("/api/events");
    assert_eq!((refused.status, &refused.json()["error"]), (503, &"streams".into()));
    assert_eq!(w.get("/api/state").status, 200);
    open.pop();
    let again = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        stream().1.contains(" 200 ")
    });
    assert!(again, "the place of a stream that was closed");
}

#[test]
fn a_slow_or_silent_client_does_not_hold_the_others_up() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let silent: Vec<TcpStream> = (0..40).map(|_| TcpStream::connect(("127.0.0.1", w.port)).unwrap()).collect();
    for mut stream in &silent {
        stream.write_all(b"GET / HTTP/1.1\r\nHost:").unwrap();
    }
    assert_eq!(w.get("/api/state").status, 200);
    // what says nothing more is sent away
    let mut answer = Vec::new();
    let mut first = &silent[0];
    first.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    assert!(first.read_to_end(&mut answer).is_ok(), "the connection is still open");
}

/// Formulas that are long, deep or multiply a shape parameter many times: each is tried or refused with its place, at once.
#[test]
fn no_formula_ends_the_process() {
    let dir = folder();
    let w = Workbench::open(dir.path());
    let version = w.version();
    let attempt = |formula: &str, shapes: usize| {
        let name = |i: usize| if i == 0 { "s".to_owned() } else { format!("s{i}") };
        let shape: Vec<Value> =
            (0..shapes).map(|i| json!({ "parameter": name(i), "unit": "mm", "start": 0.9 })).collect();
        let term = json!({ "parameter": "p", "unit": "um", "dof": "dx", "formula": formula });
        let draft = json!({ "id": "my-a", "at": "X", "terms": [term], "shape": shape });
        let begun = Instant::now();
        let answer = w.post("/api/try", &json!({ "version": version, "draft": draft }).to_string());
        (answer, begun.elapsed())
    };
    for formula in [
        format!("X{}", "*s".repeat(18)),
        format!("X{}", "*s".repeat(100)),
        format!("{}s", "s^".repeat(18)),
        format!("{}s{}", "sin(".repeat(32), ")".repeat(32)),
        vec!["cos(Y/s)"; 24].join("+"),
        vec!["cos(Y/s)"; 60].join("+"),
    ] {
        let (answer, time) = attempt(&formula, 1);
        assert_eq!(answer.status, 200, "{formula}: {:.300}", answer.body);
        assert!(answer.json()["error"].is_null(), "{formula}: {:.300}", answer.body);
        assert!(time < Duration::from_secs(20), "{formula}: {time:?}");
    }
    for (formula, from) in [("(".repeat(100) + "s" + &")".repeat(100), 64), ("s^".repeat(100) + "s", 129)] {
        let (answer, _) = attempt(&formula, 1);
        assert_eq!(answer.json()["error"], "mistakes", "{formula}: {:.300}", answer.body);
        let mistake = &answer.json()["mistakes"][0];
        assert_eq!((&mistake["field"], &mistake["from"]), (&json!("terms.0.formula"), &json!(from)), "{mistake}");
        assert!(mistake["help"].is_string(), "{mistake}");
    }
    let (answer, _) = attempt("s + s1 + s2 + s3 + s4 + s5 + s6 + s7 + s8", 9);
    assert_eq!(answer.json()["error"], "mistakes", "{:.300}", answer.body);
    assert_eq!(answer.json()["mistakes"][0]["field"], "shape.8.parameter");
    assert_eq!(w.version(), version);
}
