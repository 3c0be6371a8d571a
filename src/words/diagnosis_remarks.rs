//! What a reader must know beside the verdict of a diagnosis.

use super::diagnose::{may_be_the_room, plain};
use crate::diagnose::Verdict;
use crate::diagnose::answer::{Candidate, Diagnosis, Outlier};
use crate::report::fit::{significant, with_unit};

/// More touches than this that come back with the first candidate are said in one line.
const MOST_ALONE: usize = 4;

/// Effects named with their smallest detectable size.
const MOST_POWER: usize = 4;

/// What a reader must know beside the verdict, the most important first.
pub(crate) fn remarks(d: &Diagnosis, verbose: bool) -> Vec<String> {
    let mut out: Vec<String> = d.warnings.iter().map(|w| format!("warning: {w}")).collect();
    // what nothing speaks for is not explained
    if d.verdict != Verdict::Adequate {
        out.extend(d.proposed().iter().flat_map(of_candidate));
    }
    out.extend(d.declared_noise_um.map(|declared_um| {
        let part = if d.proposed().is_empty() { "" } else { " What is named may be only a part of what is wrong." };
        format!(
            "repeated touches scatter by {} µm, and the probe is declared with {} µm: chips, dirt or a loose stylus count as noise here.{part} Clean the ball and the faces, fasten the stylus and measure again",
            significant(d.noise_um),
            significant(declared_um)
        )
    }));
    for g in d.gross.iter().take(3) {
        let share = |share: f64| format!("{:.0} %", 100.0 * share);
        out.push(match (g.in_place, g.agrees) {
            (Some(of), _) => format!("tried: {}: {} of the touches would be where planned", g.says, share(of)),
            (_, Some(of)) => format!("tried: {}: {} of the touches would hit or miss as they did", g.says, share(of)),
            _ => format!("tried: {}: the residual would be {} µm RMS", g.says, significant(g.rms_um)),
        });
    }
    out.extend(not_used(d));
    let beside_the_verdict = match d.verdict {
        Verdict::Adequate => true,
        Verdict::Unexplained(_) => may_be_the_room(d),
        _ => false,
    };
    if !d.needs_temperature.is_empty() && !beside_the_verdict {
        out.push(format!("cannot be measured without temperatures in the log: {}", d.needs_temperature.join(", ")));
    }
    let unseen: Vec<&str> =
        d.not_seen.iter().filter(|id| !d.needs_temperature.contains(id)).map(String::as_str).collect();
    if !unseen.is_empty() {
        out.push(format!(
            "cannot be seen with these touches (they move no touch, or the values of the model include all that they do): {}",
            unseen.join(", ")
        ));
    }
    let small: Vec<String> = d
        .power
        .iter()
        .take(MOST_POWER)
        .map(|p| format!("{} below {} µm", p.effect, significant(p.minimal_detectable_um)))
        .collect();
    if !small.is_empty() {
        out.push(format!("too small to be found with these touches: {}", small.join(", ")));
    }
    if verbose && let Some(first) = d.depends.first() {
        out.push(first.says.clone());
        // they share much of it with the first, and with each other
        let others: Vec<String> =
            d.depends[1..].iter().map(|w| format!("{} ({:.0} %)", plain(&w.by), 100.0 * w.share)).collect();
        if !others.is_empty() {
            out.push(format!("each taken alone, the residual also depends on: {}", others.join(", ")));
        }
    }
    out
}

fn unusually_large(c: &Candidate) -> String {
    let or =
        if c.same_as.is_empty() { "Or another effect looks like it" } else { "Or another effect of its group acts" };
    let cause = if c.too_large.is_empty() { String::new() } else { format!("Probable cause: {}. ", c.too_large) };
    format!("{} would be {:.0} times its usual size. {cause}{or}", c.effect, c.times_usual)
}

/// What is to be known of the effect that is named.
fn of_candidate(first: &Candidate) -> Vec<String> {
    let mut out = Vec::new();
    if !first.wrong_sign.is_empty() {
        out.push(wrong_sign(first));
    }
    if !first.plausible {
        out.push(unusually_large(first));
    }
    for w in &first.weakens {
        out.push(format!(
            "{} becomes less certain with {}: {} in place of {}",
            w.name,
            first.effect,
            with_unit(significant(w.sigma_after), &w.unit),
            with_unit(significant(w.sigma_before), &w.unit)
        ));
    }
    out
}

/// Touches that are not used. Those of a block that moved, and those that agree with the first candidate, are one finding.
fn not_used(d: &Diagnosis) -> Vec<String> {
    let mut out = Vec::new();
    let moved = |o: &&Outlier| d.verdict.moved_block().is_some_and(|b| b == o.block);
    let of_block: Vec<&Outlier> = d.outliers.iter().filter(moved).collect();
    if let (Some(block), Some(first)) = (d.verdict.moved_block(), of_block.first()) {
        let ids: Vec<String> = of_block.iter().map(|o| o.id.to_string()).collect();
        out.push(match ids.len() {
            1 => format!("not used: touch {} of run {}, of block {block} that moved", first.id, first.run),
            n => format!("not used: {n} touches of block {block} that moved: {}", ids.join(", ")),
        });
    }
    let (back, stay): (Vec<&Outlier>, Vec<&Outlier>) =
        d.outliers.iter().filter(|o| !moved(o)).partition(|o| o.comes_back);
    let together = back.len() > MOST_ALONE;
    if together {
        let ids: Vec<String> = back.iter().map(|o| format!("{}/{}", o.run, o.id)).collect();
        let n = ids.len();
        let says = "that agree with the others once the first candidate is in the model";
        out.push(format!("not used: {n} touches {says} (run/touch): {}", ids.join(", ")));
    }
    for o in stay.into_iter().chain(back.into_iter().filter(|_| !together)) {
        let back =
            if o.comes_back { "; it agrees with the others once the first candidate is in the model" } else { "" };
        out.push(format!("not used: touch {} of run {} ({} {}): {}{back}", o.id, o.run, o.block, o.face, o.reason));
    }
    out
}

/// What a size of the wrong sign means.
pub(crate) fn wrong_sign(c: &Candidate) -> String {
    format!(
        "{} would be negative, but such an effect is positive: a compensation that is too large, or a part that cools down, would look like this",
        c.wrong_sign.join(", ")
    )
}
