//! Errors that depend on the position of one axis → tables of another one's (or its own) correction.

use super::backup::Old;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding};
use crate::machine::Machine;
use crate::post::tables::GridForm;
use crate::tables::compensation::{Grid, Tables as Record};
use crate::tables::correction::{AxisShape, Correction, Limits, rounded};
use crate::tables::rows::{TableError, Wanted};
use crate::units::um_from_mm;

/// Counts of points of a table that repeats every turn: whole degrees, and halves of one.
const TURN_COUNTS: [usize; 6] = [37, 73, 121, 181, 361, 721];

/// Counts of points over a range: zero is a point of a symmetrical one.
const COUNTS: [usize; 11] = [3, 5, 9, 17, 33, 65, 97, 129, 193, 257, 513];

/// The tables of a correction with what each leaves, on top of those that were active; `step` is the smallest step of (a
/// length, an angle), `lever_mm` where errors of angles are stated.
///
/// # Errors
/// When the control has not so many tables, or an error has no value at a coordinate.
pub fn grids(
    machine: &Machine,
    correction: &Correction,
    form: &GridForm,
    active: &[Grid],
    step: [f64; 2],
    lever_mm: f64,
) -> Result<(Vec<Grid>, Vec<TableError>), Failure> {
    let shapes: Vec<&AxisShape> = correction.shapes.iter().chain(&correction.across).collect();
    let mut pairs: Vec<(AxisName, AxisName)> = shapes.iter().map(|s| (s.input, s.axis)).collect();
    pairs.extend(active.iter().map(|g| (g.input, g.output)));
    pairs.sort_unstable();
    pairs.dedup();
    let (mut out, mut leaves, mut number) = (Vec::new(), Vec::new(), form.first);
    for (input, output) in pairs {
        let Some(axis) = machine.axis(input) else { continue };
        let origin = machine.origin.get(input).unwrap_or(0.0);
        let own: Vec<&&AxisShape> = shapes.iter().filter(|s| (s.input, s.axis) == (input, output)).collect();
        let before: Vec<&Grid> = active.iter().filter(|g| (g.input, g.output) == (input, output)).collect();
        let value = |at: f64, sense: f64| -> f64 {
            let old: f64 = before.iter().filter(|g| f64::from(g.sense) * sense >= 0.0).map(|g| g.at(at)).sum();
            old - own.iter().map(|s| (s.error)(at - origin, sense)).sum::<f64>()
        };
        let [low, high] = axis.range.map(|v| v + origin);
        let probe = |i: u32| low + (high - low) * f64::from(i) / 97.0;
        let even = (0..98).all(|i| (value(probe(i), 1.0) - value(probe(i), -1.0)).abs() < 1e-12);
        let turns = input.is_rotary()
            && high - low >= 360.0
            && (0..98).all(|i| {
                let at = probe(i).rem_euclid(360.0);
                (value(at, 1.0) - value(probe(i), 1.0)).abs() < 1e-9
                    && (value(at, -1.0) - value(probe(i), -1.0)).abs() < 1e-9
            });
        let smallest = step[usize::from(output.is_rotary())];
        for sense in if even { &[0_i8][..] } else { &[1, -1] } {
            let senses: &[f64] = if *sense < 0 { &[-1.0] } else { &[1.0] };
            let wanted = Wanted {
                input,
                output,
                origin,
                travel: axis.range,
                used: correction.used.get(&input).copied(),
                senses,
                value: &value,
            };
            let possible = |counts: &[usize]| -> Vec<usize> {
                let fitting: Vec<usize> = counts.iter().copied().filter(|n| *n <= form.most_points).collect();
                if fitting.is_empty() { vec![form.most_points.max(2)] } else { fitting }
            };
            let ([low, high], count) = if turns {
                ([0.0, 360.0], wanted.count([0.0, 360.0], &possible(&TURN_COUNTS)))
            } else {
                wanted.place(&possible(&COUNTS))
            };
            let (min, distance) = (rounded(low), rounded((high - low) / (count - 1) as f64));
            let positions: Vec<f64> = (0..count).map(|i| min + distance * i as f64).collect();
            let stored = |at: &f64| rounded((value(*at, senses[0]) / smallest).round() * smallest);
            let mut values: Vec<f64> = positions.iter().map(stored).collect();
            if turns && let (Some(first), Some(last)) = (values.first().copied(), values.last_mut()) {
                *last = first;
            }
            leaves.push(wanted.leaves(&positions, |i, _| values[i], (number, *sense, turns), lever_mm)?);
            out.push(Grid { number, input, output, sense: *sense, min, step: distance, modulo: turns, values });
            number += 1;
        }
    }
    if out.len() > form.most {
        let says = format!("{} position tables are needed, the control has {}", out.len(), form.most);
        return Err(
            Failure::new("tables::grids", says).help("take the smallest effects out of the study's model, one by one")
        );
    }
    Ok((out, leaves))
}

/// Position tables with values that no correction should reach.
#[must_use]
pub fn beyond(grids: &[Grid], limits: &Limits) -> Vec<Finding> {
    let mut findings = Vec::new();
    for grid in grids {
        let (limit, unit) = if grid.output.is_rotary() { (limits.deg, "deg") } else { (limits.mm, "mm") };
        let largest = grid.values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if largest > limit {
            let says = format!(
                "the position table of {} by the position of {} reaches {largest:.6} {unit}, above the limit of {limit} {unit}",
                grid.output, grid.input
            );
            findings.push(
                Finding::error("tables::too_large", says)
                    .help("look for a set-up fault (wrong block, wrong sense, wrong length) first; --force exports it all the same"),
            );
        }
    }
    findings
}

/// What the user's backup says of a table: nothing, or its points with their numbers.
fn in_backup(form: &GridForm, number: usize, old: &Old) -> Option<Vec<(usize, String, f64)>> {
    let names = (0..form.most_points).filter_map(|p| Some((p, form.point_name(number, p)?)));
    let found: Vec<_> = names.filter_map(|(p, n)| old.values.get(&n).map(|(v, _)| (p, n.clone(), *v))).collect();
    (!found.is_empty()).then_some(found)
}

/// Is what stood in a table known: from the user's backup, or because a file that was loaded wrote it?
#[must_use]
pub fn known(form: &GridForm, grid: &Grid, active: Option<&Record>, old: &Old) -> bool {
    let by_file = |a: &Record| {
        let wrote = a.grids.iter().any(|g| g.number == grid.number);
        wrote && form.point_name(grid.number, 0).is_none_or(|name| !a.changes.contains_key(&name))
    };
    in_backup(form, grid.number, old).is_some() || active.is_some_and(by_file)
}

/// The table that acted before a new one, or one of zeros.
#[must_use]
pub fn before(active: Option<&Record>, grid: &Grid) -> Grid {
    let same = |o: &&Grid| (o.input, o.output, o.sense) == (grid.input, grid.output, grid.sense);
    let none = || Grid { values: vec![0.0; grid.values.len()], ..grid.clone() };
    active.and_then(|a| a.grids.iter().find(same).cloned()).unwrap_or_else(none)
}

/// Tables that hold something else than what axiscal has written into them: they would be written over.
#[must_use]
pub fn occupied(form: &GridForm, grids: &[Grid], active: &[Grid], old: &Old) -> Vec<Finding> {
    let mut findings = Vec::new();
    for grid in grids {
        let Some(points) = in_backup(form, grid.number, old) else { continue };
        let own = active.iter().find(|a| a.number == grid.number);
        let as_written = |i: usize, value: f64| {
            (own.and_then(|a| a.values.get(i)).copied().unwrap_or(0.0) - value).abs() <= SAME_POINT
        };
        let other = points.iter().find(|(point, _, value)| !as_written(*point, *value));
        let empty = points.iter().all(|(_, _, value)| *value == 0.0);
        if let (Some((point, name, _)), true) = (other, empty) {
            let wrote = own.and_then(|a| a.values.get(*point)).copied().unwrap_or_default();
            let says = format!(
                "the compensation that was active during the measurement wrote {name} = {wrote}, the backup has 0: what was identified adds to the first"
            );
            findings.push(
                Finding::error("tables::old_not_active", says)
                    .help("give a backup of the control from after that compensation was loaded, or none"),
            );
        } else if let Some((_, name, value)) = other {
            let says = format!(
                "position table {} of the control is in use: {name} = {value} is not what the study's compensation wrote, and would be written over",
                grid.number
            );
            findings.push(Finding::error("tables::occupied", says).help(
                "where axiscal wrote it and it acted during the measurement, name that export as `compensation` in the study; else write the first free number into a file of your own ([tables.grid] first = …): the tables of one axis add up; --force writes over it",
            ));
        }
    }
    findings
}

/// Points of a table that differ by less are the same, mm or deg.
const SAME_POINT: f64 = 1e-6;

/// The largest error that a shape makes over the range of its input, µm (linear axes) or deg.
#[must_use]
pub fn largest_um(machine: &Machine, shape: &AxisShape, radius_mm: f64) -> f64 {
    let range = machine.axis(shape.input).map_or([0.0, 0.0], |a| a.range);
    let at = |i: u32, sense: f64| (shape.error)(range[0] + (range[1] - range[0]) * f64::from(i) / 360.0, sense).abs();
    let most = (0..=360).flat_map(|i| [at(i, 1.0), at(i, -1.0)]).fold(0.0, f64::max);
    um_from_mm(if shape.axis.is_rotary() { crate::units::rad_from_deg(most) * radius_mm } else { most })
}
