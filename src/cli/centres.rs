//! Options of `axiscal new` for what others have measured: sphere centres, points on spheres, results on one's own part.

use super::Io;
use crate::diag::{Failure, Result};
use crate::log::Reader;
use crate::log::centres::{Counted, Kind, Stated};
use crate::machine::Machine;
use crate::post::as_written::LengthUnit;
use crate::units::um_from_mm;
use crate::workflow::Environment;
use crate::workflow::centres::{self, CentresRequest, Converted};
use crate::workflow::new::Beside;
use crate::workflow::own_part::{self, PartRequest};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct CentresArgs {
    /// A file of sphere centres, or of points on spheres, that something else has measured (no plan and no log needed)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["plan", "log", "points"])]
    pub centres: Option<PathBuf>,
    /// Unit of X, Y and Z: mm or inch
    #[arg(long, value_name = "UNIT", requires = "centres")]
    pub unit: Option<String>,
    /// What X, Y and Z are: machine, workpiece (under the control's transformation) or reading (R-test)
    #[arg(long, requires = "centres")]
    pub kind: Option<String>,
    /// Machine positions are those of the ball or of the spindle (default: what fits the machine)
    #[arg(long, value_name = "ball|spindle", requires = "centres")]
    pub position_of: Option<String>,
    /// Standard deviation of each coordinate of a centre, in micrometres
    #[arg(long, value_name = "UM", requires = "centres")]
    pub sigma_um: Option<f64>,
    /// What carries the sphere or the part (default: the last rotary axis of the workpiece side)
    #[arg(long, value_name = "AXIS")]
    pub carrier: Option<String>,
    /// From the spindle to the ball's centre, mm (default: as in the machine file)
    #[arg(long, value_name = "MM")]
    pub tool_length: Option<f64>,
    /// Where the sphere is with all axes at 0, mm (for readings)
    #[arg(
        long,
        value_name = "X,Y,Z",
        allow_hyphen_values = true,
        value_delimiter = ',',
        num_args = 1,
        requires = "centres"
    )]
    pub sphere_at: Vec<f64>,
    /// Where the zero of workpiece coordinates is with all axes at 0, mm (default: 0,0,0)
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_delimiter = ',', num_args = 1)]
    pub zero_at: Vec<f64>,
    /// Inspection results on a part of your own (msr): each nominal point becomes a touch of a plan
    #[arg(long, value_name = "FILE", requires = "poses", conflicts_with_all = ["plan", "log"])]
    pub points: Option<PathBuf>,
    /// The results' coordinates: part (the part's own in every orientation) or turned (by the orientation before them)
    #[arg(long, value_name = "part|turned", requires = "points")]
    pub points_in: Option<String>,
    /// Where the rotary axes were for each orientation of the results: a CSV such as `record,A,C`
    #[arg(long, value_name = "FILE", requires = "points")]
    pub poses: Option<PathBuf>,
}

/// Plans and logs that were made, and what to say of them.
pub struct Made {
    /// For each run its plan and its log: paths and texts.
    pub files: Vec<(PathBuf, String)>,
    pub beside: Beside,
    pub says: Vec<String>,
    pub record: Value,
}

impl Made {
    /// The plans (0) or the logs (1).
    pub fn paths(&self, which: usize) -> Vec<PathBuf> {
        self.files.iter().skip(which).step_by(2).map(|(path, _)| path.clone()).collect()
    }
}

/// Fitted spheres that the screen lists; `--json` has all.
const MOST_SHOWN: usize = 12;

impl CentresArgs {
    /// Reads the file of another program, where one is given.
    ///
    /// # Errors
    /// When it is unusable or an option is no usable word.
    pub fn convert(&self, machine: &Machine, out: &Path, controllers: &[String], io: &Io) -> Result<Option<Made>> {
        if let (Some(points), Some(poses)) = (&self.points, &self.poses) {
            return self.part(machine, out, (points, poses), controllers, io).map(Some);
        }
        let Some(path) = &self.centres else { return Ok(None) };
        let source = io.source(path)?;
        let request = CentresRequest { given: self.stated()?, name: name_of(out) };
        let (converted, findings) = centres::convert(machine, &source, &request)?;
        io.remark(&findings.0);
        let mut files = Vec::new();
        for run in &converted.runs {
            let suffix = run.number.map_or_else(String::new, |n| format!("-run{n}"));
            let beside = |ending: &str| out.with_file_name(format!("{}{suffix}{ending}", request.name));
            files.push((beside(".plan.json"), run.plan.to_json()));
            files.push((beside(".csv"), run.log.clone()));
        }
        not_over(&files, path)?;
        let record = record(&converted);
        Ok(Some(Made { files, beside: converted.beside.clone(), says: says(&converted), record }))
    }

    /// Reads inspection results and the poses of their orientations.
    fn part(
        &self,
        machine: &Machine,
        out: &Path,
        (points, poses): (&Path, &Path),
        controllers: &[String],
        io: &Io,
    ) -> Result<Made> {
        let form = controllers.iter().find_map(|word| match Reader::load(word, |path| io.text(path)) {
            Ok((Reader::Points(form), _)) => Some(form),
            _ => None,
        });
        let form = match form {
            Some(form) => form,
            None => match Reader::load("msr", |path| io.text(path))?.0 {
                Reader::Points(form) => form,
                _ => return Err(Failure::new("points::form", "there is no form of inspection results")),
            },
        };
        let stated = self.stated()?;
        let request = PartRequest {
            name: name_of(out),
            carrier: centres::carrier_of(machine, stated.carrier.as_deref())?,
            tool_length_mm: stated.tool_length_mm.unwrap_or(machine.tool.length_mm),
            in_part: word(self.points_in.as_deref(), "--points-in", "part or turned", is_in_part)?,
            zero_at_mm: stated.zero_at_mm.unwrap_or_default(),
        };
        let bytes = io.read(points)?;
        let name = points.display().to_string();
        let (part, findings) = own_part::convert(machine, (&bytes, &name), &form, &io.source(poses)?, &request)?;
        io.remark(&findings.0);
        let beside = |ending: &str| out.with_file_name(format!("{}{ending}", request.name));
        let n = part.plan.touches.len();
        let files = vec![(beside(".plan.json"), part.plan.to_json()), (beside(".csv"), part.log)];
        not_over(&files, points)?;
        not_over(&files, poses)?;
        let says = vec![
            format!("{n} points of one part on {}: its position and its tilts are unknown", request.carrier),
            "X, Y and Z are read as the control's own coordinates: what is seen is the error of the kinematics in use"
                .to_owned(),
        ];
        let record = json!({ "kind": "part", "carrier": request.carrier.to_string(), "points": n });
        Ok(Made { files, beside: Beside::default(), says, record })
    }

    fn stated(&self) -> Result<Stated> {
        Ok(Stated {
            unit: word(self.unit.as_deref(), "--unit", "mm or inch", unit)?,
            kind: word(self.kind.as_deref(), "--kind", "machine, workpiece or reading", Kind::from_word)?,
            position_of: word(self.position_of.as_deref(), "--position-of", "ball or spindle", Counted::from_word)?,
            sigma_um: positive(self.sigma_um, "--sigma-um")?,
            carrier: self.carrier.clone(),
            tool_length_mm: positive(self.tool_length, "--tool-length")?,
            sphere_at_mm: three(&self.sphere_at, "--sphere-at")?,
            zero_at_mm: three(&self.zero_at, "--zero-at")?,
        })
    }
}

/// What is read is not written over.
fn not_over(files: &[(PathBuf, String)], read: &Path) -> Result<()> {
    if files.iter().any(|(written, _)| written == read) {
        return Err(Failure::new("new::exists", format!("{} would be written over", read.display()))
            .help("name the study differently with --out: its touches are written beside it under the same name"));
    }
    Ok(())
}

fn is_in_part(word: &str) -> Option<bool> {
    match word {
        "part" => Some(true),
        "turned" => Some(false),
        _ => None,
    }
}

fn unit(word: &str) -> Option<LengthUnit> {
    crate::log::centres::unit_of(word)
}

/// Files beside a study are named after it.
fn name_of(out: &Path) -> String {
    out.file_stem().map_or_else(|| "study".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn word<T>(given: Option<&str>, option: &str, expected: &str, read: fn(&str) -> Option<T>) -> Result<Option<T>> {
    let Some(text) = given else { return Ok(None) };
    let unusable = || Failure::new("new::option", format!("{option} is {text:?}")).help(format!("write {expected}"));
    read(text).map(Some).ok_or_else(unusable)
}

fn positive(given: Option<f64>, option: &str) -> Result<Option<f64>> {
    match given {
        Some(value) if !(value.is_finite() && value > 0.0) => {
            Err(Failure::new("new::option", format!("{option} is {value}")).help("write a number greater than 0"))
        }
        given => Ok(given),
    }
}

fn three(given: &[f64], option: &str) -> Result<Option<[f64; 3]>> {
    match given {
        [] => Ok(None),
        [x, y, z] if given.iter().all(|v| v.is_finite()) => Ok(Some([*x, *y, *z])),
        _ => Err(Failure::new("new::option", format!("{option} needs three numbers"))
            .help(format!("write for example {option} 200,0,-250: X, Y and Z in mm"))),
    }
}

fn says(converted: &Converted) -> Vec<String> {
    let of = if converted.kind == Kind::Reading { "readings" } else { "centres" };
    let mut lines = Vec::new();
    for group in converted.fitted.iter().take(MOST_SHOWN) {
        lines.push(format!(
            "line {}: sphere {:?} through {} points: radius {:.5} mm, form residual {:.1} µm RMS, at most {:.1} µm; the linear fit of many controls gives a centre {:.3} µm away",
            group.line,
            group.sphere,
            group.n_points,
            group.fitted.radius,
            um_from_mm(group.fitted.rms),
            um_from_mm(group.fitted.largest),
            um_from_mm(group.algebraic_off_mm),
        ));
    }
    if converted.fitted.len() > MOST_SHOWN {
        lines.push(format!("and {} more spheres (--json has all)", converted.fitted.len() - MOST_SHOWN));
    }
    for (name, centre) in &converted.spheres {
        lines.push(format!(
            "sphere {name:?} on {}: centre about X {:.3} Y {:.3} Z {:.3} with all axes at 0",
            converted.carrier, centre.x, centre.y, centre.z
        ));
    }
    lines.push(format!("{} {of} at {} poses", converted.n_centres, converted.n_poses));
    lines
}

fn record(converted: &Converted) -> Value {
    let fitted: Vec<Value> = converted
        .fitted
        .iter()
        .map(|g| {
            json!({
                "line": g.line, "sphere": g.sphere, "points": g.n_points, "centre_mm": g.fitted.centre.as_slice(),
                "radius_mm": g.fitted.radius, "rms_um": um_from_mm(g.fitted.rms), "largest_um": um_from_mm(g.fitted.largest),
                "algebraic_off_um": um_from_mm(g.algebraic_off_mm),
            })
        })
        .collect();
    let spheres: Vec<Value> = converted
        .spheres
        .iter()
        .map(|(name, centre)| json!({ "name": name, "centre_mm": centre.as_slice() }))
        .collect();
    json!({
        "kind": converted.kind.as_str(), "carrier": converted.carrier.to_string(), "centres": converted.n_centres,
        "poses": converted.n_poses, "spheres": spheres, "fitted": fitted,
        "noise_um": converted.beside.touch_sigma_mm.map(um_from_mm),
    })
}
