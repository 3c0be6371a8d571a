//! What of a view is drawn: the same plots, colours and words as on the page (`web/plots.js`).

use super::chart::{Axis, Chart, Colour, Look, Mark, Point, Shape};
use super::machine;
use crate::compare::model_ladder::{Curve, Kind};
use crate::diagnose::Verdict;
use crate::fit::outcome::Status;
use crate::report::fit::significant;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::view::View;
use crate::view::record::{Judgement, Variable};

// Okabe and Ito's colours
pub(super) const BLUE: Colour = (0, 114, 178);
pub(super) const RED: Colour = (213, 94, 0);
pub(super) const GREEN: Colour = (0, 158, 115);
pub(super) const PURPLE: Colour = (204, 121, 167);
pub(super) const ORANGE: Colour = (230, 159, 0);
pub(super) const INK: Colour = (22, 25, 29);
pub(super) const GREY: Colour = (120, 126, 134);

/// More results than this are in the table, not in the plot.
const MOST_RESULTS: usize = 24;

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

fn chart(name: &str, title: impl Into<String>, x: Axis, y: Axis) -> Chart {
    Chart {
        name: name.to_owned(),
        title: title.into(),
        x,
        y,
        downwards: false,
        picture: false,
        aspect: 0.6,
        marks: Vec::new(),
        csv: None,
    }
}

fn point(x: f64, y: f64) -> Point {
    Point { x, y, note: String::new() }
}

fn look(colour: Colour, shape: Shape, filled: bool) -> Look {
    Look { colour, shape, filled, size: 7, opacity: 1.0 }
}

fn upright(series: &str, x: f64, y: (f64, f64), dash: Option<(f64, f64)>) -> Mark {
    Mark::Line { series: series.to_owned(), colour: INK, width: 2, dash, points: vec![point(x, y.0), point(x, y.1)] }
}

fn highest(values: impl Iterator<Item = f64>) -> f64 {
    values.filter(|v| v.is_finite()).fold(0.0, f64::max)
}

const DASH: Option<(f64, f64)> = Some((9.0, 6.0));

fn errors(view: &View) -> Chart {
    let mut rungs = vec![view.errors.before, view.errors.after];
    rungs.dedup();
    let rungs: Vec<_> = rungs.into_iter().filter_map(|i| view.ladder.get(i)).collect();
    let noise = view.errors.noise_um;
    let held = || rungs.iter().filter_map(|r| r.held_out_rms_um);
    let top = 1.12 * highest(rungs.iter().map(|r| r.rms_um).chain(held()).chain([noise]));
    let names: Vec<String> = rungs.iter().map(|r| format!("{}: {} µm", r.label, significant(r.rms_um))).collect();
    let y = Axis::named(names);
    let ends = y.range;
    let mut c = chart("error", "The error before and after", Axis::new("residual (RMS), µm", (0.0, top)), y);
    c.downwards = true;
    c.aspect = 0.35;
    for (i, rung) in rungs.iter().enumerate() {
        let i = i as f64;
        c.marks.push(Mark::Area {
            series: if i == 0.0 { "before" } else { "after" }.to_owned(),
            colour: if i == 0.0 { RED } else { BLUE },
            opacity: 1.0,
            x: (0.0, rung.rms_um),
            y: (i - 0.28, i + 0.28),
        });
    }
    let points: Vec<Point> =
        rungs.iter().enumerate().filter_map(|(i, r)| Some(point(r.held_out_rms_um?, i as f64))).collect();
    if !points.is_empty() {
        c.marks.push(Mark::Points {
            series: "cross-validated".to_owned(),
            look: look(INK, Shape::Diamond, false),
            points,
        });
    }
    c.marks.push(upright("probe's noise", noise, ends, DASH));
    let mut csv = String::from("what,rms_um,held_out_rms_um\n");
    for r in &rungs {
        let held = r.held_out_rms_um.map_or_else(String::new, |h| h.to_string());
        csv += &format!("{},{},{held}\n", super::chart::field(&r.label), r.rms_um);
    }
    csv += &format!("probe's noise,{noise},\n");
    c.csv = Some(csv);
    c
}

fn results(view: &View) -> Chart {
    let list = if view.proposed.is_empty() { &view.parameters } else { &view.proposed };
    let shown: Vec<_> = list
        .iter()
        .filter(|p| p.at_radius_um.is_some() && p.status != Status::Undetermined)
        .take(MOST_RESULTS)
        .collect();
    let reach = 1.1
        * highest(
            shown
                .iter()
                .map(|p| p.at_radius_um.unwrap_or(0.0).abs() + p.at_radius_expanded_um.unwrap_or(0.0))
                .chain(shown.iter().filter_map(|p| p.tolerance_um)),
        );
    let names: Vec<String> = shown.iter().map(|p| format!("{} ({})", p.says, p.name)).collect();
    let x = Axis::new(format!("error at {} mm, µm (bar: 95 %)", view.tolerance.radius_mm), (-reach, reach));
    let partly = view.diagnosis.answer.verdict != Verdict::Adequate && view.proposed.is_empty();
    let title = if partly {
        "The machine's errors against the tolerance: these values include part of the missing error"
    } else {
        "The machine's errors against the tolerance"
    };
    let mut c = chart("results", title, x, Axis::named(names));
    c.downwards = true;
    c.aspect = (0.22 + 0.032 * shown.len() as f64).clamp(0.4, 1.1);
    for (i, p) in shown.iter().enumerate() {
        if let Some(t) = p.tolerance_um {
            let i = i as f64;
            c.marks.push(Mark::Area {
                series: "tolerance".to_owned(),
                colour: BLUE,
                opacity: 0.13,
                x: (-t, t),
                y: (i - 0.5, i + 0.5),
            });
        }
    }
    for (i, p) in shown.iter().enumerate() {
        let (Some(at), Some(doubt)) = (p.at_radius_um, p.at_radius_expanded_um) else { continue };
        let points = vec![point(at - doubt, i as f64), point(at + doubt, i as f64)];
        c.marks.push(Mark::Line { series: String::new(), colour: INK, width: 2, dash: None, points });
    }
    for (judgement, name, colour, shape) in [
        (Judgement::Within, "within", BLUE, Shape::Circle),
        (Judgement::Beyond, "too large", RED, Shape::Diamond),
        (Judgement::Open, "uncertain", ORANGE, Shape::Square),
        (Judgement::None, "no tolerance", GREY, Shape::Triangle),
    ] {
        let of = |(i, p): (usize, &&crate::view::record::ParameterRecord)| {
            (p.judgement == judgement).then(|| point(p.at_radius_um.unwrap_or(0.0), i as f64))
        };
        let points: Vec<Point> = shown.iter().enumerate().filter_map(of).collect();
        if !points.is_empty() {
            c.marks.push(Mark::Points { series: name.to_owned(), look: look(colour, shape, true), points });
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
    let noise = view.errors.noise_um;
    let all: Vec<f64> = view
        .ladder
        .iter()
        .flat_map(|r| [Some(r.rms_um), r.held_out_rms_um])
        .flatten()
        .chain([noise])
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    let (low, high) = (all.iter().copied().fold(f64::INFINITY, f64::min), highest(all.iter().copied()));
    let log = high > 12.0 * low;
    let y = Axis {
        log,
        ..Axis::new("error left (RMS), µm", if log { (0.6 * low, 1.8 * high) } else { (0.0, 1.15 * high) })
    };
    let names = view.ladder.iter().map(|r| r.label.replace(" +", "\n+")).collect();
    let mut x = Axis::named(names);
    x.title = String::new();
    let ends = x.range;
    let mut c = chart("ladder", "Step by step to the noise", x, y);
    let mut stairs: Vec<Point> = Vec::new();
    for (i, r) in view.ladder.iter().enumerate() {
        if let Some(last) = stairs.last().map(|p| p.y) {
            stairs.push(point(i as f64, last));
        }
        stairs.push(Point { x: i as f64, y: r.rms_um, note: r.label.clone() });
    }
    c.marks.push(Mark::Line {
        series: "touches that were fitted".to_owned(),
        colour: BLUE,
        width: 3,
        dash: None,
        points: stairs,
    });
    for (i, r) in view.ladder.iter().enumerate() {
        let filled = r.kind != Kind::Proposed;
        let at = vec![Point { x: i as f64, y: r.rms_um, note: r.label.clone() }];
        c.marks.push(Mark::Points { series: String::new(), look: look(BLUE, Shape::Circle, filled), points: at });
        c.marks.push(Mark::Word { text: significant(r.rms_um), at: (i as f64, r.rms_um) });
    }
    let held: Vec<Point> =
        view.ladder.iter().enumerate().filter_map(|(i, r)| Some(point(i as f64, r.held_out_rms_um?))).collect();
    if !held.is_empty() {
        c.marks.push(Mark::Points {
            series: "cross-validated".to_owned(),
            look: look(RED, Shape::Diamond, false),
            points: held,
        });
    }
    let points = vec![point(ends.0, noise), point(ends.1, noise)];
    c.marks.push(Mark::Line { series: "probe's noise".to_owned(), colour: INK, width: 2, dash: DASH, points });
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

/// A direction of R: its letter, and how its points and its line look.
type Direction = (&'static str, Colour, Shape, Option<(f64, f64)>);

const LETTERS: [Direction; 3] = [
    ("X", BLUE, Shape::Circle, None),
    ("Y", RED, Shape::Square, DASH),
    ("Z", GREEN, Shape::Triangle, Some((3.0, 4.0))),
];

fn residuals(view: &View, variable: &Variable) -> Chart {
    let t = &view.touches;
    let value = |i: usize| -> Option<f64> {
        match variable.id.as_str() {
            "time" => Some(t.time_h[i]),
            "order" => Some((i + 1) as f64),
            "approach" => t.approach_deg[i],
            "stylus" => Some(t.stylus_mm[i]),
            axis => t.axes.get(axis).and_then(|a| a.get(i)).copied(),
        }
    };
    let (from, to) = (view.errors.before, view.errors.after);
    let along = variable.id == "approach";
    let used: Vec<usize> = (0..t.n).filter(|i| t.rejected[*i].is_none() && value(*i).is_some()).collect();
    let xs: Vec<f64> = used.iter().filter_map(|i| value(*i)).collect();
    let low = xs.iter().copied().fold(f64::INFINITY, f64::min);
    let high = xs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = 0.04 * (high - low);
    let miss = |rung: usize, i: usize| if along { 1.0 } else { f64::from(t.sign[i]) } * t.residual_um[rung][i];
    let noise = 2.0 * view.errors.noise_um;
    let added: Vec<&Curve> =
        view.curves.iter().filter(|q| q.variable == variable.id && (q.from, q.to) == (from, to)).collect();
    let missed = used.iter().flat_map(|i| [miss(from, *i).abs(), miss(to, *i).abs()]);
    // a line between the touches may go further than any of them
    let drawn = added.iter().flat_map(|q| q.y_um.iter().map(|y| y.abs()));
    let reach = 1.08 * highest(missed.chain(drawn).chain([noise]));
    let title = if along { "residual along the face, µm" } else { "residual, µm" };
    let name = format!("residual-{}", variable.id.to_lowercase());
    let x = Axis::new(variable.title.clone(), (low - room, high + room));
    let mut c = chart(&name, format!("Residual against the {}", variable.title), x, Axis::new(title, (-reach, reach)));
    c.marks.push(Mark::Area {
        series: "twice the noise".to_owned(),
        colour: BLUE,
        opacity: 0.13,
        x: (low - room, high + room),
        y: (-noise, noise),
    });
    let source = |i: usize| {
        let log = view.study.runs.get(t.run[i] - 1).map_or("log", |r| r.log.as_str());
        format!("run {} touch {} {log}:{}", t.run[i], t.id[i], t.line[i])
    };
    let kinds: Vec<Direction> = if along { vec![("normal", PURPLE, Shape::Diamond, None)] } else { LETTERS.to_vec() };
    for (k, (direction, colour, shape, dash)) in kinds.iter().enumerate() {
        let mut add = |rung: usize, word: &str, filled: bool, opacity: f64| {
            let points: Vec<Point> = used
                .iter()
                .filter(|i| along || t.towards[**i] == k)
                .map(|&i| Point { x: value(i).unwrap_or(f64::NAN), y: miss(rung, i), note: source(i) })
                .collect();
            let series = if along { word.to_owned() } else { format!("{direction} {word}") };
            let look = Look { colour: *colour, shape: *shape, filled, size: if filled { 3 } else { 5 }, opacity };
            c.marks.push(Mark::Points { series, look, points });
        };
        if from != to {
            add(from, "before", false, 0.45);
        }
        add(to, "after", true, 0.85);
        for curve in added.iter().filter(|q| q.direction == *direction) {
            let points = curve.x.iter().zip(&curve.y_um).map(|(x, y)| point(*x, *y)).collect();
            let series = format!("{direction} added");
            c.marks.push(Mark::Line { series, colour: *colour, width: 3, dash: *dash, points });
        }
    }
    c
}

/// How a candidate stands to the test with all of them counted in.
fn standing(k: &crate::diagnose::answer::Candidate) -> &'static str {
    if k.proposed {
        "proposed"
    } else if k.p_adjusted < FAMILY_LEVEL {
        "explains part"
    } else {
        "no more than noise"
    }
}

fn candidates(view: &View) -> Chart {
    let d = &view.diagnosis.answer;
    let top = 1.12
        * highest(
            d.candidates.iter().flat_map(|k| [k.rms_after_um, k.held_out_after_um.unwrap_or(0.0)]).chain([d.rms_um]),
        );
    let y = Axis::named(d.candidates.iter().map(|k| k.name.clone()).collect());
    let ends = y.range;
    let mut c = chart("candidates", "Error left with each candidate", Axis::new("error left (RMS), µm", (0.0, top)), y);
    c.downwards = true;
    c.aspect = 0.45;
    let standings = [
        ("proposed", Shape::Circle, true),
        ("explains part", Shape::Circle, false),
        ("no more than noise", Shape::Square, false),
    ];
    for (name, shape, filled) in standings {
        let of = |(i, k): (usize, &crate::diagnose::answer::Candidate)| {
            let note = if k.same_as.is_empty() {
                String::new()
            } else {
                format!("cannot be separated from {}", k.same_as.join(" "))
            };
            (standing(k) == name).then_some(Point { x: k.rms_after_um, y: i as f64, note })
        };
        let points: Vec<Point> = d.candidates.iter().enumerate().filter_map(of).collect();
        if !points.is_empty() {
            c.marks.push(Mark::Points { series: name.to_owned(), look: look(BLUE, shape, filled), points });
        }
    }
    let held: Vec<Point> = d
        .candidates
        .iter()
        .enumerate()
        .filter_map(|(i, k)| Some(point(k.held_out_after_um.filter(|h| *h > 0.0)?, i as f64)))
        .collect();
    c.marks.push(Mark::Points {
        series: "cross-validated".to_owned(),
        look: look(RED, Shape::Diamond, false),
        points: held,
    });
    c.marks.push(upright("model now", d.rms_um, ends, None));
    c.marks.push(upright("probe's noise", view.errors.noise_um, ends, DASH));
    c
}

fn correlation(view: &View) -> Chart {
    let q = &view.correlation;
    let (x, y) = (Axis::named(q.names.clone()), Axis::named(q.names.clone()));
    let mut c = chart("correlation", "How the results hang together: correlation, −1 to 1", x, y);
    c.downwards = true;
    c.aspect = 0.8;
    let mut csv =
        format!("parameter,{}\n", q.names.iter().map(|n| super::chart::field(n)).collect::<Vec<_>>().join(","));
    for (i, row) in q.matrix.iter().enumerate() {
        let cells: Vec<String> = row.iter().map(|r| r.map_or_else(String::new, |r| r.to_string())).collect();
        csv += &format!("{},{}\n", super::chart::field(&q.names[i]), cells.join(","));
        for (j, r) in row.iter().enumerate().filter_map(|(j, r)| Some((j, (*r)?))) {
            let (x, y) = (j as f64, i as f64);
            c.marks.push(Mark::Area {
                series: String::new(),
                colour: if r < 0.0 { BLUE } else { RED },
                opacity: r.abs().min(1.0),
                x: (x - 0.49, x + 0.49),
                y: (y - 0.49, y + 0.49),
            });
            if q.names.len() <= 14 {
                c.marks.push(Mark::Word { text: format!("{r:.2}").replace('-', "\u{2212}"), at: (x - 0.35, y + 0.2) });
            }
        }
    }
    c.csv = Some(csv);
    c
}
