//! The files of an export: the control's own through its templates, and what a person reads.

use super::backup::Old;
use super::changes::{Division, SHEET};
use super::fill::{Filled, Value as Entry};
use super::{Export, Options};
use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::post::tables::{FileForm, Kind, LengthUnit, Tables, compile};
use crate::tables::compensation::Grid;
use crate::tables::correction::Correction;
use crate::tables::linuxcnc::{head, one_line, render};
use crate::units::{Plain, inch_from_mm, mm_from_inch};
use minijinja::{Value, context};
use nalgebra::Vector3;
use std::collections::BTreeMap;

const CHANGES: &str = include_str!("../templates/control/changes.txt.j2");
const README: &str = include_str!("../templates/control/readme.txt.j2");

/// A number with so many digits; a minus before zero is none.
#[must_use]
pub fn digits(value: f64, decimals: usize, always_mark: bool) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.trim_start_matches(['-', '0', '.']).is_empty() {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    };
    if always_mark && !text.contains('.') { text + "." } else { text }
}

fn entry(
    value: &Entry,
    spelling: Option<&str>,
    restore: bool,
    unit: LengthUnit,
    tables: &Tables,
    old: &Old,
) -> Option<Value> {
    let name = value.name(spelling)?.clone();
    // what is restored is restored in the unit in which it was given
    let (factor, decimals, shown_unit) = match (value.unit, unit) {
        ("mm", LengthUnit::Inch) => (inch_from_mm(1.0), super::fill::decimals(*tables.step_inch.get_ref()), "inch"),
        ("inch", LengthUnit::Mm) => (mm_from_inch(1.0), super::fill::decimals(*tables.step_mm.get_ref()), "mm"),
        _ => (1.0, value.decimals, value.unit),
    };
    let show = |v: f64| digits(v * factor, decimals, tables.always_mark);
    let given = value.given.as_ref();
    let is_length = matches!(value.unit, "mm" | "inch");
    let same_unit = |n: &&String| {
        !is_length || old.values.get(*n).is_some_and(|(_, u)| u.map_or(value.unit, LengthUnit::says) == unit.says())
    };
    let old_text = match given.filter(same_unit).and_then(|n| old.texts.get(n)) {
        Some(text) => text.clone(),
        // units are mixed: nothing of what was given is lost in a digit that is cut off
        None if is_length && given.is_some_and(|n| old.texts.contains_key(n)) => {
            digits(value.old * factor, decimals + 3, tables.always_mark)
        }
        None => show(value.old),
    };
    let (now, other) = if restore { (old_text.clone(), show(value.new)) } else { (show(value.new), old_text.clone()) };
    // from what the control then holds to what this file brings
    let change = if restore { value.old - value.new } else { value.new - value.old };
    let change = digits(change * factor, decimals, false);
    Some(context! {
        id => value.id.clone(), name, value => now, other, old => old_text, new => show(value.new),
        change, says => one_line(&value.says), unit => shown_unit, changed => value.new != value.old,
        known => value.known, instead => value.instead,
    })
}

fn grid(machine: &Machine, tables: &Tables, grid: &Grid, restore: Option<&Grid>) -> Value {
    let name = |axis| {
        let number =
            machine.axes.iter().map(|a| a.name.index()).filter(|i| *i <= crate::axes::AxisName::index(axis)).count();
        tables.grid.as_ref().map_or_else(String::new, |form| form.axis_name(axis, number))
    };
    let output_step = if grid.output.is_rotary() { tables.step_deg.get_ref() } else { tables.step_mm.get_ref() };
    let decimals = super::fill::decimals(*output_step);
    let values: Vec<String> = (0..grid.values.len())
        .map(|i| {
            let at = grid.min + grid.step * i as f64;
            restore.map_or(grid.values[i], |old| old.at(at))
        })
        .map(|v| digits(v, decimals, tables.always_mark))
        .collect();
    let at = |v: f64| format!("{}", crate::tables::correction::rounded(v));
    context! {
        number => grid.number, input => name(grid.input), output => name(grid.output), sense => grid.sense,
        input_axis => grid.input.to_string(), output_axis => grid.output.to_string(),
        min => at(grid.min), max => at(grid.max()), step => at(grid.step), modulo => grid.modulo, values,
    }
}

#[allow(clippy::too_many_arguments)] // one place, one call
pub(super) fn write(
    machine: &Machine,
    tables: &Tables,
    kind: &Kind,
    correction: &Correction,
    options: &Options,
    (first, others, division): (&Filled, &BTreeMap<&str, Filled>, &Division),
    export: &mut Export,
) -> Result<()> {
    let unverified = export.compensation.tables.iter().flat_map(|t| &t.unverified);
    let doubts: Vec<String> = unverified.clone().map(|(what, why)| one_line(&format!("{what}: {why}"))).collect();
    // for heads that have no room for the reasons
    let doubted: Vec<String> = unverified.map(|(what, _)| one_line(what)).collect();
    // of several tables of the same values the one that is open widest
    let by_width = |a: &&Vector3<f64>, b: &&Vector3<f64>| a.norm().total_cmp(&b.norm());
    let opened = std::iter::once(first).chain(others.values()).filter_map(|f| f.opened_mm.as_ref()).max_by(by_width);
    let head = head(machine, correction);
    let head_of = |restore: bool| -> Vec<String> {
        let says = if restore {
            "The vectors of this file do not close, the new ones did: touch off all work offsets again (README.txt)"
        } else {
            "The old vectors did not close, the new ones do: touch off all work offsets again (README.txt)"
        };
        head.iter().cloned().chain(opened.map(|_| says.to_owned())).collect()
    };
    let old_unit =
        options.old.unit(std::iter::once(first).chain(others.values()).flat_map(Filled::given_lengths), options.unit);
    let record = export.compensation.tables.clone();
    let grids = record.map(|r| r.grids).unwrap_or_default();
    let active = correction.active.as_ref().and_then(|a| a.tables.as_ref());
    let before = |g: &Grid| super::grids::before(active, g);
    let grids_known = division.grids_known;
    let is_written = |f: &&FileForm| division.files.contains(&f.name);
    let main = tables.file.iter().filter(|f| !f.grids).find(is_written);
    let common = |restore: bool, form: Option<&FileForm>| {
        let spelling = form.or(main).or(tables.file.first()).and_then(|f| f.spelling.as_deref());
        let unit = old_unit.filter(|_| restore).unwrap_or(options.unit);
        let filled = spelling.and_then(|s| others.get(s)).unwrap_or(first);
        let entries: Vec<&Entry> =
            if filled.known() { filled.entries().collect() } else { filled.values.iter().collect() };
        let entries: Vec<Value> =
            entries.into_iter().filter_map(|v| entry(v, spelling, restore, unit, tables, &options.old)).collect();
        let letter = if unit == LengthUnit::Mm { "M" } else { "I" };
        let shown: Vec<Value> = grids.iter().map(|g| grid(machine, tables, g, restore.then_some(&before(g)))).collect();
        let of_grids = form.is_some_and(|f| f.grids);
        let known = if of_grids { grids_known } else { filled.known() };
        context! {
            head => head_of(restore), kind => kind.name.clone(), machine => one_line(&machine.name), entries, grids => shown,
            axes => machine.rotary().map(|a| a.name.to_string()).collect::<Vec<_>>(),
            unit => context! { name => unit.says(), letter }, restore, known, doubts => doubts.clone(), doubted => doubted.clone(),
        }
    };
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for form in tables.file.iter().filter(is_written) {
        for (name, restore) in [(Some(&form.name), false), (form.restore.as_ref(), true)] {
            let Some(name) = name else { continue };
            let text = own(form, &common(restore, Some(form)))?;
            let text = text.replace('\n', form.end_of_line.characters());
            files.push((name.clone(), text.into_bytes()));
        }
    }
    if division.changes().next().is_some() {
        let line = |c: &super::changes::Change| {
            let described = digits(c.described, c.decimals, false);
            context! { name => c.names.join(" or "), change => c.signed(), unit => c.unit, described, says => one_line(&c.says) }
        };
        let text = render(
            "changes",
            CHANGES,
            &context! {
                head => head_of(false), bare => !correction.transformation, unit => options.unit.says(),
                grids => division.points.first().and_then(|c| c.names.first().cloned()), doubts => doubts.clone(),
                changes => division.changes().map(line).collect::<Vec<_>>(),
            },
        )?;
        files.push((SHEET.to_owned(), text.into_bytes()));
    }
    let load = how_to_load(tables, &files);
    let left: Vec<Value> = export
        .left
        .iter()
        .map(|l| {
            let size = l.size(|um| format!("{um:.2}"));
            context! { parameter => l.parameter.clone(), value => format!("{:.6}", l.value), unit => l.unit.clone(), size,
            lever => format!("{:.0}", l.lever_mm), why => one_line(&l.why) }
        })
        .collect();
    let not: Vec<Value> = correction
        .left_out
        .iter()
        .filter(|l| !l.known)
        .map(|l| context! { parameter => l.parameter.clone(), effect => l.effect.clone(), why => one_line(&l.why) })
        .collect();
    let shift = export.compensation.tables.as_ref().map_or([0.0; 3], |t| t.workpiece_shift_mm);
    // old values acted during the measurement, and are not of this program's making: the study says nothing of their part
    let on_top = correction.transformation && correction.active.is_none() && !options.old.values.is_empty();
    let shape = |s: &crate::tables::correction::AxisShape| format!("{} ({})", s.parameter, s.effect);
    let in_grids: Vec<String> = if grids.is_empty() {
        Vec::new()
    } else {
        correction.shapes.iter().chain(&correction.across).map(shape).collect()
    };
    let decimals = |g: &Grid| {
        super::fill::decimals(*if g.output.is_rotary() { tables.step_deg.get_ref() } else { tables.step_mm.get_ref() })
    };
    let points: Vec<Value> = grids
        .iter()
        .map(|g| {
            let old = before(g);
            let show = |v: f64| digits(v, decimals(g), false);
            let rows: Vec<Value> = g
                .values
                .iter()
                .enumerate()
                .map(|(i, new)| {
                    let at = g.min + g.step * i as f64;
                    let was = old.at(at);
                    context! { at => format!("{}", crate::tables::correction::rounded(at)), old => show(was), new => show(*new), change => show(new - was) }
                })
                .collect();
            context! { number => g.number, input => g.input.to_string(), output => g.output.to_string(), rows }
        })
        .collect();
    let text = render(
        "readme",
        README,
        &context! {
            ..common(false, None), ..context! {
                own_head => head_of(false), says => tables.says.clone(), worksheet => tables.worksheet, load, cannot => tables.cannot.clone(),
                files => files.iter().map(|(n, _)| n.clone()).collect::<Vec<_>>(),
                variants => tables.file.iter().filter(|f| f.variant).map(|f| f.name.clone()).collect::<Vec<_>>(),
                reads => tables.reads.is_some() && division.complete(),
                sheet => division.changes().next().map(|_| SHEET), values_known => division.values_known,
                restore_unit => old_unit.filter(|unit| *unit != options.unit).map(|unit| unit.says()), on_top,
                left, omitted => not, in_grids, points, grids_known, radius => format!("{}", options.radius_mm),
                rounding => format!("{:.2}", export.rounding_um), rest => format!("{:.2}", export.rest_um),
                table_errors => export.table_errors.iter().map(|t| one_line(&t.says(|um| format!("{um:.2}")))).collect::<Vec<_>>(),
                longer => format!("{:.2}", export.longer_tool_um), length => format!("{:.3}", machine.tool.length_mm),
                shift => shift.map(|v| format!("{v:+.4}")).to_vec(), tool => correction.tool_length_mm.map(|v| format!("{v:+.4}")),
                measured => correction.of_measurement.keys().cloned().collect::<Vec<_>>(),
                step => Plain(*match options.unit {
                    LengthUnit::Mm => tables.step_mm.get_ref(),
                    LengthUnit::Inch => tables.step_inch.get_ref(),
                }).to_string(),
                forced => correction.provenance.forced.iter().map(|l| one_line(l)).collect::<Vec<_>>(),
                opened => opened.map(|v| v.map(|v| format!("{v:+.4}")).as_slice().to_vec()),
            }
        },
    )?;
    files.push(("README.txt".to_owned(), (text.trim_end().to_owned() + "\n").into_bytes()));
    files.push(("compensation.json".to_owned(), export.compensation.to_json()?.into_bytes()));
    export.files = files;
    Ok(())
}

/// The lines that say how to load the tables; one that names a file of position tables stands only where that is written.
fn how_to_load(tables: &Tables, files: &[(String, Vec<u8>)]) -> Vec<String> {
    let written = |name: &str| files.iter().any(|(n, _)| n == name);
    let lacks = |line: &&String| tables.file.iter().any(|f| line.contains(&f.name) && !written(&f.name));
    tables.load.iter().filter(|line| !lacks(line)).cloned().collect()
}

/// A template of the postprocessor file: the user may have changed it.
fn own(form: &FileForm, context: &Value) -> Result<String> {
    let fault = |e: minijinja::Error| {
        Failure::new("tables::template", format!("template of {}: {e:#}", form.name))
            .help("compare it with that of the built-in controllers: `axiscal controllers show NAME`")
    };
    let environment = compile(form.template.get_ref()).map_err(fault)?;
    environment.get_template("file").and_then(|t| t.render(context)).map_err(fault)
}
