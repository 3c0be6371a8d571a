//! The touches that find an artefact that was put down by eye, and what is made relative to it.

use super::Writer;
use crate::axes::{AxisMap, AxisName};
use crate::diag::{Failure, Result};
use crate::post::NumberRule;
use minijinja::{Value, context};
use nalgebra::Matrix3;

const LINEAR: [AxisName; 3] = [AxisName::X, AxisName::Y, AxisName::Z];

/// What was found may be further off than the tolerance by this, mm: the contacts are rounded.
const ROUNDED_MM: f64 = 0.01;

impl Writer<'_> {
    /// A controller whose file does not say how an artefact is found writes no such program.
    pub(super) fn check_find(&self) -> Result<()> {
        if self.plan.find.is_none() {
            return Ok(());
        }
        if self.post.touch_with_cycle {
            return Err(Failure::new("post::find", "the control's measuring cycle does not find an artefact")
                .help("generate without --touch-with cycle, or without placement_tolerance"));
        }
        if self.post.finds() {
            return Ok(());
        }
        let says =
            format!("controller {} does not say how an artefact is found that was put down by eye", self.post.name);
        Err(Failure::new("post::find", says).help(
            "generate without placement_tolerance, or describe it under [write.found], [write.shift] and [write.find_end]",
        ))
    }

    /// By how much a touch that finds may trigger further off than others, as a length.
    pub(super) fn find_room(&self) -> String {
        let more = |room_mm: f64| (room_mm - self.machine.probe.placement_tolerance).max(0.0);
        self.length(self.plan.find.as_ref().map_or(0.0, |find| more(find.room_mm)))
    }

    pub(super) fn found(&mut self, moves: &AxisMap) -> Result<()> {
        for (axis, factor) in moves.iter() {
            let context = context! { axis => axis.to_string(), factor => self.fine(factor) };
            self.render("found", context)?;
        }
        Ok(())
    }

    /// A number with more digits than a coordinate has.
    fn fine(&self, value: f64) -> String {
        let rule = &self.post.number;
        NumberRule { decimals: rule.decimals.max(6), ..rule.clone() }.number(value)
    }

    /// The rows of a matrix, each with its terms that are not 0: `{ axis, terms: [{ axis, value }] }`.
    pub(in crate::post) fn shift_rows(&self, matrix: &Matrix3<f64>) -> Value {
        const NOTHING: f64 = 5e-7;
        let row = |(i, axis): (usize, &AxisName)| {
            let terms = LINEAR.iter().enumerate().filter(|(j, _)| matrix[(i, *j)].abs() > NOTHING);
            let terms: Vec<Value> =
                terms.map(|(j, a)| context! { axis => a.to_string(), value => self.fine(matrix[(i, j)]) }).collect();
            context! { axis => axis.to_string(), terms }
        };
        Value::from(LINEAR.iter().enumerate().map(row).collect::<Vec<Value>>())
    }

    pub(super) fn find_end(&mut self) -> Result<()> {
        let tolerance = self.plan.find.as_ref().map_or(0.0, |find| find.tolerance_mm);
        let context =
            context! { most => self.length(tolerance + ROUNDED_MM), find_tolerance => self.length(tolerance) };
        self.render("find_end", context)
    }
}
