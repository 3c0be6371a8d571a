//! Raw touches → touches of the plan: by number where there is one, otherwise by place. What does not match is said.

use super::finding_places::{Capped, Places};
use super::parse::Rejected;
use super::position_rows::{self, RowForm};
use super::setup_mistakes;
use super::touch::{RawTouch, Status, Touch};
use crate::axes::{AxisName, Position};
use crate::diag::{Failure, Finding, Findings, Result};
use crate::machine::Machine;
use crate::program::plan::{Plan, PlanTouch};
use std::collections::BTreeMap;

/// A rotary axis that reads further from its pose than this (deg) did not make this touch.
pub(super) const POSE_ROOM_DEG: f64 = 0.5;

/// Matches touches to the plan. Positions are axis positions relative to R, mm and deg.
///
/// The touches come back in the order of the plan; each stands once. A log by columns is matched by place and order.
///
/// # Errors
/// When most touches cannot be this plan's: swapped columns, inches, another origin, another plan.
pub fn match_to_plan(machine: &Machine, plan: &Plan, raw: Vec<RawTouch>) -> Result<(Vec<Touch>, Findings)> {
    match_at(machine, plan, raw, RowForm::default(), None, &Rejected::default())
}

/// The same with places in the log for the findings, and what the rows are in a log of nothing but rows.
pub(super) fn match_at(
    machine: &Machine,
    plan: &Plan,
    raw: Vec<RawTouch>,
    form: RowForm<'_>,
    places: Option<&Places<'_>>,
    rejected: &Rejected,
) -> Result<(Vec<Touch>, Findings)> {
    let mut findings = Findings::default();
    let at = |finding: Finding, line: usize| match places {
        Some(places) => places.at_line(finding, line),
        None => Finding { message: format!("line {line}: {}", finding.message), ..finding },
    };
    let mut rejected = rejected.clone();
    let raw = if raw.iter().any(|t| t.id.is_none()) {
        let numbered = position_rows::number(machine, plan, raw, form, &at);
        findings.0.extend(numbered.findings);
        if findings.has_errors() {
            return Err(Failure(findings.0));
        }
        rejected.ids.extend(numbered.unclear);
        numbered.touches
    } else {
        raw
    };
    let by_id: BTreeMap<u64, &PlanTouch> = plan.touches.iter().map(|t| (t.id, t)).collect();
    let mut unknown = Capped::default();
    let mut twice = Capped::few();
    let mut known: BTreeMap<u64, RawTouch> = BTreeMap::new();
    for touch in raw {
        let line = touch.line;
        let Some(id) = touch.id else { continue };
        if !by_id.contains_key(&id) {
            unknown.push(|| {
                let message = format!("touch {id} is not in the plan; it is not used");
                at(
                    Finding::warning("log::unmatched", message)
                        .help("is this the plan that the program was made with?"),
                    line,
                )
            });
            continue;
        }
        if let Some(older) = known.insert(id, touch) {
            twice.push(|| {
                let message =
                    format!("touch {id} appears twice, in lines {} and {line}: the later one is used", older.line);
                at(
                    Finding::warning("log::twice", message)
                        .help("this is normal after a restart at a set-up: a line H with its number U stands between"),
                    line,
                )
            });
        }
    }
    findings.0.extend(unknown.drain("touches that are not in the plan", "log::unmatched"));
    findings.0.extend(twice.drain("touches that stand twice", "log::twice"));

    let pairs: Vec<(&PlanTouch, RawTouch)> =
        plan.touches.iter().filter_map(|t| known.remove(&t.id).map(|raw| (t, raw))).collect();
    let good: Vec<bool> =
        pairs.iter().map(|(planned, raw)| fits(machine, planned, &complete(planned, raw), raw.present)).collect();
    let bad = good.iter().filter(|g| !**g).count();
    if bad > 1 && bad * 2 > pairs.len() {
        let line = pairs.first().map_or(1, |(_, raw)| raw.line);
        findings.push(at(setup_mistakes::explain(machine, &pairs, bad), line));
        return findings.finish(Vec::new());
    }
    if let Some(finding) = setup_mistakes::hint(machine, &pairs) {
        findings.push(finding);
    }
    let mut implausible = Capped::few();
    let mut touches = Vec::with_capacity(pairs.len());
    let mut missed = Capped::default();
    for ((planned, raw), good) in pairs.iter().zip(good) {
        let position = complete(planned, raw);
        if !good {
            implausible.push(|| at(not_here(machine, planned, &position), raw.line));
        }
        if good && raw.status == Status::Miss {
            missed.push(|| {
                let message = format!(
                    "touch {} (block {}, face {}) was missed: the probe did not trigger",
                    planned.id, planned.block, planned.face
                );
                let help = "it is kept as a miss and not used; is the block there, is the probe switched on?";
                at(Finding::warning("log::missed", message).help(help), raw.line)
            });
        }
        touches.push(Touch {
            id: planned.id,
            position,
            status: if good { raw.status } else { Status::Elsewhere },
            time_s: raw.time_s,
            digit_mm: None,
            temperature_deg_c: raw.temperature_deg_c,
            line: raw.line,
        });
    }
    findings.0.extend(implausible.drain("touches far from their places", "log::implausible"));
    findings.0.extend(missed.drain("missed touches", "log::missed"));
    let have: std::collections::BTreeSet<u64> = pairs.iter().map(|(t, _)| t.id).collect();
    let missing: Vec<u64> = plan.touches.iter().map(|t| t.id).filter(|id| !have.contains(id)).collect();
    if !missing.is_empty() {
        let message = not_read(&missing, plan.touches.len(), &rejected);
        findings.push(
            Finding::warning("log::missing", message)
                .help("the rest is used; `axiscal identify` says what cannot be determined with it"),
        );
    }
    if touches.iter().all(|t| t.status == Status::Elsewhere) {
        findings.push(
            Finding::error("log::no_match", "no touch of the log can be used with this plan")
                .help("is this the plan that the program was made with?"),
        );
    }
    findings.finish(touches)
}

/// Touches without a usable line: those whose line is there but was rejected, and those that are not there.
fn not_read(missing: &[u64], planned: usize, rejected: &Rejected) -> String {
    let (damaged, absent): (Vec<u64>, Vec<u64>) = missing.iter().partition(|id| rejected.ids.contains(id));
    let mut parts = Vec::new();
    if !damaged.is_empty() {
        parts.push(format!(
            "{} of the plan's {planned} touches {}, but {} not used (see above): {}",
            damaged.len(),
            if damaged.len() == 1 { "is in the log" } else { "are in the log" },
            if damaged.len() == 1 { "its line is" } else { "their lines are" },
            ranges(&damaged)
        ));
    }
    if !absent.is_empty() {
        let unless = if rejected.unnamed { ", or only in lines that are not used (see above)" } else { "" };
        parts.push(format!(
            "{} of the plan's {planned} touches {} not in the log{unless}: {}",
            absent.len(),
            if absent.len() == 1 { "is" } else { "are" },
            ranges(&absent)
        ));
    }
    parts.join("; ")
}

/// The axis positions of a touch; axes that the log lacks stand at the plan's pose.
fn complete(planned: &PlanTouch, raw: &RawTouch) -> Position {
    let mut position = planned.nominal_position();
    for axis in AxisName::ALL {
        if raw.present[axis.index()] {
            position.set(axis, raw.position.get(axis));
        }
    }
    position
}

/// How far from its nominal place a touch can trigger: overtravel of the stylus and placement of the block, mm.
pub(super) fn room_mm(machine: &Machine) -> f64 {
    machine.probe.overtravel + machine.probe.placement_tolerance
}

/// By how much the rotary axes that a log holds differ at most, deg.
pub(super) fn turned_deg(machine: &Machine, one: &Position, other: &Position, present: [bool; 6]) -> f64 {
    let differ =
        machine.rotary().filter(|a| present[a.name.index()]).map(|a| (one.get(a.name) - other.get(a.name)).abs());
    differ.fold(0.0, f64::max)
}

/// Can this position be that touch?
pub(super) fn fits(machine: &Machine, planned: &PlanTouch, position: &Position, present: [bool; 6]) -> bool {
    let nominal = planned.nominal_position();
    let off = (position.xyz_mm() - nominal.xyz_mm()).norm();
    let turned = turned_deg(machine, position, &nominal, present);
    // comparisons are written so that a NaN does not fit
    off <= room_mm(machine) && turned <= POSE_ROOM_DEG
}

fn not_here(machine: &Machine, planned: &PlanTouch, position: &Position) -> Finding {
    let nominal = planned.nominal_position();
    let (axis, found, wanted) = AxisName::ALL
        .into_iter()
        .filter(|a| machine.axis(*a).is_some())
        .map(|a| (a, position.get(a), nominal.get(a)))
        .max_by(|a, b| (a.1 - a.2).abs().total_cmp(&(b.1 - b.2).abs()))
        .unwrap_or((AxisName::X, 0.0, 0.0));
    let message = format!(
        "touch {} reads {axis} {found:.3}, expected about {wanted:.3}: too far away to be this touch; it is not used",
        planned.id
    );
    Finding::warning("log::implausible", message).help(format!(
        "a touch may lie up to {:.1} mm from its nominal place (overtravel and placement tolerance)",
        room_mm(machine)
    ))
}

/// `1-5, 9, 12-14`
pub(super) fn ranges(ids: &[u64]) -> String {
    let mut out: Vec<String> = Vec::new();
    let mut rest = ids;
    while let Some((first, _)) = rest.split_first() {
        let run = 1 + rest.windows(2).take_while(|pair| pair[0].checked_add(1) == Some(pair[1])).count();
        out.push(if run > 1 { format!("{first}-{}", rest[run - 1]) } else { first.to_string() });
        rest = &rest[run..];
        if out.len() == 8 && !rest.is_empty() {
            out.push(format!("and {} more", rest.len()));
            break;
        }
    }
    out.join(", ")
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn ranges_are_short() {
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10]), "1-3, 7, 9-10");
        assert_eq!(ranges(&[]), "");
        assert_eq!(ranges(&[u64::MAX]), u64::MAX.to_string());
        assert_eq!(ranges(&(0..30).map(|i| i * 2).collect::<Vec<_>>()), "0, 2, 4, 6, 8, 10, 12, 14, and 22 more");
    }
}
