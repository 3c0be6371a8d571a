//! `axiscal export`: the compensation as the controller's own tables.

use super::load::{Loaded, load_study};
use super::{Answer, Io};
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Result, Source, source};
use crate::diagnose::consequence::Consequence;
use crate::diagnose::{self, Diagnosis, Subject};
use crate::files;
use crate::fit::outcome::Undetermined;
use crate::fit::{Fit, Settings};
use crate::machine::Machine;
use crate::post::tables::{LengthUnit, Tables};
use crate::post::{Postprocessor, Release};
use crate::report::fit::{number, significant, table};
use crate::tables::compensation::{Compensation, Provenance};
use crate::tables::control::{self, backup, backup::Old};
use crate::tables::correction::{Correction, left_um};
use crate::tables::linuxcnc::{self, Export, Left, Options, ini::UserIni};
use crate::tables::place::{Meaning, meaning};
use crate::tables::rows::TableError;
use crate::units::Plain;
use comfy_table::Cell;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
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
    /// LinuxCNC: its version, 2.9 or master (default: `version` in [settings] of the postprocessor file)
    #[arg(long, value_name = "VERSION")]
    pub target: Option<String>,
    /// The control's own backup of the values that are to be changed: they are added to
    #[arg(long, value_name = "FILE", alias = "active")]
    pub backup: Option<PathBuf>,
    /// One old value of the control, in its unit (in place of a backup, or beside it). LinuxCNC: MODULE.PIN=VALUE
    #[arg(long, value_name = "NAME=VALUE")]
    pub old: Vec<String>,
    /// Unit of lengths in the control's tables
    #[arg(long, value_enum, default_value = "mm")]
    pub unit: LengthUnit,
    /// Write entries that nobody has verified on a control
    #[arg(long)]
    pub accept_unverified: bool,
    /// Date of the data, YYYY-MM-DD (default: of the newest log file)
    #[arg(long)]
    pub date: Option<String>,
}

/// Runs `export`.
///
/// # Errors
/// When the study is unusable, the controller has no tables, or a value is beyond the limits.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let (described, findings) = Postprocessor::load_built_in_or_file(&args.controller)?;
    io.report(&findings);
    if described.tables.is_none() && described.releases.is_empty() {
        let says = format!("controller {:?} has no [tables]: no tables are known for it", args.controller);
        return Err(Failure::new("export::controller", says).help(
            "`axiscal controllers` lists those that are built in; [tables] in a file of your own says what it has",
        ));
    }
    let post = described.tables.clone().map(|tables| (described.name.clone(), tables));
    let release = match (&post, &args.target) {
        (Some(_), Some(_)) => {
            return Err(Failure::new("export::options", "--target is for linuxcnc only")
                .help("leave it away: the tables of this control do not depend on a version"));
        }
        (Some(_), None) => None,
        (None, target) => Some(described.release(target.as_deref())?.clone()),
    };
    if post.is_none() && (args.backup.is_some() || args.unit == LengthUnit::Inch) {
        return Err(Failure::new("export::options", "--backup and --unit are not for linuxcnc").help(
            "its old values and its unit are in the INI file: --ini; the pins of a kinematics module: --old MODULE.PIN=VALUE",
        ));
    }
    if post.is_some() && args.ini.is_some() {
        return Err(Failure::new("export::options", "--ini is for linuxcnc only")
            .help("give the control's own backup with --backup"));
    }
    if !(args.radius.is_finite() && args.radius > 0.0 && args.radius <= 1e5) {
        return Err(Failure::new(
            "export::radius",
            format!("--radius {} mm is no radius of a workpiece", Plain(args.radius)),
        )
        .help("write the distance from the rotary axis in mm, up to 100000"));
    }
    if let Some(date) = args.date.as_ref().filter(|d| !is_date(d)) {
        return Err(Failure::new("export::date", format!("--date {date:?} is no date")).help("write YYYY-MM-DD"));
    }
    let loaded = load_study(&args.study, io)?;
    let settings = loaded.settings();
    let fit = loaded.fit(&settings)?;
    let active = loaded.active()?;
    let folder = files::Folder::open(&args.out)?;
    free_folder(&args.out, &folder, &loaded)?;
    let all_acts =
        |a: &Compensation| loaded.transformation() == Some(true) || a.idle_without_transformation(&loaded.machine) == 0;
    if active.as_ref().is_some_and(all_acts) {
        io.report(&[Finding::info(
            "export::adds",
            "the identified errors are added to the compensation that was active during the measurement",
        )]);
    }
    let date = match &args.date {
        Some(date) => date.clone(),
        None => newest_log(&loaded),
    };
    let Judged { forced, doubts } = judged(&loaded, &fit, &settings, args, io)?;
    let provenance = provenance(&loaded, date, forced.into_iter().collect());
    let correction = correction(&loaded, &fit, active.as_ref(), provenance, io)?;
    if let Some((name, tables)) = &post {
        let found = (&correction, &fit.outcome.undetermined[..], &doubts[..]);
        return control(&loaded, name, tables, found, folder, args, io);
    }
    let version = release.as_ref().map(|r| r.name.clone());
    let export = export(&loaded, &correction, release, args, io)?;
    folder.write(&described.name, &export.files)?;
    say(&export, args, io);
    say_not_told(&fit.outcome.undetermined, io);
    io.answer(&json!({
        "controller": args.controller,
        "version": version,
        "out": args.out.display().to_string(),
        "files": export.files.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "terms": export.component.compensation.terms,
        "left": export.component.left,
        "stock_left": export.stock.left,
        "table_errors": export.table_errors,
        "changes": export.changes,
        "could_be_wrong": doubts,
        "not_told": fit.outcome.undetermined,
        "radius_mm": args.radius,
    }));
    Ok(Answer::Done)
}

/// What the diagnosis says of an export.
#[derive(Debug, Default)]
struct Judged {
    /// What speaks against it, where it was forced all the same.
    forced: Option<String>,
    /// By how much each exported value could be wrong because of what is missing, the worst against its tolerance first.
    doubts: Vec<Doubt>,
}

/// By how much an exported value could be wrong.
#[derive(Debug, serde::Serialize)]
struct Doubt {
    #[serde(flatten)]
    what: Consequence,
    /// What that does at the tolerance's radius, um; none where the unit says nothing about that.
    off_um: Option<f64>,
    /// Its tolerance, in its unit.
    tolerance: f64,
}

impl Doubt {
    /// How often the tolerance goes into it.
    fn ratio(&self) -> f64 {
        self.what.off / self.tolerance
    }

    fn says(&self, radius_mm: f64) -> String {
        let Consequence { parameter, unit, off, because, .. } = &self.what;
        let size = match self.off_um {
            Some(um) => format!("{} µm at {} mm", significant(um), Plain(radius_mm)),
            None => format!("{} {unit}", significant(*off)),
        };
        // in the same unit, so that the two can be compared
        let limit = match self.off_um.filter(|_| self.ratio() > 0.0) {
            Some(um) => format!("{} µm", significant(um / self.ratio())),
            None => format!("{} {unit}", significant(self.tolerance)),
        };
        format!("{parameter} could be wrong by {size}; its tolerance is {limit} (cause: {because})")
    }
}

/// The values that go into tables, with how wrong they could be.
fn doubts(loaded: &Loaded, found: &Diagnosis) -> Vec<Doubt> {
    let tolerance = &loaded.study.tolerance;
    let is_exported = |c: &&Consequence| {
        let effect = loaded.catalogue.get(&c.effect, &loaded.machine);
        effect.is_some_and(|effect| {
            let index = effect.parameters.iter().position(|p| p.name == c.parameter);
            index.is_some_and(|i| meaning(effect, i, &loaded.machine) != Meaning::Measurement)
        })
    };
    let doubt = |c: &Consequence| {
        let tolerance_of = tolerance.limit(&c.parameter, &c.unit)?;
        let off_um = left_um(c.off, &c.unit, tolerance.radius_mm);
        Some(Doubt { what: c.clone(), off_um, tolerance: tolerance_of })
    };
    let mut out: Vec<Doubt> = found.consequences.iter().filter(is_exported).filter_map(doubt).collect();
    out.sort_by(|a, b| b.ratio().total_cmp(&a.ratio()));
    out
}

/// What a model lacks stands in part in its parameters. That is a remark where no exported value could be wrong by more than its
/// tolerance, and else refuses the export.
fn judged(loaded: &Loaded, fit: &Fit, settings: &Settings, args: &Args, io: &Io) -> Result<Judged> {
    let settings = Settings { quick: true, ..settings.clone() };
    let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit };
    let options = diagnose::Options { at_most: 1, refit: false, power: false, ..diagnose::Options::default() };
    let found = diagnose::diagnose(subject, &options)?;
    if !found.verdict.is_no() {
        return Ok(Judged::default());
    }
    let word = found.verdict.as_str();
    let doubts = doubts(loaded, &found);
    let named = found.candidates.first().filter(|_| found.verdict.is_missing_effect());
    let named = named.map_or_else(String::new, |c| format!(" ({})", c.effect));
    let radius_mm = loaded.study.tolerance.radius_mm;
    let refused = match (found.mistake(), doubts.first()) {
        (Some(mistake), _) => Some(mistake),
        (None, Some(worst)) if worst.ratio() > 1.0 => Some(worst.says(radius_mm)),
        (None, worst) => {
            let most = worst.map_or_else(|| "no exported value depends on it".to_owned(), |d| d.says(radius_mm));
            let says = format!("the diagnosis is {word}{named}; the largest consequence: {most}");
            let remark = if found.verdict.is_weak_pattern() {
                Finding::info("export::verdict", says)
            } else {
                Finding::warning("export::verdict", says)
            };
            io.report(&[remark.help("`axiscal diagnose` shows what is missing")]);
            None
        }
    };
    let Some(why) = refused else { return Ok(Judged { forced: None, doubts }) };
    let finding = Finding::error("export::verdict", format!("the diagnosis is {word}{named}: {why}"))
        .help("`axiscal diagnose` shows it, `axiscal add` puts an effect into the study; --force exports all the same");
    if args.force {
        let says = finding.message.clone();
        io.report(&[Finding { severity: crate::diag::Severity::Warning, help: None, ..finding }]);
        return Ok(Judged { forced: Some(says), doubts });
    }
    Err(finding.into())
}

fn provenance(loaded: &Loaded, data_date: String, forced: Vec<String>) -> Provenance {
    let study = loaded.path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    Provenance { study, study_sha256: loaded.sha256.clone(), data_date, forced }
}

fn correction(
    loaded: &Loaded,
    fit: &Fit,
    active: Option<&Compensation>,
    provenance: Provenance,
    io: &Io,
) -> Result<Correction> {
    if !fit.outcome.converged {
        return Err(Failure::new(
            "export::not_converged",
            format!("the fit did not converge: {}", fit.outcome.stopped),
        )
        .help("`axiscal identify` shows it; check plan and log"));
    }
    io.report(&fit.outcome.warnings.iter().map(|w| Finding::warning("export::fit", w.clone())).collect::<Vec<_>>());
    let holds: Vec<String> = crate::report::fit::held(&fit.outcome.parameters).collect();
    if !holds.is_empty() {
        let says = format!("{}: {}", crate::report::fit::HOLDS, holds.join("; "));
        let help = "where such an error is none of the machine (a stylus length that was entered wrongly, say), correct it and measure \
                    again before this is loaded";
        io.report(&[Finding::info("export::holds", says).help(help)]);
    }
    let (correction, findings) =
        Correction::collect(&loaded.machine, &loaded.catalogue, &fit.outcome, loaded.during(active), provenance)?;
    io.report(&findings.0);
    Ok(Correction { used: used(loaded), ..correction })
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

fn export(loaded: &Loaded, correction: &Correction, release: Option<Release>, args: &Args, io: &Io) -> Result<Export> {
    let ini = match &args.ini {
        Some(path) => Some(UserIni::read(&source(path.display().to_string(), files::read_text(path)?))?),
        None => None,
    };
    let mm_per_unit = ini.as_ref().map_or(1.0, |i| i.mm_per_unit);
    let mut options = Options { radius_mm: args.radius, force: args.force, ini, release, ..Options::default() };
    if !args.old.is_empty() {
        options.old_pins = old_pins(&loaded.machine, options.release.as_ref(), mm_per_unit, args)?;
    }
    let (export, findings) = linuxcnc::export(&loaded.machine, correction, &options)?;
    io.report(&findings.0);
    Ok(export)
}

/// Present pins of the stock kinematics module, by their names without the module's, mm.
fn old_pins(
    machine: &Machine,
    release: Option<&Release>,
    mm_per_unit: f64,
    args: &Args,
) -> Result<BTreeMap<String, f64>> {
    let module = release.and_then(|release| Some((linuxcnc::stock::module_of(machine, release).ok()?, release)));
    let Some((module, release)) = module else {
        return Err(Failure::new(
            "export::options",
            "--old is for the pins of a stock kinematics module, and none describes this machine",
        )
        .help(
            "leave it away: the component's pins are all written, the other old values are in the INI file (--ini)",
        ));
    };
    let numbers = release.pins.get(module.name).into_iter().flatten();
    let numbers = numbers.filter(|pin| release.direction_pin.as_ref() != Some(*pin));
    let names = numbers.map(|pin| format!("{}.{pin}", module.name)).collect();
    let mut old = Old::default();
    by_hand(&mut old, &names, args)?;
    for (value, _) in old.values.values_mut() {
        *value *= mm_per_unit;
    }
    backup::within_reach(&old, None, machine)?;
    let pin = |name: &str| name.rsplit_once('.').map_or(name, |(_, pin)| pin).to_owned();
    Ok(old.values.into_iter().map(|(name, (mm, _))| (pin(&name), mm)).collect())
}

/// Old values: the backup, and what was given by hand.
fn old_values(machine: &Machine, tables: &Tables, correction: &Correction, args: &Args, io: &Io) -> Result<Old> {
    let names = control::names(machine, tables);
    let mut old = match &args.backup {
        Some(path) => {
            let text = source(path.display().to_string(), read_backup(path)?);
            not_its_own(&text, correction)?;
            io.report(&written_by_an_export(&text, correction).into_iter().collect::<Vec<_>>());
            let such_as = control::example(machine, tables).unwrap_or_default();
            let old = backup::read_such_as(&text, &tables.backup, &names, &such_as)?;
            backup::within_reach(&old, Some(&text), machine)?;
            old
        }
        None => Old::default(),
    };
    by_hand(&mut old, &names, args)?;
    backup::within_reach(&old, None, machine)?;
    Ok(old)
}

/// What `--old` gives, checked against the names that there are.
fn by_hand(old: &mut Old, names: &BTreeSet<String>, args: &Args) -> Result<()> {
    for word in &args.old {
        let bad = |what: &str| {
            // a table has a thousand names: the nearest are those that may be meant
            let meant = word.split('=').next().unwrap_or_default();
            let shown = crate::simulate::scenario::nearest(meant, names.iter().cloned().collect());
            let more = if names.len() > shown.len() { " …" } else { "" };
            Failure::new("export::old", format!("--old {word:?}: {what}"))
                .help(format!("write NAME=VALUE with one of: {}{more}", shown.join(", ")))
        };
        let (name, value) = word.rsplit_once('=').ok_or_else(|| bad("there is no ="))?;
        let plain = backup::plain_name(name);
        let known =
            names.iter().find(|n| backup::plain_name(n) == plain).ok_or_else(|| bad("no such value is written"))?;
        let digits = value.trim().to_owned();
        let value: f64 = digits.parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| bad("that is no number"))?;
        if old.values.insert(known.clone(), (value, Some(args.unit))).is_some() {
            return Err(bad("it is given twice"));
        }
        old.assumed.remove(known);
        old.texts.insert(known.clone(), digits);
    }
    Ok(())
}

/// The file that this study's own export wrote holds the new values: what was identified would be added twice.
fn not_its_own(backup: &Source, correction: &Correction) -> Result<()> {
    let text = backup.inner().to_ascii_lowercase();
    let own = text.contains(&correction.provenance.study_sha256.to_ascii_lowercase());
    if !own || text.contains("restores") || correction.provenance.study_sha256.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        "export::own_backup",
        format!("{} was written by an export of this study: its values are the new ones", backup.name()),
    )
    .help("give the control's own backup from before, or the restoring file of that export"))
}

/// New values of another export that were loaded before these touches belong into the study as `compensation`; loaded after
/// them they hold what was identified already.
fn written_by_an_export(backup: &Source, correction: &Correction) -> Option<Finding> {
    let text = backup.inner();
    let new_values = text.contains("Study sha256:") && !text.to_ascii_lowercase().contains("restores");
    (new_values && correction.active.is_none() && correction.transformation).then(|| {
        Finding::warning(
            "export::written_before",
            format!("{} has the new values of an export, and the study names no compensation", backup.name()),
        )
        .help("if they were loaded when these touches were made, name that export as `compensation` in the study; if not, give what the control held then")
    })
}

/// A backup's text: controls write remarks in code pages of their own, and names and numbers in ASCII.
fn read_backup(path: &Path) -> Result<String> {
    let bytes = files::read_bytes(path)?;
    let single = std::str::from_utf8(&bytes).is_err() && !bytes.contains(&0);
    if single { Ok(bytes.iter().map(|b| char::from(*b)).collect()) } else { files::read_text(path) }
}

/// Tables of a control that is described by data.
fn control(
    loaded: &Loaded,
    name: &str,
    tables: &Tables,
    (correction, not_told, doubts): (&Correction, &[Undetermined], &[Doubt]),
    folder: files::Folder,
    args: &Args,
    io: &Io,
) -> Result<Answer> {
    let (machine, transformation) = (&loaded.machine, loaded.transformation());
    if transformation.is_none() && (args.backup.is_some() || !args.old.is_empty()) {
        return Err(Failure::new(
            "export::two_frames",
            "what the control held acted on a part of the runs only: some programs of the study give axis positions, others not",
        )
        .help("put the programs of `generate --tcp` into one study and the others into another, or leave the old values away where they are those of the machine's description"));
    }
    let options = control::Options {
        radius_mm: args.radius,
        force: args.force,
        accept_unverified: args.accept_unverified,
        unit: args.unit,
        old: old_values(machine, tables, correction, args, io)?,
        ..control::Options::default()
    };
    let (export, findings) = control::export(machine, name, tables, correction, &options)?;
    io.report(&findings.0);
    keep_restoring(machine, tables, &export.files, args)?;
    folder.write(name, &export.files)?;
    let mut t = table(&["value", "old", "new", "change", "unit"]);
    for v in &export.values {
        let show = |x: f64| number(control::digits(x, v.decimals, false));
        // what is taken from the machine's description is no value of the control
        let known = |x: f64| if v.known { show(x) } else { Cell::new("not known") };
        let spelling = tables.file.first().and_then(|f| f.spelling.as_ref());
        let shown = spelling.and_then(|s| v.names.get(s)).or(v.names.values().next()).cloned().unwrap_or_default();
        t.add_row(vec![Cell::new(shown), known(v.old), known(v.new), show(v.change()), Cell::new(v.unit)]);
    }
    crate::report::lay::lay(&mut t, io.paper(false).width, &[]);
    io.say(format!("{}\n{t}", tables.says));
    if let Some(record) = &export.compensation.tables {
        for grid in &record.grids {
            io.say(format!(
                "position table {}: {} by the position of {}, {} points from {} to {}",
                grid.number,
                grid.output,
                grid.input,
                grid.values.len(),
                grid.min,
                grid.max()
            ));
        }
    }
    say_left("which leaves", (&export.left, &export.table_errors), args, io);
    io.say(format!(
        "rounding to the control's resolution leaves up to {} µm; all constant errors that were identified together up to {} µm; a tool 100 mm longer or shorter is off by up to {} µm",
        significant(export.rounding_um), significant(export.rest_um), significant(export.longer_tool_um)
    ));
    say_not_told(not_told, io);
    io.say(format!(
        "{}: {} files; README.txt says how to load them and what must be set again",
        args.out.display(),
        export.files.len()
    ));
    io.answer(&json!({
        "controller": args.controller,
        "out": args.out.display().to_string(),
        "files": export.files.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "terms": export.compensation.terms,
        "values": export.values.iter().map(value_record).collect::<Vec<_>>(),
        "changes": export.changes,
        "could_be_wrong": doubts,
        "left": export.left,
        "not_told": not_told,
        "rounding_um": export.rounding_um,
        "rest_um": export.rest_um,
        "longer_tool_um": export.longer_tool_um,
        "table_errors": export.table_errors,
        "radius_mm": args.radius,
    }));
    Ok(Answer::Done)
}

/// A value as the JSON has it: without old and new where the control's present value is not known.
fn value_record(value: &control::fill::Value) -> serde_json::Value {
    let mut record = json!(value);
    if let Some(fields) = record.as_object_mut() {
        fields.insert("change".to_owned(), json!(value.change()));
        if !value.known {
            fields.insert("old".to_owned(), serde_json::Value::Null);
            fields.insert("new".to_owned(), serde_json::Value::Null);
        }
    }
    record
}

/// The restoring file of an earlier export may be all that is left of the control's old values: it is not written over by another.
fn keep_restoring(machine: &Machine, tables: &Tables, files: &[(String, Vec<u8>)], args: &Args) -> Result<()> {
    let names = control::names(machine, tables);
    // the head may be another one: day and study
    let values = |bytes: &[u8]| {
        let text = source("restoring", String::from_utf8_lossy(bytes).into_owned());
        backup::read(&text, &tables.backup, &names).ok().map(|old| old.values)
    };
    let restoring = tables.file.iter().filter_map(|f| f.restore.as_ref());
    for name in restoring.filter(|_| !args.force) {
        let path = args.out.join(name);
        let same = |old: &[u8]| {
            let new = files.iter().find(|(n, _)| n == name).map(|(_, new)| new.as_slice());
            new.is_some_and(|new| new == old || values(new).is_some_and(|v| Some(v) == values(old)))
        };
        if files::read_own(&path).is_ok_and(|old| !same(&old)) {
            return Err(Failure::new(
                "export::restoring",
                format!("{} of an earlier export holds other values than this one would write", path.display()),
            )
            .help("it brings back what the control held then: export into another folder, or --force keeps it as NAME.earlier-1"));
        }
    }
    Ok(())
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
fn free_folder(out: &Path, files: &files::Folder, loaded: &Loaded) -> Result<()> {
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
    if used && !files.was_written() {
        return Err(Failure::new(
            "export::folder",
            format!("{} is not empty and has no earlier export", out.display()),
        )
        .help("name an empty folder: an export is a set of files that belong together"));
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
    crate::report::lay::lay(&mut t, io.paper(false).width, &[]);
    io.say(format!("By the kinematics component:\n{t}"));
    say_left("which leaves", (&export.component.left, &export.table_errors), args, io);
    say_left("LinuxCNC without the component (stock/) leaves", (&export.stock.left, &export.table_errors), args, io);
    io.say(format!(
        "{}: {} files; README.txt says how to load them and what must be set again",
        args.out.display(),
        export.files.len()
    ));
}

/// What has no value of its own is in no table: "nothing is left" speaks of the rest.
fn say_not_told(not_told: &[Undetermined], io: &Io) {
    for u in not_told {
        io.say(format!("not corrected, because it cannot be determined: {}", u.says));
    }
}

fn say_left(what: &str, (left, tables): (&[Left], &[TableError]), args: &Args, io: &Io) {
    if left.is_empty() && tables.is_empty() {
        io.say(format!("{what}: nothing of what was identified"));
        return;
    }
    io.say(format!("{what}, at a radius of {} mm:", args.radius));
    for l in left {
        let size = l.size(significant);
        io.say(format!("  {:<6} {} {} leaves {size}: {}", l.parameter, significant(l.value), l.unit, l.why));
    }
    for table in tables {
        io.say(format!("  {}", table.says(significant)));
    }
}
