//! Findings in the words of the shop floor.

use super::oversized;
use crate::diagnose::features::direction_words;
use crate::diagnose::next_step::MachineCheck;
use crate::diagnose::verdict::{Missing, NameDoubt, TooLittle, Verdict};
use crate::diagnose::{Diagnosis, Subject};
use crate::fit::{Fit, VisitSource};
use crate::log::LogMistake;
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

/// What may act in place of one of two effects that are named together.
pub(super) fn in_place_of(name: &str, others: &[String], or_else: Option<&str>) -> String {
    let all: Vec<&str> = others.iter().map(String::as_str).chain(or_else).collect();
    match all[..] {
        [] => String::new(),
        _ => format!(" In place of {name} it may be {}: these touches cannot separate them.", all.join(" or ")),
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
        Some(("before", axis)) => format!("where {axis} was before"),
        Some(("sense", axis)) => format!("the direction of {axis}'s last motion"),
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
    form_of(&d.id, &d.on)
}

fn form_of<'a>(id: &'a str, on: &str) -> &'a str {
    let middle = id.split(':').nth(1).unwrap_or_default();
    middle.strip_prefix(on).map_or(middle, |rest| rest.trim_start_matches('-'))
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
        return format!("{percent} % of the residual is the same at every touch, {direction}");
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
            (format!("block {block}"), format!("it moved {:.2} h after the first touch", d.scanned))
        }
        "T" => ("the temperature".to_owned(), "smoothly".to_owned()),
        "block" => ("the block".to_owned(), "blocks disagree".to_owned()),
        "face" => ("the face".to_owned(), "faces disagree".to_owned()),
        "visit" => ("the index position".to_owned(), "index positions disagree".to_owned()),
        "run" => ("the run".to_owned(), "runs disagree".to_owned()),
        "S" => ("the orientation of the spindle".to_owned(), harmonic(d)),
        "L" => ("the length of the stylus".to_owned(), "longer against shorter".to_owned()),
        "feed" => ("the feed".to_owned(), "fast against slow".to_owned()),
        "approach" => ("the direction of approach".to_owned(), "around the probe".to_owned()),
        on if on.contains('*') => (factors(on), "both together".to_owned()),
        on => match (on.strip_suffix(" before"), on.strip_prefix('s')) {
            (Some(axis), _) => (format!("where {axis} was before"), "the way it came from".to_owned()),
            (_, Some(axis)) if axis.len() == 1 => {
                (format!("the direction of {axis}'s last motion"), "up against down".to_owned())
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
    format!("{percent} % of the residual depends on {on} ({how}), {direction}")
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

/// A set-up mistake of the catalogue: `flip_B`, `swap_XY`.
pub(crate) fn catalogue_mistake(parameter: &str) -> String {
    match parameter.split_once('_') {
        Some(("flip", axis)) => format!("axis {axis} counts the wrong way round"),
        Some((_, axes)) => {
            let (a, b) = axes.split_at(1.min(axes.len()));
            format!("axes {a} and {b} are exchanged")
        }
        None => parameter.to_owned(),
    }
}

/// A mistake that a log shows.
pub(crate) fn log_mistake(mistake: &LogMistake) -> String {
    match mistake {
        LogMistake::Inches => "the log is in inches and was read as millimetres".to_owned(),
        LogMistake::Millimetres => "the log is in millimetres and was read as inches".to_owned(),
        LogMistake::ExchangedXyz => "axes X, Y and Z are exchanged".to_owned(),
        LogMistake::Exchanged(a, b) => format!("axes {a} and {b} are exchanged"),
        LogMistake::Sign(axes) => {
            let each: Vec<String> = axes.iter().map(|a| format!("axis {a} counts the wrong way round")).collect();
            each.join(", and ")
        }
        LogMistake::Shift { .. } => mistake.says(),
    }
}

/// The size of the residual beside the noise.
pub(super) fn against(d: &Diagnosis) -> String {
    /// Noise below this is none: the touches are made by a program without noise, µm.
    const NO_NOISE_UM: f64 = 0.005;
    if d.noise_um < NO_NOISE_UM {
        return format!("{:.2} µm RMS", d.rms_um);
    }
    format!("{:.2} µm RMS, {:.1} times the probe noise of {:.2} µm", d.rms_um, d.rms_um / d.noise_um, d.noise_um)
}

/// The verdict, the first sentence as the answer.
pub(crate) fn verdict(d: &Diagnosis, fit: &Fit) -> String {
    let mut says = answer(d, fit);
    if let Some(declared_um) = d.declared_visit_um {
        says += &format!(
            " The tests allow for index positions that scatter by {:.2} µm, and the machine's file declares {declared_um:.2} µm: an effect may be hidden in it. Measure some poses twice and diagnose again.",
            d.visit_um
        );
    }
    // beside a set-up mistake nothing else counts
    match d.oversized.first().filter(|_| d.mistake().is_none()) {
        None => says,
        Some(o) => format!("{says} {}{}", oversized::finding(o, &d.verdict), oversized::more(d.oversized.len() - 1)),
    }
}

fn answer(d: &Diagnosis, fit: &Fit) -> String {
    match &d.verdict {
        Verdict::Adequate => adequate(d, fit),
        Verdict::MissingEffect(missing) => missing_effect(d, missing),
        Verdict::Unexplained(unexplained) => {
            let room = if may_be_the_room(d) { without_temperature(d, fit) } else { String::new() };
            format!("{}{room}", super::not_explained::not_explained(d, unexplained, fit))
        }
        Verdict::TooLittleData(why) => too_little(d, why),
    }
}

fn adequate(d: &Diagnosis, fit: &Fit) -> String {
    /// So small a probability of the misfit is said, though no effect is named: one clean machine in a hundred has it.
    const MORE_THAN_NOISE: f64 = 0.01;
    let fits = if d.lack_of_fit_p < MORE_THAN_NOISE {
        format!(
            "No effect was found that is missing, but the residual is larger than the probe noise explains (p = {:.2} %): {}. \
             Something small may be missing.",
            100.0 * d.lack_of_fit_p,
            against(d)
        )
    } else {
        format!("The model is complete as far as these touches can measure: {}.", against(d))
    };
    format!("{fits}{}{}", tested(d), without_temperature(d, fit))
}

/// Does a residual that no effect explains change with time as a room's temperature does, and not in a jump?
pub(crate) fn may_be_the_room(d: &Diagnosis) -> bool {
    d.depends.first().is_some_and(|first| first.on == "t" && form_of(&first.id, &first.on) != "step")
}

/// A warm room looks like scatter of the index positions where few of them are measured, and like a drift that no effect explains
/// where many are: that the log lacks the temperature is said beside the verdict.
fn without_temperature(d: &Diagnosis, fit: &Fit) -> String {
    if d.needs_temperature.is_empty() {
        return String::new();
    }
    let why = match fit.data.temperature_gap {
        None => "The log has no temperatures",
        Some(_) => "Temperatures are missing for a part of the touches",
    };
    format!(
        " {why}, so effects of the room temperature cannot be tested ({}). Keep the room at one temperature, or add temperatures \
         to the touches (CSV, temperature_degC).",
        d.needs_temperature.join(", ")
    )
}

fn tested(d: &Diagnosis) -> String {
    if d.power.is_empty() {
        return String::new();
    }
    let unseen = match d.not_seen.iter().filter(|id| !d.needs_temperature.contains(id)).count() {
        0 => String::new(),
        1 => "; 1 more cannot be seen with these touches".to_owned(),
        n => format!("; {n} more cannot be seen with these touches"),
    };
    format!(" {} effects were tested{unseen}.", d.tested)
}

fn missing_effect(d: &Diagnosis, missing: &Missing) -> String {
    const CORRECT: &str =
        "Correct it in the machine file or in the log, and measure again. Small effects cannot be judged before that.";
    match missing {
        Missing::TouchesFarOff { far, of, right, mistake } => format!(
            "{far} of {of} touches are far from their planned positions. Probable cause: {mistake}. Without it {right} of them \
             would be right. {CORRECT}"
        ),
        Missing::TouchesMissed { unusable, of, mistakes, agrees } => format!(
            "{unusable} of {of} touches cannot be used, most of them because the probe did not trigger. Probable cause: {}. This \
             explains {:.0} % of the hits and misses. {CORRECT}",
            list(mistakes),
            100.0 * agrees
        ),
        Missing::Effect(doubt) => {
            let Some(c) = d.candidates.first() else { return String::new() };
            let or_else = c.or_else.as_ref().map_or_else(String::new, |other| format!(", or {other}"));
            let what = match (d.proposed(), &c.same_as[..]) {
                ([first, second], _) => {
                    format!("{} and {} together: no single effect explains it better", first.effect, second.effect)
                }
                (_, []) => format!("{} ({}){or_else}", c.name, c.effect),
                (_, others) => format!("{}{or_else}", one_of(&c.effect, others)),
            };
            let which = match d.proposed() {
                [_, _] => {
                    d.proposed().iter().map(|c| in_place_of(&c.effect, &c.same_as, c.or_else.as_deref())).collect()
                }
                _ if c.same_as.is_empty() && c.or_else.is_none() => String::new(),
                _ => " These touches cannot separate them.".to_owned(),
            };
            let rest = super::not_explained::remains(d);
            let doubt = match doubt {
                None => String::new(),
                Some(NameDoubt::Pattern(says)) => {
                    format!(" The name may be wrong: a pattern that no listed effect explains fits better ({says}).")
                }
                Some(NameDoubt::OtherForm { by, more }) => format!(
                    " The name may be wrong: another dependence on {} explains {:.0} % more of the residual than {}.",
                    plain(by),
                    100.0 * more,
                    c.effect
                ),
            };
            let it = if d.proposed().len() > 1 { "both" } else { "it" };
            let (of, before_um) = match &d.all_touches {
                None => (String::new(), d.rms_um),
                Some(all) => (format!(" of all touches, with the {} that are not used now,", all.put_back), all.rms_um),
            };
            format!(
                "Missing: {what}.{which} With {it} the error{of} falls from {before_um:.2} to {:.2} µm RMS; the probe noise is {:.2} \
                 µm.{rest}{doubt}",
                c.rms_after_um, d.noise_um
            )
        }
    }
}

/// The first candidate with those that these touches cannot separate from it.
pub(super) fn candidate_names(d: &Diagnosis) -> String {
    let Some(c) = d.candidates.first() else { return "an effect".to_owned() };
    match &c.same_as[..] {
        [] => c.effect.clone(),
        [other] => format!("{} or {other}", c.effect),
        others => format!("{} or one of {} others", c.effect, others.len()),
    }
}

fn too_little(d: &Diagnosis, why: &TooLittle) -> String {
    match why {
        TooLittle::FewTouches { used, unknowns } => format!(
            "Too few touches to judge: {used} touches for {unknowns} unknowns. Use a program with more touches, or remove effects \
             from the model."
        ),
        TooLittle::NoneUsed { excluded: 0 } => {
            "Too few touches to judge: there is no touch that can be used. Measure again.".to_owned()
        }
        TooLittle::NoneUsed { excluded } => format!(
            "Too few touches to judge: all {excluded} touches are excluded. Include touches again, or measure again."
        ),
        TooLittle::NothingDetermined(names) => format!(
            "Too little data to judge: these touches determine none of the machine errors in the model ({}). The fit is good \
             ({}), but says nothing about the machine. Run the program to its end, or touch in other poses; `axiscal identify` \
             lists poses that help.",
            names.join(", "),
            against(d)
        ),
        TooLittle::MostUnusable { unusable, of, far } => format!(
            "{unusable} of {of} touches cannot be used, most of them because {}. Small effects cannot be judged. Check: does an axis \
             count the wrong way round? Are two axes exchanged? Are the blocks where the plan says? Does the log belong to this plan?",
            if *far { "they are far from their planned positions" } else { "the probe did not trigger" }
        ),
    }
}

#[must_use]
pub fn machine_check(check: &MachineCheck) -> String {
    match check {
        MachineCheck::NamedFaces(faces) => {
            let faces = faces.join(", ");
            return format!("clean {faces} and touch them again. If they are clean, measure the block: its size may differ from the plan");
        }
        MachineCheck::NamedBlocks(blocks) => {
            let block = blocks.first().map_or("", String::as_str);
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
        MachineCheck::WeakPattern => "measure again: further touches show whether the pattern is real",
        MachineCheck::NoFormula => "check at the machine: no formula describes it",
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

/// What an effect is, and which of its parameters have no size.
#[must_use]
pub fn without_sizes(says: &str, names: &[String]) -> String {
    format!("{}. Its {} cannot be determined with this plan", says.trim_end_matches('.'), list(names))
}

/// What an effect of each block is, where only the differences between blocks are determined; with the block that differs most.
pub(crate) fn differences_of_blocks(says: &str, odd: Option<&crate::diagnose::odd_block::OddBlock>) -> String {
    let says = format!("{}. Only the differences between blocks can be determined", says.trim_end_matches('.'));
    match odd {
        Some(odd) => {
            let (by, more) = (crate::units::significant(odd.by.abs(), 3), if odd.by > 0.0 { "more" } else { "less" });
            format!(
                "{says}: block {} differs most, its {} is {by} {} {more} than that of the others",
                odd.block, odd.parameter, odd.unit
            )
        }
        None => says,
    }
}

/// What an effect is, with the point about which it turns its axis.
pub(crate) fn turning(says: &str, point: &crate::model::lever_arm::TurningPoint) -> String {
    format!("{}. Here it is a {}", says.trim_end_matches('.'), super::fit::turning_point(point))
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
        (CONSTANT, _) => "an offset that the model lacks: a zero point, a length, a position error of an axis",
        ("block", _) => "a block that differs from the others: loose, tilted, another size",
        ("face", _) => "single faces that are offset: chips, burrs, coolant",
        ("visit", _) if comes_back => {
            "poses that each have an error of their own, and come back with it: a pattern that no listed effect explains"
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
        (_, "step") => "looseness that gives way at one position: a stop, a clamp, a worn spot",
        (_, "kink") => {
            "contact that changes at one position: a counterweight, a guideway joint, slack that is taken up"
        }
        _ => "a guideway or scale that is bent, or weight that shifts",
    };
    text.to_owned()
}

/// How far the evidence of an effect is beyond the noise, from the probability that noise alone gives as much (all effects
/// that were tested counted in).
#[must_use]
pub fn beyond_noise(p_adjusted: f64) -> &'static str {
    match p_adjusted {
        p if p < 1e-6 => "far beyond the noise",
        p if p < 1e-3 => "clearly beyond the noise",
        p if p < 0.05 => "beyond the noise",
        p if p < 0.5 => "may be noise",
        _ => "no more than noise",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_and_groups_have_names() {
        let rotary = |name: &str| name == "C";
        assert_eq!(plain(&by("C*C before", &rotary)), "the product of C and where C was before");
        assert_eq!(plain(&by("C before", &rotary)), "where C was before");
        let ids = ["pitch-y".to_owned(), "pitch-x".to_owned()];
        assert_eq!(one_of("backlash-x", &ids), "one of backlash-x, pitch-y, pitch-x");
        assert_eq!(one_of("backlash-x", &[]), "backlash-x");
        assert_eq!(plain("sX*C"), "the product of the direction of X's last motion and C");
        assert_eq!(plain("time*block"), "time and block");
    }
}
