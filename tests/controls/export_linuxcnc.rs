//! `axiscal export` for LinuxCNC: the INI file's values, a component in use, versions, and the rows of an endless axis.

use crate::export_verb::{axiscal, export, folder, json, text, trunnion};
use predicates::prelude::*;
use serde_json::Value;
use std::path::Path;

/// LinuxCNC: a component's pins are all that there is; what stands in the INI file is added to.
#[test]
fn linuxcnc_adds_to_what_the_ini_holds() {
    let scenario = "seed = 3\n[effects.zero-a]\nEA0A = 0.03\n[effects.scale-x]\nEXX = 60\n[effects.location-a]\nEY0A = 0.013\n[noise]\ntouch_um = 0.5\n";
    // without tilts of C, one of which is A's zero position
    let effects = "location-a,zero-a,scale-x,block-setup,pretravel";
    let folder = folder("trunnion", "full", "linuxcnc", scenario, effects);
    let at = folder.path();
    let files = |answer: &Value| -> Vec<String> {
        answer["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned()).collect()
    };
    let without = json(export(at, "linuxcnc", "without", &[]));
    let names = files(&without);
    assert!(names.contains(&"axiscal.hal".to_owned()) && names.contains(&"restore.hal".to_owned()), "{names:?}");
    for file in ["axiscal_comp_x.txt", "stock/axiscal.hal", "stock/restore.hal", "stock/axiscal_comp_x.txt"] {
        assert!(!names.contains(&file.to_owned()), "{file}: {names:?}");
    }
    let ini = |name: &str| {
        let own = text(at, name);
        own.lines().filter(|l| !l.starts_with('#')).map(str::to_owned).collect::<Vec<_>>().join("\n")
    };
    for name in ["without/stock/axiscal.ini", "without/restore.ini", "without/stock/restore.ini"] {
        for word in ["HOME_OFFSET", "COMP_FILE"] {
            assert!(!ini(name).contains(word), "{name}: {}", ini(name));
        }
    }
    assert!(!ini("without/restore.ini").contains("KINEMATICS"));
    let changes = without["changes"].as_array().unwrap();
    let of = |word: &str| changes.iter().find(|c| c["name"].as_str().unwrap().contains(word));
    assert!((of("y-rot-point").unwrap()["change"].as_f64().unwrap() - 0.013).abs() < 0.002, "{changes:?}");
    assert!(of("HOME_OFFSET").is_some() && of("compensation of X at -300 mm").is_some(), "{changes:?}");

    std::fs::write(
        at.join("own.ini"),
        "[KINS]\nKINEMATICS = trivkins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n[JOINT_3]\nTYPE = ANGULAR\nHOME_OFFSET = 12.5\n[JOINT_4]\nTYPE = ANGULAR\n",
    )
    .unwrap();
    let with = json(export(at, "linuxcnc", "with", &["--ini", "own.ini"]));
    assert_eq!(with["changes"], serde_json::json!([]));
    let home: f64 = ini("with/stock/axiscal.ini")
        .lines()
        .filter_map(|l| l.strip_prefix("HOME_OFFSET = ")?.parse().ok())
        .find(|v: &f64| (v - 12.5).abs() < 0.1)
        .unwrap();
    assert!(((home - 12.5).abs() - 0.03).abs() < 0.005, "{home}");
    assert!(ini("with/stock/restore.ini").contains("HOME_OFFSET = 12.5"));
    for file in ["axiscal_comp_x.txt", "stock/axiscal.hal", "stock/restore.hal"] {
        assert!(files(&with).contains(&file.to_owned()), "{file}");
    }
    // the module in use has pins that no INI file holds
    let used = text(at, "own.ini").replace("trivkins", "xyzac-trt-kins");
    std::fs::write(at.join("used.ini"), used).unwrap();
    let used = json(export(at, "linuxcnc", "used", &["--ini", "used.ini"]));
    assert!(!files(&used).contains(&"stock/axiscal.hal".to_owned()), "{used}");
    assert!(used["changes"].as_array().unwrap().iter().all(|c| c["file"] == "stock/axiscal_changes.txt"));
    // given by hand they are added to, and the restoring file brings them back
    let pin = |folder: &str, file: &str, name: &str| -> Option<f64> {
        let lines = text(at, &format!("{folder}/stock/{file}.hal"));
        lines.lines().find_map(|l| l.strip_prefix(&format!("setp xyzac-trt-kins.{name} "))?.parse().ok())
    };
    let present = [("x-rot-point", 7.5), ("y-rot-point", -3.25), ("z-rot-point", -251.0), ("y-offset", 0.4)];
    let old: Vec<String> = present.iter().map(|(n, v)| format!("--old=xyzac-trt-kins.{n}={v}")).collect();
    let old: Vec<&str> = ["--ini", "used.ini"].into_iter().chain(old.iter().map(String::as_str)).collect();
    let given = json(export(at, "linuxcnc", "given", &old));
    assert_eq!(given["changes"], serde_json::json!([]));
    for (name, was) in present {
        let described = pin("with", "restore", name).unwrap();
        let change = pin("with", "axiscal", name).unwrap() - described;
        assert_eq!(pin("given", "restore", name), Some(was), "{name}");
        assert!((pin("given", "axiscal", name).unwrap() - was - change).abs() < 1e-9, "{name}");
    }
    assert_eq!(pin("given", "axiscal", "tool-offset"), None);
    // the virtual machine has the described machine's pins: the same change
    let record = |folder: &str| -> Value {
        serde_json::from_str(&text(at, &format!("{folder}/stock/compensation.json"))).unwrap()
    };
    assert_eq!(record("given")["stock"]["pins"], record("with")["stock"]["pins"]);
    // what lacks a pin, or is none, or has another kinematics in use is refused with its code
    let refused: [(&[&str], &str); 4] = [
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.x-offset=0"], "tables::old_pins"),
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.rot-point=0"], "export::old"),
        (&["--ini", "used.ini", "--old", "xyzac-trt-kins.x-rot-point=1e308"], "export::backup_range"),
        (&[&["--ini", "own.ini"], &old[2..]].concat(), "tables::old_pins"),
    ];
    for (more, code) in refused {
        let run = export(at, "linuxcnc", "refused", &[more, &["--json"]].concat()).assert().code(2);
        let answer: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
        assert_eq!(answer["findings"][0]["code"], code, "{more:?}: {answer}");
        assert!(!at.join("refused").exists());
    }
}

/// A component that is in use acted on the touches: where the study does not name its compensation, its values would be lost.
#[test]
fn a_component_in_use_is_not_written_over() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let ini = "[KINS]\nKINEMATICS = axiscal_trunnion_kins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\n";
    std::fs::write(at.join("machine.ini"), ini).unwrap();
    let run = export(at, "linuxcnc", "comp", &["--ini", "machine.ini", "--json"]).assert().code(2);
    let refused: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    assert_eq!(refused["findings"][0]["code"], "tables::component_in_use", "{refused}");
    assert!(!at.join("comp").exists());
    let forced = json(export(at, "linuxcnc", "comp", &["--ini", "machine.ini", "--force"]));
    assert!(!forced["files"].as_array().unwrap().is_empty());
    // whoever loads it is told
    let record: Value = serde_json::from_str(&text(at, "comp/compensation.json")).unwrap();
    assert!(record["forced"].as_array().unwrap().iter().any(|f| f.as_str().unwrap().contains("axiscal_trunnion_kins")));
}

/// JOINTS, letters and joint types of an INI file that contradict each other: the zero of A would go to a linear joint.
#[test]
fn an_ini_that_contradicts_itself_is_refused() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let ini = "[KINS]\nKINEMATICS = xyzac-trt-kins\nJOINTS = 6\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n\
               [JOINT_3]\nTYPE = LINEAR\nHOME_OFFSET = 12.0\n[JOINT_4]\nTYPE = ANGULAR\nHOME_OFFSET = 1.25\n";
    std::fs::write(at.join("machine.ini"), ini).unwrap();
    let refused = export(at, "linuxcnc", "comp", &["--ini", "machine.ini"]).assert().code(2);
    refused.stderr(
        predicate::str::contains("machine.ini:3:1: error:").and(predicate::str::contains("machine.ini:8:1: error:")),
    );
    assert!(!at.join("comp").exists());
    let good = ini.replace("JOINTS = 6", "JOINTS = 5").replacen("LINEAR\nHOME", "ANGULAR\nHOME", 1);
    std::fs::write(at.join("machine.ini"), good).unwrap();
    export(at, "linuxcnc", "comp", &["--ini", "machine.ini"]).assert().success();
}

/// The version of LinuxCNC: 2.9 unless it is said, by `--target` or in a file; the direction pin is set where there is one.
#[test]
fn linuxcnc_is_written_for_its_version() {
    let folder = trunnion("linuxcnc");
    let at = folder.path();
    let mine = "format = \"axiscal-postprocessor/1\"\nbased_on = \"linuxcnc\"\nname = \"mine\"\n[settings]\nversion = \"master\"\n";
    std::fs::write(at.join("mine.toml"), mine).unwrap();
    // another kinematics in use: no pin of the stock module holds anything that would be added to
    let own = "[KINS]\nKINEMATICS = trivkins coordinates=XYZAC\nJOINTS = 5\n[TRAJ]\nCOORDINATES = XYZAC\nLINEAR_UNITS = mm\n\
               [JOINT_3]\nTYPE = ANGULAR\n[JOINT_4]\nTYPE = ANGULAR\n";
    std::fs::write(at.join("own.ini"), own).unwrap();
    for (n, (controller, more, version)) in [
        ("linuxcnc", &[][..], "2.9"),
        ("linuxcnc", &["--target", "master"], "master"),
        ("./mine.toml", &[], "master"),
        ("./mine.toml", &["--target", "2.9"], "2.9"),
    ]
    .into_iter()
    .enumerate()
    {
        let out = format!("comp{n}");
        let answer = json(export(at, controller, &out, &[more, &["--ini", "own.ini"]].concat()));
        assert_eq!(answer["version"], version);
        let record: Value = serde_json::from_str(&text(at, &format!("{out}/stock/compensation.json"))).unwrap();
        assert_eq!(record["stock"]["version"], version);
        let pin = "setp xyzac-trt-kins.conventional-directions 0";
        for file in ["axiscal.hal", "restore.hal"] {
            let hal = text(at, &format!("{out}/stock/{file}"));
            assert_eq!(hal.lines().any(|l| l == pin), version == "master", "{hal}");
            assert_eq!(hal.lines().filter(|l| l.starts_with("setp")).count(), 7 + usize::from(version == "master"));
        }
    }
    let unknown = export(at, "linuxcnc", "comp9", &["--target", "2.8"]).assert().code(2);
    unknown.stderr(predicate::str::contains("2.9, master"));
    export(at, "haas", "comp9", &["--target", "2.9", "--accept-unverified"]).assert().code(2);
}

/// A turntable without ends: LinuxCNC has no table that repeats every turn, and 256 rows over 55 turns would be 78 deg apart.
/// What goes two and three times a turn must be gone after the export, and what the rows leave must be stated.
#[test]
fn rows_of_an_endless_axis_hold_what_goes_several_times_a_turn() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["endless.toml", "program.toml", "wrong.toml"] {
        let text = text(Path::new(env!("CARGO_MANIFEST_DIR")), &format!("tests/tables/endless/{name}"));
        std::fs::write(at.join(name), text).unwrap();
    }
    let machine = ["--machine", "endless", "--machines", "endless.toml"];
    let plan = ["--plan", "job/turn.plan.json"];
    let effects = "location-a,location-c,positioning-c-1,positioning-c-2,positioning-c-3,block-setup,pretravel";
    let run = |verb: &str, more: &[&str]| {
        axiscal(at).arg(verb).args(machine).args(more).assert().success();
    };
    run("generate", &["--program", "program.toml", "--controller", "linuxcnc", "--out", "job"]);
    run("simulate", &[&plan[..], &["--scenario", "wrong.toml", "--out", "run.log"]].concat());
    run("new", &[&plan[..], &["--log", "run.log", "--effects", effects, "--out", "study.toml"]].concat());

    let answer = json(export(at, "linuxcnc", "comp", &[]));
    let [said] = answer["table_errors"].as_array().unwrap().as_slice() else { panic!("{answer}") };
    assert_eq!((said["input"].as_str(), said["output"].as_str()), (Some("C"), Some("C")));
    let um = |key: &str| said[key].as_f64().unwrap();
    assert!(um("correction_um") > 30.0 && um("interpolation_um") < 0.1 && um("rounding_um") < 1e-3, "{said}");
    // the rows cover the turns in use, and what the end values leave elsewhere is said
    assert!(said["range"][0].as_f64().unwrap() <= -360.0 && said["range"][1].as_f64().unwrap() >= 360.0, "{said}");
    assert!(um("beyond_um") > 10.0, "{said}");
    for way in ["comp/compensation.json", "comp/stock/compensation.json"] {
        let record: Value = serde_json::from_str(&text(at, way)).unwrap();
        assert_eq!(record["table_errors"], answer["table_errors"]);
    }

    // measured again with it
    let comp = ["--compensation", "comp"];
    run("simulate", &[&plan[..], &comp[..], &["--scenario", "wrong.toml", "--out", "after.log"]].concat());
    run("new", &[&plan[..], &comp[..], &["--log", "after.log", "--effects", effects, "--out", "after.toml"]].concat());
    let mut identify = axiscal(at);
    identify.args(["identify", "after.toml", "--quick"]);
    let fit = json(identify);
    let value = |name: &str| {
        let found = fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
        (found["value"].as_f64().unwrap(), found["sigma"].as_f64().unwrap())
    };
    for (name, planted) in [("ECC2c", 200.0), ("ECC3s", 150.0)] {
        let (urad, sigma) = value(name);
        assert!(urad.abs() < 5.0 * sigma && urad.abs() < 0.1 * planted, "{name}: {urad} +- {sigma} urad");
    }
}
