//! Points on spheres, on cylinders and in bores: from a ring of directions to places and normals in the carrier's frame.

use super::as_written::RingIn;
use super::spec::Along;
use crate::axes::Position;
use crate::machine::{Block, Form, Machine};
use crate::units::{deg_from_rad, rad_from_deg};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

/// A point on what is round, in the carrier's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RingPoint {
    /// Nominal contact, mm.
    pub point: Vector3<f64>,
    /// Unit normal that points out of the material.
    pub normal: Vector3<f64>,
    /// Azimuth and elevation in the carrier's frame, e.g. `az72 el10`.
    pub label: String,
}

/// What turns the directions of a frame into those of a body's carrier, in a pose.
#[must_use]
pub fn to_carrier(machine: &Machine, block: &Block, frame: RingIn, pose: &Position) -> Rotation3<f64> {
    let into_carrier = || machine.carrier_frame(block.carrier, pose).rotation.inverse();
    match frame {
        RingIn::Block => Rotation3::identity(),
        RingIn::Machine => into_carrier().to_rotation_matrix(),
        RingIn::Tool => {
            // Z is where the spindle is
            let up = UnitQuaternion::rotation_between(&Vector3::z(), &machine.tool.direction);
            let turned = machine.tool_frame(pose).rotation * up.unwrap_or_default();
            (into_carrier() * turned).to_rotation_matrix()
        }
    }
}

/// Places a point of a ring on a body; `to_carrier` turns the directions of the program's frame into the carrier's.
///
/// # Errors
/// What the body lacks for it, for a person.
pub fn place(
    block: &Block,
    azimuth_deg: f64,
    along: Along,
    to_carrier: &Rotation3<f64>,
) -> Result<RingPoint, &'static str> {
    let radius = block.diameter.unwrap_or_default() / 2.0;
    let flat = |deg: f64| Vector3::new(rad_from_deg(deg).cos(), rad_from_deg(deg).sin(), 0.0);
    match (block.form, along) {
        (Form::Sphere, Along::Elevation(deg)) => {
            let (sin, cos) = rad_from_deg(deg).sin_cos();
            let normal = tidy(to_carrier * (flat(azimuth_deg) * cos + Vector3::z() * sin));
            Ok(RingPoint { point: tidy(block.centre + normal * radius), normal, label: label(&normal) })
        }
        (Form::Cylinder | Form::Bore, Along::Depth(mm)) => {
            if !(mm > 0.0 && mm < block.size.z) {
                return Err("the depth lies beyond its ends");
            }
            let sense = if block.form == Form::Bore { -1.0 } else { 1.0 };
            let outward = tidy(flat(azimuth_deg));
            let height = Vector3::z() * (block.size.z / 2.0 - mm);
            Ok(RingPoint {
                point: tidy(block.centre + outward * radius + height),
                normal: tidy(outward * sense),
                label: format!("az{:.0} dp{mm}", whole_turn(azimuth_deg)),
            })
        }
        (Form::Sphere, Along::Depth(_)) => Err("a sphere has elevations and no depths"),
        (Form::Cylinder | Form::Bore, Along::Elevation(_)) => Err("a cylinder or bore has depths and no elevations"),
        (Form::Box | Form::Plane | Form::Centre | Form::Reading | Form::Part, _) => {
            Err("it is not round: it has faces")
        }
    }
}

/// Name of a direction: azimuth and elevation in whole degrees.
#[must_use]
pub fn label(normal: &Vector3<f64>) -> String {
    let elevation = deg_from_rad(normal.z.clamp(-1.0, 1.0).asin());
    if elevation > 89.5 {
        return "pole".to_owned();
    }
    format!("az{:.0} el{:.0}", whole_turn(deg_from_rad(normal.y.atan2(normal.x))), elevation + 0.0)
}

/// An angle between 0 and 360, deg.
fn whole_turn(deg: f64) -> f64 {
    let turned = deg.rem_euclid(360.0);
    if turned >= 359.5 { 0.0 } else { turned }
}

/// Without the last digits that a sine leaves: files show 0 and not 6e-17.
fn tidy(v: Vector3<f64>) -> Vector3<f64> {
    v.map(|x| if x.abs() < 1e-12 { 0.0 } else { x })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Carrier;

    fn body(form: Form) -> Block {
        Block {
            name: "b".to_owned(),
            form,
            centre: Vector3::new(10.0, 20.0, 30.0),
            size: Vector3::new(25.0, 25.0, 25.0),
            diameter: Some(25.0),
            riser: None,
            carrier: Carrier::Table,
        }
    }

    #[test]
    fn points_lie_where_a_drawing_has_them() {
        let none = Rotation3::identity();
        let pole = place(&body(Form::Sphere), 0.0, Along::Elevation(90.0), &none).unwrap();
        assert_eq!((pole.point, pole.label.as_str()), (Vector3::new(10.0, 20.0, 42.5), "pole"));
        let side = place(&body(Form::Sphere), 90.0, Along::Elevation(30.0), &none).unwrap();
        let by_hand = Vector3::new(10.0, 20.0 + 12.5 * 0.75f64.sqrt(), 30.0 + 6.25);
        assert!((side.point - by_hand).norm() < 1e-12 && side.label == "az90 el30", "{side:?}");
        // a table that is tilted by 90 degrees about X: up in the machine is another direction of the carrier
        let tilted = Rotation3::from_axis_angle(&Vector3::x_axis(), -std::f64::consts::FRAC_PI_2);
        let up = place(&body(Form::Sphere), 0.0, Along::Elevation(90.0), &tilted).unwrap();
        assert!((up.normal - Vector3::y()).norm() < 1e-12 && up.label == "az90 el0", "{up:?}");
        let hole = place(&body(Form::Bore), 180.0, Along::Depth(5.0), &none).unwrap();
        assert_eq!((hole.point, hole.normal), (Vector3::new(-2.5, 20.0, 37.5), Vector3::new(1.0, 0.0, 0.0)));
        assert!(place(&body(Form::Bore), 0.0, Along::Depth(30.0), &none).is_err());
        assert!(place(&body(Form::Sphere), 0.0, Along::Depth(3.0), &none).is_err());
    }
}
