//! The paper's three tables: given, identified by closed form and by least squares, deviation.
//!
//! The touches come from the virtual machine, which shares no arithmetic with either way of identifying.

use super::closed_form::{self, DoubleHead, Mode, Reading};
use crate::axes::AxisName;
use crate::diag::{Failure, Result};
use crate::fit::{self, Settings};
use crate::geometry::translation;
use crate::log::{RawTouch, Status, Touch};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Run;
use crate::program::plan::Plan;
use crate::simulate::{self, scenario::Scenario};
use crate::units::deg_from_rad;
use nalgebra::Vector3;
use serde::Serialize;

/// The values that the paper gives, deg and mm: a b g d_x d_y d_z of BZ, a and d_x of BA.
pub const GIVEN: [[f64; 8]; 2] = [
    [0.0150, -0.0100, 0.0200, 0.0300, 0.0250, -0.0100, 0.0120, 0.0100],
    [0.0250, 0.0340, -0.0100, -0.0400, -0.0350, 0.0180, -0.0180, 0.0230],
];

/// One printed table for one set of given values.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// `4-1`, `4-2` or `4-3`.
    pub table: String,
    /// 1 or 2.
    pub set: usize,
    /// Of Table 4-3: `R`, `T` or `F`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// Its lines.
    pub rows: Vec<Row>,
}

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The paper's symbol.
    pub parameter: String,
    /// `deg` or `mm`.
    pub unit: String,
    /// What was planted.
    pub given: f64,
    /// What the closed form gives.
    pub closed_form: f64,
    /// What least squares gives.
    pub least_squares: f64,
}

impl Row {
    /// The print says "identified = given": equal at four decimals, both ways.
    #[must_use]
    pub fn equals_print(&self) -> bool {
        let four = |x: f64| (x * 1e4).round() as i64;
        four(self.closed_form) == four(self.given) && four(self.least_squares) == four(self.given)
    }
}

/// What the tables are made on: a machine and its plan.
#[derive(Debug, Clone, Copy)]
pub struct Bench<'a> {
    pub machine: &'a Machine,
    /// What is touched on it.
    pub plan: &'a Plan,
    /// The effects.
    pub catalogue: &'a Catalogue,
}

impl Bench<'_> {
    /// Touches of a machine with these errors, without noise, blocks where the plan says.
    ///
    /// # Errors
    /// When the virtual machine refuses the scenario or a touch misses.
    pub fn touch(&self, effect: &str, errors: &[(&str, f64)]) -> Result<Vec<Touch>> {
        let scenario = Scenario::flawless().with(self.machine, effect, errors)?;
        let (raw, _) = simulate::run(self.machine, self.plan, &scenario, None)?;
        raw.iter().map(matched).collect()
    }

    /// Readings of touches: recorded less nominal along the outward normal.
    #[must_use]
    pub fn readings(&self, touches: &[Touch]) -> Vec<Reading> {
        let numbered = self.plan.numbered();
        touches
            .iter()
            .filter_map(|t| {
                let planned = numbered.touch(t.id)?;
                let pose = planned.pose.position();
                let carrier = self.machine.carrier(&planned.carrier)?;
                // the linear axes are square to each other and stand at R: the carrier's turn is all that is left
                let turn = self.machine.carrier_frame(carrier, &pose.with_xyz_mm(Vector3::zeros()))
                    * translation(Vector3::zeros());
                let normal = turn.rotation * Vector3::from(planned.normal);
                // the plan's own places are rounded for the control: the nominal one is computed anew
                let ball = Vector3::from(planned.point) + Vector3::from(planned.normal) * self.plan.ball_radius_mm;
                let nominal = self.machine.linear_for_ball(carrier, &pose, &ball, self.plan.tool_length_mm)?;
                let moved = t.position.xyz_mm() - nominal.xyz_mm();
                Some(Reading {
                    pose_deg: [AxisName::A, AxisName::B, AxisName::C].map(|a| pose.get(a)),
                    normal,
                    point: crate::geometry::apply(&turn, &Vector3::from(planned.point)),
                    e: normal.dot(&moved),
                })
            })
            .collect()
    }

    /// Least squares with known blocks, by the paper's symbol.
    ///
    /// # Errors
    /// When the fit is refused.
    pub fn fit(&self, touches: &[Touch], effect: &str) -> Result<Vec<(String, f64)>> {
        let settings = Settings { effects: vec![effect.into()], ..Settings::default() };
        let runs = [Run { plan: self.plan, touches, mounting: None, started_s: None }];
        let fit = fit::identify(self.machine, self.catalogue, &runs, &settings)?;
        Ok(fit
            .outcome
            .parameters
            .iter()
            .map(|p| (p.alias.clone().unwrap_or_else(|| p.name.clone()), p.value))
            .collect())
    }

    fn table(
        &self,
        table: &str,
        set: usize,
        mode: Option<&str>,
        effects: (&str, &str),
        errors: &[(&str, f64)],
        closed: impl Fn(&[Reading]) -> Option<Vec<(&'static str, f64)>>,
    ) -> Result<Table> {
        let (planted, fitted) = effects;
        let touches = self.touch(planted, errors)?;
        let closed = closed(&self.readings(&touches)).ok_or_else(|| {
            Failure::new("paper::faces", format!("the plan lacks faces that the closed form of table {table} needs"))
        })?;
        let least = self.fit(&touches, fitted)?;
        let rows = errors
            .iter()
            .filter_map(|(name, given)| {
                let pick = |all: &[(String, f64)]| all.iter().find(|(n, _)| n == name).map(|(_, v)| *v);
                let closed_form = closed.iter().find(|(n, _)| n == name)?.1;
                Some(Row {
                    parameter: (*name).to_owned(),
                    unit: if name.starts_with('d') { "mm" } else { "deg" }.into(),
                    given: *given,
                    closed_form,
                    least_squares: pick(&least)?,
                })
            })
            .collect();
        Ok(Table { table: table.into(), set, mode: mode.map(Into::into), rows })
    }
}

fn matched(raw: &RawTouch) -> Result<Touch> {
    match (raw.id, raw.status) {
        (Some(id), Status::Hit) => Ok(Touch {
            id,
            position: raw.position,
            status: raw.status,
            time_s: raw.time_s,
            digit_mm: None,
            temperature_deg_c: None,
            line: raw.line,
        }),
        _ => Err(Failure::new("paper::miss", format!("touch {} of the virtual machine missed", raw.line))),
    }
}

/// Tables 4-1 and 4-2 on the swivelling head (plans `head` and `table`), and 4-3 on the two-axis head.
///
/// # Errors
/// When a plan lacks what a table needs.
pub fn all(head: Bench, table: Bench, double: Bench) -> Result<Vec<Table>> {
    let mut out = Vec::new();
    for (i, g) in GIVEN.iter().enumerate() {
        let errors = [("a_BZ", g[0]), ("b_BZ", g[1]), ("g_BZ", g[2]), ("d_xBZ", g[3]), ("d_yBZ", g[4])];
        let length = head.machine.tool.length_mm;
        out.push(head.table("4-1", i + 1, None, ("paper-head", "paper-head"), &errors, |r| {
            let [a, b, g, dx, dy] = closed_form::head(r, length)?;
            Some(vec![
                ("a_BZ", deg_from_rad(a)),
                ("b_BZ", deg_from_rad(b)),
                ("g_BZ", deg_from_rad(g)),
                ("d_xBZ", dx),
                ("d_yBZ", dy),
            ])
        })?);
    }
    for (i, g) in GIVEN.iter().enumerate() {
        let errors = [("a_CY", g[0]), ("b_CY", g[1]), ("d_xCY", g[3]), ("d_yCY", g[4])];
        let z_c = table.machine.reference.pivot.z;
        out.push(table.table("4-2", i + 1, None, ("paper-table", "paper-table"), &errors, |r| {
            let [a, b, dx, dy] = closed_form::table(r, z_c)?;
            Some(vec![("a_CY", deg_from_rad(a)), ("b_CY", deg_from_rad(b)), ("d_xCY", dx), ("d_yCY", dy)])
        })?);
    }
    for (mode, word) in [(Mode::R, "R"), (Mode::T, "T"), (Mode::F, "F")] {
        for (i, g) in GIVEN.iter().enumerate() {
            // mode R takes the table's last two numbers for the unknowns of the relations
            let (angle, offset) = if mode == Mode::R { ("g_BA", "d_zBA") } else { ("a_BA", "d_xBA") };
            let errors = [
                (angle, g[6]),
                (offset, g[7]),
                ("a_BZ", g[0]),
                ("b_BZ", g[1]),
                ("g_BZ", g[2]),
                ("d_xBZ", g[3]),
                ("d_yBZ", g[4]),
                ("d_zBZ", g[5]),
            ];
            let fitted = if mode == Mode::T { "paper-double-head" } else { "double-head-10" };
            let length = double.machine.tool.length_mm;
            out.push(double.table("4-3", i + 1, Some(word), ("double-head-10", fitted), &errors, |r| {
                closed_form::double_head(r, length, mode).map(|u| double_rows(&u))
            })?);
        }
    }
    Ok(out)
}

fn double_rows(u: &DoubleHead) -> Vec<(&'static str, f64)> {
    vec![
        ("a_BZ", deg_from_rad(u.a_bz)),
        ("b_BZ", deg_from_rad(u.b_bz)),
        ("g_BZ", deg_from_rad(u.g_bz)),
        ("d_xBZ", u.dx_bz),
        ("d_yBZ", u.dy_bz),
        ("d_zBZ", u.dz_bz),
        ("a_BA", deg_from_rad(u.a_ba)),
        ("g_BA", deg_from_rad(u.g_ba)),
        ("d_xBA", u.dx_ba),
        ("d_zBA", u.dz_ba),
    ]
}
