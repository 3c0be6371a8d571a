//! The interval of a shape parameter: how far a time constant or a pitch may go before the touches contradict it.
//!
//! Sizes enter the touches linearly and their intervals are as wide on either side. A shape does not: a time constant that
//! came out too short looks better known than it is. So each of its values is held in turn, everything else follows, and the
//! interval ends where χ² has grown by k² (the likelihood profile of D. M. Bates and D. G. Watts, *Nonlinear Regression
//! Analysis and Its Applications*, 1988, section 6.1). All but the effect's own sizes follow linearly, as they nearly do. A size
//! beside a shape that is told weakly may be all that it is beside any of the shape's values that the touches allow.

mod alone;
mod ends;
mod held;

use super::candidates::Trials;
use super::nonlinear_scan::{self, Stretch};
use super::{Fit, Settings};
use crate::machine::Machine;
use crate::model::catalogue::{Effect, Parameter};
use crate::model::predict::{Model, Unknown};
pub use alone::without_prior;
use ends::{also, hull, with_all};
use held::{Held, inverse};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Steps from the value to the end of its usual interval: a profile that goes up and down is followed to its first crossing.
const STEPS: f64 = 4.0;
/// After so many steps each goes further than the one before.
const EVEN: usize = 32;
/// Steps at most: they reach the end of any range.
const MOST_STEPS: usize = 120;
/// Halvings between two steps.
const HALVINGS: usize = 30;

/// χ² grows by this much at the ends of the 95 % interval of a moment at which something jumps: it is flat between two touches
/// and a random walk from one to the next (B. E. Hansen, Econometrica 68, 2000, p. 575, table I).
const GROWTH_OF_A_JUMP: f64 = 7.35;
/// χ² grows by this much at the ends of a 95 % interval.
const GROWTH_95: f64 = 3.841;
/// Values at which χ² has grown by no more than so many times the limit may have a better one beside them.
const NEARLY: f64 = 8.0;
/// So many places behind one that the touches contradict are looked at before the rest counts as contradicted.
const LOOKED_AHEAD: usize = 40;

/// What the profiles say, by index among the unknowns.
#[derive(Debug, Default)]
pub struct Intervals {
    /// 95 % intervals of shape parameters and of what depends on them, in their units.
    pub ends: BTreeMap<usize, [Option<f64>; 2]>,
    /// Other values of a shape parameter, apart from its own, that fit about as well: nobody knows which it is.
    pub other_values: BTreeMap<usize, Vec<f64>>,
    /// What may be much else beside some values of a shape, with those shapes.
    pub lost_beside: BTreeMap<usize, BTreeSet<usize>>,
}

/// How far χ² may grow at a value of a shape before the touches contradict it.
#[derive(Debug, Clone, Copy)]
struct Room {
    growth: f64,
    /// Nothing beside that value is less sure than by so many standard uncertainties.
    most: f64,
}

impl Room {
    /// At one of so many values of which the best was taken, beside an interval of k standard uncertainties.
    fn of_the_best(tried: usize) -> impl Fn(f64) -> Self {
        let chance = by_chance(tried);
        move |k| Self { growth: k * k + chance, most: f64::INFINITY }
    }

    /// At a moment at which something jumps.
    fn of_a_jump(k: f64) -> Self {
        Self { growth: GROWTH_OF_A_JUMP, most: k }
    }

    /// Standard uncertainties on either side where χ² has grown by so much; none where the touches contradict that value.
    fn factor(self, growth: f64) -> Option<f64> {
        let left = self.growth - growth;
        (left > 0.0).then(|| left.sqrt().min(self.most))
    }
}

/// The best of so many values is better by chance, as χ² falls.
fn by_chance(tried: usize) -> f64 {
    2.0 * (tried.max(1) as f64).ln()
}

/// Beside a shape that is not told something may be much else than beside the shape's value, and more than anybody expects of it: then
/// it is not told either. `usual`: half of its interval beside the value alone.
fn is_told(ends: [Option<f64>; 2], value: f64, usual: f64, typical: f64) -> bool {
    const MUCH_ELSE: f64 = 2.0;
    const TYPICAL: f64 = 5.0;
    let most = (MUCH_ELSE * usual).max(TYPICAL * typical);
    ends.iter().flatten().all(|end| (end - value).abs() <= most)
}

/// Some of the values that fit best, each with its χ²; those that are next to a better one are the same.
fn best_of(mut values: Vec<(f64, f64)>) -> Vec<f64> {
    const KEPT: usize = 12;
    const SAME: f64 = 0.02;
    values.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut out: Vec<f64> = Vec::new();
    for (value, _) in values {
        if out.len() < KEPT && out.iter().all(|o| (o - value).abs() > SAME * value.abs()) {
            out.push(value);
        }
    }
    out
}

/// Standard uncertainty and t-factor of a free unknown, by its index among all.
type Spread<'a> = dyn Fn(usize) -> Option<(f64, f64)> + 'a;

/// 95 % intervals of shape parameters and of the sizes beside them, by index among the unknowns, in their units; an end is none
/// where the touches set none within the range of the shape. `settings`: which shapes the search holds; `of`: which shapes are asked
/// for; `spread`: standard uncertainty and t-factor of a free unknown at the solution.
#[must_use]
pub fn intervals(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    settings: &Settings,
    (of, spread): (&dyn Fn(&Unknown) -> bool, &Spread),
) -> Intervals {
    let mut out = Intervals::default();
    let asked = |effect: &Effect| fit.model.unknowns.iter().any(|u| u.shape && u.effect == effect.id && of(u));
    for effect in effects.iter().filter(|e| asked(e)) {
        let model = Model::new(machine, &[effect], &fit.data.set_ups, fit.model.reference);
        let trials = Trials::of(&model, &fit.data.observations);
        // an effect of blocks has a set of parameters for each
        let all = model.unknowns.iter().zip(effect.parameters.iter().cycle());
        for (u, p, (_, low, high)) in all.filter(|(u, _)| of(u)).filter_map(|(u, p)| Some((u, p, p.shape?))) {
            let Some(unknown) = fit.model.unknowns.iter().position(|v| v.effect == u.effect && v.name == u.name) else {
                continue;
            };
            let free = fit.free.contains(&unknown);
            let jumps = settings.jumps.contains(&u.name);
            if !free && !jumps && !settings.held.contains(&u.name) {
                continue;
            }
            let Some(profile) = Profile::new(fit, (&model, &trials), effect, unknown) else { continue };
            if jumps {
                let stretches = nonlinear_scan::stretches_of_a_jump(p, &fit.data, u.name.split('@').nth(1));
                let (ends, places) = profile.ends_of_a_jump(&stretches);
                out.ends.insert(unknown, ends);
                // any of these moments may be it, and everything is as it is beside that one
                profile.widen(&places, &Room::of_a_jump, spread, &mut out);
                profile.widen_others(&places, &Room::of_a_jump, spread, &mut out);
                continue;
            }
            // a shape that the touches do not tell may be any of those that were tried
            let (places, tried) = match spread(unknown).filter(|_| free) {
                Some(of) => {
                    let ends = profile.ends(of, [low, high]);
                    let all = profile.all_places(p);
                    let beyond = profile.beyond(&all, ends, of.1 * of.1 + by_chance(all.len()));
                    let at: Vec<f64> = beyond.iter().map(|b| b.0).collect();
                    also(&mut out.ends, unknown, hull(ends, &at));
                    let mut places = between([ends[0].unwrap_or(low), ends[1].unwrap_or(high)]);
                    let tried = if beyond.is_empty() { 1 } else { all.len() };
                    if !beyond.is_empty() {
                        // another value altogether: then everything else may be otherwise, too
                        profile.widen_others(&at, &Room::of_the_best(tried), spread, &mut out);
                        out.other_values.insert(unknown, best_of(beyond));
                    }
                    places.extend(at);
                    (places, tried)
                }
                None => {
                    let mut places = profile.all_places(p);
                    places.extend([low, high, fit.theta[unknown]]);
                    let n = places.len();
                    // any of them may be it, and everything else as it is beside that one
                    profile.widen_others(&places, &Room::of_the_best(n), spread, &mut out);
                    (places, n)
                }
            };
            profile.widen(&places, &Room::of_the_best(tried), spread, &mut out);
            if !free {
                profile.size_runs_along([low, high], spread, &mut out.ends);
            }
        }
    }
    // beside another shape a line may lead out of a range: nothing sets that end
    for (i, ends) in &mut out.ends {
        let u = &fit.model.unknowns[*i];
        let name = u.name.split('@').next().unwrap_or_default();
        let own = effects.iter().filter(|e| e.id == u.effect).flat_map(|e| &e.parameters);
        if let Some((_, low, high)) = own.filter(|p| p.name == name).find_map(|p| p.shape) {
            *ends = [ends[0].filter(|end| *end >= low), ends[1].filter(|end| *end <= high)];
        }
    }
    out
}

/// Places from one end to the other, by equal factors where both are above 0.
fn between([low, high]: [f64; 2]) -> Vec<f64> {
    const PLACES: usize = 40;
    let at = |k: usize| {
        let share = k as f64 / PLACES as f64;
        if low > 0.0 { low * (high / low).powf(share) } else { low + (high - low) * share }
    };
    (0..=PLACES).map(at).collect()
}

/// χ² as a function of one shape parameter, everything else following.
struct Profile<'a> {
    fit: &'a Fit,
    /// The effect alone, and its columns at any shape.
    alone: (&'a Model, &'a Trials<'a>),
    /// Its unknowns in that model; of an effect of blocks those of one.
    set: Range<usize>,
    effect: &'a Effect,
    /// Index of the shape among the unknowns, and its place among the effect's parameters.
    unknown: usize,
    shape: usize,
    /// Values of the effect's parameters at the solution.
    values: Vec<f64>,
    /// Places of the free sizes among the effect's parameters.
    sizes: Vec<usize>,
    /// Whitened residuals of touches and priors.
    residual: DVector<f64>,
    /// Whitened Jacobian of all free unknowns but the shape and the sizes.
    others: DMatrix<f64>,
    /// Their indices among the unknowns.
    rest: Vec<usize>,
    /// The others' covariance.
    covariance: DMatrix<f64>,
    /// Index of each size among the unknowns.
    unknowns: Vec<usize>,
    /// Rows of the priors in the columns of the sizes, and in that of the shape.
    priors: DMatrix<f64>,
    prior_of_shape: DVector<f64>,
    /// What the effect does at the solution.
    now: DVector<f64>,
}

impl<'a> Profile<'a> {
    /// `alone`: the model of the effect alone, with its columns.
    fn new(fit: &'a Fit, alone: (&'a Model, &'a Trials<'a>), effect: &'a Effect, unknown: usize) -> Option<Self> {
        let set = nonlinear_scan::set_of(alone.0, effect, &fit.model.unknowns[unknown].name)?;
        let own = alone.0.unknowns[set.clone()].iter();
        let places = own
            .map(|own| fit.model.unknowns.iter().position(|u| u.effect == effect.id && u.name == own.name))
            .collect::<Option<Vec<usize>>>()?;
        let shape = places.iter().position(|&i| i == unknown)?;
        let free = |i: usize| fit.free.binary_search(&places[i]).ok();
        let sizes: Vec<usize> =
            (0..places.len()).filter(|&i| effect.parameters[i].shape.is_none() && free(i).is_some()).collect();
        let own: Vec<usize> = sizes.iter().filter_map(|&i| free(i)).collect();
        let here = free(shape);
        let linear = fit.linear(fit.noise.tau_mm);
        let n = fit.data.observations.len();
        let rest: Vec<usize> = (0..fit.free.len()).filter(|c| Some(*c) != here && !own.contains(c)).collect();
        let others = linear.jacobian.select_columns(&rest);
        let products = others.tr_mul(&others);
        let covariance = inverse(&products, &products.diagonal()).inverse;
        let n_priors = linear.jacobian.nrows() - n;
        let prior_rows = linear.jacobian.rows(n, n_priors);
        let priors = prior_rows.select_columns(&own);
        let prior_of_shape = here.map_or_else(|| DVector::zeros(n_priors), |c| prior_rows.column(c).into_owned());
        let mut out = Self {
            fit,
            alone,
            set,
            effect,
            unknown,
            shape,
            values: places.iter().map(|&i| fit.theta[i]).collect(),
            unknowns: sizes.iter().map(|&i| places[i]).collect(),
            sizes,
            residual: linear.residual,
            covariance,
            rest: rest.iter().map(|&c| fit.free[c]).collect(),
            others,
            priors,
            prior_of_shape,
            now: DVector::zeros(0),
        };
        out.now = out.does(out.values[shape]).1;
        Some(out)
    }

    /// Takes out what the user states of the shape itself: its row has no other entry.
    fn drop_prior_of_shape(&mut self) {
        let first = self.residual.len() - self.prior_of_shape.len();
        for (row, slope) in self.prior_of_shape.iter_mut().enumerate().filter(|(_, slope)| **slope != 0.0) {
            *slope = 0.0;
            self.residual[first + row] = 0.0;
        }
    }

    /// Whitened columns of the effect's free sizes at a value of the shape, and what its sizes do there (touches only).
    fn does(&self, at: f64) -> (DMatrix<f64>, DVector<f64>) {
        let mut values = self.values.clone();
        values[self.shape] = at;
        let (model, trials) = self.alone;
        let all = trials.columns(&nonlinear_scan::variant(model, &self.set, &values)).values;
        let mut all = all.columns_range(self.set.clone()).into_owned();
        self.fit.whitening(self.fit.noise.tau_mm).apply(&mut all);
        let size = |i: usize| if self.effect.parameters[i].shape.is_some() { 0.0 } else { values[i] };
        let does = &all * DVector::from_fn(values.len(), |i, _| size(i));
        (all.select_columns(&self.sizes), does)
    }

    /// The values below and above the shape's at which χ² has grown by k².
    fn ends(&self, (sigma, k): (f64, f64), range: [f64; 2]) -> [Option<f64>; 2] {
        let (value, width) = (self.values[self.shape], k * sigma);
        let inside = |at: f64| self.held(at).growth < k * k;
        let end = |side: f64, limit: f64| -> Option<f64> {
            if width.is_nan() || width <= 0.0 {
                return None;
            }
            let (mut last, mut stride) = (value, width / STEPS);
            for step in 0..MOST_STEPS {
                let at = last + side * stride;
                let (at, over) = if side * (at - limit) >= 0.0 { (limit, true) } else { (at, false) };
                if !inside(at) {
                    let (mut from, mut to) = (last, at);
                    for _ in 0..HALVINGS {
                        let middle = 0.5 * (from + to);
                        if inside(middle) { from = middle } else { to = middle }
                    }
                    return Some(0.5 * (from + to));
                }
                if over {
                    return None;
                }
                last = at;
                if step > EVEN {
                    stride *= 1.2;
                }
            }
            None
        };
        [end(-1.0, range[0]), end(1.0, range[1])]
    }

    /// The first and the last moment of a jump that the touches do not contradict, and a place in each stretch between them that they
    /// do not; `stretches`: where it may be, in order.
    fn ends_of_a_jump(&self, stretches: &[Stretch]) -> ([Option<f64>; 2], Vec<f64>) {
        let value = self.values[self.shape];
        let allowed = |at: &Stretch| self.held(at.place).growth < GROWTH_OF_A_JUMP;
        let here = stretches.iter().position(|s| s.ends[0] <= value && value <= s.ends[1]);
        let Some(here) = here else { return ([None, None], Vec::new()) };
        let mut places = vec![value];
        let mut end = |further: &mut dyn Iterator<Item = &Stretch>, side: usize| -> Option<f64> {
            let (mut last, mut beyond) = (stretches[here].ends[side], 0);
            for stretch in further {
                if allowed(stretch) {
                    (last, beyond) = (stretch.ends[side], 0);
                    places.push(stretch.place);
                } else {
                    beyond += 1;
                }
                if beyond == LOOKED_AHEAD {
                    break;
                }
            }
            // up to the last touch there is nothing that would speak against a jump behind it
            (beyond > 0).then_some(last)
        };
        let ends = [end(&mut stretches[..here].iter().rev(), 0), end(&mut stretches[here + 1..].iter(), 1)];
        (ends, places)
    }

    /// Values of the shape over all of its range, near to each other; n of them where they are many.
    fn all_places(&self, p: &Parameter) -> Vec<f64> {
        if p.between.is_some() {
            return nonlinear_scan::all_tried(p, &self.fit.data);
        }
        nonlinear_scan::fine(p, self.fit.data.observations.len(), &|at| self.does(at).0)
    }

    /// Values beyond the ends of the first crossing that the touches allow as well, with by how much χ² is higher there.
    fn beyond(&self, places: &[f64], [low, high]: [Option<f64>; 2], growth: f64) -> Vec<(f64, f64)> {
        let outside = |at: f64| low.is_some_and(|low| at < low) || high.is_some_and(|high| at > high);
        let growth_at = |at: f64| self.held(at).growth;
        let growths: Vec<f64> = places.par_iter().map(|&at| growth_at(at)).collect();
        let neighbour = |by: usize| growths.get(by).copied().unwrap_or(f64::INFINITY);
        let mut out = Vec::new();
        for k in 0..places.len() {
            // a value that is worse than the one beside it belongs to that one
            let lowest = growths[k] <= neighbour(k.wrapping_sub(1)) && growths[k] <= neighbour(k + 1);
            if !lowest || growths[k] >= NEARLY * growth {
                continue;
            }
            let (mut from, mut to) = (places[k.saturating_sub(1)], places[(k + 1).min(places.len() - 1)]);
            for _ in 0..HALVINGS {
                let third = (to - from) / 3.0;
                if growth_at(from + third) < growth_at(to - third) { to -= third } else { from += third }
            }
            let best = 0.5 * (from + to);
            let least = growth_at(best);
            if least < growth && outside(best) {
                out.push((best, least));
            }
        }
        out
    }

    /// Intervals of everything else that is told, beside values of the shape that fit as well.
    fn widen_others(&self, places: &[f64], room: &dyn Fn(f64) -> Room, spread: &Spread, out: &mut Intervals) {
        let held: Vec<Held> = places.iter().map(|&at| self.held(at)).collect();
        for (r, &unknown) in self.rest.iter().enumerate() {
            let Some((sigma, k)) = spread(unknown) else { continue };
            let beside = held.iter().filter_map(|h| {
                let factor = room(k).factor(h.growth)?;
                h.others.get(r).map(|of| (*of, factor.min(k)))
            });
            let value = self.fit.theta[unknown];
            let typical = self.fit.model.unknowns[unknown].typical;
            self.found(unknown, with_all((value, sigma, k), beside), (value, k * sigma, typical), out);
        }
    }

    /// Intervals of the sizes: all that each may be beside some places of the shape.
    fn widen(&self, places: &[f64], room: &dyn Fn(f64) -> Room, spread: &Spread, out: &mut Intervals) {
        let held: Vec<Held> = places.iter().map(|&at| self.held(at)).collect();
        let lowest = held.iter().map(|h| h.growth).fold(0.0, f64::min);
        for (c, (&i, &unknown)) in self.sizes.iter().zip(&self.unknowns).enumerate() {
            let Some((sigma, k)) = spread(unknown) else { continue };
            let beside = held.iter().filter_map(|h| {
                let factor = room(k).factor(h.growth - lowest)?;
                h.sizes.get(c).map(|of| (*of, factor))
            });
            let (value, typical) = (self.values[i], self.effect.parameters[i].typical);
            self.found(unknown, with_all((value, sigma, k), beside), (value, k * sigma, typical), out);
        }
    }

    /// The ends of an interval, or none where it may be much else.
    fn found(
        &self,
        unknown: usize,
        ends: [Option<f64>; 2],
        (value, usual, typical): (f64, f64, f64),
        out: &mut Intervals,
    ) {
        let told = is_told(ends, value, usual, typical);
        also(&mut out.ends, unknown, if told { ends } else { [None, None] });
        if !told {
            out.lost_beside.entry(unknown).or_default().insert(self.unknown);
        }
    }
}

impl Profile<'_> {
    /// Sizes that run away along with a shape that is held at an end of its range: how large they are is what the end was chosen to
    /// be, and no interval holds that.
    fn size_runs_along(&self, [low, high]: [f64; 2], spread: &Spread, out: &mut BTreeMap<usize, [Option<f64>; 2]>) {
        /// The range would end so much earlier.
        const SHARE: f64 = 0.2;
        let value = self.values[self.shape];
        let part = |end: f64| SHARE * if low > 0.0 { end } else { high - low };
        let inner = match value {
            v if v == low => low + part(low),
            v if v == high => high - part(high),
            _ => return,
        };
        let (at, aside) = (self.held(value), self.held(inner));
        for (&unknown, (one, other)) in self.unknowns.iter().zip(at.sizes.iter().zip(&aside.sizes)) {
            let Some((sigma, k)) = spread(unknown) else { continue };
            if (one.0 - other.0).abs() > k * sigma {
                out.insert(unknown, [None, None]);
            }
        }
    }
}
