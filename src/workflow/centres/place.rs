//! From the numbers of a file to axis positions, and to the centre of each sphere in the frame of what bears it.

use super::{Centre, at_line};
use crate::axes::{AxisName, Position};
use crate::diag::{Failure, Finding, Findings, Result, Source};
use crate::log::centres::{CentreRow, Counted, Kind, Stated};
use crate::machine::{Carrier, Machine};
use crate::post::as_written::LengthUnit;
use crate::units::mm_from_inch;
use nalgebra::Vector3;

/// What the numbers mean on the machine.
#[derive(Debug, Clone)]
pub(super) struct Places<'a> {
    pub machine: &'a Machine,
    pub carrier: Carrier,
    pub kind: Kind,
    pub length_mm: f64,
    position_of: Counted,
    unit: LengthUnit,
    /// Of the sphere, where it is stated.
    sphere_at: Option<Vector3<f64>>,
    zero_at: Vector3<f64>,
}

/// Positions of rotary axes may be this far beyond their ranges, deg.
const BEYOND_DEG: f64 = 10.0;

/// The middle one of some numbers.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => 0.0,
        _ if n % 2 == 1 => values[n / 2],
        _ => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    }
}

impl<'a> Places<'a> {
    /// Settles what the numbers mean.
    ///
    /// # Errors
    /// When the file does not fit the machine, or says too little.
    pub fn find(
        machine: &'a Machine,
        carrier: Carrier,
        stated: &Stated,
        (unit, kind): (LengthUnit, Kind),
        rows: &[CentreRow],
        source: &Source,
        findings: &mut Findings,
    ) -> Result<Self> {
        let mut places = Self {
            machine,
            carrier,
            kind,
            length_mm: stated.tool_length_mm.unwrap_or(machine.tool.length_mm),
            position_of: stated.position_of.unwrap_or(Counted::Spindle),
            unit,
            sphere_at: stated.sphere_at_mm.map(Vector3::from),
            zero_at: Vector3::from(stated.zero_at_mm.unwrap_or_default()),
        };
        if kind == Kind::Reading && places.sphere_at.is_none() {
            let finding = Finding::error("centres::sphere_at", "readings say how the sphere moves, not where it is")
                .help("add the line `# sphere_at_mm = 200, 0, -250` above the header line or give --sphere-at: where the sphere is with all axes at 0, in the machine's frame R");
            return Err(at_line(source, 1, finding).into());
        }
        if kind == Kind::Machine && stated.position_of.is_none() {
            places.position_of = places.choose(rows, findings);
        }
        let off = places.typical_off(rows);
        if off > places.room_mm() {
            return Err(places.does_not_fit(rows, off, source).into());
        }
        Ok(places)
    }

    /// How far a centre may be from its nominal place, mm: what a log may be off its plan.
    fn room_mm(&self) -> f64 {
        self.machine.probe.overtravel + self.machine.probe.placement_tolerance
    }

    /// Positions of the ball or of the spindle: what the chain of the machine says, where it says anything.
    fn choose(&self, rows: &[CentreRow], findings: &mut Findings) -> Counted {
        let as_if = |position_of: Counted| Self { position_of, ..self.clone() }.typical_off(rows);
        let (ball, spindle) = (as_if(Counted::Ball), as_if(Counted::Spindle));
        let room = self.room_mm();
        let chosen = if ball <= room && spindle > room { Counted::Ball } else { Counted::Spindle };
        let message = match (ball <= room, spindle <= room) {
            (true, false) => format!(
                "X, Y and Z are read as positions of the ball (tool length {} mm subtracted by the control): as positions of the spindle they would be {spindle:.0} mm off",
                self.length_mm
            ),
            (false, true) => format!(
                "X, Y and Z are read as positions of the spindle (tool length {} mm not in them): as positions of the ball they would be {ball:.0} mm off",
                self.length_mm
            ),
            (true, true) => format!(
                "X, Y and Z are read as positions of the spindle (tool length {} mm not in them); these poses do not show whether that is right",
                self.length_mm
            ),
            (false, false) => return chosen,
        };
        findings.push(Finding::info("centres::position_of", message).help("--position-of ball or spindle states it"));
        chosen
    }

    /// Axis positions of a row, relative to R. `None`: the linear axes do not span space.
    fn position(&self, row: &CentreRow) -> Option<Position> {
        let origin = |axis: AxisName| self.machine.origin.get(axis).unwrap_or(0.0);
        let mut pose = Position::default();
        row.rotary.iter().for_each(|(axis, deg)| pose.set(axis, deg - origin(axis)));
        let xyz = if self.unit == LengthUnit::Inch { row.xyz.map(mm_from_inch) } else { row.xyz };
        match self.kind {
            Kind::Machine => {
                let zero = Vector3::new(origin(AxisName::X), origin(AxisName::Y), origin(AxisName::Z));
                let subtracted = match self.position_of {
                    Counted::Ball => self.machine.tool.direction.into_inner() * self.length_mm,
                    Counted::Spindle => Vector3::zeros(),
                };
                Some(pose.with_xyz_mm(xyz - zero + subtracted))
            }
            Kind::Workpiece => self.machine.linear_for_ball(self.carrier, &pose, &(xyz + self.zero_at), self.length_mm),
            Kind::Reading => {
                let turned = self.machine.carrier_frame(self.carrier, &pose).rotation.inverse() * xyz;
                let ball = self.sphere_at.unwrap_or_default() + turned;
                self.machine.linear_for_ball(self.carrier, &pose, &ball, self.length_mm)
            }
        }
    }

    /// The ball in the carrier's frame, as an errorless machine holds it.
    fn ball(&self, row: &CentreRow) -> Option<Vector3<f64>> {
        Some(self.machine.ball_in(self.carrier, &self.position(row)?, self.length_mm))
    }

    /// The rows' own centre in the carrier's frame: the middle one along each axis, which a wrong row does not move.
    fn middle(&self, rows: &[&CentreRow]) -> Vector3<f64> {
        if let (Kind::Reading, Some(at)) = (self.kind, self.sphere_at) {
            return at;
        }
        let balls: Vec<Vector3<f64>> = rows.iter().filter_map(|r| self.ball(r)).collect();
        Vector3::from_fn(|i, _| median(balls.iter().map(|b| b[i]).collect()))
    }

    /// How far the middle one of the centres is from where its sphere should be, mm.
    fn typical_off(&self, rows: &[CentreRow]) -> f64 {
        let mut off = Vec::new();
        for name in names(rows) {
            let own: Vec<&CentreRow> = rows.iter().filter(|r| r.sphere == name).collect();
            let middle = self.middle(&own);
            off.extend(own.iter().filter_map(|r| Some((self.ball(r)? - middle).norm())));
        }
        median(off)
    }

    /// Why the file is not this machine's, and which single change would make it so.
    fn does_not_fit(&self, rows: &[CentreRow], off: f64, source: &Source) -> Finding {
        let other_unit = if self.unit == LengthUnit::Mm { LengthUnit::Inch } else { LengthUnit::Mm };
        let other_end = if self.position_of == Counted::Ball { Counted::Spindle } else { Counted::Ball };
        let other_kind = if self.kind == Kind::Machine { Kind::Workpiece } else { Kind::Machine };
        let mut tries = vec![
            (Self { position_of: other_end, ..self.clone() }, format!("as positions of the {}", other_end.as_str())),
            (Self { unit: other_unit, ..self.clone() }, "in the other unit (--unit)".to_owned()),
            (Self { kind: other_kind, ..self.clone() }, format!("as kind {}", other_kind.as_str())),
        ];
        let carriers =
            self.machine.side(crate::machine::Side::Workpiece).map(|a| Carrier::Axis(a.name)).chain([Carrier::Table]);
        tries.extend(
            carriers
                .filter(|c| *c != self.carrier)
                .map(|carrier| (Self { carrier, ..self.clone() }, format!("with the sphere on {carrier} (--carrier)"))),
        );
        let fits = |tried: &Self, rows: &[CentreRow]| {
            let ends = [Counted::Ball, Counted::Spindle].map(|position_of| Self { position_of, ..tried.clone() });
            ends.iter().any(|t| t.typical_off(rows) <= self.room_mm())
        };
        let mut would: Option<String> = tries.iter().find(|(t, _)| fits(t, rows)).map(|t| t.1.clone());
        for axis in self.machine.rotary() {
            let turned: Vec<CentreRow> = rows
                .iter()
                .map(|r| {
                    let mut r = r.clone();
                    r.rotary.set(axis.name, -r.rotary.get(axis.name).unwrap_or(0.0));
                    r
                })
                .collect();
            if would.is_none() && fits(self, &turned) {
                would = Some(format!("with {} counted the other way round", axis.name));
            }
        }
        let message = format!(
            "these centres do not fit machine {:?}: in the frame of {} the middle one is {off:.1} mm from its sphere's place",
            self.machine.name, self.carrier
        );
        let help = match would {
            Some(how) => format!("they would fit {how}: check which is right"),
            None => "check --unit, --kind, --position-of, --carrier and --tool-length, the columns, and the positions of the rotary axes in the machine file".to_owned(),
        };
        at_line(source, rows.first().map_or(1, |r| r.line), Finding::error("centres::do_not_fit", message).help(help))
    }

    /// All rows with their axis positions.
    ///
    /// # Errors
    /// When an axis cannot be there.
    pub fn centres(&self, rows: &[CentreRow], source: &Source) -> Result<Vec<Centre>> {
        let mut wrong = Vec::new();
        let mut out = Vec::new();
        for row in rows {
            let Some(position) = self.position(row) else {
                return Err(Failure::new(
                    "centres::frame",
                    format!("the linear axes of machine {:?} do not span space", self.machine.name),
                )
                .help("check the directions of X, Y and Z in the machine file"));
            };
            for axis in self.machine.rotary() {
                let [low, high] = axis.range;
                let at = position.get(axis.name);
                if at < low - BEYOND_DEG || at > high + BEYOND_DEG {
                    let message = format!("{} is at {at} deg, far beyond its range of {low} to {high}", axis.name);
                    let finding = Finding::error("centres::out_of_range", message)
                        .help("check the number, and the range in the machine file");
                    wrong.push(at_line(source, row.line, finding));
                }
            }
            out.push(Centre { row: row.clone(), position });
        }
        if wrong.is_empty() { Ok(out) } else { Err(Failure(wrong)) }
    }

    /// The spheres by name, with their nominal centres in the carrier's frame.
    ///
    /// # Errors
    /// When a row is far from the others of its sphere.
    pub fn spheres(&self, centres: &[Centre], source: &Source) -> Result<Vec<(String, Vector3<f64>)>> {
        let rows: Vec<CentreRow> = centres.iter().map(|c| c.row.clone()).collect();
        let mut wrong = Vec::new();
        let mut out = Vec::new();
        for name in names(&rows) {
            let own: Vec<&CentreRow> = rows.iter().filter(|r| r.sphere == name).collect();
            let middle = self.middle(&own);
            for row in own {
                let off = self.ball(row).map_or(f64::INFINITY, |b| (b - middle).norm());
                if off > self.room_mm() {
                    let message =
                        format!("this centre is {off:.1} mm from where the others of sphere {name:?} have it");
                    let finding = Finding::error("centres::far", message)
                        .help("a slip of the pen, another sphere, or the wrong angles: correct the row, or write bad into a column status");
                    wrong.push(at_line(source, row.line, finding));
                }
            }
            out.push((name, middle));
        }
        if wrong.is_empty() { Ok(out) } else { Err(Failure(wrong)) }
    }
}

/// The names of the spheres in the order of the file.
fn names(rows: &[CentreRow]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for row in rows {
        if !names.contains(&row.sphere) {
            names.push(row.sphere.clone());
        }
    }
    names
}
