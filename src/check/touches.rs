//! The touches that a program made, against those of its plan.

use super::checked_program::{CheckedProgram, CollectedFindings};
use super::explore::ExploredRun;
use super::run::{Event, Probe};
use crate::axes::{AxisMap, Position};
use crate::log;
use crate::program::plan::{ControllerFrame, PlanTouch};
use crate::units::Plain;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;

/// A touch that a program made. Positions are axis positions relative to R, mm and deg.
#[derive(Debug, Clone)]
pub struct Made {
    /// Its line of the log, by its place in the record of the run.
    pub logged: Option<usize>,
    /// Its place in the program.
    pub at: Range<usize>,
    /// What was mounted.
    pub part: usize,
    /// The block that it met.
    pub block: Option<String>,
    /// Begin, programmed end and contact of the search; its feed.
    pub search: ([Position; 3], f64),
    /// The same of the measuring touch, and whether the feed override acts on it.
    pub measured: Option<([Position; 3], f64, bool)>,
    /// What the control has kept of the last of them.
    pub latched: Position,
    /// The ball has moved off between the two.
    pub backed_off: bool,
    /// What went into the log.
    pub log: Option<String>,
    /// In which sense each rotary axis came to its place.
    pub senses: AxisMap,
    /// Where the spindle stood at the control, deg.
    pub spindle_deg: Option<f64>,
    /// The program waited for a person before this touch and after the one before it.
    pub waited: bool,
}

impl Made {
    /// After its search.
    pub fn search(
        at: &Range<usize>,
        part: usize,
        block: Option<String>,
        probe: &Probe,
        from: &Position,
        to: &Position,
        contact: &Position,
    ) -> Self {
        Self {
            logged: None,
            at: at.clone(),
            part,
            block,
            search: ([*from, *to, *contact], probe.feed),
            measured: None,
            latched: *contact,
            backed_off: false,
            log: None,
            senses: AxisMap::default(),
            spindle_deg: None,
            waited: false,
        }
    }

    /// After its measuring touch.
    pub fn measure(&mut self, probe: &Probe, from: &Position, to: &Position, contact: &Position, hit: bool) {
        if hit {
            self.measured = Some(([*from, *to, *contact], probe.feed, probe.overridden));
        }
    }
}

/// Logged coordinates may leave the contact by this beside the digits of the log, mm or deg.
const LOGGED: f64 = 1e-6;

/// A line that a run wrote into its log.
struct LogLine<'a> {
    /// Its place in the record of the run.
    event: usize,
    /// Its place in the program.
    at: &'a Range<usize>,
    text: &'a str,
}

/// Compares the touches of a run with the plan.
pub fn against_plan(case: &CheckedProgram<'_>, told: &ExploredRun, made: &[Made], said: &mut CollectedFindings) {
    let lines: Vec<LogLine<'_>> = told
        .trunk
        .iter()
        .enumerate()
        .filter_map(|(event, h)| match &h.event {
            Event::Log(text) => Some(LogLine { event, at: &h.at, text }),
            _ => None,
        })
        .collect();
    log_is_open(case, told, said);
    let text: String = lines.iter().flat_map(|line| [line.text, "\n"]).collect();
    let end = told.trunk.last().map_or(0..0, |h| h.at.clone());
    let mut parsed = match log::parse(text.as_bytes(), "the log that the program writes", case.post) {
        Ok((parsed, findings)) => {
            // what a run leaves that the control has stopped follows from that
            for finding in findings.0.iter().filter(|_| told.fault.is_none()) {
                said.say(case, "check::log", &end, format!("the log that it writes: {}", finding.message), "");
            }
            parsed
        }
        Err(failure) => {
            // a run that only gives the settings back writes no touches
            if told.fault.is_none() && (!made.is_empty() || told.from == 1) {
                for finding in &failure.0 {
                    said.say(case, "check::log", &end, format!("the log that it writes: {}", finding.message), "");
                }
            }
            return;
        }
    };
    let Some(plan) = case.plan else {
        return;
    };
    if told.from == 1 && told.fault.is_none() {
        whole_log(case, &text, &end, said);
    }
    if let Err(failure) = log::to_axes(case.machine, plan, &mut parsed.touches) {
        for finding in &failure.0 {
            said.say(case, "check::log", &end, format!("the log that it writes: {}", finding.message), "");
        }
        return;
    }
    let made_at: HashMap<usize, &Made> = made.iter().filter_map(|m| Some((m.logged?, m))).collect();
    let by_line = |line: usize| lines.get(line.checked_sub(1)?).and_then(|l| made_at.get(&l.event)).copied();
    times(case, &parsed.touches, &lines, said);
    let numbered = plan.numbered();
    let mut ids = Vec::new();
    let mut met: BTreeSet<(usize, &str)> = BTreeSet::new();
    for raw in &parsed.touches {
        let place = lines.get(raw.line.saturating_sub(1)).map_or(end.clone(), |l| l.at.clone());
        let Some(id) = raw.id else { continue };
        let Some(planned) = numbered.touch(id) else {
            said.say(case, "check::not_planned", &place, format!("touch {id} is not in the plan"), "");
            continue;
        };
        if raw.status == log::Status::Miss {
            continue;
        }
        ids.push((id, place.clone()));
        let Some(made) = by_line(raw.line) else {
            said.say(case, "check::log", &place, format!("touch {id} is logged without having been made"), "");
            continue;
        };
        let step = 0.5 * 10f64.powi(-(case.post.log.decimals as i32)) * case.post.number.mm(1.0);
        // three rounded words of a place that is turned may all fall on one axis
        let room = match plan.controller_frame {
            ControllerFrame::Tcp => 3f64.sqrt() * step + 1e-4,
            ControllerFrame::Axes => step,
        } + LOGGED;
        if made.latched.0.iter().zip(raw.position.0).any(|(a, b)| (a - b).abs() > room) {
            let says = format!("touch {id}: the log does not hold the place of the contact");
            said.say(case, "check::log", &place, says, "");
        }
        let first = met.insert((made.part, planned.block.as_str()));
        if first && made.search.1 > case.machine.probe.slow_feed + case.same {
            let says = format!(
                "touch {id}: the first touch of a block must search at slow_feed ({} mm/min)",
                Plain(case.machine.probe.slow_feed)
            );
            said.say(case, "check::feed", &place, says, "");
        }
        for says in differences(case, made, planned) {
            said.say(case, "check::not_the_plan", &place, format!("touch {id}: {says}"), "");
        }
    }
    order(case, told, &ids, &end, said);
}

/// Where the log has times, each touch has one, it goes on as the run does, and it does not jump.
fn times(case: &CheckedProgram<'_>, touches: &[log::RawTouch], lines: &[LogLine<'_>], said: &mut CollectedFindings) {
    // no touch with the way to it takes as long
    const LONGEST_S: f64 = 3600.0;
    if !case.post.log.writes_time {
        return;
    }
    let mut before = 0.0;
    for touch in touches {
        let place = lines.get(touch.line.saturating_sub(1)).map_or(0..0, |l| l.at.clone());
        let id = touch.id.unwrap_or_default();
        match touch.time_s {
            None => said.say(case, "check::log", &place, format!("touch {id} has no time in the log"), ""),
            Some(time) => {
                if !(before..before + LONGEST_S).contains(&time) {
                    let says = format!("touch {id}: the log gives {time} s, {before} s for the one before it");
                    said.say(case, "check::log", &place, says, "");
                }
                before = time;
            }
        }
    }
    // a clock that stands still is none
    let first = touches.first().and_then(|t| t.time_s).unwrap_or(0.0);
    if touches.len() > 2 && before <= first {
        let place = lines.last().map_or(0..0, |l| l.at.clone());
        said.say(case, "check::log", &place, "the times in the log stand still".to_owned(), "");
    }
}

/// The whole log must read as that of a complete run of this plan.
fn whole_log(case: &CheckedProgram<'_>, text: &str, end: &Range<usize>, said: &mut CollectedFindings) {
    let Some(plan) = case.written else { return };
    let writer = log::Writer::Controller(case.post);
    let mut complain = |message: &str| {
        said.say(case, "check::log", end, format!("the log that it writes: {message}"), "");
    };
    match log::read(text.as_bytes(), "the log that the program writes", writer, case.machine, plan) {
        Ok((log, findings)) => {
            // a program that an earlier version wrote is as good as it was
            findings.0.iter().filter(|f| f.code != "log::older").for_each(|f| complain(&f.message));
            if !log.complete {
                complain("it is not complete");
            }
        }
        Err(failure) => failure.0.iter().for_each(|f| complain(&f.message)),
    }
}

/// Lines that are written while no log is open are lost.
fn log_is_open(case: &CheckedProgram<'_>, told: &ExploredRun, said: &mut CollectedFindings) {
    if case.post.check.as_ref().is_some_and(|c| c.log_always_open) {
        return;
    }
    let (mut open, mut opened) = (None, false);
    let wanted = case.plan.and_then(|p| case.post.log_name(p).ok());
    for happened in &told.trunk {
        match &happened.event {
            Event::LogOpen { name, append } => {
                open = Some(());
                // a device has no name, and nothing of it is written over
                if name.is_empty() {
                    continue;
                }
                if wanted.as_ref().is_some_and(|w| w != name) {
                    let says = format!("the log is called {name:?}, expected {:?}", wanted.as_deref().unwrap_or(""));
                    said.say(case, "check::log", &happened.at, says, "");
                }
                let again = std::mem::replace(&mut opened, true);
                if *append != (told.from > 1 || again) {
                    let says = if again {
                        "the lines of the log before this one are written over"
                    } else if *append {
                        "a run from the beginning goes on with an old log"
                    } else {
                        "a run that goes on writes over the log of its beginning"
                    };
                    said.say(case, "check::log", &happened.at, says.to_owned(), "");
                }
            }
            Event::LogClose => open = None,
            Event::Log(_) if open.is_none() && told.parts.last().is_some() && moves(told) => {
                said.say(case, "check::log", &happened.at, "a line is written while no log is open".to_owned(), "");
            }
            _ => {}
        }
    }
    if open.is_some() && told.fault.is_none() {
        let end = told.trunk.last().map_or(0..0, |h| h.at.clone());
        said.say(case, "check::log", &end, "the log is not closed".to_owned(), "");
    }
}

fn moves(told: &ExploredRun) -> bool {
    told.trunk.iter().any(|h| matches!(h.event, Event::Move { .. }))
}

/// The whole plan, or all of it from some touch on.
fn order(
    case: &CheckedProgram<'_>,
    told: &ExploredRun,
    ids: &[(u64, Range<usize>)],
    end: &Range<usize>,
    said: &mut CollectedFindings,
) {
    let Some(plan) = case.plan else { return };
    let begin = match ids.first() {
        _ if told.from == 1 => 0,
        Some((id, _)) => plan.touches.iter().position(|t| t.id == *id).unwrap_or(0),
        None => plan.touches.len(),
    };
    let expected: Vec<u64> = plan.touches.iter().skip(begin).map(|t| t.id).collect();
    let made: BTreeSet<u64> = ids.iter().map(|(id, _)| *id).collect();
    let lacking: Vec<u64> = expected.iter().copied().filter(|id| !made.contains(id)).collect();
    if !lacking.is_empty() {
        let shown: Vec<String> = lacking.iter().take(10).map(u64::to_string).collect();
        let more = if lacking.len() > 10 { format!(" and {} more", lacking.len() - 10) } else { String::new() };
        let says = format!("the plan has touch {}{more}, the program does not make it", shown.join(", "));
        said.say(case, "check::touch_lacking", end, says, "");
        return;
    }
    for (wanted, (id, place)) in expected.iter().zip(ids) {
        if wanted != id {
            let says = format!("touch {id} is made where the plan has touch {wanted}");
            said.say(case, "check::order", place, says, "");
            return;
        }
    }
    if let Some((id, place)) = ids.get(expected.len()) {
        said.say(case, "check::order", place, format!("touch {id} is made once more than planned"), "");
    }
}

fn differences(case: &CheckedProgram<'_>, made: &Made, planned: &PlanTouch) -> Vec<String> {
    let mut says = Vec::new();
    let mut need = |good: bool, text: String| {
        if !good {
            says.push(text);
        }
    };
    let near = |a: &Position, b: &Position| a.0.iter().zip(b.0).all(|(x, y)| (x - y).abs() <= case.same);
    let probe = &case.machine.probe;
    let [from, to, contact] = &made.search.0;
    let turned = from.0[3..].iter().zip(&planned.start_position().0[3..]).any(|(a, b)| (a - b).abs() > case.same);
    need(!turned, "the rotary axes do not stand at its pose".into());
    need(near(from, &planned.start_position()), "the search does not begin at the plan's start".into());
    need(near(to, &planned.end_position()), "the search does not end at the plan's end".into());
    need(
        made.block.as_deref() == Some(planned.block.as_str()),
        format!("it meets block {}, the plan has block {}", made.block.as_deref().unwrap_or("?"), planned.block),
    );
    const NOMINAL_MM: f64 = 2e-3;
    let nominal = planned.nominal_position();
    need(
        contact.0.iter().zip(nominal.0).all(|(a, b)| (a - b).abs() <= NOMINAL_MM),
        "the contact is not where the plan has it".into(),
    );
    let slow = planned.feed_mm_min.unwrap_or(probe.slow_feed);
    match &made.measured {
        Some((places, feed, overridden)) => {
            need(
                near(&places[1], &planned.end_position()),
                "the measuring touch does not end at the plan's end".into(),
            );
            need(
                (feed - slow).abs() <= case.same,
                format!("it measures at {} mm/min, the plan has {}", Plain(*feed), Plain(slow)),
            );
            need(!overridden, "the feed override acts on the measuring touch".into());
            let back = (places[0].xyz_mm() - contact.xyz_mm()).norm();
            need(
                (back - probe.back_off).abs() <= 0.01 + case.same,
                format!("it moves off {back:.3} mm before it measures, the machine's back_off is {}", probe.back_off),
            );
        }
        None => need(
            (made.search.1 - slow).abs() <= case.same,
            "it is not touched a second time at the measuring feed".into(),
        ),
    }
    for (axis, sense) in planned.from.iter() {
        need(made.senses.get(axis) == Some(sense), format!("axis {axis} came in another sense than planned"));
    }
    // a touch that says nothing stands at 0, where the plan turns the spindle at all
    let turns = case.plan.is_some_and(|p| p.touches.iter().any(|t| t.spindle_deg.is_some()));
    if turns && orients(case) {
        let wanted = (planned.spindle_deg.unwrap_or(0.0) * case.machine.tool.spindle_sense).rem_euclid(360.0);
        let found = made.spindle_deg.map(|d| d.rem_euclid(360.0));
        let off = found.map_or(360.0, |f| (f - wanted).abs());
        need(off.min(360.0 - off) <= case.same, format!("the spindle is not oriented to {} deg", Plain(wanted)));
    }
    says
}

/// Some machines cannot orient the spindle: the user's setting says so.
fn orients(case: &CheckedProgram<'_>) -> bool {
    case.post.settings.get("orient").is_none_or(|o| !matches!(o.as_str(), "" | "no"))
}
