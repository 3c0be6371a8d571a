//! A chart on paper: its touches put in, what is in space seen from the front, right and above, lines that cross it given their ends.

use super::chart::{Axis, Chart, Dash, Ink, Look, Mark, Model, Pen, Point, Shape};
use crate::report::fit::significant;
use crate::units::mm_from_um;
use crate::view::View;
use nalgebra::Vector3;

/// Cells of a larger square have no room for their numbers.
const MOST_NUMBERS: usize = 14;

/// The same chart of points, lines, areas and words alone.
pub(super) fn on_paper(chart: &Chart, view: &View) -> Chart {
    let mut marks: Vec<Mark> = chart.marks.iter().flat_map(|mark| plain(mark, chart, view)).collect();
    let Some(picture) = &chart.picture else { return Chart { marks, ..chart.clone() } };
    if let Some(scale) = picture.scales.get(view.errors.before) {
        let mut end = picture.foot;
        end[2] += mm_from_um(scale.bar_um) * scale.times;
        marks.push(wire("", solid(Ink::Ink, 6), &[vec![picture.foot, end]]));
        marks.push(Mark::Word { text: format!("{} µm", significant(scale.bar_um)), at: seen(&end) });
    }
    let (x, y) = seen(&picture.centre);
    let reach = 0.9 * picture.extent;
    let x = Axis::new("", (x - 1.3 * reach, x + 1.3 * reach));
    Chart { marks, x, y: Axis::new("", (y - reach, y + reach)), ..chart.clone() }
}

fn plain(mark: &Mark, chart: &Chart, view: &View) -> Vec<Mark> {
    let t = &view.touches;
    let rung = |model: Model| if model == Model::Before { view.errors.before } else { view.errors.after };
    match mark {
        Mark::Rule { series, pen, at, upright } => {
            let ends = if *upright { chart.y.range } else { chart.x.range };
            let point = |end: f64| if *upright { bare(*at, end) } else { bare(end, *at) };
            vec![Mark::Line { series: series.clone(), pen: *pen, points: vec![point(ends.0), point(ends.1)] }]
        }
        Mark::Area { series, ink, opacity, x, y } => {
            let inside = |(from, to): (f64, f64), (low, high): (f64, f64)| (from.max(low), to.min(high));
            let (x, y) = (inside(*x, chart.x.range), inside(*y, chart.y.range));
            vec![Mark::Area { series: series.clone(), ink: *ink, opacity: *opacity, x, y }]
        }
        Mark::Cells { rows } => cells(rows),
        // one model is not drawn twice
        Mark::Touches { model: Model::Before, .. } if view.errors.before == view.errors.after => Vec::new(),
        Mark::Touches { series, look, direction, model } => {
            let variable = chart.x.variable.as_deref().unwrap_or_default();
            let of = |i: usize| direction.is_none_or(|d| t.towards[i] == d);
            let each = used(view).filter(|i| of(*i)).filter_map(|i| {
                let sign = if direction.is_some() { f64::from(t.sign[i]) } else { 1.0 };
                Some(Point {
                    x: t.value(variable, i)?,
                    y: sign * t.residual_um[rung(*model)][i],
                    note: source(view, i),
                })
            });
            vec![Mark::Points { series: series.clone(), look: *look, points: each.collect() }]
        }
        Mark::Added { series, pen, direction } => {
            let between = (rung(Model::Before), rung(Model::After));
            let name = direction_name(*direction);
            let curves = view.curves.iter().filter(|c| {
                Some(&c.variable) == chart.x.variable.as_ref() && c.direction == name && (c.from, c.to) == between
            });
            let line = |c: &crate::compare::model_ladder::Curve| Mark::Line {
                series: series.clone(),
                pen: *pen,
                points: c.x.iter().zip(&c.y_um).map(|(x, y)| bare(*x, *y)).collect(),
            };
            curves.map(line).collect()
        }
        Mark::Wire { pen, lines } => vec![wire("", *pen, lines)],
        Mark::Name { text, at } => vec![Mark::Word { text: text.clone(), at: seen(at) }],
        Mark::Arrows { series, pen, stage } => {
            let Some(times) = chart.picture.as_ref().and_then(|p| p.scales.get(view.errors.before)).map(|s| s.times)
            else {
                return Vec::new();
            };
            let shaft = |i: usize| {
                let length = mm_from_um(t.residual_um[view.errors.before][i]) * times;
                let tip = Vector3::from(t.point[i]) + Vector3::from(t.normal[i]) * length;
                vec![t.point[i], tip.into()]
            };
            let shafts: Vec<Vec<[f64; 3]>> = used(view).filter(|i| t.stage[*i] == *stage).map(shaft).collect();
            let tips = shafts.iter().filter_map(|s| s.last()).map(point_of).collect();
            let look = Look { ink: pen.ink, shape: Shape::Diamond, filled: true, size: 3, opacity: 1.0 };
            vec![wire(series, *pen, &shafts), Mark::Points { series: String::new(), look, points: tips }]
        }
        Mark::Unused { series, look } => {
            let points: Vec<Point> =
                (0..t.n).filter(|i| t.rejected[*i].is_some()).map(|i| point_of(&t.point[i])).collect();
            let series = if points.is_empty() { String::new() } else { series.clone() };
            vec![Mark::Points { series, look: *look, points }]
        }
        Mark::Points { .. } | Mark::Line { .. } | Mark::Word { .. } => vec![mark.clone()],
    }
}

/// The name of a direction in the view's curves.
fn direction_name(direction: Option<usize>) -> &'static str {
    direction.and_then(|d| ["X", "Y", "Z"].get(d).copied()).unwrap_or("normal")
}

/// Touches that the model uses.
pub(super) fn used(view: &View) -> impl Iterator<Item = usize> {
    (0..view.touches.n).filter(|i| view.touches.rejected[*i].is_none())
}

/// Where a touch is found again.
fn source(view: &View, i: usize) -> String {
    let t = &view.touches;
    let log = view.study.runs.get(t.run[i] - 1).map_or("log", |r| r.log.as_str());
    format!("run {} touch {} {log}:{}", t.run[i], t.id[i], t.line[i])
}

fn bare(x: f64, y: f64) -> Point {
    Point { x, y, note: String::new() }
}

/// X to the right, Z up, seen from the front, right and above.
fn seen(p: &[f64; 3]) -> (f64, f64) {
    let (sa, ca) = (-0.6f64).sin_cos();
    let (se, ce) = 0.5f64.sin_cos();
    (ca * p[0] - sa * p[1], ce * p[2] + se * (sa * p[0] + ca * p[1]))
}

fn point_of(p: &[f64; 3]) -> Point {
    let (x, y) = seen(p);
    bare(x, y)
}

fn wire(series: &str, pen: Pen, lines: &[Vec<[f64; 3]>]) -> Mark {
    let gap = || bare(f64::NAN, f64::NAN);
    let points = lines.iter().flat_map(|line| line.iter().map(point_of).chain([gap()])).collect();
    Mark::Line { series: series.to_owned(), pen, points }
}

fn cells(rows: &[Vec<Option<f64>>]) -> Vec<Mark> {
    let mut out = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        for (j, r) in row.iter().enumerate().filter_map(|(j, r)| Some((j, (*r)?))) {
            let (x, y) = (j as f64, i as f64);
            out.push(Mark::Area {
                series: String::new(),
                ink: if r < 0.0 { Ink::Blue } else { Ink::Red },
                opacity: r.abs().min(1.0),
                x: (x - 0.49, x + 0.49),
                y: (y - 0.49, y + 0.49),
            });
            if rows.len() <= MOST_NUMBERS {
                let text = super::charts::minus(format!("{r:.2}"));
                out.push(Mark::Word { text, at: (x - 0.35, y + 0.2) });
            }
        }
    }
    out
}

/// A solid line.
pub(super) const fn solid(ink: Ink, width: u32) -> Pen {
    Pen { ink, width, dash: Dash::Solid }
}
