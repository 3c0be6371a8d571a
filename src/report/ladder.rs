//! A changed model, the ladder of models, and two studies side by side.

use super::fit::{digits, number, per_dof, significant, table};
use super::lay::lay;
use super::plot::{Paper, line};
use super::prose::sentence;
use crate::compare::change::Change;
use crate::compare::verify::Verification;
use crate::fit::outcome::Outcome;
use crate::study::history::History;
use comfy_table::Cell;
use std::collections::BTreeSet;

fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".into(), significant)
}

fn stated(value: Option<(f64, f64)>) -> String {
    value.map_or_else(|| "?".into(), |(v, s)| format!("{} ± {}", digits(v, Some(s)), significant(s)))
}

/// How far figures of touches left out can be trusted.
#[derive(Debug, Clone, Copy, Default)]
pub struct HeldOutDoubt {
    /// Standard errors before and after, µm.
    pub standard_errors: (Option<f64>, Option<f64>),
    /// By how much it falls, with the standard error, µm.
    pub fall: Option<(f64, f64)>,
    /// The same error where the choice was redone for each group left out, µm; none where a person chose.
    pub nested_rms_um: Option<f64>,
    /// Groups of touches that were left out in turn.
    pub n_groups: usize,
}

/// A standard error: two digits, as many as it knows itself.
fn two_digits(se: f64) -> String {
    digits(se, Some(se))
}

/// A figure with its standard error.
fn with_error(value: Option<f64>, se: Option<f64>) -> String {
    match (value, se) {
        (Some(v), Some(s)) => format!("{} ± {}", digits(v, Some(s)), two_digits(s)),
        (value, _) => or_dash(value),
    }
}

/// Before and after a change of the model.
#[must_use]
pub fn change(
    (before, after): (&Outcome, &Outcome),
    c: &Change,
    later: (Option<f64>, Option<f64>),
    doubt: &HeldOutDoubt,
    paper: Paper,
) -> String {
    let mut t = table(&["", "before", "after"]);
    let mut row = |what: &str, b: String, a: String| {
        t.add_row(vec![Cell::new(what), number(b), number(a)]);
    };
    row("residual, µm RMS", significant(before.rms_um), significant(after.rms_um));
    row(
        "cross-validated, µm RMS",
        with_error(before.held_out_rms_um, doubt.standard_errors.0),
        with_error(after.held_out_rms_um, doubt.standard_errors.1),
    );
    if doubt.nested_rms_um.is_some() {
        row("  choice repeated, µm RMS", "-".into(), or_dash(doubt.nested_rms_um));
    }
    if later.0.is_some() || later.1.is_some() {
        row("on the last run, µm RMS", or_dash(later.0), or_dash(later.1));
    }
    row("chi2/dof", per_dof(before.chi2_per_dof, 3), per_dof(after.chi2_per_dof, 3));
    row("unknowns", before.unknowns.to_string(), after.unknowns.to_string());
    for p in &c.kept {
        let unit = &p.unit;
        row(&format!("{}, {unit}", p.name), stated(p.before), stated(p.after));
    }
    lay(&mut t, paper.width.min(100), &[]);
    let mut out =
        format!("{t}\n± in this table: one standard uncertainty, or one standard error of the cross-validated error\n");
    if other_noise((before.noise_um, before.visit_um), (after.noise_um, after.visit_um)) {
        let line = format!(
            "chi2/dof uses the noise that each fit finds: touch {} and index position {} µm before, {} and {} µm after",
            significant(before.noise_um),
            significant(before.visit_um),
            significant(after.noise_um),
            significant(after.visit_um)
        );
        out += &format!("{}\n", sentence(&line, paper.width, 0, 0));
    }
    // less than a thousandth of a nanometre is the arithmetic's
    const NOTHING_UM: f64 = 1e-6;
    let not_used = |o: &Outcome| o.rejected.iter().map(|r| (r.run, r.id)).collect::<BTreeSet<_>>();
    let others = not_used(before) != not_used(after);
    if others && after.unknowns > before.unknowns && after.rms_um > before.rms_um + NOTHING_UM {
        let line = format!(
            "the residual rises, because other touches are not used: {} before, {} after. Look at them before you keep this effect",
            before.rejected.len(),
            after.rejected.len()
        );
        out += &format!("{}\n", sentence(&line, paper.width, 0, 0));
    }
    if doubt.fall.is_some_and(|(fall, _)| fall.abs() < NOTHING_UM) {
        out += "the cross-validated error stays the same: the change has no effect on these touches\n";
    } else if let Some((fall, se)) = doubt.fall {
        let how = if doubt.nested_rms_um.is_some() { "" } else { "; you chose the effect with all touches known" };
        out += &format!(
            "the cross-validated error {} by {} ± {} µm (one standard error, {} index positions{how})\n",
            if fall < 0.0 { "rises" } else { "falls" },
            digits(fall.abs(), Some(se)),
            two_digits(se),
            doubt.n_groups
        );
    }
    if !c.new.is_empty() {
        let mut t = table(&["new", "value", "unit", "std. unc.", "95 %"]);
        for p in &c.new {
            t.add_row(vec![
                Cell::new(&p.name),
                number(if p.sigma.is_some() { digits(p.value, p.sigma) } else { "?".into() }),
                Cell::new(super::fit::unit(&p.unit)),
                number(or_dash(p.sigma)),
                number(p.expanded.map_or_else(|| "-".into(), |e| format!("± {}", significant(e)))),
            ]);
        }
        lay(&mut t, paper.width.min(100), &[]);
        out += &format!("\n{t}\n");
    }
    for r in &c.remarks {
        out += &format!("note: {r}\n");
    }
    paper.plain(out)
}

/// Do two fits hold what is left against another noise, so that their chi2/dof cannot be compared? µm.
fn other_noise(before: (f64, f64), after: (f64, f64)) -> bool {
    /// A difference that shows in chi2/dof, as a share of the noise of a touch.
    const SHOWS: f64 = 0.05;
    let room = SHOWS * before.0.max(after.0);
    (before.0 - after.0).abs() > room || (before.1 - after.1).abs() > room
}

/// The ladder as a table and a chart.
#[must_use]
pub fn history(h: &History, paper: Paper) -> String {
    // only where the search chose there is a nested figure
    let nested = h.steps.iter().any(|s| s.nested_rms_um.is_some());
    let mut head = vec!["step", "change", "residual, µm", "cross-validated, µm", "later run, µm", "chi2/dof"];
    if nested {
        head.insert(4, "choice repeated, µm");
    }
    let mut t = table(&head);
    for s in &h.steps {
        let signed = |sign: &str, ids: &[String]| ids.iter().map(|e| format!("{sign}{e}")).collect::<Vec<_>>();
        let mut what = signed("+", &s.added);
        what.extend(signed("-", &s.removed));
        let first = if s.step == 1 { s.effects.join(" ") } else { what.join(" ") };
        let mut row = vec![
            number(s.step),
            Cell::new(first),
            number(significant(s.rms_um)),
            number(with_error(s.held_out_rms_um, s.held_out_se_um)),
            number(or_dash(s.later_run_rms_um)),
            number(per_dof(s.chi2_per_dof, 3)),
        ];
        if nested {
            row.insert(4, number(or_dash(s.nested_rms_um)));
        }
        t.add_row(row);
    }
    lay(&mut t, paper.width.min(120), &[]);
    let note = if nested {
        "cross-validated: each index position is left out of the fit in turn, ± one standard error; choice repeated: the effect is \
         chosen anew each time as well (-: a person chose it with all touches known)"
    } else {
        "cross-validated: each index position is left out of the fit in turn, ± one standard error; the effects were chosen with \
         all touches known"
    };
    let noises: Vec<(usize, f64, f64)> =
        h.steps.iter().filter_map(|s| Some((s.step, s.noise_um?, s.visit_um?))).collect();
    let changed = noises.windows(2).any(|w| other_noise((w[0].1, w[0].2), (w[1].1, w[1].2)));
    let noise_note = match changed {
        true => {
            let each = noises
                .iter()
                .map(|(k, noise, visit)| format!("{k}: {} and {}", significant(*noise), significant(*visit)));
            let line = format!(
                "chi2/dof uses the noise of a touch and of index positions that each fit finds, µm: step {}",
                each.collect::<Vec<_>>().join("; ")
            );
            sentence(&line, paper.width, 0, 0) + "\n"
        }
        false => String::new(),
    };
    let points = |value: &dyn Fn(&crate::study::history::Step) -> Option<f64>| -> Vec<(f64, f64)> {
        h.steps.iter().filter_map(|s| Some((s.step as f64, value(s)?))).collect()
    };
    let mut out = format!("{t}\n{}\n{noise_note}", sentence(note, paper.width, 0, 0));
    for (title, p) in [
        ("residual, µm RMS, by step", points(&|s| Some(s.rms_um))),
        ("cross-validated error, µm RMS, by step", points(&|s| s.held_out_rms_um)),
    ] {
        let drawn = line(title, &p, paper);
        if !drawn.is_empty() {
            out += &format!("\n{drawn}");
        }
    }
    paper.plain(out)
}

/// Two studies side by side.
#[must_use]
pub fn verification(v: &Verification, paper: Paper) -> String {
    let mut out = format!("{}\n{}\n\n", v.machine, v.says);
    let mut t = table(&["", "before", "after"]);
    let mut row = |what: &str, b: f64, a: f64| {
        t.add_row(vec![Cell::new(what), number(significant(b)), number(significant(a))]);
    };
    row("readings, blocks placed, µm RMS", v.before.readings_rms_um, v.after.readings_rms_um);
    row("residual of the model, µm RMS", v.before.fit_rms_um, v.after.fit_rms_um);
    row("noise of a touch, µm", v.before.noise_um, v.after.noise_um);
    lay(&mut t, paper.width.min(100), &[]);
    out += &format!("{t}\n\n");
    let mut t = table(&["error", "unit", "before", "after", "difference", "95 %", ""]);
    for r in &v.parameters {
        t.add_row(vec![
            Cell::new(&r.name),
            Cell::new(&r.unit),
            number(digits(r.before.0, Some(r.before.1))),
            number(digits(r.after.0, Some(r.after.1))),
            number(digits(r.difference, Some(r.expanded))),
            number(format!("± {}", significant(r.expanded))),
            Cell::new(match (v.models_differ(), r.changed) {
                (true, _) => "models differ",
                (_, true) => "changed",
                _ => "not changed",
            }),
        ]);
    }
    lay(&mut t, paper.width.min(110), &[]);
    out += &format!("{t}\n");
    for r in &v.remarks {
        out += &format!("note: {r}\n");
    }
    paper.plain(out)
}
