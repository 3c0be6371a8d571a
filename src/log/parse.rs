//! A whole log: which form it has, where its runs begin and end, which of them counts.

use super::finding_places::{Capped, Places};
use super::numbers::Fault;
use super::read_lines::{Event, LineKind, Reader, looks_like_columns};
use super::record::{LogHeader, begin, named};
use super::runs::{self, RunFound};
use super::text_lines::{Line, Lines, is_tape};
use super::touch::RawTouch;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::post::as_written::{EndOfLine, LengthUnit, Role};
use crate::post::{LogRule, Postprocessor, log_word};
use crate::units::mm_from_inch;
use nalgebra::Vector3;
use std::borrow::Cow;

/// What a log holds. Positions are the control's own coordinates, mm and deg: [`super::to_axes`] makes axis positions of them.
#[derive(Debug, Clone, PartialEq)]
pub struct ParsedLog {
    /// The touches of the run that counts, in the order of the log.
    pub touches: Vec<RawTouch>,
    /// The head of that run.
    pub header: Option<LogHeader>,
    /// How far off its place the run found the artefact, mm along X, Y and Z with all rotary axes at 0.
    pub found_mm: Option<Vector3<f64>>,
    /// How the log ends.
    pub ending: Ending,
    /// Lines of that run that are not used.
    pub rejected: Rejected,
    /// The log is nothing but columns: touches carry no number and hits look like misses.
    pub columns: bool,
    /// The rows of one touch, in order, in a log of columns.
    pub per_touch: Vec<Role>,
    /// Each row of a log of columns says whether the probe triggered.
    pub rows_say_status: bool,
    /// The runs that the log holds.
    pub runs: Vec<RunFound>,
}

/// How a log ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// With the line of its end, and it began with the first set-up.
    Line,
    /// With the line of its end, but it began with this later set-up.
    Later(u64),
    /// Without the line of its end.
    CutOff,
    /// A log of this form has no such line: columns, CSV.
    Unmarked,
}

/// Lines that are not used because they are not understood.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rejected {
    /// Touches that such lines name.
    pub ids: Vec<u64>,
    /// There are some that name none.
    pub unnamed: bool,
    /// Numbers of these lines, ascending.
    pub lines: Vec<usize>,
}

/// Reads a log: the last complete run in it.
///
/// Lines that are not understood are findings with line and column; the rest is used.
///
/// # Errors
/// When nothing of it can be used: empty, binary, UTF-16, or without one line that is understood.
pub fn parse(bytes: &[u8], name: &str, post: &Postprocessor) -> Result<(ParsedLog, Findings)> {
    parse_run(bytes, name, post, None)
}

/// No line has as many decimals as the form says.
fn other_decimals(said: usize, found: &[u8]) -> Finding {
    let found = String::from_utf8_lossy(found);
    let message = format!("no row has {said} decimals, as the form of this log says: the first number is {found}");
    Finding::error("log::decimals", message).help(
        "write `decimals` as the log has it into a form of your own; numbers with 4 or 5 decimals are often inches: then unit = \"inch\", too",
    )
}

/// Reads a log: the run of this number, from 1, or the last complete one.
///
/// # Errors
/// As [`parse`], and when there is no such run.
pub fn parse_run(
    bytes: &[u8],
    name: &str,
    post: &Postprocessor,
    asked: Option<usize>,
) -> Result<(ParsedLog, Findings)> {
    let places = Places::new(bytes, name);
    let mut findings = Findings::default();
    let start = sniff(bytes, &places, &mut findings)?;
    let rule = with_its_mark(bytes, &post.log, &places, &mut findings);
    let columns = rule.columns.as_ref().filter(|c| looks_like_columns(&bytes[start..], c));
    let is_columns = columns.is_some();
    let reader = Reader { rule: &rule, columns };
    let read = reader.read(&bytes[start..], start);
    line_ends(bytes, start, read.ends, post, &places, &mut findings);
    let mut faults = Capped::default();
    for event in read.events.iter().filter(|e| matches!(e.kind, LineKind::Fault)) {
        faults.push(|| match reader.line(&event.line) {
            Err(fault) if event.line.ended() => {
                let at = event.line.start + fault.at;
                let finding = Finding::warning(fault.code, format!("{}; the line is not used", fault.message));
                places.at(finding, at..at + fault.length)
            }
            Err(fault) => cut(&places, &event.line, &fault),
            // only lines that are not understood are noted as such
            Ok(_) => Finding::warning("log::not_understood", "the line is not used"),
        });
    }
    let n_faults = faults.len();
    // one mistake of a form that a user wrote, not one of each row
    if is_columns && read.touches.is_empty() && n_faults > 0 {
        let of_line = |e: &Event| reader.line(&e.line).err().map(|fault| (e.line.start, fault));
        let each: Vec<_> =
            read.events.iter().filter(|e| matches!(e.kind, LineKind::Fault)).filter_map(of_line).collect();
        if let Some((start, first)) = each.first().filter(|_| each.iter().all(|(_, f)| f.code == "log::decimals")) {
            let at = start + first.at;
            return Err(places
                .at(other_decimals(rule.decimals, &bytes[at..at + first.length]), at..at + first.length)
                .into());
        }
    }
    if let Some(columns) = columns.filter(|c| !c.prefix.is_empty()) {
        let others = read.lines.saturating_sub(read.touches.len() + n_faults);
        if others > 0 {
            let message = format!("{others} of {} lines do not hold {:?} and are not read", read.lines, columns.prefix);
            findings.push(
                Finding::info("log::other_lines", message).help("prefix in [log.columns] says which lines are rows"),
            );
        }
    }
    findings.0.extend(faults.drain("lines that are not understood", "log::not_understood"));
    glued(bytes, start, &read.events, &places, &mut findings);
    let runs = runs::split(&read.touches, &read.events, |line| reader.may_be_head(line));
    let units: Vec<LengthUnit> =
        runs.iter().filter_map(|r| r.header.as_ref()).filter(|h| h.says_unit).map(|h| h.unit).collect();
    let heads = runs.iter().filter_map(|r| r.header.as_ref()).filter(|h| !h.written_together);
    let heads: Vec<String> = heads.map(|h| h.controller.clone()).collect();
    let chosen = runs::choose(runs, &read.touches, asked, is_columns, &places, &mut findings)
        .map_err(|f| Failure([std::mem::take(&mut findings.0), f.0].concat()))?
        .filter(|(run, _)| run.has_touches());
    let Some((run, found)) = chosen else {
        let message = format!("no touch in the log; {n_faults} of its lines are not understood");
        let other = heads.iter().find(|c| **c != log_word(&post.name));
        let help = match other {
            Some(other) => format!("its head says that {other} wrote it: read it with that controller's file"),
            None => "is this the log that the probing program wrote? is it of this controller?".to_owned(),
        };
        findings.push(places.at_line(Finding::error("log::nothing", message).help(help), 1));
        return Err(Failure(findings.0));
    };
    let ending = match (&run.header, &run.end) {
        _ if is_columns => Ending::Unmarked,
        (_, None) => Ending::CutOff,
        (Some(header), Some(_)) if header.setup > 1 => Ending::Later(header.setup),
        _ => Ending::Line,
    };
    let first = run.header.as_ref().map_or(0, |h| h.line);
    let last = run.end.map_or(usize::MAX, |(_, line)| line);
    let lost =
        read.events.iter().filter(|e| matches!(e.kind, LineKind::Fault) && (first..=last).contains(&e.line.number));
    let lost: Vec<(usize, Option<u64>)> =
        lost.filter(|e| reader.may_be_touch(&e.line)).map(|e| (e.line.number, named(e.line.bytes, &rule))).collect();
    let unnamed = lost.iter().any(|(_, id)| id.is_none());
    let lines = lost.iter().map(|(line, _)| *line).collect();
    let rejected = Rejected { ids: lost.into_iter().filter_map(|(_, id)| id).collect(), unnamed, lines };
    let mut touches = run.take(read.touches);
    run.say_resumed(&mut touches, &rule, &places, &mut findings);
    if let Some(header) = &run.header {
        if !header.written_together {
            other_controller(header, post, &places, &mut findings);
        }
        if !header.says_unit {
            let message = "the head does not say what X, Y and Z are in, MM or INCH: they are taken as mm";
            let help = "heads of logs of older versions do not say it; where the program was in inches, write INCH behind the digest of the plan (the twelve digits)";
            findings.push(places.at_line(Finding::warning("log::unit", message).help(help), header.line));
        }
    }
    let unit = match &run.header {
        _ if is_columns => columns.map(|c| c.unit).unwrap_or_default(),
        Some(header) => header.unit,
        // a head that is lost said what the others say, or what the postprocessor file lets the program write
        None => units.first().filter(|u| units.iter().all(|v| v == *u)).copied().unwrap_or(post.log.unit),
    };
    if unit == LengthUnit::Inch {
        touches.iter_mut().for_each(|t| t.position = t.position.with_xyz_mm(t.position.xyz_mm().map(mm_from_inch)));
    }
    let off = run.found.map(Vector3::from);
    let found_mm = if unit == LengthUnit::Inch { off.map(|off| off.map(mm_from_inch)) } else { off };
    let per_touch = columns.map(|c| c.per_touch.clone()).unwrap_or_default();
    let rows_say_status = columns.is_some_and(|c| !c.status.is_empty());
    findings.finish(ParsedLog {
        touches,
        header: run.header,
        found_mm,
        ending,
        rejected,
        columns: is_columns,
        per_touch,
        rows_say_status,
        runs: found,
    })
}

/// Heads in the middle of a line.
fn glued(bytes: &[u8], start: usize, events: &[Event<'_>], places: &Places<'_>, findings: &mut Findings) {
    let in_line = |e: &&Event<'_>| {
        let before = e.line.start.checked_sub(1).filter(|_| e.line.start > start).and_then(|at| bytes.get(at));
        !matches!(before, None | Some(b'\n' | b'\r'))
    };
    let mut found = Capped::few();
    for event in events.iter().filter(|e| !matches!(e.kind, LineKind::End(_))).filter(in_line) {
        found.push(|| {
            let finding = Finding::warning("log::line_end_lost", "a run begins in the middle of a line")
                .help("were two logs put together? the line end between them is lost; they are read as two runs");
            places.at(finding, event.line.start..event.line.start + event.line.bytes.len())
        });
    }
    findings.0.extend(found.drain("runs that begin in the middle of a line", "log::line_end_lost"));
}

/// The log was written by another controller than the one that is named.
pub(super) fn other_controller(header: &LogHeader, post: &Postprocessor, places: &Places<'_>, findings: &mut Findings) {
    if header.controller != log_word(&post.name) {
        let message =
            format!("the head says that {} wrote this log, it is read as one of {}", header.controller, post.name);
        let finding = Finding::warning("log::other_controller", message)
            .help("positions mean the same on all of them; spelling and rounding may differ");
        findings.push(places.at_line(finding, header.line));
    }
}

/// The rule with the decimal mark that the log has, where a setting of the control chooses between the two.
fn with_its_mark<'r>(
    bytes: &[u8],
    rule: &'r LogRule,
    places: &Places<'_>,
    findings: &mut Findings,
) -> Cow<'r, LogRule> {
    let Some(other) = rule.other_mark else { return Cow::Borrowed(rule) };
    let has = |mark: u8| {
        let touch = |l: &Line<'_>| begin(l.bytes, rule).first() == Some(&b'P');
        Lines::new(bytes, 0)
            .filter(touch)
            .take(16)
            .find_map(|l| l.bytes.iter().position(|b| *b == mark).map(|i| l.start + i))
    };
    match (has(rule.mark), has(other)) {
        (None, Some(at)) => {
            let message = format!("the numbers of this log have the decimal mark '{}'", other as char);
            let finding = Finding::info("log::other_decimal_mark", message)
                .help("a setting of the control chooses it; the log is read with it");
            findings.push(places.at(finding, at..at + 1));
            Cow::Owned(LogRule { mark: other, other_mark: Some(rule.mark), ..rule.clone() })
        }
        _ => Cow::Borrowed(rule),
    }
}

/// A last line without an end: what cut the log cut it too.
fn cut(places: &Places<'_>, line: &Line<'_>, fault: &Fault) -> Finding {
    let at = line.start + fault.at;
    let message = format!("the log is cut off in line {}: {}; the line is not used", line.number, fault.message);
    places.at(Finding::warning("log::cut_line", message), at..at + fault.length)
}

/// Refuses what is no text; gives the offset where the text begins.
pub(super) fn sniff(bytes: &[u8], places: &Places<'_>, findings: &mut Findings) -> Result<usize> {
    let name = places.name();
    if bytes.iter().all(|b| b.is_ascii_whitespace() || is_tape(*b)) {
        return Err(Failure::new("log::empty", format!("{name}:1:1: the log is empty"))
            .help("did the program run to its end, and is this the file that the control wrote?"));
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(Failure::new("log::utf16", format!("{name}:1:1: the log is UTF-16 text, expected plain ASCII"))
            .help("an editor has saved it like this: take the file that the control wrote, or save it as UTF-8"));
    }
    let head = &bytes[..bytes.len().min(4096)];
    // what a punch writes around lines is no sign of a binary file
    let odd = |b: &u8| *b == 0 || *b >= 0x80 || (*b < b' ' && !matches!(*b, b'\n' | b'\r' | b'\t'));
    let line = |l: Line<'_>| -> usize {
        super::text_lines::without_leader(super::text_lines::without_trailer(l.bytes)).iter().filter(|b| odd(b)).count()
    };
    let count: usize = Lines::new(head, 0).map(line).sum();
    if count * 10 > head.len() {
        let at = head.iter().position(odd).unwrap_or(0);
        let finding = Finding::error("log::binary", format!("byte {} is no text: this is a binary file", at + 1))
            .help("take the log that the probing program wrote, unpacked");
        return Err(places.at(finding, at..at + 1).into());
    }
    if bytes.starts_with(b"\xef\xbb\xbf") {
        let finding =
            Finding::info("log::byte_order_mark", "the log begins with a byte order mark: an editor has saved it")
                .help("it is read all the same");
        findings.push(places.at(finding, 0..3));
        return Ok(3);
    }
    Ok(0)
}

/// Says so when lines end otherwise than this controller ends them.
fn line_ends(
    bytes: &[u8],
    start: usize,
    ends: [bool; 3],
    post: &Postprocessor,
    places: &Places<'_>,
    findings: &mut Findings,
) {
    let all = [EndOfLine::Lf, EndOfLine::Crlf, EndOfLine::Cr];
    let strange = |end: EndOfLine| ends[end as usize] && !post.log.end_of_line.contains(&end);
    let Some(found) = all.into_iter().find(|e| strange(*e)) else { return };
    let Some(line) = Lines::new(&bytes[start..], start).find(|l| l.end == Some(found)) else { return };
    let some = if ends.iter().filter(|e| **e).count() > 1 { "some" } else { "the" };
    let at = line.start + line.bytes.len();
    let message = format!("{some} lines end with {}; {} writes others", found.says(), post.name);
    let finding = Finding::warning("log::line_ends", message)
        .help("they are read all the same; was the log opened in an editor? prefer the file as the control wrote it");
    findings.push(places.at(finding, at..at + 1));
}
