//! The answer of `diagnose`: the verdict first, then what may be missing, then on what the misfit depends.

use super::fit::{digits, first_remarks, number, significant, table, unit, with_unit};
use super::lay::lay;
use super::plot::{Paper, axis_label};
use super::prose::sentence;
use crate::diagnose::answer::{Candidate, Diagnosis, Shape};
use crate::diagnose::{Verdict, setup_mistakes};
use crate::words::diagnose::plain;
use crate::words::diagnosis_remarks::remarks;
use comfy_table::Cell;

/// Rows of the small plot.
const ROWS: usize = 11;

/// Groups of touches that are named below the plot.
const MOST_NAMED: usize = 6;

/// Columns of the small plot at least and at most.
const COLUMNS: (usize, usize) = (30, 100);

/// Words in lines of the paper; the lines after the first begin with so many blanks.
fn wrapped(text: &str, indent: usize, paper: Paper) -> String {
    let own = text.len() - text.trim_start().len();
    sentence(text.trim_start(), paper.width, own, indent) + "\n"
}

/// The answer: verdict, candidates, what to check; at most three remarks where all are not asked for.
#[must_use]
pub fn diagnosis(d: &Diagnosis, paper: Paper, verbose: bool) -> String {
    let wrapped = |text: &str, indent: usize| wrapped(text, indent, paper);
    let mut out = wrapped(&d.says, 0);
    if verbose {
        out += &wrapped(&format!("noise: {}", d.noise_says), 2);
    }
    if !d.candidates.is_empty() {
        out += &candidates(d, paper, verbose);
        out += &to_check(d, paper);
    }
    // where no effect is named the curve is the finding
    if let Some(shape) = d.shape.as_ref().filter(|_| verbose || d.verdict.unexplained().is_some()) {
        out += &plot(shape, paper);
        if !shape.kind.is_empty() {
            out += &wrapped(&format!("possible cause: {}", shape.kind), 2);
        }
    }
    let remarks: Vec<String> = remarks(d, verbose).iter().map(|r| wrapped(r, 2).trim_end().to_owned()).collect();
    out += &first_remarks(&remarks, verbose);
    paper.plain(out)
}

/// The table of candidates with their sizes.
fn candidates(d: &Diagnosis, paper: Paper, verbose: bool) -> String {
    let wrapped = |text: &str, indent: usize| wrapped(text, indent, paper);
    // where nothing is missing the list says what was tried
    let missing = d.verdict != Verdict::Adequate;
    if !missing && !verbose {
        return String::new();
    }
    let mut t = table(&["candidate", "p (Holm)", "error, µm", "cross-validated, µm", "share"]);
    for c in &d.candidates {
        if c.effect == setup_mistakes::EFFECT {
            // a mistake of yes or no: it has neither a size nor a chance, and an error only where it was fitted
            let (error, share) = match c.proposed {
                true => (significant(c.rms_after_um), format!("{:.0} %", 100.0 * c.share)),
                false => ("-".to_owned(), "-".to_owned()),
            };
            t.add_row(vec![Cell::new(&c.name), number("-"), number(error), number("-"), number(share)]);
            continue;
        }
        let held = match (c.held_out_before_um, c.held_out_after_um) {
            // nothing could be predicted: 0 against 0 says nothing
            (Some(before), Some(after)) if before > 0.0 || after > 0.0 => {
                let se = c.held_out_se_um.map_or_else(String::new, |se| format!(" ± {}", digits(se, Some(se))));
                format!("{} > {}{se}", significant(before), significant(after))
            }
            _ => "-".into(),
        };
        t.add_row(vec![
            Cell::new(if c.proposed { format!("* {}", one_of(c)) } else { one_of(c) }),
            number(probability(c.p_adjusted)),
            number(significant(c.rms_after_um)),
            number(held),
            number(format!("{:.0} %", 100.0 * c.share)),
        ]);
    }
    lay(&mut t, paper.width.min(100), &[]);
    let mut out = if missing { String::new() } else { "tried, and not needed:\n".to_owned() };
    out += &format!("{t}\n");
    let rises = |c: &Candidate| c.held_out_before_um.zip(c.held_out_after_um).is_some_and(|(b, a)| a >= b);
    let tested = || d.candidates.iter().filter(|c| c.proposed && c.effect != setup_mistakes::EFFECT);
    if tested().any(rises) {
        out += &wrapped(
            "* passes the test; with so few index positions, unused measurements neither confirm nor refute it",
            2,
        );
    } else if tested().next().is_some() {
        out += &wrapped("* passes the test and is confirmed on unused measurements (± one standard error)", 2);
    }
    let sized = || {
        let of = |c: &&Candidate| missing && c.p_adjusted < 1.0 && c.effect != setup_mistakes::EFFECT;
        d.candidates.iter().filter(of).take(if verbose { usize::MAX } else { d.proposed().len().max(1) })
    };
    if sized().any(|c| c.moves_sigma_um.is_some() || c.parameters.iter().any(|p| p.sigma.is_some())) {
        out += "expected size, ± one standard uncertainty:\n";
    }
    for c in sized() {
        let which = if c.same_as.is_empty() { c.effect.clone() } else { format!("if it is {}", c.effect) };
        out += &wrapped(&format!("  {which}: {}", sizes(c)), 4);
        if !c.same_as.is_empty() {
            out += &wrapped(&format!("  cannot be separated from {}", c.same_as.join(", ")), 4);
        }
    }
    out
}

/// What the first candidate is, and what to check at the machine. What is not named sends nobody to the machine.
fn to_check(d: &Diagnosis, paper: Paper) -> String {
    let wrapped = |text: &str, indent: usize| wrapped(text, indent, paper);
    let named = |c: &&Candidate| d.verdict != Verdict::Adequate && (c.proposed || d.verdict.most_touches_unusable());
    let Some(first) = d.candidates.first().filter(named) else { return String::new() };
    let which = if first.same_as.is_empty() { String::new() } else { format!("if it is {}: ", first.effect) };
    // an effect of a person's own may say nothing of either
    let says = if first.says.is_empty() { String::new() } else { format!(": {}", first.says) };
    let mut out = wrapped(&format!("{which}{}{says}", first.name), 2);
    if !first.look.is_empty() {
        out += &wrapped(&format!("  check at the machine: {}", first.look), 4);
    }
    if !first.tell_apart.is_empty() {
        out += &wrapped(&format!("  to separate them: {}", first.tell_apart), 4);
    }
    out
}

/// A p-value.
pub(super) fn probability(p: f64) -> String {
    // what is smaller is no number of the computer's any more
    if p < 1e-300 {
        "< 1e-300".to_owned()
    } else if p < 1e-3 {
        format!("{p:.0e}")
    } else {
        format!("{p:.3}")
    }
}

/// A candidate in a cell: never one name where these touches cannot tell it from others.
fn one_of(c: &Candidate) -> String {
    let with = c.together_with.as_ref().map_or_else(String::new, |other| format!(", with {other}"));
    match c.same_as.len() {
        0 if c.or_else.is_some() => format!("{} or something else{with}", c.effect),
        0 => format!("{}{with}", c.effect),
        1 => format!("{} or 1 other{with}", c.effect),
        n => format!("{} or {n} others{with}", c.effect),
    }
}

fn sizes(c: &Candidate) -> String {
    const MOST: usize = 4;
    let mut each: Vec<String> = c
        .parameters
        .iter()
        .map(|p| match p.sigma {
            Some(s) => {
                let amount = format!("{} ± {}", digits(p.value, Some(s)), significant(s));
                format!("{} {}", p.name, with_unit(amount, &p.unit))
            }
            None => format!("{} {}", p.name, with_unit(significant(p.value), &p.unit)),
        })
        .collect();
    let more = each.len() > MOST;
    each.truncate(MOST);
    let mut text = each.join(", ");
    if more {
        text += ", …";
    }
    if !c.not_told.is_empty() {
        let unknown: Vec<String> = c.not_told.iter().take(MOST).map(|name| format!("{name} ?")).collect();
        let gap = if text.is_empty() { "" } else { ", " };
        let more = if c.not_told.len() > MOST { ", …" } else { "" };
        text += &format!("{gap}{}{more} (cannot be determined one by one with this plan)", unknown.join(", "));
        if let (Some(most), Some(sigma)) = (c.moves_um, c.moves_sigma_um) {
            let size = digits(most, Some(sigma));
            text += &format!("; together they move a touch by up to {size} ± {} µm", significant(sigma));
        }
    }
    text
}

/// The misfit against its variable, in characters.
fn plot(s: &Shape, paper: Paper) -> String {
    /// Part of a row that is rounding.
    const HALF_WAY: f64 = 1e-6;
    let (rows, columns) = (ROWS, paper.width.saturating_sub(16).clamp(COLUMNS.0, COLUMNS.1));
    let [zero, band, curve] = ['·', '░', '█'];
    let (Some(&from), Some(&to)) = (s.x.first(), s.x.last()) else { return String::new() };
    let limit = s.y.iter().zip(&s.band).map(|(y, b)| y.abs() + b).fold(0.0, f64::max);
    if limit <= 0.0 || to <= from {
        return String::new();
    }
    // half-way between two rows it is the lower one, whatever the last bit says
    let row = |y: f64| {
        let at = (limit - y) / (2.0 * limit) * (rows - 1) as f64;
        (at + HALF_WAY).round().clamp(0.0, (rows - 1) as f64) as usize
    };
    let mut grid = vec![vec![' '; columns]; rows];
    grid[rows / 2].fill(zero);
    for c in 0..columns {
        let i = c * (s.x.len() - 1) / (columns - 1);
        for line in grid.iter_mut().take(row(s.y[i] - s.band[i]) + 1).skip(row(s.y[i] + s.band[i])) {
            line[c] = band;
        }
        grid[row(s.y[i])][c] = curve;
    }
    // a group has a number and no unit
    let unit = match self::unit(&s.x_unit) {
        none if none.is_empty() => none,
        shown => format!(" ({shown})"),
    };
    let against = match &s.block {
        Some(block) => format!("the time on block {block}"),
        None => plain(&s.by),
    };
    let what = format!("residual against {against}{unit}, {}, about its mean", s.direction);
    let mut out = wrapped(&what, 2, paper);
    let y_unit = self::unit(&s.y_unit);
    for (r, line) in grid.iter().enumerate() {
        let label = match r {
            0 => format!("{limit:+8.1}"),
            _ if r == rows - 1 => format!("{:+8.1}", -limit),
            _ if r == rows / 2 => format!("{:8.1}", 0.0),
            _ => " ".repeat(8),
        };
        out += &format!(
            "{label} {} {}\n",
            line.iter().collect::<String>().trim_end(),
            if r == 0 { y_unit.as_str() } else { "" }
        );
    }
    let (from, to) = (axis_label(from, to - from), axis_label(to, to - from));
    let gap = columns.saturating_sub(from.len() + to.len());
    out += &format!("{} {from}{}{to}\n", " ".repeat(8), " ".repeat(gap));
    // a number says nothing to a person: those that stand out by name
    let far = |i: &usize| s.y[*i].abs() > s.band[*i];
    let mut named: Vec<usize> = (0..s.labels.len().min(s.y.len())).filter(far).collect();
    named.sort_by(|a, b| s.y[*b].abs().total_cmp(&s.y[*a].abs()));
    let of = |&i: &usize| format!("{} {} {:+.1}", i + 1, s.labels[i], s.y[i]);
    let names: Vec<String> = named.iter().take(MOST_NAMED).map(of).collect();
    if !names.is_empty() {
        out += &wrapped(&format!("furthest off: {} {}", names.join(", "), s.y_unit), 2, paper);
    }
    out
}
