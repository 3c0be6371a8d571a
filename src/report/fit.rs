//! The answer of `identify` as a table with its remarks.

use super::lay::lay;
use super::plot::Paper;
use crate::fit::outcome::{Outcome, Parameter, Rejected, Status};
use comfy_table::{Cell, CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

/// Up to so many touches that are far from their places have a line each.
const MOST_FAR: usize = 12;

/// Lines above, below and under the head only: rows are read across, not boxed in.
const HOUSE: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// A table in the house's form.
#[must_use]
pub fn table(head: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(HOUSE).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(head.iter().map(Cell::new));
    table
}

/// A right-aligned cell.
#[must_use]
pub fn number(text: impl ToString) -> Cell {
    Cell::new(text.to_string()).set_alignment(CellAlignment::Right)
}

/// Value and uncertainty with the digits that the uncertainty leaves: two significant ones of it.
#[must_use]
pub fn digits(value: f64, sigma: Option<f64>) -> String {
    let decimals = match sigma {
        Some(s) if s > 0.0 && s.is_finite() => (1 - s.log10().floor() as i32).clamp(0, 12) as usize,
        _ => 6,
    };
    unsigned_zero(format!("{value:.decimals$}"))
}

/// A value that is zero to its printed digits has no sign.
fn unsigned_zero(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        _ => text,
    }
}

/// An amount in words: a number without a dimension has no unit beside it.
#[must_use]
pub fn with_unit(amount: impl std::fmt::Display, unit: &str) -> String {
    if unit == "1" { amount.to_string() } else { format!("{amount} {unit}") }
}

/// The variations that together determine what the touches cannot, and how many combinations they leave.
pub(super) fn together(variations: &[String], left: usize) -> String {
    let what = if left == 0 { "to determine all of them" } else { "to determine some of them" };
    let rest = match left {
        0 => String::new(),
        1 => ". No variation of these touches determines 1 combination".to_owned(),
        n => format!(". No variation of these touches determines {n} combinations"),
    };
    format!("{what}: {}{rest}\n", variations.join("; and "))
}

/// The whole answer.
#[must_use]
pub fn outcome(o: &Outcome, paper: Paper) -> String {
    let mut out = String::new();
    out += &format!(
        "{}: {} touches, {} unknown{} of rank {} ({} degrees of freedom), condition {:.1}\n",
        o.machine,
        o.touches,
        o.unknowns,
        if o.unknowns == 1 { "" } else { "s" },
        o.rank,
        o.dof,
        o.condition
    );
    out += &format!("error left {} um RMS; chi2/dof {:.3}", significant(o.rms_um), o.chi2_per_dof);
    if let Some(held_out) = o.held_out_rms_um {
        out += &format!("; {} um on index visits left out", significant(held_out));
    }
    out += &format!("\nnoise: {}\n", o.noise_says);
    out += &format!(
        "{} after {} steps: {}\n\n",
        if o.converged { "converged" } else { "NOT converged" },
        o.iterations,
        o.stopped
    );
    let results: Vec<&Parameter> = o.parameters.iter().filter(|p| !p.name.contains('@')).collect();
    // two figures side by side: what the probe's noise leaves open, and what everything else may add
    let unmodelled = results.iter().any(|p| p.sigma_with_unmodelled.is_some());
    let mut head = vec!["parameter", "value", "unit", "probe noise", "std. unc.", "95 %"];
    if unmodelled {
        head.push("unmodelled");
    }
    head.push("status");
    let mut t = table(&head);
    for p in &results {
        let name = p.alias.as_ref().map_or_else(|| p.name.clone(), |a| format!("{} ({a})", p.name));
        let mut cells = vec![
            Cell::new(name),
            number(if p.status == Status::Undetermined { "?".into() } else { digits(p.value, p.sigma) }),
            Cell::new(&p.unit),
            number(p.sigma_noise.map_or_else(|| "-".into(), significant)),
            number(p.sigma.map_or_else(|| "-".into(), significant)),
            number(p.expanded.map_or_else(|| "-".into(), |e| format!("± {}", significant(e)))),
        ];
        if unmodelled {
            cells.push(number(p.sigma_with_unmodelled.map_or_else(|| "-".into(), significant)));
        }
        cells.push(Cell::new(status(p.status, paper.width < ROOMY)));
        t.add_row(cells);
    }
    // numbers are never broken: a name is, where it must. What a reader decides by stays on any paper: value, 95 % and status
    let left_out = lay(&mut t, paper.width.min(120), &["probe noise", "std. unc.", "unmodelled"]);
    out += &t.to_string();
    out.push('\n');
    out += &uneven(&results);
    let shown = |head: &str| !left_out.iter().any(|h| h == head);
    match (shown("probe noise"), shown("std. unc.")) {
        (true, _) => {
            out += "probe noise: standard uncertainty from the touches' own noise alone; std. unc.: with all that the fit counts\n";
        }
        (false, true) => out += "std. unc.: standard uncertainty with all that the fit counts\n",
        (false, false) => {}
    }
    if unmodelled && shown("unmodelled") {
        out += "unmodelled: standard uncertainty if every effect that the model leaves out acts at its typical size\n";
    }
    out += &left_out_says(&left_out);
    let holds: Vec<String> = held(&o.parameters).collect();
    if !holds.is_empty() {
        out += &format!("{HOLDS}: {}\n", holds.join("; "));
    }
    let following: Vec<String> = following(&results).collect();
    if !following.is_empty() {
        out += &format!("{FOLLOW}: {}\n", following.join(", "));
    }
    let blocks: Vec<&Parameter> = o.parameters.iter().filter(|p| p.name.contains('@')).collect();
    if !blocks.is_empty() {
        let n_known = blocks.iter().filter(|p| p.status == Status::Identified).count();
        out += &format!(
            "and {} set-up unknowns of the blocks, {n_known} of them identified (--json lists them)\n",
            blocks.len()
        );
    }
    if o.parameters.iter().any(|p| p.effect.starts_with("location") || p.effect == "paper-table") {
        let [x, y, z] = o.reference_mm;
        out += &format!("location errors of workpiece-side axes are stated at ({x}, {y}, {z}) mm in R\n");
    }
    for p in &o.priors {
        out += &format!("prior: {} = {} ± {} {}, counted once\n", p.name, p.value, significant(p.sigma), p.unit);
    }
    for b in &o.type_b {
        out += &format!(
            "type B: {} uncertain by {} {}, in the standard uncertainties\n",
            b.name,
            significant(b.sigma),
            b.unit
        );
    }
    if !o.correlations.is_empty() {
        let pairs: Vec<String> = o.correlations.iter().map(|c| format!("{} ~ {} {:+.2}", c.a, c.b, c.r)).collect();
        out += &format!("told apart worst (correlation): {}\n", pairs.join(", "));
    }
    for w in &o.weak {
        out += &format!("hardly told by this data: {}\n", w.says);
    }
    for u in &o.undetermined {
        out += &format!("not told by this data: {}\n", u.says);
    }
    if !o.parted_together.is_empty() {
        out += &together(&o.parted_together, o.never_determined);
    }
    // a column of the other sign puts hundreds of them elsewhere: one line says so
    let far = |r: &&Rejected| r.is_far;
    let all_far: Vec<&Rejected> = o.rejected.iter().filter(far).collect();
    let many = all_far.len() > MOST_FAR;
    if let Some(first) = all_far.first().filter(|_| many) {
        let n = all_far.len();
        out += &format!(
            "not used: {n} touches far from their places, the first of them touch {} of run {}\n",
            first.id, first.run
        );
    }
    for r in o.rejected.iter().filter(|r| !(many && far(r))) {
        out += &format!("not used: touch {} of run {}: {}\n", r.id, r.run, r.reason);
    }
    for w in &o.warnings {
        out += &format!("warning: {w}\n");
    }
    paper.plain(out)
}

/// What is said of values that hold more than their name says.
pub const HOLDS: &str =
    "no touch here tells these from effects that the model leaves out, whose size stands in the value";

/// Results with the effects that stand in their values: `EZ0A holds tool-length`.
pub fn held(parameters: &[Parameter]) -> impl Iterator<Item = String> {
    let with = parameters.iter().filter(|p| !p.holds.is_empty() && !p.name.contains('@'));
    with.map(|p| format!("{} holds {}", p.name, p.holds.join(", ")))
}

/// What is said of values that are told exactly only while what is not told is what it is held at.
pub const FOLLOW: &str =
    "these move, while what is not told below moves by its usual size, by (in the standard uncertainties)";

/// Results that follow what is not told, and by how much: `EZ0B by 0.000000760 mm`.
fn following(results: &[&Parameter]) -> impl Iterator<Item = String> {
    let moves = results.iter().filter_map(|p| Some((*p, p.moves_with_unseen?)));
    moves.map(|(p, by)| format!("{} by {}", p.name, with_unit(significant(by), &p.unit)))
}

/// What a table does not show for want of room; nothing where it shows all.
pub(super) fn left_out_says(heads: &[String]) -> String {
    if heads.is_empty() {
        return String::new();
    }
    format!("too narrow here for: {} (a wider terminal, COLUMNS=120 or --json has it)\n", heads.join(", "))
}

/// Three significant digits, plainly written where that is readable.
#[must_use]
pub fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return unsigned_zero(format!("{x}"));
    }
    let magnitude = x.abs().log10().floor() as i32;
    if (-7..6).contains(&magnitude) { format!("{x:.*}", (2 - magnitude).max(0) as usize) } else { format!("{x:.2e}") }
}

/// From this width on the last column has its whole words.
const ROOMY: usize = 96;

/// Shape parameters whose doubt is not the same on both sides, in words.
fn uneven(results: &[&Parameter]) -> String {
    /// Sides that differ by less need no words.
    const TENTH: f64 = 1.1;
    let mut out = String::new();
    for p in results {
        let Some([low, high]) = p.interval else { continue };
        let shown = |end: f64| digits(end, p.sigma);
        let says = match (low, high) {
            (Some(low), Some(high)) => {
                let (below, above) = (p.value - low, high - p.value);
                if below.max(above) <= TENTH * below.min(above) {
                    continue;
                }
                format!("{} to {}", shown(low), with_unit(shown(high), &p.unit))
            }
            // an end that the touches do not set: more than that they do not tell
            (Some(low), None) => {
                out += &format!("{}: {} or more with 95 %\n", p.name, with_unit(significant(low), &p.unit));
                continue;
            }
            (None, Some(high)) => {
                out += &format!("{}: {} or less with 95 %\n", p.name, with_unit(significant(high), &p.unit));
                continue;
            }
            (None, None) => continue,
        };
        out += &format!("{}: {says} with 95 %; the wider side stands in the table\n", p.name);
    }
    out
}

fn status(status: Status, short: bool) -> &'static str {
    match status {
        // the rule needs no word where there is little room
        Status::Identified if short => "",
        Status::PriorDominated if short => "prior",
        Status::Undetermined if short => "not told",
        Status::Identified => "identified",
        Status::Fixed => "fixed",
        Status::PriorDominated => "prior-dominated",
        Status::Undetermined => "undetermined",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_uncertainty() {
        assert_eq!(digits(0.029_984_56, Some(2.3e-4)), "0.02998");
        assert_eq!(digits(12.3, Some(4.0)), "12.3");
        assert_eq!(digits(-0.3, Some(40.0)), "0");
        assert_eq!(digits(-0.000_01, Some(0.1)), "0.00");
        assert_eq!(digits(-0.3, Some(4.0)), "-0.3");
        assert_eq!(significant(-0.0), "0");
        assert_eq!((with_unit("0.3", "1"), with_unit("0.3", "um")), ("0.3".into(), "0.3 um".into()));
        assert_eq!(significant(0.000_234_5), "0.000235");
        assert_eq!(significant(1234.5), "1234");
    }
}
