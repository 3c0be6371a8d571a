//! Which further touches part effects best: greedy Bayesian D_s start, then exchange for the named pairs.
//!
//! Each bundle adds its information matrix over the model's unknowns and the effects in question. What the model's
//! unknowns (set-ups of blocks among them) take is projected out by the Schur complement: locating a new block earns no
//! credit.

use super::bundle::{Bundle, cost_s};
use super::linearised_plan::LinearisedPlan;
use super::questions::{Pair, Questions};
use crate::fit::candidates::without_value;
use crate::model::catalogue::Effect;
use crate::search::distinguishability::{Left, Products, chance};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// More separation than this is worth no further touch: 25 tells two effects apart nearly always.
const ENOUGH: f64 = 50.0;

/// Share of separation beyond enough that still counts, so that a tie goes to the clearer answer.
const BEYOND: f64 = 1e-3;

/// Prior of the model's unknowns, in typical sizes: wide, for a firm start only.
const WIDE: f64 = 30.0;

/// Information about an effect before any touch, per square of its typical size: the choice works with the inverse.
const FAINT: f64 = 1e-3;

/// Rounds of the exchange at most.
const MOST_ROUNDS: usize = 12;

/// Bundles that one round of the exchange tries to leave out.
const MOST_OUT: usize = 6;

/// Bundles that the exchange may take in: so many of those that are worth most, before the choice and beside it.
const MOST_IN: usize = 60;

/// Bundles that are looked at together.
const AT_ONCE: usize = 8;

/// Information about the model's unknowns and the effects in question, bundle by bundle.
#[derive(Debug, Clone)]
pub struct Design {
    n_base: usize,
    /// Columns of each effect, behind those of the base.
    spans: Vec<(String, Range<usize>)>,
    /// Size of each effect in typical sizes; `None`: the mean over random signs of typical ones.
    sizes: Vec<Option<DVector<f64>>>,
    /// What there is already, with the prior of the base.
    given: DMatrix<f64>,
    /// Rows of the touches of all bundles, and which of them are of each.
    rows: DMatrix<f64>,
    ranges: Vec<Range<usize>>,
    /// The pairs, by their effects.
    asked: Vec<(usize, Option<usize>)>,
}

/// How well a pair is told apart.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Separation {
    /// Id of one effect.
    pub one: String,
    /// Id of the other; none: whether the first is there at all.
    pub other: Option<String>,
    /// Noncentrality of what would be left if one were taken for the other, with the data so far.
    pub before: f64,
    /// The same with the further touches.
    pub after: f64,
    /// Probability that `diagnose` tells them apart by all touches.
    pub told: f64,
    /// The same where the room's temperature turns during the further touches; none where that makes no difference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub told_if_room_turns: Option<f64>,
    /// Noncentrality with that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub after_if_room_turns: Option<f64>,
}

impl Separation {
    /// The larger of the noncentralities with the further touches.
    #[must_use]
    pub fn most(&self) -> f64 {
        self.after.max(self.after_if_room_turns.unwrap_or(0.0))
    }
}

/// Whitened columns in typical sizes: the model's free unknowns, whose number stands beside them, then the effects that it leaves out.
#[must_use]
pub fn typical_columns(view: &LinearisedPlan) -> (DMatrix<f64>, usize) {
    let n_base = view.free.len();
    let mut columns = view.jacobian.clone();
    for (mut column, &i) in columns.column_iter_mut().zip(&view.free) {
        column *= view.model.unknowns[i].typical;
    }
    let own = view.library.matrix();
    let mut all = columns.resize_horizontally(n_base + own.ncols(), 0.0);
    all.columns_mut(n_base, own.ncols()).copy_from(&own);
    (all, n_base)
}

impl Design {
    /// `view`: all touches so far and then those of the pool, with the columns of the effects in question.
    /// `n_given`: how many touches there are already.
    #[must_use]
    pub fn new(view: &LinearisedPlan, n_given: usize, pool: &[Bundle], questions: &Questions) -> Self {
        let (columns, n_base) = typical_columns(view);
        let mut spans = Vec::new();
        for c in view.library.candidates() {
            let span = &c.variants[0].columns;
            spans.push((c.id.clone(), n_base + span.start..n_base + span.end));
        }
        let gram = |rows: Range<usize>| {
            let part = columns.rows(rows.start, rows.len());
            part.tr_mul(&part)
        };
        let mut given = gram(0..n_given);
        // rows that are no touches: what is known beside them
        given += gram(view.n_touches()..columns.nrows());
        for i in 0..n_base {
            given[(i, i)] += 1.0 / (WIDE * WIDE);
        }
        let rows = columns.rows(n_given, view.n_touches() - n_given).into_owned();
        let mut at = 0;
        let ranges: Vec<Range<usize>> = pool
            .iter()
            .map(|b| {
                at += b.touches.len();
                at - b.touches.len()..at
            })
            .collect();
        let find = |id: &str| spans.iter().position(|(s, _)| s == id);
        let asked = questions
            .pairs
            .iter()
            .filter_map(|p: &Pair| {
                let other = match &p.other {
                    Some(id) => Some(find(id)?),
                    None => None,
                };
                Some((find(&p.one)?, other))
            })
            .collect();
        let size = |(id, span): &(String, Range<usize>)| {
            questions.suspects.iter().find(|s| s.id == *id).map(|s| s.size.clone()).filter(|t| t.len() == span.len())
        };
        let sizes = spans.iter().map(size).collect();
        Self { n_base, spans, sizes, given, rows, ranges, asked }
    }

    fn span(&self, effect: usize) -> Range<usize> {
        let r = &self.spans[effect].1;
        r.start - self.n_base..r.end - self.n_base
    }

    /// Noncentralities of the pairs, the worse way of each, for the choice: without the ranks that the statement has. `s`:
    /// information about the effects, what the base takes projected out.
    fn separations(&self, s: &DMatrix<f64>) -> Vec<f64> {
        let part = |rows: &Range<usize>, columns: &Range<usize>| {
            s.view((rows.start, columns.start), (rows.len(), columns.len()))
        };
        // each effect at its size, as seen by all; one column for each parameter where there is no size
        let seen: Vec<DMatrix<f64>> = (0..self.spans.len())
            .map(|k| {
                let columns = s.columns(self.span(k).start, self.span(k).len());
                match &self.sizes[k] {
                    Some(theta) => DMatrix::from_column_slice(s.nrows(), 1, (columns * theta).as_slice()),
                    None => columns.into_owned(),
                }
            })
            .collect();
        let own: Vec<f64> = (0..self.spans.len())
            .map(|k| {
                let mine = seen[k].rows(self.span(k).start, self.span(k).len());
                match &self.sizes[k] {
                    Some(theta) => theta.dot(&mine.column(0)),
                    None => mine.trace(),
                }
            })
            .collect();
        let factors: Vec<Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>> = (0..self.spans.len())
            .map(|k| {
                let span = self.span(k);
                let mut block = part(&span, &span).into_owned();
                let floor = 1e-9 * block.trace().max(1e-12);
                for i in 0..block.nrows() {
                    block[(i, i)] += floor;
                }
                block.cholesky()
            })
            .collect();
        let left = |a: usize, b: usize| {
            let span = self.span(b);
            let cross = seen[a].rows(span.start, span.len()).into_owned();
            let taken = factors[b].as_ref().map_or(0.0, |c| cross.dot(&c.solve(&cross)));
            (own[a] - taken).max(0.0)
        };
        let each = self.asked.iter().map(|&(a, b)| b.map_or(own[a].max(0.0), |b| left(a, b).min(left(b, a))));
        each.collect()
    }

    /// What the exchange maximises: separations, as far as they are worth anything.
    fn worth(&self, s: &DMatrix<f64>) -> f64 {
        self.separations(s).iter().map(|l| l.min(ENOUGH) + BEYOND * (l - ENOUGH).max(0.0).sqrt()).sum()
    }

    fn information(&self, chosen: &[usize]) -> DMatrix<f64> {
        chosen.iter().fold(self.given.clone(), |sum, &i| {
            let rows = self.rows.rows(self.ranges[i].start, self.ranges[i].len());
            sum + rows.tr_mul(&rows)
        })
    }

    /// Separations of the pairs by the touches so far and with a choice, by the criterion of the diagnosis.
    #[must_use]
    pub fn separated(&self, chosen: &[usize]) -> Vec<Separation> {
        let before = Products::of_information(&self.given, self.n_base);
        let after = Products::of_information(&self.information(chosen), self.n_base);
        let each = self.asked.iter().map(|&(a, b)| {
            let of = |products: &Option<Products>| {
                let size = |k: usize| self.sizes[k].as_ref();
                let other = b.map(|b| (self.span(b), size(b)));
                products.as_ref().map_or(Left { lambda: 0.0, q: 0 }, |p| {
                    p.apart((&self.span(a), size(a)), other.as_ref().map(|(span, size)| (span, *size)))
                })
            };
            let (before, after) = (of(&before), of(&after));
            Separation {
                one: self.spans[a].0.clone(),
                other: b.map(|b| self.spans[b].0.clone()),
                before: before.lambda,
                after: after.lambda,
                told: chance(after.lambda, after.q),
                told_if_room_turns: None,
                after_if_room_turns: None,
            }
        });
        each.collect()
    }

    /// Chooses bundles within a time, s.
    #[must_use]
    pub fn choose(&self, pool: &[Bundle], budget_s: f64) -> Vec<usize> {
        let Some(start) = Choice::start(self) else { return Vec::new() };
        let pool: Vec<&Bundle> = pool.iter().collect();
        let pool = pool.as_slice();
        let worth = |s: &DMatrix<f64>| self.worth(s);
        // D_s finds its way where no single bundle parts a pair yet; the pairs' own worth is the other start
        let ways: [&[&Value]; 2] = [&[&d_s, &worth], &[&worth]];
        let found = ways.into_par_iter().map(|way| {
            let mut choice = start.clone();
            let mut few = Vec::new();
            for value in way {
                let gains = choice.gains(self, pool, value);
                few.extend(gains.iter().map(|(i, _)| *i).take(MOST_IN));
                choice.fill(self, pool, budget_s, gains, value);
            }
            // the exchange knows few bundles: the chosen ones, those that were worth most before, and those beside the chosen ones
            let beside = choice.gains(self, pool, &worth).into_iter().map(|(i, _)| i).take(MOST_IN);
            few.extend(beside);
            few.retain(|i| !choice.chosen.contains(i));
            few.sort_unstable();
            few.dedup();
            let few = [&choice.chosen[..], &few[..]].concat();
            let design = self.only(&few);
            let mut choice = choice.only(self, &few);
            choice.exchange(&design, &few.iter().map(|i| pool[*i]).collect::<Vec<_>>(), budget_s);
            (design.worth(&choice.effects(&design)), choice.chosen.into_iter().map(|i| few[i]).collect())
        });
        let nothing = (self.worth(&start.effects(self)), Vec::new());
        // ties go to the first: the same choice in every run
        let best = found.collect::<Vec<_>>().into_iter().fold(nothing, |a, b| if b.0 > a.0 { b } else { a });
        self.thinned(pool, best.1)
    }

    fn rows_of(&self, few: &[usize]) -> Vec<usize> {
        few.iter().flat_map(|i| self.ranges[*i].clone()).collect()
    }

    /// With these bundles only.
    fn only(&self, few: &[usize]) -> Self {
        let mut at = 0;
        let ranges = few.iter().map(|i| {
            at += self.ranges[*i].len();
            at - self.ranges[*i].len()..at
        });
        let ranges = ranges.collect();
        Self {
            n_base: self.n_base,
            spans: self.spans.clone(),
            sizes: self.sizes.clone(),
            given: self.given.clone(),
            rows: self.rows.select_rows(&self.rows_of(few)),
            ranges,
            asked: self.asked.clone(),
        }
    }

    /// Without the bundles that no pair needs.
    fn thinned(&self, pool: &[&Bundle], mut chosen: Vec<usize>) -> Vec<usize> {
        let worth = |chosen: &[usize]| {
            let products = Products::of_information(&self.information(chosen), self.n_base);
            products.map_or(0.0, |p| self.worth(p.beside_the_base()))
        };
        let full = worth(&chosen);
        let mut order = chosen.clone();
        order.sort_by_key(|&i| std::cmp::Reverse(pool[i].touches.len()));
        for i in order {
            let rest: Vec<usize> = chosen.iter().copied().filter(|k| *k != i).collect();
            if !rest.is_empty() && worth(&rest) > 0.99 * full {
                chosen = rest;
            }
        }
        chosen
    }
}

/// How good information about the effects is.
type Value<'a> = dyn Fn(&DMatrix<f64>) -> f64 + Sync + 'a;

/// Bayesian D_s: log det of the information about the effects, each with a prior of its typical size.
fn d_s(s: &DMatrix<f64>) -> f64 {
    let with_prior = s + DMatrix::identity(s.nrows(), s.ncols());
    let factor = with_prior.cholesky();
    factor.map_or(f64::NEG_INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>())
}

/// A choice of bundles with the covariance of all unknowns: one bundle more or less changes it by a matrix of low rank.
#[derive(Debug, Clone)]
struct Choice {
    chosen: Vec<usize>,
    covariance: DMatrix<f64>,
    /// Rows of all bundles times the covariance.
    seen: DMatrix<f64>,
}

impl Choice {
    /// No bundle.
    fn start(design: &Design) -> Option<Self> {
        let mut information = design.given.clone();
        for i in design.n_base..information.ncols() {
            information[(i, i)] += FAINT;
        }
        let covariance = information.cholesky()?.inverse();
        Some(Self { chosen: Vec::new(), seen: &design.rows * &covariance, covariance })
    }

    /// With these bundles only, the chosen ones first.
    fn only(&self, design: &Design, few: &[usize]) -> Self {
        Self {
            chosen: (0..self.chosen.len()).collect(),
            covariance: self.covariance.clone(),
            seen: self.seen.select_rows(&design.rows_of(few)),
        }
    }

    /// L⁻¹AC of a bundle with rows A, some of its columns: the covariance C changes by what these rows are squared, less for one more bundle
    /// (`sign` 1), more for one that goes (−1).
    fn change(&self, design: &Design, bundle: usize, sign: f64, columns: Range<usize>) -> Option<DMatrix<f64>> {
        let range = &design.ranges[bundle];
        let seen = self.seen.rows(range.start, range.len());
        let within = seen * design.rows.rows(range.start, range.len()).transpose() * sign;
        let factor = (within + DMatrix::identity(range.len(), range.len())).cholesky()?;
        let mut out = seen.columns(columns.start, columns.len()).into_owned();
        factor.l_dirty().solve_lower_triangular_mut(&mut out).then_some(out)
    }

    /// Inverse of the effects' covariance.
    fn inverse(&self, design: &Design) -> DMatrix<f64> {
        let (p, q) = (design.n_base, self.covariance.ncols() - design.n_base);
        let covariance = self.covariance.view((p, p), (q, q)).into_owned();
        covariance.cholesky().map_or_else(|| Self::of_nothing(q), |factor| factor.inverse())
    }

    /// Information about the effects.
    fn effects(&self, design: &Design) -> DMatrix<f64> {
        let inverse = self.inverse(design);
        let q = inverse.nrows();
        inverse - Self::of_nothing(q)
    }

    /// What is known of the effects before any touch.
    fn of_nothing(q: usize) -> DMatrix<f64> {
        DMatrix::identity(q, q) * FAINT
    }

    /// The value with one bundle more (`sign` 1) or less (−1). `inverse`: of the effects' covariance as it is; by Woodbury.
    fn value(&self, design: &Design, inverse: &DMatrix<f64>, bundle: usize, sign: f64, value: &Value) -> Option<f64> {
        let (p, q) = (design.n_base, inverse.nrows());
        let change = self.change(design, bundle, sign, p..p + q)?;
        let mut by = &change * inverse;
        let left = DMatrix::identity(change.nrows(), change.nrows()) - &by * change.transpose() * sign;
        left.cholesky()?.l_dirty().solve_lower_triangular_mut(&mut by).then_some(())?;
        Some(value(&(inverse + by.tr_mul(&by) * sign - Self::of_nothing(q))))
    }

    /// One bundle more (`sign` 1) or less (−1).
    fn take(&mut self, design: &Design, bundle: usize, sign: f64) {
        let all = 0..self.covariance.ncols();
        let Some(change) = self.change(design, bundle, sign, all) else { return };
        self.seen -= (&design.rows * change.transpose()) * &change * sign;
        self.covariance -= change.tr_mul(&change) * sign;
        if sign > 0.0 {
            self.chosen.push(bundle);
        } else {
            self.chosen.retain(|i| *i != bundle);
        }
    }

    /// What the chosen bundles take, and one more of them, s.
    fn cost_s(&self, pool: &[&Bundle], more: Option<usize>) -> f64 {
        cost_s(self.chosen.iter().copied().chain(more).map(|i| pool[i]))
    }

    /// Takes what is worth most for its time until nothing more fits. `gains`: the bundles that may be taken, each with its gain when
    /// it was last computed.
    ///
    /// Gains mostly fall as bundles are taken, so a gain is computed again only if the old one could still be the best (Minoux, in:
    /// Optimization Techniques, Springer 1978, 234). On a new block gains may rise after the first bundle: those are computed again.
    fn fill(&mut self, design: &Design, pool: &[&Bundle], budget_s: f64, mut gains: Vec<(usize, f64)>, value: &Value) {
        loop {
            let inverse = self.inverse(design);
            let here = value(&(&inverse - Self::of_nothing(inverse.nrows())));
            let spent = self.cost_s(pool, None);
            let seconds = |i: usize| self.cost_s(pool, Some(i));
            let mut open: Vec<(usize, f64, f64)> = gains
                .iter()
                .enumerate()
                .map(|(place, (i, gain))| (place, *gain, seconds(*i)))
                .filter(|(.., all)| *all <= budget_s)
                .collect();
            let rate = |(_, gain, all): &(usize, f64, f64)| gain / (all - spent);
            // equal rates by their place: the same choice in every run
            open.sort_by(|a, b| rate(b).total_cmp(&rate(a)).then(a.0.cmp(&b.0)));
            let mut best: Option<(usize, f64, f64)> = None;
            for some in open.chunks(AT_ONCE) {
                if best.is_some_and(|best| rate(&best) >= rate(&some[0])) {
                    break;
                }
                let looked_at: Vec<(usize, f64, f64)> = some
                    .par_iter()
                    .map(|&(place, _, all)| {
                        let value = self.value(design, &inverse, gains[place].0, 1.0, value);
                        (place, value.map_or(0.0, |value| value - here), all)
                    })
                    .collect();
                for one in looked_at {
                    gains[one.0].1 = one.1;
                    if rate(&one) > best.map_or(1e-9, |best| rate(&best)) {
                        best = Some(one);
                    }
                }
            }
            let Some((place, ..)) = best else { return };
            let (bundle, _) = gains.remove(place);
            let same_block = gains.iter_mut().filter(|(i, _)| pool[*i].block == pool[bundle].block);
            same_block.for_each(|(_, gain)| *gain = f64::INFINITY);
            self.take(design, bundle, 1.0);
        }
    }

    /// What each of the bundles that are not chosen is worth now, the best for its time first.
    fn gains(&self, design: &Design, pool: &[&Bundle], value: &Value) -> Vec<(usize, f64)> {
        let inverse = self.inverse(design);
        let here = value(&(&inverse - Self::of_nothing(inverse.nrows())));
        let spent = self.cost_s(pool, None);
        let of = |i: usize| {
            let gain = self.value(design, &inverse, i, 1.0, value).map_or(0.0, |value| value - here);
            (gain / (self.cost_s(pool, Some(i)) - spent), (i, gain))
        };
        let open = (0..pool.len()).into_par_iter().filter(|i| !self.chosen.contains(i));
        let mut all: Vec<(f64, (usize, f64))> = open.map(of).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.0.cmp(&b.1.0)));
        all.into_iter().map(|(_, gain)| gain).collect()
    }

    /// Leaves out a bundle that is missed least and fills the time again, while that pays.
    fn exchange(&mut self, design: &Design, pool: &[&Bundle], budget_s: f64) {
        let worth = |s: &DMatrix<f64>| design.worth(s);
        for _ in 0..MOST_ROUNDS {
            let here = worth(&self.effects(design));
            let inverse = self.inverse(design);
            let without = |&i: &usize| Some((self.value(design, &inverse, i, -1.0, &worth)?, i));
            let mut least: Vec<(f64, usize)> = self.chosen.iter().filter_map(without).collect();
            least.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
            let tried = least.into_par_iter().take(MOST_OUT).map(|(_, out)| {
                let mut other = self.clone();
                other.take(design, out, -1.0);
                let mut gains = other.gains(design, pool, &worth);
                gains.retain(|(i, _)| *i != out);
                other.fill(design, pool, budget_s, gains, &worth);
                (worth(&other.effects(design)), other)
            });
            let tried: Vec<(f64, Self)> = tried.collect();
            match tried.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a }) {
                Some((value, other)) if value > here * (1.0 + 1e-6) + 1e-9 => *self = other,
                _ => return,
            }
        }
    }
}

/// Bundles at which every effect of the user's own has a value, and a sentence for each effect that has none at others. Without
/// it such an effect would stand in the design as one that leaves no trace, and nothing would ever part it from another.
///
/// `view` holds `n_given` touches and then those of the pool, in its order.
#[must_use]
pub fn where_all_have_values(
    view: &LinearisedPlan,
    n_given: usize,
    effects: &[(&Effect, Option<f64>)],
    pool: &[Bundle],
) -> (Vec<Bundle>, Vec<String>) {
    let mut left = vec![true; pool.len()];
    let mut said = Vec::new();
    for (effect, _) in effects.iter().filter(|(e, _)| !e.built_in) {
        let mut at = n_given;
        let mut bad: Vec<(usize, String)> = Vec::new();
        for (i, bundle) in pool.iter().enumerate() {
            let end = (at + bundle.touches.len()).min(view.data.nominal.len());
            let found = without_value(effect, &view.data.nominal[at.min(end)..end]);
            bad.extend(found.first().map(|b| (i, b.formula.clone())));
            at = end;
        }
        let Some((first, formula)) = bad.first() else { continue };
        bad.iter().for_each(|(i, _)| left[*i] = false);
        let pose: Vec<String> = pool[*first].manner.pose.iter().map(|(axis, deg)| format!("{axis} {deg}")).collect();
        said.push(format!(
            "formula {formula:?} of effect {} has no value at {} of the {} blocks and poses that could be touched, for instance at \
             {}: the program does not go there; write the formula so that it holds everywhere if the effect acts there too",
            effect.id,
            bad.len(),
            pool.len(),
            pose.join(", ")
        ));
    }
    (pool.iter().zip(left).filter(|(_, l)| *l).map(|(b, _)| b.clone()).collect(), said)
}
