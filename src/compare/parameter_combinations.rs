//! What a fit tells of an effect whose parameters it does not tell one by one.

use crate::fit::Fit;
use crate::fit::outcome::Parameter;
use crate::model::catalogue::Catalogue;
use crate::search::{Basis, KEPT};
use crate::units::um_from_mm;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// What the parameters of an effect do together, where a part of them leaves no trace beside the rest of the model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Together {
    /// Id of the effect.
    pub effect: String,
    /// By how much the part that is told moves the touch that it moves most, µm.
    pub moves_um: f64,
    /// Its standard uncertainty, µm.
    pub sigma_um: f64,
}

/// Between which values of a variable a jump lies: those of the last touch before it and the first one after it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bracket {
    /// Name of the parameter.
    pub name: String,
    /// Its unit, that of the two values.
    pub unit: String,
    /// The last touch before.
    pub from: f64,
    /// The first touch after.
    pub to: f64,
}

/// With the decimals that a doubt leaves: two significant ones of it.
fn digits(value: f64, doubt: f64) -> String {
    let decimals = if doubt > 0.0 { (1 - doubt.log10().floor() as i32).clamp(0, 12) as usize } else { 6 };
    format!("{value:.decimals$}")
}

impl Together {
    /// In words.
    #[must_use]
    pub fn says(&self) -> String {
        let (size, doubt) = (digits(self.moves_um, self.sigma_um), digits(self.sigma_um, self.sigma_um));
        format!("together they move a touch by up to {size} ± {doubt} µm")
    }
}

impl Bracket {
    /// In words.
    #[must_use]
    pub fn says(&self) -> String {
        let doubt = 0.1 * (self.to - self.from);
        format!("{} between {} and {} {}", self.name, digits(self.from, doubt), digits(self.to, doubt), self.unit)
    }
}

/// Of an effect of the model of which some parameter has no size of its own; `None` where all have one, or none leaves a
/// trace. With the columns A of the effect (in typical sizes) and P what the rest of the model cannot follow, sizes along the
/// directions that PA sees, and their covariance (AᵀPA)⁺.
#[must_use]
pub fn together(fit: &Fit, effect: &str) -> Option<Together> {
    let unknown = |c: usize| &fit.model.unknowns[fit.free[c]];
    let own = |c: &usize| unknown(*c).effect == effect && !unknown(*c).shape;
    let (of, others): (Vec<usize>, Vec<usize>) = (0..fit.free.len()).partition(own);
    let alone = |p: &Parameter| p.effect == effect && p.sigma.is_none();
    let names = |p: &Parameter| of.iter().any(|&c| unknown(c).name == p.name);
    if of.is_empty() || !fit.outcome.parameters.iter().any(|p| alone(p) && names(p)) {
        return None;
    }
    let typical = |c: usize| if unknown(c).typical > 0.0 { unknown(c).typical } else { 1.0 };
    let free = fit.free_theta();
    let (raw_mm, white) = fit.with_touches(fit.noise.tau_mm, |t| (t.unwhitened(&free).1, t.dense(&free).1));
    let mut columns = white.select_columns(&of);
    let mut scale = DVector::zeros(of.len());
    for (k, (mut column, &c)) in columns.column_iter_mut().zip(&of).enumerate() {
        column *= typical(c);
        scale[k] = column.norm();
    }
    let left = Basis::new(&white.select_columns(&others)).project_columns(&columns);
    let unit = |k: usize| if scale[k] > 0.0 { scale[k] } else { 1.0 };
    let gram = left.tr_mul(&left);
    let eigen = DMatrix::from_fn(of.len(), of.len(), |i, j| gram[(i, j)] / (unit(i) * unit(j))).symmetric_eigen();
    let seen: Vec<usize> = (0..of.len()).filter(|&k| eigen.eigenvalues[k] > KEPT * KEPT).collect();
    if seen.is_empty() {
        return None;
    }
    let v = eigen.eigenvectors.select_columns(&seen);
    let inverse =
        DMatrix::from_diagonal(&DVector::from_iterator(seen.len(), seen.iter().map(|&k| 1.0 / eigen.eigenvalues[k])));
    let theta = DVector::from_fn(of.len(), |k, _| fit.theta[fit.free[of[k]]] / typical(of[k]) * unit(k));
    let theta = &v * (v.transpose() * theta);
    let covariance = &v * inverse * v.transpose();
    let row = |i: usize| DVector::from_fn(of.len(), |k, _| um_from_mm(raw_mm[(i, of[k])]) * typical(of[k]) / unit(k));
    let used = (0..fit.weight.len()).filter(|&i| fit.weight[i] > 0.0);
    let most = used.map(|i| (row(i), row(i).dot(&theta).abs())).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let sigma_um = most.0.dot(&(covariance * &most.0)).max(0.0).sqrt();
    Some(Together { effect: effect.to_owned(), moves_um: most.1, sigma_um })
}

/// Of a parameter at which something jumps (a moment, a place); `None` for others, and where no touch lies on one of its
/// sides.
#[must_use]
pub fn bracket(fit: &Fit, catalogue: &Catalogue, p: &Parameter) -> Option<Bracket> {
    let variable =
        catalogue.iter().filter(|e| e.id == p.effect).flat_map(|e| &e.parameters).find(|q| q.name == p.name)?.between?;
    let used = fit.data.observations.iter().zip(&fit.weight).filter(|(_, w)| **w > 0.0);
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for (o, _) in used {
        let value = o.state[variable];
        if value < p.value {
            from = from.max(value);
        } else {
            to = to.min(value);
        }
    }
    (from.is_finite() && to.is_finite()).then(|| Bracket { name: p.name.clone(), unit: p.unit.clone(), from, to })
}
