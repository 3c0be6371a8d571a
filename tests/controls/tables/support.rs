//! Machines, terms and numbers that look random and are the same every time.

use axiscal::axes::{AxisName, Position};
use axiscal::diag::source;
use axiscal::machine::{self, Machine};
use axiscal::model::catalogue::Catalogue;
use axiscal::tables::compensation::Term;
use axiscal::tables::place::{Dof, Place};
use std::path::PathBuf;
use std::process::Command;

pub const MACHINES: [&str; 6] =
    ["swivel-head", "double-head", "trunnion", "swivel-table-b", "nutating-b", "trunnion-offset"];

pub fn machine(name: &str) -> Machine {
    let (machines, _) = machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

pub fn catalogue() -> Catalogue {
    Catalogue::built_in().unwrap()
}

/// A linear congruential generator (Knuth's MMIX constants): enough to spread poses.
pub struct Spread(u64);

impl Spread {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }
    /// Within ±size.
    pub fn next(&mut self, size: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0) * size
    }
}

pub fn term(axis: AxisName, place: Place, dof: Dof, value: f64) -> Term {
    Term {
        axis,
        place,
        dof,
        value,
        unit: dof.unit().to_owned(),
        parameter: format!("E{}0{axis}", dof.iso_letter()),
        effect: "test".to_owned(),
        active_before: 0.0,
        identified: value,
        sigma: None,
    }
}

/// Every location error that a machine can have, up to 0.3 mm and 0.15°.
pub fn all_terms(machine: &Machine, spread: &mut Spread) -> Vec<Term> {
    let mut terms = Vec::new();
    for axis in machine.rotary() {
        for place in [Place::Before, Place::After] {
            for dof in Dof::ALL {
                terms.push(term(axis.name, place, dof, spread.next(if dof.is_angle() { 0.15 } else { 0.3 })));
            }
        }
        let own = Dof::ALL[axis.name.index()];
        terms.push(term(axis.name, Place::Zero, own, spread.next(0.15)));
    }
    terms
}

pub fn pose(machine: &Machine, spread: &mut Spread) -> Position {
    let mut at = Position::default();
    for axis in &machine.axes {
        let [low, high] = axis.range;
        at.set(axis.name, (low + high) / 2.0 + spread.next((high - low) / 2.0));
    }
    at
}

pub fn here(path: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests").join(path)
}

/// Is this program there? When it is not, the test says that it left something out.
pub fn have(program: &str, argument: &str, what: &str) -> bool {
    let there = Command::new(program).arg(argument).output().is_ok();
    if !there {
        println!("LEFT OUT: {what}: {program} is not installed");
    }
    there
}

pub fn run(command: &mut Command) -> String {
    let done = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(
        done.status.success(),
        "{command:?}: {}\n{}{}",
        done.status,
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr)
    );
    String::from_utf8(done.stdout).unwrap()
}

/// Compiles the harness that plays HAL for a kinematics module.
pub fn harness(folder: &std::path::Path) -> PathBuf {
    let out = folder.join("harness");
    let mut gcc = Command::new("gcc");
    gcc.args(["-O1", "-Wall", "-rdynamic", "-o"]).arg(&out).arg(here("linuxcnc_kins/harness.c")).arg("-ldl");
    run(&mut gcc);
    out
}

/// Answers of a module to lines for the harness: the numbers of each answer.
pub fn ask(harness: &std::path::Path, module: &std::path::Path, coordinates: &str, lines: &[String]) -> Vec<Vec<f64>> {
    use std::io::Write;
    let mut child = Command::new(harness)
        .arg(module)
        .arg(coordinates)
        .stdin(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let text = lines.join("\n") + "\n";
    let writer = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let done = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    let answer = String::from_utf8(done.stdout).unwrap();
    assert!(done.status.success(), "{}: {}\n{answer}", module.display(), done.status);
    let mut answers = answer.lines();
    assert_eq!(answers.next(), Some("type 4"), "KINEMATICS_BOTH");
    answers.map(|l| l.split(' ').map(|w| w.parse().unwrap()).collect()).collect()
}
