//! Two runs of one program, from different beginnings: do they do the same?

use crate::axes::AxisName;
use crate::check::explore::ExploredRun;
use crate::check::run::{Event, Rate, Start};
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
            // where a cycle goes back by itself is a part of the search before it
            Event::Release { from, to } => {
                says.push_str("release");
                numbers.extend(from.0.into_iter().chain(to.0));
            }
            other => says = format!("{other:?}"),
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
