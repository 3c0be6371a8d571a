//! Sphere centres of others, R-test readings and results on one's own part as studies. Inputs: `tests/centres/README.md`.

use crate::common::verbs::{axiscal, json, ok};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn input(name: &str) -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/centres").join(name).display().to_string()
}

/// What stderr says of a call that must be refused.
fn refused(at: &Path, args: &[&str]) -> String {
    let out = axiscal(at, args);
    assert_eq!(out.status.code(), Some(2), "{args:?}: {}", String::from_utf8_lossy(&out.stdout));
    String::from_utf8(out.stderr).unwrap()
}

fn parameter<'a>(fit: &'a Value, name: &str) -> &'a Value {
    fit["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

const OF_PLANTED: [&str; 8] = ["--machine", "swivel-table-b", "--unit", "mm", "--kind", "machine", "--sigma-um", "0.8"];

fn planted(at: &Path) {
    let file = input("planted.csv");
    ok(at, &[&["new", "--centres", &file, "--out", "s.toml"][..], &OF_PLANTED].concat());
}

/// Planted offsets within three standard uncertainties; the tilt of C in the machine is that of B and that of C on B together.
#[test]
fn planted_axes_are_found_from_centres() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    planted(at);
    let (fit, code) = json(at, &["identify", "s.toml", "--covariance"]);
    assert_eq!(code, 0);
    assert_eq!(fit["rank"], fit["unknowns"]);
    for (name, planted) in [("EZ0B", -0.012), ("EX0C", 0.018), ("EY0C", -0.006)] {
        let p = parameter(&fit, name);
        let (value, sigma) = (p["value"].as_f64().unwrap(), p["sigma"].as_f64().unwrap());
        assert!((value - planted).abs() < 3.0 * sigma && sigma < 5e-4, "{name}: {value} ± {sigma}");
    }
    let names: Vec<&str> = fit["covariance"]["names"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    let place = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let covariance = |a: &str, b: &str| fit["covariance"]["matrix"][place(a)][place(b)].as_f64().unwrap();
    let (b, c) = ("EA0B", "EA0C");
    let sum = parameter(&fit, b)["value"].as_f64().unwrap() + parameter(&fit, c)["value"].as_f64().unwrap();
    let sigma = (covariance(b, b) + 2.0 * covariance(b, c) + covariance(c, c)).sqrt();
    let planted = 0.0002_f64.to_degrees();
    assert!((sum - planted).abs() < 3.0 * sigma, "{sum} ± {sigma}, planted {planted}");
}

#[test]
fn every_verb_works_on_a_study_of_centres() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    planted(at);
    let (found, code) = json(at, &["diagnose", "s.toml"]);
    assert!(code == 0 && found["verdict"] == "adequate", "{found}");
    // nothing has triggered: what is wrong with a trigger is no question
    let text = found.to_string();
    for absent in ["pretravel", "lobing-3", "latency", "sphere-form-3", "block-size"] {
        assert!(!text.contains(&format!("\"{absent}\"")), "{absent}");
    }
    ok(at, &["compare", "s.toml"]);
    ok(at, &["assess", "--plan", "s.plan.json", "--machine", "swivel-table-b"]);
    ok(at, &["add", "s.toml", "scale-x"]);
    ok(at, &["remove", "s.toml", "scale-x"]);
    ok(at, &["export", "s.toml", "--controller", "linuxcnc", "--out", "comp"]);
    ok(at, &["report", "s.toml", "--out", "report.html"]);
    ok(
        at,
        &[
            "simulate",
            "--plan",
            "s.plan.json",
            "--machine",
            "swivel-table-b",
            "--controller",
            "csv",
            "--out",
            "sim.csv",
        ],
    );
    ok(
        at,
        &[
            "new",
            "--machine",
            "swivel-table-b",
            "--plan",
            "s.plan.json",
            "--log",
            "sim.csv",
            "--controller",
            "csv",
            "--out",
            "sim.toml",
        ],
    );
    let (fit, _) = json(at, &["identify", "sim.toml"]);
    assert!(fit["rms_um"].as_f64().unwrap() < 3.0, "{fit}");
}

/// Of the 18 parameters of the forward model 12 combinations have an effect; the constant offsets have none, and get no number.
#[test]
fn readings_determine_what_they_can_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (file, own) = (input("cone_19.csv"), input("bk4.toml"));
    let of_readings =
        ["new", "--machine", "trunnion", "--centres", &file, "--sphere-at", "200,0,-250", "--sigma-um", "0.01"];
    let model = ["--effects-file", &own, "--effects", "bk4-a,bk4-c,bk4-c-motion,reading-zero", "--out", "k.toml"];
    ok(at, &[&of_readings[..], &model].concat());
    let (fit, _) = json(at, &["identify", "k.toml"]);
    // 18, and the three unknown zeros of the readings, which are determined as far as nothing else looks like them
    assert_eq!((fit["unknowns"].as_u64(), fit["rank"].as_u64()), (Some(21), Some(12 + 3)));
    for name in ["X_OC", "X_OA", "Y_OA", "Z_OA"] {
        let p = parameter(&fit, name);
        assert_eq!(p["status"], "undetermined", "{p}");
        let combinations = fit["undetermined"].as_array().unwrap();
        assert!(combinations.iter().any(|c| c["says"].as_str().unwrap().contains(name)), "{name}");
    }
    // planted.csv of the same source, mm and mrad
    for (name, planted) in
        [("Y_OC", -0.02), ("Z_OC", 0.01), ("A_OC", 0.1), ("B_OC", -0.08), ("B_OA", 0.09), ("C_OA", -0.07)]
    {
        let p = parameter(&fit, name);
        assert!((p["value"].as_f64().unwrap() - planted).abs() < 1e-5, "{p}");
    }
    // the default model, without being told anything
    ok(at, &[&of_readings[..], &["--out", "d.toml"]].concat());
    let (fit, _) = json(at, &["identify", "d.toml"]);
    for name in ["EX0C", "EY0A", "EZ0A"] {
        assert_eq!(parameter(&fit, name)["status"], "undetermined");
    }
    assert_eq!(parameter(&fit, "EB0A")["status"], "identified");
}

#[test]
fn what_a_file_does_not_say_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let file = input("planted.csv");
    let new = ["new", "--machine", "swivel-table-b", "--out", "s.toml", "--centres", &file];
    let said = refused(at, &new);
    assert!(said.contains("unit of X, Y and Z") && said.contains("# kind = machine"), "{said}");
    let said = refused(at, &[&new[..], &["--unit", "mm", "--kind", "machine"]].concat());
    assert!(said.contains("noise of a centre is not stated"), "{said}");
    let (inch, none) = (["--unit", "inch", "--kind", "machine", "--sigma-um", "1"], input("no-angles.txt"));
    let said = refused(at, &[&new[..], &inch].concat());
    assert!(said.contains("do not fit machine") && said.contains("in the other unit"), "{said}");
    let said = refused(at, &["new", "--machine", "swivel-table-b", "--centres", &none, "--out", "s.toml"]);
    assert!(said.contains("no-angles.txt:1:1") && said.contains("without the angles"), "{said}");
    assert!(!at.join("s.toml").exists() && !at.join("s.plan.json").exists());
}

const HEAD: &str = "# unit = mm\n# kind = machine\n# position-of = ball\n# sigma-um = 1\n";

#[test]
fn faulty_rows_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let good = "B,C,X,Y,Z\n0,0,90,55,-200\n0,90,-55,90,-200\n";
    let cases = [
        ("0,180,-90,-55\n", "f.csv:8:1", "4 fields"),
        ("0,180,-90,-55", "f.csv:8:1", "cut off"),
        ("0,180,-90,0,-55,0,-200,0\n", "f.csv:8:1", "decimal commas"),
        ("0,180,nan,-55,-200\n", "f.csv:8:7", "expected a number"),
        ("0,180,-90,,-200\n", "f.csv:8:11", "expected a number"),
        ("0,90,-55,90,-200\n", "f.csv:8:1", "the same as line 7"),
        ("0,180,-90,-155,-200\n", "f.csv:8:1", "from where the others"),
        ("0,400,-90,-55,-200\n", "f.csv:8:1", "beyond its range"),
    ];
    for (row, place, words) in cases {
        std::fs::write(at.join("f.csv"), format!("{HEAD}{good}{row}")).unwrap();
        let said = refused(at, &["new", "--machine", "swivel-table-b", "--centres", "f.csv", "--out", "s.toml"]);
        assert!(said.contains(place) && said.contains(words) && said.contains("help:"), "{row}: {said}");
    }
    for (text, words) in [
        ("B,C,X,Y,W\n0,0,1,2,3\n", "column \"W\" is not known"),
        ("B,X,Y,Z\n0,90,55,-200\n", "no column C"),
        ("A,B,C,X,Y,Z\n0,0,0,90,55,-200\n", "no axis A"),
        ("B,C,X,Y,Z\n", "no row"),
        ("", "no header"),
    ] {
        std::fs::write(at.join("f.csv"), format!("{HEAD}{text}")).unwrap();
        let said = refused(at, &["new", "--machine", "swivel-table-b", "--centres", "f.csv", "--out", "s.toml"]);
        assert!(said.contains(words) && said.contains("help:"), "{text}: {said}");
    }
}

/// One set of centres in every spelling: the fits agree.
#[test]
fn spellings_of_one_file_give_one_result() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = std::fs::read_to_string(input("planted.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let body = |line: &dyn Fn(&[f64]) -> String| rows.iter().map(|r| line(r)).collect::<String>();
    let inch = |mm: f64| mm / 25.4;
    let files = [
        format!("{HEAD}{text}"),
        format!("{HEAD}{text}").replace('\n', "\r\n"),
        format!("{HEAD}{}", text.replace(',', ";").replace('.', ",")),
        format!(
            "# unit: inch\n# kind: machine\n# sigma_um: 1\nsphere\tX\tY\tZ\tB\tC\tstatus\n{}",
            body(&|r| format!("k\t{}\t{}\t{}\t{}\t{}\tok\n", inch(r[2]), inch(r[3]), inch(r[4]), r[0], r[1]))
        ),
        format!(
            "# kind = machine\n# position-of = spindle\n# sigma_um = 1\nX_mm Y_mm Z_mm B_deg C_deg\n{}",
            body(&|r| format!("{} {} {} {} {}\n", r[2], r[3], r[4] + 202.684, r[0], r[1]))
        ),
    ];
    let mut values = Vec::new();
    for (i, file) in files.iter().enumerate() {
        std::fs::write(at.join("f.txt"), file).unwrap();
        let study = format!("s{i}.toml");
        ok(at, &["new", "--machine", "swivel-table-b", "--centres", "f.txt", "--out", &study]);
        values.push(parameter(&json(at, &["identify", &study]).0, "EX0C")["value"].as_f64().unwrap());
    }
    assert!(values.iter().all(|v| (v - values[0]).abs() < 1e-7), "{values:?}");
}

/// Six points of a sphere at each pose: its centre is used, and what the form leaves is shown.
#[test]
fn points_are_fitted_first() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = std::fs::read_to_string(input("planted.csv")).unwrap();
    let mut out = format!("{HEAD}sphere,touch,X,Y,Z,B,C,direction\n");
    let directions = [
        ("+Z", [0.0, 0.0, 1.0]),
        ("+X", [1.0, 0.0, 0.0]),
        ("-X", [-1.0, 0.0, 0.0]),
        ("+Y", [0.0, 1.0, 0.0]),
        ("-Y", [0.0, -1.0, 0.0]),
    ];
    for line in text.lines().skip(1) {
        let r: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        for (i, (name, d)) in directions.iter().enumerate() {
            let p: Vec<f64> = (0..3).map(|k| r[2 + k] + 15.5 * d[k]).collect();
            out += &format!("ball,{},{},{},{},{},{},{name}\n", i + 1, p[0], p[1], p[2], r[0], r[1]);
        }
    }
    std::fs::write(at.join("points.csv"), &out).unwrap();
    let (made, _) = json(at, &["new", "--machine", "swivel-table-b", "--centres", "points.csv", "--out", "s.toml"]);
    let fitted = made["centres"]["fitted"].as_array().unwrap();
    assert_eq!(fitted.len(), 16);
    assert!((fitted[0]["radius_mm"].as_f64().unwrap() - 15.5).abs() < 1e-6, "{}", fitted[0]);
    let (fit, _) = json(at, &["identify", "s.toml"]);
    let x = parameter(&fit, "EX0C")["value"].as_f64().unwrap();
    assert!((x - 0.01774).abs() < 2e-5, "{x}");
    // three points of one pose determine no sphere
    std::fs::write(at.join("few.csv"), out.lines().take(8).collect::<Vec<_>>().join("\n")).unwrap();
    let said = refused(at, &["new", "--machine", "swivel-table-b", "--centres", "few.csv", "--out", "f.toml"]);
    assert!(said.contains("few.csv:6:1") && said.contains("4 and more"), "{said}");
}

#[test]
fn repeats_give_the_noise_and_runs_become_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let text = std::fs::read_to_string(input("planted.csv")).unwrap();
    let mut out = String::from("# unit = mm\n# kind = machine\nrun,B,C,X,Y,Z\n");
    for run in 1..=2 {
        for (i, line) in text.lines().skip(1).enumerate() {
            let r: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            for repeat in 0..2 {
                let off = if (i + repeat + run) % 2 == 0 { 0.0007 } else { -0.0007 };
                out += &format!("{run},{},{},{},{},{}\n", r[0], r[1], r[2] + off, r[3] - off, r[4] + off);
            }
        }
    }
    std::fs::write(at.join("f.csv"), out).unwrap();
    ok(at, &["new", "--machine", "swivel-table-b", "--centres", "f.csv", "--out", "s.toml"]);
    assert!(at.join("s-run1.plan.json").exists() && at.join("s-run2.csv").exists());
    let (fit, _) = json(at, &["identify", "s.toml"]);
    assert_eq!(fit["noise_source"], "repeats");
    assert!((fit["noise_um"].as_f64().unwrap() - 0.99).abs() < 0.05, "{}", fit["noise_um"]);
    assert_eq!(fit["touches"], 2 * 2 * 16 * 3);
    // one sphere that stays where it is
    assert_eq!(fit["unknowns"], 8 + 3);
}

const POSES: &str = "record,A,C\n1,0,0\n2,0,90\n3,-60,0\n";

#[test]
fn results_on_a_part_become_a_plan() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("poses.csv"), POSES).unwrap();
    let file = input("part.txt");
    let new = ["new", "--machine", "trunnion", "--points", &file, "--poses", "poses.csv"];
    for (frame, study) in [("part", "p.toml"), ("turned", "t.toml")] {
        ok(at, &[&new[..], &["--points-in", frame, "--out", study]].concat());
        let (fit, _) = json(at, &["identify", study]);
        assert_eq!(fit["touches"], 12, "{frame}");
    }
    ok(at, &[&new[..], &["--out", "q.toml"]].concat());
    let plan = |name: &str| std::fs::read_to_string(at.join(name)).unwrap();
    let touches = |text: String| serde_json::from_str::<Value>(&text).unwrap()["touches"].clone();
    // the same points at each pose are those of the part
    assert_eq!(touches(plan("q.plan.json")), touches(plan("p.plan.json")));
    std::fs::write(at.join("poses.csv"), "record,A,C\n1,0,0\n2,0,90\n").unwrap();
    let said = refused(at, &[&new[..], &["--out", "r.toml"]].concat());
    assert!(said.contains("orientation 3") && said.contains("part.txt:25:1"), "{said}");
    std::fs::write(at.join("poses.csv"), "record,A\n1,0\n").unwrap();
    let said = refused(at, &[&new[..], &["--out", "r.toml"]].concat());
    assert!(said.contains("poses.csv:1:1") && said.contains("record,A,C"), "{said}");
}

/// Poses for the user's own cycle: measured and added to the file, they separate what they promise to separate better.
#[test]
fn plan_next_proposes_poses_for_centres() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    planted(at);
    let ask = ["plan-next", "s.toml", "--out", "next", "--effects", "scale-x,scale-y"];
    let (next, code) = json(at, &ask);
    assert_eq!(code, 0);
    let pair = &next["pairs"][0];
    let (before, after) = (pair["before"].as_f64().unwrap(), pair["after"].as_f64().unwrap());
    assert!(after > 1.5 * before, "{pair}");
    let centres = next["centres"].as_array().unwrap();
    assert!(!centres.is_empty());
    let csv = std::fs::read_to_string(at.join("next/next-2.csv")).unwrap();
    assert_eq!(csv.lines().count(), centres.len() + 1);
    assert!(csv.starts_with("sphere,B,C,X,Y,Z\n"), "{csv}");
    // the user's cycle: each centre where an errorless machine has it, in the file's coordinates (ball)
    let mut text = std::fs::read_to_string(input("planted.csv")).unwrap();
    for c in centres {
        let of = |k: usize| c["expected_mm"][k].as_f64().unwrap();
        let angle = |axis: &str| c["pose"][axis].as_f64().unwrap();
        text += &format!("{},{},{},{},{}\n", angle("B"), angle("C"), of(0), of(1), of(2) - 202.684);
    }
    std::fs::write(at.join("more.csv"), text).unwrap();
    ok(at, &[&["new", "--centres", "more.csv", "--out", "m.toml"][..], &OF_PLANTED].concat());
    let (fit, _) = json(at, &["identify", "m.toml"]);
    assert_eq!(fit["touches"], 3 * (16 + centres.len()));
    for verb in ["diagnose", "plan-next"] {
        let out: &[&str] = if verb == "plan-next" { &["--out", "again"] } else { &[] };
        let (_, code) = json(at, &[&[verb, "m.toml"][..], out].concat());
        assert!(code == 0 || code == 1, "{verb}");
    }
    ok(at, &["report", "m.toml", "--out", "report.html"]);
    // a program needs a controller, poses do not
    let said = refused(at, &["plan-next", "s.toml", "--out", "next", "--join", "next/next-2.csv"]);
    assert!(said.contains("--controller"), "{said}");
}
