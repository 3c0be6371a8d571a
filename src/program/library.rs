//! The programs that are built in, and which of them is meant for a machine.

use super::parts::Part;
use super::spec::{ProgramSpec, load};
use crate::diag::{Failure, Result, source};
use crate::machine::Machine;

/// The programs that are built in: file name and text.
const BUILT_IN: [(&str, &str); 13] = [
    ("programs/head.toml", include_str!("../../programs/head.toml")),
    ("programs/table.toml", include_str!("../../programs/table.toml")),
    ("programs/double-head.toml", include_str!("../../programs/double-head.toml")),
    ("programs/basic-trunnion.toml", include_str!("../../programs/basic-trunnion.toml")),
    ("programs/basic-swivel-table-b.toml", include_str!("../../programs/basic-swivel-table-b.toml")),
    ("programs/basic-nutating-b.toml", include_str!("../../programs/basic-nutating-b.toml")),
    ("programs/basic-trunnion-offset.toml", include_str!("../../programs/basic-trunnion-offset.toml")),
    ("programs/full-swivel-head.toml", include_str!("../../programs/full-swivel-head.toml")),
    ("programs/full-double-head.toml", include_str!("../../programs/full-double-head.toml")),
    ("programs/full-trunnion.toml", include_str!("../../programs/full-trunnion.toml")),
    ("programs/full-swivel-table-b.toml", include_str!("../../programs/full-swivel-table-b.toml")),
    ("programs/full-nutating-b.toml", include_str!("../../programs/full-nutating-b.toml")),
    ("programs/full-trunnion-offset.toml", include_str!("../../programs/full-trunnion-offset.toml")),
];

/// The programs that are built in.
///
/// # Errors
/// Never for a released program: the files are tested.
pub fn built_in() -> Result<Vec<ProgramSpec>> {
    BUILT_IN
        .iter()
        .map(|(name, text)| load(&source(format!("{name} (built in)"), *text)).map(|(spec, _)| spec))
        .collect()
}

/// The built-in programs that were written for a machine and touch nothing but one of its mountings: what they are, and their text.
///
/// # Errors
/// Never for a released program: the files are tested.
pub fn written_for(machine: &Machine, mounting: &str) -> Result<Vec<(ProgramSpec, &'static str)>> {
    let texts = BUILT_IN.iter().map(|(_, text)| *text);
    let touches_it = |s: &ProgramSpec| {
        s.machine.as_ref().is_some_and(|m| m.value == machine.name)
            && s.parts.iter().all(|part| part.mounting.value == mounting)
    };
    Ok(built_in()?.into_iter().zip(texts).filter(|(spec, _)| touches_it(spec)).collect())
}

/// Chooses the program of a name for a machine: the one that was written for it, else the only one that names no axis
/// which the machine lacks and whose mounting and blocks it has.
///
/// # Errors
/// When there is none, or several fit; the message lists what there is.
pub fn choose(specs: Vec<ProgramSpec>, name: &str, machine: &Machine) -> Result<ProgramSpec> {
    let mut names: Vec<String> = specs.iter().map(|s| s.name.clone()).collect();
    names.dedup();
    if !specs.iter().any(|s| s.name == name) {
        return Err(Failure::new("program::unknown", format!("no program is called {name:?}")).help(format!(
            "there are: {}; a program of your own is a file: `axiscal generate --program FILE.toml` makes its plan",
            names.join(", ")
        )));
    }
    let for_it: Vec<String> = specs_for(machine, &specs);
    let named: Vec<ProgramSpec> = specs.into_iter().filter(|s| s.name == name).collect();
    let written_for: Vec<String> = named.iter().filter_map(|s| s.machine.as_ref().map(|m| m.value.clone())).collect();
    let written_for_it = |s: &ProgramSpec| s.machine.as_ref().is_none_or(|m| m.value == machine.name);
    let fits = |s: &ProgramSpec| {
        let parts: Option<Vec<Part>> = s.parts.iter().map(|p| Part::on(machine, s, p).ok()).collect();
        parts.is_some_and(|parts| {
            let has_block = |part: usize, name: &String| {
                parts.get(part).is_some_and(|p| p.mounting.blocks.iter().any(|b| &b.name == name))
            };
            s.setups.iter().all(|x| {
                x.pose.value.iter().all(|(a, _)| machine.axis(a).is_some())
                    && x.blocks.iter().flatten().all(|b| has_block(x.part, &b.value))
            })
        })
    };
    if let Some(spec) = named.iter().find(|s| written_for_it(s)) {
        return Ok(spec.clone());
    }
    let mut fitting = named.into_iter().filter(fits);
    match (fitting.next(), fitting.next()) {
        (Some(only), None) => Ok(only),
        _ => Err(Failure::new(
            "program::other_machine",
            format!(
                "program {name:?} is written for {}, not for {}{}",
                written_for.join(", "),
                machine.name,
                if for_it.is_empty() {
                    String::new()
                } else {
                    format!("; for {} there are: {}", machine.name, for_it.join(", "))
                }
            ),
        )
        .help(
            "`axiscal programs` lists which program is for which machine; copy the nearest one and adapt it to yours",
        )),
    }
}

/// Names of the programs that were written for a machine.
fn specs_for(machine: &Machine, specs: &[ProgramSpec]) -> Vec<String> {
    let written_for_it = |s: &&ProgramSpec| s.machine.as_ref().is_some_and(|m| m.value == machine.name);
    specs.iter().filter(written_for_it).map(|s| s.name.clone()).collect()
}
