//! What the integration tests share: machines, plans, and touches from the virtual machine.
#![allow(dead_code)] // each test file uses a part of it
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

pub mod more_machines;
pub mod random;
pub mod verbs;

use axiscal::diag::source;
use axiscal::fit::{self, Fit, Settings};
use axiscal::log::{RawTouch, Touch};
use axiscal::machine::{self, Machine, artefact};
use axiscal::model::catalogue::Catalogue;
use axiscal::model::data::Run;
use axiscal::program::{self, plan::Plan};
use axiscal::simulate::{self, Compensation, Scenario};
use axiscal::workflow::auto_program::{AutoProgram, auto_program};

/// How many cases a statistical test makes: the small number, or the large one where AXISCAL_FULL_COUNTS is set.
pub fn count(small: u64, large: u64) -> u64 {
    if std::env::var_os("AXISCAL_FULL_COUNTS").is_some() { large } else { small }
}

pub fn machines() -> Vec<Machine> {
    machine::load(&source("machines.toml", machine::BUILT_IN)).unwrap().0
}

pub fn machine(name: &str) -> Machine {
    machines().into_iter().find(|m| m.name == name).unwrap()
}

/// The plan of a built-in program, with its path proven.
pub fn plan(machine: &Machine, name: &str) -> Plan {
    let spec = program::choose(program::built_in().unwrap(), name, machine).unwrap();
    program::generate(machine, &spec, &program::Options::default()).unwrap().0.plan
}

/// A built-in machine with a built-in artefact mounted, and the program that is chosen for it.
pub fn with_artefact(machine: &str, artefact: &str, minutes: f64) -> (Machine, AutoProgram) {
    let (_, text) = artefact::BUILT_IN.iter().find(|(name, _)| *name == artefact).unwrap();
    let machines = source("machines.toml", axiscal::machine::BUILT_IN);
    let (mounted, _) = artefact::mount(&machines, &self::machine(machine), &source("artefact.toml", *text)).unwrap();
    let mounting = mounted.machine.mounting(artefact).unwrap();
    let auto = auto_program(&mounted.machine, &Catalogue::built_in().unwrap(), mounting, minutes, None).unwrap();
    (mounted.machine.clone(), auto)
}

/// Every touch of a plan on the virtual machine; all must hit.
pub fn touch(machine: &Machine, plan: &Plan, scenario: &Scenario, compensation: Option<&Compensation>) -> Vec<Touch> {
    let (raw, _) = simulate::run(machine, plan, scenario, compensation).unwrap();
    assert_eq!(raw.len(), plan.touches.len());
    raw.iter().map(matched).collect()
}

pub fn matched(raw: &RawTouch) -> Touch {
    assert_eq!(raw.status, axiscal::log::Status::Hit, "touch {:?} missed", raw.id);
    Touch {
        id: raw.id.unwrap(),
        position: raw.position,
        status: raw.status,
        time_s: raw.time_s,
        digit_mm: None,
        temperature_deg_c: raw.temperature_deg_c,
        line: raw.line,
    }
}

/// A fit of these effects to runs, default settings otherwise.
pub fn identify(machine: &Machine, runs: &[(&Plan, &[Touch])], effects: &[&str]) -> Fit {
    identify_with(machine, runs, effects, Settings::default())
}

pub fn identify_with(machine: &Machine, runs: &[(&Plan, &[Touch])], effects: &[&str], settings: Settings) -> Fit {
    let runs: Vec<Run> =
        runs.iter().map(|(plan, touches)| Run { plan, touches, mounting: None, started_s: None }).collect();
    let settings = Settings { effects: effects.iter().map(|e| (*e).to_owned()).collect(), ..settings };
    fit::identify(machine, &Catalogue::built_in().unwrap(), &runs, &settings).unwrap()
}

/// Value of a parameter by name or by the paper's symbol.
pub fn value(fit: &Fit, name: &str) -> f64 {
    fit.outcome
        .parameters
        .iter()
        .find(|p| p.name == name || p.alias.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("no parameter {name}"))
        .value
}
