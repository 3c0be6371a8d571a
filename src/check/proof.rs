//! What a program does, as a text and as a digest: two programs with one digest move identically
//! in every run that is tried. That they do so whatever happens their statements show ([`super::statements`]).
//!
//! "Identically" means: in the run from the beginning, whatever state it finds the control in, and in the runs from each
//! set-up, the same moves in the same order (targets to 0.001 µm, rapid or feed, stopping at contact or not), the same lines in
//! the same logs, the same messages, stops, orientations and other functions; and the same, from each probing move on, when the
//! probe triggers early, late, not at all, does not close again, or when the block stands off; and the same settings left to
//! the user each time.

use super::explore::{Branch, ExploredRun};
use super::run::{Event, Happened, Rate};
use crate::axes::Position;
use crate::program::plan::Proof;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// The proof of a program: its runs one by one, and its statements ([`super::statements`]).
#[derive(Default)]
pub struct Proving {
    all: Sha256,
    lines: Vec<String>,
    runs: usize,
}

impl Proving {
    /// The next run; the first one is that of the whole program.
    pub fn add(&mut self, told: &ExploredRun) {
        let Self { all, lines, runs: n } = self;
        let mut text = String::new();
        // writing into a String cannot fail
        let _ = writeln!(text, "run {n} from {}", told.from);
        let mut branches = told.branches.iter().peekable();
        for (place, happened) in told.trunk.iter().enumerate() {
            while let Some(branch) = branches.next_if(|b| b.leaves <= place) {
                write_branch(&mut text, branch);
            }
            write_event(&mut text, happened);
            if *n == 0 && matches!(happened.event, Event::Log(_)) {
                lines.push(hex(&Sha256::digest(text.as_bytes()))[..8].to_owned());
                all.update(text.as_bytes());
                text.clear();
            }
        }
        branches.for_each(|b| write_branch(&mut text, b));
        let _ = writeln!(
            text,
            "settings {:?} aborted {:?} fault {:?}",
            told.settings,
            told.aborted,
            told.fault.as_ref().map(|f| &f.says)
        );
        all.update(text.as_bytes());
        *n += 1;
    }

    /// All runs were told.
    pub fn finish(self, (statements_sha256, statements): (String, Vec<String>)) -> Proof {
        Proof { sha256: hex(&self.all.finalize()), lines: self.lines, statements_sha256, statements }
    }
}

/// The line of the log (from 0) up to which another program still does the same.
pub fn same_lines(one: &Proof, other: &Proof) -> usize {
    one.lines.iter().zip(&other.lines).take_while(|(a, b)| a == b).count()
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut hex, byte| {
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// In whole thousandths of a µm or µdeg: much faster to write than decimals, and there is no minus zero.
fn place(text: &mut String, at: &Position) {
    for x in at.0 {
        text.push(' ');
        whole(text, x);
    }
}

fn whole(text: &mut String, x: f64) {
    let _ = write!(text, "{}", (x * 1e6).round() as i64);
}

fn write_branch(text: &mut String, branch: &Branch) {
    let fault = branch.fault.as_ref().map(|f| f.says.as_str());
    let _ = writeln!(
        text,
        "branch {:?} over {} fault {fault:?} settings {:?}",
        branch.deviation, branch.over, branch.settings
    );
    branch.trace.iter().for_each(|h| write_event(text, h));
}

/// One line for an event.
pub fn write_event(text: &mut String, happened: &Happened) {
    let _ = match &happened.event {
        // an axis that is sent where it stands does not move, but it is known from then on
        Event::Move { to, rate, exact, named, .. } => {
            text.push_str("move");
            place(text, to);
            match rate {
                Rate::Rapid => text.push_str(" rapid"),
                Rate::Feed(feed) => {
                    text.push_str(" F");
                    whole(text, *feed);
                }
            }
            writeln!(text, " {exact} {named:?}")
        }
        Event::Probe { probe, outcome, .. } => {
            text.push_str("probe");
            place(text, &probe.from);
            text.push_str(" to");
            place(text, &probe.to);
            text.push_str(" F");
            whole(text, probe.feed);
            // part of the way: to a thousand-millionth
            let part = (outcome.part * 1e9).round() as i64;
            writeln!(text, " {} {} {} {} {part}", probe.toward, probe.overridden, probe.alarm.word(), outcome.hit)
        }
        Event::Release { from, to } => {
            text.push_str("release");
            place(text, from);
            text.push_str(" to");
            place(text, to);
            writeln!(text)
        }
        other => writeln!(text, "{other:?}"),
    };
}
