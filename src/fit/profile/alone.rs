//! A shape parameter without what the user states of it.

use super::{GROWTH_95, HALVINGS, Profile};
use crate::fit::Fit;
use crate::fit::candidates::Trials;
use crate::machine::Machine;
use crate::model::catalogue::Effect;
use crate::model::predict::Model;

/// What the touches say of a shape parameter that has a prior, without the prior; none where the search does not follow it.
/// `scale2`: the variance of the touches' scatter, as a multiple of their noise, where χ² falls by so much.
#[must_use]
pub fn without_prior(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    unknown: usize,
    scale2: impl Fn(f64) -> f64,
) -> Option<Alone> {
    let u = &fit.model.unknowns[unknown];
    let effect = effects.iter().find(|e| e.id == u.effect)?;
    let name = u.name.split('@').next()?;
    let p = effect.parameters.iter().find(|p| p.name == name)?;
    let (_, low, high) = p.shape?;
    let model = Model::new(machine, &[effect], &fit.data.set_ups, fit.model.reference);
    let trials = Trials::of(&model, &fit.data.observations);
    let mut profile = Profile::new(fit, (&model, &trials), effect, unknown)?;
    let whole = profile.residual.norm_squared();
    profile.drop_prior_of_shape();
    let growth = |at: f64| profile.held(at).growth;
    // the best of many places, and then between its neighbours
    let places = profile.all_places(p);
    let best = (0..places.len()).min_by(|&a, &b| growth(places[a]).total_cmp(&growth(places[b])))?;
    let (mut from, mut to) = (places[best.saturating_sub(1)], places[(best + 1).min(places.len() - 1)]);
    for _ in 0..HALVINGS {
        let third = (to - from) / 3.0;
        if growth(from + third) < growth(to - third) { to -= third } else { from += third }
    }
    let value = 0.5 * (from + to);
    let least = growth(value);
    // what the others would still gain, where they have not settled, they gain at any value: that says nothing of this one
    let falls = whole - profile.residual.norm_squared() + growth(profile.values[profile.shape]) - least;
    let limit = GROWTH_95 * scale2(falls);
    let over = |at: f64| growth(at) - least > limit;
    let end = |mut inside: f64, limit: f64| -> f64 {
        // the first place that is contradicted, and back to where that begins
        let beyond = places.iter().copied().filter(|at| (at - inside) * (limit - inside) > 0.0);
        let by_distance = |a: &f64, b: &f64| (a - inside).abs().total_cmp(&(b - inside).abs());
        let mut beyond: Vec<f64> = beyond.collect();
        beyond.sort_by(by_distance);
        for at in beyond {
            if over(at) {
                let mut outside = at;
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (inside + outside);
                    if over(middle) { outside = middle } else { inside = middle }
                }
                return inside;
            }
            inside = at;
        }
        limit
    };
    Some(Alone { value, interval: [end(value, low), end(value, high)], falls })
}

/// A shape without its prior.
pub struct Alone {
    /// Its best value, in its unit.
    pub value: f64,
    /// 95 % interval; an end of its range where the touches set none.
    pub interval: [f64; 2],
    /// By how much χ² falls.
    pub falls: f64,
}
