//! A program finds the spindle turning: it stops it before anything moves.

use super::is_motion;
use crate::check::explore::Told;
use crate::check::run::{Event, Happened, SPINDLE_OFF};
use std::ops::Range;

/// The first move, or search, that comes before the spindle stands: switched off, or turned to an angle.
pub(super) fn turns(told: &Told) -> Option<(Range<usize>, String)> {
    let stands = |h: &Happened| match &h.event {
        Event::Orient(_) => true,
        Event::Other(what) => what == SPINDLE_OFF,
        _ => false,
    };
    let moves = told.trunk.iter().take_while(|h| !stands(h)).find(|h| is_motion(h))?;
    let says = "it moves before it has stopped the spindle (M5, or an angle to which it is turned): a probe that turns breaks at its first contact";
    Some((moves.at.clone(), says.to_owned()))
}
