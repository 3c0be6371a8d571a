//! The tables of any control whose transformation knows rotary axes as lines: what they are is data (`[tables]` of its
//! postprocessor file), see `crate::post::tables`.
//!
//! What is known of the machine becomes lines ([`super::lines`]), the lines become the control's vectors and directions
//! ([`fill`]), on top of the user's own old values ([`backup`]), rounded to what it stores; errors that depend on a
//! position become position tables ([`grids`]). What the control has no place for is left, with the error that it leaves.

pub mod backup;
mod carried;
pub mod changes;
mod files;
pub mod fill;
pub mod grids;
mod left;
mod old;
mod replace;
mod unverified;

use super::compensation::{Compensation, FORMAT, Mode, Tables as Record, Term, Vector};
use super::correction::{Correction, Limits, rounded};
use super::kins::Errors;
use super::lines::{self, Seen};
use super::linuxcnc::{Left, force, program};
use super::restate::kept_in_words;
use super::rows::TableError;
use crate::axes::AxisName;
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::{Axis, Machine, Side};
use crate::post::tables::{FileForm, Kind, LengthUnit, Tables, Turn};
use backup::Old;
use carried::{Carried, add_angles, carried, with_active};
use changes::{Change, Division, SHEET};
pub use files::digits;
use fill::{Filled, Question, Value};
use left::Figures;
use nalgebra::Vector3;
use replace::Replaced;
use std::collections::{BTreeMap, BTreeSet};
pub use unverified::not_run;
use unverified::say_unverified;

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

/// More than this is no rounding, µm.
const WORSE_UM: f64 = 1.0;

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
    let active = correction.active.as_ref();
    findings.0.extend(carried::beside_the_ball(machine, correction).beyond(&options.limits));
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
    let in_lines = carried.in_lines();
    let (before, now) = (seen(&with_active(&in_lines)), seen(&in_lines));
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
    let instead = match division.changes().next() {
        Some(_) => format!("no file with values is written, {SHEET} says by how much each value changes"),
        None => "no file is written, because no value changes".to_owned(),
    };
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
    if in_lines.is_empty() && carried.zero.is_empty() && grid_list.is_empty() {
        findings.push(
            Finding::warning(
                "tables::nothing",
                "no parameter of status \"identified\" that a table of this control can hold",
            )
            .help("`axiscal identify` says what these touches cannot determine"),
        );
    }
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
    let Figures { rounding_um, rest_um, longer_tool_um, without_um } = pieces.figures(&before, &now);
    if rest_um > without_um + rounding_um + WORSE_UM {
        let says = format!("the new values leave up to {rest_um:.0} µm, the present ones {without_um:.0} µm");
        let help = "do not load them: the control has no place for a part of what was found, and the other part alone is worse";
        let mut worse = [Finding::error("tables::worse", says).help(help)];
        if options.force {
            force(&mut worse, &mut noted);
        }
        findings.0.extend(worse);
    }
    let ((), findings) = findings.finish(())?;
    let written: BTreeMap<String, f64> = std::iter::once((spellings.first().copied(), &filled))
        .chain(others.iter().map(|(s, f)| (Some(*s), f)))
        .filter(|(_, f)| f.known())
        .flat_map(|(spelling, f)| f.entries().filter_map(move |v| Some((v.name(spelling)?.clone(), v.new))))
        .collect();
    let is_written = |f: &&FileForm| division.files.contains(&f.name);
    // of several files with the same values one is loaded
    let main = tables.file.iter().filter(is_written).any(|f| !f.grids && !f.variant);
    let loaded = tables.file.iter().filter(is_written).filter(|f| !f.variant || !main);
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
        of_turns: carried.of_turns.clone(),
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

/// The first of some names; a person who needs the rest finds it in the sheet.
fn some_of(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let rest = names.len().saturating_sub(SHOWN);
    let shown = names[..names.len() - rest].join(", ");
    if rest > 0 { format!("{shown} and {rest} more") } else { shown }
}
