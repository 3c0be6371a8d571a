//! The compensation of a study as the controller's own tables.

mod judge;
mod old_values;

pub use judge::Doubt;

use super::{Environment, Loaded, load_controller};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::fit::Fit;
use crate::fit::outcome::Undetermined;
use crate::post::Release;
use crate::post::tables::{LengthUnit, Tables};
use crate::tables::Correction;
use crate::tables::compensation::{Compensation, Provenance};
use crate::tables::control;
use crate::tables::linuxcnc::{self, ini::UserIni};
use crate::units::Plain;
use judge::{Judged, judged};
use old_values::{old_pins, old_values};
use std::collections::BTreeMap;
use std::path::Path;

/// What is exported, and how.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Name of a controller, or a postprocessor file.
    pub controller: &'a str,
    /// LinuxCNC's version; `None`: that of its postprocessor file.
    pub target: Option<&'a str>,
    /// Radius at which what a table cannot carry is stated, mm.
    pub radius_mm: f64,
    /// Values beyond the limits, and those of a model that lacks something, all the same.
    pub force: bool,
    /// Entries that nobody has verified on a control, too.
    pub accept_unverified: bool,
    /// Unit of lengths in the control's tables.
    pub unit: LengthUnit,
    /// LinuxCNC's INI file, for its old values.
    pub ini: Option<&'a Path>,
    /// The control's own backup of the values that are to be changed.
    pub backup: Option<&'a Path>,
    /// Old values of the control, `NAME=VALUE`.
    pub old: &'a [String],
    /// Date of the data, YYYY-MM-DD; `None`: of the newest log file.
    pub date: Option<&'a str>,
}

impl<'a> Request<'a> {
    /// For a controller, with nothing known of its old values.
    #[must_use]
    pub fn new(controller: &'a str) -> Self {
        Self {
            controller,
            target: None,
            radius_mm: 100.0,
            force: false,
            accept_unverified: false,
            unit: LengthUnit::Mm,
            ini: None,
            backup: None,
            old: &[],
            date: None,
        }
    }

    /// The tables that are asked for.
    ///
    /// # Errors
    /// When the controller has no tables, or an option is not for it.
    pub fn form(&self, env: &dyn Environment) -> Result<Form> {
        let described = load_controller(self.controller, env)?;
        if described.tables.is_none() && described.releases.is_empty() {
            let says = format!("controller {:?} has no [tables]: no tables are known for it", self.controller);
            return Err(Failure::new("export::controller", says).help(
                "`axiscal controllers` lists those that are built in; [tables] in a file of your own says what it has",
            ));
        }
        let kind = match (described.tables.clone(), self.target) {
            (Some(_), Some(_)) => {
                return Err(Failure::new("export::options", "--target is for linuxcnc only")
                    .help("leave it away: the tables of this control do not depend on a version"));
            }
            (Some(tables), None) => Kind::Control(Box::new(tables)),
            (None, target) => Kind::LinuxCnc(Box::new(described.release(target)?.clone())),
        };
        let is_linuxcnc = matches!(kind, Kind::LinuxCnc(_));
        if is_linuxcnc && (self.backup.is_some() || self.unit == LengthUnit::Inch) {
            return Err(Failure::new("export::options", "--backup and --unit are not for linuxcnc").help(
                "its old values and its unit are in the INI file: --ini; the pins of a kinematics module: --old MODULE.PIN=VALUE",
            ));
        }
        if !is_linuxcnc && self.ini.is_some() {
            return Err(Failure::new("export::options", "--ini is for linuxcnc only")
                .help("give the control's own backup with --backup"));
        }
        if !(self.radius_mm.is_finite() && self.radius_mm > 0.0 && self.radius_mm <= 1e5) {
            return Err(Failure::new(
                "export::radius",
                format!("--radius {} mm is no radius of a workpiece", Plain(self.radius_mm)),
            )
            .help("write the distance from the rotary axis in mm, up to 100000"));
        }
        if let Some(date) = self.date.filter(|d| !is_date(d)) {
            return Err(Failure::new("export::date", format!("--date {date:?} is no date")).help("write YYYY-MM-DD"));
        }
        Ok(Form { name: described.name, kind })
    }
}

/// Which tables a controller has.
#[derive(Debug, Clone)]
pub struct Form {
    pub name: String,
    pub kind: Kind,
}

#[derive(Debug, Clone)]
pub enum Kind {
    /// As the postprocessor file describes them.
    Control(Box<Tables>),
    LinuxCnc(Box<Release>),
}

/// The tables, with what they leave and how wrong they could be.
#[derive(Debug)]
pub struct Exported<'a> {
    pub tables: Exports<'a>,
    /// What has no value of its own is in no table.
    pub not_told: Vec<Undetermined>,
    /// By how much each value could be wrong because of what the model lacks.
    pub could_be_wrong: Vec<Doubt>,
}

/// The tables of either kind.
#[derive(Debug)]
pub enum Exports<'a> {
    Control(Box<control::Export>, &'a Tables),
    LinuxCnc(Box<linuxcnc::Export>, &'a Release),
}

impl Exported<'_> {
    /// Name and contents of each file.
    #[must_use]
    pub fn files(&self) -> &[(String, Vec<u8>)] {
        match &self.tables {
            Exports::Control(export, _) => &export.files,
            Exports::LinuxCnc(export, _) => &export.files,
        }
    }
}

/// Exports a study. Nothing is written: what is in the folder is the caller's to judge.
///
/// # Errors
/// When the study cannot be fitted, the fit is not to be relied on, or a value is beyond the limits.
pub fn export<'a>(loaded: &Loaded, form: &'a Form, request: &Request, env: &dyn Environment) -> Result<Exported<'a>> {
    let fit = loaded.fit(&loaded.settings())?;
    let Judged { forced, doubts } = judged(loaded, &fit, request.force, env)?;
    let date = request.date.map_or_else(|| newest_log(loaded, env), str::to_owned);
    let (correction, remarks) =
        correction(loaded, &fit, &date, forced.into_iter().collect(), loaded.active(env)?.as_ref())?;
    env.remark(&remarks.0);
    let tables = match &form.kind {
        Kind::Control(tables) => {
            let export = control_tables(loaded, form, tables, &correction, request, env)?;
            Exports::Control(Box::new(export), tables)
        }
        Kind::LinuxCnc(release) => {
            let export = linuxcnc_tables(loaded, release, &correction, request, env)?;
            Exports::LinuxCnc(Box::new(export), release)
        }
    };
    Ok(Exported { tables, not_told: fit.outcome.undetermined, could_be_wrong: doubts })
}

fn control_tables(
    loaded: &Loaded,
    form: &Form,
    tables: &Tables,
    correction: &Correction,
    request: &Request,
    env: &dyn Environment,
) -> Result<control::Export> {
    if loaded.transformation().is_none() && (request.backup.is_some() || !request.old.is_empty()) {
        return Err(Failure::new(
            "export::two_frames",
            "what the control held acted on a part of the runs only: some programs of the study give axis positions, others not",
        )
        .help("put the programs of `generate --tcp` into one study and the others into another, or leave the old values away where they are those of the machine's description"));
    }
    let options = control::Options {
        radius_mm: request.radius_mm,
        force: request.force,
        accept_unverified: request.accept_unverified,
        unit: request.unit,
        old: old_values(&loaded.machine, tables, correction, request, env)?,
        ..control::Options::default()
    };
    let (export, findings) = control::export(&loaded.machine, &form.name, tables, correction, &options)?;
    env.remark(&findings.0);
    Ok(export)
}

fn linuxcnc_tables(
    loaded: &Loaded,
    release: &Release,
    correction: &Correction,
    request: &Request,
    env: &dyn Environment,
) -> Result<linuxcnc::Export> {
    let ini = match request.ini {
        Some(path) => Some(UserIni::read(&env.source(path)?)?),
        None => None,
    };
    let mm_per_unit = ini.as_ref().map_or(1.0, |i| i.mm_per_unit);
    let mut options = linuxcnc::Options {
        radius_mm: request.radius_mm,
        force: request.force,
        ini,
        release: Some(release.clone()),
        ..linuxcnc::Options::default()
    };
    if !request.old.is_empty() {
        options.old_pins = old_pins(&loaded.machine, options.release.as_ref(), mm_per_unit, request)?;
    }
    let (export, findings) = linuxcnc::export(&loaded.machine, correction, &options)?;
    env.remark(&findings.0);
    Ok(export)
}

/// What a compensation carries. `forced`: what speaks against it, where it is made all the same.
///
/// # Errors
/// When the fit did not converge.
pub(super) fn correction(
    loaded: &Loaded,
    fit: &Fit,
    data_date: &str,
    forced: Vec<String>,
    active: Option<&Compensation>,
) -> Result<(Correction, Findings)> {
    if !fit.outcome.converged {
        return Err(Failure::new(
            "export::not_converged",
            format!("the fit did not converge: {}", fit.outcome.stopped),
        )
        .help("`axiscal identify` shows it; check plan and log"));
    }
    let mut remarks = Findings::default();
    let on = loaded.transformation() == Some(true);
    if active.is_some_and(|a| on || a.idle_without_transformation(&loaded.machine) == 0) {
        remarks.push(Finding::info(
            "export::adds",
            "the identified errors are added to the compensation that was active during the measurement",
        ));
    }
    remarks.0.extend(fit.outcome.warnings.iter().map(|w| Finding::warning("export::fit", w.clone())));
    let holds: Vec<String> = crate::report::fit::held(&fit.outcome.parameters).collect();
    if !holds.is_empty() {
        let says = format!("{}: {}", crate::report::fit::HOLDS, holds.join("; "));
        let help = "where such an error is none of the machine (a stylus length that was entered wrongly, say), correct it and measure \
                    again before this is loaded";
        remarks.push(Finding::info("export::holds", says).help(help));
    }
    let provenance = Provenance {
        study: loaded.name(),
        study_sha256: loaded.sha256.clone(),
        data_date: data_date.to_owned(),
        forced,
    };
    let during = loaded.during(active);
    let (correction, findings) =
        Correction::collect(&loaded.machine, &loaded.catalogue, &fit.outcome, during, provenance)?;
    remarks.0.extend(findings.0);
    Ok((Correction { used: used(loaded), ..correction }, remarks))
}

/// From where to where the programs of the study move the rotary axes.
fn used(loaded: &Loaded) -> BTreeMap<AxisName, [f64; 2]> {
    let mut out: BTreeMap<AxisName, [f64; 2]> = BTreeMap::new();
    let poses = loaded.runs.iter().flat_map(|r| &r.plan.touches).map(|t| &t.pose);
    for (axis, at) in poses.flat_map(|pose| loaded.machine.rotary().filter_map(|a| Some((a.name, pose.get(a.name)?)))) {
        let range = out.entry(axis).or_insert([at, at]);
        *range = [range[0].min(at), range[1].max(at)];
    }
    out
}

/// The day on which the newest log was written: the data's own date, not that of the export.
pub(super) fn newest_log(loaded: &Loaded, env: &dyn Environment) -> String {
    let newest = loaded.study.data.iter().filter_map(|d| env.stamp(&loaded.folder().join(&d.log))?.1).max();
    newest.map_or_else(|| "unknown".to_owned(), |t| time::OffsetDateTime::from(t).date().to_string())
}

/// Is it a day of the calendar, YYYY-MM-DD?
fn is_date(text: &str) -> bool {
    let parts: Vec<&str> = text.split('-').collect();
    let [year, month, day] = parts[..] else { return false };
    if (year.len(), month.len(), day.len()) != (4, 2, 2) {
        return false;
    }
    let (Ok(year), Ok(month), Ok(day)) = (year.parse(), month.parse::<u8>(), day.parse()) else { return false };
    time::Month::try_from(month).is_ok_and(|m| time::Date::from_calendar_date(year, m, day).is_ok())
}
