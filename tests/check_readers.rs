//! Readers that share nothing with the crate read the same programs: the positions that they compute must be the plan's.
//!
//! LinuxCNC's own interpreter, `rs274`. Left out with a word where it is not installed; AXISCAL_LINUXCNC=required makes that
//! a failure.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a panic in a test is a failure with its place

use axiscal::machine;
use axiscal::post::Postprocessor;
use axiscal::program::{self, Options};
use axiscal::{axes::AxisName, diag::source};
use std::process::{Command, Stdio};

/// `rs274` prints four decimals.
const PRINTED: f64 = 1e-4;

/// The interpreter believes that each probing move ends this far short of its end, mm: what a move does not name stays there.
const SHORT_MM: f64 = 0.3;

#[test]
fn rs274_drives_every_search_to_the_plans_end() {
    if Command::new("rs274").arg("-h").stdin(Stdio::null()).output().is_err() {
        assert!(
            std::env::var("AXISCAL_LINUXCNC").as_deref() != Ok("required"),
            "rs274 of linuxcnc-uspace is not installed"
        );
        println!("left out: rs274 is not installed");
        return;
    }
    let (machines, _) = machine::load(&source("machines", machine::BUILT_IN)).unwrap();
    let machine = machines.into_iter().find(|m| m.name == "swivel-head").unwrap();
    let (post, _) = Postprocessor::load_built_in_or_file("linuxcnc").unwrap();
    let spec = program::choose(program::built_in().unwrap(), "table", &machine).unwrap();
    let (generated, _) = program::generate(&machine, &spec, &Options::default()).unwrap();
    let text = post.program(&machine, &generated.plan, &generated.path).unwrap().text;

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("p.ngc"), text).unwrap();
    std::fs::write(folder.path().join("p.var"), "").unwrap();
    let run = Command::new("rs274")
        .args(["-g", "-v", "p.var", "p.ngc", "canon.txt"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let canon = std::fs::read_to_string(folder.path().join("canon.txt")).unwrap();
    let ends: Vec<Vec<f64>> = canon
        .lines()
        .filter_map(|l| l.split_once("STRAIGHT_PROBE(")?.1.split_once(')'))
        .map(|(numbers, _)| numbers.split(',').map(|n| n.trim().parse().unwrap()).collect())
        .collect();

    let mut ends = ends.iter();
    for touch in &generated.plan.touches {
        let wanted = touch.end_position();
        let is_there = |end: &&Vec<f64>| {
            AxisName::ALL.into_iter().all(|axis| {
                let off = (end[axis.index()] - wanted.get(axis)).abs();
                let searched = touch.start.get(axis) != touch.end.get(axis);
                off < if searched || axis.is_rotary() { PRINTED } else { SHORT_MM }
            })
        };
        // the search and the measuring touch, in this order after those of the touch before
        assert_eq!(ends.by_ref().filter(is_there).take(2).count(), 2, "touch {} is not made", touch.id);
    }
}
