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
    let loaded = load_study(&args.study, io)?;
    let settings = loaded.settings();
    let fit = fit::identify(&loaded.machine, &loaded.catalogue, &loaded.runs(), &settings)?;
    let active = active(&loaded, io)?;
    let date = match &args.date {
        Some(date) => date.clone(),
        None => newest_log(&loaded),
    };
    let export = export(&loaded, &fit, active.as_ref(), args, date, io)?;
    for (name, contents) in &export.files {
        files::write_whole(&args.out.join(name), contents)?;
    }
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

/// What the control applied while the touches were made: the same for all runs, or the sum has no meaning.
fn active(loaded: &Loaded, io: &Io) -> Result<Option<Compensation>> {
    let mut found: Option<(Option<&Path>, Option<Compensation>)> = None;
    for run in &loaded.runs {
        let here = match &run.compensation {
            Some(path) => {
                let file = if path.is_dir() { path.join("compensation.json") } else { path.clone() };
                Some(Compensation::read(&source(file.display().to_string(), files::read_text(&file)?))?)
            }
            None => None,
        };
        match &found {
            Some((_, first)) if *first != here => {
                return Err(Failure::new(
                    "export::two_compensations",
                    "the runs of the study were measured under different compensations",
                )
                .help("the identified errors add to what was active: put runs under one compensation into one study"));
            }
            Some(_) => {}
            None => found = Some((run.compensation.as_deref(), here)),
        }
    }
    let active = found.and_then(|(_, c)| c);
    if active.is_some() {
        io.report(&[Finding::info(
            "export::adds",
            "the identified errors are added to the compensation that was active during the measurement",
        )]);
    }
    Ok(active)
}

/// The day on which the newest log was written: the data's own date, not that of the export.
fn newest_log(loaded: &Loaded) -> String {
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
