//! The machine with its blocks, and the miss of every touch as an arrow, seen from the front, right and above.

use super::chart::{Axis, Chart, Colour, Look, Mark, Point, Shape, field};
use super::charts::{BLUE, GREEN, GREY, INK, ORANGE, PURPLE, RED};
use crate::machine::Form;
use crate::report::fit::significant;
use crate::view::View;
use crate::view::record::{BlockRecord, SolidRecord};
use nalgebra::Vector3;
use std::f64::consts::TAU;

const STAGES: [Colour; 5] = [BLUE, RED, GREEN, PURPLE, ORANGE];

/// The largest misses are drawn this long, as a share of the artefact.
const LONGEST: f64 = 0.25;

type V = Vector3<f64>;

/// On the paper: X to the right, Z up, seen from the front, right and above.
fn project(p: &V) -> (f64, f64) {
    let (sa, ca) = (-0.6f64).sin_cos();
    let (se, ce) = 0.5f64.sin_cos();
    (ca * p.x - sa * p.y, ce * p.z + se * (sa * p.x + ca * p.y))
}

fn line(series: &str, colour: Colour, width: u32, dash: Option<(f64, f64)>, ends: &[(V, V)]) -> Mark {
    let at = |p: &V| {
        let (x, y) = project(p);
        Point { x, y, note: String::new() }
    };
    let gap = Point { x: f64::NAN, y: f64::NAN, note: String::new() };
    let points = ends.iter().flat_map(|(a, b)| [at(a), at(b), gap.clone()]).collect();
    Mark::Line { series: series.to_owned(), colour, width, dash, points }
}

/// The twelve edges of a box.
fn edges(centre: V, size: V) -> Vec<(V, V)> {
    let corner = |i: usize| {
        let half = |bit: usize, k: usize| if i & (1 << bit) == 0 { -0.5 * size[k] } else { 0.5 * size[k] };
        centre + V::new(half(0, 0), half(1, 1), half(2, 2))
    };
    let pairs = (0..8usize).flat_map(|i| (0..3).filter(move |b| i & (1 << b) == 0).map(move |b| (i, i | (1 << b))));
    pairs.map(|(a, b)| (corner(a), corner(b))).collect()
}

/// What is touched: a box by its edges, a sphere by three circles, a cylinder or a hole by its two ends.
fn body(b: &BlockRecord) -> Vec<(V, V)> {
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

fn rings(s: &SolidRecord, direction: V, radius: f64, height: f64) -> Vec<(V, V)> {
    circles(V::from(s.at), direction, radius, &[0.0, height])
}

/// Circles about a line through a point, at these places along it.
fn circles(foot: V, direction: V, radius: f64, along: &[f64]) -> Vec<(V, V)> {
    let other = if direction.z.abs() < 0.9 { V::z() } else { V::x() };
    let u = direction.cross(&other).normalize();
    let w = direction.cross(&u);
    let at = |k: usize, z: f64| {
        let (sin, cos) = (TAU * k as f64 / 48.0).sin_cos();
        foot + direction * z + (u * cos + w * sin) * radius
    };
    along.iter().flat_map(|z| (0..48).map(|k| (at(k, *z), at(k + 1, *z))).collect::<Vec<_>>()).collect()
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

/// The picture with the misses of the model that is shown as "before".
pub(super) fn machine(view: &View) -> Chart {
    let t = &view.touches;
    let rung = view.errors.before;
    let points: Vec<V> = t.point.iter().map(|p| V::from(*p)).collect();
    let low = points.iter().fold(V::repeat(f64::INFINITY), |a, p| a.inf(p));
    let high = points.iter().fold(V::repeat(f64::NEG_INFINITY), |a, p| a.sup(p));
    let extent = (high - low).max().max(20.0);
    let centre = 0.5 * (low + high);
    let mut sizes: Vec<f64> =
        (0..t.n).filter(|i| t.rejected[*i].is_none()).map(|i| t.residual_um[rung][i].abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let large = sizes.get(sizes.len() * 98 / 100).copied().unwrap_or(1.0).max(1e-3);
    let magnification = round125(LONGEST * extent / crate::units::mm_from_um(large));
    let mut marks = Vec::new();
    for s in &view.machine.solids {
        let lines = match (s.size, s.direction, s.radius_height) {
            (Some(size), ..) => edges(V::from(s.at), V::from(size)),
            (None, Some(d), Some([r, h])) => rings(s, V::from(d), r, h),
            _ => continue,
        };
        marks.push(line("", GREY, 1, None, &lines));
    }
    for b in &view.machine.blocks {
        marks.push(line("", INK, 2, None, &body(b)));
    }
    for a in &view.machine.axes {
        let direction = V::from(a.direction);
        let beside = low - V::new(0.25, 0.25, 0.1) * extent;
        let (from, to) = if a.rotary {
            let at = V::from(a.point) + direction * (centre - V::from(a.point)).dot(&direction);
            (at - direction * (0.75 * extent), at + direction * (0.75 * extent))
        } else {
            (beside, beside + direction * (0.4 * extent))
        };
        marks.push(line("", INK, 2, a.rotary.then_some((14.0, 6.0)), &[(from, to)]));
        marks.push(Mark::Word { text: a.name.clone(), at: project(&to) });
    }
    let mut csv = String::from(
        "stage,run,touch,line,point_x_mm,point_y_mm,point_z_mm,normal_x,normal_y,normal_z,miss_before_um,miss_after_um,used\n",
    );
    let mut stages: Vec<usize> = Vec::new();
    for s in &t.stage {
        if !stages.contains(s) {
            stages.push(*s);
        }
    }
    for (k, stage) in stages.iter().enumerate() {
        let own: Vec<usize> = (0..t.n).filter(|i| t.stage[*i] == *stage && t.rejected[*i].is_none()).collect();
        let tip = |i: usize| {
            let length = crate::units::mm_from_um(t.residual_um[rung][i]) * magnification;
            points[i] + V::from(t.normal[i]) * length
        };
        let colour = STAGES[k % STAGES.len()];
        let arrows: Vec<(V, V)> = own.iter().map(|i| (points[*i], tip(*i))).collect();
        marks.push(line(&t.words[*stage], colour, 2, None, &arrows));
        let ends = arrows.iter().map(|(_, b)| project(b)).map(|(x, y)| Point { x, y, note: String::new() }).collect();
        let look = Look { colour, shape: Shape::Diamond, filled: true, size: 3, opacity: 1.0 };
        marks.push(Mark::Points { series: String::new(), look, points: ends });
    }
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
    let scale_um = round125(crate::units::um_from_mm(LONGEST * extent) / magnification);
    let foot = V::new(high.x + 0.2 * extent, low.y - 0.2 * extent, low.z);
    let end = foot + V::z() * (crate::units::mm_from_um(scale_um) * magnification);
    marks.push(line("", INK, 6, None, &[(foot, end)]));
    marks.push(Mark::Word { text: format!("{} µm", significant(scale_um)), at: project(&end) });
    let (x, y) = project(&centre);
    let r = 0.9 * extent;
    let label = view.ladder.get(rung).map_or("", |q| q.label.as_str());
    Chart {
        name: "machine".to_owned(),
        title: format!(
            "{}: the residual of each touch ({label}), by stage; arrows {magnification} times as long as the residuals",
            view.machine.name
        ),
        x: Axis::new("", (x - 1.3 * r, x + 1.3 * r)),
        y: Axis::new("", (y - r, y + r)),
        downwards: false,
        picture: true,
        aspect: 0.75,
        marks,
        csv: Some(csv),
    }
}
