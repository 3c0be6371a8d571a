//! The C component: compiled, loaded, and compared with the Rust mapping.

use super::support::{MACHINES, Spread, all_terms, ask, harness, have, here, machine, pose, run};
use axiscal::axes::Position;
use axiscal::fit::outcome::Outcome;
use axiscal::machine::Machine;
use axiscal::tables::compensation::{Provenance, Term};
use axiscal::tables::correction::{Correction, During};
use axiscal::tables::kins::{Errors, Kins};
use axiscal::tables::linuxcnc::component;
use std::path::{Path, PathBuf};
use std::process::Command;

fn source(machine: &Machine) -> String {
    let outcome: Outcome = super::export::outcome(&machine.name, &[]);
    let (correction, _) = Correction::collect(
        machine,
        &super::support::catalogue(),
        &outcome,
        During { loaded: None, transformation: true },
        Provenance::default(),
    )
    .unwrap();
    component::source(machine, &correction).unwrap()
}

/// With the project's own headers and the warnings that LinuxCNC's build has on.
fn compiled(machine: &Machine, folder: &Path) -> PathBuf {
    let name = component::name(machine);
    let c = folder.join(format!("{name}.c"));
    std::fs::write(&c, source(machine)).unwrap();
    let so = folder.join(format!("{name}.so"));
    let mut gcc = Command::new("gcc");
    gcc.args(["-std=gnu11", "-Os", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-I"])
        .arg(here("linuxcnc_kins/stub"));
    run(gcc.arg("-o").arg(&so).arg(&c).arg("-lm"));
    so
}

fn set_lines(machine: &Machine, terms: &[Term], reference: [f64; 3], length: f64) -> Vec<String> {
    let name = component::name(machine);
    let mut lines: Vec<String> = component::pins(machine, terms, reference, 1.0)
        .into_iter()
        .map(|(pin, value)| format!("set {name}.{pin} {value}"))
        .collect();
    lines.push(format!("set {name}.tool-length {length}"));
    lines
}

/// A position as the harness takes it: X Y Z A B C.
fn six(word: &str, p: &Position) -> String {
    format!("{word} {}", p.0.map(|v| format!("{v:.17e}")).join(" "))
}

/// Joints come back in the order of the letters; put them into a position.
fn of_joints(machine: &Machine, joints: &[f64]) -> Position {
    let mut at = Position::default();
    let mut n = 0;
    for letter in axiscal::axes::AxisName::ALL {
        if machine.axis(letter).is_some() {
            at.set(letter, joints[n]);
            n += 1;
        }
    }
    at
}

fn compare(machine: &Machine, module: &Path, harness: &Path) {
    let coordinates = component::coordinates(machine);
    let mut worst: f64 = 0.0;
    for seed in 0..5 {
        let mut spread = Spread::new(100 + seed);
        let terms = all_terms(machine, &mut spread);
        let reference = [spread.next(50.0), spread.next(50.0), -250.0];
        let length = 150.0 + spread.next(100.0);
        let kins = Kins::new(machine, Errors::from_terms(&terms, reference), length);
        let poses: Vec<Position> = (0..50).map(|_| pose(machine, &mut spread)).collect();
        let mut lines = set_lines(machine, &terms, reference, length);
        lines.extend(poses.iter().map(|p| six("inverse", p)));
        let answers = ask(harness, module, &coordinates, &lines);
        assert_eq!(answers.len(), poses.len());
        let mut back = set_lines(machine, &terms, reference, length);
        for (world, answer) in poses.iter().zip(&answers) {
            let ours = kins.joints(world).unwrap();
            let theirs = of_joints(machine, answer);
            worst = (0..6).map(|k| (ours.0[k] - theirs.0[k]).abs()).fold(worst, f64::max);
            let text: Vec<String> = answer.iter().map(|v| format!("{v:.17e}")).collect();
            back.push(format!("forward {}", text.join(" ")));
        }
        for (world, answer) in poses.iter().zip(ask(harness, module, &coordinates, &back)) {
            worst = (0..6).map(|k| (world.0[k] - answer[k]).abs()).fold(worst, f64::max);
        }
    }
    println!("{}: C and Rust differ by at most {worst:.1e}", machine.name);
    assert!(worst < 1e-12, "{}: {worst:e}", machine.name);
}

#[test]
fn c_and_rust_are_one_mapping() {
    if !have("gcc", "--version", "the kinematics component in C") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let harness = harness(folder.path());
    for name in MACHINES {
        let machine = machine(name);
        let so = compiled(&machine, folder.path());
        compare(&machine, &so, &harness);
    }
}

/// Without errors joints are world, to the last bit; also with an origin and other units, where only exactness of the
/// difference helps.
#[test]
fn c_without_errors_is_the_identity() {
    if !have("gcc", "--version", "the kinematics component in C") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let harness = harness(folder.path());
    for name in MACHINES {
        let mut machine = machine(name);
        machine.name = format!("{name}-shifted");
        for axis in machine.axes.clone() {
            machine.origin.set(axis.name, 12.3);
        }
        let so = compiled(&machine, folder.path());
        let mut spread = Spread::new(7);
        let poses: Vec<Position> = (0..100).map(|_| pose(&machine, &mut spread)).collect();
        let mut lines = set_lines(&machine, &[], [1.0, 2.0, 3.0], 202.684);
        lines.push(format!("set {}.mm-per-unit 25.4", component::name(&machine)));
        lines.push(format!("set {}.tool-offset 1.5", component::name(&machine)));
        lines.extend(poses.iter().map(|p| six("inverse", p)));
        lines.extend(poses.iter().map(|p| {
            let joints: Vec<f64> = machine_order(&machine, p);
            format!(
                "forward {}",
                (0..6).map(|n| joints.get(n).unwrap_or(&0.0).to_string()).collect::<Vec<_>>().join(" ")
            )
        }));
        let answers = ask(&harness, &so, &component::coordinates(&machine), &lines);
        for (p, answer) in poses.iter().zip(&answers) {
            assert_eq!(of_joints(&machine, answer), *p, "{name}");
        }
        for (p, answer) in poses.iter().zip(&answers[poses.len()..]) {
            assert_eq!(answer.as_slice(), p.0.as_slice(), "{name}");
        }
    }
}

fn machine_order(machine: &Machine, p: &Position) -> Vec<f64> {
    axiscal::axes::AxisName::ALL.into_iter().filter(|a| machine.axis(*a).is_some()).map(|a| p.get(a)).collect()
}

/// Joints in another order, two motors on Y: each joint of a letter is told the same, and a missing axis is refused.
#[test]
fn coordinates_say_which_joint_moves_which_axis() {
    if !have("gcc", "--version", "the kinematics component in C") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let harness = harness(folder.path());
    let machine = machine("swivel-head");
    let so = compiled(&machine, folder.path());
    let answers = ask(&harness, &so, "ZYxYbC", &["inverse 1 2 3 0 5 6".to_owned(), "forward 3 2 1 2 5 6".to_owned()]);
    assert_eq!(answers[0], [3.0, 2.0, 1.0, 2.0, 5.0, 6.0]);
    assert_eq!(answers[1], [1.0, 2.0, 3.0, 0.0, 5.0, 6.0]);
    for bad in ["XYZB", "XYZBCQ", ""] {
        let status =
            Command::new(&harness).arg(&so).arg(bad).stdin(std::process::Stdio::null()).output().unwrap().status;
        assert_eq!(status.code(), Some(3), "{bad:?} is refused");
    }
}

/// A tool offset in inches counts 25.4 times; the linear axes and the pins of displacements stay what they are called.
#[test]
fn inches_are_converted_at_the_border() {
    if !have("gcc", "--version", "the kinematics component in C") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let harness = harness(folder.path());
    let machine = machine("swivel-head");
    let so = compiled(&machine, folder.path());
    let name = component::name(&machine);
    let set = |pin: &str, value: f64| format!("set {name}.{pin} {value}");
    let lines = [
        set("mm-per-unit", 25.4),
        set("b-before-y", 0.0254),
        set("b-before-a", 0.01),
        set("tool-length", 100.0),
        set("tool-offset", 4.0),
        "inverse 1 2 3 0 0 0".to_owned(),
    ];
    let answers = ask(&harness, &so, "XYZBC", &lines);
    // by hand: tilted by a about x the ball at (0, 0, -t) moves by t sin a in y; t = 100 + 4 * 25.4 = 201.6 mm
    let y = 2.0 - (0.0254 + 201.6 * 0.01_f64.to_radians().sin()) / 25.4;
    assert!((answers[0][1] - y).abs() < 1e-12, "{} {y}", answers[0][1]);
    assert_eq!(answers[0][0], 1.0);
}

/// As a user does it: LinuxCNC's own headers and build.
#[test]
fn halcompile_takes_it() {
    if !have("halcompile", "--help", "the component compiled by halcompile")
        || !have("gcc", "--version", "the component")
    {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let harness = harness(folder.path());
    for machine_name in MACHINES {
        let machine = machine(machine_name);
        let name = component::name(&machine);
        std::fs::write(folder.path().join(format!("{name}.c")), source(&machine)).unwrap();
        run(Command::new("halcompile").args(["--compile", &format!("{name}.c")]).current_dir(folder.path()));
        compare(&machine, &folder.path().join(format!("{name}.so")), &harness);
    }
}
