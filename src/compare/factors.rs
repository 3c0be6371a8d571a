//! The ways in which touches are split, and what each says.

use super::share::{Misfit, Share};
use super::{Group, Harmonic, Point, Split};
use crate::axes::AxisName;
use crate::fit::Fit;
use crate::units::rad_from_deg;
use nalgebra::DMatrix;

/// A share below this is not worth a sentence.
pub(super) const WORTH_NAMING: f64 = 0.05;

/// Bins of a quantity that takes many values.
const N_BINS: usize = 8;

/// A quantity with at most so many values is not binned.
const MOST_LEVELS: usize = 24;

/// Harmonics of a rotary axis that are looked for.
const ORDERS: usize = 3;

/// What a group's touches may have in common.
#[derive(Clone, Copy, PartialEq)]
enum Common {
    /// A residual: every touch comes late or early.
    Residual,
    /// A displacement in R.
    Displacement,
    /// A displacement in the frame of what bears the block, and a residual: another place, and another size.
    Place,
}

/// Touches in groups.
struct Levels {
    of: Vec<usize>,
    names: Vec<String>,
    at: Vec<Option<f64>>,
}

pub(super) fn splits(fit: &Fit, points: &[Point], misfit: &Misfit) -> Vec<Split> {
    let mut out = Vec::new();
    let mut add = |by: &str, what: &str, levels: Levels, common: Common, angle_deg: Option<(AxisName, Vec<f64>)>| {
        // a group of one touch has nothing in common: the points of a sphere are touched once each
        let of_one_touch = matches!(common, Common::Residual) && levels.at.iter().all(Option::is_none);
        if levels.names.len() > 1 && !(of_one_touch && 2 * levels.names.len() > points.len()) {
            out.push(split(fit, points, misfit, (by, what), &levels, common, angle_deg));
        }
    };
    let words = |word: &dyn Fn(&Point) -> String| named(points, word);
    add("stage", "the stage of the program", words(&|p| p.stage.clone()), Common::Displacement, None);
    add("run", "the run", words(&|p| p.run.to_string()), Common::Displacement, None);
    add("block", "the block", words(&|p| p.block.clone()), Common::Place, None);
    add("face", "the face of the block", words(&|p| p.face.clone()), Common::Residual, None);
    add("direction", "the direction of the approach in the machine", words(&direction), Common::Residual, None);
    add("approach", "the direction of the approach about the probe's axis", approach(points), Common::Residual, None);
    for axis in fit.model.axes() {
        let letter = axis.letter().to_string();
        let values: Vec<f64> = points.iter().map(|p| p.axes.get(&letter).copied().unwrap_or(0.0)).collect();
        let (by, angle) = if axis.is_rotary() {
            (format!("pose.{letter}"), Some((axis, values.clone())))
        } else {
            (letter.clone(), None)
        };
        let what = if axis.is_rotary() { letter } else { format!("the position of {letter}") };
        let levels = measured(&values, 1e-2, if axis.is_rotary() { MOST_LEVELS } else { N_BINS });
        add(&by, &what, levels, Common::Displacement, angle);
    }
    let of = |value: &dyn Fn(&Point) -> f64| points.iter().map(value).collect::<Vec<f64>>();
    add("time", "the time", bins(&of(&|p| p.time_h), 1e-9), Common::Displacement, None);
    add("feed", "the feed", measured(&of(&|p| p.feed_mm_min), 1e-6, MOST_LEVELS), Common::Residual, None);
    add(
        "spindle",
        "the orientation of the spindle",
        measured(&of(&|p| p.spindle_deg), 1e-2, MOST_LEVELS),
        Common::Displacement,
        None,
    );
    add("stylus", "the stylus", measured(&of(&|p| p.stylus_mm), 1e-6, MOST_LEVELS), Common::Displacement, None);
    if points.iter().all(|p| p.temperature_deg_c.is_some()) {
        let values = of(&|p| p.temperature_deg_c.unwrap_or(20.0));
        add("temperature", "the temperature", bins(&values, 1e-3), Common::Displacement, None);
    }
    out
}

/// Groups by a word, in the order of their first touches.
fn named(points: &[Point], word: &dyn Fn(&Point) -> String) -> Levels {
    let mut levels = Levels { of: Vec::with_capacity(points.len()), names: Vec::new(), at: Vec::new() };
    for p in points {
        let name = word(p);
        let k = levels.names.iter().position(|n| *n == name).unwrap_or_else(|| {
            levels.names.push(name);
            levels.at.push(None);
            levels.names.len() - 1
        });
        levels.of.push(k);
    }
    levels
}

/// Nearest direction of the machine against which the ball comes.
fn direction(p: &Point) -> String {
    let k = (0..3).max_by(|&a, &b| p.normal[a].abs().total_cmp(&p.normal[b].abs())).unwrap_or(2);
    format!("{}{}", if p.normal[k] < 0.0 { '+' } else { '-' }, ["X", "Y", "Z"][k])
}

/// Eighths of a turn about the probe's axis, and along it.
fn approach(points: &[Point]) -> Levels {
    let octant = |deg: f64| (deg / 45.0).round().rem_euclid(8.0) as usize;
    let name = |p: &Point| p.approach_deg.map_or_else(|| "along".into(), |d| format!("{} deg", 45 * octant(d)));
    let mut levels = named(points, &name);
    let mut order: Vec<usize> = (0..levels.names.len()).collect();
    let key = |k: &usize| levels.names[*k].split(' ').next().and_then(|n| n.parse::<u32>().ok()).unwrap_or(u32::MAX);
    order.sort_by_key(key);
    let place = |k: usize| order.iter().position(|o| *o == k).unwrap_or(k);
    levels.of = levels.of.iter().map(|k| place(*k)).collect();
    levels.names = order.iter().map(|k| levels.names[*k].clone()).collect();
    levels
}

/// Each value a group where they are few, else bins.
fn measured(values: &[f64], resolution: f64, most: usize) -> Levels {
    let key = |v: f64| (v / resolution).round() as i64;
    let mut keys: Vec<i64> = values.iter().map(|v| key(*v)).collect();
    keys.sort_unstable();
    keys.dedup();
    if keys.len() > most {
        return bins(values, resolution);
    }
    let of: Vec<usize> = values.iter().map(|v| keys.binary_search(&key(*v)).unwrap_or(0)).collect();
    let at: Vec<f64> = keys.iter().map(|k| *k as f64 * resolution).collect();
    Levels { of, names: at.iter().map(|v| plain(*v)).collect(), at: at.into_iter().map(Some).collect() }
}

/// Bins of about equal numbers of touches; equal values stay together.
fn bins(values: &[f64], resolution: f64) -> Levels {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let mut edges: Vec<f64> = (1..N_BINS).filter_map(|k| sorted.get(k * n / N_BINS).copied()).collect();
    edges.dedup_by(|a, b| (*a - *b).abs() <= resolution);
    let bin = |v: f64| edges.iter().filter(|e| v >= **e - 0.5 * resolution).count();
    let mut levels = Levels { of: Vec::new(), names: Vec::new(), at: Vec::new() };
    let mut place = vec![usize::MAX; edges.len() + 1];
    for (k, place) in place.iter_mut().enumerate() {
        let inside: Vec<f64> = sorted.iter().copied().filter(|v| bin(*v) == k).collect();
        if let (Some(first), Some(last)) = (inside.first(), inside.last()) {
            *place = levels.names.len();
            let same = last - first <= resolution;
            levels.names.push(if same { plain(*first) } else { format!("{} … {}", plain(*first), plain(*last)) });
            levels.at.push(Some(inside.iter().sum::<f64>() / inside.len() as f64));
        }
    }
    levels.of = values.iter().map(|v| place[bin(*v)]).collect();
    levels
}

/// A number without needless zeros.
fn plain(v: f64) -> String {
    let text = if v.abs() >= 100.0 { format!("{v:.1}") } else { format!("{v:.2}") };
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

fn split(
    fit: &Fit,
    points: &[Point],
    misfit: &Misfit,
    (by, what): (&str, &str),
    levels: &Levels,
    common: Common,
    angle_deg: Option<(AxisName, Vec<f64>)>,
) -> Split {
    let n = points.len();
    let width = match common {
        Common::Residual => 1,
        Common::Displacement => 3,
        Common::Place => 4,
    };
    let n_levels = levels.names.len();
    let n_turns = if angle_deg.is_some() { ORDERS } else { 0 };
    let mut columns = DMatrix::zeros(n, width * n_levels + 6 * n_turns);
    for (i, p) in points.iter().enumerate() {
        // blocks beside a turntable do not see its errors
        if angle_deg.as_ref().is_some_and(|(axis, _)| !fit.model.sees(*axis, &fit.data.observations[i])) {
            continue;
        }
        match common {
            Common::Residual => columns[(i, levels.of[i])] = 1.0,
            Common::Displacement => (0..3).for_each(|k| columns[(i, 3 * levels.of[i] + k)] = p.normal[k]),
            Common::Place => {
                (0..3).for_each(|k| columns[(i, 4 * levels.of[i] + k)] = fit.data.observations[i].normal[k]);
                columns[(i, 4 * levels.of[i] + 3)] = 1.0;
            }
        }
        if let Some((_, angle)) = &angle_deg {
            for k in 1..=ORDERS {
                let (sin, cos) = (k as f64 * rad_from_deg(angle[i])).sin_cos();
                for c in 0..3 {
                    let at = width * n_levels + 6 * (k - 1) + 2 * c;
                    columns[(i, at)] = p.normal[c] * cos;
                    columns[(i, at + 1)] = p.normal[c] * sin;
                }
            }
        }
    }
    let beside = misfit.beside(columns);
    let all: Vec<usize> = (0..width * n_levels).collect();
    let groups_share = beside.share(&all);
    let first = width * n_levels;
    // an axis that stands at few places cannot tell the orders apart
    let orders = if n_turns > 0 && n_levels > 2 { ((n_levels - 1) / 2).min(ORDERS) } else { 0 };
    let harmonics: Vec<Harmonic> = (1..=orders)
        .map(|order| {
            let at = first + 6 * (order - 1);
            let whole: Vec<usize> = (at..at + 6).collect();
            Harmonic {
                order,
                share: beside.share(&whole).share,
                along: [0, 1, 2].map(|c| beside.share(&[at + 2 * c, at + 2 * c + 1]).share),
            }
        })
        .collect();
    let joint: Vec<usize> = (first..first + 6 * orders).collect();
    let joint_share = if orders > 0 {
        beside.share(&joint)
    } else {
        Share { share: 0.0, p: 1.0, rank: 0, evidence: f64::NEG_INFINITY }
    };
    let best = if joint_share.evidence > groups_share.evidence { joint_share } else { groups_share };
    let groups = groups(fit, points, levels);
    let says = says(what, best.share, &harmonics, &groups, common);
    Split {
        by: by.into(),
        share: best.share,
        p: best.p,
        columns: best.rank,
        evidence: best.evidence.max(-1e9),
        harmonics,
        groups,
        says,
    }
}

fn groups(fit: &Fit, points: &[Point], levels: &Levels) -> Vec<Group> {
    let each = levels.names.iter().zip(&levels.at).enumerate().map(|(k, (name, at))| {
        let inside: Vec<f64> = (0..points.len())
            .filter(|&i| levels.of[i] == k && fit.weight[i] > 0.0)
            .map(|i| points[i].residual_um)
            .collect();
        let n = inside.len().max(1) as f64;
        Group {
            value: name.clone(),
            at: *at,
            n: inside.len(),
            mean_um: inside.iter().sum::<f64>() / n,
            rms_um: (inside.iter().map(|r| r * r).sum::<f64>() / n).sqrt(),
        }
    });
    each.collect()
}

fn says(what: &str, share: f64, harmonics: &[Harmonic], groups: &[Group], common: Common) -> String {
    let percent = |s: f64| format!("{:.0} %", 100.0 * s);
    if share < WORTH_NAMING {
        return format!("does not depend on {what}");
    }
    let leading = harmonics.iter().max_by(|a, b| a.share.total_cmp(&b.share));
    if let Some(h) = leading.filter(|h| h.share >= 0.6 * share) {
        let times = match h.order {
            1 => "once",
            2 => "twice",
            _ => "three times",
        };
        let most = h.along.iter().copied().fold(0.0, f64::max);
        let along: Vec<&str> = ["X", "Y", "Z"]
            .into_iter()
            .zip(h.along)
            .filter(|(_, s)| *s > 0.5 * most && most > 0.0)
            .map(|(c, _)| c)
            .collect();
        return format!(
            "{} of the residual depends on {what}, {times} per turn, along {}",
            percent(share),
            along.join(" and ")
        );
    }
    let size = |g: &&Group| if common == Common::Residual { g.mean_um.abs() } else { g.rms_um };
    match groups.iter().filter(|g| g.n > 0).max_by(|a, b| size(a).total_cmp(&size(b))) {
        Some(worst) => format!(
            "{} of the residual depends on {what}; worst at {} (mean {:+.1} µm, RMS {:.1} µm)",
            percent(share),
            worst.value,
            worst.mean_um,
            worst.rms_um
        ),
        None => format!("{} of the residual depends on {what}", percent(share)),
    }
}
