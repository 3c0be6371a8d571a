//! What a program does when something goes wrong: it must say so and stay where it is.

use super::checked_program::{CheckedProgram, CollectedFindings, SIDEWAYS_MM};
use super::explore::{Branch, Deviation, ExploredRun};
use super::run::{Alarm, Event, Happened};
use super::settings::{compare_settings, stopped_by_itself};
use crate::axes::Position;
use std::borrow::Cow;
use std::ops::Range;

/// The line with which the log of a run ends.
pub fn last_line(told: &ExploredRun) -> Option<&str> {
    told.trunk.iter().rev().find_map(|h| match &h.event {
        Event::Log(text) => Some(text.as_str()),
        _ => None,
    })
}

/// When something went wrong the program must say so and stay where it is. `last_line` is that of the run.
pub fn branch_stops(
    case: &CheckedProgram<'_>,
    told: &ExploredRun,
    last_line: Option<&str>,
    branch: &Branch,
    said: &mut CollectedFindings,
) {
    if !branch.deviation.must_stop() {
        return;
    }
    let Some(first) = branch.trace.first() else { return };
    let what = match branch.deviation {
        Deviation::Contact(part) if part > 0.0 => "contact on the way",
        Deviation::Contact(_) => "the probe is triggered before this move",
        Deviation::Miss => "no contact up to the end",
        Deviation::Shift(_) => "the block stands off by more than the placement tolerance",
        Deviation::Disagree(_) => "search and measuring touch disagree",
        Deviation::Stuck => "the probe does not close again",
        Deviation::Deflected => "the probe is deflected before the move",
        Deviation::NotWritten => "a line cannot be written into the log",
    };
    let mut complain = |at: &Range<usize>, says: &str| {
        said.say(case, "check::goes_on", at, format!("{what}: {says}"), "the program must say what is wrong and stop");
    };
    if let Some(fault) = &branch.fault {
        complain(&fault.at, &fault.says);
        return;
    }
    let stuck = branch.deviation == Deviation::Stuck;
    let moves = branch.trace.iter().skip(1).find(|h| match &h.event {
        Event::Move { from, to, .. } => !(stuck && goes_back(branch, from, to)),
        // with the probe deflected a search ends where it begins
        Event::Probe { probe, outcome, .. } => {
            !(stuck && (outcome.part == 0.0 || goes_back(branch, &probe.from, &probe.to)))
        }
        _ => false,
    });
    if let Some(moves) = moves {
        complain(&moves.at, "the program moves on");
        return;
    }
    if !branch.over {
        complain(&first.at, "the program goes on");
        return;
    }
    let shows =
        |h: &Happened| matches!(&h.event, Event::Message(t) | Event::Wait(t) | Event::Abort(t) if !t.is_empty());
    if !branch.trace.iter().any(shows) {
        complain(&first.at, "no message is shown");
    }
    let logs_end = |h: &Happened| matches!((&h.event, last_line), (Event::Log(t), Some(l)) if t == l);
    if told.fault.is_none() && branch.trace.iter().any(logs_end) {
        complain(&first.at, "the log is closed as if the program were complete");
    }
    let ends_well = matches!(branch.trace.last().map(|h| &h.event), Some(Event::End));
    let stops = |h: &Happened| matches!(&h.event, Event::Wait(_) | Event::Abort(_));
    if ends_well && !branch.trace.iter().any(stops) {
        complain(&first.at, "the program ends as if it were complete");
    }
    let alarmed = branch.trace.iter().any(
        |h| matches!(&h.event, Event::Probe { probe, outcome, .. } if probe.alarm == Alarm::AtEvent && outcome.hit),
    );
    let mut after = Cow::Borrowed(branch.settings.as_ref());
    if alarmed {
        // the package's own alarm: what it leaves is the package's, and the postprocessor file says what that is
        let calls = case.post.check.as_ref().map(|c| c.calls.as_slice()).unwrap_or_default();
        after.to_mut().retain(|name, _| !calls.iter().any(|c| c.leaves.contains(name)));
    }
    let stopped = stopped_by_itself(&branch.trace);
    compare_settings(case, [&told.settings[0], &after], stopped, &first.at, what, said);
}

/// Does a move go back from where the branch began?
fn goes_back(branch: &Branch, from: &Position, to: &Position) -> bool {
    let Some(Event::Probe { probe, .. }) = branch.trace.first().map(|h| &h.event) else { return false };
    let along = probe.to.xyz_mm() - probe.from.xyz_mm();
    let way = to.xyz_mm() - from.xyz_mm();
    let turned = from.0[3..] != to.0[3..];
    !turned && way.dot(&along) <= 0.0 && way.cross(&along).norm() <= (1e-3 * way.norm() + SIDEWAYS_MM) * along.norm()
}
