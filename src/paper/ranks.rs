//! The paper's statements of rank, computed: which unknowns a set of poses can tell (the method, section 1 and 7).
//!
//! Each pose gives the ball's displacement along x, y and z (or only along the directions of the printed sums), as
//! touches on three faces of one block do.

use crate::axes::AxisName;
use crate::diag::{Failure, Result, source};
use crate::fit::solve::observe;
use crate::machine::{Carrier, Machine};
use crate::model::catalogue::Catalogue;
use crate::model::predict::{Model, Observation, SetUp};
use crate::model::surface::{Body, Surface};
use nalgebra::{DMatrix, Vector3};

/// One statement: so many unknowns, of this rank.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Statement {
    pub machine: String,
    /// The unknowns in the paper's letters.
    pub unknowns: String,
    pub poses: String,
    /// How many unknowns.
    pub number: usize,
    pub rank: usize,
}

/// The unknowns as effects: one row each, so that any set of them can be put into a model.
const UNKNOWNS: &[(&str, &str, &str, &str)] = &[
    ("a_BZ", "B", "rx", "fixed"),
    ("b_BZ", "B", "ry", "fixed"),
    ("g_BZ", "B", "rz", "fixed"),
    ("dx_BZ", "B", "dx", "fixed"),
    ("dy_BZ", "B", "dy", "fixed"),
    ("dz_BZ", "B", "dz", "fixed"),
    ("a_BA", "A", "rx", "fixed"),
    ("b_BA", "A", "ry", "fixed"),
    ("g_BA", "A", "rz", "fixed"),
    ("dx_BA", "A", "dx", "fixed"),
    ("dy_BA", "A", "dy", "fixed"),
    ("dz_BA", "A", "dz", "fixed"),
    ("dL", "tool", "dz", ""),
    ("tx", "tool", "dx", ""),
    ("ty", "tool", "dy", ""),
    ("datum_x", "block", "dx", ""),
    ("datum_y", "block", "dy", ""),
    ("datum_z", "block", "dz", ""),
];

fn catalogue() -> Result<Catalogue> {
    let mut text = String::new();
    for (name, at, dof, frame) in UNKNOWNS {
        let frame = if frame.is_empty() { String::new() } else { format!(", frame = \"{frame}\"") };
        let unit = if dof.starts_with('r') { "mrad" } else { "mm" };
        text += &format!(
            "[[effect]]\nid = \"{name}\"\nat = \"{at}\"\nterms = [{{ parameter = \"{name}\", unit = \"{unit}\", dof = \"{dof}\", formula = \"1\"{frame} }}]\n"
        );
    }
    let mut catalogue = Catalogue::default();
    catalogue.add_file(&source("the paper's unknowns", text))?;
    Ok(catalogue)
}

/// A displacement that is measured: head pose (B, A) in deg and machine direction 0..3.
type Measured = (f64, f64, usize);

fn rank(machine: &Machine, catalogue: &Catalogue, unknowns: &[&str], measured: &[Measured]) -> Result<usize> {
    let effects: Vec<_> = unknowns
        .iter()
        .map(|id| {
            catalogue
                .get(id, machine)
                .ok_or_else(|| Failure::new("paper::unknown", format!("{id} does not apply to {}", machine.name)))
        })
        .collect::<Result<_>>()?;
    let set_up = SetUp {
        label: "datum".into(),
        carrier: Carrier::Table,
        body: Body::Box,
        centre: Vector3::zeros(),
        runs: vec![0],
    };
    let model = Model::new(machine, &effects, std::slice::from_ref(&set_up), machine.reference.pivot);
    let mut jacobian = DMatrix::zeros(measured.len(), model.n_unknowns());
    let mut row = vec![0.0; model.n_unknowns()];
    for (i, (b, a, k)) in measured.iter().enumerate() {
        let mut pose = crate::axes::Position::default();
        pose.set(AxisName::B, *b);
        pose.set(AxisName::A, *a);
        let point = machine.reference.ball;
        let position = machine.linear_for_ball(Carrier::Table, &pose, &point, machine.tool.length_mm).unwrap_or(pose);
        let mut normal = Vector3::zeros();
        normal[*k] = 1.0;
        let touch = Observation {
            run: 0,
            id: i as u64 + 1,
            set_up: 0,
            point,
            normal,
            surface: Surface::Plane { point, normal },
            ball_radius: 0.0,
            ball_at_zero: machine.tool.ball_at_zero(machine.tool.length_mm),
            position,
            state: [0.0; crate::model::formula::VARIABLES.len()],
            has_temperature: false,
        };
        model.gap_and_row(&touch, &model.start(), &mut row);
        jacobian.row_mut(i).copy_from_slice(&row);
    }
    Ok(observe(&jacobian).rank)
}

fn xyz(poses: &[(f64, f64)]) -> Vec<Measured> {
    poses.iter().flat_map(|(b, a)| (0..3).map(move |k| (*b, *a, k))).collect()
}

/// All statements, computed on the built-in machines.
///
/// # Errors
/// When a machine of the paper is missing.
pub fn statements(machines: &[Machine]) -> Result<Vec<Statement>> {
    let find = |name: &str| {
        machines
            .iter()
            .find(|m| m.name == name)
            .ok_or_else(|| Failure::new("paper::machine", format!("machine {name:?} is missing")))
    };
    let catalogue = catalogue()?;
    let mut out = Vec::new();
    let mut say = |machine: &Machine, unknowns: &str, ids: &[&str], poses: &str, measured: &[Measured]| -> Result<()> {
        out.push(Statement {
            machine: machine.name.clone(),
            unknowns: unknowns.into(),
            poses: poses.into(),
            number: ids.len(),
            rank: rank(machine, &catalogue, ids, measured)?,
        });
        Ok(())
    };

    let head = find("swivel-head")?;
    let three = xyz(&[(0.0, 0.0), (-90.0, 0.0), (-30.0, 0.0)]);
    let poses = "B = 0, -90, -30";
    let five = ["a_BZ", "b_BZ", "g_BZ", "dx_BZ", "dy_BZ"];
    let six = ["a_BZ", "b_BZ", "g_BZ", "dx_BZ", "dy_BZ", "dz_BZ"];
    let datum = ["datum_x", "datum_y", "datum_z"];
    say(head, "a b g dx dy", &five, poses, &three)?;
    say(head, "a b g dx dy dz", &six, poses, &three)?;
    say(head, "a b g dx dy dz, L", &[&six[..], &["dL"]].concat(), poses, &three)?;
    say(head, "a b g dx dy dz, datum", &[&six[..], &datum[..]].concat(), poses, &three)?;
    say(head, "a b g, L, datum", &[&five[..3], &["dL"], &datum[..]].concat(), poses, &three)?;
    say(
        head,
        "a b g dx dy dz, L, datum, tip",
        &[&six[..], &["dL"], &datum[..], &["tx", "ty"]].concat(),
        poses,
        &three,
    )?;
    say(head, "a b g dx dy", &five, "B = 0, -90", &xyz(&[(0.0, 0.0), (-90.0, 0.0)]))?;

    let double = find("double-head")?;
    let relations = ["dx_BZ", "dy_BZ", "a_BZ", "b_BZ", "g_BZ", "dz_BA", "g_BA"];
    let eight = ["a_BZ", "b_BZ", "g_BZ", "dx_BZ", "dy_BZ", "dz_BZ", "a_BA", "dx_BA"];
    let ten = ["a_BZ", "b_BZ", "g_BZ", "dx_BZ", "dy_BZ", "dz_BZ", "a_BA", "dx_BA", "dz_BA", "g_BA"];
    let twelve: Vec<&str> = UNKNOWNS[..12].iter().map(|u| u.0).collect();
    let sums: Vec<Measured> = vec![
        (0.0, 0.0, 0),
        (0.0, 0.0, 1),
        (-90.0, 0.0, 0),
        (-90.0, 0.0, 1),
        (0.0, -90.0, 0),
        (0.0, -90.0, 1),
        (-30.0, 0.0, 0),
    ];
    say(double, "seven of the relations", &relations, "the seven printed sums", &sums)?;
    say(double, "eight of the table", &eight, "the seven printed sums", &sums)?;
    let printed = [(0.0, 0.0), (-90.0, 0.0), (0.0, -90.0), (-30.0, 0.0)];
    let plus = [&printed[..], &[(0.0, 90.0)]].concat();
    let plus_b = [&plus[..], &[(90.0, 0.0)]].concat();
    let cross = [(0.0, 0.0), (-90.0, 0.0), (90.0, 0.0), (0.0, -90.0), (0.0, 90.0)];
    let without = [(0.0, 0.0), (-90.0, 0.0), (0.0, -90.0), (0.0, 90.0)];
    let angles = [0.0, 30.0, -30.0, 90.0, -90.0];
    let swept: Vec<(f64, f64)> = angles.iter().flat_map(|b| angles.iter().map(move |a| (*b, *a))).collect();
    for (poses, list) in [
        ("(0,0) (-90,0) (0,-90) (-30,0)", &printed[..]),
        ("(0,0) (-90,0) (0,-90) (-30,0) (0,90)", &plus[..]),
        ("(0,0) (-90,0) (0,-90) (-30,0) (0,90) (90,0)", &plus_b[..]),
        ("(0,0) (±90,0) (0,±90)", &cross[..]),
        ("(0,0) (-90,0) (0,±90)", &without[..]),
        ("both axes swept, ±90", &swept[..]),
    ] {
        say(double, "eight of the table", &eight, poses, &xyz(list))?;
        say(double, "ten", &ten, poses, &xyz(list))?;
    }
    say(double, "all twelve", &twelve, "both axes swept, ±90", &xyz(&swept))?;
    say(double, "ten, R, datum", &[&ten[..], &["dL"], &datum[..]].concat(), "both axes swept, ±90", &xyz(&swept))?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_the_integers_of_the_method() {
        let (machines, _) = crate::machine::load(&source("machines.toml", crate::machine::BUILT_IN)).unwrap();
        let ranks: Vec<(usize, usize)> = statements(&machines).unwrap().iter().map(|s| (s.number, s.rank)).collect();
        let head = [(5, 5), (6, 6), (7, 7), (9, 6), (7, 7), (12, 7), (5, 4)];
        let double = [
            (7, 7),
            (8, 6), // the printed sums
            (8, 8),
            (10, 9),
            (8, 8),
            (10, 10),
            (8, 8),
            (10, 10),
            (8, 8),
            (10, 10),
            (8, 8),
            (10, 9),
            (8, 8),
            (10, 10),
            (12, 10),
            (14, 11),
        ];
        assert_eq!(ranks[..7], head);
        assert_eq!(ranks[7..], double);
    }
}
