//! What the touches say of every effect, worked out behind the fit: first the score tests of the list, then the whole
//! diagnosis.

use super::draft::Draft;
use super::session::Snapshot;
use crate::diag::Result;
use crate::diagnose::candidate_effects::Named;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::{Diagnosis, Options};
use crate::fit::Fit;
use crate::search::Search;
use crate::search::held_out::Colours;
use serde::Serialize;

/// What the touches say of one effect that is not in the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scored {
    pub effect: String,
    /// Does it leave a trace in these touches?
    pub visible: bool,
    /// Probability of so much misfit in its direction where nothing is missing.
    pub p: f64,
    /// Its natural logarithm, which is finite where p is not.
    pub ln_p: f64,
    /// The same, with all effects that were tested counted in (Holm).
    pub p_adjusted: f64,
    /// Does it pass Holm's test? Whether it is proposed the diagnosis says, which also looks at touches left out.
    pub passes: bool,
    /// The same in words: how far it is beyond the noise.
    pub likely: &'static str,
    /// Share of the misfit's sum of squares that it takes away.
    pub share: f64,
    pub parameters: Vec<Size>,
    /// What it would take away from the residual of each touch, µm, to first order: for the small picture beside its name.
    /// Only the strongest candidates have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub curve_um: Option<Vec<f64>>,
}

/// Numbers of all small pictures together.
const MOST_NUMBERS: usize = 30_000;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Size {
    pub name: String,
    pub value: f64,
    pub unit: String,
    pub sigma: f64,
}

/// The score tests of all effects that are not in the model, the most significant first.
#[must_use]
pub fn scores(state: &Snapshot) -> Vec<Scored> {
    let (fit, opened) = (&*state.fit, &*state.opened);
    if fit.n_used() == 0 || fit.dof == 0 {
        return Vec::new();
    }
    let evidence = Evidence::from_fit(fit);
    let named = Named::for_fit(fit, &evidence, &opened.machine, &opened.catalogue);
    let search = Search::new(evidence.question(), &named.library);
    let total = evidence.residual.norm_squared().max(f64::MIN_POSITIVE);
    let pictures = (MOST_NUMBERS / fit.data.observations.len().max(1)).clamp(3, 30);
    let drawn: std::collections::HashSet<usize> =
        search.ranking().into_iter().filter(|&i| search.scores[i].visible()).take(pictures).collect();
    let colours = evidence.colours_um(fit);
    let each = search.scores.iter().enumerate().map(|(i, s)| {
        let columns = &named.columns[i];
        let sizes = columns.iter().zip(s.estimate.iter()).enumerate().map(|(k, (c, estimate))| Size {
            name: c.name.clone(),
            value: estimate * c.typical,
            unit: c.unit.clone(),
            sigma: s.covariance.get((k, k)).map_or(f64::NAN, |v| v.max(0.0).sqrt() * c.typical),
        });
        Scored {
            effect: named.effects[i].id.clone(),
            visible: s.visible(),
            p: s.p,
            ln_p: s.ln_p,
            p_adjusted: s.p_adjusted,
            likely: crate::words::diagnose::beyond_noise(s.p_adjusted),
            passes: s.proposed(),
            share: (s.delta_ss / total).clamp(0.0, 1.0),
            // sets of many blocks say nothing to a reader
            curve_um: drawn.contains(&i).then(|| taken_away_um(fit, &evidence, &colours, &search, i)),
            parameters: if columns.len() > 12 { Vec::new() } else { sizes.collect() },
        }
    });
    let mut out: Vec<Scored> = each.collect();
    out.sort_by(|a, b| b.visible.cmp(&a.visible).then(a.ln_p.total_cmp(&b.ln_p)).then(a.effect.cmp(&b.effect)));
    out
}

/// What candidate `i` takes away from each touch, µm, to first order; 0 where a touch is not used.
fn taken_away_um(fit: &Fit, evidence: &Evidence, colours: &Colours, search: &Search, i: usize) -> Vec<f64> {
    // columns are what a size adds to the residual
    let rows = -evidence.base.project(&(search.columns(i) * &search.scores[i].estimate));
    let mut of_visit: std::collections::BTreeMap<usize, Vec<usize>> = std::collections::BTreeMap::new();
    for (row, visit) in evidence.visits.iter().enumerate() {
        of_visit.entry(*visit).or_default().push(row);
    }
    let mut out = vec![0.0; fit.data.observations.len()];
    for (visit, of) in of_visit {
        let white = nalgebra::DMatrix::from_fn(of.len(), 1, |k, _| rows[of[k]]);
        let um = colours.touches(visit, &white);
        for (k, row) in of.into_iter().enumerate() {
            out[evidence.used[row]] = (um[(k, 0)] * 1e3).round() / 1e3 + 0.0;
        }
    }
    out
}

/// The whole diagnosis.
///
/// # Errors
/// When a refit is impossible.
pub fn diagnosis(state: &Snapshot) -> Result<Diagnosis> {
    state.opened.diagnose(&state.opened.quick_settings(), &state.fit, &Options::default())
}

/// A starting formula for what no known effect explains, and on what it rests.
///
/// # Errors
/// When nothing significant is left, or what is left has no formula.
pub fn sketched(state: &Snapshot) -> Result<(Draft, String)> {
    let settings = state.opened.quick_settings();
    let knows = |id: &str| state.opened.catalogue.knows(id);
    let made = crate::diagnose::sketch::sketch(state.opened.subject(&settings, &state.fit), &knows)?;
    Ok((Draft::from_row(&made.toml)?, made.says))
}
