//! Axis compensation files: `[JOINT_n] COMP_FILE`, type 1.
//!
//! A line is `nominal forward reverse`, ascending, at most 256 lines, nothing else in the file: LinuxCNC stops reading at
//! the first line that is not three numbers. The values are added to the command while the axis moves up or down, so
//! that each is nominal - actual. Between the lines LinuxCNC interpolates, outside them the end value holds. The file
//! overrides `BACKLASH`.

use crate::axes::AxisName;
use crate::machine::Machine;
use crate::tables::compensation::AxisTable;
use crate::tables::correction::{AxisShape, rounded};

/// Most lines that LinuxCNC reads.
pub const MAX_LINES: usize = 256;

/// The table follows the error to this, mm or deg: a tenth of what a control resolves.
const CLOSE_ENOUGH: f64 = 1e-5;

/// What an axis is to be told more than its nominal coordinate, at a coordinate relative to R's origin.
fn told_more(shapes: &[&AxisShape], q: f64, sense: f64) -> f64 {
    -shapes.iter().map(|shape| (shape.error)(q, sense)).sum::<f64>()
}

/// The tables of all axes that have an error of their own position, or had one before. Rows in mm or deg.
///
/// `already` are the tables that were active during the measurement: the new ones are added to them.
#[must_use]
pub fn tables(
    machine: &Machine,
    shapes: &[AxisShape],
    already: impl Fn(AxisName) -> Option<AxisTable>,
    joint: impl Fn(AxisName) -> usize,
) -> Vec<(AxisName, AxisTable)> {
    let mut tables = Vec::new();
    for axis in &machine.axes {
        let own: Vec<&AxisShape> = shapes.iter().filter(|s| s.axis == axis.name).collect();
        let before = already(axis.name);
        if own.is_empty() && before.is_none() {
            continue;
        }
        let origin = machine.origin.get(axis.name).unwrap_or(0.0);
        let value = |nominal: f64, sense: f64| {
            let old = before.as_ref().map_or(0.0, |t| t.at(nominal, sense > 0.0));
            old + told_more(&own, nominal - origin, sense)
        };
        let rows = rows(axis.range.map(|v| v + origin), value);
        let file = format!("axiscal_comp_{}.txt", axis.name.letter().to_ascii_lowercase());
        tables.push((axis.name, AxisTable { joint: joint(axis.name), file, rows }));
    }
    tables
}

/// Equidistant lines over a range, as few as follow the value to [`CLOSE_ENOUGH`].
fn rows(range: [f64; 2], value: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
    let table = |n: usize| -> Vec<[f64; 3]> {
        (0..n)
            .map(|i| {
                let share = i as f64 / (n - 1) as f64;
                let nominal = rounded(range[0] + share * (range[1] - range[0]));
                [nominal, rounded(value(nominal, 1.0)), rounded(value(nominal, -1.0))]
            })
            .collect()
    };
    let follows = |rows: &[[f64; 3]]| {
        rows.windows(2).all(|w| {
            [0.25, 0.5, 0.75].into_iter().all(|share| {
                let at = |column: usize| w[0][column] + share * (w[1][column] - w[0][column]);
                (value(at(0), 1.0) - at(1)).abs() <= CLOSE_ENOUGH && (value(at(0), -1.0) - at(2)).abs() <= CLOSE_ENOUGH
            })
        })
    };
    // odd counts first: zero is then a line of a symmetrical range
    let counts = [3, 5, 9, 17, 33, 65, 97, 129, 193];
    counts.into_iter().map(table).find(|rows| follows(rows)).unwrap_or_else(|| table(MAX_LINES))
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

    fn one(machine: &Machine, shape: AxisShape) -> AxisTable {
        let axis = shape.axis;
        let found = tables(machine, &[shape], |_| None, |_| 7);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].0, axis);
        found[0].1.clone()
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
        let found = tables(&machine, &[new], |a| (a == AxisName::X).then(|| old.clone()), |_| 7);
        assert_eq!(found[0].1.rows[2], [300.0, -0.02, -0.02]);
        // without anything new it stays in force
        let kept = tables(&machine, &[], |a| (a == AxisName::X).then(|| old.clone()), |_| 7);
        assert_eq!(kept[0].1.rows[0], [-300.0, 0.01, 0.01]);
    }
}
