//! README.txt of an export: what is carried, what is not and how large an error that leaves, how to load, how to go back.

use super::pack::Packing;
use super::{Left, Way, component, head, one_line, render, stock};
use crate::diag::Result;
use crate::machine::{Carrier, Side};
use crate::tables::compensation::Term;
use crate::units::um_from_mm;
use minijinja::context;

const TEMPLATE: &str = include_str!("../templates/linuxcnc/readme.txt.j2");

/// Columns of text, each as wide as its widest cell.
fn columns(rows: &[Vec<String>]) -> Vec<String> {
    let count = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|cell| cell.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..count).map(width).collect();
    rows.iter()
        .map(|row| {
            let cells: Vec<String> = row.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}")).collect();
            format!("  {}", cells.join("  ").trim_end())
        })
        .collect()
}

fn carried(terms: &[Term]) -> Vec<String> {
    let heading = ["parameter", "effect", "place", "was", "found", "+-", "now", "unit"];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for t in terms {
        rows.push(vec![
            one_line(&t.parameter),
            one_line(&t.effect),
            format!("{} {} {}", t.axis, t.place, t.dof),
            format!("{:.6}", t.active_before),
            format!("{:.6}", t.identified),
            t.sigma.map_or_else(|| "-".to_owned(), |s| format!("{s:.6}")),
            format!("{:.6}", t.value),
            t.unit.clone(),
        ]);
    }
    columns(&rows)
}

fn left(lines: &[Left]) -> Vec<String> {
    let mut rows = Vec::new();
    for l in lines {
        let size = l.size(|um| format!("{um:.2}"));
        let anywhere = ["mm", "um"].iter().any(|unit| l.unit.split('/').next() == Some(*unit)) && l.unit != "um/m";
        let error = if anywhere { format!("leaves {size}") } else { format!("leaves {size} at {} mm", l.lever_mm) };
        rows.push(vec![
            one_line(&l.parameter),
            one_line(&l.effect),
            format!("{:.6} {}", l.value, one_line(&l.unit)),
            error,
            one_line(&l.why),
        ]);
    }
    columns(&rows)
}

pub(super) fn text(packing: &Packing, by_component: &Way, by_stock: &Way) -> Result<String> {
    let (machine, correction) = (packing.machine, packing.correction);
    let unwritten = |known: bool| correction.left_out.iter().filter(move |l| l.known == known);
    let withheld: Vec<Vec<String>> =
        unwritten(false).map(|l| vec![one_line(&l.parameter), one_line(&l.effect), l.why.clone()]).collect();
    let kept: Vec<String> = correction
        .terms
        .iter()
        .filter(|t| t.identified == 0.0 && t.active_before != 0.0)
        .map(|t| one_line(&t.parameter))
        .collect();
    // tilts that no linear axis can take out of the tool's or the workpiece's direction
    let tilts: Vec<String> = correction
        .terms
        .iter()
        .filter(|t| t.dof.is_angle() && t.place != crate::tables::place::Place::Zero && t.value != 0.0)
        .map(|t| format!("{} {:.6} deg = {:.2} um on 100 mm", one_line(&t.parameter), t.value, angle_um(t)))
        .collect();
    let shift =
        packing.module.as_ref().ok().map(|m| stock::pins(machine, *m, &by_stock.compensation.terms).workpiece_shift_mm);
    let home = by_stock.compensation.stock.as_ref().map(|s| &s.home_offset_deg);
    let home: Vec<String> = home
        .into_iter()
        .flatten()
        .map(|(axis, deg)| format!("{axis}: {deg:.6} deg added to its HOME_OFFSET"))
        .collect();
    let shapes_of = |axis| -> String {
        let own = correction.shapes.iter().filter(|s| s.axis == axis);
        own.map(|s| format!(" {} ({})", one_line(&s.parameter), one_line(&s.effect))).collect::<Vec<_>>().join(",")
    };
    let tables: Vec<String> = packing
        .tables
        .iter()
        .map(|(axis, t)| format!("{axis}: {} ({} lines):{}", t.file, t.rows.len(), shapes_of(*axis)))
        .collect();
    let measurement: Vec<String> =
        correction.of_measurement.iter().map(|(effect, n)| format!("{} ({n})", one_line(effect))).collect();
    let table_axes =
        machine.rotary().filter(|a| a.side == Side::Workpiece).map(|a| a.name.to_string()).collect::<Vec<_>>();
    // what stands on the linear axes' table does not move with the rotary axis that the component looks at
    let workpiece_axis = machine.side(Side::Workpiece).last().map(|a| a.name);
    let beside: Vec<String> = machine
        .mountings
        .iter()
        .filter(|m| workpiece_axis.is_some_and(|a| a.is_rotary() && m.carrier != Carrier::Axis(a)))
        .map(|m| one_line(&m.name))
        .collect();
    render(
        "README.txt",
        TEMPLATE,
        &context! {
            head => head(machine, correction),
            forced => correction.provenance.forced.iter().map(|l| one_line(l)).collect::<Vec<_>>(),
            component => component::name(machine),
            coordinates => packing.joints.coordinates(),
            machine_sha256 => machine.sha256.clone(),
            radius => packing.options.radius_mm.to_string(),
            stock_point => by_stock.compensation.reference_mm.map(|v| v.to_string()).to_vec(),
            reference => correction.reference_mm.map(|v| v.to_string()).to_vec(),
            table_axes => table_axes,
            beside => beside,
            workpiece_axis => workpiece_axis.map(|a| a.to_string()).unwrap_or_default(),
            tool_length => machine.tool.length_mm,
            carried => carried(&by_component.compensation.terms),
            any => !by_component.compensation.terms.is_empty(),
            kept => kept,
            left => left(&by_component.left),
            withheld => columns(&withheld),
            measurement => measurement,
            tilts => tilts,
            release => packing.release.says.clone(),
            turning => packing.module.as_ref().map(|m| packing.turning(m)).unwrap_or_default(),
            faults => packing.module.iter().flat_map(|m| packing.faults(m)).map(|f| one_line(&f.says)).collect::<Vec<_>>(),
            module => packing.module.as_ref().map(|m| m.name).unwrap_or_default(),
            why_no_module => packing.module.as_ref().err().cloned().unwrap_or_default(),
            shift => shift.map(|s| s.map(|v| format!("{v:.6}")).to_vec()),
            stock_carried => carried(&by_stock.compensation.terms),
            stock_any => !by_stock.compensation.terms.is_empty(),
            stock_left => left(&by_stock.left),
            home => home,
            tables => tables,
            table_errors => packing.table_errors.iter().map(|t| one_line(&t.says(|um| format!("{um:.2}")))).collect::<Vec<_>>(),
            has_pins => packing.has("stock/axiscal.hal"),
            sheets => ["axiscal_changes.txt", "stock/axiscal_changes.txt"].into_iter().filter(|p| packing.has(p)).collect::<Vec<_>>(),
            has_work_offset => packing.has(&format!("stock/{}.ngc", super::work_offset::SUBROUTINE)),
            work_offset => super::work_offset::SUBROUTINE,
            tool_change => correction.tool_length_mm.filter(|c| *c != 0.0).map(|c| format!("{c:.6}")),
            second_order => second_order_um(&correction.terms),
        },
    )
}

fn angle_um(term: &Term) -> f64 {
    crate::tables::correction::left_um(term.value, &term.unit, 100.0).unwrap_or(0.0)
}

/// Adding two small turns is exact to the product of the two: the largest such product times 200 mm, µm; none below 1 nm.
fn second_order_um(terms: &[Term]) -> Option<String> {
    let largest = |value: fn(&Term) -> f64| {
        terms
            .iter()
            .filter(|t| t.dof.is_angle())
            .map(|t| crate::units::rad_from_deg(value(t)).abs())
            .fold(0.0, f64::max)
    };
    let um = um_from_mm(largest(|t| t.active_before) * largest(|t| t.identified) * 200.0);
    (um >= 1e-3).then(|| format!("{um:.3}"))
}
