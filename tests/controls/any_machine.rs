//! A closed loop on machines that nobody wrote: for every controller, what is exported makes a random machine right at
//! points that were not measured, or what stays was foretold, or nothing is exported, with the reason.
//!
//! `cargo run --release --example any_machine 2000` makes more draws.

mod draw;
mod way;

use rayon::prelude::*;
use way::{CONTROLLERS, Ended, way};

/// Draws of this run.
const DRAWS: u64 = 40;

#[test]
fn a_compensation_is_right_on_any_machine() {
    let all: Vec<(u64, &str, Ended, &str)> = (0..DRAWS)
        .into_par_iter()
        .map(|seed| {
            let controller = CONTROLLERS[usize::try_from(seed).unwrap() % CONTROLLERS.len()];
            let (ended, chain) = way(seed, controller);
            (seed, controller, ended, chain)
        })
        .collect();
    let wrong: Vec<String> = all
        .iter()
        .filter_map(|(seed, controller, ended, chain)| match ended {
            Ended::Wrong(why) => Some(format!("draw {seed}, {controller}, {chain}: {why}")),
            _ => None,
        })
        .collect();
    assert!(wrong.is_empty(), "{} of {DRAWS} draws:\n{}", wrong.len(), wrong.join("\n"));
    // a test in which everything is refused or excused would prove nothing: where the control holds every location error, what
    // is left is noise unless the touches could not part some of them
    let of = |holds: &[&str], kind: fn(&Ended) -> bool| {
        all.iter().filter(|(_, controller, ended, _)| holds.contains(controller) && kind(ended)).count()
    };
    let holding = ["linuxcnc", "sinumerik"];
    let (compensated, tried) = (of(&holding, |e| *e == Ended::Compensated), of(&holding, |_| true));
    assert!(compensated * 2 >= tried, "only {compensated} of {tried} draws were compensated to the noise: {all:?}");
    let refused = of(&CONTROLLERS, |e| matches!(e, Ended::Refused(_)));
    assert!(refused * 3 <= all.len(), "{refused} of {DRAWS} draws were refused: {all:?}");
}
