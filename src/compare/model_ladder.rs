//! The models of a ladder on the same touches: what each of them leaves of every touch, and the curve of what was added
//! between two of them.

use super::Point;
use crate::diag::Result;
use crate::fit::{Fit, Settings, held_out, identify_data};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Data;
use crate::units::um_from_mm;
use serde::Serialize;

/// Most models of a ladder that are fitted again: the first and the last ones.
pub const MOST: usize = 9;

/// A variable with more distinct values than this is drawn in bins.
const MOST_PLACES: usize = 40;

/// How many bins.
const BINS: usize = 24;

/// What a rung stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The machine as it stands: only what belongs to the measurement (places of the blocks, the probe) is solved for.
    Uncorrected,
    /// A model that was tried before.
    Tried,
    /// The study's model.
    Current,
    /// The study's model with what the diagnosis proposes.
    Proposed,
}

/// One model on the study's touches.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rung {
    /// What it stands for.
    pub kind: Kind,
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// Effects that it has and the rung before has not.
    pub added: Vec<String>,
    /// Effects that the rung before has and it has not.
    pub removed: Vec<String>,
    /// √(Σr²/n) over the touches used, µm.
    pub rms_um: f64,
    /// RMS on index visits that were left out of the fit, µm.
    pub held_out_rms_um: Option<f64>,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Free parameters.
    pub unknowns: usize,
    /// Measured less model along the outward normal, µm, touch by touch.
    pub residual_um: Vec<f64>,
}

impl Rung {
    /// A fit as a rung.
    #[must_use]
    pub fn from_fit(fit: &Fit, kind: Kind) -> Self {
        let o = &fit.outcome;
        Self {
            kind,
            effects: o.effects.clone(),
            added: Vec::new(),
            removed: Vec::new(),
            rms_um: o.rms_um,
            // a quick fit leaves it out
            held_out_rms_um: o.held_out_rms_um.or_else(|| held_out::by_visit(fit).map(|h| h.rms_um)),
            chi2_per_dof: o.chi2_per_dof,
            unknowns: o.unknowns,
            residual_um: fit.residual_mm.iter().map(|r| um_from_mm(*r)).collect(),
        }
    }
}

/// A ladder on one set of touches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ladder {
    /// The rungs, the machine as it stands first.
    pub rungs: Vec<Rung>,
    /// Models that could not be fitted again, and why.
    pub notes: Vec<String>,
}

/// Fits the machine as it stands and the models that were tried; `current` is not fitted again.
///
/// `tried`: the effects of each model, the first one first. Of equal neighbours one stays.
#[must_use]
pub fn climb(
    machine: &Machine,
    catalogue: &Catalogue,
    settings: &Settings,
    current: &Fit,
    tried: &[Vec<String>],
) -> Ladder {
    let mut out = Ladder::default();
    let own = &current.outcome.effects;
    let bare: Vec<String> =
        own.iter().filter(|id| catalogue.get(id, machine).is_some_and(|e| e.nuisance)).cloned().collect();
    let mut models: Vec<(Kind, Vec<String>)> = Vec::new();
    if bare.len() < own.len() {
        models.push((Kind::Uncorrected, bare));
    }
    let mut before: Vec<(Kind, Vec<String>)> = Vec::new();
    for effects in tried {
        if before.last().is_none_or(|(_, last)| last != effects) {
            before.push((Kind::Tried, effects.clone()));
        }
    }
    // the last one that was tried is the study's own, unless somebody edited the study by hand
    if before.last().is_some_and(|(_, last)| last == own) {
        before.pop();
    }
    let surplus = before.len().saturating_sub(MOST);
    if surplus > 0 {
        before.drain(1..=surplus);
        out.notes.push(format!("{surplus} models between the first and the last ones are not drawn"));
    }
    models.append(&mut before);
    for (kind, effects) in models {
        match refit(machine, catalogue, settings, current, effects.clone()) {
            Ok(fit) => out.push(Rung::from_fit(&fit, kind)),
            Err(failure) => {
                out.notes.push(format!("the model {} cannot be fitted any more: {failure}", effects.join(", ")))
            }
        }
    }
    out.push(Rung::from_fit(current, Kind::Current));
    out
}

/// Another model on the touches of a fit.
fn refit(
    machine: &Machine,
    catalogue: &Catalogue,
    settings: &Settings,
    current: &Fit,
    effects: Vec<String>,
) -> Result<Fit> {
    let data: Data = current.data.clone();
    let mut settings = Settings { effects, quick: true, ..settings.clone() };
    settings.reference = Some(current.model.reference);
    // what is said of a parameter holds where the model has it
    let here: Vec<&crate::model::catalogue::Effect> =
        settings.effects.iter().filter_map(|id| catalogue.get(id, machine)).collect();
    let has = |name: &str| {
        let plain = name.split('@').next().unwrap_or(name);
        let of = |p: &crate::model::catalogue::Parameter| {
            crate::symbols::same(&p.name, plain) || p.alias.as_deref() == Some(plain)
        };
        here.iter().any(|e| e.parameters.iter().any(of))
    };
    settings.knowledge.retain(|name, _| has(name));
    identify_data(machine, catalogue, data, &settings)
}

impl Ladder {
    /// Puts a rung on top.
    pub fn push(&mut self, mut rung: Rung) {
        if let Some(last) = self.rungs.last() {
            rung.added = rung.effects.iter().filter(|e| !last.effects.contains(e)).cloned().collect();
            rung.removed = last.effects.iter().filter(|e| !rung.effects.contains(e)).cloned().collect();
        }
        self.rungs.push(rung);
    }
}

/// In which direction of R a touch shows a displacement: the one nearest to its normal, and whether the normal points up
/// it (+1) or down it (-1). The residual times that is how far the ball stands off in this direction.
#[must_use]
pub fn direction(normal: &[f64; 3]) -> (usize, f64) {
    let k = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(0);
    (k, if normal[k] < 0.0 { -1.0 } else { 1.0 })
}

/// What was added between two rungs, against a variable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// An axis letter, `time`, `order` or `approach`.
    pub variable: String,
    /// `X`, `Y`, `Z`: displacement of the ball in this direction of R; `normal`: along the touched faces.
    pub direction: &'static str,
    /// Number of the rung before.
    pub from: usize,
    /// Number of the rung after.
    pub to: usize,
    /// Values of the variable: mm, deg, h.
    pub x: Vec<f64>,
    /// What the model of the later rung holds and that of the earlier one does not, µm (mean of the touches there).
    pub y_um: Vec<f64>,
}

const DIRECTIONS: [&str; 3] = ["X", "Y", "Z"];

/// The curves between two rungs against each variable.
#[must_use]
pub fn curves(points: &[Point], rungs: &[Rung], from: usize, to: usize, variables: &[String]) -> Vec<Curve> {
    let (Some(a), Some(b)) = (rungs.get(from), rungs.get(to)) else { return Vec::new() };
    let mut out = Vec::new();
    for variable in variables {
        // the direction of approach is that of the face: the probe's own errors act along it
        let along_normal = variable == "approach";
        let kinds: &[&'static str] = if along_normal { &["normal"] } else { &DIRECTIONS };
        for (k, name) in kinds.iter().enumerate() {
            let mut places: Vec<(f64, f64)> = Vec::new();
            for (i, p) in points.iter().enumerate() {
                let (towards, sign) = direction(&p.normal);
                let Some(x) = p.value(variable).filter(|x| x.is_finite()) else { continue };
                let added = a.residual_um[i] - b.residual_um[i];
                if !added.is_finite() || (!along_normal && towards != k) {
                    continue;
                }
                places.push((x, if along_normal { added } else { sign * added }));
            }
            let (x, y_um) = means(places);
            if x.len() > 1 {
                out.push(Curve { variable: variable.clone(), direction: name, from, to, x, y_um });
            }
        }
    }
    out
}

/// Means at the places where touches are, or in bins of equally many.
fn means(mut places: Vec<(f64, f64)>) -> (Vec<f64>, Vec<f64>) {
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let span = places.last().map_or(0.0, |l| l.0) - places.first().map_or(0.0, |f| f.0);
    let near = span * 1e-3;
    let mut groups: Vec<Vec<(f64, f64)>> = Vec::new();
    for p in &places {
        match groups.last_mut() {
            Some(group) if group.first().is_some_and(|q| p.0 - q.0 <= near) => group.push(*p),
            _ => groups.push(vec![*p]),
        }
    }
    if groups.len() > MOST_PLACES {
        let size = places.len().div_ceil(BINS).max(1);
        groups = places.chunks(size).map(<[_]>::to_vec).collect();
    }
    let mean = |g: &Vec<(f64, f64)>, k: fn(&(f64, f64)) -> f64| g.iter().map(k).sum::<f64>() / g.len() as f64;
    (groups.iter().map(|g| mean(g, |p| p.0)).collect(), groups.iter().map(|g| mean(g, |p| p.1)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_displacement_in_x_has_one_sign_on_both_faces() {
        assert_eq!(direction(&[1.0, 0.0, 0.0]), (0, 1.0));
        assert_eq!(direction(&[-0.9, 0.1, 0.43]), (0, -1.0));
        assert_eq!(direction(&[0.0, 0.0, -1.0]), (2, -1.0));
    }

    #[test]
    fn few_places_keep_their_own_mean_and_many_are_binned() {
        let (x, y) = means(vec![(90.0, 1.0), (0.0, 3.0), (90.0, 2.0), (0.001, 5.0)]);
        assert_eq!(x.len(), 2, "{x:?}");
        assert!((y[0] - 4.0).abs() < 1e-12 && (y[1] - 1.5).abs() < 1e-12);
        let (x, _) = means((0..500).map(|i| (f64::from(i), 0.0)).collect());
        assert!(x.len() <= BINS && x.windows(2).all(|w| w[0] < w[1]));
        assert!(means(Vec::new()).0.is_empty());
    }
}
