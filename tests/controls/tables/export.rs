//! What an export writes.

use axiscal::fit::outcome::{Outcome, Parameter, Status};

/// A fit with these parameters: name, effect, value, unit, status.
pub fn outcome(machine: &str, parameters: &[(&str, &str, f64, &str, Status)]) -> Outcome {
    let parameters = parameters
        .iter()
        .map(|(name, effect, value, unit, status)| Parameter {
            name: (*name).to_owned(),
            alias: None,
            effect: (*effect).to_owned(),
            value: *value,
            unit: (*unit).to_owned(),
            interval: None,
            sigma: Some(0.0002),
            expanded: Some(0.0004),
            sigma_noise: None,
            sigma_type_b: None,
            moves_with_unseen: None,
            sigma_with_unmodelled: None,
            holds: Vec::new(),
            status: *status,
        })
        .collect();
    Outcome {
        format: axiscal::fit::outcome::FORMAT.to_owned(),
        machine: machine.to_owned(),
        effects: vec![],
        converged: true,
        iterations: 4,
        touches: 202,
        unknowns: 5,
        rank: 5,
        dof: 197,
        condition: 13.7,
        rms_um: 1.0,
        noise_um: 1.0,
        chi2_per_dof: 1.0,
        parameters,
        ..Outcome::default()
    }
}

use super::support::{Spread, catalogue, have, machine, pose, run};
use axiscal::axes::AxisName;
use axiscal::diag::source;
use axiscal::tables::compensation::{Compensation, Mode, Provenance};
use axiscal::tables::correction::{Correction, During};
use axiscal::tables::kins::{Errors, Kins};
use axiscal::tables::linuxcnc::ini::UserIni;
use axiscal::tables::linuxcnc::work_offset;
use axiscal::tables::linuxcnc::{self, Export, Options};
use std::collections::BTreeMap;

type Parameters<'a> = &'a [(&'a str, &'a str, f64, &'a str, Status)];

fn provenance() -> Provenance {
    Provenance {
        study: "study.toml".into(),
        study_sha256: "0123abcd".into(),
        data_date: "2026-11-20".into(),
        forced: Vec::new(),
    }
}

fn collect(name: &str, parameters: Parameters, active: Option<&Compensation>) -> Correction {
    Correction::collect(
        &machine(name),
        &catalogue(),
        &outcome(name, parameters),
        During { loaded: active, transformation: true },
        provenance(),
    )
    .unwrap()
    .0
}

fn export(name: &str, parameters: Parameters, active: Option<&Compensation>, options: &Options) -> Export {
    linuxcnc::export(&machine(name), &collect(name, parameters, active), options).unwrap().0
}

fn files(export: &Export) -> BTreeMap<&str, &str> {
    export.files.iter().map(|(name, text)| (name.as_str(), std::str::from_utf8(text).unwrap())).collect()
}

/// The lines of a HAL or INI file that are no comments.
fn lines(text: &str) -> Vec<&str> {
    text.lines().filter(|l| !l.is_empty() && !l.starts_with('#')).collect()
}

const ID: Status = Status::Identified;

const HEAD: [(&str, &str, f64, &str, Status); 5] = [
    ("EA0B", "paper-head", 0.015, "deg", ID),
    ("EB0B", "paper-head", -0.01, "deg", ID),
    ("EC0B", "paper-head", 0.02, "deg", ID),
    ("EX0B", "paper-head", 0.03, "mm", ID),
    ("EY0B", "paper-head", 0.025, "mm", ID),
];

#[test]
fn only_what_was_identified_is_written() {
    let parameters = [
        ("EX0B", "location-b", 0.03, "mm", ID),
        ("EZ0B", "location-b", 0.04, "mm", Status::Undetermined),
        ("EA0B", "location-b", 0.01, "deg", Status::PriorDominated),
        ("EC0B", "location-b", 0.02, "deg", Status::Fixed),
        ("SX@head x-", "block-setup", 0.2, "mm", ID),
        ("pretravel", "pretravel", 0.005, "mm", ID),
    ];
    let export = export("swivel-head", &parameters, None, &Options::default());
    let terms = &export.component.compensation.terms;
    assert_eq!(terms.len(), 1);
    assert_eq!((terms[0].parameter.as_str(), terms[0].value, terms[0].sigma), ("EX0B", 0.03, Some(0.0002)));
    let files = files(&export);
    let hal = lines(files["axiscal.hal"]);
    assert!(hal.contains(&"setp axiscal_swivel_head_kins.b-after-x 0.03"));
    let set: Vec<_> = hal.iter().filter(|l| !l.ends_with(" 0") && !l.ends_with("mm-per-unit 1")).collect();
    assert_eq!(set.len(), 1, "{set:?}");
    let readme = files["README.txt"];
    for word in
        ["these touches cannot determine it", "held by the user", "from its prior", "block-setup (1)", "pretravel (1)"]
    {
        assert!(readme.contains(word), "{word}\n{readme}");
    }
}

#[test]
fn what_was_active_is_added_to() {
    let first = export("swivel-head", &HEAD, None, &Options::default());
    // the file goes out and comes back in
    let text = files(&first)["compensation.json"];
    let active = Compensation::read(&source("compensation.json", text)).unwrap();
    assert_eq!(active, first.component.compensation);
    let found = [("EX0B", "paper-head", 0.001, "mm", ID), ("EX0C", "paper-table", -0.04, "mm", ID)];
    let second = export("swivel-head", &found, Some(&active), &Options::default());
    let by = |name: &str| second.component.compensation.terms.iter().find(|t| t.parameter == name).unwrap();
    assert_eq!((by("EX0B").active_before, by("EX0B").identified, by("EX0B").value), (0.03, 0.001, 0.031));
    assert_eq!((by("EA0B").active_before, by("EA0B").identified, by("EA0B").value), (0.015, 0.0, 0.015));
    assert_eq!((by("EX0C").active_before, by("EX0C").identified, by("EX0C").value), (0.0, -0.04, -0.04));
    let files = files(&second);
    assert!(lines(files["axiscal.hal"]).contains(&"setp axiscal_swivel_head_kins.b-before-x 0.031"));
    let restore = lines(files["restore.hal"]);
    assert!(restore.contains(&"setp axiscal_swivel_head_kins.b-before-x 0.03"));
    assert!(restore.contains(&"setp axiscal_swivel_head_kins.c-before-x 0"));
    assert!(
        files["README.txt"].contains("Kept as they were, nothing was found on top of them: EY0B, EA0B, EB0B, EC0B.")
    );
    assert!(lines(files["restore.ini"]).contains(&"KINEMATICS = axiscal_swivel_head_kins coordinates=XYZBC"));
}

/// The same transform stated at another point: the mapping does not change.
#[test]
fn what_was_active_is_restated_at_the_new_reference() {
    let machine = machine("trunnion");
    let found = [
        ("EX0C", "paper-table", 0.03, "mm", ID),
        ("EA0C", "paper-table", 0.1, "deg", ID),
        ("EB0C", "paper-table", -0.15, "deg", ID),
    ];
    let first = export("trunnion", &found, None, &Options::default()).component.compensation;
    let mut later = outcome("trunnion", &[]);
    later.reference_mm = [5.0, -7.0, -267.684];
    let (correction, _) = Correction::collect(
        &machine,
        &catalogue(),
        &later,
        During { loaded: Some(&first), transformation: true },
        provenance(),
    )
    .unwrap();
    let old = Kins::new(&machine, Errors::from_terms(&first.terms, first.reference_mm), 202.684);
    let new = Kins::new(&machine, Errors::from_terms(&correction.terms, correction.reference_mm), 202.684);
    let mut spread = Spread::new(3);
    for _ in 0..20 {
        let world = pose(&machine, &mut spread);
        let (a, b) = (old.joints(&world).unwrap(), new.joints(&world).unwrap());
        // the values are written with twelve decimals
        assert!((0..6).all(|k| (a.0[k] - b.0[k]).abs() < 5e-12), "{a:?} {b:?}");
    }
}

#[test]
fn what_is_too_large_is_refused_unless_forced() {
    let found = [("EX0B", "paper-head", 0.6, "mm", ID), ("EA0B", "paper-head", -0.3, "deg", ID)];
    let correction = collect("swivel-head", &found, None);
    let failure = linuxcnc::export(&machine("swivel-head"), &correction, &Options::default()).unwrap_err();
    let codes: Vec<_> = failure.0.iter().map(|f| f.code).collect();
    assert_eq!(codes, ["tables::too_large", "tables::too_large"], "both at once");
    assert!(failure.to_string().contains("EX0B (paper-head) is 0.600000 mm, above the limit of 0.5 mm"));
    let forced = Options { force: true, ..Options::default() };
    let (_, findings) = linuxcnc::export(&machine("swivel-head"), &correction, &forced).unwrap();
    assert_eq!(findings.0.iter().filter(|f| f.code == "tables::too_large").count(), 2);

    // a step of 0.9 mm that ends at 0.4 mm
    let before = export("swivel-head", &[("EX0B", "paper-head", -0.5, "mm", ID)], None, &Options::default());
    let step = collect("swivel-head", &[("EX0B", "paper-head", 0.9, "mm", ID)], Some(&before.component.compensation));
    let failure = linuxcnc::export(&machine("swivel-head"), &step, &Options::default()).unwrap_err();
    assert!(failure.to_string().contains("the change of EX0B"), "{failure}");
}

#[test]
fn what_belongs_to_another_machine_is_refused() {
    let of_head = export("swivel-head", &HEAD, None, &Options::default()).component.compensation;
    let correction = collect("trunnion", &[("EX0C", "location-c", 0.01, "mm", ID)], Some(&of_head));
    let failure = linuxcnc::export(&machine("trunnion"), &correction, &Options::default()).unwrap_err();
    assert_eq!(failure.0[0].code, "compensation::other");
    let wrong = Correction::collect(
        &machine("trunnion"),
        &catalogue(),
        &outcome("swivel-head", &[]),
        During { loaded: None, transformation: true },
        provenance(),
    );
    assert_eq!(wrong.unwrap_err().0[0].code, "tables::other_machine");
    let unknown = outcome("trunnion", &[("k", "no-such-effect", 1.0, "um", ID)]);
    let wrong = Correction::collect(
        &machine("trunnion"),
        &catalogue(),
        &unknown,
        During { loaded: None, transformation: true },
        provenance(),
    );
    assert_eq!(wrong.unwrap_err().0[0].code, "tables::unknown_effect");
    let nan = outcome("trunnion", &[("EX0C", "location-c", f64::NAN, "mm", ID)]);
    let wrong = Correction::collect(
        &machine("trunnion"),
        &catalogue(),
        &nan,
        During { loaded: None, transformation: true },
        provenance(),
    );
    assert_eq!(wrong.unwrap_err().0[0].code, "tables::not_a_number");
}

/// An INI file of the machine as it is before anything is loaded.
fn plain_ini(letters: &str) -> UserIni {
    let joints: String = letters
        .chars()
        .enumerate()
        .map(|(n, letter)| {
            format!("[JOINT_{n}]\nTYPE = {}\n", if "ABC".contains(letter) { "ANGULAR" } else { "LINEAR" })
        })
        .collect();
    let count = letters.len();
    let text = format!(
        "[KINS]\nKINEMATICS = trivkins coordinates={letters}\nJOINTS = {count}\n[TRAJ]\nCOORDINATES = {letters}\nLINEAR_UNITS = mm\n{joints}"
    );
    UserIni::read(&source("plain.ini", text)).unwrap()
}

/// 30 µrad = 0.00171887° at 300 mm leave 9 µm.
#[test]
fn the_error_that_is_left_is_stated_at_the_radius() {
    let found = [("EX0C", "location-c", 0.02, "mm", ID), ("EA0C", "location-c", 30e-6_f64.to_degrees(), "deg", ID)];
    let options = Options { radius_mm: 300.0, ini: Some(plain_ini("XYZAC")), ..Options::default() };
    let export = export("trunnion", &found, None, &options);
    assert!(export.component.left.is_empty());
    let left = &export.stock.left;
    assert_eq!(left.len(), 1);
    assert_eq!(left[0].parameter, "EA0C");
    assert!((left[0].left_um.unwrap() - 9.0).abs() < 1e-6);
    assert_eq!(export.stock.compensation.mode, Mode::Stock);
    let files = files(&export);
    assert!(files["README.txt"].contains("leaves 9.00 um at 300 mm"));
    let hal = lines(files["stock/axiscal.hal"]);
    assert!(hal.contains(&"setp xyzac-trt-kins.x-rot-point 0.02"), "{hal:?}");
    assert!(lines(files["stock/restore.hal"]).contains(&"setp xyzac-trt-kins.x-rot-point 0"));
    assert!(lines(files["stock/axiscal.ini"]).contains(&"KINEMATICS = xyzac-trt-kins coordinates=XYZAC"));
}

/// The same at another height. By hand: C is tilted by 1 mrad about X, stated at z = 0; at the block, 202.684 mm below, its
/// axis stands at y + 1e-3 · 202.684 (Rx(a) moves a point at -h by +h sin a in y).
#[test]
fn stock_offsets_are_taken_at_the_workpiece() {
    let found = [("EY0C", "location-c", 0.02, "mm", ID), ("EA0C", "location-c", 1e-3_f64.to_degrees(), "deg", ID)];
    let export = export("trunnion", &found, None, &Options::default());
    let stock = &export.stock.compensation;
    assert_eq!(stock.reference_mm, [0.0, 0.0, -202.684]);
    let y = stock.terms.iter().find(|t| t.parameter == "EY0C").unwrap();
    assert!((y.value - (0.02 + 202.684 * 1e-3_f64.sin())).abs() < 1e-9);
    assert_eq!((y.active_before, y.identified, y.sigma), (0.0, y.value, None));
    assert_eq!(stock.stock.as_ref().unwrap().pins["y-rot-point"], y.value);
    // the other components of the same tilt are of second order
    assert!(stock.terms.iter().filter(|t| t.parameter != "EY0C").all(|t| t.value.abs() < 2e-4));
}

#[test]
fn a_head_s_tilt_is_left_at_the_tool_s_length() {
    let options = Options { ini: Some(plain_ini("XYZBC")), ..Options::default() };
    let export = export("swivel-head", &HEAD, None, &options);
    let left = |name: &str| export.stock.left.iter().find(|l| l.parameter == name);
    // by hand: 0.015° · π/180 · 202.684 mm
    assert!((left("EA0B").unwrap().left_um.unwrap() - 53.062_5).abs() < 1e-3);
    assert!((left("EX0B").unwrap().left_um.unwrap() - 30.0).abs() < 1e-9);
    assert!(left("EB0B").is_none(), "a turn of B about itself is one of its zero");
    let files = files(&export);
    assert_eq!(lines(files["stock/axiscal.ini"]), ["[JOINT_3]", "HOME_OFFSET = -0.01"]);
    assert_eq!(lines(files["stock/restore.ini"]), ["[JOINT_3]", "HOME_OFFSET = 0"]);
    assert!(!files.contains_key("stock/axiscal.hal"));
}

const INI: &str = "[KINS]\nKINEMATICS = trivkins coordinates=XYYZAC\nJOINTS = 6\n[TRAJ]\nCOORDINATES = X Y Z A C\n\
                   LINEAR_UNITS = inch\n[JOINT_4]\nHOME_OFFSET = 1.5\n";

#[test]
fn the_old_values_come_from_the_ini() {
    let ini = UserIni::read(&source("m.ini", INI)).unwrap();
    let options = Options { ini: Some(ini), ..Options::default() };
    let found = [
        ("EX0C", "location-c", 0.0254, "mm", ID),
        ("EC0C", "zero-c", 0.05, "deg", ID),
        ("EA0A", "zero-a", -0.02, "deg", ID),
    ];
    let export = export("trunnion", &found, None, &options);
    let files = files(&export);
    assert_eq!(
        lines(files["stock/axiscal.ini"]),
        [
            "[KINS]",
            "KINEMATICS = xyzac-trt-kins coordinates=XYYZAC",
            "JOINTS = 6",
            "[JOINT_4]",
            "HOME_OFFSET = 1.48",
            "[JOINT_5]",
            "HOME_OFFSET = 0.05"
        ]
    );
    let restore = lines(files["stock/restore.ini"]);
    assert!(restore.contains(&"KINEMATICS = trivkins coordinates=XYYZAC"));
    assert!(restore.contains(&"HOME_OFFSET = 1.5"));
    // machine units are inches
    assert!(lines(files["stock/axiscal.hal"]).contains(&"setp xyzac-trt-kins.x-rot-point 0.001"));
    let hal = lines(files["axiscal.hal"]);
    assert!(hal.contains(&"setp axiscal_trunnion_kins.mm-per-unit 25.4"));
    assert!(hal.contains(&"setp axiscal_trunnion_kins.c-before-x 0.0254"));
    assert!(hal.contains(&"setp axiscal_trunnion_kins.c-zero 0.05"));
    // the component takes the zero error off the angle itself: homing stays
    assert!(!files["axiscal.ini"].contains("HOME_OFFSET"));
}

/// From stock to the component: the home offset that stock put in goes out again, for the component's pins hold it.
#[test]
fn a_home_offset_is_taken_back_when_the_way_changes() {
    let zero = [("EC0C", "zero-c", 0.05, "deg", ID)];
    let stock = export("trunnion", &zero, None, &Options::default()).stock.compensation;
    let again = [("EC0C", "zero-c", 0.01, "deg", ID)];
    // without the INI file the present value is not known: it changes by so much
    let next = export("trunnion", &again, Some(&stock), &Options::default());
    let change = |file: &str| next.changes.iter().find(|c| c.file == file && c.name == "[JOINT_4] HOME_OFFSET");
    assert!((change("axiscal_changes.txt").unwrap().change + 0.05).abs() < 1e-9, "{:?}", next.changes);
    assert!((change("stock/axiscal_changes.txt").unwrap().change - 0.01).abs() < 1e-9, "{:?}", next.changes);
    let mut ini = plain_ini("XYZAC");
    ini.home_offset.insert(4, 0.05);
    let next = export("trunnion", &again, Some(&stock), &Options { ini: Some(ini), ..Options::default() });
    let files = files(&next);
    assert!(lines(files["axiscal.hal"]).contains(&"setp axiscal_trunnion_kins.c-zero 0.06"));
    assert!(lines(files["axiscal.ini"]).contains(&"HOME_OFFSET = 0"));
    assert!(lines(files["restore.ini"]).contains(&"HOME_OFFSET = 0.05"));
    assert!(lines(files["stock/axiscal.ini"]).contains(&"HOME_OFFSET = 0.06"));
}

const MY_EFFECTS: &str = r#"
[[effect]]
id = "my-scale"
at = "X"
terms = [ { parameter = "k", unit = "um/m", dof = "dx", formula = "X" } ]
[[effect]]
id = "my-encoder"
at = "C"
terms = [ { parameter = "ec", unit = "urad", dof = "rz", formula = "sin(C)" } ]
[[effect]]
id = "my-lost-motion"
at = "reading"
terms = [ { parameter = "b", unit = "um", dof = "Y", formula = "-sY" } ]
[[effect]]
id = "my-sag"
at = "tool"
terms = [ { parameter = "s", unit = "um", dof = "dx", formula = "sin(B)" } ]
"#;

/// By hand. Table X of swivel-head displaced by +100 µm/m of X is a coordinate that is too small: at X = 450 it is told
/// 0.045 mm more. C stands 100 µrad = 0.00573° too far at C = 90 and is told that much less. Y stands 2 µm less far than
/// it shows when it moves up: it is told 0.002 more, and 0.002 less when it moves down.
#[test]
fn errors_of_an_axis_s_own_position_become_its_table() {
    let machine = machine("swivel-head");
    let mut catalogue = catalogue();
    catalogue.add_file(&source("my-effects.toml", MY_EFFECTS)).unwrap();
    let fit = outcome(
        "swivel-head",
        &[
            ("k", "my-scale", 100.0, "um/m", ID),
            ("ec", "my-encoder", 100.0, "urad", ID),
            ("b", "my-lost-motion", 2.0, "um", ID),
            ("s", "my-sag", 5.0, "um", ID),
        ],
    );
    let (correction, _) =
        Correction::collect(&machine, &catalogue, &fit, During { loaded: None, transformation: true }, provenance())
            .unwrap();
    let options = Options { ini: Some(plain_ini("XYZBC")), ..Options::default() };
    let (export, _) = linuxcnc::export(&machine, &correction, &options).unwrap();
    let tables = &export.stock.compensation.stock.as_ref().unwrap().axis_tables;
    let (x, y, c) = (&tables[&AxisName::X], &tables[&AxisName::Y], &tables[&AxisName::C]);
    assert_eq!((x.rows.first().unwrap()[1], x.rows.last().unwrap()[1]), (-0.045, 0.045));
    assert!((c.at(90.0, true) + 100e-6_f64.to_degrees()).abs() < 2e-5);
    assert_eq!(y.rows[0], [-300.0, 0.002, -0.002]);
    let files = files(&export);
    assert_eq!(files["stock/axiscal_comp_y.txt"], "-300 0.002 -0.002\n0 0.002 -0.002\n300 0.002 -0.002\n");
    assert_eq!(files["axiscal_comp_y.txt"], files["stock/axiscal_comp_y.txt"]);
    for line in files["stock/axiscal_comp_c.txt"].lines() {
        assert_eq!(line.split(' ').filter(|w| w.parse::<f64>().is_ok()).count(), 3, "{line}");
    }
    let ini = lines(files["stock/axiscal.ini"]);
    assert!(ini.contains(&"COMP_FILE = axiscal_comp_x.txt") && ini.contains(&"COMP_FILE_TYPE = 1"));
    // the sag has no table; at any radius it leaves its own size
    assert_eq!(export.component.left.len(), 1);
    assert_eq!(export.component.left[0].left_um, Some(5.0));
    // measured again under these tables: the new ones add up
    let active = export.component.compensation;
    let again = outcome("swivel-head", &[("k", "my-scale", -20.0, "um/m", ID)]);
    let (correction, _) = Correction::collect(
        &machine,
        &catalogue,
        &again,
        During { loaded: Some(&active), transformation: true },
        provenance(),
    )
    .unwrap();
    let (export, _) = linuxcnc::export(&machine, &correction, &Options::default()).unwrap();
    let tables = &export.component.compensation.stock.as_ref().unwrap().axis_tables;
    assert_eq!(tables[&AxisName::X].rows.last().unwrap()[1], 0.036);
    assert_eq!(tables[&AxisName::Y].rows[0], [-300.0, 0.002, -0.002]);
}

#[test]
fn a_table_of_the_user_s_own_is_not_silently_replaced() {
    let machine = machine("swivel-head");
    let mut catalogue = catalogue();
    catalogue.add_file(&source("my-effects.toml", MY_EFFECTS)).unwrap();
    let fit = outcome("swivel-head", &[("k", "my-scale", 100.0, "um/m", ID)]);
    let (correction, _) =
        Correction::collect(&machine, &catalogue, &fit, During { loaded: None, transformation: true }, provenance())
            .unwrap();
    let text = "[TRAJ]\nCOORDINATES = XYZBC\n[JOINT_0]\nCOMP_FILE = mine.comp\nCOMP_FILE_TYPE = 0\n";
    let ini = UserIni::read(&source("m.ini", text)).unwrap();
    let options = Options { ini: Some(ini), ..Options::default() };
    let failure = linuxcnc::export(&machine, &correction, &options).unwrap_err();
    assert_eq!(failure.0.last().unwrap().code, "tables::replaces");
    let forced = Options { force: true, ..options };
    let (export, _) = linuxcnc::export(&machine, &correction, &forced).unwrap();
    let restore = lines(files(&export)["restore.ini"]).join("|");
    assert!(restore.contains("COMP_FILE = mine.comp|COMP_FILE_TYPE = 0"), "{restore}");
}

/// The nine numbers give the offset of any pose, and that offset puts the ball over the point.
#[test]
fn the_work_offset_puts_its_point_right_at_every_pose() {
    for name in super::support::MACHINES {
        let machine = machine(name);
        let mut spread = Spread::new(11);
        let terms = super::support::all_terms(&machine, &mut spread);
        let reference = [0.0, 0.0, -250.0];
        // a zero error turns the second axis's lever at an angle that is off: home offsets hold it
        let terms: Vec<_> = terms.into_iter().filter(|t| t.place != axiscal::tables::place::Place::Zero).collect();
        let offset = work_offset::offset(&machine, &terms, reference).unwrap();
        for _ in 0..50 {
            let at = pose(&machine, &mut spread);
            let angles = offset.axes.map(|a| at.get(a.name));
            // where the errorless machine holds the ball over the point, by the crate; then told the offset more, by hand
            let carrier = machine.side(axiscal::machine::Side::Workpiece).last();
            let carrier = axiscal::machine::Carrier::Axis(carrier.unwrap().name);
            let world = machine.linear_for_ball(carrier, &at, &offset.point_mm, 202.684).unwrap();
            let told = world.with_xyz_mm(world.xyz_mm() + offset.at(angles));
            let tip = super::by_hand::tip(&machine, &told, &terms, reference, 202.684);
            for k in 0..3 {
                assert!((tip[k] - offset.point_mm[k]).abs() < 1e-8, "{name}: {tip:?}");
            }
        }
    }
}

/// Texts of a user that would end a comment, begin a line or a string do not leave their comment.
#[test]
fn names_stay_inside_their_comments() {
    let mut machine = machine("swivel-head");
    machine.name = "bad */ int main(void) {} /* \"\\\n#include <x>\n(".into();
    let nasty = "*/ x (y)\nsetp evil.pin 1\r\nG0 X0".to_owned();
    let provenance =
        Provenance { study: nasty.clone(), study_sha256: nasty.clone(), data_date: nasty, forced: Vec::new() };
    let fit = outcome(&machine.name, &HEAD);
    let (correction, _) =
        Correction::collect(&machine, &catalogue(), &fit, During { loaded: None, transformation: true }, provenance)
            .unwrap();
    let (export, _) = linuxcnc::export(&machine, &correction, &Options::default()).unwrap();
    let files = files(&export);
    let hal = files["axiscal.hal"];
    assert!(hal.lines().all(|l| l.is_empty() || l.starts_with('#') || l.starts_with("setp axiscal_")), "{hal}");
    let ngc = files["stock/axiscal_work_offset.ngc"];
    for line in ngc.lines().filter(|l| l.starts_with('(')) {
        assert!(line.ends_with(')') && line.matches(['(', ')']).count() == 2, "{line}");
    }
    let (c, _) = files.iter().find(|(name, _)| name.ends_with(".c")).unwrap();
    if have("gcc", "--version", "the C component of a machine with an odd name") {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(c), files[c]).unwrap();
        let mut gcc = std::process::Command::new("gcc");
        gcc.args(["-std=gnu11", "-Wall", "-Werror", "-c", "-o", "/dev/null", "-I"]);
        run(gcc.arg(super::support::here("linuxcnc_kins/stub")).arg(folder.path().join(c)));
    }
}

/// Every file names program, study, hash and date; the same input gives the same bytes.
#[test]
fn every_file_has_its_head_and_is_reproducible() {
    let found: Vec<_> = HEAD.into_iter().chain([("dL", "tool-length", 0.05, "mm", ID)]).collect();
    let (one, two) = (
        export("swivel-head", &found, None, &Options::default()),
        export("swivel-head", &found, None, &Options::default()),
    );
    assert_eq!(one.files, two.files);
    for (name, text) in files(&one) {
        for word in [&linuxcnc::program(), "study.toml", "0123abcd", "2026-11-20"] {
            assert!(text.contains(word), "{name} lacks {word:?}");
        }
        assert!(text.ends_with('\n') && !text.contains("\n\n\n\n"), "{name}");
    }
    let files = files(&one);
    assert!(files["README.txt"].contains("The probe is 0.050000 mm longer"));
    assert!(files["tool_table.ngc"].contains("G10 L1 P[#5400] Z[#5403 + [0.050000]]"));
    assert!(files["restore_tool_table.ngc"].contains("Z[#5403 + [-0.050000]]"));
}

/// LinuxCNC's own interpreter reads the NC files; the work offset that it sets is the one computed here.
#[test]
fn the_interpreter_takes_the_nc_files() {
    if !have("rs274", "-?", "the NC files under LinuxCNC's interpreter") {
        return;
    }
    let found: Vec<_> = HEAD.into_iter().chain([("dL", "tool-length", 0.05, "mm", ID)]).collect();
    let export = export("swivel-head", &found, None, &Options::default());
    let files = files(&export);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("axiscal_work_offset.ngc", files["stock/axiscal_work_offset.ngc"]);
    write("tool.tbl", "T1 P1 Z25.0 D6.0 ;probe\n");
    write("m.var", "");
    write("m.ini", "[RS274NGC]\nSUBROUTINE_PATH = .\n");
    let interpret = |name: &str| {
        let mut rs274 = std::process::Command::new("rs274");
        rs274.args(["-g", "-v", "m.var", "-t", "tool.tbl", "-i", "m.ini", name]).current_dir(folder.path());
        run(rs274.stdin(std::process::Stdio::null()))
    };
    for (b, c) in [(0.0, 0.0), (-90.0, 40.0), (-30.0, 200.0)] {
        write("use.ngc", &format!("G21 G49 G54 G0 B{b} C{c}\no<axiscal_work_offset> call [1] [10] [20] [30]\nM2\n"));
        let canon = interpret("use.ngc");
        let set = canon.lines().rfind(|l| l.contains("SET_G5X_OFFSET(1")).unwrap_or_else(|| panic!("{canon}"));
        let numbers: Vec<f64> = set[set.find('(').unwrap() + 1..set.rfind(')').unwrap()]
            .split(',')
            .map(|w| w.trim().parse().unwrap())
            .collect();
        let machine = machine("swivel-head");
        let terms: Vec<_> =
            export.component.compensation.terms.iter().filter(|t| t.parameter != "EB0B").cloned().collect();
        let offset = work_offset::offset(&machine, &terms, [0.0; 3]).unwrap();
        // the machine's rotary axes in the order of the chain: C, then B
        let more = offset.at(offset.axes.map(|a| if a.name == AxisName::C { c } else { b }));
        for k in 0..3 {
            // rs274 prints four decimals
            assert!((numbers[1 + k] - [10.0, 20.0, 30.0][k] - more[k]).abs() < 1e-4, "{set} {more}");
        }
    }
    for (file, length) in [("tool_table.ngc", "25.0500"), ("restore_tool_table.ngc", "24.9500")] {
        write("tool.tbl", "T1 P1 Z25.0 D6.0 ;probe\n");
        write("length.ngc", &files[file].replace("M2\n", "G43\nM2\n").replace("M70\n", "T1 M6\nG20\nM70\n"));
        let canon = interpret("length.ngc");
        // shown in the user's inches or in millimetres, as M72 left it
        let inches = format!("{:.4}", length.parse::<f64>().unwrap() / 25.4);
        let set = canon.lines().rfind(|l| l.contains("USE_TOOL_LENGTH_OFFSET")).unwrap_or_else(|| panic!("{canon}"));
        assert!(set.contains(length) || set.contains(&inches), "{set}");
    }
}
