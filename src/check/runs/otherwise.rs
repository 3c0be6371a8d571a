//! Two runs of one program, from different beginnings: do they do the same?

use crate::axes::{AxisName, Position};
use crate::check::explore::ExploredRun;
use crate::check::run::{Event, Happened, Rate, Start};
use std::fmt::Write;
use std::ops::Range;

/// Where a run from elsewhere, with the control in another state, does otherwise.
pub(super) fn otherwise(one: &ExploredRun, other: &ExploredRun) -> Option<(Range<usize>, String)> {
    let (a, b) = (deeds(one), deeds(other));
    let differs = |x: &Deed, y: &Deed| {
        let apart = |(p, q): (&f64, &f64)| (p - q).abs() > ROUNDING;
        x.says != y.says || x.numbers.len() != y.numbers.len() || x.numbers.iter().zip(&y.numbers).any(apart)
    };
    let first = a.iter().zip(&b).find(|(x, y)| differs(x, y)).map(|(x, _)| x.at.clone());
    let shorter = (a.len() != b.len()).then(|| a.get(b.len()).or(a.last()).map_or(0..0, |x| x.at.clone()));
    let place = first.or(shorter)?;
    let says = match other.start {
        Start::LeftoverMode(what) => format!(
            "with {} left on by the user the program does otherwise: it must take it off, or see it and say so without a move{}",
            what.says(),
            other.fault.as_ref().map_or(String::new(), |fault| format!(" ({})", fault.says))
        ),
        _ => "the program does otherwise when it finds the control in another state (units, G91, offsets, feed mode) or the axes elsewhere: something that it needs is not set in its head".to_owned(),
    };
    Some((place, says))
}

/// What a program computes from offsets that it reads is rounded otherwise when they are others, mm or deg.
const ROUNDING: f64 = 1e-5;

/// What a program does, as far as it must be the same wherever it begins.
struct Deed {
    at: Range<usize>,
    says: String,
    /// Positions, mm or deg; feeds, mm/min.
    numbers: Vec<f64>,
}

fn deeds(told: &ExploredRun) -> Vec<Deed> {
    let all_known = one_known(told);
    let mut out = Vec::new();
    for happened in &told.trunk {
        let (mut says, mut numbers) = (String::new(), Vec::new());
        match &happened.event {
            Event::Move { to, rate, exact, named, .. } => {
                let rate = match rate {
                    Rate::Rapid => "rapid",
                    Rate::Feed(feed) => {
                        numbers.push(*feed);
                        "feed"
                    }
                };
                says = format!("{rate} {exact} {named:?}");
                numbers.extend(AxisName::ALL.into_iter().filter(|a| named[a.index()]).map(|a| to.get(a)));
            }
            Event::Probe { probe, .. } if probe.known != all_known => continue,
            Event::Probe { probe, outcome, .. } => {
                says = format!("probe {} {} {} {}", probe.toward, probe.overridden, probe.alarm.word(), outcome.hit);
                numbers.push(probe.feed);
                numbers.extend(probe.from.0);
                numbers.extend(probe.to.0);
            }
            _ => write_event(&mut says, happened),
        }
        out.push(Deed { at: happened.at.clone(), says, numbers });
    }
    out
}

/// The axes of the machine, all known.
fn one_known(told: &ExploredRun) -> [bool; 6] {
    let known = told.trunk.iter().rev().find_map(|h| match &h.event {
        Event::Probe { probe, .. } => Some(probe.known),
        _ => None,
    });
    known.unwrap_or([true; 6])
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

/// One line for an event.
fn write_event(text: &mut String, happened: &Happened) {
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
