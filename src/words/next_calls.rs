//! What to do after a diagnosis, as the terminal prints it. A command is named only where its verb will do something: the same
//! findings decide here and there.

use super::command::quoted_path as quoted;
use super::diagnose as words;
use crate::diagnose::answer::Diagnosis;
use crate::diagnose::next_step::NextStep;
use crate::program;
use crate::workflow::Loaded;
use std::path::Path;

/// A call with the study's own control.
fn with_control(loaded: &Loaded, call: impl Fn(&str) -> String) -> String {
    match loaded.control() {
        Some(name) => call(&quoted(Path::new(&name))),
        // touches in a file of another origin: nobody knows the control
        None => call("NAME") + " (for NAME one of those that `axiscal controllers` lists)",
    }
}

/// The call of `plan-next`, with the study's own control.
#[must_use]
pub(crate) fn plan_next(loaded: &Loaded) -> String {
    let study = quoted(&loaded.path);
    with_control(loaded, |name| format!("axiscal plan-next {study} --out next --controller {name}"))
}

/// The call that writes the program in whose poses every known effect shows, where this machine has one.
fn richer_program(loaded: &Loaded) -> Option<String> {
    program::choose(program::built_in().ok()?, "full", &loaded.machine).ok()?;
    let machines = loaded.study.machines.as_ref().map(|m| format!(" --machines {}", quoted(&loaded.folder().join(m))));
    let machine = quoted(Path::new(&loaded.machine.name)) + &machines.unwrap_or_default();
    Some(with_control(loaded, |name| {
        format!("axiscal generate --machine {machine} --program full --controller {name} --out next")
    }))
}

/// The call of `sketch-effect`.
#[must_use]
pub(crate) fn sketch_effect(loaded: &Loaded) -> String {
    format!("axiscal sketch-effect {} --out my-effects.toml", quoted(&loaded.path))
}

/// Effects of a group that are named in a line; the table above has all of them.
const MOST_IDS: usize = 3;

/// What to do next, the first thing first, each line as it is printed.
#[must_use]
pub(crate) fn lines(found: &Diagnosis, loaded: &Loaded) -> Vec<String> {
    let study = quoted(&loaded.path);
    let add =
        |effect: &str| format!("  in either case, this removes it from the other errors: axiscal add {study} {effect}");
    let sketchable = found.verdict.unexplained().is_some_and(|u| u.sketchable);
    match found.next_step() {
        NextStep::CorrectSetupMistake => {
            vec!["next: correct that and measure again; smaller errors can be judged afterwards".to_owned()]
        }
        NextStep::Add(first) => vec![format!("next: axiscal add {study} {}", first.effect)],
        NextStep::AddOrCheck(first, other) => {
            vec![format!("next: check at the machine whether it is that, or {other}"), add(&first.effect)]
        }
        NextStep::CheckWhich(first) => {
            let how = "check at the machine which of them it is: no touches separate them";
            vec![format!("next: {how}"), add(&first.effect)]
        }
        // which of them it is, is for touches or a person to say
        NextStep::Separate(first) => {
            let ids: Vec<&str> = std::iter::once(&first.effect).chain(&first.same_as).map(String::as_str).collect();
            let more = match ids.len().saturating_sub(MOST_IDS) {
                0 => String::new(),
                n => format!(" or {n} more"),
            };
            let some = ids[..ids.len().min(MOST_IDS)].join(", ");
            vec![
                format!("next: {}", plan_next(loaded)),
                format!("  or, when you know which it is: axiscal add {study} EFFECT"),
                format!("  with one of {some}{more} in place of EFFECT"),
            ]
        }
        NextStep::MeasureMore => {
            let sketch = sketchable.then(|| format!("  or: {}", sketch_effect(loaded)));
            std::iter::once(format!("next: {}", plan_next(loaded))).chain(sketch).collect()
        }
        NextStep::Sketch => vec![format!("next: {}", sketch_effect(loaded))],
        NextStep::CorrectAtMachine(check) => {
            let sketch = || format!("  or, to remove it from the other errors: {}", sketch_effect(loaded));
            let what = format!("next: {}", words::machine_check(check));
            std::iter::once(what).chain(sketchable.then(sketch)).collect()
        }
        NextStep::RicherProgram => richer_program(loaded).map(|call| format!("next: {call}")).into_iter().collect(),
        NextStep::CheckSize(o) => vec![format!("next: {}", super::oversized::check(o))],
        NextStep::Nothing => Vec::new(),
    }
}
