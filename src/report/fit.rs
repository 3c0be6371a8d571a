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
    match self::unit(unit).as_str() {
        "" => amount.to_string(),
        shown => format!("{amount} {shown}"),
    }
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

/// A unit as it is printed.
#[must_use]
pub fn unit(unit: &str) -> String {
    match unit {
        "1" => String::new(),
        "urad" => "µrad".to_owned(),
        "um" => "µm".to_owned(),
        other => other.strip_prefix("um/").map_or_else(|| other.to_owned(), |per| format!("µm/{per}")),
    }
}

/// Remarks on the first screen.
const FIRST_REMARKS: usize = 3;

/// The first remarks, or all of them; the most important one is first.
#[must_use]
pub fn first_remarks(remarks: &[String], verbose: bool) -> String {
    let shown = if verbose { remarks.len() } else { remarks.len().min(FIRST_REMARKS) };
    let mut out: String = remarks[..shown].iter().map(|r| format!("{r}\n")).collect();
    match remarks.len() - shown {
        0 => {}
        1 => out += "1 more remark: --verbose\n",
        n => out += &format!("{n} more remarks: --verbose\n"),
    }
    out
}

/// The answer: what is determined, how well the model fits, and the table; at most three remarks where all are not asked for.
#[must_use]
pub fn outcome(o: &Outcome, paper: Paper, verbose: bool) -> String {
    let results: Vec<&Parameter> = o.parameters.iter().filter(|p| !is_of_a_block(&p.name)).collect();
    let mut out = answer(o, &results);
    if verbose {
        out += &fit_details(o);
    }
    out.push('\n');
    let (table, left_out) = results_table(&results, paper, verbose);
    out += &table;
    for point in &o.turns_about {
        out += &format!("{}: {}\n", point.parameter, point.says);
    }
    if verbose {
        let shown = |head: &str| !left_out.iter().any(|h| h == head);
        out += &legend(&results, &shown);
        out += &left_out_says(&left_out);
        out += &result_details(o);
    }
    out += &first_remarks(&remarks(o, &results, verbose), verbose);
    paper.plain(out)
}

/// The first sentences: what is determined, and how large the residual is.
fn answer(o: &Outcome, results: &[&Parameter]) -> String {
    let lost = results.iter().filter(|p| p.status == Status::Undetermined).count();
    let determined = match (results.len(), lost) {
        (1, 0) => "The 1 parameter is determined".to_owned(),
        (n, 0) => format!("All {n} parameters are determined"),
        (n, lost) => format!("{} of {n} parameters are determined, {lost} cannot be determined", n - lost),
    };
    let times = if o.noise_um > 0.0 && o.rms_um / o.noise_um < 1e4 {
        format!(", {:.1} times the probe noise of {} µm", o.rms_um / o.noise_um, significant(o.noise_um))
    } else {
        String::new()
    };
    let mut out = format!(
        "{determined} ({}).\nThe residual is {} µm RMS{times}, over {} touches.\n",
        o.machine,
        significant(o.rms_um),
        o.touches.saturating_sub(o.rejected.len())
    );
    if let Some(held_out) = o.held_out_rms_um {
        out += &format!("The cross-validated error is {} µm RMS.\n", significant(held_out));
    }
    if !o.converged {
        out += &format!("The fit did NOT converge: {}.\n", o.stopped);
    }
    out
}

/// chi2/dof; with as many unknowns as touches there is none.
pub(crate) fn per_dof(chi2_per_dof: f64, decimals: usize) -> String {
    if chi2_per_dof.is_nan() { "-".to_owned() } else { format!("{chi2_per_dof:.decimals$}") }
}

fn fit_details(o: &Outcome) -> String {
    format!(
        "{} unknown{}, rank {}, {} degrees of freedom, condition {:.1}, chi2/dof {}\nnoise: {}\n{} after {} steps: {}\n",
        o.unknowns,
        if o.unknowns == 1 { "" } else { "s" },
        o.rank,
        o.dof,
        o.condition,
        per_dof(o.chi2_per_dof, 3),
        o.noise_says,
        if o.converged { "converged" } else { "NOT converged" },
        o.iterations,
        o.stopped
    )
}

/// The table, and the columns that the paper has no room for.
fn results_table(results: &[&Parameter], paper: Paper, verbose: bool) -> (String, Vec<String>) {
    // two figures side by side: what the probe's noise leaves open, and what everything else may add
    let unmodelled = results.iter().any(|p| p.sigma_with_unmodelled.is_some());
    let mut head = vec!["parameter", "value", "unit"];
    if verbose {
        head.extend(["probe noise", "std. unc."]);
    }
    head.push("95 %");
    if unmodelled && verbose {
        head.push("unmodelled");
    }
    head.push("status");
    let mut t = table(&head);
    let short = paper.width < ROOMY;
    for p in results {
        let name = p.alias.as_ref().map_or_else(|| p.name.clone(), |a| format!("{} ({a})", p.name));
        let mut cells = vec![
            Cell::new(name),
            number(if p.status == Status::Undetermined { "?".into() } else { digits(p.value, p.sigma) }),
            Cell::new(unit(&p.unit)),
        ];
        if verbose {
            cells.push(number(p.sigma_noise.map_or_else(|| "-".into(), significant)));
            cells.push(number(p.sigma.map_or_else(|| "-".into(), significant)));
        }
        cells.push(number(p.expanded.map_or_else(|| "-".into(), |e| format!("± {}", significant(e)))));
        if unmodelled && verbose {
            cells.push(number(p.sigma_with_unmodelled.map_or_else(|| "-".into(), significant)));
        }
        cells.push(Cell::new(status(p.status, short)));
        t.add_row(cells);
    }
    // numbers are never broken: a name is, where it must. What a reader decides by stays on any paper: value, 95 % and status
    let left_out = lay(&mut t, paper.width.min(120), &["probe noise", "std. unc.", "unmodelled"]);
    (format!("{t}\n{}", uneven(results)), left_out)
}

/// What the columns are.
fn legend(results: &[&Parameter], shown: &dyn Fn(&str) -> bool) -> String {
    let mut out = String::new();
    if shown("probe noise") {
        out += "probe noise: standard uncertainty from the noise of the touches alone\n";
    }
    if shown("std. unc.") {
        out += "std. unc.: standard uncertainty with everything that the fit counts\n";
    }
    if shown("unmodelled") && results.iter().any(|p| p.sigma_with_unmodelled.is_some()) {
        out += "unmodelled: standard uncertainty if every lasting effect outside the model has its usual size\n";
    }
    out
}

/// Is it a number of a block, which no table of results shows?
fn is_of_a_block(name: &str) -> bool {
    name.contains('@') && !crate::model::predict::is_of_a_run(name)
}

/// What stands beside the table.
fn result_details(o: &Outcome) -> String {
    let mut out = String::new();
    let blocks: Vec<&Parameter> = o.parameters.iter().filter(|p| is_of_a_block(&p.name)).collect();
    if !blocks.is_empty() {
        let n_known = blocks.iter().filter(|p| p.status == Status::Identified).count();
        out += &format!("block positions: {n_known} of {} unknowns determined (--json lists them)\n", blocks.len());
    }
    if o.parameters.iter().any(|p| p.effect.starts_with("location") || p.effect == "paper-table") {
        let [x, y, z] = o.reference_mm;
        out += &format!("location errors of workpiece-side axes are stated at ({x}, {y}, {z}) mm in R\n");
    }
    for p in &o.priors {
        out += &format!("prior: {} = {} ± {} {}, counted once\n", p.name, p.value, significant(p.sigma), unit(&p.unit));
    }
    for b in &o.type_b {
        out += &format!(
            "type B: {} uncertain by {} {}, in the standard uncertainties\n",
            b.name,
            significant(b.sigma),
            unit(&b.unit)
        );
    }
    if !o.correlations.is_empty() {
        let pairs: Vec<String> = o.correlations.iter().map(|c| format!("{} and {} {:+.2}", c.a, c.b, c.r)).collect();
        out += &format!("highest correlations: {}\n", pairs.join(", "));
    }
    out
}

/// What a reader must know, the most important first.
fn remarks(o: &Outcome, results: &[&Parameter], verbose: bool) -> Vec<String> {
    let mut out: Vec<String> = o.warnings.iter().map(|w| format!("warning: {w}")).collect();
    out.extend(o.undetermined.iter().map(|u| format!("cannot be determined: {}", u.says)));
    if !o.parted_together.is_empty() {
        out.push(together(&o.parted_together, o.never_determined).trim_end().to_owned());
    }
    out.extend(not_used(o, verbose));
    out.extend(o.weak.iter().map(|w| format!("hardly determined: {}", w.says)));
    let holds: Vec<String> = held(&o.parameters).collect();
    if !holds.is_empty() {
        out.push(format!("{HOLDS}: {}", holds.join("; ")));
    }
    let following: Vec<String> = following(results).collect();
    if !following.is_empty() {
        out.push(format!("{FOLLOW}: {}", following.join(", ")));
    }
    out
}

/// Touches that are not used: in one line on the first screen.
fn not_used(o: &Outcome, verbose: bool) -> Vec<String> {
    let one = |r: &Rejected| format!("not used: touch {} of run {}: {}", r.id, r.run, r.reason);
    let (far, others): (Vec<&Rejected>, Vec<&Rejected>) = o.rejected.iter().partition(|r| r.is_far);
    let mut out = Vec::new();
    // a column of the other sign puts hundreds of them elsewhere: one line says so
    match far.first() {
        Some(first) if far.len() > MOST_FAR || (far.len() > 1 && !verbose) => out.push(format!(
            "not used: {} touches far from their planned positions, the first is touch {} of run {}",
            far.len(),
            first.id,
            first.run
        )),
        _ => out.extend(far.into_iter().map(one)),
    }
    if others.len() > 1 && !verbose {
        let ids: Vec<String> = others.iter().take(MOST_FAR).map(|r| format!("{}/{}", r.run, r.id)).collect();
        let more = if others.len() > MOST_FAR { ", …" } else { "" };
        out.push(format!("not used: {} touches (run/touch): {}{more}", others.len(), ids.join(", ")));
    } else {
        out.extend(others.into_iter().map(one));
    }
    out
}

/// What is said of values that include more than their name says.
pub const HOLDS: &str = "these values include effects outside the model, which these touches cannot separate";

/// Results with the effects that stand in their values: `EZ0A includes tool-length`.
pub fn held(parameters: &[Parameter]) -> impl Iterator<Item = String> {
    let with = parameters.iter().filter(|p| !p.holds.is_empty() && !p.name.contains('@'));
    with.map(|p| format!("{} includes {}", p.name, p.holds.join(", ")))
}

/// What is said of values that depend on what cannot be determined.
pub const FOLLOW: &str =
    "these values change, if what cannot be determined has its usual size, by (counted in the uncertainties)";

/// Results that follow what cannot be determined, and by how much: `EZ0B by 0.000000760 mm`.
fn following(results: &[&Parameter]) -> impl Iterator<Item = String> {
    let moves = results.iter().filter_map(|p| Some((*p, p.moves_with_unseen?)));
    moves.map(|(p, by)| format!("{} by {}", p.name, with_unit(significant(by), &p.unit)))
}

/// What a table does not show for want of room; nothing where it shows all.
pub(super) fn left_out_says(heads: &[String]) -> String {
    if heads.is_empty() {
        return String::new();
    }
    format!("no room for: {} (use a wider terminal, COLUMNS=120 or --json)\n", heads.join(", "))
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
            // the touches set no other end
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
        out += &format!("{}: {says} with 95 %; the table has the wider side\n", p.name);
    }
    out
}

fn status(status: Status, short: bool) -> &'static str {
    match status {
        // the rule needs no word where there is little room
        Status::Identified if short => "",
        Status::PriorDominated if short => "prior",
        Status::Undetermined if short => "unknown",
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
        assert_eq!((with_unit("0.3", "1"), with_unit("0.3", "um")), ("0.3".into(), "0.3 µm".into()));
        assert_eq!(significant(0.000_234_5), "0.000235");
        assert_eq!(significant(1234.5), "1234");
    }
}
