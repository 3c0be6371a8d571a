//! What `diagnose` says to do next is something that can be done: each command runs, and what no command can do is said as
//! an action at the machine. A gross mistake in the log stops every verb alike.

use crate::common;

use common::verbs::{axiscal, json, ok, study, touched};
use serde_json::Value;
use std::path::Path;

/// Words as they were before they were laid out in lines.
fn unwrapped(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The touches of `full` as CSV, each row changed, and their study. `change` gets the touch of the plan and the row by the
/// names of its columns.
fn study_of_csv(at: &Path, change: impl Fn(&Value, &mut Vec<(String, String)>)) {
    ok(at, &["parse", "full.log", "--plan", "full.plan.json", "--controller", "linuxcnc", "--out", "touches.csv"]);
    let plan: Value = serde_json::from_str(&std::fs::read_to_string(at.join("full.plan.json")).unwrap()).unwrap();
    let text = std::fs::read_to_string(at.join("touches.csv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut out = vec![head.join(",")];
    for line in lines {
        let mut row: Vec<(String, String)> =
            head.iter().zip(line.split(',')).map(|(h, v)| ((*h).to_owned(), v.to_owned())).collect();
        let touch =
            plan["touches"].as_array().unwrap().iter().find(|t| t["id"].as_u64() == row[0].1.parse().ok()).unwrap();
        change(touch, &mut row);
        out.push(row.into_iter().map(|c| c.1).collect::<Vec<_>>().join(","));
    }
    std::fs::write(at.join("touches.csv"), out.join("\n") + "\n").unwrap();
    let new = ["new", "--machine", "swivel-head", "--plan", "full.plan.json", "--log", "touches.csv"];
    ok(at, &[&new[..], &["--controller", "csv", "--out", "study.toml"]].concat());
}

/// The commands that an answer names.
fn commands(said: &str) -> Vec<String> {
    let named = said.lines().filter_map(|l| Some((l, l.find("axiscal ")?)));
    let each = named.filter(|(l, _)| l.starts_with("next:") || l.starts_with("  or") || l.starts_with("  either"));
    // an effect that a person must choose is no command
    each.map(|(l, at)| l[at..].to_owned()).filter(|c| !c.contains(" EFFECT")).collect()
}

/// `diagnose` of the study: its words, after each command that it names has run and did something.
fn diagnosed(at: &Path) -> String {
    let said = String::from_utf8(axiscal(at, &["diagnose", "study.toml", "--verbose"]).stdout).unwrap();
    for command in commands(&said) {
        let words: Vec<&str> = command.split(' ').skip(1).collect();
        let out = axiscal(at, &words);
        let text = format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr));
        assert_eq!(out.status.code(), Some(0), "{command}: {text}\nafter: {said}");
    }
    assert!(said.contains("next: "), "{said}");
    said
}

#[test]
fn a_column_of_the_other_sign_stops_every_verb() {
    let folder = touched(&["full"], "seed = 5\n[noise]\ntouch_um = 0.7\n", None);
    let at = folder.path();
    study_of_csv(at, |_, row| {
        let b = row.iter_mut().find(|c| c.0 == "B").unwrap();
        b.1 = b.1.parse::<f64>().map(|v| (-v).to_string()).unwrap();
    });
    let says = "axis B counts the wrong way round";
    let (d, code) = json(at, &["diagnose", "study.toml"]);
    assert_eq!((d["verdict"].as_str(), code), (Some("missing-effect"), 1), "{}", d["says"]);
    assert!(d["says"].as_str().unwrap().contains(says), "{}", d["says"]);
    assert_eq!(d["gross"][0]["hypothesis"], "flip_B", "{}", d["gross"]);
    assert_eq!(d["candidates"][0]["effect"], "sign-or-axis-swap", "{d}");
    assert!(d["gross"][0]["in_place"].as_f64().is_some_and(|s| s > 0.99), "{}", d["gross"]);
    let said = String::from_utf8(axiscal(at, &["diagnose", "study.toml"]).stdout).unwrap();
    assert!(said.contains("next: correct that") && unwrapped(&said).contains("would be where planned"), "{said}");
    let (c, _) = json(at, &["compare", "study.toml"]);
    assert!(c["says"].as_str().unwrap().contains(says) && c["explained_by_noise"] == false, "{}", c["says"]);
    let (i, _) = json(at, &["identify", "study.toml", "--quick"]);
    assert!(i["warnings"].to_string().contains("the sign of B were the other one"), "{}", i["warnings"]);
    let (s, code) = json(at, &["solve", "study.toml", "--yes"]);
    assert!(code == 1 && s["stopped"].as_str().unwrap().contains(says), "{s}");
    let (n, code) = json(at, &["plan-next", "study.toml", "--out", "next", "--controller", "linuxcnc"]);
    assert!(code == 1 && n["says"].as_str().unwrap().contains(says) && !at.join("next").exists(), "{n}");
    let (r, _) = json(at, &["report", "study.toml", "--out", "page.html"]);
    assert!(r["headline"]["level"] == "act" && r["headline"]["sentence"].as_str().unwrap().contains(says), "{r}");
    // they are no touches of the plan: none of them is given on, and it is said how many there are and why
    let parse = ["parse", "touches.csv", "--plan", "full.plan.json", "--controller", "csv", "--out", "again.csv"];
    let (p, _) = json(at, &parse);
    let n = p["elsewhere"].as_u64().unwrap() as usize;
    assert!(n > 100 && p["complete"] == false && p["missing"].as_array().unwrap().len() == n, "{}", p["elsewhere"]);
    assert_eq!(std::fs::read_to_string(at.join("again.csv")).unwrap().lines().count(), 1 + 744 - n);
}

#[test]
fn what_is_said_to_be_next_can_be_done() {
    // an effect with a name, alone
    let named = touched(&["full"], "seed = 4\n[effects.head-sag]\nhead_sag = 8.0\n[noise]\ntouch_um = 0.7\n", None);
    study(named.path(), &["full"]);
    let said = diagnosed(named.path());
    assert!(said.contains("next: axiscal add study.toml head-sag"), "{said}");

    // several that these touches cannot tell apart: the program that does, for the control that the study knows
    let group = touched(
        &["head", "table"],
        "seed = 3\n[effects.backlash-y]\nbacklash_Y = 6.0\n[noise]\ntouch_um = 1.0\n",
        None,
    );
    study(group.path(), &["head", "table"]);
    let said = diagnosed(group.path());
    assert!(said.contains("next: axiscal plan-next study.toml --out next --controller linuxcnc"), "{said}");

    // teeth: a formula
    let teeth = "seed = 6\n[[harmonic]]\naxis = \"C\"\ndof = \"rz\"\nk = 7\ncos_urad = 160.0\nsin_urad = -90.0\n[noise]\ntouch_um = 1.0\n";
    let teeth = touched(&["full"], teeth, None);
    study(teeth.path(), &["full"]);
    let said = diagnosed(teeth.path());
    assert!(said.contains("next: axiscal sketch-effect study.toml"), "{said}");

    // poses that do not come back: nothing to type
    let visits = touched(&["full"], "seed = 400\n[noise]\ntouch_um = 0.5\nvisit_um = 6.0\n", None);
    study(visits.path(), &["full"]);
    let said = diagnosed(visits.path());
    assert!(commands(&said).is_empty() && said.contains("next: check the clamping and indexing"), "{said}");
}

/// One block is knocked in mid-program: its jump is drawn, its touches are one finding, and the formula takes it away.
#[test]
fn a_moved_block_is_drawn_and_sketched() {
    let own = "[[effect]]\nid = \"planted\"\nat = \"block\"\nper = \"block\"\nterms = [\n{ parameter = \"qx\", unit = \"um\", dof = \"dx\", formula = \"step(t - 0.83)\" },\n{ parameter = \"qy\", unit = \"um\", dof = \"dy\", formula = \"step(t - 0.83)\" } ]\n";
    let wrong = "effects_file = \"own.toml\"\nseed = 5\n[effects.planted]\n\"qx@full/b\" = 8.0\n\"qy@full/b\" = -5.0\n[noise]\ntouch_um = 0.7\n";
    let folder = touched(&["full"], wrong, Some(own));
    let at = folder.path();
    study(at, &["full"]);
    let (d, code) = json(at, &["diagnose", "study.toml"]);
    assert_eq!((d["verdict"].as_str(), code), (Some("unexplained"), 1), "{}", d["says"]);
    assert_eq!((d["moved_block"].as_str(), d["where"][0]["by"].as_str()), (Some("full/b"), Some("time*block")), "{d}");
    let shape = &d["shape"];
    assert!(shape["kind"].as_str().unwrap().starts_with("a block was knocked or slid"), "{shape}");
    assert_eq!((shape["block"].as_str(), shape["x_unit"].as_str()), (Some("full/b"), Some("h")), "{shape}");
    let list = |key: &str| -> Vec<f64> { shape[key].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
    let (x, y) = (list("x"), list("y"));
    let jumps: Vec<usize> = (1..y.len()).filter(|&i| (y[i] - y[i - 1]).abs() > 3.0).collect();
    assert_eq!(jumps.len(), 1, "{y:?}");
    assert!((x[jumps[0]] - 0.83).abs() < 0.1, "{}", x[jumps[0]]);
    let said = diagnosed(at);
    assert!(
        said.contains("next: clamp block full/b again") && unwrapped(&said).contains("the time on block full/b"),
        "{said}"
    );
    let listed = said.lines().filter(|l| l.contains("not used:") && l.contains("full/b")).count();
    assert!(listed <= 1, "{said}");
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    let text =
        text.replace("machine = \"swivel-head\"", "machine = \"swivel-head\"\neffects_file = [\"my-effects.toml\"]");
    std::fs::write(at.join("study.toml"), &text).unwrap();
    let (added, code) = json(at, &["add", "study.toml", "sketch-moved-block"]);
    let noise = added["after"]["noise_um"].as_f64().unwrap();
    assert!(code == 0 && added["after"]["rms_um"].as_f64().unwrap() < 1.2 * noise, "{added}");
    // a word of the whole study below [[data]] belongs to the run: said so
    let below = text.replace("effects_file = [\"my-effects.toml\"]\n", "");
    let below = below
        .replace("controller = \"linuxcnc\"\n", "controller = \"linuxcnc\"\neffects_file = [\"my-effects.toml\"]\n");
    std::fs::write(at.join("below.toml"), below).unwrap();
    let out = axiscal(at, &["identify", "below.toml"]);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(2) && said.contains("put it above the first [[data]]"), "{said}");
}

/// Chips on two faces: they are named, the curve has names on its axis, and nobody is sent to write a formula.
#[test]
fn chips_are_said_by_face() {
    let folder = touched(&["full"], "seed = 5\n[noise]\ntouch_um = 0.7\n", None);
    let at = folder.path();
    study_of_csv(at, |touch, row| {
        let place = (touch["block"].as_str().unwrap(), touch["face"].as_str().unwrap());
        let id = touch["id"].as_u64().unwrap();
        if ![("a", "+X"), ("g", "+Y")].contains(&place) || id * 7 % 5 > 2 {
            return;
        }
        let chip_mm = 0.006 + 0.004 * (id * 13 % 7) as f64;
        let way: Vec<f64> = ["X", "Y", "Z"]
            .iter()
            .map(|k| touch["end"][*k].as_f64().unwrap() - touch["start"][*k].as_f64().unwrap())
            .collect();
        let length = way.iter().map(|w| w * w).sum::<f64>().sqrt();
        for (k, w) in ["X", "Y", "Z"].iter().zip(&way) {
            let cell = row.iter_mut().find(|c| c.0 == *k).unwrap();
            cell.1 = format!("{:.4}", cell.1.parse::<f64>().unwrap() - w / length * chip_mm);
        }
    });
    let (d, code) = json(at, &["diagnose", "study.toml"]);
    assert_eq!(code, 1, "{}", d["says"]);
    let named = d["outliers"].as_array().unwrap();
    assert!(named.iter().all(|o| !o["block"].as_str().unwrap().is_empty() && !o["face"].as_str().unwrap().is_empty()));
    let said = diagnosed(at);
    if d["where"][0]["by"] == "face" {
        let faces = d["faces"].to_string();
        assert!(faces.contains("full/a +X"), "{faces}: {}", d["says"]);
        assert!(said.contains("next: clean full/"), "{said}");
    }
    if let Some(shape) = d.get("shape").filter(|s| s["by"] == "face") {
        assert_eq!(shape["labels"].as_array().unwrap().len(), shape["x"].as_array().unwrap().len(), "{shape}");
    }
    assert_eq!(d["where"][0]["by"], "face", "{}", d["says"]);
}
