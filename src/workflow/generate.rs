//! A probing program for a control: every move proven before anything is written.

use super::Environment;
use super::new::default_effects;
use crate::check::{self, Against};
use crate::diag::{Failure, Finding, Findings, Result, Severity, source};
use crate::fit;
use crate::log::{Status, Touch};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::{Run, assemble};
use crate::post::{DialectName, NcProgram, Postprocessor};
use crate::program::plan::{Plan, Proof};
use crate::program::{self, Generated, Options, ProgramSpec};
use crate::tables::linuxcnc;
use std::path::Path;

/// A program for one control.
#[derive(Debug)]
pub struct ForControl {
    /// Plan and path, which are the same for every control.
    pub generated: Generated,
    pub nc: NcProgram,
    /// What the program does when it is read back; `None` where the control's dialect is not known.
    pub proof: Option<Proof>,
    /// Run time, with what a person needs at the stops, s.
    pub seconds: f64,
}

/// Generates a program and proves it.
///
/// # Errors
/// When nothing can be reached, the machine cannot run under the control's transformation, or the program cannot be proven.
pub fn generate(
    machine: &Machine,
    spec: &ProgramSpec,
    post: &Postprocessor,
    options: &Options,
    env: &dyn Environment,
) -> Result<ForControl> {
    if options.tcp
        && post.check.as_ref().is_some_and(|rule| rule.dialect == DialectName::Ngc)
        && !post.releases.is_empty()
        && let Err(why) = linuxcnc::stock::module_of(machine, post.release(None)?)
    {
        return Err(Failure::new("generate::no_transformation", format!("{} cannot run under a transformation of LinuxCNC's own: {why}", machine.name))
            .help("generate without --tcp: under the kinematics component that `export` writes, coordinates stay axis positions. Is it another version of LinuxCNC, name it under [settings] of a postprocessor file of your own"));
    }
    for_control(machine, spec, program::generate(machine, spec, options)?, post, env)
}

/// Writes a generated program for one control, and proves it.
///
/// # Errors
/// When the program cannot be written for this control, or not be proven.
pub fn for_control(
    machine: &Machine,
    spec: &ProgramSpec,
    (mut generated, findings): (Generated, Findings),
    post: &Postprocessor,
    env: &dyn Environment,
) -> Result<ForControl> {
    if !generated.plan.skipped.is_empty() {
        let lost = lost_parameters(machine, spec, &generated.plan)?;
        if !lost.is_empty() {
            let note = format!("without the omitted touches these cannot be determined: {}", lost.join(", "));
            generated.path.head.push(format!("  {note}"));
            generated.plan.notes.push(note);
        }
    }
    env.remark(&findings.0);
    let written = |post: &Postprocessor, dry_run_first: bool| -> Result<(NcProgram, Option<(Proof, f64)>)> {
        let nc = post.program(machine, &generated.plan, &generated.path)?;
        let name = format!("{}.{}", spec.name, nc.extension);
        let beside = nc.sources();
        let against = Against { plan: Some(&generated.plan), beside: &beside, dry_run_first, ..Against::default() };
        let proven = prove_against(machine, post, &against, &name, &nc, env)?;
        Ok((nc, proven))
    };
    let may_lack_it = post.dry_run_mm == 0.0;
    let (nc, proven) = match written(post, may_lack_it) {
        // moves that are clear where they are need not be clear when they are lifted
        Err(_) if may_lack_it => {
            let mut plain = post.clone();
            plain.without_dry_run = true;
            // not the dry run alone is wrong: all findings are those of the whole program
            let without = match written(&plain, false) {
                Ok(without) => without,
                Err(of_plain) => return Err(written(post, false).err().unwrap_or(of_plain)),
            };
            let says = "the program has no dry run: its moves are not clear of everything when they are lifted";
            env.remark(&[
                Finding::warning("generate::no_dry_run", says).help("run it at a low feed override the first time")
            ]);
            without
        }
        other => other?,
    };
    env.remark(&nc.findings.0);
    // the figure of `check`, move by move as this control makes them
    let seconds = proven.as_ref().map_or(generated.path.seconds, |(_, s)| s + generated.path.waiting);
    Ok(ForControl { generated, nc, proof: proven.map(|(proof, _)| proof), seconds })
}

/// Reads the program back and proves it: what cannot be proven is not written. What it does, and its run time without the
/// stops, s.
///
/// # Errors
/// When the program holds anything that `check` refuses.
pub fn prove(
    machine: &Machine,
    post: &Postprocessor,
    plan: &Plan,
    name: &str,
    nc: &NcProgram,
    env: &dyn Environment,
) -> Result<Option<(Proof, f64)>> {
    let beside = nc.sources();
    let against = Against { plan: Some(plan), beside: &beside, ..Against::default() };
    prove_against(machine, post, &against, name, nc, env)
}

fn prove_against(
    machine: &Machine,
    post: &Postprocessor,
    against: &Against<'_>,
    name: &str,
    nc: &NcProgram,
    env: &dyn Environment,
) -> Result<Option<(Proof, f64)>> {
    if post.check.is_none() {
        let what = format!(
            "controller {} does not say how its programs are read back: the program was not checked",
            post.name
        );
        env.remark(&[Finding::warning("check::no_dialect", what)
            .help("write [check] in the postprocessor file: docs/guide/check.md")]);
        return Ok(None);
    }
    let text = source(format!("{name} (not written)"), nc.text.as_str());
    let checked = check::check(machine, post, &text, against)?;
    if checked.findings.iter().any(|f| f.severity == Severity::Error) {
        let mut findings = checked.findings;
        findings.push(
            Finding::error("check::refused", format!("{name} cannot be proven safe: no file was written"))
                .help("the findings above say where: look there in the templates of a postprocessor file of your own; with a built-in controller it is a fault of axiscal: report it with machines.toml, program and controller"),
        );
        return Err(Failure(findings));
    }
    Ok(Some((checked.proof, checked.seconds)))
}

/// Location errors that the whole program could tell, with blocks of unknown set-up, and the touches that are left cannot.
fn lost_parameters(machine: &Machine, spec: &ProgramSpec, plan: &Plan) -> Result<Vec<String>> {
    let catalogue = Catalogue::built_in()?;
    let effects = default_effects(machine, &[plan], false);
    let unseen = |plan: &Plan| -> Result<Vec<String>> {
        let touches: Vec<Touch> = plan
            .touches
            .iter()
            .map(|t| Touch {
                id: t.id,
                position: t.nominal_position(),
                status: Status::Hit,
                time_s: None,
                digit_mm: None,
                temperature_deg_c: None,
                line: 0,
            })
            .collect();
        let data = assemble(machine, &[Run { plan, touches: &touches, mounting: None, started_s: None }]);
        let (model, seen) = fit::observe_plan(machine, &catalogue, &data, &effects)?;
        let blind = |i: usize| seen.unseen.iter().any(|v| v[i].abs() > 1e-6);
        Ok((0..model.n_unknowns()).filter(|i| blind(*i)).map(|i| model.unknowns[i].name.clone()).collect())
    };
    let before = unseen(&program::plan_without_path(machine, spec)?)?;
    let after = unseen(plan)?;
    Ok(after.into_iter().filter(|name| !before.contains(name) && !name.contains('@')).collect())
}

/// A program by name, or from a file of the user's own when the word ends in `.toml` or holds a `/`.
///
/// # Errors
/// When there is none of that name for this machine, or the file is unusable.
pub fn load_program(word: &str, machine: &Machine, env: &dyn Environment) -> Result<ProgramSpec> {
    if !is_file(word) {
        return program::choose(program::built_in()?, word, machine);
    }
    let (spec, findings) = program::load(&env.source(Path::new(word))?)?;
    env.remark(&findings.0);
    Ok(spec)
}

/// Whether a word means a file rather than a name.
#[must_use]
pub fn is_file(word: &str) -> bool {
    word.ends_with(".toml") || word.contains(['/', '\\'])
}
