//! Ends of intervals: one that holds others.

use std::collections::BTreeMap;

/// An interval with further places; an end that is open stays so.
pub(super) fn hull([low, high]: [Option<f64>; 2], places: &[f64]) -> [Option<f64>; 2] {
    let least = places.iter().copied().fold(f64::INFINITY, f64::min);
    let most = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [low.map(|low| low.min(least)), high.map(|high| high.max(most))]
}

/// The interval of a value, its standard uncertainty and t-factor, with those that it has beside other values of a shape: there
/// with a factor of their own.
pub(super) fn with_all(
    (value, sigma, k): (f64, f64, f64),
    beside: impl Iterator<Item = ((f64, f64), f64)>,
) -> [Option<f64>; 2] {
    let [mut low, mut high] = [value - k * sigma, value + k * sigma];
    for ((at, sigma), k) in beside {
        (low, high) = (low.min(at - sigma * k), high.max(at + sigma * k));
    }
    [Some(low), Some(high)]
}

/// Widens what is known of an unknown: beside each of several shapes it may be something else.
pub(super) fn also(out: &mut BTreeMap<usize, [Option<f64>; 2]>, unknown: usize, ends: [Option<f64>; 2]) {
    out.entry(unknown).and_modify(|e| *e = both(*e, ends)).or_insert(ends);
}

/// An interval that holds two others; an end that is open stays so.
fn both([a, b]: [Option<f64>; 2], [c, d]: [Option<f64>; 2]) -> [Option<f64>; 2] {
    [a.zip(c).map(|(a, c)| a.min(c)), b.zip(d).map(|(b, d)| b.max(d))]
}
