//! Thousands of random edits of a program for each control: how many are not read, refused by what they do, refused only
//! because its statements are others, how many move identically, how many pass with a remark, and whether one escaped.
//!
//! `cargo run --release --example edits -- [COUNT] [--same] [--text] [CONTROLLER …]`; `--same` lists those that move
//! identically, `--text` prints the program itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // an example ends with what went wrong
#![allow(dead_code)] // it uses a part of what the tests use

#[path = "../tests/controls/edits.rs"]
mod edits;

use edits::{Fate, original};

fn main() {
    let mut words = std::env::args().skip(1);
    let count: u64 = words.next().and_then(|w| w.parse().ok()).unwrap_or(2000);
    let (options, named): (Vec<String>, Vec<String>) = words.partition(|w| w.starts_with("--"));
    let all = ["linuxcnc", "fanuc", "haas", "sinumerik", "heidenhain", "fanuc-inspection-plus", "haas-inspection-plus"];
    let controllers = if named.is_empty() { all.map(str::to_owned).to_vec() } else { named };
    println!(
        "| controller | edits | not read | refused by what it does | refused as changed only | moves identically | passes with a remark | escaped | s |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for controller in &controllers {
        let original = original(controller, None);
        let begun = std::time::Instant::now();
        let fates = original.fates(count, 7);
        let number = |fate: Fate| fates.iter().filter(|(_, f)| *f == fate).count();
        println!(
            "| {controller} | {count} | {} | {} | {} | {} | {} | {} | {:.0} |",
            number(Fate::NotRead),
            number(Fate::Refused),
            number(Fate::Unproven),
            number(Fate::Same),
            number(Fate::Remarked),
            number(Fate::Escaped),
            begun.elapsed().as_secs_f64()
        );
        if options.iter().any(|o| o == "--text") {
            println!("{}", original.text);
        }
        if options.iter().any(|o| o == "--same") {
            fates.iter().filter(|(_, f)| *f == Fate::Same).for_each(|(what, _)| println!("the same: {what}"));
        }
        for (what, _) in fates.iter().filter(|(_, f)| *f == Fate::Escaped) {
            println!("escaped: {what}");
        }
    }
}
