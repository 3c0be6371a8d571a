//! Whole runs: blocks that stand elsewhere, misses, edges, pre-travel, noise.

use super::*;
use crate::units::{mm_from_um, rad_from_deg};

fn top_plan(n: usize) -> (Machine, Plan) {
    let machine = machine_named("swivel-head");
    let mut plan = empty_plan(&machine, "table");
    for i in 0..n {
        let at = pose(&[(AxisName::B, 0.0), (AxisName::C, 90.0 * (i / 10 % 4) as f64)]);
        add_touch(&mut plan, &machine, "x+", [31.0, 1.0, -197.684], [0.0, 0.0, 1.0], at);
    }
    (machine, plan)
}

#[test]
fn a_displaced_block_is_met_where_its_plane_is() {
    let machine = machine_named("swivel-head");
    let (shift, tilt) = ([0.1, -0.2, 0.05], [0.05, -0.03, 0.1].map(rad_from_deg));
    let scenario = Scenario::flawless().with_block("table", "x+", shift, tilt);
    let mut plan = empty_plan(&machine, "table");
    let point = [35.0, 2.0, -201.0];
    add_touch(&mut plan, &machine, "x+", point, [1.0, 0.0, 0.0], pose(&[(AxisName::B, 0.0), (AxisName::C, 0.0)]));
    let e = readings(&machine, &plan, &scenario, None)[0];
    // plane of the real face: n' = Rz·Ry·Rx·x through centre + shift + 5·n'; the ball's centre moves along -x
    let ((sb, cb), (sg, cg)) = (tilt[1].sin_cos(), tilt[2].sin_cos());
    let n = [cg * cb, sg * cb, -sb];
    let foot = plus(plus([30.0, 0.0, -202.684], 1.0, shift), 5.0, n);
    let ball = plus(point, 3.0, [1.0, 0.0, 0.0]);
    let expected = (3.0 - dot(n, minus(ball, foot))) / n[0];
    close(e, expected, 1e-12);
}

#[test]
fn a_ball_that_misses_says_so_and_stops_at_the_end() {
    let (machine, plan) = top_plan(1);
    for (shift, status, at_start) in
        [(-2.5, Status::Miss, false), (-1.5, Status::Hit, false), (2.5, Status::Miss, true)]
    {
        let scenario = Scenario::flawless().with_block("table", "x+", [0.0, 0.0, shift], [0.0; 3]);
        let (raw, findings) = run(&machine, &plan, &scenario, None).unwrap();
        assert_eq!(raw[0].status, status);
        assert_eq!(findings.0.len(), usize::from(status == Status::Miss));
        if status == Status::Miss {
            let touch = &plan.touches[0];
            assert_eq!(raw[0].position, if at_start { touch.start_position() } else { touch.end_position() });
            assert_eq!(findings.0[0].code, if at_start { "simulate::already" } else { "simulate::missed" });
        }
    }
}

#[test]
fn an_edge_is_met_as_an_edge() {
    let (machine, plan) = top_plan(1);
    // the ball comes down at x = 31: with the block's upper edge at 30.5 it meets the edge half a millimetre beside
    let scenario = Scenario::flawless().with_block("table", "x+", [-4.5, 0.0, 0.0], [0.0; 3]);
    let (raw, findings) = run(&machine, &plan, &scenario, None).unwrap();
    let e = reading(&plan, &raw[0]);
    close(e, (9.0_f64 - 0.25).sqrt() - 3.0, 1e-12);
    assert_eq!(findings.0[0].code, "simulate::edge");
}

#[test]
fn pretravel_makes_every_touch_late_by_itself() {
    let (machine, plan) = top_plan(3);
    let scenario = Scenario::flawless().with(&machine, "pretravel", &[("pretravel", 0.005)]).unwrap();
    for e in readings(&machine, &plan, &scenario, None) {
        close(e, -0.005, 1e-12);
    }
}

#[test]
fn noise_has_its_size_and_its_seed() {
    let (machine, plan) = top_plan(4000);
    let noisy = |seed| Scenario::flawless().with_noise(mm_from_um(1.0), 0.0, seed);
    let e = readings(&machine, &plan, &noisy(7), None);
    let sigma = (e.iter().map(|x| x * x).sum::<f64>() / e.len() as f64).sqrt();
    close(sigma, 1e-3, 4e-5);
    let together: f64 = e.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / e.len() as f64;
    close(together, 0.0, 6e-8);
    let same = run(&machine, &plan, &noisy(7), None).unwrap().0;
    let again = run(&machine, &plan, &noisy(7), None).unwrap().0;
    assert_eq!(same, again);
    assert_ne!(same, run(&machine, &plan, &noisy(8), None).unwrap().0);
    // a shorter plan has the same touches with the same noise
    let mut short = plan.clone();
    short.touches.drain(..100);
    assert_eq!(run(&machine, &short, &noisy(7), None).unwrap().0[0].position, same[100].position);
}

#[test]
fn a_visit_moves_all_its_touches_alike() {
    let (machine, mut plan) = top_plan(40);
    let scenario = Scenario::flawless().with_noise(0.0, mm_from_um(2.0), 3);
    let e = readings(&machine, &plan, &scenario, None);
    for visit in e.chunks(10) {
        visit.iter().for_each(|x| close(*x, visit[0], 1e-12));
    }
    assert!((e[0] - e[10]).abs() > 1e-5);
    // the plan's own numbers count where they are given
    plan.touches.iter_mut().for_each(|t| t.visit = Some(1));
    let e = readings(&machine, &plan, &scenario, None);
    e.iter().for_each(|x| close(*x, e[0], 1e-12));
}

#[test]
fn a_plan_that_does_not_fit_is_refused_with_its_touch() {
    let (machine, plan) = top_plan(2);
    let mut other = plan.clone();
    other.machine = "trunnion".to_owned();
    let mut lame = plan.clone();
    lame.touches[1].end = lame.touches[1].start;
    let mut blind = plan.clone();
    blind.touches[0].start = AxisMap::default();
    let mut nan = plan.clone();
    nan.touches[1].start.set(AxisName::X, f64::NAN);
    let mut far = plan.clone();
    far.blocks[0].centre[1] = 1e300;
    let mut flat = plan;
    flat.blocks[0].size[2] = 0.0;
    let cases = [
        (other, "trunnion"),
        (lame, "touch 2"),
        (blind, "touch 1"),
        (nan, "touch 2"),
        (far, "nowhere"),
        (flat, "no length"),
    ];
    for (plan, word) in cases {
        let failure = run(&machine, &plan, &Scenario::flawless(), None).unwrap_err();
        assert!(failure.to_string().contains(word), "{failure}");
        assert!(failure.0[0].help.is_some());
    }
}
