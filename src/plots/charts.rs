//! What of a view is drawn, in files and on the page.

use super::chart::{Axis, Chart, Dash, Ink, Look, Mark, Model, Pen, Point, Shape};
use super::machine;
use super::on_paper::{solid, used};
use crate::compare::model_ladder::{Curve, Kind};
use crate::diagnose::Verdict;
use crate::diagnose::answer::Candidate;
use crate::fit::outcome::Status;
use crate::report::fit::{digits, significant, with_unit};
use crate::view::View;
use crate::view::record::{Judgement, ParameterRecord, RungRecord, Standing, Variable};

/// More results than this are in the table, not in the plot.
const MOST_RESULTS: usize = 12;

/// The plots of a view.
#[must_use]
pub fn charts(view: &View) -> Vec<Chart> {
    let mut out = vec![errors(view), results(view), ladder(view)];
    out.extend(view.variables.iter().map(|v| residuals(view, v)));
    out.push(machine::machine(view));
    if !view.diagnosis.answer.candidates.is_empty() {
        out.push(candidates(view));
    }
    if view.correlation.names.len() > 1 {
        out.push(correlation(view));
    }
    out
}

pub(super) fn chart(name: &str, title: impl Into<String>, x: Axis, y: Axis) -> Chart {
    Chart {
        name: name.to_owned(),
        title: title.into(),
        says: String::new(),
        x,
        y,
        downwards: false,
        picture: None,
        legend: false,
        aspect: 0.6,
        marks: Vec::new(),
        csv: None,
    }
}

fn point(x: f64, y: f64, note: impl Into<String>) -> Point {
    Point { x, y, note: note.into() }
}

fn look(ink: Ink, shape: Shape, filled: bool) -> Look {
    Look { ink, shape, filled, size: 7, opacity: 1.0 }
}

const DASHED: Pen = Pen { ink: Ink::Ink, width: 2, dash: Dash::Dash };

/// A number with the sign that print has.
pub(super) fn minus(number: String) -> String {
    number.replace('-', "\u{2212}")
}

/// An error with three digits; as many unknowns as touches leave nothing but the computer's rounding.
fn um(value: f64) -> String {
    format!("{} µm", if value.abs() < 5e-4 { "0".to_owned() } else { minus(significant(value)) })
}

fn noise(view: &View, upright: bool) -> Mark {
    let at = view.errors.noise_um;
    Mark::Rule { series: format!("probe noise {}", um(at)), pen: DASHED, at, upright }
}

/// The cross-validated errors, where there are any.
fn cross_validated(points: Vec<Point>, ink: Ink) -> Option<Mark> {
    let series = "cross-validated".to_owned();
    (!points.is_empty()).then(|| Mark::Points { series, look: look(ink, Shape::Diamond, false), points })
}

fn highest(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|v| v.is_finite()).fold(0.0, f64::max)
}

fn errors(view: &View) -> Chart {
    let mut rungs = vec![view.errors.before, view.errors.after];
    rungs.dedup();
    let rungs: Vec<&RungRecord> = rungs.into_iter().filter_map(|i| view.ladder.get(i)).collect();
    let held = || rungs.iter().filter_map(|r| r.held_out_rms_um);
    let top = 1.12 * highest(rungs.iter().map(|r| r.rms_um).chain(held()).chain([view.errors.noise_um]));
    let name = |(i, r): (usize, &&RungRecord)| {
        let model = match (i, r.kind) {
            (0, Kind::Uncorrected) => "the machine\nuncorrected".to_owned(),
            (0, _) => "before\n(model now)".to_owned(),
            (_, Kind::Proposed) => format!("after, with\n{}", r.added.join(", ")),
            _ => "after\n(remaining)".to_owned(),
        };
        format!("{model}\n{}", um(r.rms_um))
    };
    let names: Vec<String> = rungs.iter().enumerate().map(name).collect();
    let x = Axis::new("error of the touches (RMS), µm", (0.0, top)).or("error (RMS), µm");
    let said: Vec<String> = names.iter().map(|n| n.replace('\n', " ")).collect();
    let mut c = chart("error", "The error before and after", x, Axis::named(names));
    c.says = format!("Error of the touches: {}; the probe noise is {}.", said.join("; "), um(view.errors.noise_um));
    c.downwards = true;
    c.aspect = 0.35;
    for (i, rung) in rungs.iter().enumerate() {
        let first = i == 0;
        let i = i as f64;
        c.marks.push(Mark::Area {
            series: if first { "before" } else { "after" }.to_owned(),
            ink: if first { Ink::Red } else { Ink::Blue },
            opacity: 1.0,
            x: (0.0, rung.rms_um),
            y: (i - 0.25, i + 0.25),
        });
    }
    let held = rungs.iter().enumerate().filter_map(|(i, r)| Some(point(r.held_out_rms_um?, i as f64, "")));
    c.marks.extend(cross_validated(held.collect(), Ink::Ink));
    c.marks.push(noise(view, true));
    let mut csv = String::from("what,rms_um,held_out_rms_um\n");
    for r in &rungs {
        let held = r.held_out_rms_um.map_or_else(String::new, |h| h.to_string());
        csv += &format!("{},{},{held}\n", super::chart::field(&r.label), r.rms_um);
    }
    csv += &format!("probe's noise,{},\n", view.errors.noise_um);
    c.csv = Some(csv);
    c
}

/// The results that are largest beside their tolerance, in their order.
fn shown(list: &[ParameterRecord], limit_um: f64) -> Vec<&ParameterRecord> {
    let sized = list.iter().filter(|p| p.at_radius_um.is_some() && p.status != Status::Undetermined);
    let mut sized: Vec<(usize, &ParameterRecord)> = sized.enumerate().collect();
    let ratio = |p: &ParameterRecord| p.at_radius_um.unwrap_or(0.0).abs() / p.tolerance_um.unwrap_or(limit_um);
    sized.sort_by(|a, b| ratio(b.1).total_cmp(&ratio(a.1)));
    sized.truncate(MOST_RESULTS);
    sized.sort_by_key(|(place, _)| *place);
    sized.into_iter().map(|(_, p)| p).collect()
}

fn results(view: &View) -> Chart {
    let list = if view.proposed.is_empty() { &view.parameters } else { &view.proposed };
    let shown = shown(list, view.tolerance.error_um);
    let doubt = |p: &ParameterRecord| p.at_radius_expanded_um.unwrap_or(0.0);
    let at = |p: &ParameterRecord| p.at_radius_um.unwrap_or(0.0);
    let furthest = shown.iter().map(|p| at(p).abs() + doubt(p)).chain(shown.iter().filter_map(|p| p.tolerance_um));
    let reach = 1.08 * highest(furthest.chain([view.tolerance.error_um]));
    let mut names: Vec<String> = shown.iter().map(|p| format!("{} ({})", p.says, p.name)).collect();
    if names.is_empty() {
        names.push("no error can be determined".to_owned());
    }
    let title = format!("error at {} mm, µm", view.tolerance.radius_mm);
    let x = Axis::new(format!("{title} (bar: 95 %)"), (-reach, reach)).or(&title);
    let partly = view.diagnosis.answer.verdict != Verdict::Adequate && view.proposed.is_empty();
    let title = if partly {
        "The machine's errors against the tolerance: these values include part of the missing error"
    } else {
        "The machine's errors against the tolerance"
    };
    let mut c = chart("results", title, x, Axis::named(names));
    let each = shown.iter().map(|p| {
        let expanded = p.at_radius_expanded_um.map_or_else(String::new, |doubt| format!(" ± {}", um(doubt)));
        format!("{} {}{expanded} ({})", p.name, um(at(p)), p.judgement.says())
    });
    c.says = match &each.collect::<Vec<_>>()[..] {
        [] => "These touches determine no error of the machine.".to_owned(),
        each => {
            let t = &view.tolerance;
            format!("{title} of {} µm at {} mm: {}.", t.error_um, t.radius_mm, each.join("; "))
        }
    };
    c.downwards = true;
    c.aspect = (0.22 + 0.032 * shown.len() as f64).clamp(0.4, 1.1);
    for (i, t) in shown.iter().enumerate().filter_map(|(i, p)| Some((i as f64, p.tolerance_um?))) {
        let (series, x, y) = ("tolerance".to_owned(), (-t, t), (i - 0.5, i + 0.5));
        c.marks.push(Mark::Area { series, ink: Ink::Band, opacity: 1.0, x, y });
    }
    let now = shown.iter().enumerate().filter_map(|(i, p)| {
        let now = view.parameters.iter().find(|q| q.name == p.name && !view.proposed.is_empty())?;
        Some(point(now.at_radius_um?, i as f64, "with the model as it is"))
    });
    let now: Vec<Point> = now.collect();
    if !now.is_empty() {
        // a tick, which no judgement's mark looks like, and which none covers
        let look = Look { size: 9, ..look(Ink::Ink, Shape::Tick, false) };
        c.marks.push(Mark::Points { series: "with the model as it is".to_owned(), look, points: now });
    }
    let bars = shown
        .iter()
        .enumerate()
        .flat_map(|(i, p)| [at(p) - doubt(p), at(p) + doubt(p), f64::NAN].map(|x| point(x, i as f64, "")));
    c.marks.push(Mark::Line { series: String::new(), pen: solid(Ink::Ink, 2), points: bars.collect() });
    for (judgement, ink, shape) in [
        (Judgement::Within, Ink::Blue, Shape::Circle),
        (Judgement::Beyond, Ink::Red, Shape::Diamond),
        (Judgement::Open, Ink::Orange, Shape::Square),
        (Judgement::None, Ink::Muted, Shape::Cross),
    ] {
        let of = |(i, p): (usize, &&ParameterRecord)| {
            let value = with_unit(minus(digits(p.value, p.sigma)), &p.unit);
            let note = match p.expanded {
                Some(expanded) => {
                    format!("{}: {value} ± {} (95 %); at the radius:", p.name, minus(digits(expanded, p.sigma)))
                }
                None => format!("{}: {value}; at the radius:", p.name),
            };
            (p.judgement == judgement).then(|| point(at(p), i as f64, note))
        };
        let points: Vec<Point> = shown.iter().enumerate().filter_map(of).collect();
        if !points.is_empty() {
            c.marks.push(Mark::Points { series: judgement.says().to_owned(), look: look(ink, shape, true), points });
        }
    }
    let mut csv =
        String::from("parameter,what,value,unit,sigma,expanded,at_radius_um,at_radius_expanded_um,tolerance_um\n");
    let number = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    for p in list {
        csv += &format!(
            "{},{},{},{},{},{},{},{},{}\n",
            super::chart::field(&p.name),
            super::chart::field(&p.says),
            p.value,
            p.unit,
            number(p.sigma),
            number(p.expanded),
            number(p.at_radius_um),
            number(p.at_radius_expanded_um),
            number(p.tolerance_um)
        );
    }
    c.csv = Some(csv);
    c
}

fn ladder(view: &View) -> Chart {
    let all: Vec<f64> = view
        .ladder
        .iter()
        .flat_map(|r| [Some(r.rms_um), r.held_out_rms_um])
        .flatten()
        .chain([view.errors.noise_um])
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    let (low, high) = (all.iter().copied().fold(f64::INFINITY, f64::min), highest(all.iter().copied()));
    let log = high > 12.0 * low;
    let range = if log { (0.6 * low, 1.8 * high) } else { (0.0, 1.15 * high) };
    let y = Axis { log, ..Axis::new("remaining error (RMS), µm", range).or("RMS, µm") };
    let names = view.ladder.iter().map(|r| r.label.replace(" +", "\n+")).collect();
    let mut c = chart("ladder", "Step by step to the noise", Axis::named(names), y);
    let each: Vec<String> = view.ladder.iter().map(|r| format!("{} {}", r.label, um(r.rms_um))).collect();
    c.says =
        format!("Remaining error of each model: {}; the probe noise is {}.", each.join(", "), um(view.errors.noise_um));
    c.legend = true;
    let mut stairs: Vec<Point> = Vec::new();
    for (i, r) in view.ladder.iter().enumerate() {
        if let Some(last) = stairs.last().map(|p| p.y) {
            stairs.push(point(i as f64, last, ""));
        }
        stairs.push(point(i as f64, r.rms_um, r.label.clone()));
    }
    c.marks.push(Mark::Line { series: "fitted".to_owned(), pen: solid(Ink::Blue, 3), points: stairs });
    for (i, r) in view.ladder.iter().enumerate() {
        let look = look(Ink::Blue, Shape::Circle, r.kind != Kind::Proposed);
        let points = vec![point(i as f64, r.rms_um, r.label.clone())];
        c.marks.push(Mark::Points { series: String::new(), look, points });
        c.marks.push(Mark::Word { text: minus(significant(r.rms_um)), at: (i as f64, r.rms_um) });
    }
    let held =
        view.ladder.iter().enumerate().filter_map(|(i, r)| Some(point(i as f64, r.held_out_rms_um?, r.label.clone())));
    c.marks.extend(cross_validated(held.collect(), Ink::Red));
    c.marks.push(noise(view, false));
    let mut csv = String::from("step,model,effects,rms_um,held_out_rms_um,chi2_per_dof,unknowns\n");
    for (i, r) in view.ladder.iter().enumerate() {
        let held = r.held_out_rms_um.map_or_else(String::new, |h| h.to_string());
        csv += &format!(
            "{i},{},{},{},{held},{},{}\n",
            super::chart::field(&r.label),
            super::chart::field(&r.effects.join(" ")),
            r.rms_um,
            r.chi2_per_dof,
            r.unknowns
        );
    }
    c.csv = Some(csv);
    c
}

/// Directions of R: letter, and how points and line look.
const DIRECTIONS: [(&str, Ink, Shape, Dash); 3] = [
    ("X", Ink::Blue, Shape::Circle, Dash::Solid),
    ("Y", Ink::Red, Shape::Square, Dash::Dash),
    ("Z", Ink::Green, Shape::Triangle, Dash::Dot),
];

fn residuals(view: &View, variable: &Variable) -> Chart {
    let t = &view.touches;
    let (from, to) = (view.errors.before, view.errors.after);
    let along = variable.id == "approach";
    let used: Vec<usize> = used(view).filter(|i| t.value(&variable.id, *i).is_some()).collect();
    let xs: Vec<f64> = used.iter().filter_map(|i| t.value(&variable.id, *i)).collect();
    let low = xs.iter().copied().fold(f64::INFINITY, f64::min);
    let high = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = 0.04 * (high - low);
    let noise = 2.0 * view.errors.noise_um;
    let added = |q: &&Curve| q.variable == variable.id && (q.from, q.to) == (from, to);
    let missed = used.iter().flat_map(|i| [t.residual_um[from][*i].abs(), t.residual_um[to][*i].abs()]);
    // a line between the touches may go further than any of them
    let drawn = view.curves.iter().filter(added).flat_map(|q| q.y_um.iter().map(|y| y.abs()));
    let reach = 1.08 * highest(missed.chain(drawn).chain([noise]));
    let title = if along { "residual along the face, µm" } else { "residual, µm" };
    let x = Axis::new(variable.title.clone(), (low - room, high + room));
    let x = Axis { variable: Some(variable.id.clone()), ..x };
    let name = format!("residual-{}", variable.id.to_lowercase());
    let y = Axis::new(title, (-reach, reach)).or("residual, µm");
    let mut c = chart(&name, format!("Residual against the {}", variable.title), x, y);
    let share = variable
        .share
        .map_or_else(String::new, |share| format!(" {:.0} % of the unexplained error depends on it.", 100.0 * share));
    c.says = format!("Residuals in µm against {}.{share}", variable.title);
    c.marks.push(Mark::Area {
        series: "twice the noise".to_owned(),
        ink: Ink::Band,
        opacity: 1.0,
        x: (f64::NEG_INFINITY, f64::INFINITY),
        y: (-noise, noise),
    });
    let each = DIRECTIONS.iter().enumerate().map(|(d, look)| (Some(d), look));
    let kinds: Vec<_> =
        if along { vec![(None, &("", Ink::Purple, Shape::Diamond, Dash::Solid))] } else { each.collect() };
    for (direction, &(letter, ink, shape, dash)) in kinds {
        let series = |word: &str| format!("{letter} {word}").trim_start().to_owned();
        let mut add = |model: Model, word: &str, filled: bool, opacity: f64| {
            let look = Look { ink, shape, filled, size: if filled { 3 } else { 5 }, opacity };
            c.marks.push(Mark::Touches { series: series(word), look, direction, model });
        };
        add(Model::Before, "before", false, 0.45);
        add(Model::After, "after", true, 0.85);
        c.marks.push(Mark::Added { series: series("added"), pen: Pen { ink, width: 3, dash }, direction });
    }
    c
}

fn candidates(view: &View) -> Chart {
    let d = &view.diagnosis.answer;
    let top = 1.12
        * highest(
            d.candidates.iter().flat_map(|k| [k.rms_after_um, k.held_out_after_um.unwrap_or(0.0)]).chain([d.rms_um]),
        );
    let y = Axis::named(d.candidates.iter().map(|k| k.name.clone()).collect());
    let x = Axis::new("remaining error (RMS), µm", (0.0, top)).or("RMS, µm");
    let mut c = chart("candidates", "Remaining error with each candidate", x, y);
    let each: Vec<String> = d.candidates.iter().map(|k| format!("{} {}", k.name, um(k.rms_after_um))).collect();
    c.says = format!("{}: {}.", c.title, each.join(", "));
    c.downwards = true;
    c.legend = true;
    c.aspect = 0.45;
    let standings = [
        ("proposed", Shape::Circle, true, [Standing::Proposed, Standing::ProposedTogether].as_slice()),
        ("explains part", Shape::Circle, false, Standing::PARTS.as_slice()),
        ("no more than noise", Shape::Cross, false, [Standing::NoMoreThanNoise].as_slice()),
    ];
    for (name, shape, filled, of) in standings {
        let at = |(i, (k, standing)): (usize, (&Candidate, &Standing))| {
            let note = if k.same_as.is_empty() {
                String::new()
            } else {
                format!("cannot be separated from {}", k.same_as.join(" "))
            };
            of.contains(standing).then(|| point(k.rms_after_um, i as f64, note))
        };
        let all = d.candidates.iter().zip(&view.diagnosis.standings).enumerate();
        let points: Vec<Point> = all.filter_map(at).collect();
        if !points.is_empty() {
            c.marks.push(Mark::Points { series: name.to_owned(), look: look(Ink::Blue, shape, filled), points });
        }
    }
    let held = d.candidates.iter().enumerate();
    let held = held.filter_map(|(i, k)| Some(point(k.held_out_after_um.filter(|h| *h > 0.0)?, i as f64, "")));
    c.marks.extend(cross_validated(held.collect(), Ink::Red));
    c.marks.push(Mark::Rule { series: "model now".to_owned(), pen: solid(Ink::Ink, 2), at: d.rms_um, upright: true });
    c.marks.push(noise(view, true));
    c
}

fn correlation(view: &View) -> Chart {
    let q = &view.correlation;
    let (x, y) = (Axis::named(q.names.clone()), Axis::named(q.names.clone()));
    let mut c = chart("correlation", "How the results hang together: correlation, −1 to 1", x, y);
    c.says = format!("Correlation of the results of the model now, from −1 to 1: {}.", q.names.join(", "));
    c.downwards = true;
    c.aspect = 0.8;
    c.marks.push(Mark::Cells { rows: q.matrix.clone() });
    let mut csv =
        format!("parameter,{}\n", q.names.iter().map(|n| super::chart::field(n)).collect::<Vec<_>>().join(","));
    for (row, name) in q.matrix.iter().zip(&q.names) {
        let cells: Vec<String> = row.iter().map(|r| r.map_or_else(String::new, |r| r.to_string())).collect();
        csv += &format!("{},{}\n", super::chart::field(name), cells.join(","));
    }
    c.csv = Some(csv);
    c
}
