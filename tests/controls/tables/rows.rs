//! What is stated of a table's rows bounds what a control makes of them.

use super::controls::tables;
use super::support::machine;
use axiscal::axes::AxisName;
use axiscal::machine::Machine;
use axiscal::tables::control::{self, grids};
use axiscal::tables::correction::{AxisShape, Correction};
use axiscal::tables::linuxcnc::{self, axis_table};
use proptest::prelude::*;
use std::rc::Rc;

const LEVER_MM: f64 = 150.0;

/// A wave: amplitude in deg or mm, how often a turn or in 360 mm, phase in rad.
#[derive(Debug, Clone, Copy)]
struct Wave {
    amplitude: f64,
    often: f64,
    phase: f64,
}

/// What is planted, and where: mm or deg.
#[derive(Debug, Clone)]
struct Planted {
    axis: AxisName,
    range: [f64; 2],
    waves: Vec<Wave>,
    slope: f64,
    /// Half of what is lost on reversing.
    reversal: f64,
    /// A corner at 0, as `abs(X)` has one.
    corner: f64,
}

impl Planted {
    /// How much further the axis stands than it shows.
    fn error(&self, q: f64, sense: f64) -> f64 {
        let wave = |w: &Wave| w.amplitude * (w.often * q.to_radians() + w.phase).sin();
        let waves: f64 = self.waves.iter().map(wave).sum();
        waves + self.slope * q + self.reversal * sense + self.corner * (q - 7.3).abs()
    }

    fn machine(&self) -> Machine {
        let mut machine = machine("trunnion");
        for axis in machine.axes.iter_mut().filter(|a| a.name == self.axis) {
            axis.range = self.range;
        }
        machine
    }

    fn correction(&self) -> Correction {
        let own = self.clone();
        let shape = AxisShape {
            parameter: "k".to_owned(),
            effect: "test".to_owned(),
            value: 1.0,
            unit: "mm".to_owned(),
            axis: self.axis,
            input: self.axis,
            error: Rc::new(move |q, sense| own.error(q, sense)),
        };
        Correction { shapes: vec![shape], ..Correction::default() }
    }

    fn um(&self, off: f64) -> f64 {
        1e3 * if self.axis.is_rotary() { off.to_radians() * LEVER_MM } else { off }
    }

    /// Where to look, finely and at no round numbers: all of it, or some turns of an endless axis.
    fn coordinates(&self, [low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
        let step = ((high - low) / 60_000.0).min(0.0317);
        (0..).map(move |i| low + step * f64::from(i)).take_while(move |q| *q <= high)
    }
}

fn wave(often: impl Strategy<Value = f64>) -> impl Strategy<Value = Wave> {
    (-0.05..0.05, often, 0.0..std::f64::consts::TAU).prop_map(|(amplitude, often, phase)| Wave {
        amplitude,
        often,
        phase,
    })
}

fn planted() -> impl Strategy<Value = Planted> {
    let linear = (-900.0..-20.0, 20.0..900.0).prop_map(|(low, high)| (AxisName::X, [low, high]));
    let rotary = prop_oneof![(-400.0..-10.0, 10.0..400.0), (-20_000.0..-10.0, 10.0..20_000.0), Just((-9999.0, 9999.0))]
        .prop_map(|(low, high)| (AxisName::C, [low, high]));
    let waves = prop_oneof![
        proptest::collection::vec(wave((1..13).prop_map(f64::from)), 0..4),
        proptest::collection::vec(wave(0.2..120.0), 0..3),
    ];
    let rest = (-1e-4..1e-4, prop_oneof![Just(0.0), 0.0..0.01], prop_oneof![Just(0.0), 0.0..1e-4]);
    (prop_oneof![linear, rotary], waves, rest).prop_map(|((axis, range), waves, (slope, reversal, corner))| Planted {
        axis,
        range,
        waves,
        slope: if axis.is_rotary() { 0.0 } else { slope },
        reversal,
        corner,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn the_stated_error_bounds_that_of_every_table(planted in planted()) {
        let (machine, correction) = (planted.machine(), planted.correction());
        let made = axis_table::tables(&machine, &correction, |_| None, |_| 2, LEVER_MM).unwrap();
        prop_assert_eq!(made.len(), 1);
        let (table, said) = (&made[0].table, &made[0].leaves);
        prop_assert!(table.rows.len() <= axis_table::MAX_LINES && table.rows.len() == said.rows);
        let (mut largest, mut corrected) = (0.0_f64, 0.0_f64);
        for q in planted.coordinates(said.range) {
            for sense in [1.0, -1.0] {
                let off = planted.um(planted.error(q, sense) + table.at(q, sense > 0.0)).abs();
                prop_assert!(off <= said.interpolation_um + said.rounding_um + 1e-7, "{} um at {}: {:?}", off, q, said);
                largest = largest.max(off);
                corrected = corrected.max(planted.um(planted.error(q, sense)).abs());
            }
        }
        // and is no more than what a table of this kind really leaves, where that is more than a trifle
        prop_assert!(said.interpolation_um <= 1.25 * largest + 0.1, "{} um: {:?}", largest, said);
        // refused exactly where it is too large, by what was found here
        let refused = said.findings().iter().any(|f| f.code == "tables::too_coarse");
        let at_100_mm = if planted.axis.is_rotary() { largest * 100.0 / LEVER_MM } else { largest };
        if at_100_mm > 0.51 && largest > 0.11 * corrected {
            prop_assert!(refused, "{} um of {} um: {:?}", largest, corrected, said);
        }
        if at_100_mm < 0.3 || largest < 0.06 * corrected {
            prop_assert!(!refused, "{} um of {} um: {:?}", largest, corrected, said);
        }
        // the turns that are always in use are covered
        for (end, usual) in [(said.range[0], planted.range[0].max(-360.0)), (said.range[1], planted.range[1].min(360.0))] {
            prop_assert!(if usual < 0.0 { end <= usual + 1e-9 } else { end >= usual - 1e-9 }, "{:?}", said);
        }
        // what the end values leave beyond
        let [low, high] = planted.range;
        for q in [low, high, low + 0.3 * (said.range[0] - low), high - 0.2 * (high - said.range[1])] {
            if q < said.range[0] - 1e-6 || q > said.range[1] + 1e-6 {
                prop_assert!(said.beyond_um.is_some(), "{:?}", said);
            }
        }
    }

    /// SINUMERIK's tables: fewer points, rounded values, and for what repeats every turn a table that does so too.
    #[test]
    fn the_stated_error_bounds_that_of_every_position_table(planted in planted()) {
        let (machine, correction) = (planted.machine(), planted.correction());
        let form = tables("sinumerik").grid.unwrap();
        let step = 1e-4;
        let (made, said) = grids::grids(&machine, &correction, &form, &[], [step, step], LEVER_MM).unwrap();
        prop_assert!(made.len() == said.len() && !made.is_empty());
        for (grid, said) in made.iter().zip(&said) {
            prop_assert!(grid.values.len() <= form.most_points && grid.values.len() == said.rows);
            prop_assert!(said.rounding_um <= planted.um(step / 2.0) + 1e-6, "{:?}", said);
            let range = if grid.modulo { [planted.range[0].max(-720.0), planted.range[1].min(720.0)] } else { said.range };
            for q in planted.coordinates(range) {
                for sense in [1.0, -1.0] {
                    if f64::from(grid.sense) * sense < 0.0 {
                        continue;
                    }
                    let off = planted.um(planted.error(q, sense) + grid.at(q)).abs();
                    prop_assert!(off <= said.interpolation_um + said.rounding_um + 1e-5, "{} um at {}: {:?}", off, q, said);
                }
            }
        }
    }
}

/// Forty times a turn, 0.02 deg: neither 255 rows over two turns nor 181 points of one turn follow that.
#[test]
fn a_table_that_is_too_coarse_is_refused_and_named_where_it_is_forced() {
    let wave = Wave { amplitude: 0.02, often: 40.0, phase: 0.4 };
    let planted = Planted {
        axis: AxisName::C,
        range: [-360.0, 360.0],
        waves: vec![wave],
        slope: 0.0,
        reversal: 0.0,
        corner: 0.0,
    };
    let (machine, correction) = (planted.machine(), planted.correction());
    let code = "tables::too_coarse";

    let of = |force: bool| linuxcnc::export(&machine, &correction, &linuxcnc::Options { force, ..Default::default() });
    let refused = of(false).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == code), "{refused}");
    let (forced, findings) = of(true).unwrap();
    assert!(findings.0.iter().any(|f| f.code == code));
    for way in [&forced.component, &forced.stock] {
        assert_eq!(way.compensation.table_errors, forced.table_errors);
        assert_eq!(way.compensation.provenance.forced.len(), 1);
    }
    // a third of a wave from row to row: straight lines cut off nearly half of its height
    let said = &forced.table_errors[0];
    assert!(said.interpolation_um > 10.0 && said.correction_um > 30.0, "{said:?}");

    let of = |force: bool| {
        let options = control::Options { force, accept_unverified: true, ..Default::default() };
        control::export(&machine, "sinumerik", &tables("sinumerik"), &correction, &options)
    };
    let refused = of(false).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == code), "{refused}");
    let (forced, _) = of(true).unwrap();
    assert_eq!((forced.table_errors.len(), forced.compensation.provenance.forced.len()), (1, 1));
    assert_eq!(forced.compensation.table_errors, forced.table_errors);
}
