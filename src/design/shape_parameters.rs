//! What planned touches will tell of a shape parameter: a time constant, a pitch, the moment of a jump.
//!
//! How well it is told depends on its own value and on how large its effect is: it is looked at where its search begins, with
//! the typical sizes. That another value would do the same to these touches is found by the fit.

use super::linearised_plan::{LinearisedPlan, Task};
use super::record::Expected;
use crate::diag::{Failure, Result};
use crate::fit::candidates::{Trials, Variant};
use crate::fit::whitening::Whitening;
use crate::fit::{all_tried, jumps_in_a_design};
use crate::model::catalogue::{Effect, Parameter};
use crate::model::data::Data;
use crate::model::predict::{Model, Unknown};
use crate::search::Basis;
use crate::units::significant;
use nalgebra::{DMatrix, DVector};

/// Digits of a value.
const DIGITS: i32 = 4;

/// What is said of the shape parameters of a model.
pub(super) fn shapes(task: &Task, view: &LinearisedPlan, expected: &[Expected]) -> Vec<String> {
    let shaped = task.effects.iter().flat_map(|e| e.parameters.iter().filter_map(move |p| Some((*e, p, p.shape?.0))));
    // an effect of blocks has one for each
    let is =
        |u: &Unknown, e: &Effect, p: &Parameter| u.effect == e.id && u.name.split('@').next() == Some(p.name.as_str());
    let each = shaped.flat_map(|(e, p, start)| {
        (0..view.model.unknowns.len())
            .filter(move |&i| is(&view.model.unknowns[i], e, p))
            .map(move |i| (e, p, start, i))
    });
    let mut out = Vec::new();
    for (effect, p, start, unknown) in each {
        let name = &view.model.unknowns[unknown].name;
        if !view.free.contains(&unknown) {
            if !task.held.iter().any(|h| crate::symbols::same(h, &p.name) || crate::symbols::same(h, name)) {
                out.push(format!(
                    "{} ({}) will be found by trying every place between the touches: how well it will be told depends on how large the jump is, and the rest is what is expected where it is known to be {}",
                    name,
                    effect.name,
                    with_unit(&significant(view.theta[unknown], DIGITS), &p.unit)
                ));
            }
            continue;
        }
        let looked_at = format!(
            "{} ({}) is looked at where it is {} and {} has its typical sizes",
            name,
            effect.name,
            with_unit(&significant(start, DIGITS), &p.unit),
            effect.id
        );
        let row = expected.iter().position(|x| x.effect == effect.id && x.name == *name);
        out.push(match row.is_some_and(|r| expected[r].sigma.is_some()) {
            true => format!("{looked_at}: how well it will be told, and what goes with it, depends on both"),
            false => format!("{looked_at}: there it leaves no trace, and of other values nothing is said here"),
        });
    }
    out
}

fn with_unit(number: &str, unit: &str) -> String {
    if unit == "1" { number.to_owned() } else { format!("{number} {unit}") }
}

/// Moments at which something jumps, in a model on planned touches.
pub(super) struct Moments<'a> {
    pub task: &'a Task<'a>,
    pub model: &'a Model,
    pub data: &'a Data,
    pub free: &'a [usize],
    pub white: &'a Whitening,
}

impl Moments<'_> {
    /// Puts each among the touches where its jump leaves most that the rest of the model cannot follow: behind the last touch it
    /// would leave nothing. `jacobian`: whitened, of the free unknowns.
    pub fn put_where_they_show(&self, theta: &mut [f64], jacobian: &DMatrix<f64>) {
        for effect in &self.task.effects {
            for p in jumps_in_a_design(effect, self.data) {
                // an effect of blocks has one for each
                for (i, u) in self.model.unknowns.iter().enumerate() {
                    if u.effect != effect.id || u.name.split('@').next() != Some(p.name.as_str()) {
                        continue;
                    }
                    let rest: Vec<usize> = (0..self.free.len())
                        .filter(|&c| {
                            let other = &self.model.unknowns[self.free[c]];
                            other.effect != effect.id || other.name.split('@').nth(1) != u.name.split('@').nth(1)
                        })
                        .collect();
                    let rest = jacobian.select_columns(&rest);
                    if rest.iter().any(|x| !x.is_finite()) {
                        continue;
                    }
                    if let Some(value) = self.most_visible((effect, p), &u.name, &Basis::new(&rest), jacobian.nrows()) {
                        theta[i] = value;
                    }
                }
            }
        }
    }

    /// The value of a parameter at which its jump leaves most beside everything else.
    fn most_visible(&self, (effect, p): (&Effect, &Parameter), name: &str, base: &Basis, n_rows: usize) -> Option<f64> {
        /// Places that are tried.
        const MOST: usize = 60;
        let alone = Model::new(self.task.machine, &[effect], &self.data.set_ups, self.task.reference);
        let trials = Trials::of(&alone, &self.data.nominal);
        let at = alone.unknowns.iter().position(|u| u.name == name)?;
        let first = at / effect.parameters.len() * effect.parameters.len();
        let own = first..first + effect.parameters.len();
        let shaped: Vec<usize> = (0..alone.n_unknowns()).filter(|&i| alone.unknowns[i].shape).collect();
        let sizes: Vec<usize> = own.filter(|&i| !alone.unknowns[i].shape).collect();
        let typical = DVector::from_fn(sizes.len(), |k, _| alone.unknowns[sizes[k]].typical);
        let kept = |value: f64| {
            let shapes = shaped.iter().map(|&i| if i == at { value } else { alone.unknowns[i].start }).collect();
            let mut all = trials.columns(&Variant { effects: vec![0], shapes }).values.select_columns(&sizes);
            self.white.apply(&mut all);
            base.project(&(all * &typical).resize_vertically(n_rows, 0.0)).norm()
        };
        let places = all_tried(p, self.data);
        let few = places.iter().copied().step_by(places.len().div_ceil(MOST).max(1));
        let best = few.map(|v| (v, kept(v))).filter(|(_, kept)| kept.is_finite());
        best.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(value, _)| value)
    }
}

/// A slope that is no number, as that of a root where it begins, would be one of everything.
///
/// # Errors
/// Names the parameter and the touch.
pub(super) fn every_slope_is_a_number(
    model: &Model,
    data: &Data,
    free: &[usize],
    jacobian: &DMatrix<f64>,
) -> Result<()> {
    let Some(at) = jacobian.iter().position(|x| !x.is_finite()) else { return Ok(()) };
    let (row, column) = (at % jacobian.nrows(), at / jacobian.nrows());
    let u = &model.unknowns[free[column]];
    let touch = data.nominal.get(row).map_or(0, |o| o.id);
    Err(Failure::new(
        "assess::no_slope",
        format!(
            "how the touches go with {} of effect {} is no number at touch {touch}, where it is {}",
            u.name, u.effect, u.start
        ),
    )
    .help("begin it (`start`) where its formula is smooth at all touches"))
}
