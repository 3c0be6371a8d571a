//! Files that others wrote: logs of other programs, programs of other people, machines and programs with one mistake in them. Read are
//! JSON answers and exit codes.
// a panic in a test is a failure with its place

use assert_cmd::Command;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn here() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign")
}

/// Exit code and JSON answer of a call; paths are relative to `tests/foreign`.
fn answer(args: &[&str]) -> (i32, Value) {
    let mut command = Command::cargo_bin("axiscal").unwrap();
    let output = command.current_dir(here()).args(args).arg("--json").output().unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    let json = serde_json::from_str(&stdout).unwrap_or_else(|e| panic!("{args:?}: {e}: {stdout:?} {stderr}"));
    (output.status.code().unwrap(), json)
}

/// The codes of the findings of an answer, each as often as it stands there.
fn codes(json: &Value) -> Vec<&str> {
    json["findings"].as_array().unwrap().iter().map(|f| f["code"].as_str().unwrap()).collect()
}

fn says<'a>(json: &'a Value, code: &str) -> &'a str {
    let all = json["findings"].as_array().unwrap();
    all.iter().find(|f| f["code"] == code).unwrap_or_else(|| panic!("no {code} in {json}"))["says"].as_str().unwrap()
}

// -------------------------------------------------------------------------------------------------------------- logs

/// A plan of a program in `tests/foreign`, in a folder of its own.
struct Planned {
    folder: tempfile::TempDir,
    name: &'static str,
    /// Nominal X, Y, Z of each touch, mm.
    nominal: Vec<[f64; 3]>,
}

impl Planned {
    fn of(name: &'static str, program: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap().to_owned();
        let (code, _) = answer(&[
            "generate",
            "--machine",
            "trunnion",
            "--program",
            program,
            "--controller",
            "linuxcnc",
            "--out",
            &out,
        ]);
        assert_eq!(code, 0);
        let text = std::fs::read_to_string(folder.path().join(format!("{name}.plan.json"))).unwrap();
        let plan: Value = serde_json::from_str(&text).unwrap();
        let nominal = plan["touches"]
            .as_array()
            .unwrap()
            .iter()
            .map(|t| ["X", "Y", "Z"].map(|axis| t["nominal"][axis].as_f64().unwrap()));
        let nominal = nominal.collect();
        Self { folder, name, nominal }
    }

    fn parse(&self, log: &str, controller: &str) -> (i32, Value) {
        let path = self.folder.path().join("foreign.log");
        std::fs::write(&path, log).unwrap();
        let plan = self.folder.path().join(format!("{}.plan.json", self.name));
        answer(&["parse", path.to_str().unwrap(), "--controller", controller, "--plan", plan.to_str().unwrap()])
    }
}

/// A line of `(PROBEOPEN)`.
fn row(at: [f64; 3]) -> String {
    let [x, y, z] = at;
    format!("{x:.6} {y:.6} {z:.6} 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000\n")
}

/// How far past its place the probe triggered at each touch of the grid, mm.
const OFF_MM: [f64; 9] = [0.004, -0.002, 0.003, 0.001, -0.003, 0.002, -0.001, 0.005, 0.0];

fn touched(grid: &Planned) -> Vec<[f64; 3]> {
    grid.nominal.iter().zip(OFF_MM).map(|(at, off)| [at[0], at[1], at[2] + off]).collect()
}

fn z_by_id(json: &Value) -> Vec<(u64, f64)> {
    let touches = json["touches"].as_array().unwrap();
    touches.iter().map(|t| (t["id"].as_u64().unwrap(), t["Z"].as_f64().unwrap())).collect()
}

#[test]
fn rows_of_probeopen_belong_to_their_positions_in_any_order() {
    let grid = Planned::of("grid", "grid.toml");
    let at = touched(&grid);
    let expected: Vec<(u64, f64)> = (1..).zip(&at).map(|(id, at)| (id, at[2])).collect();
    let orders: [(&str, [usize; 9], bool); 4] = [
        ("the plan's", [0, 1, 2, 3, 4, 5, 6, 7, 8], false),
        ("X fastest", [0, 3, 6, 1, 4, 7, 2, 5, 8], true),
        ("backwards", [8, 7, 6, 5, 4, 3, 2, 1, 0], true),
        ("to and fro", [0, 1, 2, 5, 4, 3, 6, 7, 8], true),
    ];
    // one row for each touch, and search, release and measuring touch
    for n_rows in [1, 3] {
        for (name, order, other) in orders {
            let rows = order.iter().flat_map(|i| {
                let [x, y, z] = at[*i];
                let three = [[x, y, z - 0.002], [x, y, z + 0.003], [x, y, z]];
                three.into_iter().skip(3 - n_rows).map(row).collect::<Vec<_>>()
            });
            let (code, json) = grid.parse(&rows.collect::<String>(), "linuxcnc");
            assert_eq!((code, &json["complete"]), (0, &true.into()), "{name}, {n_rows} rows: {json}");
            for ((id, z), (wanted_id, wanted_z)) in z_by_id(&json).into_iter().zip(&expected) {
                assert!(id == *wanted_id && (z - wanted_z).abs() < 1e-6, "{name}, {n_rows} rows: {json}");
            }
            assert_eq!(codes(&json).contains(&"log::order"), other, "{name}: {json}");
            assert!(!codes(&json).contains(&"log::unmatched"), "{name}: {json}");
        }
    }
}

#[test]
fn a_row_that_is_lost_or_doubled_is_said_whatever_the_order() {
    let grid = Planned::of("grid", "grid.toml");
    let at = touched(&grid);
    let lost: String = [0, 3, 6, 1, 7, 2, 5, 8].iter().map(|i: &usize| row(at[*i])).collect();
    let (code, json) = grid.parse(&lost, "linuxcnc");
    assert_eq!((code, &json["hits"], &json["missing"]), (0, &8.into(), &serde_json::json!([5])), "{json}");
    // the same position once more, elsewhere in the log: which of the two counts is not known
    let doubled: String = [0, 3, 6, 1, 4, 7, 2, 5, 8, 0].iter().map(|i: &usize| row(at[*i])).collect();
    let (code, json) = grid.parse(&doubled, "linuxcnc");
    assert_eq!((code, &json["missing"]), (0, &serde_json::json!([1])), "{json}");
    assert!(codes(&json).contains(&"log::ambiguous"), "{json}");
}

#[test]
fn another_zero_or_unit_is_one_message_in_every_reader() {
    let grid = Planned::of("grid", "grid.toml");
    let at = touched(&grid);
    let by = [-110.5, 42.25, -17.299];
    let shifted: Vec<[f64; 3]> = at.iter().map(|p| std::array::from_fn(|i| p[i] + by[i])).collect();
    let inch: Vec<[f64; 3]> = at.iter().map(|p| p.map(|v| v / 25.4)).collect();
    let inch_shifted: Vec<[f64; 3]> = shifted.iter().map(|p| p.map(|v| v / 25.4)).collect();
    let csv = |rows: &[[f64; 3]]| {
        let lines = (1..).zip(rows).map(|(id, [x, y, z])| format!("{id},{x:.6},{y:.6},{z:.6},0,0\n"));
        format!("id,X,Y,Z,A,C\n{}", lines.collect::<String>())
    };
    let any_order = |rows: &[[f64; 3]]| [4, 8, 0, 3, 1, 7, 6, 2, 5].map(|i: usize| row(rows[i])).concat();
    for (what, log, controller) in [
        ("shift", any_order(&shifted), "linuxcnc"),
        ("inch", any_order(&inch), "linuxcnc"),
        ("both", any_order(&inch_shifted), "linuxcnc"),
        ("shift", csv(&shifted), "csv"),
        ("inch", csv(&inch), "csv"),
    ] {
        let (code, json) = grid.parse(&log, controller);
        assert_eq!((code, codes(&json)), (2, vec!["log::swapped"]), "{what} {controller}: {json}");
        let shift_is_named = says(&json, "log::swapped").contains("X -110.500 Y 42.250 Z -17.");
        assert_eq!(shift_is_named, what != "inch", "{what} {controller}: {json}");
    }
    // the same for inspection results: nominal points, and the ball's centres
    let msr = |by: [f64; 3]| {
        let points = (1..).zip(&grid.nominal).map(|(n, at)| {
            let p: [f64; 3] = std::array::from_fn(|i| at[i] + by[i]);
            let surface = p[2] - 202.684 - 3.0;
            format!(
                "G800 N{n} X{:.4} Y{:.4} Z{surface:.4} I0.0000 J0.0000 K1.0000 O0U0.01L-0.01\nG801 N{n} X{:.4}Y{:.4}Z{:.4}R3.0000\n",
                p[0], p[1], p[0], p[1], surface + 3.0
            )
        });
        format!("START\nG330 N0 A0. B0. C0. X0. Y0. Z0. I0 R0\n{}END\n", points.collect::<String>())
    };
    let (code, json) = grid.parse(&msr(by), "msr");
    assert_eq!((code, codes(&json)), (2, vec!["log::swapped"]), "{json}");
}

/// The example of docs/guide/controllers.md.
fn console_form() -> String {
    let guide = std::fs::read_to_string(here().join("../../docs/guide/controllers.md")).unwrap();
    let block = guide.split("```toml\n").find(|b| b.contains("prefix = \"[PRB:\"")).expect("the guide has an example");
    block.split("```").next().unwrap().to_owned()
}

#[test]
fn a_console_log_is_read_by_a_form_that_is_data() {
    let two = Planned::of("console", "console-program.toml");
    let form = two.folder.path().join("console.toml");
    std::fs::write(&form, console_form()).unwrap();
    let form = form.to_str().unwrap();
    // as in console.txt: two probings at a touch, the answer of each in a line of the console
    let [[x1, y1, z1], [x2, y2, z2]] = two.nominal[..] else { panic!("two touches") };
    let original = std::fs::read_to_string(here().join("console.txt")).unwrap();
    let log = original
        .replace("10.000,20.000,-4.012:1", &format!("{x1:.3},{y1:.3},{:.3}:1", z1 - 0.012))
        .replace("10.000,20.000,-4.018:1", &format!("{x1:.3},{y1:.3},{:.3}:1", z1 - 0.018))
        .replace("30.000,20.000,-4.018:0", &format!("{x2:.3},{y2:.3},{:.3}:0", z2 - 0.018));
    let (code, json) = two.parse(&log, form);
    assert_eq!((code, &json["hits"], &json["misses"]), (0, &1.into(), &1.into()), "{json}");
    let (id, z) = z_by_id(&json)[0];
    assert!(id == 1 && (z - (z1 - 0.018)).abs() < 1e-9, "{json}");
    assert!(codes(&json).contains(&"log::other_lines"), "{json}");
    // the file as it is has nothing to do with this plan, and every row of it is understood
    let (code, json) = two.parse(&original, form);
    assert_eq!(code, 2);
    assert!(
        codes(&json)
            .iter()
            .all(|c| ["log::other_lines", "log::unmatched", "log::missing", "log::no_match"].contains(c)),
        "{json}"
    );
    // what is damaged is said
    for (from, to, finding) in [
        (":1]", "]", "log::status"),
        (":1]", ":1", "log::cut_line"),
        (",", ";", "log::in_number"),
        ("[PRB:", "[PRB:x", "log::not_a_number"),
        (".000", ".00", "log::decimals"),
    ] {
        let (_, json) = two.parse(&log.replacen(from, to, 1), form);
        assert!(codes(&json).contains(&finding), "{from:?}: {json}");
    }
    // inches: other decimals than the form says are one message; with those, the unit is named
    let in_inches = |decimals: usize| {
        let point = |p: &[f64; 3], z: f64| {
            let [x, y, z] = [p[0] / 25.4, p[1] / 25.4, (p[2] - z) / 25.4];
            format!("[PRB:{x:.decimals$},{y:.decimals$},{z:.decimals$}:1]\n")
        };
        two.nominal.iter().map(|p| point(p, 0.012) + &point(p, 0.018)).collect::<String>()
    };
    for (decimals, finding) in [(4, "log::decimals"), (5, "log::decimals"), (3, "log::swapped")] {
        let (code, json) = two.parse(&in_inches(decimals), form);
        assert_eq!((code, codes(&json)), (2, vec![finding]), "{decimals}: {json}");
    }
    let with = console_form().replace("decimals = 3", "decimals = 4");
    for (text, expected) in [(with.clone(), 2), (with.replace("decimals = 4", "decimals = 4\nunit = \"inch\""), 0)] {
        std::fs::write(form, text).unwrap();
        let (code, json) = two.parse(&in_inches(4), form);
        assert_eq!(code, expected, "{json}");
        assert_eq!(codes(&json).contains(&"log::swapped"), expected == 2, "{json}");
    }
}

// ---------------------------------------------------------------------------------------------------------- programs

/// Checks a text without a plan.
fn checked(text: &str, controller: &str) -> (i32, Value) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(if controller == "linuxcnc" { "p.ngc" } else { "p.nc" });
    std::fs::write(&file, text).unwrap();
    answer(&["check", file.to_str().unwrap(), "--machine", "trunnion", "--controller", controller])
}

#[test]
fn what_is_not_known_is_not_called_wrong() {
    let modes = "G21 G90 G94 G40\n";
    for (name, text, unknown) in [
        ("dwell", format!("{modes}G4 P0.5\nM2\n"), 1),
        ("blending", format!("{modes}G64 P0.01\nM2\n"), 1),
        ("g92", format!("{modes}G92 X0\nM2\n"), 1),
        ("repeat", "o10 repeat [2]\nG4 P1\no10 endrepeat\nM2\n".to_owned(), 3),
        ("probeopen", format!("(PROBEOPEN a.txt)\n{modes}(PROBECLOSE)\nM2\n"), 2),
        ("all at once", format!("{modes}G4 P1\nG5.1 X1 I2\nM62 P0\nM100\nG4 P2\nG92 X0\nM2\n"), 6),
    ] {
        let (code, json) = checked(&text, "linuxcnc");
        let beyond = ["check::output", "check::foreign_program"];
        let mut found = codes(&json);
        if name == "all at once" {
            // an output and a program of the user's are named in their places, as what they are
            assert!(beyond.iter().all(|c| found.contains(c)), "{json}");
            found.iter_mut().filter(|c| beyond.contains(c)).for_each(|c| *c = "check::not_known");
        }
        assert_eq!((code, found), (2, vec!["check::not_known"; unknown]), "{name}: {json}");
        let lines: BTreeSet<i64> =
            json["findings"].as_array().unwrap().iter().map(|f| f["line"].as_i64().unwrap()).collect();
        assert!(lines.len() == unknown || name == "all at once", "{name}: {json}");
    }
    let klartext = "0 BEGIN PGM T MM\n1 CYCL DEF 32.0 TOLERANZ\n2 CYCL DEF 32.1 T0.05\n3 TOOL CALL 5 Z S1000\n4 FN 27: TABWRITE 5\n5 END PGM T MM\n";
    for (controller, text, unknown) in [
        (
            "sinumerik",
            "CYCLE832(0.01,_ROUGH, \"a b\")\nN20 ORIAXES T1 G0 X10\nFOO=3\nORIAXES\nM30\n",
            vec!["CYCLE832", "ORIAXES", "T1", "FOO"],
        ),
        ("heidenhain", klartext, vec!["CYCL DEF 32", "TOOL CALL 5", "FN 27"]),
    ] {
        let (code, json) = checked(text, controller);
        assert_eq!((code, codes(&json)), (2, vec!["check::not_known"; unknown.len()]), "{controller}: {json}");
        let found = json["findings"].as_array().unwrap();
        for (one, name) in found.iter().zip(unknown) {
            assert!(one["says"].as_str().unwrap().starts_with(&format!("{name} is")), "{one}");
        }
    }
    for (name, text) in [
        ("a name with a hyphen", "o<my-touch> sub\nG21\no<my-touch> endsub\no<my-touch> call\nM2\n"),
        ("a remark behind a semicolon", "; a remark\nG21 G90 G94 G40 ; another\nM2\n"),
    ] {
        let (code, json) = checked(text, "linuxcnc");
        assert!(code < 2, "{name}: {json}");
        let refused = ["check::not_known", "check::not_understood", "check::not_run"];
        assert!(!codes(&json).iter().any(|c| refused.contains(c)), "{name}: {json}");
    }
    let (code, json) = checked("%\nO123\nG28 Z0.\nM3 S500\nG43 I1.\nM30\n%\n", "fanuc");
    assert_eq!((code, codes(&json)), (2, vec!["check::not_known"; 4]), "{json}");
    for (controller, text, unknown) in [
        ("sinumerik", "G17 G710 G90\nG33 X1\nM3\nG4 F1\nG33 X2\nM30\n", 3),
        ("heidenhain", "0 BEGIN PGM P MM\n1 L X+1 R0 FMAX\n2 M3\n3 M8\n4 M30\n5 END PGM P MM\n", 2),
    ] {
        let (code, json) = checked(text, controller);
        assert_eq!((code, codes(&json)), (2, vec!["check::not_known"; unknown]), "{controller}: {json}");
    }
}

#[test]
fn without_a_plan_the_number_is_the_program_s_own_affair() {
    for number in ["O0123", "O00230001", "O9100", "O9810"] {
        for controller in ["fanuc", "fanuc-inspection-plus"] {
            let (code, json) = checked(&format!("%\n{number}\nG21 G17 G40 G49 G80 G90 G94\nM30\n%\n"), controller);
            assert!(code < 2, "{number} {controller}: {json}");
            let of_the_number = ["check::not_understood", "check::not_known", "check::program_number"];
            assert!(!codes(&json).iter().any(|c| of_the_number.contains(c)), "{number} {controller}: {json}");
        }
    }
}

#[test]
fn beside_its_plan_another_number_is_a_remark() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap().to_owned();
    let (code, _) = answer(&[
        "generate",
        "--machine",
        "trunnion",
        "--program",
        "grid.toml",
        "--controller",
        "fanuc",
        "--out",
        &out,
    ]);
    assert_eq!(code, 0);
    let (program, plan) = (folder.path().join("grid.nc"), folder.path().join("grid.plan.json"));
    let text = std::fs::read_to_string(&program).unwrap();
    assert!(text.contains("O9100"));
    std::fs::write(&program, text.replacen("O9100", "O4711", 1)).unwrap();
    let (program, plan) = (program.to_str().unwrap(), plan.to_str().unwrap());
    let (code, json) = answer(&["check", program, "--machine", "trunnion", "--controller", "fanuc", "--plan", plan]);
    assert_eq!((code, &json["good"]), (0, &true.into()), "{json}");
    assert_eq!(codes(&json), ["check::edited", "check::program_number"], "{json}");
}

// ------------------------------------------------------------------------------------- one mistake, one message; risers

/// Generates a program on a machine of a file.
fn generated(machine: &str, machines: &str, program: &str, more: &[&str]) -> (i32, Value) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let call = ["generate", "--machine", machine, "--machines", machines, "--program", program];
    answer(&[&call[..], &["--controller", "linuxcnc", "--out", out], more].concat())
}

#[test]
fn faces_in_machine_directions_on_an_inclined_table_are_one_mistake() {
    let (code, json) = generated("tnr", "inclined.toml", "inclined-program.toml", &[]);
    assert_eq!((code, codes(&json)), (2, vec!["program::skew_face"]), "{json}");
    // its place is the pose of the set-up
    let program = std::fs::read_to_string(here().join("inclined-program.toml")).unwrap();
    let line = json["findings"][0]["line"].as_u64().unwrap() as usize;
    assert!(program.lines().nth(line - 1).unwrap().contains("60.0, 120.0"), "{json}");
}

#[test]
fn a_gap_and_what_is_needed_are_shown_in_digits_that_differ() {
    let (code, json) = generated("desktop-ab", "near.toml", "upright-program.toml", &[]);
    assert_eq!(code, 0, "{json}");
    let skipped = json["skipped"].as_array().unwrap();
    let mut seen = 0;
    for reason in skipped.iter().map(|s| s["reason"].as_str().unwrap()) {
        if let Some((_, figures)) = reason.split_once("would come within ") {
            let numbers: Vec<f64> = figures.split([' ', '(']).filter_map(|w| w.parse().ok()).collect();
            let [gap, needed] = numbers[..] else { panic!("{reason}") };
            assert!(gap < needed, "{reason}");
            seen += 1;
        }
    }
    assert!(seen > 0, "the machine shows none: {json}");
}

#[test]
fn a_riser_goes_to_a_table_that_stands_upright() {
    let counts = |machines: &str| {
        let (code, json) = generated("desktop-ab", machines, "upright-program.toml", &[]);
        assert_eq!(code, 0, "{json}");
        json["skipped"].as_array().unwrap().iter().map(|s| s["points"].as_u64().unwrap()).sum::<u64>()
    };
    // a riser to the disc leaves as much free as a post there that the file describes
    let (with_riser, with_post) = (counts("upright.toml"), counts("near.toml"));
    assert!(with_riser <= with_post, "{with_riser} touches are left out, with a post {with_post}");
    // straight down it stands in the way
    let text = std::fs::read_to_string(here().join("upright.toml")).unwrap();
    let down = text.replacen("size = [8.0, 8.0] }", "size = [8.0, 8.0], toward = \"-Z\" }", 1);
    assert_ne!(text, down);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("down.toml");
    std::fs::write(&file, down).unwrap();
    assert!(counts(file.to_str().unwrap()) > 2 * with_post);
}

#[test]
fn risers_of_built_in_machines_end_at_a_table() {
    let text = axiscal::diag::source("machines.toml", axiscal::machine::BUILT_IN);
    let (_, findings) = axiscal::machine::load(&text).unwrap();
    let hanging: Vec<&str> =
        findings.0.iter().filter(|f| f.code == "machine::riser_hangs").map(|f| f.message.as_str()).collect();
    assert!(hanging.is_empty(), "{hanging:#?}");
    let upright = axiscal::diag::source("upright.toml", std::fs::read_to_string(here().join("upright.toml")).unwrap());
    let (_, findings) = axiscal::machine::load(&upright).unwrap();
    assert!(findings.0.iter().any(|f| f.code == "machine::riser_hangs"), "it is 6.3 mm too short");
}
