//! A turn about a bearing or a carriage that stands somewhere else than where rotations are stated: besides the turn, what it turns
//! is displaced in proportion to the distance. That distance is unknown, so that it is a parameter.

use super::as_written::{EffectAsWritten, Grid, Placed, Scan, ShapeAsWritten, TermAsWritten};
use super::catalogue::{About, Effect, Place};
use super::reference_points::own_point;
use crate::axes::AxisName;
use crate::machine::{Machine, Side};
use nalgebra::Vector3;

/// How far from where rotations are stated a bearing or a carriage may be, mm.
pub const FARTHEST_MM: f64 = 400.0;

/// Distances that are tried between −400 and 400 mm: what lies between them is found by refining the best.
const TRIED: usize = 9;

/// Puts the lever arm of a row with `arm` into its terms and shapes: a turn of θ about r̂ through a point at a·d̂ is the same turn
/// through the origin and a displacement of −a·θ·(r̂ × d̂).
pub(super) fn with_arm(mut row: EffectAsWritten) -> EffectAsWritten {
    let Some(along) = row.arm.as_ref().and_then(|word| component(word.get_ref())) else { return row };
    let name = arm_name(row.id.get_ref());
    let displaced = |term: &TermAsWritten| {
        let about = component(term.dof.get_ref().strip_prefix('r')?)?;
        let (to, sign) = cross(about, along)?;
        let mut shift = term.clone();
        *shift.dof.get_mut() = format!("d{}", ["x", "y", "z"][to]);
        *shift.formula.get_mut() = format!("{}{name}*({})", if sign > 0.0 { "-" } else { "" }, term.formula.get_ref());
        Some(shift)
    };
    let shifts: Vec<TermAsWritten> = row.terms.iter().filter_map(displaced).collect();
    row.terms.extend(shifts);
    let at_the_word = |text: &str, place: &Placed| Placed::new(place.span(), text.to_owned());
    let place = row.id.clone();
    row.shape.push(ShapeAsWritten {
        parameter: at_the_word(&name, &place),
        unit: at_the_word("mm", &place),
        start: 0.0,
        min: Some(-2.0 * FARTHEST_MM),
        max: Some(2.0 * FARTHEST_MM),
        scan: Some(Scan::Grid(Grid { from: -FARTHEST_MM, to: FARTHEST_MM, points: TRIED, log: false })),
        between: None,
        source: None,
    });
    row
}

/// What says about which point an effect turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arm {
    /// A parameter of the shape: so far along x, y or z (0, 1, 2).
    Distance { parameter: usize, along: usize },
    /// One turn about x, y or z with a displacement along each of the other two, all in proportion to the same: parameters of the
    /// turn and of the displacements, with their directions.
    Displaced { turn: (usize, usize), shifts: [(usize, usize); 2] },
}

/// The arm of a row whose parameters have these names.
pub(super) fn arm_of(row: &EffectAsWritten, names: &[String]) -> Option<Arm> {
    let place = |name: &str| names.iter().position(|n| n == name);
    if let Some(along) = row.arm.as_ref().and_then(|word| component(word.get_ref())) {
        return Some(Arm::Distance { parameter: place(&arm_name(row.id.get_ref()))?, along });
    }
    let [first, second, third] = row.terms.as_slice() else { return None };
    let dof = |term: &TermAsWritten, kind: char| component(term.dof.get_ref().strip_prefix(kind)?);
    let parameter = |term: &TermAsWritten| place(term.parameter.get_ref());
    let turn = (parameter(first)?, dof(first, 'r')?);
    let shifts = [(parameter(second)?, dof(second, 'd')?), (parameter(third)?, dof(third, 'd')?)];
    let alike = [second, third].iter().all(|term| term.formula.get_ref() == first.formula.get_ref());
    let across = turn.1 != shifts[0].1 && turn.1 != shifts[1].1 && shifts[0].1 != shifts[1].1;
    (alike && across).then_some(Arm::Displaced { turn, shifts })
}

fn arm_name(id: &str) -> String {
    format!("arm_{}", id.replace('-', "_"))
}

/// About which point an axis turns where it should not turn, or turns further than it should.
#[derive(Debug, Clone, PartialEq)]
pub struct TurningPoint {
    /// The axis that turns.
    pub axis: AxisName,
    /// It turns the way it is made to turn: about its own direction.
    pub about_itself: bool,
    /// How far the point lies along x, y, z (0, 1, 2) from there, mm: one direction or two.
    pub off_mm: Vec<(usize, f64)>,
    /// Standard uncertainty of that distance, mm, where there is one distance and its uncertainty is known.
    pub sigma_mm: Option<f64>,
    /// From where.
    pub from: From,
}

/// From where the distance of a point counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum From {
    /// The ball at zero, where the artefact stands.
    Ball,
    /// The point of a head's axis.
    Pivot,
}

/// A turn is one, and a distance is not 0, where it is so many standard uncertainties.
pub const SURE: f64 = 3.0;

/// Where the point lies about which an effect turns its axis; `value`: of each of its parameters, by its place, and its standard
/// uncertainty, in its unit (infinite: not known). None where the effect has no such point. Where two displacements say
/// where it lies, also None if the axis may not turn at all.
#[must_use]
pub fn turning_point(
    machine: &Machine,
    effect: &Effect,
    value: impl Fn(usize) -> Option<(f64, f64)>,
) -> Option<TurningPoint> {
    let first = effect.terms.first()?;
    let (Place::Before(name) | Place::After(name)) = first.place else { return None };
    let axis = machine.axis(name)?;
    let about_itself = name.is_rotary() && first.component == name.index();
    let ball = machine.reference.ball;
    let (stated, from) = match (name.is_rotary(), axis.side) {
        (true, Side::Tool) => (ball, From::Pivot),
        (true, Side::Workpiece) => (own_point(machine, axis), From::Ball),
        (false, _) if effect.about == Some(About::Ball) => (ball, From::Ball),
        // the coordinates of a carriage begin at the origin of R
        (false, _) => (Vector3::zeros(), From::Ball),
    };
    let off = |along: usize, mm: f64| (along, stated[along] - ball[along] + mm);
    let mut sigma_mm = None;
    let off_mm = match effect.arm? {
        Arm::Distance { parameter, along } => {
            let (mm, sigma) = value(parameter)?;
            sigma_mm = Some(sigma).filter(|s| s.is_finite());
            vec![off(along, mm)]
        }
        Arm::Displaced { turn, shifts } => {
            // a turn θω̂ and a displacement t leave the point ω̂ × t/θ where it is
            let factor = |parameter: usize| effect.parameters.get(parameter).map(|p| p.factor);
            let (theta, sigma) = value(turn.0)?;
            if theta.abs() <= SURE * sigma {
                return None;
            }
            let mut t = Vector3::zeros();
            for (parameter, along) in shifts {
                t[along] = value(parameter)?.0 * factor(parameter)?;
            }
            let mut about = Vector3::zeros();
            about[turn.1] = 1.0;
            let point = about.cross(&t) / (theta * factor(turn.0)?);
            let off_mm: Vec<(usize, f64)> = shifts.iter().map(|&(_, along)| off(along, point[along])).collect();
            let far_mm = off_mm.iter().map(|(_, mm)| mm * mm).sum::<f64>().sqrt();
            if !far_mm.is_finite() || far_mm > 2.0 * FARTHEST_MM {
                return None;
            }
            off_mm
        }
    };
    Some(TurningPoint { axis: name, about_itself, off_mm, sigma_mm, from })
}

fn component(letter: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|l| *l == letter)
}

/// Unit vectors r̂ × d̂: along which axis, and with which sign.
fn cross(r: usize, d: usize) -> Option<(usize, f64)> {
    match (3 + d - r) % 3 {
        1 => Some(((r + 2) % 3, 1.0)),
        2 => Some(((r + 1) % 3, -1.0)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use crate::diag::source;
    use crate::model::catalogue::Catalogue;

    #[test]
    fn the_point_is_told_from_the_ball_or_from_the_pivot() {
        use super::{From, TurningPoint, turning_point};
        use crate::axes::AxisName;
        let catalogue = Catalogue::built_in().unwrap();
        let at = |machine: &str, id: &str, arm_mm: f64| {
            let machine = crate::machine::built_in(machine).unwrap().unwrap();
            let effect = catalogue.get(id, &machine).unwrap();
            let is_arm = |i: usize| effect.parameters[i].name.starts_with("arm_");
            turning_point(&machine, effect, |i| Some((if is_arm(i) { arm_mm } else { 0.0 }, 9.0)))
        };
        let point = |axis, about_itself, off: (usize, f64), from| {
            Some(TurningPoint { axis, about_itself, off_mm: vec![off], sigma_mm: Some(9.0), from })
        };
        // C of the table: its arm counts from the height of the ball
        assert_eq!(at("swivel-head", "tilt-c-1", -180.0), point(AxisName::C, false, (2, -180.0), From::Ball));
        assert_eq!(at("swivel-head", "tilt-b-2", 90.0), point(AxisName::B, false, (1, 90.0), From::Pivot));
        // the weight of the head turns B about its own direction, but with what carries it
        assert_eq!(at("swivel-head", "head-tilt", 150.0), point(AxisName::B, true, (2, 150.0), From::Pivot));
        // X carries the spindle: its arm counts from the ball as that of a table does
        for machine in ["trunnion", "swivel-head"] {
            let above = at(machine, "carriage-sag-x", 70.0).unwrap();
            assert!(above.off_mm == [(2, 70.0)] && above.from == From::Ball, "{above:?}");
        }
        assert_eq!(at("trunnion", "zero-a", 0.0), None);
    }

    #[test]
    fn displacements_beside_a_turn_say_where_its_point_lies() {
        use super::turning_point;
        let catalogue = Catalogue::built_in().unwrap();
        let machine = crate::machine::built_in("trunnion").unwrap().unwrap();
        // 50 urad about z through a point 300 mm from the ball to Y-, 100 mm to X+: what is at the ball goes by 50 urad times 300 mm
        // to -x and by 50 urad times 100 mm to -y
        let effect = catalogue.get("angular-cy", &machine).unwrap();
        let value = |x: f64, y: f64, turn: f64| {
            move |i: usize| match effect.parameters[i].name.as_str() {
                "ECY" => Some((turn, 5.0)),
                "ECY_x" => Some((x, 0.1)),
                _ => Some((y, 0.1)),
            }
        };
        let point = turning_point(&machine, effect, value(-15.0, -5.0, 50.0)).unwrap();
        let [(0, x), (1, y)] = point.off_mm[..] else { panic!("{point:?}") };
        assert!((x - 100.0).abs() < 1e-9 && (y + 300.0).abs() < 1e-9, "{point:?}");
        // a scale is no turn, and what may not turn at all has no point
        assert_eq!(
            turning_point(&machine, effect, value(0.0, 5.0, 16.0)).map(|p| p.off_mm),
            Some(vec![(0, -312.5), (1, 0.0)])
        );
        assert_eq!(turning_point(&machine, effect, value(0.0, 5.0, 14.0)), None);
        assert_eq!(turning_point(&machine, effect, value(0.0, 50.0, 16.0)), None);
    }

    #[test]
    fn a_turn_about_a_point_below_shifts_what_is_above_it() {
        // about y through a point 100 mm below: what stands at the origin goes to +x with a positive turn
        let text = "[[effect]]\nid = \"my-lean\"\nat = \"X\"\narm = \"z\"\nterms = [{ parameter = \"lean\", unit = \"urad\", \
                    dof = \"ry\", formula = \"X/300\" }]\n";
        let mut catalogue = Catalogue::default();
        catalogue.add_file(&source("my.toml", text)).unwrap();
        let effect = catalogue.iter().next().unwrap();
        let names: Vec<&str> = effect.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["lean", "arm_my_lean"]);
        let shift = &effect.terms[1];
        assert_eq!((shift.component, shift.formula.text()), (0, "-arm_my_lean*(X/300)"));
        assert_eq!(effect.arm, Some(super::Arm::Distance { parameter: 1, along: 2 }));
        let wrong = Catalogue::default().add_file(&source("my.toml", text.replace("\"z\"", "\"q\""))).unwrap_err();
        assert_eq!(wrong.0[0].code, "effects::arm");
    }
}
