//! `axiscal export` on top of what the control holds: old values from a backup, by hand or not known, and the files that bring
//! them back.

use crate::common::*;
use crate::export_verb::{EFFECTS, axiscal, backup, export, folder, json, text, trunnion};
use predicates::prelude::*;
use serde_json::Value;
use std::collections::BTreeMap;

/// `NAME=1.25 ; remark`: what a control would hold after such a file.
fn sinumerik(text: &str) -> BTreeMap<String, f64> {
    let value = |line: &str| {
        let (name, value) = line.split(';').next()?.split_once('=')?;
        let name = name.split_whitespace().last()?;
        Some((name.to_owned(), value.trim().replace("EX", "E").parse().ok()?))
    };
    text.lines().filter_map(value).collect()
}

#[test]
fn old_values_come_from_the_backup_and_the_restoring_file_brings_them_back() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    let more = ["--accept-unverified", "--backup", "backup.ini", "--date", "2026-11-20"];
    let answer = json(export(at, "sinumerik", "comp", &more));
    let (old, new) = (sinumerik(&backup("sinumerik.ini")), sinumerik(&text(at, "comp/axiscal_trafo.ini")));
    let restoring = text(at, "comp/restore_trafo.ini");
    assert!(restoring.contains("RESTORES the values before") && !restoring.contains("ASSUMED"), "{restoring}");
    // what the control holds after both files is what it held
    let mut held = old.clone();
    for (name, value) in &new {
        assert!(held.insert(name.clone(), *value).is_some(), "{name} is in no backup");
    }
    assert_ne!(held, old);
    held.extend(sinumerik(&restoring));
    assert_eq!(held, old);
    // EY0A is 0.021 mm, against the machine's description: the program gave axis positions, on which the -0.2 and -250.05 of
    // the backup did not act; along A's line, in X, they stay
    let moved = |name: &str| new[name] - old[name];
    assert!((new["$MC_TRAFO5_BASE_TOOL_1[1]"] - 0.021).abs() < 0.001, "{new:?}");
    assert!((new["$MC_TRAFO5_BASE_TOOL_1[2]"] + 250.0).abs() < 0.002);
    assert!(moved("$MC_TRAFO5_BASE_TOOL_1[0]").abs() < 1e-9 && moved("$MC_TRAFO5_JOINT_OFFSET_1[2]").abs() < 1e-5);
    assert!(
        (moved("$MC_TRAFO5_BASE_TOOL_1[1]")
            + moved("$MC_TRAFO5_JOINT_OFFSET_1[1]")
            + moved("$MC_TRAFO5_PART_OFFSET_1[1]"))
        .abs()
            < 1e-9
    );
    assert_eq!(answer["values"].as_array().unwrap().len(), new.len());

    // the head of every file: study, its hash, the day of the data
    let hash_of = |out: &str| -> String {
        let record: Value = serde_json::from_str(&text(at, &format!("{out}/compensation.json"))).unwrap();
        record["study_sha256"].as_str().unwrap().to_owned()
    };
    let hash = hash_of("comp");
    assert!(hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit()), "{hash}");
    let files = answer["files"].as_array().unwrap();
    // the present values of the swivel data are not known: no file of theirs
    assert_eq!(files.len(), 4, "{files:?}");
    for name in files {
        let text = text(at, &format!("comp/{}", name.as_str().unwrap()));
        for word in ["study.toml", hash.as_str(), "2026-11-20", "trunnion"] {
            assert!(text.contains(word), "{name} lacks {word}");
        }
    }
    // without --date: the day of the log file
    export(at, "sinumerik", "comp", &more[..3]).assert().success();
    assert!(!text(at, "comp/axiscal_trafo.ini").contains("2026-11-20"));
    assert_eq!(hash_of("comp"), hash, "the same data");

    // the same by hand, value by value
    let mut by_hand = vec!["--accept-unverified".to_owned()];
    by_hand.extend(
        old.iter().filter(|(n, _)| new.contains_key(*n)).flat_map(|(n, v)| ["--old".to_owned(), format!("{n}={v}")]),
    );
    let words: Vec<&str> = by_hand.iter().map(String::as_str).collect();
    export(at, "sinumerik", "hand", &words).assert().success();
    assert_eq!(sinumerik(&text(at, "hand/axiscal_trafo.ini")), new);

    // another byte in the log is another hash
    let log = text(at, "run.log");
    std::fs::write(at.join("run.log"), log.replace('\n', "\r\n")).unwrap();
    export(at, "sinumerik", "none", &["--accept-unverified"]).assert().success();
    assert_ne!(hash_of("none"), hash);
}

/// What is loaded takes the place of what the control held: without the present values nothing to load is written.
#[test]
fn without_present_values_nothing_to_load_is_written() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    for control in ["sinumerik", "fanuc", "heidenhain", "haas"] {
        let answer = json(export(at, control, control, &["--accept-unverified"]));
        assert_eq!(answer["files"], serde_json::json!(["axiscal_changes.txt", "README.txt", "compensation.json"]));
        let values = answer["values"].as_array().unwrap();
        assert!(values.iter().all(|v| v["old"].is_null() && v["new"].is_null() && v["known"] == false), "{values:?}");
        let moved = values.iter().map(|v| v["change"].as_f64().unwrap());
        assert!(moved.into_iter().any(|change| (change - 0.021).abs() < 0.0015), "{control}: {values:?}");
        assert!(answer["changes"].as_array().unwrap().iter().all(|c| c["change"] != 0.0), "{answer}");
        // the record is enough for the virtual machine, and for the study of the next measurement
        let log = format!("{control}.log");
        let compensation = format!("{control}/compensation.json");
        let common = ["--machine", "trunnion", "--controller", control, "--plan", "tcp.plan.json"];
        let mut tcp = plan(&machine("trunnion"), "basic");
        tcp.controller_frame = axiscal::program::plan::ControllerFrame::Tcp;
        std::fs::write(at.join("tcp.plan.json"), tcp.to_json()).unwrap();
        axiscal(at)
            .arg("simulate")
            .args(common)
            .args(["--scenario", "wrong.toml", "--compensation", &compensation, "--out", &log])
            .assert()
            .success();
        let study = format!("{control}.toml");
        axiscal(at)
            .arg("new")
            .args(common)
            .args(["--log", &log, "--compensation", &compensation, "--effects", EFFECTS, "--out", &study])
            .assert()
            .success();
        let run = axiscal(at).args(["identify", &study, "--json"]).assert().success();
        let fit: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        let found = fit["parameters"].as_array().unwrap();
        // a tilt of C, which some of them cannot hold, leaves its share in the other offsets
        let left = found.iter().find(|p| p["name"] == "EY0A").unwrap()["value"].as_f64().unwrap();
        assert!(left.abs() < 0.003, "{control}: {left}");
        // a sheet is no present value: the next export still gives changes
        let out = format!("{control}-again");
        let mut again = axiscal(at);
        again.args(["export", &study, "--controller", control, "--out", &out, "--accept-unverified", "--json"]);
        let run = again.assert().success();
        let answer: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        assert!(answer["values"].as_array().unwrap().iter().all(|v| v["new"].is_null()), "{answer}");
    }
}

#[test]
fn old_values_by_hand_are_checked() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    let name = "$MC_TRAFO5_BASE_TOOL_1[1]";
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    std::fs::write(at.join("empty.ini"), "; nothing\n").unwrap();
    std::fs::write(at.join("twice.ini"), format!("{name}=1\n{name}=2\n")).unwrap();
    let of = |value: &str| format!("{name}={value}");
    let cases: [(&[&str], &str); 8] = [
        (&["--old", name], "there is no ="),
        (&["--old", "$MC_OTHER=1"], "no such value is written"),
        (&["--old", &of("1,5")], "that is no number"),
        (&["--old", &of("inf")], "that is no number"),
        (&["--old", &of("1"), "--old", &of("1")], "it is given twice"),
        (&["--backup", "backup.ini", "--old", &of("1")], "it is given twice"),
        (&["--backup", "empty.ini"], "none of the values"),
        (&["--backup", "twice.ini"], "twice.ini:2:1: error: $MC_TRAFO5_BASE_TOOL_1[1] stands twice: 1 and 2"),
    ];
    for (more, says) in cases {
        let all = [&["--accept-unverified"][..], more].concat();
        let run = export(at, "sinumerik", "comp", &all).assert().code(2);
        let said = String::from_utf8_lossy(&run.get_output().stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(says), "{more:?}: {said}");
        assert!(!at.join("comp").exists());
    }
    // a place 3 mm away is another machine's
    export(at, "sinumerik", "comp", &["--accept-unverified", "--old", &of("3")])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--force"));
    // LinuxCNC has its own
    for more in [&["--backup", "backup.ini"][..], &["--unit", "inch"]] {
        export(at, "linuxcnc", "comp", more).assert().code(2).stderr(predicate::str::contains("--ini"));
    }
    export(at, "sinumerik", "comp", &["--ini", "backup.ini"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("--backup"));
}

/// What a control with a worksheet holds, where it is set as the trunnion is described.
fn held(control: &str) -> String {
    let names: Vec<String> = match control {
        "haas" => (300..306).map(|n| format!("SETTING {n}")).collect(),
        _ => ["FIRST", "SECOND"]
            .iter()
            .flat_map(|axis| ["X", "Y", "Z"].map(|c| format!("{axis} TABLE AXIS {c}")))
            .collect(),
    };
    let value = |n: usize| if n == 2 || (n == 5 && control == "haas") { -250.0 } else { 0.0 };
    names.iter().enumerate().map(|(n, name)| format!("{name} = {:.4}\n", value(n))).collect()
}

/// Controls without a file that a user writes: the sheet is the record of what was entered, and serves as the backup.
#[test]
fn a_worksheet_serves_as_the_backup_of_the_next_export() {
    let folder = trunnion("haas");
    let at = folder.path();
    let sheet = |name: &str| -> BTreeMap<String, f64> {
        let value = |line: &str| {
            let (name, value) = line.split(';').next()?.split_once('=')?;
            Some((name.trim().to_owned(), value.trim().parse().ok()?))
        };
        text(at, name).lines().filter_map(value).collect()
    };
    for control in ["haas", "heidenhain"] {
        let [one, two] = ["one", "two"].map(|n| format!("{control}-{n}"));
        std::fs::write(at.join("held.txt"), held(control)).unwrap();
        let first = json(export(at, control, &one, &["--accept-unverified", "--backup", "held.txt"]));
        let entered = format!("{one}/axiscal_worksheet.txt");
        let more = ["--accept-unverified", "--backup", entered.as_str()];
        // of the same study they are the new values: what was identified would be added twice
        let twice = export(at, control, &two, &more).assert().code(2);
        twice.stderr(predicates::str::contains("written by an export of this study"));
        // the study of the next measurement
        std::fs::write(at.join("study.toml"), text(at, "study.toml") + "# measured again\n").unwrap();
        let second = json(export(at, control, &two, &more));
        assert_eq!(first["values"].as_array().unwrap().len(), second["values"].as_array().unwrap().len());
        let (was, back) = (sheet(&entered), sheet(&format!("{two}/restore_worksheet.txt")));
        assert!(was.len() >= 6 && was == back, "{control}: {was:?} {back:?}");
        // a program of axis positions shows the same error again, whatever was entered: it is no sum
        let again = sheet(&format!("{two}/axiscal_worksheet.txt"));
        let old = sheet(&format!("{one}/restore_worksheet.txt"));
        for (name, value) in &was {
            assert!((again[name] - value).abs() < 1.1e-4, "{control} {name}: {} instead of {value}", again[name]);
        }
        assert!(was.iter().any(|(name, value)| (value - old[name]).abs() > 0.01), "{control}: {was:?}");
    }
}

#[test]
fn a_restoring_file_is_not_written_over() {
    let folder = trunnion("sinumerik");
    let at = folder.path();
    std::fs::write(at.join("backup.ini"), backup("sinumerik.ini")).unwrap();
    export(at, "sinumerik", "comp", &["--accept-unverified", "--backup", "backup.ini"]).assert().success();
    let restoring = text(at, "comp/restore_trafo.ini");
    export(at, "sinumerik", "comp", &["--accept-unverified"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("restore_trafo.ini of an earlier export holds other values"));
    assert_eq!(text(at, "comp/restore_trafo.ini"), restoring);
    // the same values again, and what is forced
    export(at, "sinumerik", "comp", &["--accept-unverified", "--backup", "backup.ini"]).assert().success();
    export(at, "sinumerik", "comp", &["--accept-unverified", "--force"]).assert().success();
}

#[test]
fn a_restoring_worksheet_shows_the_way_back() {
    let folder = trunnion("heidenhain");
    let at = folder.path();
    std::fs::write(at.join("held.txt"), held("heidenhain")).unwrap();
    export(at, "heidenhain", "comp", &["--accept-unverified", "--backup", "held.txt"]).assert().success();
    let changes = |name: &str| -> Vec<f64> {
        let change = |line: &str| line.split("change ").nth(1)?.split([';', ' ']).next()?.trim().parse().ok();
        text(at, name).lines().filter_map(change).collect()
    };
    let names: Vec<String> = std::fs::read_dir(at.join("comp"))
        .unwrap()
        .map(|e| format!("comp/{}", e.unwrap().file_name().to_string_lossy()))
        .filter(|n| n.contains("worksheet"))
        .collect();
    let (back, there): (Vec<_>, Vec<_>) = names.iter().partition(|n| n.contains("restore"));
    let (back, there) = (changes(back[0]), changes(there[0]));
    assert!(there.iter().any(|c| c.abs() > 0.01), "{there:?}");
    assert_eq!(back.len(), there.len());
    assert!(back.iter().zip(&there).all(|(b, t)| (b + t).abs() < 1e-9), "{back:?} {there:?}");
}

#[test]
fn a_position_table_that_is_in_use_is_not_written_over() {
    let scenario = "seed = 5\n[effects.scale-x]\nEXX = 60\n[noise]\ntouch_um = 0.5\n";
    let folder = folder("swivel-head", "head", "sinumerik", scenario, "location-b,scale-x,block-setup,pretravel");
    let at = folder.path();
    std::fs::write(at.join("used.ini"), "$AN_CEC[0,0]=0.05\n$AN_CEC[0,1]=0.07\nM17\n").unwrap();
    let more = ["--accept-unverified", "--force", "--backup", "used.ini"];
    export(at, "sinumerik", "none", &more[..1]).assert().success();
    assert!(!at.join("none/axiscal_cec.ini").exists() && !at.join("none/restore_cec.ini").exists());
    assert!(text(at, "none/axiscal_changes.txt").contains("$AN_CEC[0,0]"));
    // the table is not in use: that is a present value, and the vectors are still not known
    let alone = [more[0], "--old", "$AN_CEC[0,0]=0"];
    let answer = json(export(at, "sinumerik", "alone", &alone));
    assert!(at.join("alone/axiscal_cec.ini").exists() && !at.join("alone/axiscal_trafo.ini").exists(), "{answer}");
    export(at, "sinumerik", "forced", &more)
        .assert()
        .success()
        .stderr(predicate::str::contains("position table 0 of the control is in use: $AN_CEC[0,0] = 0.05"));
    let quiet = [more[0], more[2], more[3]];
    export(at, "sinumerik", "used", &quiet).assert().code(2).stderr(predicate::str::contains("is in use"));
    std::fs::write(at.join("used.ini"), "$AN_CEC[0,0]=0\n$AN_CEC[0,1]=0\nM17\n").unwrap();
    export(at, "sinumerik", "free", &quiet).assert().success();
    assert!(!text(at, "free/restore_cec.ini").contains("ASSUMED"));
}
