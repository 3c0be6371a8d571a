//! A program finds the spindle turning and the probe switched off: it stops the one before anything moves, and switches the
//! other on before it searches.

use super::is_motion;
use crate::check::explore::ExploredRun;
use crate::check::run::{Event, Happened, SPINDLE_OFF};
use std::ops::Range;

/// The first move, or search, that comes before the spindle stands: switched off, or turned to an angle.
pub(super) fn turns(told: &ExploredRun) -> Option<(Range<usize>, String)> {
    let stands = |h: &Happened| match &h.event {
        Event::Orient(_) => true,
        Event::Other(what) => what == SPINDLE_OFF,
        _ => false,
    };
    let moves = told.trunk.iter().take_while(|h| !stands(h)).find(|h| is_motion(h))?;
    let says = "it moves before it has stopped the spindle (M5, or an angle to which it is turned): a probe that turns breaks at its first contact";
    Some((moves.at.clone(), says.to_owned()))
}

/// Words that switch the probe on or off, as a run tells of them: M functions and calls of macros. `None` where lines of the
/// setting are of another kind.
fn switches(lines: &str) -> Option<Vec<String>> {
    let number = |word: &str, letter: char| word.strip_prefix(letter)?.parse::<f64>().ok();
    let mut out = Vec::new();
    for line in lines.lines().map(str::trim).filter(|l| !l.is_empty()) {
        let mut words = line.split_whitespace();
        if let Some(call) = line.strip_prefix("G65") {
            let program = call.split_whitespace().find_map(|w| number(w, 'P'))?;
            out.push(format!("P{program}"));
            continue;
        }
        if !words.clone().all(|w| number(w, 'M').is_some()) {
            return None;
        }
        out.extend(words.by_ref().filter_map(|w| number(w, 'M')).map(|m| format!("M{m}")));
    }
    Some(out)
}

/// The first search with a probe that the postprocessor file says is to be switched on, and is not.
pub(super) fn searches_dead(told: &ExploredRun, on: &str, off: &str) -> Option<(Range<usize>, String)> {
    let (on, off) = (switches(on)?, switches(off).unwrap_or_default());
    let mut seen = vec![false; on.len()];
    for happened in &told.trunk {
        match &happened.event {
            Event::Other(what) => {
                if let Some(n) = on.iter().position(|word| word == what) {
                    seen[n] = true;
                } else if off.contains(what) {
                    seen.fill(false);
                }
            }
            Event::Probe { .. } => {
                let missing = on.iter().zip(&seen).find(|(_, seen)| !**seen).map(|(word, _)| word)?;
                let says = format!(
                    "it searches before {missing} has switched the probe on (setting probe_on): a dead probe does not stop at the block"
                );
                return Some((happened.at.clone(), says));
            }
            _ => {}
        }
    }
    None
}
