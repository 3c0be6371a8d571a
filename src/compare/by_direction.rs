//! How much of the residual goes with each variable, direction by direction: where the model fails, at one look.

use super::Point;
use super::model_ladder::direction;
use super::variables::VariableKind;

/// Positions closer than this share of the range are one position.
const SAME_POSITION: f64 = 1e-3;
/// More positions than this are put into so many bins of equal count.
const MOST_GROUPS: usize = 24;
/// Fewer touches in a direction show no pattern.
const FEWEST_TOUCHES: usize = 8;
/// Touches to a mean: with fewer, the means follow the noise.
const TOUCHES_PER_GROUP: usize = 4;
/// A variable that takes away less than this share of the whole is not drawn for its own sake.
const WORTH_DRAWING: f64 = 0.1;
/// By so much of the whole an angle may fall short of a linear axis, and that of time, and still be drawn: in most programs
/// the positions follow the angles, and time and order follow both, so they take away what belongs to the angles.
const RANK: f64 = 0.1;

/// How much of the residual goes with a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Explained {
    /// In X, Y and Z: share of that direction's variance, 0 to 1. `None` where too few touches or only one value say so.
    pub share: [Option<f64>; 3],
    /// Share of the variance of all three directions together, 0 to 1.
    pub whole: f64,
}

/// Share of the residual's variance that the means at each value of `variable` take away.
///
/// The share is adjusted for the number of groups (adjusted R²), so that noise alone comes out near 0. The touches used.
#[must_use]
pub fn explained(points: &[Point], variable: &str) -> Explained {
    let mut values: [Vec<(f64, f64)>; 3] = Default::default();
    let mut squares = [0.0; 3];
    for p in points.iter().filter(|p| p.used) {
        let (towards, sign) = direction(&p.normal);
        squares[towards] += p.residual_um * p.residual_um;
        if let Some(x) = p.value(variable) {
            values[towards].push((x, sign * p.residual_um));
        }
    }
    let share = values.map(adjusted_r2);
    let all: f64 = squares.iter().sum();
    let taken: f64 = share.iter().zip(squares).map(|(share, of)| share.unwrap_or(0.0) * of).sum();
    Explained { share, whole: if all > 0.0 { taken / all } else { 0.0 } }
}

/// The variable to draw the residual against: number in `all` of the one that takes away most of the whole. The second word
/// of each says what it is.
#[must_use]
pub fn to_draw(all: &[(Explained, VariableKind)]) -> Option<usize> {
    let worth = |(e, kind): &(Explained, VariableKind)| match kind {
        VariableKind::Angle => e.whole + 2.0 * RANK,
        VariableKind::Position => e.whole + RANK,
        VariableKind::Other => e.whole,
    };
    let enough = all.iter().enumerate().filter(|(_, (e, _))| e.whole >= WORTH_DRAWING);
    // of equals the first
    enough.rev().max_by(|a, b| worth(a.1).total_cmp(&worth(b.1))).map(|(i, _)| i)
}

fn adjusted_r2(mut of: Vec<(f64, f64)>) -> Option<f64> {
    let n = of.len();
    if n < FEWEST_TOUCHES {
        return None;
    }
    of.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = groups(&of);
    if groups.len() < 2 || groups.len() + 1 >= n {
        return None;
    }
    let mean = |of: &[(f64, f64)]| of.iter().map(|v| v.1).sum::<f64>() / of.len() as f64;
    let about = |of: &[(f64, f64)]| {
        let mean = mean(of);
        of.iter().map(|v| (v.1 - mean).powi(2)).sum::<f64>()
    };
    let total = about(&of) / (n - 1) as f64;
    let within = groups.iter().map(|g| about(g)).sum::<f64>() / (n - groups.len()) as f64;
    (total > 0.0).then(|| (1.0 - within / total).clamp(0.0, 1.0))
}

/// Touches at one position, or bins of equal count where there are many positions. Sorted input.
fn groups(of: &[(f64, f64)]) -> Vec<&[(f64, f64)]> {
    let range = of[of.len() - 1].0 - of[0].0;
    let at_positions: Vec<&[(f64, f64)]> = of.chunk_by(|a, b| b.0 - a.0 <= SAME_POSITION * range).collect();
    let most = MOST_GROUPS.min(of.len() / TOUCHES_PER_GROUP);
    if at_positions.len() <= most {
        return at_positions;
    }
    of.chunks(of.len().div_ceil(most)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_not_explained_and_a_pattern_is() {
        // alternating signs have no mean at any of the ten positions
        let noise: Vec<(f64, f64)> =
            (0..200).map(|i| (f64::from(i / 20), if i % 2 == 0 { 1.0 } else { -1.0 })).collect();
        assert!(adjusted_r2(noise.clone()).unwrap() < 0.01);
        let pattern = noise.iter().map(|(x, y)| (*x, y + 3.0 * (x - 4.5))).collect();
        // variance of 3(x − 4.5) over ten equal groups: 9 · 8.25 = 74.25, beside 1 of noise
        assert!((adjusted_r2(pattern).unwrap() - 74.25 / 75.25).abs() < 2e-3);
    }

    #[test]
    fn few_touches_and_one_value_say_nothing() {
        assert_eq!(adjusted_r2(vec![(0.0, 1.0); 7]), None);
        assert_eq!(adjusted_r2(vec![(2.0, 1.0); 50]), None);
        assert_eq!(adjusted_r2((0..50).map(|i| (f64::from(i) * 1e-9, 0.0)).collect()), None);
    }

    #[test]
    fn an_angle_comes_before_what_follows_it_and_weak_ones_are_not_drawn() {
        let of = |whole: f64| Explained { share: [Some(whole); 3], whole };
        use VariableKind::{Angle, Other, Position};
        assert_eq!(to_draw(&[(of(0.58), Position), (of(0.50), Angle), (of(0.50), Angle), (of(0.69), Other)]), Some(1));
        assert_eq!(to_draw(&[(of(0.62), Position), (of(0.50), Angle), (of(0.71), Other)]), Some(0));
        assert_eq!(to_draw(&[(of(0.09), Angle), (of(0.5), Other)]), Some(1));
        assert_eq!(to_draw(&[(of(0.09), Angle), (of(0.0), Position)]), None);
    }

    #[test]
    fn many_positions_are_binned() {
        let line: Vec<(f64, f64)> = (0..500).map(|i| (f64::from(i), f64::from(i))).collect();
        let share = adjusted_r2(line).unwrap();
        assert!(share > 0.99 && share < 1.0, "{share}");
    }
}
