//! The tables of any control whose transformation knows rotary axes as lines: what they are is data (`[tables]` of its
//! postprocessor file), see `crate::post::tables`.
//!
//! What is known of the machine becomes lines ([`super::lines`]), the lines become the control's vectors and directions
//! ([`fill`]), on top of the user's own old values ([`backup`]), rounded to what it stores; errors that depend on a
//! position become position tables ([`grids`]). What the control has no place for is left, with the error that it leaves.

pub mod backup;
pub mod changes;
mod files;
pub mod fill;
pub mod grids;
mod left;
mod old;
mod replace;

use super::compensation::{Compensation, FORMAT, Mode, Tables as Record, Term, Vector};
use super::correction::{Correction, Limits, rounded};
use super::kins::Errors;
use super::lines::{self, Seen};
use super::linuxcnc::{Left, force, program};
use super::place::{Place, Spot, along, turns_about_itself};
use super::restate::{kept_in_words, stated_at};
use super::rows::TableError;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::{Axis, Machine, Side};
use crate::post::tables::{FileForm, Kind, LengthUnit, Tables, Turn, doubt};
use backup::Old;
use changes::{Change, Division, SHEET};
pub use files::digits;
use fill::{Filled, Question, Value};
use nalgebra::Vector3;
use replace::Replaced;
use std::collections::{BTreeMap, BTreeSet};

/// How to export.
#[derive(Debug, Clone)]
pub struct Options {
    /// Distance from the rotary axis at which what is left is stated, mm.
    pub radius_mm: f64,
    /// Above these an export is refused.
    pub limits: Limits,
    /// Export all the same.
    pub force: bool,
    /// Write entries that nobody has verified.
    pub accept_unverified: bool,
    /// Unit of lengths in the control's tables.
    pub unit: LengthUnit,
    /// Old values of the control.
    pub old: Old,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            radius_mm: 100.0,
            limits: Limits::default(),
            force: false,
            accept_unverified: false,
            unit: LengthUnit::Mm,
            old: Old::default(),
        }
    }
}

/// The files of an export, with what they carry.
#[derive(Debug, Clone)]
pub struct Export {
    /// Name and contents.
    pub files: Vec<(String, Vec<u8>)>,
    /// The record, as written to `compensation.json`.
    pub compensation: Compensation,
    /// The machine as the written numbers describe it, where the old ones were as its description has it.
    pub seen: Seen,
    /// What stays.
    pub left: Vec<Left>,
    /// The values, old and new.
    pub values: Vec<Value>,
    /// What is given as changes, because the control's present values are not known.
    pub changes: Vec<Change>,
    /// What rounding to the control's resolution leaves, µm.
    pub rounding_um: f64,
    /// What all that is known and not carried leaves together, rounding included, µm.
    pub rest_um: f64,
    /// A tool 100 mm longer or shorter than the stylus is off by so much, because the tool's own tilt is not held, µm.
    pub longer_tool_um: f64,
    /// What each position table leaves.
    pub table_errors: Vec<TableError>,
}

/// A value that every backup of such a machine holds, for messages; position tables are not always written.
#[must_use]
pub fn example(machine: &Machine, tables: &Tables) -> Option<String> {
    let kind = kind_of(machine, tables).ok()?;
    let mut vectors = kind.vector.iter().flat_map(|v| v.names.values().flatten());
    vectors.find(|n| !n.is_empty()).cloned()
}

/// Names of a control's values for a machine: what a backup is searched for.
#[must_use]
pub fn names(machine: &Machine, tables: &Tables) -> BTreeSet<String> {
    let Ok(kind) = kind_of(machine, tables) else { return BTreeSet::new() };
    let vectors = kind.vector.iter().flat_map(|v| v.names.values().flatten().cloned());
    let angles = kind.angle.iter().flat_map(|a| a.names.values().cloned());
    let points = tables.grid.iter().flat_map(crate::post::tables::GridForm::point_names);
    vectors.chain(angles).chain(points).filter(|n| !n.is_empty()).collect()
}

/// The control's kind for the machine.
///
/// # Errors
/// When its transformation does not know such a machine.
pub fn kind_of<'a>(machine: &Machine, tables: &'a Tables) -> Result<&'a Kind> {
    let count = |side: Side| machine.side(side).filter(|a| a.name.is_rotary()).count();
    let (workpiece, tool) = (count(Side::Workpiece), count(Side::Tool));
    let refuse = |why: String| {
        Failure::new(
            "tables::kind",
            format!("the tables of this control do not describe machine {:?}: {why}", machine.name),
        )
        .help("`axiscal controllers show` prints what its [tables] hold; another kind can be added there")
    };
    lines::fits(machine).map_err(refuse)?;
    let found = tables.kind.iter().find(|k| (k.workpiece, k.tool) == (workpiece, tool));
    let kind =
        found.ok_or_else(|| refuse(format!("it has {workpiece} rotary axes in the table and {tool} in the head")))?;
    let held = directions_of(machine, kind);
    let inclined = machine.rotary().find(|a| !held.contains(&a.name) && is_inclined(a));
    match inclined.filter(|_| !tables.inclined_axes) {
        Some(axis) => Err(refuse(format!(
            "axis {} is inclined, and the control takes it to be along {}",
            axis.name,
            ["X", "Y", "Z"][axis.name.index() % 3]
        ))),
        None => Ok(kind),
    }
}

/// Is a rotary axis not along the linear axis of its letter, as a control without directions assumes?
fn is_inclined(axis: &Axis) -> bool {
    (axis.direction[axis.name.index() % 3].abs() - 1.0).abs() > 1e-9
}

/// The axes whose directions a kind of table holds.
fn directions_of(machine: &Machine, kind: &Kind) -> BTreeSet<AxisName> {
    kind.vector.iter().filter_map(|v| axis_of(machine, v.direction?)).collect()
}

/// The machine's axis in a place of a kind.
fn axis_of(machine: &Machine, turn: Turn) -> Option<AxisName> {
    let (side, place) = turn.place();
    machine.side(side).filter(|a| a.name.is_rotary()).nth(place).map(|a| a.name)
}

/// Where a workpiece stands, mm in R: on the line of the table's last rotary axis, next to the ball at zero.
fn workpiece(machine: &Machine) -> Vector3<f64> {
    let ball = machine.reference.ball;
    match machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last() {
        Some(axis) => axis.point + axis.direction.into_inner() * axis.direction.dot(&(ball - axis.point)),
        None => ball,
    }
}

/// What the control can hold of the terms, where it holds them, and the rest with the reason.
struct Carried {
    /// Terms in lines.
    terms: Vec<Term>,
    /// Terms as zero positions.
    zero: Vec<Term>,
    /// Where `before` of workpiece-side axes is stated, mm in R.
    reference_mm: [f64; 3],
    /// Not held.
    not: Vec<(Term, String)>,
    /// Places that a tilt would move, from where the study does not know.
    kept: Vec<Spot>,
}

fn carried(machine: &Machine, correction: &Correction, kind: &Kind) -> Carried {
    let held = directions_of(machine, kind);
    let tilts = machine.rotary().all(|a| held.contains(&a.name));
    let angles: BTreeSet<AxisName> = kind.angle.iter().filter_map(|a| axis_of(machine, a.axis)).collect();
    let reference_mm = if tilts { correction.reference_mm } else { workpiece(machine).into() };
    // without directions an offset is right at one place only: that of the workpiece
    let (terms, kept) = stated_at(machine, correction, reference_mm);
    let last_work = machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last().map(|a| a.name);
    let mut out = Carried { terms: Vec::new(), zero: Vec::new(), reference_mm, not: Vec::new(), kept };
    for term in terms {
        let own = turns_about_itself(machine, term.spot());
        if own && angles.contains(&term.axis) {
            out.zero.push(term);
        } else if own && Some(term.axis) == last_work {
            let why = format!(
                "a turn of {} about itself turns the workpiece with it: set the work offset of {} again",
                term.axis, term.axis
            );
            out.not.push((term, why));
        } else if term.dof.is_angle() && !tilts {
            let why = if own {
                format!(
                    "the control's tables have no place for the zero position of {}: it belongs into the reference point of that axis",
                    term.axis
                )
            } else {
                "the control's tables hold places of rotary axes, no directions".to_owned()
            };
            out.not.push((term, why));
        } else {
            out.terms.push(term);
        }
    }
    out
}

fn with_active(terms: &[Term]) -> Vec<Term> {
    terms.iter().map(|t| Term { value: t.active_before, ..t.clone() }).collect()
}

/// How much further each axis shows than it stands, in its own count, by a value of the terms, deg.
fn zero_deg(machine: &Machine, terms: &[Term]) -> BTreeMap<AxisName, f64> {
    let mut out = BTreeMap::new();
    for term in terms {
        let Some(axis) = machine.axis(term.axis) else { continue };
        let sign = if term.place == Place::Zero { 1.0 } else { along(axis, term.dof).unwrap_or(1.0) };
        *out.entry(axis.name).or_insert(0.0) -= sign * axis.sense * term.value;
    }
    out
}

/// The tables of a control.
///
/// # Errors
/// When the control's tables do not describe the machine, a value is beyond the limits (and `force` is not set), an entry
/// is not verified (and `accept_unverified` is not set), or the old values do not belong to this machine.
pub fn export(
    machine: &Machine,
    controller: &str,
    tables: &Tables,
    correction: &Correction,
    options: &Options,
) -> Result<(Export, Findings)> {
    let mut findings = Findings::default();
    let kind = kind_of(machine, tables)?;
    findings.0.extend(correction.beyond(&options.limits));
    let active = correction.active.as_ref();
    if let Some(active) = active {
        match active.check_belongs(machine, controller) {
            Ok(more) => findings.0.extend(more.0),
            Err(failure) => findings.0.extend(failure.0),
        }
    }
    // what it wrote is what the control holds, where no backup says so
    let held = old::with_what_was_loaded(&options.old, active.and_then(|a| a.tables.as_ref()));
    let options = &Options { old: held, ..options.clone() };
    let carried = carried(machine, correction, kind);
    let length = machine.tool.length_mm;
    let seen = |terms: &[Term]| Seen::from_errors(machine, &Errors::from_terms(terms, carried.reference_mm), length);
    let (before, now) = (seen(&with_active(&carried.terms)), seen(&carried.terms));
    let spellings = old::spellings(tables);
    if !carried.kept.is_empty() {
        findings.push(Finding::info("tables::kept", kept_in_words(&carried.kept)));
    }
    let replaced =
        (!correction.transformation).then(|| Replaced::from_correction(machine, correction, &carried, length));
    let question = |spelling| Question {
        machine,
        tables,
        kind,
        before: &before,
        now: &now,
        replaced: replaced.as_ref(),
        old: &options.old,
        spelling,
        unit: options.unit,
        limits: options.limits,
    };
    let (mut filled, more) = question(spellings.first().copied()).fill();
    // what a loaded compensation wrote is off the description by what it holds
    findings.0.extend(more.0.into_iter().filter(|f| active.is_none() || f.code != "tables::old_did_not_act"));
    let zero = add_angles(machine, tables, kind, &carried, &options.old, &mut filled);
    // the same values in another table, on top of that one's own old ones
    let mut others: BTreeMap<&str, Filled> = BTreeMap::new();
    for spelling in spellings.iter().skip(1) {
        let (mut other, more) = question(Some(spelling)).fill();
        findings.0.extend(
            more.0
                .into_iter()
                .filter(|f| f.code != "tables::old_did_not_act" && !findings.0.iter().any(|g| g.message == f.message))
                .collect::<Vec<_>>(),
        );
        add_angles(machine, tables, kind, &carried, &options.old, &mut other);
        others.insert(spelling, other);
    }
    findings.0.extend(options.old.said.iter().map(|says| Finding::info("tables::old_chosen", says.clone())));
    findings.0.extend(old::between_tables(tables, &filled, &others, &options.old));
    let all = || std::iter::once(&filled).chain(others.values());
    if let Some(active) = active.and_then(|a| a.tables.as_ref()) {
        findings.0.extend(old::other_than_active(active, all(), options.unit));
    }
    let old_grids = active.and_then(|a| a.tables.as_ref()).map_or(&[][..], |t| &t.grids);
    let unit_step = *tables.step_mm.get_ref();
    let lengths = || all().flat_map(Filled::given_lengths);
    let old_unit = options.old.unit(lengths(), options.unit);
    if let (None, Some(one)) = (old_unit, options.old.converted(lengths(), options.unit)) {
        let ours = options.unit.says();
        let says = format!("the old lengths are in different units: {one}, others in {ours}");
        findings.push(Finding::warning("tables::old_units", says).help(format!(
            "they are converted, and all restored in {ours}: a control takes lengths in its own unit only, so is this backup one file of one control?"
        )));
    }
    if let Some(unit) = old_unit.filter(|u| *u != options.unit) {
        let [theirs, ours] = [unit, options.unit].map(LengthUnit::says);
        let says = format!("the old lengths are in {theirs}: they are converted, and restored in {theirs}");
        findings
            .push(Finding::info("tables::old_unit", says).help(format!("the new ones are in {ours}, as --unit says")));
    }
    let (mut grid_list, mut table_errors) = (None, Vec::new());
    if let Some(form) = &tables.grid {
        let steps = [unit_step, *tables.step_deg.get_ref()];
        match grids::grids(machine, correction, form, old_grids, steps, options.radius_mm) {
            Ok((found, leaves)) => (grid_list, table_errors) = (Some(found), leaves),
            Err(failure) => findings.0.extend(failure.0),
        }
    }
    findings.0.extend(table_errors.iter().flat_map(TableError::findings));
    if let (Some(form), Some(list)) = (&tables.grid, &grid_list) {
        findings.0.extend(grids::beyond(list, &options.limits));
        findings.0.extend(grids::occupied(form, list, old_grids, &options.old));
    }
    if options.unit == LengthUnit::Inch && grid_list.as_ref().is_some_and(|g| !g.is_empty()) {
        // a forced export leaves them out too: in the wrong unit they would be wrong
        (grid_list, table_errors) = (None, Vec::new());
        findings.push(
            Finding::error("tables::inch", "position tables are written for metric controls only")
                .help("leave the position-dependent effects out, or export with --unit mm"),
        );
    }
    let has_grids = grid_list.is_some();
    let grid_list = grid_list.unwrap_or_default();
    let mut noted = correction.clone();
    if options.force {
        force(&mut findings.0, &mut noted);
    }
    let division =
        Division::new(tables, (&filled, &others), &grid_list, active.and_then(|a| a.tables.as_ref()), &options.old);
    let unverified = say_unverified(tables, kind, &filled, (!grid_list.is_empty(), &division), options, &mut findings);
    let lacking = filled.lacking(&options.old, spellings.first().copied());
    let instead = format!("no file with values is written, {SHEET} says by how much each value changes");
    if division.values_known || filled.values.is_empty() {
        // a table that lacks its own is said above
    } else if !options.old.values.is_empty() && !lacking.is_empty() {
        let says = format!("the control's present values of {} are not known: {instead}", some_of(&lacking));
        findings.push(
            Finding::warning("tables::old_lacking", says)
                .help("give these too: in the backup, or each as --old \"NAME=VALUE\""),
        );
    } else if !options.old.assumed.is_empty() {
        let marked: Vec<&str> = options.old.assumed.iter().map(String::as_str).collect();
        let says = format!(
            "the backup marks old values as ASSUMED: {}; an earlier export took them from the machine's description: {instead}",
            marked.join(", ")
        );
        findings.push(
            Finding::warning("tables::old_assumed", says).help("give the control's own backup with --backup FILE"),
        );
    } else {
        let says = format!("the control's present values are not known: {instead}");
        findings.push(
            Finding::warning("tables::old_assumed", says)
                .help("give the control's own backup with --backup FILE, or each value with --old \"NAME=VALUE\""),
        );
    }
    if let (false, Some(form), Some(first)) = (division.grids_known, &tables.grid, grid_list.first()) {
        let says = "what the control's position tables hold is not known: no file with their points is written";
        let name = form.point_name(first.number, 0).unwrap_or_default();
        findings.push(Finding::warning("tables::old_grids", format!("{says}, {SHEET} says by how much each changes")).help(
            format!("give the control's own backup with --backup FILE; where the table is not in use, --old \"{name}=0\" is enough"),
        ));
    }
    if carried.terms.is_empty() && carried.zero.is_empty() && grid_list.is_empty() {
        findings.push(
            Finding::warning(
                "tables::nothing",
                "no parameter of status \"identified\" that a table of this control can hold",
            )
            .help("`axiscal identify` says what these touches cannot determine"),
        );
    }
    let ((), findings) = findings.finish(())?;
    let pieces = left::Pieces {
        machine,
        correction,
        carried: &carried,
        filled: &filled,
        zero: &zero,
        has_grids,
        radius_mm: options.radius_mm,
    };
    let left = pieces.left();
    let written: BTreeMap<String, f64> = std::iter::once((spellings.first().copied(), &filled))
        .chain(others.iter().map(|(s, f)| (Some(*s), f)))
        .filter(|(_, f)| f.known())
        .flat_map(|(spelling, f)| f.entries().filter_map(move |v| Some((v.name(spelling)?.clone(), v.new))))
        .collect();
    let is_written = |f: &&FileForm| division.files.contains(&f.name);
    // of several files with the same values one is loaded
    let main = tables.file.iter().filter(is_written).any(|f| !f.grids && !f.variant);
    let loaded = tables.file.iter().filter(is_written).filter(|f| !f.variant || !main);
    let (rounding_um, rest_um, longer_tool_um) = pieces.figures(&now);
    let mut terms = carried.terms.clone();
    terms.extend(carried.zero.iter().cloned());
    terms.sort_by_key(Term::spot);
    let ball = machine.reference.ball;
    let shift = (crate::geometry::apply(&now.workpiece_off, &ball) - ball).map(rounded);
    let record = Record {
        kind: kind.name.clone(),
        unit: options.unit,
        // a part of the files says nothing of the rest
        reads: tables.reads.clone().filter(|_| division.complete()),
        files: loaded.map(|f| f.name.clone()).collect(),
        vectors: filled
            .vectors
            .iter()
            .filter(|(form, _)| !form.instead)
            .map(|(form, value)| Vector {
                id: form.id.clone(),
                between: form.from.zip(form.to).map(|(a, b)| [a, b]),
                direction: form.direction,
                against: form.reversed && form.direction.is_some_and(|t| t.place().0 == Side::Workpiece),
                value: value.map(rounded).into(),
            })
            .collect(),
        values: written,
        changes: division.by_name(),
        zero_deg: zero,
        grids: grid_list,
        workpiece_shift_mm: shift.into(),
        unverified,
    };
    let compensation = Compensation {
        format: FORMAT.to_owned(),
        controller: controller.to_owned(),
        machine: machine.name.clone(),
        machine_sha256: machine.sha256.clone(),
        mode: Mode::Table,
        component: None,
        reference_mm: carried.reference_mm,
        terms,
        stock: None,
        tables: Some(record),
        table_errors: table_errors.clone(),
        program: program(),
        provenance: noted.provenance.clone(),
    };
    let mut export = Export {
        files: Vec::new(),
        compensation,
        seen: filled.seen.clone(),
        left,
        values: filled.values.clone(),
        changes: division.changes().cloned().collect(),
        rounding_um,
        rest_um,
        longer_tool_um,
        table_errors,
    };
    let tables_of = (&filled, &others, &division);
    files::write(machine, tables, kind, &noted, options, tables_of, &mut export)?;
    Ok((export, findings))
}

/// Zero positions of rotary axes; gives what the control is to hold beyond its old values, deg by axis.
fn add_angles(
    machine: &Machine,
    tables: &Tables,
    kind: &Kind,
    carried: &Carried,
    old: &Old,
    filled: &mut Filled,
) -> BTreeMap<AxisName, f64> {
    let (now, before) = (zero_deg(machine, &carried.zero), zero_deg(machine, &with_active(&carried.zero)));
    let step = *tables.step_deg.get_ref();
    let mut out = BTreeMap::new();
    for form in &kind.angle {
        let (side, place) = form.axis.place();
        let Some(axis) = machine.side(side).filter(|a| a.name.is_rotary()).nth(place) else { continue };
        let (now, before) = (now.get(&axis.name).copied(), before.get(&axis.name).copied().unwrap_or(0.0));
        let Some(now) = now else { continue };
        let given_name = form.names.values().find(|n| old.values.contains_key(*n));
        let given = given_name.and_then(|n| old.values.get(n)).map(|(v, _)| *v);
        let was = given.unwrap_or(before);
        let new = rounded(((was + now - before) / step).round() * step);
        out.insert(axis.name, rounded(new - was + before));
        filled.values.push(Value {
            id: form.id.clone(),
            says: form.says.clone(),
            names: form.names.clone(),
            old: rounded(was),
            new,
            unit: "deg",
            decimals: fill::decimals(step),
            known: given_name.is_some_and(|n| !old.assumed.contains(n)),
            given: given_name.cloned(),
            elsewhere: false,
            instead: false,
            unverified: doubt(form.source.as_ref(), form.unverified.as_ref()),
        });
    }
    out
}

/// Entries of the tables for a machine that were not run on a real control: what `--accept-unverified` accepts.
#[must_use]
pub fn not_run(machine: &Machine, tables: &Tables, position_tables: bool) -> Vec<String> {
    let Ok(kind) = kind_of(machine, tables) else { return Vec::new() };
    let mut out = Vec::new();
    let mut add = |what: String, source: &Option<String>, unverified: &Option<String>| {
        if doubt(source.as_ref(), unverified.as_ref()).is_some() {
            out.push(what);
        }
    };
    add("the tables".to_owned(), &tables.source, &tables.unverified);
    add(kind_says(kind), &kind.source, &kind.unverified);
    kind.vector.iter().for_each(|v| add(v.says.clone(), &v.source, &v.unverified));
    kind.angle.iter().for_each(|a| add(a.says.clone(), &a.source, &a.unverified));
    if let Some(grid) = tables.grid.as_ref().filter(|_| position_tables) {
        add("position tables".to_owned(), &grid.source, &grid.unverified);
    }
    tables
        .file
        .iter()
        .filter(|f| position_tables || !f.grids)
        .for_each(|f| add(format!("file {}", f.name), &f.source, &f.unverified));
    out
}

/// The key of the machine's kind in the list of what is not verified.
fn kind_id(kind: &Kind) -> String {
    format!("kind {}", kind.name)
}

fn kind_says(kind: &Kind) -> String {
    format!("entries for the kind \"{}\"", kind.name)
}

/// What an entry is, in words: its id is a key of the postprocessor's file.
fn entry_says(kind: &Kind, id: &str) -> String {
    if id == kind_id(kind) {
        return kind_says(kind);
    }
    let vectors = kind.vector.iter().map(|v| (&v.id, &v.says));
    let mut all = vectors.chain(kind.angle.iter().map(|a| (&a.id, &a.says)));
    all.find(|(known, _)| *known == id).map_or_else(|| id.to_owned(), |(_, says)| says.clone())
}

/// Entries that are not verified, and why: refused, or reported.
fn say_unverified(
    tables: &Tables,
    kind: &Kind,
    filled: &Filled,
    (grids, division): (bool, &Division),
    options: &Options,
    findings: &mut Findings,
) -> BTreeMap<String, String> {
    let mut doubts: Vec<(String, String)> = Vec::new();
    let mut add = |what: String, why: Option<String>| {
        if let Some(why) = why {
            doubts.push((what, why));
        }
    };
    add("the tables".to_owned(), doubt(tables.source.as_ref(), tables.unverified.as_ref()));
    add(kind_id(kind), doubt(kind.source.as_ref(), kind.unverified.as_ref()));
    let mut seen = BTreeSet::new();
    for value in &filled.values {
        let id = value.id.split('.').next().unwrap_or_default().to_owned();
        if seen.insert(id.clone()) {
            add(id, value.unverified.clone());
        }
    }
    if grids && let Some(form) = &tables.grid {
        add("position tables".to_owned(), doubt(form.source.as_ref(), form.unverified.as_ref()));
    }
    for file in tables.file.iter().filter(|f| division.files.contains(&f.name)) {
        add(format!("file {}", file.name), doubt(file.source.as_ref(), file.unverified.as_ref()));
    }
    for (what, why) in &doubts {
        let message = format!("{}: not verified: {why}", entry_says(kind, what));
        findings.push(if options.accept_unverified {
            Finding::warning("tables::unverified", message)
                .help("compare it with the control's manual and its own backup before you load it")
        } else {
            Finding::error("tables::unverified", message)
                .help("compare it with the control's manual and backup; --accept-unverified writes it all the same")
        });
    }
    doubts.into_iter().collect()
}

/// The first of some names; a person who needs the rest finds it in the sheet.
fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let rest = names.len().saturating_sub(SHOWN);
    let shown = names[..names.len() - rest].join(", ");
    if rest > 0 { format!("{shown} and {rest} more") } else { shown }
}
