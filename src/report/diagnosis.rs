//! The answer of `diagnose`: the verdict first, then what may be missing, then on what the misfit depends.

use super::fit::{digits, number, significant, table};
use crate::diagnose::answer::{Candidate, Diagnosis, Shape};
use comfy_table::Cell;

/// Rows and columns of the small plot.
const PLOT: (usize, usize) = (11, 64);

/// Effects named with their smallest detectable size.
const MOST_POWER: usize = 4;

/// Prose is wrapped to this: it is read on 80 columns and looks no worse on 160.
const WIDTH: usize = 80;

/// Words in lines of [`WIDTH`]; the lines after the first begin with so many blanks.
fn wrapped(text: &str, indent: usize) -> String {
    let mut length = text.len() - text.trim_start().len();
    let mut out = " ".repeat(length);
    for (i, word) in text.split_whitespace().enumerate() {
        let n = word.chars().count();
        if i > 0 && length + 1 + n > WIDTH {
            out.push('\n');
            out += &" ".repeat(indent);
            length = indent;
        } else if i > 0 {
            out.push(' ');
            length += 1;
        }
        out += word;
        length += n;
    }
    out.push('\n');
    out
}

/// The whole answer.
#[must_use]
pub fn diagnosis(d: &Diagnosis) -> String {
    let mut out = wrapped(&d.says, 0);
    if !d.candidates.is_empty() {
        out += &candidates(d);
    }
    for w in &d.depends {
        out += &wrapped(&format!("depends: {}", w.says), 2);
    }
    if let Some(shape) = &d.shape {
        out += &plot(shape);
        out += &wrapped(&format!("such a misfit comes from {}", shape.kind), 2);
    }
    for g in d.gross.iter().take(3) {
        out += &wrapped(&format!("tried: {}: {} um RMS would be left", g.says, significant(g.rms_um)), 2);
    }
    for o in &d.outliers {
        let back = if o.comes_back { "; it belongs to the rest once the first candidate is in the model" } else { "" };
        out += &wrapped(&format!("not used: touch {} of run {}: {}{back}", o.id, o.run, o.reason), 2);
    }
    let large: Vec<String> = d
        .power
        .iter()
        .take(MOST_POWER)
        .map(|p| format!("{} below {} um", p.effect, significant(p.minimal_detectable_um)))
        .collect();
    if !large.is_empty() {
        out += &wrapped(&format!("these touches could not have seen: {}", large.join(", ")), 2);
    }
    if !d.not_seen.is_empty() {
        out += &wrapped(&format!("no trace in these touches at any size: {}", d.not_seen.join(", ")), 2);
    }
    for w in &d.warnings {
        out += &wrapped(&format!("warning: {w}"), 2);
    }
    out
}

fn candidates(d: &Diagnosis) -> String {
    let mut t = table(&["candidate", "p (Holm)", "error um", "held out um", "share"]);
    for c in &d.candidates {
        let held = match (c.held_out_before_um, c.held_out_after_um) {
            (Some(before), Some(after)) => format!("{} > {}", significant(before), significant(after)),
            _ => "-".into(),
        };
        t.add_row(vec![
            Cell::new(if c.proposed { format!("* {}", c.effect) } else { c.effect.clone() }),
            number(probability(c.p_adjusted)),
            number(significant(c.rms_after_um)),
            number(held),
            number(format!("{:.0} %", 100.0 * c.share)),
        ]);
    }
    let mut out = format!("{t}\n");
    if d.candidates.iter().any(|c| c.proposed) {
        out += &wrapped(
            "* passes the test with all candidates counted in, and predicts touches that had no part in choosing it",
            2,
        );
    }
    for c in d.candidates.iter().filter(|c| c.p_adjusted < 1.0) {
        out += &wrapped(&format!("{}: {}", c.effect, sizes(c)), 2);
        if !c.same_as.is_empty() {
            out += &wrapped(&format!("  cannot be told from {}", c.same_as.join(", ")), 4);
        }
    }
    if let Some(first) = d.candidates.first() {
        out += &wrapped(&format!("{}: {}", first.name, first.says), 2);
        out += &wrapped(&format!("  look: {}", first.look), 4);
        if !first.tell_apart.is_empty() {
            out += &wrapped(&format!("  to tell apart: {}", first.tell_apart), 4);
        }
        if !first.plausible {
            out += "  its size would be unusual: look at the others of its group first\n";
        }
        for w in &first.weakens {
            out += &wrapped(
                &format!(
                    "  with it {} is known to {} {} only, instead of {}: a smaller error left over, and a less certain result",
                    w.name,
                    significant(w.sigma_after),
                    w.unit,
                    significant(w.sigma_before)
                ),
                4,
            );
        }
        if first.remains == Some(true) {
            out += "  with it in the model something else is still missing: add it and diagnose again\n";
        }
    }
    out
}

fn probability(p: f64) -> String {
    if p < 1e-3 { format!("{p:.0e}") } else { format!("{p:.3}") }
}

fn sizes(c: &Candidate) -> String {
    const MOST: usize = 4;
    let each = c.parameters.iter().take(MOST).map(|p| match p.sigma {
        Some(s) => format!("{} {} ± {} {}", p.name, digits(p.value, Some(s)), significant(s), p.unit),
        None => format!("{} {} {}", p.name, significant(p.value), p.unit),
    });
    let mut text = each.collect::<Vec<_>>().join(", ");
    if c.parameters.len() > MOST {
        text += ", …";
    }
    text
}

/// The misfit against its variable, in characters.
fn plot(s: &Shape) -> String {
    let (rows, columns) = PLOT;
    let (Some(&from), Some(&to)) = (s.x.first(), s.x.last()) else { return String::new() };
    let limit = s.y.iter().zip(&s.band).map(|(y, b)| y.abs() + b).fold(0.0, f64::max);
    if limit <= 0.0 || to <= from {
        return String::new();
    }
    let row =
        |y: f64| (((limit - y) / (2.0 * limit)) * (rows - 1) as f64).round().clamp(0.0, (rows - 1) as f64) as usize;
    let mut grid = vec![vec![' '; columns]; rows];
    grid[rows / 2].fill('·');
    for c in 0..columns {
        let i = c * (s.x.len() - 1) / (columns - 1);
        for line in grid.iter_mut().take(row(s.y[i] - s.band[i]) + 1).skip(row(s.y[i] + s.band[i])) {
            line[c] = '░';
        }
        grid[row(s.y[i])][c] = '█';
    }
    let mut out = format!("misfit against {} ({}), {}\n", s.by, s.x_unit, s.direction);
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
            if r == 0 { s.y_unit.as_str() } else { "" }
        );
    }
    let gap = columns.saturating_sub(significant(from).len() + significant(to).len());
    out += &format!("{} {}{}{}\n", " ".repeat(8), significant(from), " ".repeat(gap), significant(to));
    out
}
