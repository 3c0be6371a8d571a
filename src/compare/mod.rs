//! Model against measurement: where does it fail?
//!
//! [`compare`] is a pure function of a fit. What it returns is what the terminal, the report and the workbench draw.

pub mod by_direction;
pub mod change;
mod factors;
pub mod model_ladder;
pub mod parameter_combinations;
mod share;
pub mod variables;
pub mod verify;

pub use share::Share;

use crate::fit::{self, Fit, VisitSource, noise};
use crate::model::formula::slot;
use crate::units::um_from_mm;
use serde::{Deserialize, Serialize};
use share::Misfit;
use std::collections::BTreeMap;

/// The format line of a comparison.
pub const FORMAT: &str = "axiscal-comparison/1";

/// Worst touches that are listed.
const N_WORST: usize = 10;

/// Where a model fails.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// `axiscal-comparison/1`
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// Ids of the effects in the model.
    pub effects: Vec<String>,
    /// √(Σr²/n) over the touches used, µm.
    pub rms_um: f64,
    /// RMS on index visits that were left out of the fit, µm.
    pub held_out_rms_um: Option<f64>,
    /// Standard deviation of a touch, µm.
    pub noise_um: f64,
    /// Where that comes from: `repeats`, `declared`, `study`.
    pub noise_source: String,
    /// Scatter of index visits, µm.
    #[serde(default)]
    pub visit_um: f64,
    /// Where that comes from: `revisits`, `declared`, `study`, `one pose`.
    #[serde(default)]
    pub visit_source: VisitSource,
    /// Both in a sentence.
    #[serde(default)]
    pub noise_says: String,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Degrees of freedom.
    pub dof: usize,
    /// True when the noise explains what is left (99.9 %), its size and the way it is spread.
    pub explained_by_noise: bool,
    /// Touches that cannot be used: most of them found nothing.
    #[serde(default)]
    pub missed: usize,
    /// All in a sentence.
    pub says: String,
    /// Ways to split the touches, the one that explains most with the fewest groups first.
    pub splits: Vec<Split>,
    /// The touches furthest off, worst first, those that were not used included.
    pub worst: Vec<Worst>,
    /// Every touch with what it may depend on.
    pub points: Vec<Point>,
}

/// One way to split the touches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Split {
    /// `stage`, `pose.C`, `block`, `face`, `direction`, `X`, `time`, `feed`, `spindle`, `stylus`, `run`.
    pub by: String,
    /// Share of the misfit (its excess over the noise) that goes with it, 0 to 1. Splits overlap: shares need not add up.
    pub share: f64,
    /// Probability that noise alone does as well.
    pub p: f64,
    /// Free numbers that it has beside the model.
    pub columns: usize,
    /// Schwarz's criterion: how much better the touches are described, less the price of the columns. Splits are sorted by it.
    pub evidence: f64,
    /// Of a rotary axis: harmonics of its position, each alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub harmonics: Vec<Harmonic>,
    /// The groups in their order.
    pub groups: Vec<Group>,
    /// In words.
    pub says: String,
}

/// A harmonic of the position of a rotary axis, as a displacement in R.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    /// Times per turn.
    pub order: usize,
    /// Share of the misfit, all directions together.
    pub share: f64,
    /// Share of the misfit in X, Y and Z alone.
    pub along: [f64; 3],
}

/// Touches with one value of what they are split by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// The value, or the range of a bin.
    pub value: String,
    /// Mean value, where it is a number: mm, deg, h, mm/min.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<f64>,
    /// Touches used.
    pub n: usize,
    /// Mean residual, µm.
    pub mean_um: f64,
    /// Root mean square of the residuals, µm.
    pub rms_um: f64,
}

/// A touch that is far off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Worst {
    /// Which run of the study, from 1.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Line in the log, from 1.
    pub line: usize,
    /// Measured less model along the outward normal, µm.
    pub residual_um: f64,
    /// Externally studentised.
    pub standardised: f64,
    /// The block as it stood.
    pub block: String,
    pub face: String,
    /// Rotary axes, deg.
    pub pose: BTreeMap<String, f64>,
    /// Why it was not used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rejected: Option<String>,
}

/// One touch with what its residual may depend on. Lengths mm, angles deg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Which run of the study, from 1.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Line in the log, from 1.
    pub line: usize,
    /// Order in the study, from 1.
    pub order: usize,
    /// Measured less model along the outward normal, µm.
    pub residual_um: f64,
    /// Externally studentised.
    pub standardised: f64,
    /// False for a touch that is not used.
    pub used: bool,
    /// Stage of the program.
    pub stage: String,
    /// The block as it stood.
    pub block: String,
    pub face: String,
    /// Index visit, counted through all runs.
    pub visit: usize,
    /// Axis positions at the trigger: those of the machine.
    pub axes: BTreeMap<String, f64>,
    /// Outward normal in R.
    pub normal: [f64; 3],
    /// Direction of the approach about the probe's axis, deg, −180 to 180; none along the axis.
    pub approach_deg: Option<f64>,
    /// Hours since the first touch.
    pub time_h: f64,
    /// Temperature, °C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[serde(rename = "temperature_degC")]
    pub temperature_deg_c: Option<f64>,
    /// Feed of the touch, mm/min.
    pub feed_mm_min: f64,
    /// Orientation of the spindle.
    pub spindle_deg: f64,
    /// Pivot to ball.
    pub stylus_mm: f64,
}

impl Point {
    /// Value of something to plot against: an axis letter, `time`, `order`, `approach`, `stylus`.
    #[must_use]
    pub fn value(&self, variable: &str) -> Option<f64> {
        match variable {
            "time" => Some(self.time_h),
            "order" => Some(self.order as f64),
            "approach" => self.approach_deg,
            "stylus" => Some(self.stylus_mm),
            axis => self.axes.get(axis).copied(),
        }
    }
}

/// Compares a fit with its touches.
#[must_use]
pub fn compare(fit: &Fit) -> Comparison {
    let points = points(fit);
    let chi2_per_dof = if fit.dof > 0 { fit.chi2 / fit.dof as f64 } else { f64::NAN };
    // where most touches found nothing the rest is no sample of the machine
    let no_sample = fit.data.mostly_missed();
    let explained_by_noise = !no_sample && (fit.dof == 0 || chi2_per_dof <= fit.noise.limit(fit.dof));
    let mut splits = factors::splits(fit, &points, &Misfit::new(fit));
    let rank = |s: &Split| (s.share >= factors::WORTH_NAMING, s.evidence);
    splits.sort_by(|a, b| rank(b).0.cmp(&rank(a).0).then(rank(b).1.total_cmp(&rank(a).1)));
    let rms_um = fit.outcome.rms_um;
    let noise_um = um_from_mm(fit.noise.sigma_mm);
    // the misfit is held against both
    let visits_um = um_from_mm(fit.noise.tau_mm);
    let noise_words = noise_words(noise_um, visits_um);
    let first = splits.first().filter(|s| s.share >= factors::WORTH_NAMING);
    let misses = format!("the residual is {}", fit.noise.times(chi2_per_dof.sqrt()));
    let says = match (fit.dof, explained_by_noise, first) {
        _ if no_sample => format!(
            "{} of {} touches cannot be used: the others say nothing about the machine",
            fit.data.unusable.len(),
            fit.data.made()
        ),
        (0, _, _) => "there are as many unknowns as touches: the model cannot be judged".to_owned(),
        (_, true, _) => {
            format!("the residual of {rms_um:.2} µm is explained by {noise_words}: the model fits")
        }
        (_, false, Some(split)) => {
            format!("{misses}; {}", split.says)
        }
        (_, false, None) => format!("{misses}, and depends on nothing in particular"),
    };
    Comparison {
        format: FORMAT.into(),
        machine: fit.outcome.machine.clone(),
        effects: fit.outcome.effects.clone(),
        rms_um,
        held_out_rms_um: fit.outcome.held_out_rms_um,
        noise_um,
        noise_source: fit.noise.source.as_str().into(),
        visit_um: fit.outcome.visit_um,
        visit_source: fit.noise.visit_source,
        noise_says: fit.noise.says(),
        chi2_per_dof,
        dof: fit.dof,
        explained_by_noise,
        missed: fit.data.unusable.len(),
        says,
        splits,
        worst: worst(fit, &points),
        points,
    }
}

/// What the misfit is held against: the noise of a touch, and the scatter of index visits where it was measured.
fn noise_words(noise_um: f64, visits_um: f64) -> String {
    if visits_um > 0.0 {
        format!("a noise of {noise_um:.2} µm and a scatter of index positions of {visits_um:.2} µm")
    } else {
        format!("a noise of {noise_um:.2} µm")
    }
}

/// What a diagnosis found the misfit to depend on: named first, and in the same words.
#[derive(Debug, Clone, PartialEq)]
pub struct Lead {
    /// `pose.C`, `axis.X`, `time`, `before.B`, …
    pub by: String,
    /// Share of the misfit beyond the noise.
    pub share: f64,
    /// In a sentence.
    pub says: String,
}

impl Comparison {
    /// The same comparison with what a diagnosis found in front, best first. Its tests try many more forms than groups of
    /// equal values (orders, periods, places of a step) and pay for them: where they speak, they say it better.
    #[must_use]
    pub fn led_by(mut self, leads: &[Lead]) -> Self {
        let Some(first) = leads.first() else { return self };
        // the further ones explain much of the same: their own splits say how much
        let leads = &leads[..1];
        let mut front: Vec<Split> = Vec::new();
        for lead in leads {
            let by = match lead.by.as_str() {
                "length" => "stylus",
                other => other.strip_prefix("axis.").unwrap_or(other),
            };
            let split = match self.splits.iter().position(|s| s.by == by) {
                Some(i) => self.splits.remove(i),
                None if front.iter().any(|s| s.by == by) => continue,
                None => Split {
                    by: by.to_owned(),
                    share: lead.share,
                    p: 0.0,
                    columns: 0,
                    evidence: 0.0,
                    harmonics: Vec::new(),
                    groups: Vec::new(),
                    says: String::new(),
                },
            };
            front.push(Split { share: lead.share, says: lead.says.clone(), ..split });
        }
        front.append(&mut self.splits);
        self.splits = front;
        let noise_words =
            noise_words(self.noise_um, if self.visit_source == VisitSource::Declared { 0.0 } else { self.visit_um });
        self.says = if self.explained_by_noise && first.by == "visit" {
            // the scatter of visits is the finding, and the model has no part in it
            format!("the residual of {:.2} µm is explained by {noise_words}. {}", self.rms_um, first.says)
        } else if std::mem::take(&mut self.explained_by_noise) {
            // the size alone would do, the way it is spread does not
            format!(
                "the size of the residual, {:.2} µm, is explained by {noise_words}, but its pattern is not: {}",
                self.rms_um, first.says
            )
        } else {
            let times = noise::times_in_words(self.chi2_per_dof.sqrt(), self.visit_um);
            format!("the residual is {times}; {}", first.says)
        };
        self
    }
}

/// Every touch with what its residual may depend on.
#[must_use]
pub fn points(fit: &Fit) -> Vec<Point> {
    let axes: Vec<crate::axes::AxisName> = fit.model.axes();
    let each = fit.data.observations.iter().zip(&fit.data.origins).enumerate().map(|(i, (o, origin))| {
        let s = &o.state;
        let across = (s[slot::NORMAL_IN_PROBE], s[slot::NORMAL_IN_PROBE + 1]);
        Point {
            run: o.run + 1,
            id: o.id,
            line: origin.line,
            order: i + 1,
            residual_um: um_from_mm(fit.residual_mm[i]),
            standardised: fit.studentised[i],
            used: fit.weight[i] > 0.0,
            stage: origin.stage.clone(),
            block: origin.block.clone(),
            face: origin.face.clone(),
            visit: fit.data.visits[i] + 1,
            axes: axes.iter().map(|a| (a.letter().to_string(), o.position.get(*a))).collect(),
            normal: [0, 1, 2].map(|k| s[slot::NORMAL_IN_R + k]),
            // the ball comes against the normal
            approach_deg: (across.0.hypot(across.1) > 0.1)
                .then(|| crate::units::deg_from_rad((-across.1).atan2(-across.0))),
            time_h: s[slot::HOURS],
            temperature_deg_c: o.has_temperature.then_some(s[slot::TEMPERATURE]),
            feed_mm_min: s[slot::FEED],
            spindle_deg: crate::units::deg_from_rad(s[slot::SPINDLE]),
            stylus_mm: s[slot::LENGTHS],
        }
    });
    each.collect()
}

fn worst(fit: &Fit, points: &[Point]) -> Vec<Worst> {
    let badness = |i: usize| {
        if fit.weight[i] > 0.0 { fit.studentised[i].abs() } else { fit.residual_mm[i].abs() / fit.noise.sigma_mm }
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| badness(b).total_cmp(&badness(a)));
    let each = order.into_iter().take(N_WORST).map(|i| {
        let p = &points[i];
        Worst {
            run: p.run,
            id: p.id,
            line: p.line,
            residual_um: p.residual_um,
            standardised: p.standardised,
            block: p.block.clone(),
            face: p.face.clone(),
            pose: p
                .axes
                .iter()
                .filter(|(a, _)| matches!(a.as_str(), "A" | "B" | "C"))
                .map(|(a, v)| (a.clone(), *v))
                .collect(),
            rejected: fit.rejected.get(&i).map(fit::Reason::says),
        }
    });
    each.collect()
}
