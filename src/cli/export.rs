//! `axiscal export`: the compensation as the controller's own tables.

use super::load::{Loaded, load_study};
use super::{Answer, Io};
use crate::diag::{Failure, Finding, Result, source};
use crate::files;
use crate::fit::{self, Fit};
use crate::report::fit::{number, significant, table};
use crate::tables::compensation::{Compensation, Provenance};
use crate::tables::correction::Correction;
use crate::tables::linuxcnc::{self, Export, Left, Options, ini::UserIni};
use comfy_table::Cell;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `export`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// The controller
    #[arg(long)]
    pub controller: String,
    /// The folder to write to
    #[arg(long)]
    pub out: PathBuf,
    /// Radius at which what a table cannot carry is stated, mm
    #[arg(long, default_value_t = 100.0)]
    pub radius: f64,
    /// Export values beyond the limits all the same
    #[arg(long)]
    pub force: bool,
    /// LinuxCNC: the machine's INI file, for its old values
    #[arg(long, value_name = "FILE")]
    pub ini: Option<PathBuf>,
    /// Date of the data, YYYY-MM-DD (default: of the newest log file)
    #[arg(long)]
    pub date: Option<String>,
}

/// Runs `export`.
///
/// # Errors
/// When the study is unusable, the controller has no tables, or a value is beyond the limits.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    if args.controller != linuxcnc::CONTROLLER {
        return Err(Failure::new(
            "export::controller",
            format!("no tables are known for controller {:?}", args.controller),
        )
        .help("there is: linuxcnc"));
    }
    if !(args.radius.is_finite() && args.radius > 0.0 && args.radius <= 1e5) {
        return Err(Failure::new(
            "export::radius",
            format!("--radius {:e} mm is no radius of a workpiece", args.radius),
        )
        .help("write the distance from the rotary axis in mm, up to 100000"));
    }
    if let Some(date) = args.date.as_ref().filter(|d| !is_date(d)) {
        return Err(Failure::new("export::date", format!("--date {date:?} is no date")).help("write YYYY-MM-DD"));
    }
    let loaded = load_study(&args.study, io)?;
    let settings = loaded.settings();
    let fit = fit::identify(&loaded.machine, &loaded.catalogue, &loaded.runs(), &settings)?;
    let active = loaded.active()?;
    free_folder(&args.out, &loaded)?;
    if active.is_some() {
        io.report(&[Finding::info(
            "export::adds",
            "the identified errors are added to the compensation that was active during the measurement",
        )]);
    }
    let date = match &args.date {
        Some(date) => date.clone(),
        None => newest_log(&loaded),
    };
    let export = export(&loaded, &fit, active.as_ref(), args, date, io)?;
    for (name, contents) in &export.files {
        files::write_whole(&args.out.join(name), contents)?;
    }
    remove_stale(&args.out, &export)?;
    say(&export, args, io);
    io.answer(&json!({
        "controller": args.controller,
        "out": args.out.display().to_string(),
        "files": export.files.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "terms": export.component.compensation.terms,
        "left": export.component.left,
        "stock_left": export.stock.left,
        "radius_mm": args.radius,
    }));
    Ok(Answer::Done)
}

fn export(
    loaded: &Loaded,
    fit: &Fit,
    active: Option<&Compensation>,
    args: &Args,
    date: String,
    io: &Io,
) -> Result<Export> {
    if !fit.outcome.converged {
        return Err(Failure::new(
            "export::not_converged",
            format!("the fit did not converge: {}", fit.outcome.stopped),
        )
        .help("`axiscal identify` shows it; check plan and log"));
    }
    io.report(&fit.outcome.warnings.iter().map(|w| Finding::warning("export::fit", w.clone())).collect::<Vec<_>>());
    let study = loaded.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let provenance = Provenance { study, study_sha256: loaded.sha256.clone(), data_date: date };
    let (correction, findings) =
        Correction::collect(&loaded.machine, &loaded.catalogue, &fit.outcome, active, provenance)?;
    io.report(&findings.0);
    let ini = match &args.ini {
        Some(path) => Some(UserIni::read(&source(path.display().to_string(), files::read_text(path)?))?),
        None => None,
    };
    let options = Options { radius_mm: args.radius, force: args.force, ini, ..Options::default() };
    let (export, findings) = linuxcnc::export(&loaded.machine, &correction, &options)?;
    io.report(&findings.0);
    Ok(export)
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

/// An export must not overwrite what was active during its own measurement (the next one would add to the wrong values),
/// nor fill a folder that holds something else.
fn free_folder(out: &Path, loaded: &Loaded) -> Result<()> {
    let same = |a: &Path, b: &Path| matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for active in loaded.runs.iter().filter_map(|r| r.compensation.as_deref()) {
        let folder = if active.is_dir() { active } else { active.parent().unwrap_or(active) };
        if same(folder, out) || out.parent().is_some_and(|above| same(folder, above)) && out.ends_with("stock") {
            return Err(Failure::new(
                "export::active",
                format!("{} is the compensation that was active during the measurement", out.display()),
            )
            .help("write to another folder: the identified errors add to what was active, and its file must stay as it was"));
        }
    }
    let used = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if used && !out.join("compensation.json").is_file() {
        return Err(Failure::new(
            "export::folder",
            format!("{} is not empty and holds no earlier export", out.display()),
        )
        .help("name an empty folder: an export is a set of files that belong together"));
    }
    Ok(())
}

/// Files of an earlier export that this one does not have: loaded by mistake they would be a wrong compensation.
fn remove_stale(out: &Path, export: &Export) -> Result<()> {
    for folder in ["", "stock"] {
        let Ok(entries) = std::fs::read_dir(out.join(folder)) else { continue };
        for entry in entries.flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let relative = if folder.is_empty() { name.clone() } else { format!("{folder}/{name}") };
            let ours = name.starts_with("axiscal") || name.starts_with("restore.") || name == "tool_table.ngc";
            let is_file = entry.file_type().is_ok_and(|t| t.is_file());
            if ours && is_file && !export.files.iter().any(|(n, _)| *n == relative) {
                std::fs::remove_file(entry.path()).map_err(|e| {
                    Failure::new(
                        "export::stale",
                        format!("cannot remove {} of an earlier export: {e}", entry.path().display()),
                    )
                    .help("remove it by hand: it does not belong to this compensation")
                })?;
            }
        }
    }
    Ok(())
}

/// The day on which the newest log was written: the data's own date, not that of the export.
#[must_use]
pub fn newest_log(loaded: &Loaded) -> String {
    let folder = loaded.path.parent().map(Path::to_path_buf).unwrap_or_default();
    let newest =
        loaded.study.data.iter().filter_map(|d| std::fs::metadata(folder.join(&d.log)).ok()?.modified().ok()).max();
    newest.map_or_else(|| "unknown".to_owned(), |t| time::OffsetDateTime::from(t).date().to_string())
}

fn say(export: &Export, args: &Args, io: &Io) {
    let mut t = table(&["carried", "place", "before", "identified", "now", "unit"]);
    for term in &export.component.compensation.terms {
        t.add_row(vec![
            Cell::new(&term.parameter),
            Cell::new(format!("{} {} {}", term.axis, term.place, term.dof)),
            number(format!("{:.6}", term.active_before)),
            number(format!("{:+.6}", term.identified)),
            number(format!("{:.6}", term.value)),
            Cell::new(&term.unit),
        ]);
    }
    io.say(format!("By the kinematics component:\n{t}"));
    say_left("which leaves", &export.component.left, args, io);
    say_left("LinuxCNC without the component (stock/) leaves", &export.stock.left, args, io);
    io.say(format!(
        "{}: {} files; README.txt says how to load them and what must be set again",
        args.out.display(),
        export.files.len()
    ));
}

fn say_left(what: &str, left: &[Left], args: &Args, io: &Io) {
    if left.is_empty() {
        io.say(format!("{what}: nothing of what was identified"));
        return;
    }
    io.say(format!("{what}, at a radius of {} mm:", args.radius));
    for l in left {
        let size = l.left_um.map_or_else(|| "an error of unknown size".into(), |um| format!("{} um", significant(um)));
        io.say(format!("  {:<6} {} {} leaves {size}: {}", l.parameter, significant(l.value), l.unit, l.why));
    }
}
