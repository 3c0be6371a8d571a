//! Errors that depend on where an axis stands or from where it came: squareness, scale, straightness, angular errors,
//! harmonics of rotary axes, backlash, gross mistakes.
//!
//! A displacement is that of what the axis carries, as a function of the axis's NC coordinate; for rotary axes it stands
//! before the axis's motion (it does not turn with it), on the axis's own line and in the axis's own frame; for linear
//! axes after, in R (lever arms are counted in the frame that moves). Polynomials are scaled to [`SPAN_MM`].

use super::unit::Unit::{Deg, H, Mm, One, Um, UmPerM, Urad};
use super::{Parameter, Refusal, Role, Settings, across, along, axis_here, axis_of, dof_letter};
use crate::axes::AxisName;
use crate::machine::Machine;
use crate::simulate::chain::goes_backwards;
use crate::simulate::terms::{Shape, Target};

/// The travel at which polynomial errors have their stated size, mm.
pub const SPAN_MM: f64 = 300.0;
/// Pitch of a ball screw when none is given, mm.
const PITCH_MM: f64 = 10.0;

/// Angle after a reversal at which an axis is wound up to 63 %, when none is given, rad.
const WINDUP_RAD: f64 = std::f64::consts::PI / 18.0;
/// Radius of an encoder's ring when none is given, mm.
const RING_MM: f64 = 100.0;

/// Pairs of linear axes that wiring can swap.
const SWAPS: [(AxisName, AxisName); 3] =
    [(AxisName::X, AxisName::Y), (AxisName::Y, AxisName::Z), (AxisName::Z, AxisName::X)];

const LINEAR: [char; 3] = ['x', 'y', 'z'];
const ROTARY: [char; 3] = ['a', 'b', 'c'];

/// Ids of this family.
pub fn ids(_: &Machine) -> Vec<String> {
    let mut out: Vec<String> = ["xy", "yz", "zx"].map(|p| format!("squareness-{p}")).to_vec();
    for l in LINEAR {
        out.extend([format!("scale-{l}"), format!("positioning-{l}-2"), format!("pitch-{l}"), format!("backlash-{l}")]);
        out.extend(LINEAR.into_iter().filter(|&d| d != l).map(|d| format!("straightness-{d}{l}")));
        out.extend(ROTARY.map(|d| format!("angular-{d}{l}")));
        out.push(format!("lost-position-{l}"));
    }
    for r in ROTARY {
        for family in ["radial", "axial", "tilt", "positioning"] {
            out.extend((1..=3).map(|k| format!("{family}-{r}-{k}")));
        }
        out.extend(
            [
                "positioning-{r}-linear",
                "backlash-{r}",
                "windup-{r}",
                "encoder-eccentricity-{r}",
                "rehomed-{r}",
                "lost-position-{r}",
            ]
            .map(|id| id.replace("{r}", &r.to_string())),
        );
    }
    out.extend(
        ["clamp-play-a", "clamp-play-b", "carriage-sag-x", "carriage-sag-y", "sign-or-axis-swap"].map(str::to_owned),
    );
    out
}

/// Parameters of an id of this family.
pub fn parameters(id: &str, machine: &Machine, settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    if id == "sign-or-axis-swap" {
        return Ok(machine.axes.iter().map(|a| flipped(a.name)).chain(SWAPS.map(swapped)).collect());
    }
    if let Some(found) = axis_of(id, "backlash", machine) {
        return Ok(vec![backlash(found?.1)]);
    }
    if let Some(found) = axis_of(id, "lost-position", machine) {
        return lost_position(found?.1, settings);
    }
    for (prefix, of) in [
        ("windup", wind_up as fn(AxisName, Settings<'_>) -> Vec<Parameter>),
        ("encoder-eccentricity", run_out_that_is_read),
        ("rehomed", homed_again),
    ] {
        if let Some(found) = axis_of(id, prefix, machine) {
            let axis = found?.1;
            return if axis.is_rotary() { Ok(of(axis, settings)) } else { Err(Refusal::Unknown) };
        }
    }
    if let Some(found) = axis_of(id, "clamp-play", machine) {
        let axis = found?.1;
        let shape = Shape::SideOfUpright(axis);
        return match axis {
            AxisName::A | AxisName::B => {
                let name = format!("clamp_play_{axis}");
                Ok(vec![Parameter::new(name, Urad, [(Target::Reading(axis), shape, 0.5)])])
            }
            _ => Err(Refusal::Unknown),
        };
    }
    if let Some(found) = axis_of(id, "carriage-sag", machine) {
        return carriage_sag(found?.1, id, machine, settings);
    }
    let (family, rest) = id.split_once('-').ok_or(Refusal::Unknown)?;
    if let Some((letter, k)) = rest.split_once('-') {
        let axis = axis_in(letter)?;
        return match (family, k) {
            ("positioning", "2") if !axis.is_rotary() => Ok(vec![bend(axis_here(axis, machine)?.name)]),
            ("positioning", "linear") if axis.is_rotary() => {
                axis_here(axis, machine)?;
                Ok(vec![rotary_scale(axis)])
            }
            ("tilt", _) if axis.is_rotary() => {
                Ok(about_a_point(harmonic(family, axis, k, machine)?, id, along(axis), settings))
            }
            _ if axis.is_rotary() => harmonic(family, axis, k, machine),
            _ => Err(Refusal::Unknown),
        };
    }
    match (family, rest) {
        ("squareness", "xy") => squareness(AxisName::Y, 0, -1.0, machine),
        ("squareness", "yz") => squareness(AxisName::Z, 1, -1.0, machine),
        ("squareness", "zx") => squareness(AxisName::Z, 0, 1.0, machine),
        ("scale", letter) => {
            let axis = linear_in(letter, machine)?;
            let shape = Shape::Power(axis, 1.0, 1);
            Ok(vec![Parameter::at(format!("E{axis}{axis}"), UmPerM, moved(axis, along(axis)), shape)])
        }
        ("pitch", letter) => Ok(pitch(linear_in(letter, machine)?, settings)),
        ("straightness", pair) => {
            let (dof, axis) = pair_in(pair, machine)?;
            if dof >= 3 || dof == along(axis) {
                return Err(Refusal::Unknown);
            }
            Ok([2, 3].map(|n| polynomial(axis, dof, n, true)).to_vec())
        }
        ("angular", pair) => {
            let (dof, axis) = pair_in(pair, machine)?;
            if dof < 3 { Err(Refusal::Unknown) } else { Ok(carriage_turn(axis, dof, machine)) }
        }
        _ => Err(Refusal::Unknown),
    }
}

fn axis_in(letter: &str) -> Result<AxisName, Refusal> {
    let mut letters = letter.chars();
    match (letters.next(), letters.next()) {
        (Some(c), None) if c.is_ascii_lowercase() => AxisName::from_letter(c).ok_or(Refusal::Unknown),
        _ => Err(Refusal::Unknown),
    }
}

fn linear_in(letter: &str, machine: &Machine) -> Result<AxisName, Refusal> {
    let axis = axis_in(letter)?;
    if axis.is_rotary() { Err(Refusal::Unknown) } else { axis_here(axis, machine).map(|a| a.name) }
}

/// `yx` → component y of linear axis X.
fn pair_in(pair: &str, machine: &Machine) -> Result<(usize, AxisName), Refusal> {
    if pair.len() != 2 || !pair.is_ascii() {
        return Err(Refusal::Unknown);
    }
    let (dof, axis) = pair.split_at(1);
    Ok((axis_in(dof)?.index(), linear_in(axis, machine)?))
}

/// A lean of a carriage such that the place of the ball's centre at zero stays where it is: the chain leans it about the origin of R
/// that goes along with it, and a shift brings it back.
fn at_the_ball(mut parameter: Parameter, machine: &Machine) -> Parameter {
    if let Role::Amount(acts) = &mut parameter.role
        && let Some(&(target, shape, factor)) = acts.first()
    {
        acts.extend(back_to_the_ball(target, machine).into_iter().map(|(at, amount)| (at, shape, factor * amount)));
    }
    parameter
}

/// The shifts, mm per rad, that bring the place of the ball's centre at zero back where a lean has moved it; none where the
/// axis is no linear one (a rotary axis leans on its own line).
pub fn back_to_the_ball(target: Target, machine: &Machine) -> Vec<(Target, f64)> {
    let Target::Axis { axis, after, dof } = target else { return Vec::new() };
    if dof < 3 || axis.is_rotary() {
        return Vec::new();
    }
    let ball = &machine.reference.ball;
    let arm = [ball.x, ball.y, ball.z];
    // a small turn about axis d moves the ball's place by -arm[n] towards m and by arm[m] towards n (d, m, n right-handed)
    let (m, n) = ((dof - 2) % 3, (dof - 1) % 3);
    vec![(Target::Axis { axis, after, dof: m }, arm[n]), (Target::Axis { axis, after, dof: n }, -arm[m])]
}

/// Turns that act about a point at `arm_…` mm along a direction (0, 1, 2: x, y, z): each point of what is turned moves less, or more,
/// by the turn times that distance.
pub(super) fn about_a_point(
    mut turns: Vec<Parameter>,
    id: &str,
    along: usize,
    settings: Settings<'_>,
) -> Vec<Parameter> {
    let name = format!("arm_{}", id.replace('-', "_"));
    let arm = settings(&name).unwrap_or(0.0);
    for turn in &mut turns {
        let Role::Amount(acts) = &mut turn.role else { continue };
        let Some(&(target, shape, factor)) = acts.first() else { continue };
        let Some((to, by)) = shift_of_a_turn(target, along) else { continue };
        acts.push((to, shape, factor * by * arm));
    }
    turns.push(Parameter::signed_setting(&name, Mm).alias("arm"));
    turns
}

/// A turn about a point so far along x, y or z (0, 1, 2) also shifts what it turns: where, and by how much of turn and distance. The point
/// itself stays where it is.
pub(in crate::simulate) fn shift_of_a_turn(target: Target, along: usize) -> Option<(Target, f64)> {
    let (dof, at): (usize, &dyn Fn(usize) -> Target) = match target {
        Target::OwnLine { axis, after, dof } => (dof, &move |dof| Target::OwnLine { axis, after, dof }),
        Target::Axis { axis, after, dof } => (dof, &move |dof| Target::Axis { axis, after, dof }),
        Target::Base(dof) => (dof, &Target::Base),
        Target::Tool(dof) => (dof, &Target::Tool),
        Target::Workpiece(dof) => (dof, &Target::Workpiece),
        Target::Block(dof) => (dof, &Target::Block),
        _ => return None,
    };
    // rx (3): y goes to z and z to -y; ry: z to x, x to -z; rz: x to y, y to -x
    let (to, way) = match (dof, along) {
        (3, 1) => (2, 1.0),
        (3, 2) => (1, -1.0),
        (4, 2) => (0, 1.0),
        (4, 0) => (2, -1.0),
        (5, 0) => (1, 1.0),
        (5, 1) => (0, -1.0),
        _ => return None,
    };
    Some((at(to), -way))
}

/// A carriage on a guideway that is bowed upwards: at q from its middle it is lower by (q/300)² of the sag, and it leans
/// outwards by the slope of the guideway there, 2q/300².
fn carriage_sag(
    axis: AxisName,
    id: &str,
    machine: &Machine,
    settings: Settings<'_>,
) -> Result<Vec<Parameter>, Refusal> {
    let here = axis_here(axis, machine)?;
    let stands = if goes_backwards(here) { -1.0 } else { 1.0 };
    // outwards and down: about +y where it runs along x, about -x where it runs along y
    let (about, way) = match axis {
        AxisName::X => (4, 1.0),
        AxisName::Y => (3, -1.0),
        _ => return Err(Refusal::Unknown),
    };
    let name = format!("carriage_sag_{axis}");
    let lean = [(moved(axis, about), Shape::Power(axis, SPAN_MM, 1), stands * way * 2.0 / SPAN_MM)];
    let lean = at_the_ball(Parameter::new(name, Um, lean), machine);
    let mut both = about_a_point(vec![lean], id, 2, settings);
    if let Some(Parameter { role: Role::Amount(acts), .. }) = both.first_mut() {
        acts.push((moved(axis, 2), Shape::Power(axis, SPAN_MM, 2), -1.0));
    }
    Ok(both)
}

/// A carriage that turns in proportion to its way, about any point: besides the turn, what it bears goes across it.
fn carriage_turn(axis: AxisName, dof: usize, machine: &Machine) -> Vec<Parameter> {
    let turn = at_the_ball(polynomial(axis, dof, 1, false), machine);
    let across = (0..3).filter(|to| to + 3 != dof).map(|to| {
        let name = format!("E{}{axis}_{}", dof_letter(dof), ["x", "y", "z"][to]);
        Parameter::at(name, Um, moved(axis, to), Shape::Power(axis, SPAN_MM, 1))
    });
    std::iter::once(turn).chain(across).collect()
}

fn moved(axis: AxisName, dof: usize) -> Target {
    if axis.is_rotary() { Target::OwnLine { axis, after: false, dof } } else { Target::Axis { axis, after: true, dof } }
}

/// The axis moves askew: across its way in proportion to its coordinate.
fn squareness(axis: AxisName, dof: usize, sign: f64, machine: &Machine) -> Result<Vec<Parameter>, Refusal> {
    let axis = axis_here(axis, machine)?.name;
    // the turn that does this: about z for Y along x, about x for Z along y, about y for Z along x
    let about = 3 + (3 - along(axis) - dof);
    let name = format!("E{}0{axis}", dof_letter(about));
    Ok(vec![Parameter::new(name, Urad, [(moved(axis, dof), Shape::Power(axis, 1.0, 1), sign)])])
}

/// Curvature of the scale.
fn bend(axis: AxisName) -> Parameter {
    polynomial(axis, along(axis), 2, true)
}

/// `amount * (q / 300 mm)^n`.
fn polynomial(axis: AxisName, dof: usize, n: i32, numbered: bool) -> Parameter {
    let unit = if dof < 3 { Um } else { Urad };
    let number = if numbered { n.to_string() } else { String::new() };
    let name = format!("E{}{axis}{number}", dof_letter(dof));
    Parameter::at(name, unit, moved(axis, dof), Shape::Power(axis, SPAN_MM, n))
}

/// The screw's error of every turn.
fn pitch(axis: AxisName, settings: Settings<'_>) -> Vec<Parameter> {
    let own = format!("pitch_{axis}");
    let period = settings(&own).or_else(|| settings("pitch")).unwrap_or(PITCH_MM);
    let target = moved(axis, along(axis));
    vec![
        Parameter::at(format!("E{axis}{axis}c"), Um, target, Shape::PitchCosine(axis, period)),
        Parameter::at(format!("E{axis}{axis}s"), Um, target, Shape::PitchSine(axis, period)),
        Parameter::setting(&own, Mm).alias("pitch"),
    ]
}

/// A rotary scale that counts too much or too little: angle in proportion to the angle.
fn rotary_scale(axis: AxisName) -> Parameter {
    let dof = along(axis) + 3;
    // micrometres per metre is microradians per radian
    Parameter::at(format!("E{axis}{axis}"), UmPerM, moved(axis, dof), Shape::Power(axis, 1.0, 1))
}

/// Error motions that repeat k times per turn.
fn harmonic(family: &str, axis: AxisName, k: &str, machine: &Machine) -> Result<Vec<Parameter>, Refusal> {
    let dofs: Vec<usize> = match family {
        "radial" => across(axis).collect(),
        "axial" => vec![along(axis)],
        "tilt" => across(axis).map(|d| d + 3).collect(),
        "positioning" => vec![along(axis) + 3],
        _ => return Err(Refusal::Unknown),
    };
    let order = match k {
        "1" => 1.0,
        "2" => 2.0,
        "3" => 3.0,
        _ => return Err(Refusal::Unknown),
    };
    axis_here(axis, machine)?;
    let row = |dof: usize, letter: char, shape: Shape| {
        let unit = if dof < 3 { Um } else { Urad };
        Parameter::at(format!("E{}{axis}{k}{letter}", dof_letter(dof)), unit, moved(axis, dof), shape)
    };
    let pair = |dof: usize| [row(dof, 'c', Shape::Cosine(axis, order)), row(dof, 's', Shape::Sine(axis, order))];
    Ok(dofs.into_iter().flat_map(pair).collect())
}

/// The axis lags behind the control by half the lost motion, whichever way it goes.
fn backlash(axis: AxisName) -> Parameter {
    let unit = if axis.is_rotary() { Urad } else { Um };
    let acts = [(Target::Reading(axis), Shape::Sense(axis), -0.5)];
    Parameter::new(format!("backlash_{axis}"), unit, acts).alias("backlash").alias(format!("b_{axis}"))
}

/// The same, but the lag grows from nothing after each reversal.
fn wind_up(axis: AxisName, settings: Settings<'_>) -> Vec<Parameter> {
    let name = format!("windup_way_{axis}");
    let over = settings(&name).unwrap_or(WINDUP_RAD);
    let acts = [(Target::Reading(axis), Shape::WoundUp(axis, over), -0.5)];
    vec![Parameter::new(format!("windup_{axis}"), Urad, acts), Parameter::setting(&name, Deg)]
}

/// The centre of the axis wanders once per turn, and the reading head, past which the ring of the encoder moves by as much, takes
/// the part along the ring for an angle: the control turns the axis back by it.
fn run_out_that_is_read(axis: AxisName, settings: Settings<'_>) -> Vec<Parameter> {
    let ring = format!("ring_{axis}");
    let radius_mm = settings(&ring).unwrap_or(RING_MM);
    let mut out = Vec::new();
    for (number, dof) in across(axis).enumerate() {
        for (letter, shape) in [('c', Shape::Cosine(axis, 1.0)), ('s', Shape::Sine(axis, 1.0))] {
            let mut acts = vec![(moved(axis, dof), shape, 1.0)];
            if number == 1 {
                acts.push((moved(axis, along(axis) + 3), shape, -1.0 / radius_mm));
            }
            out.push(Parameter::new(format!("runout_{}{axis}{letter}", dof_letter(dof)), Um, acts));
        }
    }
    out.push(Parameter::setting(&ring, Mm));
    out
}

/// In this run the axis has another zero than in the first.
fn homed_again(axis: AxisName, _: Settings<'_>) -> Vec<Parameter> {
    let zero = Target::OwnLine { axis, after: false, dof: along(axis) + 3 };
    vec![Parameter::at(format!("rehomed_{axis}"), Deg, zero, Shape::Constant)]
}

/// A coupling slips at some hour: from then on the axis is elsewhere by one amount.
fn lost_position(axis: AxisName, settings: Settings<'_>) -> Result<Vec<Parameter>, Refusal> {
    let when = format!("lost_h_{axis}");
    let Some(hour) = settings(&when).or_else(|| settings("from_h")) else {
        return Err(Refusal::NotHere(format!("it must say when: {when} (hours)")));
    };
    let unit = if axis.is_rotary() { Urad } else { Um };
    let lost = Parameter::new(format!("lost_{axis}"), unit, [(Target::Reading(axis), Shape::FromHour(hour), 1.0)]);
    Ok(vec![lost, Parameter::setting(&when, H).alias("from_h")])
}

/// The control counts this axis the wrong way round (value 1).
fn flipped(axis: AxisName) -> Parameter {
    Parameter::new(format!("flip_{axis}"), One, [(Target::Reading(axis), Shape::Power(axis, 1.0, 1), -2.0)])
}

/// The control counts these two axes for each other (value 1).
fn swapped((a, b): (AxisName, AxisName)) -> Parameter {
    // each stands where the other should
    let acts = [(a, b, 1.0), (a, a, -1.0), (b, a, 1.0), (b, b, -1.0)];
    let acts = acts.map(|(axis, by, f)| (Target::Reading(axis), Shape::Power(by, 1.0, 1), f));
    Parameter::new(format!("swap_{a}{b}"), One, acts)
}
