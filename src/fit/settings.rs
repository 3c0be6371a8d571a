//! What a user asks of a fit.

use crate::model::predict::Observation;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// What the user decided about one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Knowledge {
    /// Held at a value, in the parameter's unit.
    Fixed(f64),
    /// Known to be `value` with a standard deviation, in the parameter's unit.
    Prior {
        /// Expected value.
        value: f64,
        /// Standard deviation.
        sigma: f64,
    },
}

/// A touch that the user took out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// Which run, from 0.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Why.
    pub reason: String,
}

impl Mask {
    pub(super) fn is_of(&self, o: &Observation) -> bool {
        o.run == self.run && o.id == self.id
    }
}

/// What a fit is asked for.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Settings {
    /// Ids of the effects: the whole model.
    pub effects: Vec<String>,
    /// Parameters that are held or have a prior, by name in any spelling.
    pub knowledge: BTreeMap<String, Knowledge>,
    /// Standard deviation of a touch, mm, where the user states it.
    pub touch_sigma_mm: Option<f64>,
    /// Standard deviation of each component of a visit's displacement, mm, where the user states it.
    pub visit_sigma_mm: Option<f64>,
    /// Where location errors of workpiece-side axes are stated, mm in R (default: the machine's pivot).
    pub reference: Option<Vector3<f64>>,
    /// What the measurement itself is uncertain about: parameters of effects that are not in the model, by name, with a
    /// standard uncertainty in their unit. They widen the uncertainties and are not solved for.
    pub type_b: BTreeMap<String, f64>,
    /// Touches that are not to be used.
    pub masked: Vec<Mask>,
    /// Without the figures that need the whole catalogue: what unmodelled effects may add, weak combinations, held-out errors.
    pub bare: bool,
    /// For trial fits: as `bare`, and without the intervals of shape parameters. What hangs on a shape that is not told may then be
    /// called identified.
    pub quick: bool,
    /// No touch is left out but those that the user takes out.
    pub all_in: bool,
}
