//! The machine with its blocks, and the residual of every touch as an arrow.

use super::chart::{Axis, Chart, Dash, Ink, Look, Mark, Pen, Picture, Scale, Shape, field};
use super::on_paper::{solid, used};
use crate::machine::Form;
use crate::units::{mm_from_um, um_from_mm};
use crate::view::View;
use crate::view::record::{BlockRecord, SolidRecord};
use nalgebra::Vector3;
use std::f64::consts::TAU;

const STAGES: [Ink; 6] = [Ink::Blue, Ink::Red, Ink::Green, Ink::Purple, Ink::Orange, Ink::Sky];

/// The largest residuals are drawn this long, as a share of the artefact.
const LONGEST: f64 = 0.25;

type V = Vector3<f64>;

/// Points in a row, mm.
type Polyline = Vec<[f64; 3]>;

/// To a micrometre, so that the page is short.
fn short(p: V) -> [f64; 3] {
    p.map(|v| (v * 1e3).round() / 1e3).into()
}

/// The twelve edges of a box: around below, around above, the uprights.
fn edges(centre: V, size: V) -> Vec<Polyline> {
    let corner = |x: f64, y: f64, z: f64| short(centre + 0.5 * V::new(x * size.x, y * size.y, z * size.z));
    const AROUND: [(f64, f64); 5] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let rims = [-1.0, 1.0].map(|z| AROUND.iter().map(|(x, y)| corner(*x, *y, z)).collect());
    let uprights = AROUND.iter().take(4).map(|(x, y)| vec![corner(*x, *y, -1.0), corner(*x, *y, 1.0)]);
    rims.into_iter().chain(uprights).collect()
}

/// What is touched: a box by its edges, a sphere by three circles, a cylinder or a hole by its two ends.
fn body(b: &BlockRecord) -> Vec<Polyline> {
    let (centre, size) = (V::from(b.centre), V::from(b.size));
    let radius = b.diameter.unwrap_or_default() / 2.0;
    let ends = || circles(centre - V::z() * (size.z / 2.0), V::z(), radius, &[0.0, size.z]);
    match b.form {
        Form::Box | Form::Plane | Form::Part | Form::Centre | Form::Reading => edges(centre, size),
        Form::Sphere => [V::x(), V::y(), V::z()].iter().flat_map(|d| circles(centre, *d, radius, &[0.0])).collect(),
        Form::Cylinder => ends(),
        Form::Bore => ends().into_iter().chain(edges(centre, size)).collect(),
    }
}

fn solid_body(s: &SolidRecord) -> Vec<Polyline> {
    match (s.size, s.direction, s.radius_height) {
        (Some(size), ..) => edges(V::from(s.at), V::from(size)),
        (None, Some(direction), Some([r, h])) => circles(V::from(s.at), V::from(direction), r, &[0.0, h]),
        _ => Vec::new(),
    }
}

/// Circles about a line through a point, at these places along it.
fn circles(foot: V, direction: V, radius: f64, along: &[f64]) -> Vec<Polyline> {
    let other = if direction.z.abs() < 0.9 { V::z() } else { V::x() };
    let u = direction.cross(&other).normalize();
    let w = direction.cross(&u);
    let at = |k: usize, z: f64| {
        let (sin, cos) = (TAU * k as f64 / 48.0).sin_cos();
        short(foot + direction * z + (u * cos + w * sin) * radius)
    };
    along.iter().map(|z| (0..=48).map(|k| at(k, *z)).collect()).collect()
}

/// 1, 2 or 5 times a power of ten, not above x.
fn round125(x: f64) -> f64 {
    let power = 10f64.powf(x.log10().floor());
    let rest = x / power;
    power
        * if rest >= 5.0 {
            5.0
        } else if rest >= 2.0 {
            2.0
        } else {
            1.0
        }
}

/// How long the residuals of a rung are drawn beside an artefact of this extent.
fn scale(view: &View, rung: usize, extent: f64) -> Scale {
    let mut sizes: Vec<f64> = used(view).map(|i| view.touches.residual_um[rung][i].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let large_um = sizes.get(sizes.len() * 98 / 100).copied().unwrap_or(1.0).max(1e-3);
    let times = round125(LONGEST * extent / mm_from_um(large_um));
    Scale { times, bar_um: round125(um_from_mm(LONGEST * extent) / times) }
}

/// The picture with the residuals of the model that is shown as "before".
pub(super) fn machine(view: &View) -> Chart {
    let t = &view.touches;
    let rung = view.errors.before;
    let points: Vec<V> = t.point.iter().map(|p| V::from(*p)).collect();
    let low = points.iter().fold(V::repeat(f64::INFINITY), |a, p| a.inf(p));
    let high = points.iter().fold(V::repeat(f64::NEG_INFINITY), |a, p| a.sup(p));
    let extent = (high - low).max().max(20.0);
    let centre = 0.5 * (low + high);
    let mut marks = vec![
        Mark::Wire { pen: solid(Ink::Muted, 1), lines: view.machine.solids.iter().flat_map(solid_body).collect() },
        Mark::Wire { pen: solid(Ink::Ink, 2), lines: view.machine.blocks.iter().flat_map(body).collect() },
    ];
    let mut stages: Vec<usize> = Vec::new();
    for stage in &t.stage {
        if !stages.contains(stage) {
            stages.push(*stage);
        }
    }
    for (stage, ink) in stages.iter().zip(STAGES.iter().cycle()) {
        marks.push(Mark::Arrows { series: t.words[*stage].clone(), pen: solid(*ink, 2), stage: *stage });
    }
    let cross = Look { ink: Ink::Ink, shape: Shape::Cross, filled: false, size: 4, opacity: 1.0 };
    marks.push(Mark::Unused { series: "not used".to_owned(), look: cross });
    for a in &view.machine.axes {
        let direction = V::from(a.direction);
        // a linear axis has no place: it is drawn beside the artefact; a rotary one through the point of its line next to it
        let beside = low - V::new(0.25, 0.25, 0.1) * extent;
        let (from, to) = if a.rotary {
            let at = V::from(a.point) + direction * (centre - V::from(a.point)).dot(&direction);
            (at - direction * (0.75 * extent), at + direction * (0.75 * extent))
        } else {
            (beside, beside + direction * (0.4 * extent))
        };
        let pen = Pen { ink: Ink::Ink, width: 2, dash: if a.rotary { Dash::DashDot } else { Dash::Solid } };
        marks.push(Mark::Wire { pen, lines: vec![vec![short(from), short(to)]] });
        marks.push(Mark::Name { text: a.name.clone(), at: short(to) });
    }
    let foot = V::new(high.x + 0.2 * extent, low.y - 0.2 * extent, low.z);
    let scales: Vec<Scale> = (0..view.ladder.len()).map(|rung| scale(view, rung, extent)).collect();
    let own = scales.get(rung).copied().unwrap_or(Scale { times: 1.0, bar_um: 1.0 });
    let mut csv = String::from(
        "stage,run,touch,line,point_x_mm,point_y_mm,point_z_mm,normal_x,normal_y,normal_z,miss_before_um,miss_after_um,used\n",
    );
    for i in 0..t.n {
        let (p, n) = (t.point[i], t.normal[i]);
        csv += &format!(
            "{},{},{},{},{},{},{},{},{},{},{},{},{}\n",
            field(&t.words[t.stage[i]]),
            t.run[i],
            t.id[i],
            t.line[i],
            p[0],
            p[1],
            p[2],
            n[0],
            n[1],
            n[2],
            t.residual_um[rung][i],
            t.residual_um[view.errors.after][i],
            t.rejected[i].is_none()
        );
    }
    let label = view.ladder.get(rung).map_or("", |q| q.label.as_str());
    let title = format!(
        "{}: the residual of each touch ({label}), by stage; arrows {} times as long as the residuals",
        view.machine.name, own.times
    );
    let picture = Picture { centre: short(centre), extent, foot: short(foot), scales };
    let says = "The machine with its blocks; an arrow at each touch shows its residual.".to_owned();
    let empty = || Axis::new("", (0.0, 1.0));
    Chart {
        picture: Some(picture),
        legend: true,
        aspect: 0.75,
        marks,
        csv: Some(csv),
        says,
        ..super::charts::chart("machine", title, empty(), empty())
    }
}
