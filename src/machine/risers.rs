//! Where a riser goes from its block: as the file says, or towards what the block's carrier bears. A table may stand upright at zero.

use super::as_written::{Riser, Toward};
use super::{Carrier, Shape, Solid};
use nalgebra::Vector3;

/// A table further off is none of this block's, mm.
const FARTHEST_MM: f64 = 1000.0;
/// A riser that ends further above what bears it hangs in the air, mm.
const GAP_MM: f64 = 1.0;

/// Where a riser goes, and what is wrong with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    pub toward: Toward,
    /// The carrier bears solids, and none of them is in that direction.
    pub meets_nothing: bool,
    /// How far its end is from the first solid on its way, mm, where that is far.
    pub gap_mm: Option<f64>,
}

/// Finds where a riser goes.
pub(super) fn place(
    centre: &Vector3<f64>,
    size: &Vector3<f64>,
    riser: &Riser,
    carrier: Carrier,
    solids: &[&Solid],
) -> Placed {
    let borne: Vec<&Shape> = solids.iter().filter(|s| s.carrier == carrier).map(|s| &s.shape).collect();
    let way = |toward: Toward| {
        let (axis, sign) = toward.axis_and_sign();
        let mut direction = Vector3::zeros();
        direction[axis] = sign;
        let from = centre + direction * (size[axis] / 2.0);
        first_solid(&from, &direction, &borne)
    };
    let found = match riser.toward {
        Some(toward) => Some((toward, way(toward))),
        None => {
            // down, as long as something is there; else to what is nearest
            let mut ways = Toward::ALL.into_iter().filter_map(|toward| way(toward).map(|mm| (toward, mm)));
            let first = ways.next();
            let down = first.filter(|(toward, _)| *toward == Toward::MinusZ);
            let nearest = || first.into_iter().chain(ways).min_by(|a, b| a.1.total_cmp(&b.1));
            down.or_else(nearest).map(|(toward, mm)| (toward, Some(mm)))
        }
    };
    let (toward, mm) = found.unwrap_or((Toward::MinusZ, None));
    Placed {
        toward,
        meets_nothing: mm.is_none() && !borne.is_empty(),
        gap_mm: mm.map(|mm| mm - riser.height).filter(|gap| *gap > GAP_MM),
    }
}

/// The body of a riser.
pub(super) fn body(centre: &Vector3<f64>, size: &Vector3<f64>, riser: &Riser, toward: Toward) -> Shape {
    let (axis, sign) = toward.axis_and_sign();
    let mut middle = *centre;
    middle[axis] += sign * (size[axis] / 2.0 + riser.height / 2.0);
    if let Some(diameter) = riser.diameter {
        let mut direction = Vector3::zeros();
        direction[axis] = sign;
        let foot = centre + direction * (size[axis] / 2.0);
        let direction = nalgebra::Unit::new_unchecked(direction);
        return Shape::Cylinder { foot, direction, radius: diameter / 2.0, height: riser.height };
    }
    let [one, other] = riser.size;
    let edges = match axis {
        0 => Vector3::new(riser.height, one, other),
        1 => Vector3::new(one, riser.height, other),
        _ => Vector3::new(one, other, riser.height),
    };
    Shape::Box { centre: middle, size: edges }
}

/// How far the first solid on the way is, mm.
fn first_solid(from: &Vector3<f64>, direction: &Vector3<f64>, shapes: &[&Shape]) -> Option<f64> {
    let distances = shapes.iter().filter_map(|shape| distance_mm(shape, from, direction));
    distances.filter(|mm| *mm <= FARTHEST_MM).min_by(f64::total_cmp)
}

/// How far a shape is along a half line, mm; 0 within it.
fn distance_mm(shape: &Shape, from: &Vector3<f64>, toward: &Vector3<f64>) -> Option<f64> {
    let inside = match shape {
        Shape::Box { centre, size } => {
            let off = from - centre;
            (0..3).try_fold([0.0, f64::INFINITY], |span, axis| {
                both(span, between(off[axis], toward[axis], -size[axis] / 2.0, size[axis] / 2.0)?)
            })
        }
        Shape::Cylinder { foot, direction, radius, height } => {
            let off = from - foot;
            let (along, per_mm) = (off.dot(direction), toward.dot(direction));
            let (off, way) = (off - direction.into_inner() * along, toward - direction.into_inner() * per_mm);
            between(along, per_mm, 0.0, *height)
                .and_then(|span| both([0.0, f64::INFINITY], span))
                .and_then(|span| both(span, within(&off, &way, *radius)?))
        }
    };
    inside.map(|[first, _]| first)
}

/// From where to where `at + way * t` is from `low` to `high`.
fn between(at: f64, way: f64, low: f64, high: f64) -> Option<[f64; 2]> {
    if way.abs() < 1e-12 {
        return (low..=high).contains(&at).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let (one, other) = ((low - at) / way, (high - at) / way);
    Some([one.min(other), one.max(other)])
}

/// From where to where `off + way * t` is not longer than `radius`.
fn within(off: &Vector3<f64>, way: &Vector3<f64>, radius: f64) -> Option<[f64; 2]> {
    let squared = way.norm_squared();
    if squared < 1e-12 {
        return (off.norm() <= radius).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let middle = -off.dot(way) / squared;
    let left = radius * radius - (off + way * middle).norm_squared();
    let half = (left.max(0.0) / squared).sqrt();
    (left >= 0.0).then_some([middle - half, middle + half])
}

fn both(one: [f64; 2], other: [f64; 2]) -> Option<[f64; 2]> {
    let span = [one[0].max(other[0]), one[1].min(other[1])];
    (span[0] <= span[1]).then_some(span)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(direction: Vector3<f64>, foot: Vector3<f64>) -> Solid {
        let direction = nalgebra::Unit::new_normalize(direction);
        let shape = Shape::Cylinder { foot, direction, radius: 35.0, height: 10.0 };
        Solid { name: "disc".to_owned(), carrier: Carrier::Table, shape }
    }

    fn placed(riser: Riser, solids: &[&Solid]) -> Placed {
        place(&Vector3::new(10.0, 5.0, 0.0), &Vector3::new(10.0, 10.0, 10.0), &riser, Carrier::Table, solids)
    }

    #[test]
    fn a_riser_goes_to_the_table_wherever_that_is() {
        let riser = Riser { height: 15.0, size: [8.0, 6.0], diameter: None, toward: None };
        let upright = disc(Vector3::y(), Vector3::new(0.0, -31.3, 0.0));
        let level = disc(Vector3::z(), Vector3::new(0.0, 0.0, -40.0));
        let found = placed(riser, &[&upright]);
        assert_eq!((found.toward, found.meets_nothing), (Toward::MinusY, false));
        assert!((found.gap_mm.unwrap() - 6.3).abs() < 1e-9, "{found:?}");
        assert_eq!(placed(riser, &[&upright, &level]).toward, Toward::MinusZ);
        assert_eq!(placed(riser, &[]), Placed { toward: Toward::MinusZ, meets_nothing: false, gap_mm: None });
        // a disc that is inclined is met where the line enters it
        let inclined = placed(riser, &[&disc(Vector3::new(0.0, 1.0, 2.0), Vector3::new(0.0, -10.0, -40.0))]);
        assert_eq!(inclined.toward, Toward::MinusZ);
        // it is met at Z = -40 + (10 sqrt(5) - 15) / 2
        assert!((inclined.gap_mm.unwrap() - (20.0 - (10.0 * 5f64.sqrt() - 15.0) / 2.0)).abs() < 1e-9, "{inclined:?}");
        let beside = disc(Vector3::y(), Vector3::new(200.0, 200.0, 200.0));
        assert!(placed(riser, &[&beside]).meets_nothing);
        let said = Riser { toward: Some(Toward::PlusX), ..riser };
        assert_eq!(placed(said, &[&level]).toward, Toward::PlusX);
        let Shape::Box { centre, size } =
            body(&Vector3::new(10.0, 5.0, 0.0), &Vector3::new(10.0, 10.0, 10.0), &riser, Toward::MinusY)
        else {
            panic!()
        };
        assert_eq!((centre, size), (Vector3::new(10.0, -7.5, 0.0), Vector3::new(8.0, 15.0, 6.0)));
    }
}
