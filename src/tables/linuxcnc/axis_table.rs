//! Axis compensation files: `[JOINT_n] COMP_FILE`, type 1.
//!
//! A line is `nominal forward reverse`, ascending, at most 256 lines, nothing else in the file: LinuxCNC stops reading at
//! the first line that is not three numbers. The values are added to the command while the axis moves up or down, so
//! that each is nominal - actual. Between the lines LinuxCNC interpolates, outside them the end value holds. The file
//! overrides `BACKLASH`.

use crate::axes::AxisName;
use crate::diag::Failure;
use crate::machine::Machine;
use crate::tables::compensation::AxisTable;
use crate::tables::correction::{AxisShape, Correction, rounded};
use crate::tables::rows::{TableError, Wanted};

/// Most lines that LinuxCNC reads.
pub const MAX_LINES: usize = 256;

/// Counts of lines to choose from, the fewest that follow. Odd ones: zero is then a line of a symmetrical range.
const COUNTS: [usize; 10] = [3, 5, 9, 17, 33, 65, 97, 129, 193, MAX_LINES - 1];

/// What an axis is to be told more than its nominal coordinate, at a coordinate relative to R's origin.
fn told_more(shapes: &[&AxisShape], q: f64, sense: f64) -> f64 {
    -shapes.iter().map(|shape| (shape.error)(q, sense)).sum::<f64>()
}

/// The table of an axis, with what it leaves.
#[derive(Debug, Clone)]
pub struct Made {
    pub axis: AxisName,
    /// Rows in mm or deg.
    pub table: AxisTable,
    pub leaves: TableError,
}

/// The tables of all axes that have an error of their own position, or had one before.
///
/// `already` are the tables that were active during the measurement: the new ones are added to them. LinuxCNC has no table
/// that repeats every turn: the rows cover the whole travel where they are fine enough for it, else as many turns as they
/// are fine enough for, at least those in use. `lever_mm`: where errors of angles are stated.
///
/// # Errors
/// When an error has no value at a coordinate.
pub fn tables(
    machine: &Machine,
    correction: &Correction,
    already: impl Fn(AxisName) -> Option<AxisTable>,
    joint: impl Fn(AxisName) -> usize,
    lever_mm: f64,
) -> Result<Vec<Made>, Failure> {
    let mut made = Vec::new();
    for axis in &machine.axes {
        let own: Vec<&AxisShape> = correction.shapes.iter().filter(|s| s.axis == axis.name).collect();
        let before = already(axis.name);
        if own.is_empty() && before.is_none() {
            continue;
        }
        let origin = machine.origin.get(axis.name).unwrap_or(0.0);
        let value = |nominal: f64, sense: f64| {
            let old = before.as_ref().map_or(0.0, |t| t.at(nominal, sense > 0.0));
            old + told_more(&own, nominal - origin, sense)
        };
        let wanted = Wanted {
            input: axis.name,
            output: axis.name,
            origin,
            travel: axis.range,
            used: correction.used.get(&axis.name).copied(),
            senses: &[1.0, -1.0],
            value: &value,
        };
        let ([low, high], count) = wanted.place(&COUNTS);
        let row = |i: usize| {
            let nominal = rounded(low + (high - low) * i as f64 / (count - 1) as f64);
            [nominal, rounded(value(nominal, 1.0)), rounded(value(nominal, -1.0))]
        };
        let rows: Vec<[f64; 3]> = (0..count).map(row).collect();
        let positions: Vec<f64> = rows.iter().map(|row| row[0]).collect();
        let written = |i: usize, sense: f64| rows[i][if sense > 0.0 { 1 } else { 2 }];
        let joint = joint(axis.name);
        let leaves = wanted.leaves(&positions, written, (joint, 0, false), lever_mm)?;
        let file = format!("axiscal_comp_{}.txt", axis.name.letter().to_ascii_lowercase());
        made.push(Made { axis: axis.name, table: AxisTable { joint, file, rows }, leaves });
    }
    Ok(made)
}

/// The file's text; linear axes in machine units.
#[must_use]
pub fn text(axis: AxisName, table: &AxisTable, mm_per_unit: f64) -> String {
    let unit = if axis.is_rotary() { 1.0 } else { mm_per_unit };
    let line = |row: &[f64; 3]| format!("{} {} {}\n", row[0] / unit, row[1] / unit, row[2] / unit);
    table.rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    fn machine(name: &str) -> Machine {
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        machines.into_iter().find(|m| m.name == name).unwrap()
    }

    fn shape(axis: AxisName, error: fn(f64, f64) -> f64) -> AxisShape {
        AxisShape {
            parameter: "k".to_owned(),
            effect: "test".to_owned(),
            value: 1.0,
            unit: "mm".to_owned(),
            axis,
            input: axis,
            error: std::rc::Rc::new(error),
        }
    }

    fn correction(shapes: &[AxisShape]) -> Correction {
        Correction { shapes: shapes.to_vec(), ..Correction::default() }
    }

    fn made(machine: &Machine, shape: AxisShape) -> Made {
        let axis = shape.axis;
        let found = tables(machine, &correction(&[shape]), |_| None, |_| 7, 100.0).unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].axis, axis);
        found[0].clone()
    }

    fn one(machine: &Machine, shape: AxisShape) -> AxisTable {
        made(machine, shape).table
    }

    /// A screw of the tool side that travels 1.0001 per commanded mm: at 200 it stands at 200.02, so it is told 0.02 less.
    /// Observed on LinuxCNC: rows `-200 0.02 0.02` and `200 -0.02 -0.02` put it right.
    #[test]
    fn a_long_screw_is_told_less() {
        let table = one(&machine("trunnion"), shape(AxisName::X, |x, _| 1e-4 * x));
        assert_eq!(table.rows, [[-300.0, 0.03, 0.03], [0.0, 0.0, 0.0], [300.0, -0.03, -0.03]]);
        assert!((table.at(200.0, true) + 0.02).abs() < 1e-12);
        assert_eq!(table.at(1000.0, true), -0.03);
        assert_eq!(text(AxisName::X, &table, 1.0), "-300 0.03 0.03\n0 0 0\n300 -0.03 -0.03\n");
    }

    /// An axis that stands 2 µm short of where it is told whatever way it came: half the backlash each way.
    #[test]
    fn backlash_makes_the_two_columns_differ() {
        let table = one(&machine("trunnion"), shape(AxisName::Y, |_, s| -0.002 * s));
        assert_eq!(table.rows[0], [-300.0, 0.002, -0.002]);
    }

    /// An encoder that is off centre: 0.01° sin C. At C = 90 the axis stands 0.01° too far and is told 0.01° less.
    #[test]
    fn a_harmonic_is_followed_closely() {
        let table = one(&machine("trunnion"), shape(AxisName::C, |c, _| 0.01 * c.to_radians().sin()));
        assert!(table.rows.len() <= MAX_LINES);
        assert!((table.at(90.0, true) + 0.01).abs() < 1e-5);
        for c in -359..360 {
            let c = f64::from(c) + 0.3;
            assert!((table.at(c, true) + 0.01 * c.to_radians().sin()).abs() < 2e-5, "{c}");
        }
    }

    #[test]
    fn an_older_table_is_added_to() {
        let old = AxisTable { joint: 7, file: String::new(), rows: vec![[-300.0, 0.01, 0.01], [300.0, 0.01, 0.01]] };
        let machine = machine("trunnion");
        let new = shape(AxisName::X, |x, _| 1e-4 * x);
        let already = |a| (a == AxisName::X).then(|| old.clone());
        let found = tables(&machine, &correction(&[new]), already, |_| 7, 100.0).unwrap();
        assert_eq!(found[0].table.rows[2], [300.0, -0.02, -0.02]);
        // without anything new it stays in force
        let kept = tables(&machine, &correction(&[]), already, |_| 7, 100.0).unwrap();
        assert_eq!(kept[0].table.rows[0], [-300.0, 0.01, 0.01]);
    }

    fn endless(used: Option<[f64; 2]>, error: fn(f64, f64) -> f64) -> Made {
        let mut machine = machine("trunnion");
        for axis in machine.axes.iter_mut().filter(|a| a.name == AxisName::C) {
            axis.range = [-9999.0, 9999.0];
        }
        let used = used.map(|range| (AxisName::C, range)).into_iter().collect();
        let correction = Correction { used, ..correction(&[shape(AxisName::C, error)]) };
        tables(&machine, &correction, |_| None, |_| 4, 100.0).unwrap().remove(0)
    }

    /// 200 urad three times a turn: 256 rows over 55 turns would be 78 deg apart.
    #[test]
    fn rows_of_an_endless_axis_cover_the_turns_in_use() {
        let error = |c: f64, _: f64| 0.0115 * (3.0 * c.to_radians()).cos();
        let made = endless(None, error);
        assert_eq!(made.leaves.range, [-360.0, 360.0]);
        assert!(made.leaves.interpolation_um < 0.1, "{:?}", made.leaves);
        assert!(made.leaves.findings().iter().all(|f| f.severity != crate::diag::Severity::Error));
        // the control holds the end value elsewhere, and that is a warning
        assert!(made.leaves.beyond_um.is_some_and(|um| um > 30.0), "{:?}", made.leaves);
        assert_eq!(made.leaves.findings().len(), 1);
        // a program that went to C = 800 needs three turns
        assert_eq!(endless(Some([-10.0, 800.0]), error).leaves.range, [-1080.0, 1080.0]);
        // where two rows say it all, they cover the whole travel
        let all = endless(None, |c, _| 1e-6 * c);
        assert_eq!((all.leaves.range, all.leaves.beyond_um), ([-9999.0, 9999.0], None));
    }

    /// 0.0115 deg forty times a turn cannot be held by rows that are 2.8 deg apart: refused.
    #[test]
    fn what_the_rows_cannot_follow_is_refused() {
        let made = endless(None, |c, _| 0.0115 * (40.0 * c.to_radians()).cos());
        assert!(made.leaves.findings().iter().any(|f| f.code == "tables::too_coarse"), "{:?}", made.leaves);
        // the same with less than half a micrometre is none worth refusing
        let made = endless(None, |c, _| 0.0001 * (40.0 * c.to_radians()).cos());
        assert!(made.leaves.findings().is_empty(), "{:?}", made.leaves);
    }
}
