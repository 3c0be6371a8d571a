//! The user's settings: what a program leaves of them.

use super::checked_program::{CheckedProgram, CollectedFindings};
use super::explore::ExploredRun;
use super::run::{Event, Happened};
use crate::program::plan::ControllerFrame;
use std::collections::BTreeMap;
use std::ops::Range;

/// Compares what a run leaves, at its end and after a person has broken it off, with what it found.
pub fn settings_return(case: &CheckedProgram<'_>, told: &ExploredRun, said: &mut CollectedFindings) {
    if told.fault.is_some() {
        return;
    }
    let end = told.trunk.last().map_or(0..0, |h| h.at.clone());
    let stopped = stopped_by_itself(&told.trunk);
    compare_settings(case, [&told.settings[0], &told.settings[1]], stopped, &end, "at the end", said);
    let kept = case.post.check.as_ref().map(|c| c.after_abort.as_slice()).unwrap_or_default();
    for (place, after) in &told.aborted {
        let at = told.trunk.get(*place).map_or(0..0, |h| h.at.clone());
        let what = "broken off here by hand, then started once more to give the settings back";
        let after: BTreeMap<String, String> =
            after.iter().filter(|(name, _)| kept.contains(name)).map(|(n, v)| (n.clone(), v.clone())).collect();
        compare_settings(case, [&told.settings[0], &after], false, &at, what, said);
    }
}

/// Did it end with an alarm, and not as a program that is complete?
pub fn stopped_by_itself(trace: &[Happened]) -> bool {
    trace.last().is_some_and(|h| matches!(h.event, Event::Abort(_)))
}

/// Says which settings are neither as before nor, where they may be left, off. A program that has stopped by itself under the
/// control's own transformation may leave on what `stays_on` of the postprocessor file names; one that is complete may not.
pub fn compare_settings(
    case: &CheckedProgram<'_>,
    [before, after]: [&BTreeMap<String, String>; 2],
    stopped: bool,
    at: &Range<usize>,
    when: &str,
    said: &mut CollectedFindings,
) {
    if before == after {
        return;
    }
    let left = case.post.check.as_ref().map(|c| c.leaves.as_slice()).unwrap_or_default();
    let tcp = case.plan.is_some_and(|p| p.controller_frame == ControllerFrame::Tcp);
    let stays = case.post.check.as_ref().map(|c| c.stays_on.as_slice()).filter(|_| tcp && stopped).unwrap_or_default();
    for (name, value) in after.iter().filter(|(name, _)| !stays.contains(name)) {
        // what it may leave changed, it may leave off and no otherwise
        let off = left.contains(name) && case.neutral.get(name) == Some(value);
        if before.get(name) != Some(value) && !off {
            let was = before.get(name).map_or("nothing", String::as_str);
            let says = format!("{when}: the user's setting is not given back: {name}: {was} before, {value} after");
            said.say(case, "check::not_restored", at, says, "");
        }
    }
}
