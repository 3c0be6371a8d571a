//! A comparison as tables and plots, and as CSV.

use super::fit::{number, per_dof, significant, table};
use super::lay::lay;
use super::plot::{Paper, scatter};
use crate::compare::{Comparison, Split};
use comfy_table::Cell;

/// Splits whose groups are listed at most.
const LISTED: usize = 4;

/// A share below this is not worth a table of groups or a plot of its own.
const WORTH_SHOWING: f64 = 0.05;

/// The whole answer. `all` also lists groups and plots of what explains nothing.
#[must_use]
pub fn comparison(c: &Comparison, paper: Paper, all: bool) -> String {
    let missed = match c.missed {
        0 => String::new(),
        n => format!(" ({n} more cannot be used)"),
    };
    let mut out = format!(
        "{}: residual {} µm RMS over {} touches{missed}, noise {} µm; chi2/dof {}",
        c.machine,
        significant(c.rms_um),
        c.points.iter().filter(|p| p.used).count(),
        significant(c.noise_um),
        per_dof(c.chi2_per_dof, 2)
    );
    out += &c.held_out_rms_um.map_or_else(String::new, |h| format!("; cross-validated {} µm", significant(h)));
    let noise = super::prose::sentence(&format!("noise: {}", c.noise_says), paper.width, 0, 2);
    out += &format!("\n{noise}\n{}\n\n", c.says);
    let mut t = table(&["split by", "share", "groups", "result"]);
    for s in &c.splits {
        t.add_row(vec![
            Cell::new(&s.by),
            number(format!("{:.0} %", 100.0 * s.share)),
            number(if s.groups.is_empty() { "-".to_owned() } else { s.groups.len().to_string() }),
            Cell::new(paper.plain(s.says.clone())),
        ]);
    }
    lay(&mut t, paper.width.min(160), &[]);
    out += &format!("{t}\nshare: part of the residual beyond the noise; the splits overlap\n");
    let shown = |s: &&Split| !s.groups.is_empty() && (all || s.share >= WORTH_SHOWING);
    for s in c.splits.iter().filter(shown).take(if all { usize::MAX } else { LISTED }) {
        out += &format!("\n{}\n{}\n", s.by, groups(s, paper));
    }
    out += &format!("\nlargest residuals\n{}\n", worst(c, paper));
    for variable in plotted(c, all) {
        let points: Vec<(f64, f64)> =
            c.points.iter().filter(|p| p.used).filter_map(|p| Some((p.value(&variable)?, p.residual_um))).collect();
        out += &format!("\n{}", scatter(&format!("residual, µm, against {}", named(&variable)), &points, paper));
    }
    paper.plain(out)
}

fn groups(s: &Split, paper: Paper) -> String {
    let mut t = table(&["value", "touches", "mean, µm", "RMS, µm"]);
    for g in &s.groups {
        t.add_row(vec![
            number(paper.plain(g.value.clone())),
            number(g.n),
            number(format!("{:+.2}", g.mean_um)),
            number(format!("{:.2}", g.rms_um)),
        ]);
    }
    lay(&mut t, paper.width.min(60), &[]);
    t.to_string()
}

fn worst(c: &Comparison, paper: Paper) -> String {
    let mut t = table(&["run", "touch", "log line", "residual, µm", "sigmas", "block", "face", "pose", ""]);
    for w in &c.worst {
        let pose: Vec<String> = w.pose.iter().map(|(a, v)| format!("{a}{v:.1}")).collect();
        t.add_row(vec![
            number(w.run),
            number(w.id),
            number(w.line),
            number(format!("{:+.2}", w.residual_um)),
            number(if w.rejected.is_some() { "-".into() } else { format!("{:+.1}", w.standardised) }),
            Cell::new(paper.plain(w.block.clone())),
            Cell::new(paper.plain(w.face.clone())),
            Cell::new(pose.join(" ")),
            Cell::new(if w.rejected.is_some() { "not used" } else { "" }),
        ]);
    }
    lay(&mut t, paper.width.min(120), &[]);
    t.to_string()
}

/// What is worth a plot: rotary axes, and what else explains something; everything on request.
fn plotted(c: &Comparison, all: bool) -> Vec<String> {
    let share = |by: &str| c.splits.iter().filter(|s| s.by == by).map(|s| s.share).fold(0.0, f64::max);
    let varies = |variable: &str| {
        let mut values = c.points.iter().filter_map(|p| p.value(variable));
        let first = values.next();
        values.any(|v| first.is_some_and(|f| (v - f).abs() > 1e-9))
    };
    let axes = c.points.first().map(|p| p.axes.keys().cloned().collect::<Vec<_>>()).unwrap_or_default();
    let rotary = |a: &str| matches!(a, "A" | "B" | "C");
    let mut out: Vec<String> = Vec::new();
    let mut order: Vec<String> = axes.iter().rev().filter(|a| rotary(a)).cloned().collect();
    order.extend(axes.iter().filter(|a| !rotary(a)).cloned());
    order.extend(["time", "order", "approach"].map(str::to_owned));
    for variable in order {
        let by = if rotary(&variable) { format!("pose.{variable}") } else { variable.clone() };
        if varies(&variable) && (all || rotary(&variable) || share(&by) >= WORTH_SHOWING) {
            out.push(variable);
        }
    }
    out
}

fn named(variable: &str) -> String {
    match variable {
        "time" => "time, h".into(),
        "order" => "the order of the touches".into(),
        "approach" => "the approach about the probe's axis, deg".into(),
        "A" | "B" | "C" => format!("{variable}, deg"),
        linear => format!("{linear}, mm"),
    }
}

/// Every touch with what its residual may depend on, one line each, a header line first.
#[must_use]
pub fn csv(c: &Comparison) -> String {
    let axes: Vec<&String> = c.points.first().map(|p| p.axes.keys().collect()).unwrap_or_default();
    let mut head: Vec<&str> =
        vec!["run", "id", "line", "order", "residual_um", "standardised", "used", "stage", "block", "face", "visit"];
    head.extend(axes.iter().map(|a| a.as_str()));
    head.extend([
        "nx",
        "ny",
        "nz",
        "approach_deg",
        "time_h",
        "temperature_degC",
        "feed_mm_min",
        "spindle_deg",
        "stylus_mm",
    ]);
    let mut out = head.join(",") + "\n";
    for p in &c.points {
        let mut row: Vec<String> = [p.run, p.id as usize, p.line, p.order].iter().map(ToString::to_string).collect();
        row.extend([format!("{:.4}", p.residual_um), format!("{:.4}", p.standardised), u8::from(p.used).to_string()]);
        row.extend([quoted(&p.stage), quoted(&p.block), quoted(&p.face), p.visit.to_string()]);
        row.extend(axes.iter().map(|a| p.axes.get(*a).map_or_else(String::new, |v| format!("{v:.5}"))));
        row.extend(p.normal.iter().map(|n| format!("{n:.6}")));
        row.push(p.approach_deg.map_or_else(String::new, |d| format!("{d:.3}")));
        row.push(format!("{:.6}", p.time_h));
        row.push(p.temperature_deg_c.map_or_else(String::new, |t| format!("{t:.3}")));
        row.extend([p.feed_mm_min, p.spindle_deg, p.stylus_mm].map(|v| format!("{v:.4}")));
        out += &(row.join(",") + "\n");
    }
    out
}

/// A word as a CSV field.
fn quoted(word: &str) -> String {
    if word.contains([',', '"', '\n', '\r']) { format!("\"{}\"", word.replace('"', "\"\"")) } else { word.to_owned() }
}
