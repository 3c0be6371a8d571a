//! `axiscal export`: the compensation as the controller's own tables.

use super::{Answer, Io};
use crate::diag::{Failure, Result, source};
use crate::files;
use crate::fit::outcome::Undetermined;
use crate::machine::Machine;
use crate::post::tables::{LengthUnit, Tables};
use crate::report::fit::{number, significant, table};
use crate::tables::control::{self, backup};
use crate::tables::linuxcnc::{self, Left};
use crate::tables::rows::TableError;
use crate::workflow::export::{Exported, Exports, Request, export};
use crate::workflow::{Loaded, load_study};
use comfy_table::Cell;
use serde_json::json;
use std::path::{Path, PathBuf};

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

/// # Errors
/// When the study is unusable, the controller has no tables, or a value is beyond the limits.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let request = Request {
        controller: &args.controller,
        target: args.target.as_deref(),
        radius_mm: args.radius,
        force: args.force,
        accept_unverified: args.accept_unverified,
        unit: args.unit,
        ini: args.ini.as_deref(),
        backup: args.backup.as_deref(),
        old: &args.old,
        date: args.date.as_deref(),
    };
    let form = request.form(io)?;
    let loaded = load_study(&args.study, io)?;
    let folder = files::Folder::open(&args.out)?;
    free_folder(&args.out, &folder, &loaded)?;
    let exported = export(&loaded, &form, &request, io)?;
    if let Exports::Control(_, tables) = exported.tables {
        keep_restoring(&loaded.machine, tables, exported.files(), args)?;
    }
    folder.write(&form.name, exported.files())?;
    match &exported.tables {
        Exports::Control(export, tables) => say_control(export, tables, &exported, args, io),
        Exports::LinuxCnc(export, release) => say_linuxcnc(export, &release.name, &exported, args, io),
    }
    Ok(Answer::Done)
}

/// Tables of a control that is described by data.
fn say_control(export: &control::Export, tables: &Tables, exported: &Exported, args: &Args, io: &Io) {
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
    say_not_told(&exported.not_told, io);
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
        "could_be_wrong": exported.could_be_wrong,
        "left": export.left,
        "not_told": exported.not_told,
        "rounding_um": export.rounding_um,
        "rest_um": export.rest_um,
        "longer_tool_um": export.longer_tool_um,
        "table_errors": export.table_errors,
        "radius_mm": args.radius,
    }));
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

fn say_linuxcnc(export: &linuxcnc::Export, version: &str, exported: &Exported, args: &Args, io: &Io) {
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
    say_not_told(&exported.not_told, io);
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
        "could_be_wrong": exported.could_be_wrong,
        "not_told": exported.not_told,
        "radius_mm": args.radius,
    }));
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
