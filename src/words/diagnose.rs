//! Findings in the words of the shop floor.

use crate::diagnose::Subject;
use crate::diagnose::features::direction_words;
use crate::diagnose::next_step::MachineCheck;
use crate::fit::{Fit, VisitSource};
use crate::machine::Machine;
use crate::search::dependence::Dependence;
use crate::search::pattern_tests::{CONSTANT, Features};
use crate::units::deg_from_rad;

/// What a shape depends on where one block stands elsewhere from some moment on.
pub(crate) const MOVED_BLOCK: &str = "t*block";

/// `a`, `a or b`, `a, b or c`.
#[must_use]
pub fn list(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} or {last}", all.join(", ")),
    }
}

/// `one of a, b, c`: the first leads.
#[must_use]
pub fn one_of(first: &str, others: &[String]) -> String {
    match others {
        [] => first.to_owned(),
        others => format!("one of {first}, {}", others.join(", ")),
    }
}

/// What a variable is called in `where`.
#[must_use]
pub fn by(on: &str, is_rotary: &dyn Fn(&str) -> bool) -> String {
    match on {
        "t" => "time".into(),
        "T" => "temperature".into(),
        "S" => "spindle".into(),
        "L" => "length".into(),
        "t*block" => "time*block".into(),
        "X" | "Y" | "Z" => format!("axis.{on}"),
        // the last factor of a product may be a pose before
        _ if on.contains('*') => on.to_owned(),
        _ if is_rotary(on) => format!("pose.{on}"),
        _ => match on.strip_suffix(" before") {
            Some(axis) => format!("before.{axis}"),
            None if on.len() == 2 && on.starts_with('s') => format!("sense.{}", &on[1..]),
            None => on.to_owned(),
        },
    }
}

/// What `where` calls a variable, as a machinist says it.
#[must_use]
pub fn plain(by: &str) -> String {
    let of = |word: &str, axis: &str| format!("{word} {axis}");
    match by.split_once('.') {
        Some(("pose", axis)) => axis.to_owned(),
        Some(("axis", axis)) => of("the position of", axis),
        Some(("before", axis)) => format!("where {axis} stood before"),
        Some(("sense", axis)) => format!("the sense of {axis}'s last motion"),
        _ => match by {
            "time*block" => "time and block".to_owned(),
            "length" => "the length of the stylus".to_owned(),
            "spindle" => "the orientation of the spindle".to_owned(),
            "approach" => "the direction of approach".to_owned(),
            "X" | "Y" | "Z" => of("the position of", by),
            CONSTANT => "what is the same at every touch".to_owned(),
            product if product.contains('*') => format!("the product of {}", factors(product)),
            other => format!("the {other}"),
        },
    }
}

/// The factors of a product in words: `sX*C`.
fn factors(product: &str) -> String {
    let rotary = |name: &str| matches!(name, "A" | "B" | "C");
    let each: Vec<String> = product.split('*').map(|factor| plain(&by(factor, &rotary))).collect();
    each.join(" and ")
}

/// A variable of formulas that stands for something that a person can look at: an axis, time, temperature, feed.
#[must_use]
pub fn is_plain(variable: &str) -> bool {
    ["X", "Y", "Z", "A", "B", "C", "t", "T", "feed", "S", "L"].contains(&variable)
        || (variable.len() == 2 && variable.starts_with('s'))
}

/// The form of a shape, from its id: `order`, `step`, …, or nothing for the smooth ones.
fn form(d: &Dependence) -> &str {
    let middle = d.id.split(':').nth(1).unwrap_or_default();
    middle.strip_prefix(&d.on).map_or(middle, |rest| rest.trim_start_matches('-'))
}

fn turns(order: f64) -> String {
    match order.round() as i64 {
        1 => "once per turn".into(),
        2 => "twice per turn".into(),
        k => format!("{k} times per turn"),
    }
}

fn place(d: &Dependence, rotary: bool) -> String {
    match d.on.as_str() {
        "t" => format!("{:.2} h after the first touch", d.scanned),
        _ if rotary => format!("{:.0} deg", deg_from_rad(d.scanned)),
        _ => format!("{:.0} mm", d.scanned),
    }
}

fn duration(hours: f64) -> String {
    if hours < 1.5 { format!("{:.1} min", 60.0 * hours) } else { format!("{hours:.1} h") }
}

/// On what the misfit depends, in a sentence.
#[must_use]
pub fn says(d: &Dependence, share: f64, fit: &Fit, machine: &Machine) -> String {
    let percent = (100.0 * share).round();
    let rotary = machine.rotary().any(|a| a.name.to_string() == d.on) || d.on == "S";
    let direction = direction_words(&d.direction, machine);
    if d.on == CONSTANT {
        return format!("{percent} % of what is left is the same at every touch, {direction}");
    }
    let (on, how) = match d.on.as_str() {
        "t" => (
            "time".to_owned(),
            match form(d) {
                "step" => format!("a jump {}", place(d, false)),
                "period" => format!("a cycle of {}", duration(d.scanned)),
                "exponential" => format!("settling with a time constant of {}", duration(d.scanned)),
                _ => "slowly".to_owned(),
            },
        ),
        "t*block" => {
            let block = moved_block(d, fit).unwrap_or("");
            (format!("block {block}"), format!("it stands elsewhere from {:.2} h after the first touch on", d.scanned))
        }
        "T" => ("the temperature".to_owned(), "smoothly".to_owned()),
        "block" => ("the block".to_owned(), "blocks disagree".to_owned()),
        "face" => ("the face".to_owned(), "faces disagree".to_owned()),
        "visit" => ("the index visit".to_owned(), "visits disagree".to_owned()),
        "run" => ("the run".to_owned(), "runs disagree".to_owned()),
        "S" => ("the orientation of the spindle".to_owned(), harmonic(d)),
        "L" => ("the length of the stylus".to_owned(), "longer against shorter".to_owned()),
        "feed" => ("the feed".to_owned(), "fast against slow".to_owned()),
        "approach" => ("the direction of approach".to_owned(), "around the probe".to_owned()),
        on if on.contains('*') => (factors(on), "both together".to_owned()),
        on => match (on.strip_suffix(" before"), on.strip_prefix('s')) {
            (Some(axis), _) => (format!("where {axis} stood before"), "the way it came from".to_owned()),
            (_, Some(axis)) if axis.len() == 1 => {
                (format!("the sense of {axis}'s last motion"), "up against down".to_owned())
            }
            _ => (
                on.to_owned(),
                match form(d) {
                    "step" => format!("a jump at {}", place(d, rotary)),
                    "kink" => format!("a corner at {}", place(d, rotary)),
                    _ if rotary => harmonic(d),
                    _ => "smoothly".to_owned(),
                },
            ),
        },
    };
    format!("{percent} % of what is left goes with {on} ({how}), {direction}")
}

/// The block that stands elsewhere from some moment on.
#[must_use]
pub fn moved_block<'a>(d: &Dependence, fit: &'a Fit) -> Option<&'a str> {
    let number = d.groups.first().filter(|_| d.on == MOVED_BLOCK)?;
    fit.data.set_ups.get(*number).map(|s| s.label.as_str())
}

/// What a person calls a group of touches that x numbers: `full/a +X`, `full/a`, `visit 3`.
#[must_use]
pub fn group(on: &str, number: usize, fit: &Fit, features: &Features) -> Option<String> {
    match on {
        "face" => {
            let origin = fit.data.origins.get(features.face.iter().position(|f| *f == number)?)?;
            Some(format!("{} {}", origin.block, origin.face))
        }
        "block" => fit.data.set_ups.get(number).map(|s| s.label.clone()),
        "visit" | "run" => Some(format!("{on} {}", number + 1)),
        _ => None,
    }
}

/// Does an effect's own formula speak of a variable?
pub(crate) fn speaks_of(subject: Subject, effect: &str, variable: &str) -> bool {
    let effect = subject.catalogue.get(effect, subject.machine);
    effect.is_some_and(|e| e.terms.iter().any(|t| t.formula.variables().into_iter().any(|v| v == variable)))
}

/// What to check at the machine.
#[must_use]
pub fn machine_check(check: MachineCheck) -> String {
    match check {
        MachineCheck::NamedFaces(faces) => {
            let faces = faces.join(", ");
            return format!("clean {faces} and touch them again. If they are clean, measure the block: its size may differ from the plan");
        }
        MachineCheck::NamedBlock(block) => {
            return format!("clean and clamp block {block}, measure its size, and measure again");
        }
        MachineCheck::MovedBlock(block) => return format!("clamp block {block} again and repeat the measurement"),
        MachineCheck::Faces => "clean the faces of the blocks and touch them again",
        MachineCheck::Blocks => "check whether a block is loose or dirty, clamp and clean it, and measure again",
        MachineCheck::PosesComeBack => {
            "each pose has an error of its own that comes back with it. Check what changes from pose to pose (gear, clamping \
             ring, cables that drag), and measure at more angles of the rotary axes"
        }
        MachineCheck::Runs => {
            "something changed between the runs (temperature, stylus, block, a knock). Write when each run began (`started` in its \
             [[data]]), give a run whose blocks were moved a `mounting` of its own, and diagnose again"
        }
        MachineCheck::Clamping => "check the clamping and indexing of the rotary axes for play or dirt, and measure again",
        MachineCheck::WeakPattern => "measure again: further touches tell whether the pattern is there at all",
        MachineCheck::NoFormula => "look for it at the machine: no formula describes it",
        MachineCheck::NoPattern => "measure again with more touches: the residual depends on nothing that these touches show",
    }
    .to_owned()
}

/// Revisits show that poses come back to better than a touch can tell.
pub(crate) fn visits_come_back(fit: &Fit) -> bool {
    fit.noise.visit_source == VisitSource::Revisits && fit.noise.tau_test_mm < fit.noise.sigma_mm
}

fn harmonic(d: &Dependence) -> String {
    if form(d) == "order" { turns(d.scanned) } else { "smoothly over the turn".to_owned() }
}

/// What kind of thing makes such a misfit.
#[must_use]
pub fn kind(d: &Dependence, fit: &Fit) -> String {
    let comes_back = visits_come_back(fit);
    let text = match (d.on.as_str(), form(d)) {
        ("t", "step") => {
            "something moved at one moment: a knocked fixture, a clamp or probe that gave way, a collision"
        }
        ("t", "period") => "something that cycles: a cooling unit, a lubrication pump, doors and draughts",
        ("t", "exponential") => "warming up: it moves fast at first and comes to rest",
        ("t", _) => "slow change: temperature, creep of a clamp",
        ("t*block", _) => "a block was knocked or slid: a loose clamp, dirt under it, a collision",
        (CONSTANT, _) => "an offset that the model does not hold: a zero point, a length, a position error of an axis",
        ("block", _) => "a block that stands or measures otherwise than the rest: loose, tilted, another size",
        ("face", _) => "single faces that lie elsewhere: chips, burrs, coolant",
        ("visit", _) if comes_back => {
            "poses that each have an error of their own, and come back with it: a pattern that no shape here has"
        }
        ("run", _) => "something that changed between two runs: the machine's temperature, a stylus, a block, a knock",
        ("visit", _) => "poses that do not come back: clamping or indexing scatter",
        ("T", _) => "temperature",
        ("S" | "approach", _) => "the probe: stylus run-out, or a trigger that depends on the direction",
        ("L", _) => "the stylus: its length or bending",
        ("feed", _) => "a delay between trigger and recorded position",
        (on, _) if on.ends_with(" before") => {
            "hysteresis: friction or wind-up that depends on where the axis came from"
        }
        (on, _) if on.len() == 2 && on.starts_with('s') => "looseness: backlash or a reversal error",
        (on, _) if on.contains('*') => "two axes together: sag or squareness that changes with the pose",
        (_, "order") if d.scanned >= 3.5 => {
            return format!(
                "a tooth or bolt pattern with {} periods per turn: gear, worm wheel, coupling, clamping ring",
                d.scanned.round()
            );
        }
        (_, "order") => "an eccentric or wobbling bearing, or an encoder ring mounted off its centre",
        (_, "step") => "looseness that lets go at one place: a stop, a clamp, a worn spot",
        (_, "kink") => "contact that changes at one place: a counterweight, a guideway joint, slack that is taken up",
        _ => "a guideway or scale that is bent, or weight that shifts",
    };
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_and_groups_have_names() {
        let rotary = |name: &str| name == "C";
        assert_eq!(plain(&by("C*C before", &rotary)), "the product of C and where C stood before");
        assert_eq!(plain(&by("C before", &rotary)), "where C stood before");
        let ids = ["pitch-y".to_owned(), "pitch-x".to_owned()];
        assert_eq!(one_of("backlash-x", &ids), "one of backlash-x, pitch-y, pitch-x");
        assert_eq!(one_of("backlash-x", &[]), "backlash-x");
        assert_eq!(plain("sX*C"), "the product of the sense of X's last motion and C");
        assert_eq!(plain("time*block"), "time and block");
    }
}
