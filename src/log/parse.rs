//! A whole log: which form it has, where its runs begin and end, which of them counts.

use super::lines::{Line, LineEnds, Lines, blanks};
use super::place::{Capped, Places};
use super::record::{LogHeader, Record, named, record, row};
use super::touch::RawTouch;
use super::words::Fault;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::post::Postprocessor;
use crate::post::as_written::{EndOfLine, Role};

/// What a log holds. Positions are the control's own coordinates: [`super::to_axes`] makes axis positions of them.
#[derive(Debug, Clone, PartialEq)]
pub struct ParsedLog {
    /// The touches of the run that counts, in the order of the log.
    pub touches: Vec<RawTouch>,
    /// The head of that run.
    pub header: Option<LogHeader>,
    /// How the log ends.
    pub ending: Ending,
    /// Lines of that run that are not used.
    pub rejected: Rejected,
    /// The log is nothing but columns: touches carry no number and hits look like misses.
    pub columns: bool,
    /// The rows of one touch, in order, in a log of columns.
    pub per_touch: Vec<Role>,
    /// How many runs the log holds.
    pub runs: usize,
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
}

/// One run in a log.
#[derive(Debug, Default)]
struct Run {
    header: Option<LogHeader>,
    touches: Vec<RawTouch>,
    end: Option<(u64, usize)>,
    last_line: usize,
}

/// Reads a log.
///
/// Lines that are not understood are findings with line and column; the rest is used.
///
/// # Errors
/// When nothing of it can be used: empty, binary, UTF-16, or without one line that is understood.
pub fn parse(bytes: &[u8], name: &str, post: &Postprocessor) -> Result<(ParsedLog, Findings)> {
    let places = Places::new(bytes, name);
    let mut findings = Findings::default();
    let start = sniff(bytes, &places, &mut findings)?;
    let lines = Lines::new(&bytes[start..], start);
    line_ends(&lines, post, &places, &mut findings);
    let is_columns = post.log.columns.is_some() && looks_like_columns(lines.clone());
    let mut faults = Capped::default();
    let mut runs = vec![Run::default()];
    let mut rejected: Vec<(Option<u64>, usize)> = Vec::new();
    for line in lines {
        let outcome = match post.log.columns.as_ref().filter(|_| is_columns) {
            Some(columns) => {
                row(line.bytes, line.number, columns, &post.log).map(|r| r.map_or(Record::Blank, Record::Touch))
            }
            None => record(line.bytes, line.number, &post.log),
        };
        let unusable = match &outcome {
            Ok(Record::Touch(_)) => !line.ended && (is_columns || post.log.check_word.is_none()),
            Ok(_) => false,
            Err(_) => is_columns || blanks(line.bytes).first().is_some_and(|b| b.eq_ignore_ascii_case(&b'P')),
        };
        if unusable {
            rejected.push((named(line.bytes), line.number));
        }
        match outcome {
            // without a check word a number that was cut may look whole
            Ok(Record::Touch(_)) if !line.ended && (is_columns || post.log.check_word.is_none()) => {
                faults.push(|| {
                    cut(
                        &places,
                        &line,
                        &Fault::at(
                            line.bytes,
                            line.bytes,
                            line.bytes.len(),
                            "log::cut_line",
                            "the last line has no end",
                        ),
                    )
                });
            }
            Ok(record) => take(record, &line, &mut runs),
            Err(fault) if !line.ended => faults.push(|| cut(&places, &line, &fault)),
            Err(fault) => faults.push(|| {
                let at = line.start + fault.at;
                let finding = Finding::warning(fault.code, format!("{}; the line is not used", fault.message));
                places.at(finding, at..at + fault.length)
            }),
        }
    }
    let fault_count = faults.len();
    findings.0.extend(faults.drain("lines that are not understood", "log::not_understood"));
    let count = runs.iter().filter(|r| r.header.is_some() || !r.touches.is_empty()).count();
    let Some(run) = choose(runs, is_columns, &places, &mut findings) else {
        let message = format!("no touch in the log; {fault_count} of its lines are not understood");
        let finding = Finding::error("log::nothing", message)
            .help("is this the log that the probing program wrote? is it of this controller?");
        findings.push(places.at_line(finding, 1));
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
    rejected.retain(|(_, line)| (first..=last).contains(line));
    let unnamed = rejected.iter().any(|(id, _)| id.is_none());
    let rejected = Rejected { ids: rejected.into_iter().filter_map(|(id, _)| id).collect(), unnamed };
    let per_touch = post.log.columns.as_ref().map(|c| c.per_touch.clone()).unwrap_or_default();
    let parsed = ParsedLog {
        touches: run.touches,
        header: run.header,
        ending,
        rejected,
        columns: is_columns,
        per_touch,
        runs: count,
    };
    findings.finish(parsed)
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
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(Failure::new("log::empty", format!("{name}:1:1: the log is empty"))
            .help("did the program run, and is the log closed? LinuxCNC writes it beside its INI file"));
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(Failure::new("log::utf16", format!("{name}:1:1: the log is UTF-16 text, expected plain ASCII"))
            .help("an editor has saved it like this: take the file that the control wrote, or save it as UTF-8"));
    }
    let head = &bytes[..bytes.len().min(4096)];
    let odd = |b: &u8| *b == 0 || *b >= 0x80 || (*b < b' ' && !matches!(*b, b'\n' | b'\r' | b'\t'));
    let count = head.iter().filter(|b| odd(b)).count();
    if head.contains(&0) || count * 10 > head.len() {
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

/// Says so when the lines end otherwise than this controller ends them.
fn line_ends(lines: &Lines<'_>, post: &Postprocessor, places: &Places<'_>, findings: &mut Findings) {
    let Some(first) = lines.clone().find(|l| l.ended) else { return };
    let (found, says) = match (lines.ends(), first.crlf) {
        (LineEnds::Cr, _) => (EndOfLine::Cr, "CR alone"),
        (LineEnds::Lf, true) => (EndOfLine::Crlf, "CR LF, as Windows writes them"),
        (LineEnds::Lf, false) => (EndOfLine::Lf, "LF"),
    };
    if !post.log.end_of_line.contains(&found) {
        let at = first.start + first.bytes.len();
        let finding =
            Finding::warning("log::line_ends", format!("the lines end with {says}; {} writes others", post.name)).help(
                "they are read all the same; was the log opened in an editor? prefer the file as the control wrote it",
            );
        findings.push(places.at(finding, at..at + 1));
    }
}

/// A log of columns begins with numbers and holds no line of words near its beginning.
fn looks_like_columns(lines: Lines<'_>) -> bool {
    let firsts = lines.map(|l| blanks(l.bytes)).filter_map(|l| l.first().copied()).take(64);
    let mut numbers = 0;
    for first in firsts {
        match first {
            b'P' | b'H' | b'E' => return false,
            b'0'..=b'9' | b'-' | b'+' | b'.' | b',' => numbers += 1,
            _ => {}
        }
    }
    numbers > 0
}

fn take(record: Record, line: &Line<'_>, runs: &mut Vec<Run>) {
    let Some(run) = runs.last_mut() else { return };
    match record {
        Record::Blank => {}
        Record::Touch(touch) => {
            // touches after an end belong to a run whose head is lost
            if run.end.is_some() {
                runs.push(Run { touches: vec![touch], last_line: line.number, ..Run::default() });
            } else {
                run.touches.push(touch);
                run.last_line = line.number;
            }
        }
        Record::Head(header) => {
            let goes_on = header.setup > 1
                && run.end.is_none()
                && run.header.as_ref().is_none_or(|h| h.digest == header.digest && h.program == header.program);
            if goes_on && (run.header.is_some() || !run.touches.is_empty()) {
                run.header.get_or_insert(header);
                run.last_line = line.number;
            } else {
                runs.push(Run { header: Some(header), last_line: line.number, ..Run::default() });
            }
        }
        Record::End(count) => {
            if run.end.is_none() {
                run.end = Some((count, line.number));
                run.last_line = line.number;
            }
        }
    }
}

/// The run that counts: the last complete one, else the last one that holds a touch.
fn choose(runs: Vec<Run>, columns: bool, places: &Places<'_>, findings: &mut Findings) -> Option<Run> {
    let runs: Vec<Run> = runs.into_iter().filter(|r| r.header.is_some() || !r.touches.is_empty()).collect();
    let count = runs.len();
    let whole = |r: &Run| r.end.is_some() && !r.touches.is_empty() && r.header.as_ref().is_none_or(|h| h.setup <= 1);
    let index = runs.iter().rposition(whole).or_else(|| runs.iter().rposition(|r| !r.touches.is_empty()))?;
    let run = runs.into_iter().nth(index)?;
    let first = run.header.as_ref().map(|h| h.line).or_else(|| run.touches.first().map(|t| t.line)).unwrap_or(1);
    if count > 1 {
        let kind = if run.end.is_some() { "the last complete one" } else { "the last one; none is complete" };
        let message = format!("the log holds {count} runs: run {} is taken, {kind}", index + 1);
        let finding = Finding::warning("log::runs", message)
            .help("to use another one, cut the log: a run begins with a line H and ends with a line E");
        findings.push(places.at_line(finding, first));
    }
    if columns {
        return Some(run);
    }
    let last = run.last_line;
    match (&run.header, run.end) {
        (_, None) => {
            let of = run.header.as_ref().map(|h| format!(" of {}", h.touches)).unwrap_or_default();
            let message = format!(
                "the log ends after {} touches{of} without the line E of its end: it is cut off, or the program was stopped",
                run.touches.len()
            );
            let finding = Finding::warning("log::truncated", message)
                .help("what is there is used; start the program again at the set-up where it stopped");
            findings.push(places.at_line(finding, last));
        }
        (Some(header), Some((end, line))) if end != header.touches => {
            let message = format!("the run ends with E N{end}, but began with N{}", header.touches);
            let finding = Finding::warning("log::end_count", message).help("was the log put together from two?");
            findings.push(places.at_line(finding, line));
        }
        (None, Some(_)) => {
            let finding = Finding::warning("log::no_head", "the run has no line H: the head of the log is missing")
                .help("what is there is used; whether it belongs to this plan can only be told by its positions");
            findings.push(places.at_line(finding, first));
        }
        _ => {}
    }
    Some(run)
}
