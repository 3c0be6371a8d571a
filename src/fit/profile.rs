//! The likelihood profile of a shape parameter (a time constant, a pitch, a moment): its 95 % interval, other local minima, and the
//! intervals of what depends on it.
//!
//! A size enters the touches linearly, and its interval is as wide on either side. A shape does not: a time constant that came out
//! too short looks better known than it is. So the shape is held at one value after another over its whole range, everything else
//! follows linearly, and the interval ends where χ² has grown by k² (D. M. Bates and D. G. Watts, *Nonlinear Regression Analysis
//! and Its Applications*, 1988, section 6.1). Where the touches allow several values of the shape, the interval of every other
//! unknown is the union of its intervals beside each of them.

use super::Fit;
use super::candidates::Trials;
use super::nonlinear_scan::{self, Stretch};
use super::shape_search::ShapeSearch;
use crate::machine::Machine;
use crate::model::catalogue::{Effect, Parameter};
use crate::model::predict::{Model, Unknown};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Halvings between two values of the scan.
const HALVINGS: usize = 30;

/// χ² grows by this much at the ends of the 95 % interval of a moment at which something jumps: it is flat between two touches
/// and a random walk from one to the next (B. E. Hansen, Econometrica 68, 2000, p. 575, table I).
const GROWTH_OF_A_JUMP: f64 = 7.35;

/// χ² grows by this much at the ends of a 95 % interval.
const GROWTH_95: f64 = 3.841;

/// A value of the scan at which χ² has grown by no more than so many times the limit may have a better one beside it.
const NEARLY: f64 = 8.0;

/// So many moments behind one that the touches contradict are looked at before the rest counts as contradicted.
const LOOKED_AHEAD: usize = 40;

/// An end of an interval; `None` where the touches set none.
pub type Ends = [Option<f64>; 2];

/// What the profiles say, by index among the unknowns.
#[derive(Debug, Default)]
pub struct Intervals {
    /// 95 % intervals of shape parameters and of what depends on them, in their units. Both ends of what is not a shape are open
    /// where it may be so much else beside another value of a shape that it is not determined.
    pub ends: BTreeMap<usize, Ends>,
    /// Other values of a shape parameter that fit about as well, the best first.
    pub other_values: BTreeMap<usize, Vec<f64>>,
}

/// Standard uncertainty and t-factor of a free unknown, by its index among all; none where it is not determined.
pub type Spread<'a> = dyn Fn(usize) -> Option<(f64, f64)> + 'a;

/// The best of so many values is better by chance, as χ² falls.
fn by_chance(tried: usize) -> f64 {
    2.0 * (tried.max(1) as f64).ln()
}

/// Profiles of the shape parameters that are `asked` for.
#[must_use]
pub fn intervals(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    search: &ShapeSearch,
    (asked, spread): (&dyn Fn(&Unknown) -> bool, &Spread),
) -> Intervals {
    let mut out = Intervals::default();
    let has_asked = |effect: &Effect| fit.model.unknowns.iter().any(|u| u.shape && u.effect == effect.id && asked(u));
    for effect in effects.iter().filter(|e| has_asked(e)) {
        let model = Model::new(machine, &[effect], &fit.data.set_ups, fit.model.reference);
        let trials = Trials::new(&model, &fit.data.observations);
        // an effect of blocks has a set of parameters for each
        for (u, p) in model.unknowns.iter().zip(effect.parameters.iter().cycle()).filter(|(u, _)| u.shape && asked(u)) {
            let unknown = fit.model.unknowns.iter().position(|v| v.effect == u.effect && v.name == u.name);
            let by_search = search.jumps.contains(&u.name) || search.held.contains(&u.name);
            let Some(unknown) = unknown.filter(|i| by_search || fit.free.contains(i)) else { continue };
            let Some(profile) = Profile::new(fit, (&model, &trials), effect, unknown) else { continue };
            if search.jumps.contains(&u.name) {
                profile.of_a_jump(p, spread, &mut out);
            } else {
                profile.of_a_smooth_shape(p, spread, &mut out);
            }
        }
    }
    // a straight line beside another shape may lead out of a range
    for (i, ends) in &mut out.ends {
        if let Some([low, high]) = nonlinear_scan::range_of(&fit.model.unknowns[*i], effects) {
            *ends = [ends[0].filter(|end| *end >= low), ends[1].filter(|end| *end <= high)];
        }
    }
    out
}

/// A shape parameter as the touches alone determine it, without what the user states of it.
pub struct WithoutPrior {
    /// Its best value, in its unit.
    pub value: f64,
    /// 95 % interval; an end of its range where the touches set none.
    pub interval: [f64; 2],
    /// By how much χ² falls.
    pub falls: f64,
}

/// The best value and interval of a shape parameter without its prior, or without being held. `scale2`: the variance of the touches'
/// scatter, as a multiple of their noise, where χ² falls by so much.
#[must_use]
pub fn without_prior(
    fit: &Fit,
    machine: &Machine,
    effects: &[&Effect],
    unknown: usize,
    scale2: impl Fn(f64) -> f64,
) -> Option<WithoutPrior> {
    let u = &fit.model.unknowns[unknown];
    let effect = effects.iter().find(|e| e.id == u.effect)?;
    let p = effect.parameters.iter().find(|p| p.name == u.own_name())?;
    let (_, low, high) = p.shape?;
    let model = Model::new(machine, &[effect], &fit.data.set_ups, fit.model.reference);
    let trials = Trials::new(&model, &fit.data.observations);
    let mut profile = Profile::new(fit, (&model, &trials), effect, unknown)?;
    let whole = profile.residual.norm_squared();
    profile.drop_prior_of_shape();
    let scan = profile.scan(p);
    let (value, least) = profile.minima(&scan, f64::INFINITY).into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    // what the others would still gain, where they have not settled, they gain at any value
    let falls = whole - profile.residual.norm_squared() + profile.growth(profile.values[profile.shape]) - least;
    let ends = profile.ends(&scan, value, least + GROWTH_95 * scale2(falls));
    Some(WithoutPrior { value, interval: [ends[0].unwrap_or(low), ends[1].unwrap_or(high)], falls })
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

/// Some of the values that fit best, the best first; those that are next to a better one are the same.
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

/// Values of a shape over its range, in order, with by how much χ² is higher there.
type Scan = Vec<(f64, f64)>;

/// What follows while a shape is held.
struct Held {
    /// By how much χ² has grown.
    growth: f64,
    /// Value and standard uncertainty of each of the profile's followers.
    followers: Vec<(f64, f64)>,
}

/// Which values of a shape the touches allow, and what of the other unknowns depends on that.
struct Allowed<'p> {
    places: &'p [f64],
    /// χ² may grow by so much more than k²; none at a moment of a jump, which has a limit of its own.
    chance: Option<f64>,
    /// The shape is not determined: then nothing else is surer than beside any allowed value.
    all_followers: bool,
    /// An interval is called one if it reaches no further than so many usual sizes, or twice its usual width.
    typical_sizes: f64,
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
    /// Indices among the unknowns of all that follows: the sizes first, then the rest.
    followers: Vec<usize>,
    /// Whitened residuals of touches and priors.
    residual: DVector<f64>,
    /// Whitened Jacobian of the rest, and its covariance.
    rest: DMatrix<f64>,
    covariance: DMatrix<f64>,
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
        let index = |own: &Unknown| fit.model.unknowns.iter().position(|u| u.effect == effect.id && u.name == own.name);
        let places = alone.0.unknowns[set.clone()].iter().map(index).collect::<Option<Vec<usize>>>()?;
        let shape = places.iter().position(|&i| i == unknown)?;
        let column = |i: usize| fit.free.binary_search(&places[i]).ok();
        let is_size = |i: &usize| effect.parameters[*i].shape.is_none() && column(*i).is_some();
        let sizes: Vec<usize> = (0..places.len()).filter(is_size).collect();
        let own: Vec<usize> = sizes.iter().filter_map(|&i| column(i)).collect();
        let here = column(shape);
        let linear = fit.linear(fit.noise.tau_mm);
        let rest: Vec<usize> = (0..fit.free.len()).filter(|c| Some(*c) != here && !own.contains(c)).collect();
        let columns = linear.jacobian.select_columns(&rest);
        let products = columns.tr_mul(&columns);
        let n = fit.data.observations.len();
        let n_priors = linear.jacobian.nrows() - n;
        let prior_rows = linear.jacobian.rows(n, n_priors);
        let mut out = Self {
            fit,
            alone,
            set,
            effect,
            unknown,
            shape,
            values: places.iter().map(|&i| fit.theta[i]).collect(),
            sizes,
            followers: own.iter().chain(&rest).map(|&c| fit.free[c]).collect(),
            covariance: Inverse::new(&products, &products.diagonal()).inverse,
            rest: columns,
            priors: prior_rows.select_columns(&own),
            prior_of_shape: here.map_or_else(|| DVector::zeros(n_priors), |c| prior_rows.column(c).into_owned()),
            residual: linear.residual,
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

    /// The interval of a moment at which something jumps. Any of the moments in it may be the right one, and everything else is
    /// as it is beside that one.
    fn of_a_jump(&self, p: &Parameter, spread: &Spread, out: &mut Intervals) {
        let block = self.fit.model.unknowns[self.unknown].block();
        let (ends, places) = self.ends_of_a_jump(&nonlinear_scan::stretches_of_a_jump(p, &self.fit.data, block));
        out.ends.insert(self.unknown, ends);
        let allowed = Allowed { places: &places, chance: None, all_followers: true, typical_sizes: 5.0 };
        self.widen(&allowed, spread, out);
    }

    /// Interval and other minima of a shape on which the touches depend smoothly.
    fn of_a_smooth_shape(&self, p: &Parameter, spread: &Spread, out: &mut Intervals) {
        let Some((_, low, high)) = p.shape else { return };
        let scan = self.scan(p);
        let is_free = self.fit.free.binary_search(&self.unknown).is_ok();
        let Some((_, k)) = spread(self.unknown).filter(|_| is_free) else {
            // it is not determined: it may be any of those that were tried
            let mut places: Vec<f64> = scan.iter().map(|s| s.0).collect();
            places.extend([low, high]);
            let chance = Some(by_chance(places.len()));
            let allowed = Allowed { places: &places, chance, all_followers: true, typical_sizes: 5.0 };
            return self.widen(&allowed, spread, out);
        };
        let ends = self.ends(&scan, self.values[self.shape], k * k);
        let is_beyond = |at: f64| ends[0].is_some_and(|low| at < low) || ends[1].is_some_and(|high| at > high);
        let mut others = self.minima(&scan, k * k + by_chance(scan.len()));
        others.retain(|(at, _)| is_beyond(*at));
        let beyond: Vec<f64> = others.iter().map(|o| o.0).collect();
        let with_all =
            |end: Option<f64>, pick: fn(f64, f64) -> f64| end.map(|end| beyond.iter().copied().fold(end, pick));
        out.ends.insert(self.unknown, [with_all(ends[0], f64::min), with_all(ends[1], f64::max)]);
        let mut places = between([ends[0].unwrap_or(low), ends[1].unwrap_or(high)]);
        places.extend(&beyond);
        let is_unique = beyond.is_empty();
        self.widen(
            &Allowed {
                places: &places,
                chance: Some(if is_unique { 0.0 } else { by_chance(scan.len()) }),
                all_followers: !is_unique,
                typical_sizes: if is_unique { 5.0 } else { 0.0 },
            },
            spread,
            out,
        );
        if !is_unique {
            out.other_values.insert(self.unknown, best_of(others));
        }
    }

    /// χ² over the whole range, at values near to each other, and at the solution.
    fn scan(&self, p: &Parameter) -> Scan {
        let mut places = if p.between.is_some() {
            nonlinear_scan::all_tried(p, &self.fit.data)
        } else {
            nonlinear_scan::fine(p, self.fit.data.observations.len(), &|at| self.does(at).0)
        };
        places.push(self.values[self.shape]);
        places.sort_by(f64::total_cmp);
        places.dedup();
        places.par_iter().map(|&at| (at, self.growth(at))).collect()
    }

    /// Local minima at which χ² has grown by less than a limit, each with its growth.
    fn minima(&self, scan: &Scan, limit: f64) -> Vec<(f64, f64)> {
        let growth = |by: usize| scan.get(by).map_or(f64::INFINITY, |s| s.1);
        let mut out = Vec::new();
        for k in 0..scan.len() {
            // a value that is worse than the one beside it belongs to that one
            let is_lowest = growth(k) <= growth(k.wrapping_sub(1)) && growth(k) <= growth(k + 1);
            if !is_lowest || growth(k) >= NEARLY * limit {
                continue;
            }
            let (mut from, mut to) = (scan[k.saturating_sub(1)].0, scan[(k + 1).min(scan.len() - 1)].0);
            for _ in 0..HALVINGS {
                let third = (to - from) / 3.0;
                if self.growth(from + third) < self.growth(to - third) { to -= third } else { from += third }
            }
            let best = 0.5 * (from + to);
            let least = self.growth(best);
            if least < limit {
                out.push((best, least));
            }
        }
        out
    }

    /// The nearest values below and above one of the shape's at which χ² has grown by a limit; none where the range ends before.
    fn ends(&self, scan: &Scan, value: f64, limit: f64) -> Ends {
        let is_inside = |growth: f64| growth < limit;
        let end = |further: &mut dyn Iterator<Item = &(f64, f64)>| -> Option<f64> {
            let (mut inside, mut outside) = (value, None);
            for &(at, growth) in further {
                if !is_inside(growth) {
                    outside = Some(at);
                    break;
                }
                inside = at;
            }
            let mut outside = outside?;
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                if is_inside(self.growth(middle)) { inside = middle } else { outside = middle }
            }
            Some(0.5 * (inside + outside))
        };
        let below = scan.partition_point(|s| s.0 < value);
        let above = scan.partition_point(|s| s.0 <= value);
        [end(&mut scan[..below].iter().rev()), end(&mut scan[above..].iter())]
    }

    /// The first and the last moment of a jump that the touches do not contradict, and a place in each stretch between them that they
    /// do not; `stretches`: where it may be, in order.
    fn ends_of_a_jump(&self, stretches: &[Stretch]) -> (Ends, Vec<f64>) {
        let value = self.values[self.shape];
        let here = stretches.iter().position(|s| s.ends[0] <= value && value <= s.ends[1]);
        let Some(here) = here else { return ([None, None], Vec::new()) };
        let mut places = vec![value];
        let mut end = |further: &mut dyn Iterator<Item = &Stretch>, side: usize| -> Option<f64> {
            let (mut last, mut beyond) = (stretches[here].ends[side], 0);
            for stretch in further {
                if self.growth(stretch.place) < GROWTH_OF_A_JUMP {
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

    /// Intervals of what follows: all that it may be beside the allowed values of the shape.
    fn widen(&self, allowed: &Allowed, spread: &Spread, out: &mut Intervals) {
        const MUCH_ELSE: f64 = 2.0;
        let held: Vec<Held> = allowed.places.iter().map(|&at| self.held(at)).collect();
        let lowest = held.iter().map(|h| h.growth).fold(0.0, f64::min);
        let n = if allowed.all_followers { self.followers.len() } else { self.sizes.len() };
        for (c, &unknown) in self.followers[..n].iter().enumerate() {
            let Some((sigma, k)) = spread(unknown) else { continue };
            let (limit, most) = match (allowed.chance, c < self.sizes.len()) {
                (None, _) => (GROWTH_OF_A_JUMP, k),
                (Some(chance), true) => (k * k + chance, f64::INFINITY),
                (Some(chance), false) => (k * k + chance, k),
            };
            let (value, usual) = (self.fit.theta[unknown], k * sigma);
            let (mut low, mut high) = (value - usual, value + usual);
            for h in &held {
                let left = limit - (h.growth - lowest);
                if let Some((at, sigma)) = h.followers.get(c).filter(|_| left > 0.0) {
                    let by = sigma * left.sqrt().min(most);
                    (low, high) = (low.min(at - by), high.max(at + by));
                }
            }
            let room = (MUCH_ELSE * usual).max(allowed.typical_sizes * self.fit.model.unknowns[unknown].typical);
            let is_determined = value - low <= room && high - value <= room;
            let ends = if is_determined { [Some(low), Some(high)] } else { [None, None] };
            // beside each of several shapes it may be something else
            let known = out.ends.entry(unknown).or_insert(ends);
            *known = [known[0].zip(ends[0]).map(|(a, b)| a.min(b)), known[1].zip(ends[1]).map(|(a, b)| a.max(b))];
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

    /// By how much χ² grows while the shape is held at a value.
    fn growth(&self, at: f64) -> f64 {
        self.held(at).growth
    }

    /// What χ² and all that follows are while the shape is held at a value.
    fn held(&self, at: f64) -> Held {
        /// What moves by more than this share of its usual size along with something that leaves no trace leaves none either.
        const NO_TRACE: f64 = 0.01;
        let (columns, does) = self.does(at);
        let n = columns.nrows();
        if does.iter().any(|x| !x.is_finite()) {
            return Held { growth: f64::INFINITY, followers: Vec::new() };
        }
        let mut y = self.residual.clone();
        let mut touches = y.rows_mut(0, n);
        touches += does - &self.now;
        let n_priors = y.len() - n;
        let mut known = y.rows_mut(n, n_priors);
        known += &self.prior_of_shape * (at - self.values[self.shape]);
        let mut a = DMatrix::zeros(y.len(), columns.ncols());
        a.rows_mut(0, n).copy_from(&columns);
        a.rows_mut(n, n_priors).copy_from(&self.priors);
        let follow = &self.covariance * self.rest.tr_mul(&a);
        let followed = &self.covariance * self.rest.tr_mul(&y);
        // what the rest cannot do, row by row: as a difference of products what is next to nothing would be rounding
        let own = &a - &self.rest * &follow;
        let left = &y - &self.rest * &followed;
        let slope = own.tr_mul(&left);
        let raw = DVector::from_iterator(a.ncols(), a.column_iter().map(|c| c.norm_squared()));
        let gram = own.tr_mul(&own);
        // a size with hardly a trace here would fit with any value, of metres: a wide prior keeps it within what machines have
        let typical = |c: usize| self.fit.model.unknowns[self.followers[c]].typical;
        let value = DVector::from_fn(self.sizes.len(), |c, _| self.values[self.sizes[c]]);
        let prior = DVector::from_fn(self.sizes.len(), |c, _| {
            (nonlinear_scan::CREDIBLE * typical(c).max(value[c].abs())).powi(-2)
        });
        let from_prior = |size: &DVector<f64>| size.component_mul(&prior).dot(size);
        let lost = Inverse::new(&gram, &raw).lost;
        let inverse = Inverse::new(&(&gram + DMatrix::from_diagonal(&prior)), &raw).inverse;
        let step = &inverse * (&slope + prior.component_mul(&value));
        let growth = left.norm_squared() - 2.0 * slope.dot(&step) + step.dot(&(&gram * &step))
            - self.residual.norm_squared()
            + from_prior(&(&value - &step))
            - from_prior(&value);
        // a size that leaves no trace here may be anything, and so may what follows it
        let free: Vec<DVector<f64>> = lost
            .iter()
            .map(|v| v / v.iter().enumerate().map(|(c, w)| w.abs() / typical(c)).fold(0.0, f64::max))
            .collect();
        let sigma = |along: f64, c: usize, variance: f64| {
            if along > NO_TRACE * typical(c) { f64::INFINITY } else { variance.max(0.0).sqrt() }
        };
        let of_sizes = (0..self.sizes.len()).map(|c| {
            let along = free.iter().map(|v| v[c].abs()).fold(0.0, f64::max);
            (value[c] - step[c], sigma(along, c, inverse[(c, c)]))
        });
        // how the rest moves while it and the sizes settle, and how far it scatters there
        let moved = &follow * &step - &followed;
        let scatter = &follow * &inverse;
        let of_rest = (0..self.covariance.nrows()).map(|r| {
            let c = self.sizes.len() + r;
            let variance = self.covariance[(r, r)] + scatter.row(r).dot(&follow.row(r));
            let along = free.iter().map(|v| (follow.row(r) * v).x.abs()).fold(0.0, f64::max);
            (self.fit.theta[self.followers[c]] + moved[r], sigma(along, c, variance))
        });
        Held { growth, followers: of_sizes.chain(of_rest).collect() }
    }
}

/// The inverse of a matrix of products, without what leaves no trace in it, and the directions that leave none.
struct Inverse {
    inverse: DMatrix<f64>,
    lost: Vec<DVector<f64>>,
}

impl Inverse {
    /// `raw`: the squares by which it is scaled.
    fn new(gram: &DMatrix<f64>, raw: &DVector<f64>) -> Self {
        /// Smaller eigenvalues of the scaled matrix are rounding.
        const LEAST: f64 = 1e-10;
        let scale = raw.map(|v| if v > 0.0 { v.sqrt() } else { 1.0 });
        let n = gram.nrows();
        if n == 0 {
            return Self { inverse: gram.clone(), lost: Vec::new() };
        }
        let eigen = DMatrix::from_fn(n, n, |a, b| gram[(a, b)] / (scale[a] * scale[b])).symmetric_eigen();
        let of = |v: f64| if v > LEAST { 1.0 / v } else { 0.0 };
        let inverse =
            &eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(of)) * eigen.eigenvectors.transpose();
        let lost = (0..n).filter(|&k| eigen.eigenvalues[k] <= LEAST);
        Self {
            inverse: DMatrix::from_fn(n, n, |a, b| inverse[(a, b)] / (scale[a] * scale[b])),
            lost: lost.map(|k| eigen.eigenvectors.column(k).component_div(&scale)).collect(),
        }
    }
}
