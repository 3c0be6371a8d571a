//! The closed loop of `tests/any_machine` on many draws: counts how they ended, by controller and kind.
//!
//! `cargo run --release --example any_machine 2000 [first seed]`
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a trial is its end

#[path = "../tests/controls/any_machine/draw.rs"]
mod draw;
#[path = "../tests/controls/any_machine/way.rs"]
mod way;

use rayon::prelude::*;
use std::collections::BTreeMap;
use way::{CONTROLLERS, Ended, way};

fn main() {
    let number = |i: usize, default: u64| std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let (draws, first) = (number(1, 2000), number(2, 0));
    let all: Vec<(u64, &str, Ended, &str)> = (first..first + draws)
        .into_par_iter()
        .map(|seed| {
            let controller = CONTROLLERS[usize::try_from(seed).unwrap_or(0) % CONTROLLERS.len()];
            let (ended, chain) = way(seed, controller);
            (seed, controller, ended, chain)
        })
        .collect();
    let mut counts: BTreeMap<(&str, String), usize> = BTreeMap::new();
    for (seed, controller, ended, chain) in &all {
        let kind = match ended {
            Ended::Compensated => "compensated to the noise".to_owned(),
            Ended::Foretold => "what stays was foretold".to_owned(),
            Ended::Refused(code) => format!("refused: {code}"),
            Ended::Wrong(why) => {
                println!("WRONG  draw {seed}, {controller}, {chain}: {why}");
                "wrong".to_owned()
            }
        };
        *counts.entry((controller, kind)).or_default() += 1;
    }
    for ((controller, kind), count) in counts {
        println!("{controller:12} {count:6}  {kind}");
    }
}
