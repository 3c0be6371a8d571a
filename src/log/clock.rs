//! Are the times of a log seconds that count up? They are compared with the times that the plan predicts.

use super::finding_places::Places;
use super::touch::Touch;
use crate::diag::{Finding, Findings};
use crate::program::plan::Plan;

/// Steps from touch to touch that are needed to judge the unit: a pause may be one or two of them.
const FEWEST_STEPS: usize = 5;

/// A run that takes so many times longer or shorter than its plan has its times in another unit.
const OTHER_UNIT: f64 = 10.0;

/// Warns where the times run backward, and where they are not in seconds. `touches` are in the order of the plan, each once.
pub(super) fn check(plan: &Plan, touches: &[Touch], places: &Places<'_>, findings: &mut Findings) {
    let timed: Vec<(&Touch, f64)> = touches.iter().filter_map(|t| Some((t, t.time_s?))).collect();
    findings.0.extend(runs_backward(&timed).map(|(finding, line)| places.at_line(finding, line)));
    if let (Some(finding), Some((first, _))) = (other_unit(plan, &timed), timed.first()) {
        findings.push(places.at_line(finding, first.line));
    }
}

/// The first touch whose time is before that of the touch before it. It must follow it in the plan and in the file: lines
/// in another order, and a set-up that was measured again at the end, have correct times.
fn runs_backward(timed: &[(&Touch, f64)]) -> Option<(Finding, usize)> {
    let falls = |pair: &&[(&Touch, f64)]| pair[1].1 < pair[0].1 && pair[1].0.line > pair[0].0.line;
    let mut falling = timed.windows(2).filter(falls);
    let first = falling.next()?;
    let ((before, before_s), (touch, time_s)) = (first[0], first[1]);
    let more = match falling.count() {
        0 => String::new(),
        1 => "; this happens once more".to_owned(),
        n => format!("; this happens {n} more times"),
    };
    let message = format!(
        "the times run backward: touch {} has {time_s} s, touch {} before it {before_s} s{more}",
        touch.id, before.id
    );
    let help = "effects of time (drift, warm-up) use these times: correct them, or leave them out of the log";
    Some((Finding::warning("log::time_backward", message).help(help), touch.line))
}

/// Both the whole run and the median step must be off: a pause makes only the run longer, and a coarse clock has
/// steps of 0.
fn other_unit(plan: &Plan, timed: &[(&Touch, f64)]) -> Option<Finding> {
    let numbered = plan.numbered();
    let planned = |t: &Touch| numbered.touch(t.id).and_then(|p| p.time_s);
    let both: Vec<(f64, f64)> = timed.iter().filter_map(|(t, time_s)| Some((*time_s, planned(t)?))).collect();
    let steps = both.windows(2).map(|pair| ((pair[1].0 - pair[0].0).abs(), (pair[1].1 - pair[0].1).abs()));
    let (mut log_steps, mut plan_steps): (Vec<f64>, Vec<f64>) = steps.unzip();
    if log_steps.len() < FEWEST_STEPS {
        return None;
    }
    let (log_s, plan_s) = (span(both.iter().map(|b| b.0)), span(both.iter().map(|b| b.1)));
    let (step_s, planned_step_s) = (median(&mut log_steps)?, median(&mut plan_steps)?);
    let is_longer = log_s > OTHER_UNIT * plan_s && step_s > OTHER_UNIT * planned_step_s;
    let is_shorter = OTHER_UNIT * log_s < plan_s && OTHER_UNIT * step_s < planned_step_s;
    if !(is_longer || is_shorter) || plan_s <= 0.0 || planned_step_s <= 0.0 {
        return None;
    }
    let message =
        format!("the touches take {} s by their times, and {} s by the plan", rounded(log_s), rounded(plan_s));
    let unit = if is_longer { "milliseconds" } else { "minutes or hours" };
    let help = format!(
        "times are in seconds: are these values in {unit}? Effects of time (drift, warm-up) and the spindle use them"
    );
    Some(Finding::warning("log::time_unit", message).help(help))
}

fn span(times: impl Iterator<Item = f64> + Clone) -> f64 {
    times.clone().fold(f64::NEG_INFINITY, f64::max) - times.fold(f64::INFINITY, f64::min)
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Three digits are enough to see the unit.
fn rounded(seconds: f64) -> String {
    crate::units::significant(seconds, 3)
}
