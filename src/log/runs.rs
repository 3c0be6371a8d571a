//! Where the runs of a log begin and end, and which of them counts.

use super::finding_places::Places;
use super::read_lines::{Event, LineKind};
use super::record::LogHeader;
use super::text_lines::Line;
use super::touch::RawTouch;
use crate::diag::{Failure, Finding, Findings};
use crate::post::LogRule;
use std::collections::BTreeMap;
use std::ops::Range;

/// One run in a log, as it is offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunFound {
    /// From 1, in the order of the log.
    pub number: usize,
    /// First line, from 1.
    pub first_line: usize,
    pub last_line: usize,
    /// Lines of touches that are understood.
    pub touches: usize,
    /// The line of its end is there, and it began with the first set-up.
    pub complete: bool,
    pub taken: bool,
}

impl RunFound {
    fn says(&self) -> String {
        let Self { number, first_line, last_line, touches, .. } = self;
        let how = if self.complete { "complete" } else { "not complete" };
        format!("run {number}: lines {first_line} to {last_line}, {touches} touches, {how}")
    }
}

#[derive(Debug, Default)]
pub struct Run {
    /// With which it begins.
    pub header: Option<LogHeader>,
    /// Touches of the log, in order.
    touches: Vec<Range<usize>>,
    /// Where the artefact was found, in the unit of the log; after a second start the last one.
    pub found: Option<[f64; 3]>,
    /// Count of touches of the plan, and line.
    pub end: Option<(u64, usize)>,
    last_line: usize,
    /// The set-ups at which the program was started again, with the lines that say so; `None`: that line is not understood.
    resumed: Vec<(Option<u64>, usize)>,
}

impl Run {
    pub fn has_touches(&self) -> bool {
        self.count() > 0
    }

    fn count(&self) -> usize {
        self.touches.iter().map(Range::len).sum()
    }

    fn first_line(&self, touches: &[RawTouch]) -> usize {
        let first = self.touches.first().and_then(|t| touches.get(t.start)).map(|t| t.line);
        self.header.as_ref().map(|h| h.line).or(first).unwrap_or(1)
    }

    fn complete(&self) -> bool {
        // an end alone is not enough: lines may have been lost on the way
        let whole = self.end.is_some_and(|(planned, _)| self.count() as u64 >= planned);
        whole && self.count() > 0 && self.header.as_ref().is_none_or(|h| h.setup <= 1)
    }

    /// Says where the program was started again. Its clock counts from there: how long the pause was is not known, so the
    /// touches behind it carry no time. Where the line that says so is lost the clock shows it: it goes back.
    pub fn say_resumed(&self, touches: &mut [RawTouch], rule: &LogRule, places: &Places<'_>, findings: &mut Findings) {
        let mut resumed = self.resumed.clone();
        // behind a line that says so no time is used anyhow
        let said = resumed.first().map_or(usize::MAX, |(_, line)| *line);
        let first = touches.iter().position(|t| t.line > said).unwrap_or(touches.len());
        if let Some(line) = clock_begins_again(&touches[..first], rule) {
            resumed.insert(0, (None, line));
        }
        for (i, (setup, line)) in resumed.iter().enumerate() {
            let until = resumed.get(i + 1).map_or(usize::MAX, |(_, next)| *next);
            let behind = touches.iter_mut().filter(|t| (*line..until).contains(&t.line));
            let timed = behind.filter_map(|t| t.time_s.take()).count();
            let says = match setup {
                Some(setup) => format!("the log goes on here: the program was started again at set-up {setup}"),
                None if timed == 0 => continue,
                None => "here the program was started again (the line H that says so is lost or damaged)".to_owned(),
            };
            let finding = if timed == 0 {
                Finding::info("log::resumed", says)
            } else {
                let help = "where time matters they follow the last timed one as planned: the pause is not in them";
                let says =
                    format!("{says}, and its clock with it: the times of the {timed} touches behind it are not used");
                Finding::warning("log::resumed", says).help(help)
            };
            findings.push(places.at_line(finding, *line));
        }
    }

    /// The run's touches, out of all of the log.
    pub fn take(&self, mut all: Vec<RawTouch>) -> Vec<RawTouch> {
        if let [only] = &self.touches[..] {
            // the usual log is not copied
            all.truncate(only.end);
            all.drain(..only.start);
            return all;
        }
        self.touches.iter().flat_map(|range| all[range.clone()].iter().cloned()).collect()
    }
}

/// The line of the touch whose time is before that of the touch before it, by more than both are rounded. Lines that were
/// copied, or one that stands in the wrong place, are no second start.
fn clock_begins_again(touches: &[RawTouch], rule: &LogRule) -> Option<usize> {
    let tick_s = 10f64.powi(-i32::try_from(rule.time_decimals.min(rule.decimals)).unwrap_or(0));
    let timed: Vec<(&RawTouch, f64)> = touches.iter().filter_map(|t| Some((t, t.time_s?))).collect();
    let mut last: Option<(Option<u64>, f64)> = None;
    // the times so far by number: most logs need none of it
    let mut seen: Option<BTreeMap<Option<u64>, f64>> = None;
    for (at, (touch, time_s)) in timed.iter().enumerate() {
        if let Some((id, before_s)) = last.filter(|(_, before_s)| *time_s < before_s - 1.01 * tick_s) {
            let known = seen.get_or_insert_with(|| timed[..at].iter().map(|(t, time_s)| (t.id, *time_s)).collect());
            let copied = known.get(&touch.id) == Some(time_s);
            let misplaced = touch.id <= id && timed.get(at + 1).is_none_or(|(_, next_s)| *next_s >= before_s);
            if !copied && !misplaced {
                return Some(touch.line);
            }
            continue;
        }
        if let Some(seen) = &mut seen {
            seen.insert(touch.id, *time_s);
        }
        last = Some((touch.id, *time_s));
    }
    None
}

/// The runs of a log. `may_be_head`: is this line, which is not understood, the head of a run?
pub fn split(touches: &[RawTouch], events: &[Event<'_>], may_be_head: impl Fn(&Line<'_>) -> bool) -> Vec<Run> {
    let mut runs = vec![Run::default()];
    let mut done = 0;
    let mut beginnings = beginnings(touches, events, &may_be_head).into_iter().peekable();
    let mut add = |range: Range<usize>, runs: &mut Vec<Run>| {
        let mut from = range.start;
        while let Some(at) = beginnings.next_if(|at| *at < range.end) {
            add_touches(from..at, touches, runs);
            runs.push(Run::default());
            from = at;
        }
        add_touches(from..range.end, touches, runs);
    };
    for event in events {
        add(done..event.at, &mut runs);
        done = event.at;
        let Some(run) = runs.last_mut() else { continue };
        let number = event.line.number;
        match &event.kind {
            LineKind::Fault
                if run.count() > 0
                    && run.end.is_none()
                    && may_be_head(&event.line)
                    && (is_like_a_head(event.line.bytes) || !goes_on(touches, event.at)) =>
            {
                run.resumed.push((None, number));
            }
            LineKind::Fault => {}
            LineKind::Found(off) => {
                run.found = Some(*off);
                run.last_line = number;
            }
            LineKind::Head(header) => {
                let goes_on = header.setup > 1
                    && run.end.is_none()
                    && run.header.as_ref().is_none_or(|h| {
                        h.digest == header.digest && h.program == header.program && h.unit == header.unit
                    });
                if goes_on && (run.header.is_some() || run.count() > 0) {
                    run.resumed.push((Some(header.setup), number));
                    run.header.get_or_insert_with(|| (**header).clone());
                    run.last_line = number;
                } else {
                    runs.push(Run { header: Some((**header).clone()), last_line: number, ..Run::default() });
                }
            }
            LineKind::End(count) => {
                if run.end.is_none() {
                    run.end = Some((*count, number));
                    run.last_line = number;
                }
            }
        }
    }
    add(done..touches.len(), &mut runs);
    runs.retain(|r| r.header.is_some() || r.count() > 0);
    runs
}

/// Does a line that begins with H go on much as a head does, `H AXISCAL …`?
fn is_like_a_head(line: &[u8]) -> bool {
    let word = line.trim_ascii().get(1..).map_or(&[][..], <[u8]>::trim_ascii_start);
    word.iter().zip(b"AXISCAL").filter(|(a, b)| a.eq_ignore_ascii_case(b)).count() >= 4
}

/// Do the touches go on before this one as if nothing had happened: the next number, and a clock that runs on?
fn goes_on(touches: &[RawTouch], at: usize) -> bool {
    let (Some(before), Some(next)) = (at.checked_sub(1).and_then(|n| touches.get(n)), touches.get(at)) else {
        return true;
    };
    let numbers = before.id.zip(next.id).is_some_and(|(a, b)| b == a + 1);
    numbers && before.time_s.zip(next.time_s).is_none_or(|(a, b)| b >= a)
}

/// Touches with which a run begins whose head is lost or not understood: their numbers start again, and no head says that
/// a set-up was started again.
fn beginnings(touches: &[RawTouch], events: &[Event<'_>], may_be_head: impl Fn(&Line<'_>) -> bool) -> Vec<usize> {
    let mut out = Vec::new();
    let (mut from, mut unread) = (0, Vec::new());
    for event in events {
        match event.kind {
            LineKind::Fault => unread.extend(may_be_head(&event.line).then_some(event.at)),
            // it stands right behind a head
            LineKind::Found(_) => {}
            LineKind::Head(_) | LineKind::End(_) => {
                again(touches, from..event.at, &unread, &mut out);
                from = event.at;
                unread.clear();
            }
        }
    }
    again(touches, from..touches.len(), &unread, &mut out);
    out
}

/// The same between two lines that say where a run begins or ends. `unread`: touches before which a line stands that may be
/// the head of a run.
fn again(touches: &[RawTouch], range: Range<usize>, unread: &[usize], out: &mut Vec<usize>) {
    let mut from = range.start;
    let mut last = None;
    // the touches of this run by number: most runs need none of it
    let mut seen: Option<BTreeMap<u64, usize>> = None;
    for at in range.clone() {
        let Some(id) = touches[at].id else { continue };
        if last.is_none_or(|last| id > last) {
            last = Some(id);
            if let Some(seen) = &mut seen {
                seen.insert(id, at);
            }
            continue;
        }
        let known = seen
            .get_or_insert_with(|| (from..at).filter_map(|i| Some((touches[i].id?, i))).collect::<BTreeMap<_, _>>());
        // a line that was copied brings nothing else; numbers before the first one are of an earlier set-up
        let other = |at: usize| {
            touches.get(at).and_then(|t| t.id).is_some_and(|id| match known.get(&id) {
                Some(before) => touches[*before].differs(&touches[at]),
                None => known.first_key_value().is_some_and(|(first, _)| id < *first),
            })
        };
        let follows = |next: usize| range.contains(&next) && touches[next].id > Some(id) && other(next);
        // one touch alone may stand in the wrong place
        let begins = unread.contains(&at) || (other(at) && follows(at + 1));
        if begins && is_started_again(touches, at, known) {
            // behind a second start in the middle the later touches count
            known.insert(id, at);
            last = Some(id);
        } else if begins {
            out.push(at);
            (from, last, seen) = (at, Some(id), None);
        } else {
            known.insert(id, at);
        }
    }
}

/// Is it the same run, started again at a later set-up, whose head is lost? Not with its first touch, and the clock, where there is
/// one, counts from this start: in another run that has lost its beginning this touch would have come about as late as the first time.
/// `known`: the touches of the run so far, by number.
fn is_started_again(touches: &[RawTouch], at: usize, known: &BTreeMap<u64, usize>) -> bool {
    const AS_LATE: f64 = 0.7;
    let Some(id) = touches[at].id.filter(|id| known.first_key_value().is_some_and(|(first, _)| first < id)) else {
        return false;
    };
    let before = known.range(..=id).next_back().and_then(|(_, i)| touches[*i].time_s);
    before.zip(touches[at].time_s).is_none_or(|(before, now)| now < AS_LATE * before)
}

fn add_touches(range: Range<usize>, touches: &[RawTouch], runs: &mut Vec<Run>) {
    let Some(last) = range.clone().next_back().and_then(|i| touches.get(i)) else { return };
    // touches after an end belong to a run whose head is lost
    if runs.last().is_none_or(|r| r.end.is_some()) {
        runs.push(Run::default());
    }
    if let Some(run) = runs.last_mut() {
        run.last_line = last.line;
        match run.touches.last_mut() {
            Some(before) if before.end == range.start => before.end = range.end,
            _ => run.touches.push(range),
        }
    }
}

/// The run that counts: the one that is asked for, else the last complete one, else the last one that holds a touch;
/// and all of them as they are offered.
///
/// # Errors
/// When there is none of the number that is asked for, or it holds no touch.
pub fn choose(
    runs: Vec<Run>,
    touches: &[RawTouch],
    asked: Option<usize>,
    columns: bool,
    places: &Places<'_>,
    findings: &mut Findings,
) -> Result<Option<(Run, Vec<RunFound>)>, Failure> {
    let index = match asked {
        Some(number) => Some(number.wrapping_sub(1)),
        None => runs.iter().rposition(Run::complete).or_else(|| runs.iter().rposition(|r| r.count() > 0)),
    };
    let found: Vec<RunFound> = runs
        .iter()
        .enumerate()
        .map(|(i, run)| RunFound {
            number: i + 1,
            first_line: run.first_line(touches),
            last_line: run.last_line,
            touches: run.count(),
            complete: run.complete(),
            taken: Some(i) == index,
        })
        .collect();
    let count = runs.len();
    let Some(run) = index.and_then(|i| runs.into_iter().nth(i)) else {
        if let Some(number) = asked.filter(|_| count > 0) {
            let message = format!("there is no run {number}: {} holds {count} of them", places.name());
            return Err(Failure::new("log::no_run", message).help(offer(&found)));
        }
        return Ok(None);
    };
    let first = run.first_line(touches);
    if asked.is_some() && run.count() == 0 {
        let message = format!("run {} holds no touch", index.unwrap_or(0) + 1);
        return Err(places.at_line(Finding::error("log::no_run", message).help(offer(&found)), first).into());
    }
    if count > 1 {
        let number = index.unwrap_or(0) + 1;
        let message = format!("the log holds {count} runs: run {number} is taken, ");
        let finding = match (asked, run.complete()) {
            (Some(_), _) => Finding::info("log::runs", message + "as asked for"),
            (None, true) => Finding::warning("log::runs", message + "the last complete one"),
            (None, false) => Finding::warning("log::runs", message + "the last one; none is complete"),
        };
        findings.push(places.at_line(finding.help(offer(&found)), first));
    }
    if !columns {
        shape(&run, first, places, findings);
    }
    Ok(Some((run, found)))
}

/// The runs, in a line.
fn offer(found: &[RunFound]) -> String {
    const SHOWN: usize = 6;
    let shown: Vec<String> = found.iter().rev().take(SHOWN).rev().map(RunFound::says).collect();
    let before = if found.len() > SHOWN { "… " } else { "" };
    format!("another one is taken with --run N, in a study with run = N: {before}{}", shown.join("; "))
}

/// Is the beginning of the run there, and its end?
fn shape(run: &Run, first: usize, places: &Places<'_>, findings: &mut Findings) {
    match (&run.header, run.end) {
        (_, None) => {
            let of = run.header.as_ref().map(|h| format!(" of {}", h.touches)).unwrap_or_default();
            let message = format!(
                "the log ends after {} touches{of} without the line E of its end: it is cut off, or the program was stopped",
                run.count()
            );
            let finding = Finding::warning("log::truncated", message)
                .help("what is there is used; start the program again at the set-up where it stopped");
            findings.push(places.at_line(finding, run.last_line));
        }
        (Some(header), Some((end, line))) if end != header.touches => {
            let message = format!("the run ends with E N{end}, but began with N{}", header.touches);
            let finding = Finding::warning("log::end_count", message).help("was the log put together from two?");
            findings.push(places.at_line(finding, line));
        }
        (None, Some(_)) => {
            let finding = Finding::warning("log::no_head", "the run has no line H: the head of the log is missing")
                .help("what is there is used; only its positions show whether it belongs to this plan");
            findings.push(places.at_line(finding, first));
        }
        _ => {}
    }
}
