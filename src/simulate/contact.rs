//! Where a ball on its way first meets a body: true distance of the ball's centre to faces, edges, corners and round surfaces.

use super::rigid::{Vec3, dot, minus, norm, plus};
use crate::machine::Form;

/// A body about the origin of its own frame, mm. Cylinders and holes stand along z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    pub form: Form,
    /// Half edges of the box that holds it; of a sphere its half axes.
    pub half: Vec3,
    /// Of a cylinder or a hole.
    pub radius: f64,
}

impl Body {
    /// Distance of a place (negative inside), the direction away from the surface, and how many faces meet there.
    pub fn distance(&self, p: Vec3) -> (f64, Vec3, u8) {
        match self.form {
            Form::Box | Form::Plane | Form::Centre | Form::Reading | Form::Part => distance(p, self.half),
            Form::Sphere => {
                let far = norm(p);
                if far == 0.0 {
                    return (-self.half[2], [0.0, 0.0, 1.0], 1);
                }
                let n = [p[0] / far, p[1] / far, p[2] / far];
                // half axes that are nearly equal: along a direction the surface stands this far out
                let out = (0..3).map(|i| self.half[i] * n[i] * n[i]).sum::<f64>();
                (far - out, n, 1)
            }
            Form::Cylinder => pin(p, self.radius, self.half[2]),
            Form::Bore => hole(p, self.radius, self.half),
        }
    }

    /// Is the distance from it along a line without a second minimum?
    fn convex(&self) -> bool {
        self.form != Form::Bore
    }
}

/// A solid cylinder along z.
fn pin(p: Vec3, radius: f64, half_height: f64) -> (f64, Vec3, u8) {
    let rho = p[0].hypot(p[1]);
    let (side, end) = (rho - radius, p[2].abs() - half_height);
    let outward = if rho > 0.0 { [p[0] / rho, p[1] / rho, 0.0] } else { [1.0, 0.0, 0.0] };
    let upward = [0.0, 0.0, 1.0_f64.copysign(p[2])];
    match (side > 0.0, end > 0.0) {
        (true, true) => {
            let d = side.hypot(end);
            (d, plus([outward[0] * side / d, outward[1] * side / d, 0.0], end / d, upward), 2)
        }
        (true, false) => (side, outward, 1),
        (false, true) => (end, upward, 1),
        (false, false) if side > end => (side, outward, 1),
        (false, false) => (end, upward, 1),
    }
}

/// A box with a hole through it along z.
fn hole(p: Vec3, radius: f64, half: Vec3) -> (f64, Vec3, u8) {
    let rho = p[0].hypot(p[1]);
    let over = p[2].abs() - half[2];
    let toward_middle = if rho > 0.0 { [-p[0] / rho, -p[1] / rho, 0.0] } else { [1.0, 0.0, 0.0] };
    let upward = [0.0, 0.0, 1.0_f64.copysign(p[2])];
    let wall = radius - rho;
    if wall > 0.0 && over > 0.0 {
        // over the hole: the rim
        let d = wall.hypot(over);
        return (d, plus([toward_middle[0] * wall / d, toward_middle[1] * wall / d, 0.0], over / d, upward), 2);
    }
    if wall > 0.0 {
        return (wall, toward_middle, 1);
    }
    let (outside, n, faces) = distance(p, half);
    // in the material: the nearer of the wall of the hole and the outer faces
    if outside < 0.0 && wall > outside { (wall, toward_middle, 1) } else { (outside, n, faces) }
}

/// What a search finds. `at` runs from 0 (start) to 1 (end).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contact {
    /// The ball meets the box.
    Met {
        /// Where on the way.
        at: f64,
        /// Unit vector from the box to the ball's centre, in the box's frame.
        normal: Vec3,
        /// How many faces meet where the ball touches: 1 a face, 2 an edge, 3 a corner.
        faces: u8,
    },
    Missed,
    /// It touches or enters the box before it moves, by this depth in mm.
    Already(f64),
}

/// Steps that Newton's method may take: a graze along an edge halves its error with each, everything else is quadratic.
const MAX_STEPS: usize = 80;
/// A gap this small is contact, mm: below the rounding of coordinates of machine size.
const CLOSE_MM: f64 = 1e-14;
/// How far a slightly bent way may leave the straight one, mm: decides which cases are looked at again.
const BEND_MM: f64 = 0.1;

/// Distance of a place from a box with these half edges about the origin (negative inside), and its gradient.
fn distance(p: Vec3, half: Vec3) -> (f64, Vec3, u8) {
    let mut off = [0.0; 3];
    let mut faces = 0;
    for i in 0..3 {
        let over = p[i].abs() - half[i];
        if over > 0.0 {
            off[i] = over.copysign(p[i]);
            faces += 1;
        }
    }
    match faces {
        0 => {
            // inside: the nearest face
            let depth = |i: usize| p[i].abs() - half[i];
            let mut nearest = 0;
            for i in 1..3 {
                if depth(i) > depth(nearest) {
                    nearest = i;
                }
            }
            let mut n = [0.0; 3];
            n[nearest] = 1.0_f64.copysign(p[nearest]);
            (depth(nearest), n, 1)
        }
        _ => {
            let d = norm(off);
            (d, [off[0] / d, off[1] / d, off[2] / d], faces)
        }
    }
}

/// The first contact of a ball of `radius` with a body (mm).
///
/// `place` gives the ball's centre in the body's frame; `straight` says that it moves along a straight line, otherwise
/// the way may be slightly bent (errors that depend on the axes' positions).
pub fn first_contact(place: &dyn Fn(f64) -> Vec3, straight: bool, body: &Body, radius: f64) -> Contact {
    let (p0, p1) = (place(0.0), place(1.0));
    let way = minus(p1, p0);
    let gap_at = |p: Vec3| {
        let (d, n, faces) = body.distance(p);
        (d - radius, n, faces)
    };
    let (gap, ..) = gap_at(p0);
    if gap <= 0.0 {
        return Contact::Already(-gap);
    }
    if !body.convex() {
        return sampled(place, &gap_at, way);
    }
    let slack = if straight { 0.0 } else { BEND_MM };
    let Some(guess) = on_the_line(&gap_at, p0, way, slack) else {
        return Contact::Missed;
    };
    let found = polish(place, &gap_at, way, guess);
    match found {
        Some((at, normal, faces)) if at <= 1.0 => Contact::Met { at: at.max(0.0), normal, faces },
        Some(_) => Contact::Missed,
        None => sampled(place, &gap_at, way),
    }
}

/// Newton's method from the start of a straight way. The distance to a convex body is convex along a line, so the
/// steps never pass the first contact, and a step past the end or a rising distance proves that there is none.
fn on_the_line(gap_at: &impl Fn(Vec3) -> (f64, Vec3, u8), p0: Vec3, way: Vec3, slack_mm: f64) -> Option<f64> {
    let length = norm(way);
    if length == 0.0 {
        return None;
    }
    let mut s = 0.0;
    for _ in 0..MAX_STEPS {
        let (gap, n, _) = gap_at(plus(p0, s, way));
        if gap <= CLOSE_MM {
            break;
        }
        let slope = dot(n, way);
        if slope >= 0.0 {
            // the nearest place has been passed
            return (gap <= slack_mm).then_some(s);
        }
        let next = s - gap / slope;
        if next > 1.0 + slack_mm / length {
            return (gap_at(plus(p0, 1.0, way)).0 <= slack_mm && slack_mm > 0.0).then_some(1.0);
        }
        if next == s {
            break;
        }
        s = next;
    }
    Some(s)
}

/// Newton's method on the real way, with the slope of the straight one.
fn polish(
    place: &dyn Fn(f64) -> Vec3,
    gap_at: &impl Fn(Vec3) -> (f64, Vec3, u8),
    way: Vec3,
    guess: f64,
) -> Option<(f64, Vec3, u8)> {
    let mut s = guess;
    let mut best = f64::INFINITY;
    for _ in 0..MAX_STEPS {
        let (gap, n, faces) = gap_at(place(s));
        let slope = dot(n, way);
        if gap.abs() <= CLOSE_MM || (gap.abs() >= best && best < 1e-12) {
            return Some((s, n, faces));
        }
        if slope >= 0.0 || !gap.is_finite() {
            return None;
        }
        best = best.min(gap.abs());
        let next = s - gap / slope;
        if next == s {
            return Some((s, n, faces));
        }
        s = next;
    }
    None
}

/// The slow way for a bent graze and for a hole: look along the way, then halve the first interval that ends in contact.
fn sampled(place: &dyn Fn(f64) -> Vec3, gap_at: &impl Fn(Vec3) -> (f64, Vec3, u8), way: Vec3) -> Contact {
    const LOOKS: u32 = 256;
    let gap = |s: f64| gap_at(place(s)).0;
    let mut clear = 0.0;
    for i in 1..=LOOKS {
        let mut inside = f64::from(i) / f64::from(LOOKS);
        if gap(inside) > 0.0 {
            clear = inside;
            continue;
        }
        while inside - clear > 1e-16 {
            let middle = 0.5 * (clear + inside);
            if middle <= clear || middle >= inside {
                break;
            }
            if gap(middle) > 0.0 { clear = middle } else { inside = middle }
        }
        let (at, normal, faces) = polish(place, gap_at, way, inside).unwrap_or_else(|| {
            let (_, n, faces) = gap_at(place(inside));
            (inside, n, faces)
        });
        return Contact::Met { at, normal, faces };
    }
    Contact::Missed
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn straight(p0: Vec3, p1: Vec3) -> impl Fn(f64) -> Vec3 {
        move |s| plus(p0, s, minus(p1, p0))
    }

    const CUBE: Body = Body { form: Form::Box, half: [5.0; 3], radius: 0.0 };

    #[test]
    fn what_is_round_is_met_where_a_drawing_has_it() {
        let sphere = Body { form: Form::Sphere, half: [12.0; 3], radius: 0.0 };
        // 9 mm beside the middle, 12 + 3 to go: 12 mm before the middle
        let way = straight([32.0, 9.0, 0.0], [-8.0, 9.0, 0.0]);
        let Contact::Met { at, normal, .. } = first_contact(&way, true, &sphere, 3.0) else { panic!() };
        assert!((at - 0.5).abs() < 1e-14 && norm(minus(normal, [0.8, 0.6, 0.0])) < 1e-14);
        let pin = Body { form: Form::Cylinder, half: [12.0, 12.0, 20.0], radius: 12.0 };
        let way = straight([32.0, 9.0, 3.0], [-8.0, 9.0, 3.0]);
        let Contact::Met { at, .. } = first_contact(&way, true, &pin, 3.0) else { panic!() };
        assert!((at - 0.5).abs() < 1e-14);
        let way = straight([0.0, 0.0, 33.0], [0.0, 0.0, 13.0]);
        let Contact::Met { at, normal, .. } = first_contact(&way, true, &pin, 3.0) else { panic!() };
        assert_eq!((at, normal), (0.5, [0.0, 0.0, 1.0]));
        // from the middle of a hole of 18 mm: 15 mm to the wall
        let hole = Body { form: Form::Bore, half: [30.0, 30.0, 10.0], radius: 18.0 };
        let way = straight([0.0, 0.0, 0.0], [18.0, 24.0, 0.0]);
        let Contact::Met { at, normal, .. } = first_contact(&way, true, &hole, 3.0) else { panic!() };
        assert!((at - 0.5).abs() < 1e-14 && norm(minus(normal, [-0.6, -0.8, 0.0])) < 1e-14);
        assert!(hole.distance([25.0, 0.0, 0.0]).0 < 0.0 && hole.distance([31.0, 0.0, 0.0]).0 > 0.0);
        assert!((hole.distance([15.0, 0.0, 14.0]).0 - 5.0).abs() < 1e-14, "over the hole: the rim");
    }

    #[test]
    fn a_face_is_met_exactly() {
        let way = straight([10.0, 1.0, 2.0], [6.0, 1.0, 2.0]);
        let Contact::Met { at, normal, faces } = first_contact(&way, true, &CUBE, 3.0) else { panic!() };
        assert_eq!((at, normal, faces), (0.5, [1.0, 0.0, 0.0], 1));
    }

    #[test]
    fn an_edge_and_a_corner_are_met_where_they_are() {
        // the ball's centre passes 1 mm outside the edge x = y = 5: contact where hypot = 3
        let way = straight([10.0, 6.0, 0.0], [0.0, 6.0, 0.0]);
        let Contact::Met { at, faces, .. } = first_contact(&way, true, &CUBE, 3.0) else { panic!() };
        assert!((10.0 - 10.0 * at - (5.0 + 8.0_f64.sqrt())).abs() < 1e-14);
        assert_eq!(faces, 2);
        let way = straight([10.0, 6.0, 6.0], [0.0, 6.0, 6.0]);
        let Contact::Met { at, faces, .. } = first_contact(&way, true, &CUBE, 3.0) else { panic!() };
        assert!((10.0 - 10.0 * at - (5.0 + 7.0_f64.sqrt())).abs() < 1e-14);
        assert_eq!(faces, 3);
    }

    #[test]
    fn a_ball_that_passes_or_stops_short_misses() {
        for end in [[-10.0, 8.5, 0.0], [8.1, 0.0, 0.0]] {
            let way = straight([10.0, end[1], 0.0], end);
            assert_eq!(first_contact(&way, true, &CUBE, 3.0), Contact::Missed);
            assert_eq!(first_contact(&way, false, &CUBE, 3.0), Contact::Missed);
        }
        let way = straight([7.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(first_contact(&way, true, &CUBE, 3.0), Contact::Already(1.0));
    }

    #[test]
    fn a_bent_way_is_solved_on_the_bend() {
        let way = |s: f64| [10.0 - 4.0 * s + 0.02 * (3.0 * s).sin(), 1.0, 0.5];
        let Contact::Met { at, .. } = first_contact(&way, false, &CUBE, 3.0) else { panic!() };
        assert!((way(at)[0] - 8.0).abs() < 1e-13);
    }

    proptest! {
        #[test]
        fn the_answer_is_the_first_contact(
            p0 in prop::array::uniform3(-20.0..20.0f64), p1 in prop::array::uniform3(-20.0..20.0f64), r in 0.5..4.0f64,
        ) {
            for form in [Form::Box, Form::Sphere, Form::Cylinder, Form::Bore] {
            let body = Body { form, half: if form == Form::Sphere { [5.0; 3] } else { [7.0, 8.0, 6.0] }, radius: 4.5 };
            let way = straight(p0, p1);
            let gap = |s: f64| body.distance(way(s)).0 - r;
            match first_contact(&way, true, &body, r) {
                Contact::Met { at, .. } => {
                    prop_assert!(gap(at).abs() < 1e-13);
                    for i in 0..200 {
                        prop_assert!(gap(at * f64::from(i) / 200.0) > -1e-12);
                    }
                }
                Contact::Missed => for i in 0..=400 {
                    prop_assert!(gap(f64::from(i) / 400.0) > -1e-12);
                }
                Contact::Already(_) => prop_assert!(gap(0.0) <= 0.0),
            }
            }
        }
    }
}
