//! Another origin: the one shift that puts nearly all found positions onto planned ones, where nothing says which belongs to which.

use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};

/// So many found positions are compared with the planned ones.
const FOUND: usize = 24;
/// With at most so many of the planned ones each.
const PLANNED: usize = 5_000;
/// Differences are counted in cells of this edge, mm: a block may be displaced by as much.
const CELL_MM: f64 = 1.0;
/// The cells with the most differences are tried, so many.
const TRIED: usize = 20;
/// Each with at most so many found positions.
const PROVED: usize = 500;
/// A shift that explains fewer is chance: any two positions have one.
const FEWEST: usize = 4;

/// The shift (found less planned), mm, with which nine of ten found positions lie at a planned one.
///
/// `may_pair`: a found position may be that planned one (pose, normal). `lies`: the planned one at which a found position lies when
/// this shift is taken off it.
pub fn common_shift(
    found: &[Vector3<f64>],
    planned: &[Vector3<f64>],
    may_pair: &dyn Fn(usize, usize) -> bool,
    lies: &dyn Fn(usize, &Vector3<f64>) -> Option<usize>,
) -> Option<Vector3<f64>> {
    let mut cells: BTreeMap<[i64; 3], Vec<Vector3<f64>>> = BTreeMap::new();
    for i in spread(found.len(), FOUND) {
        for j in spread(planned.len(), PLANNED).filter(|j| may_pair(i, *j)) {
            let by = found[i] - planned[j];
            cells.entry(cell(&by)).or_default().push(by);
        }
    }
    let mut keys: Vec<(usize, [i64; 3])> = cells.iter().map(|(key, all)| (all.len(), *key)).collect();
    keys.sort_by_key(|(count, key)| (std::cmp::Reverse(*count), *key));
    let tried = keys.iter().take(TRIED).map(|(_, key)| {
        let by = median(&around(&cells, key));
        let proved = spread(found.len(), PROVED);
        let count = proved.clone().count();
        let at: Vec<usize> = proved.filter_map(|i| lies(i, &by)).collect();
        let places: BTreeSet<usize> = at.iter().copied().collect();
        (at.len(), count, places.len(), by)
    });
    let best = tried.max_by_key(|(right, ..)| *right);
    let fewest = FEWEST.min(planned.len()).max(2);
    best.filter(|(right, count, places, _)| right * 10 >= count * 9 && *places >= fewest).map(|(.., by)| by)
}

/// At most `most` of the numbers below `count`, evenly spread.
fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> + Clone {
    (0..count).step_by(count.div_ceil(most).max(1))
}

#[allow(clippy::cast_possible_truncation)] // what is too large for a cell saturates
fn cell(by: &Vector3<f64>) -> [i64; 3] {
    [by.x, by.y, by.z].map(|v| (v / CELL_MM).round() as i64)
}

/// The differences in a cell and in its neighbours: the common one may lie at an edge.
fn around(cells: &BTreeMap<[i64; 3], Vec<Vector3<f64>>>, key: &[i64; 3]) -> Vec<Vector3<f64>> {
    let near = |slot: usize| [-1, 0, 1].map(|d| key[slot].saturating_add(d));
    let (xs, ys, zs) = (near(0), near(1), near(2));
    let keys = xs.into_iter().flat_map(|x| ys.into_iter().flat_map(move |y| zs.into_iter().map(move |z| [x, y, z])));
    let all: BTreeSet<[i64; 3]> = keys.collect();
    all.iter().filter_map(|k| cells.get(k)).flatten().copied().collect()
}

fn median(all: &[Vector3<f64>]) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| {
        let mut values: Vec<f64> = all.iter().map(|v| v[axis]).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<Vector3<f64>> {
        (0..9).map(|i| Vector3::new(f64::from(i % 3) * 3.0, f64::from(i / 3) * 4.0, 8.0)).collect()
    }

    fn find(found: &[Vector3<f64>]) -> Option<Vector3<f64>> {
        let planned = grid();
        let lies = |i: usize, by: &Vector3<f64>| planned.iter().position(|p| (found[i] - by - p).norm() < 0.1);
        common_shift(found, &planned, &|_, _| true, &lies)
    }

    #[test]
    fn a_shift_is_found_in_any_order() {
        let by = Vector3::new(-110.5, 42.25, -17.3);
        let mut found: Vec<_> = grid().iter().map(|p| p + by).collect();
        found.swap(0, 7);
        found.swap(2, 5);
        assert!((find(&found).unwrap() - by).norm() < 1e-9);
    }

    #[test]
    fn too_few_or_other_positions_have_no_shift() {
        let by = Vector3::new(5.0, 5.0, 5.0);
        assert_eq!(find(&grid().iter().take(3).map(|p| p + by).collect::<Vec<_>>()), None);
        let other: Vec<_> = (0..9).map(|i| Vector3::new(f64::from(i * i) * 1.7, f64::from(i) * 2.3, 0.0)).collect();
        assert_eq!(find(&other), None);
        assert_eq!(find(&[]), None);
    }
}
