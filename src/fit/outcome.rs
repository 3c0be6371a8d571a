//! What a fit says: values with their doubt, what cannot be told, and why it stopped (`axiscal-fit/1`).

use super::remark::{NoiseSource, VisitSource};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format line of a fit.
pub const FORMAT: &str = "axiscal-fit/1";

/// The answer of `identify`. Displacements in mm, tilts in deg.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// `axiscal-fit/1`
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// Ids of the effects in the model.
    pub effects: Vec<String>,
    /// Did it converge?
    pub converged: bool,
    /// Steps taken.
    pub iterations: usize,
    /// By which test it stopped.
    pub stopped: String,
    /// Touches in the data.
    pub touches: usize,
    /// Touches that were not used, each with its reason.
    pub rejected: Vec<Rejected>,
    /// Free parameters.
    pub unknowns: usize,
    /// Rank of the scaled Jacobian.
    pub rank: usize,
    /// Degrees of freedom.
    pub dof: usize,
    /// Condition number of the scaled Jacobian over its rank.
    pub condition: f64,
    /// √(Σr²/n) over the touches kept, µm.
    pub rms_um: f64,
    /// RMS on touches that were left out of the fit, µm; null where none were.
    #[serde(default)]
    pub held_out_rms_um: Option<f64>,
    /// Standard deviation of a touch, µm.
    pub noise_um: f64,
    /// Where that comes from.
    pub noise_source: NoiseSource,
    /// Degrees of freedom of that; none where it is taken as known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_dof: Option<f64>,
    /// Scatter per index visit, µm.
    pub visit_um: f64,
    /// The same as the residuals show it, µm, where only a declared one is known: uncertainties are computed with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visit_shown_um: Option<f64>,
    /// Where `visit_um` comes from.
    #[serde(default)]
    pub visit_source: VisitSource,
    /// Degrees of freedom of that; none where it is taken as known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visit_dof: Option<f64>,
    /// Both in a sentence.
    #[serde(default)]
    pub noise_says: String,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Points about which axes turn where they should not, each in a sentence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turns_about: Vec<TurnsAbout>,
    /// Combinations that the data cannot tell.
    pub undetermined: Vec<Undetermined>,
    /// What would tell all of them together: variations of the touches, chosen one after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parted_together: Vec<String>,
    /// Combinations that no variation determines.
    #[serde(skip)]
    pub never_determined: usize,
    /// Combinations that the data determine no better than their typical sizes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub weak: Vec<Combination>,
    pub parameters: Vec<Parameter>,
    /// Pairs of results that are least told apart, worst first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub correlations: Vec<Correlation>,
    /// The priors that entered the fit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub priors: Vec<PriorRow>,
    /// Uncertainties of the measurement itself that widen the results.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub type_b: Vec<TypeBRow>,
    /// Where location errors of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
    /// Covariance of the results with the type B rows, on request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Covariance>,
    /// The same without the type B rows, on request and where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance_type_a: Option<Covariance>,
    /// Residuals, on request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residuals: Option<Vec<Residual>>,
    /// Remarks that a reader must not miss.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// A touch that was not used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rejected {
    /// Number in the plan.
    pub id: u64,
    /// Which run of the study, from 1.
    pub run: usize,
    /// Why.
    pub reason: String,
    /// It is far from the planned position.
    #[serde(default, skip_serializing)]
    pub is_far: bool,
}

/// A combination that the data cannot tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Undetermined {
    /// Scaled weights of the parameters in it.
    pub combination: BTreeMap<String, f64>,
    /// In words.
    pub says: String,
    /// By how much the machine's errors in it move the touch that they move most, at the values that stand for all of it, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moves_um: Option<f64>,
    /// What would part them: variations of the touches, cheapest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parted_by: Vec<String>,
}

/// A combination that is known badly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Combination {
    /// Weights of the parameters in it, each in units of its typical size.
    pub combination: BTreeMap<String, f64>,
    /// Its standard uncertainty in units of the typical size.
    pub times_typical: f64,
    /// In words.
    pub says: String,
}

/// Two results that go together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Correlation {
    pub a: String,
    /// The other.
    pub b: String,
    /// Their correlation coefficient.
    pub r: f64,
}

/// A prior that entered the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PriorRow {
    /// Parameter.
    pub name: String,
    /// Expected value.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Their unit.
    pub unit: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TypeBRow {
    /// Parameter that is not solved for.
    pub name: String,
    /// Standard uncertainty.
    pub sigma: f64,
    /// Its unit.
    pub unit: String,
}

/// Covariance matrix of some parameters, in their units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Covariance {
    /// The parameters.
    pub names: Vec<String>,
    /// Row by row.
    pub matrix: Vec<Vec<f64>>,
}

/// Is the value a result?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Determined by the data.
    Identified,
    /// Held by the user.
    Fixed,
    /// Known from priors, its own or those of others, rather than from the data: most of its variance is theirs.
    PriorDominated,
    /// The data cannot tell it.
    Undetermined,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// ISO form, e.g. `EX0B`.
    pub name: String,
    /// The paper's form, e.g. `d_xBZ`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alias: Option<String>,
    /// Id of its effect.
    pub effect: String,
    pub value: f64,
    /// `mm`, `deg`, …
    pub unit: String,
    /// Standard uncertainty from the noise and the type B rows; none when undetermined or fixed.
    pub sigma: Option<f64>,
    /// Expanded uncertainty (95 %, Student's t with the degrees of freedom of the noise); of a shape parameter, and of a size
    /// beside one, the wider side of its interval.
    pub expanded: Option<f64>,
    /// The ends of the 95 % interval of a shape parameter (a time constant, a pitch), and of a size beside one that is told weakly,
    /// in its unit: its doubt is not the same on both sides. An end that the touches do not set is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<[Option<f64>; 2]>,
    /// Standard uncertainty from the touches' own noise alone: the scatter of index visits, from whatever source, has no part
    /// in it, and neither have type B rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_noise: Option<f64>,
    /// Standard uncertainty from the type B rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_type_b: Option<f64>,
    /// How far the value moves while the combinations that leave no trace move by their usual size: in `sigma`. Not there where
    /// the value does not depend on them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moves_with_unseen: Option<f64>,
    /// Standard uncertainty when everything that the model leaves out acts at its typical size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_with_unmodelled: Option<f64>,
    /// Effects outside of the model that these touches cannot tell from it: what they do stands in its value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holds: Vec<String>,
    /// Is the value a result?
    pub status: Status,
}

/// The point about which an effect turns its axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurnsAbout {
    /// Id of the effect.
    pub effect: String,
    /// Name of the parameter that says how far it is, or how much it turns.
    pub parameter: String,
    pub says: String,
}

/// Residual of one touch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    /// Number in the plan.
    pub id: u64,
    /// Which run of the study, from 1.
    pub run: usize,
    /// Measured less model along the outward normal, µm.
    pub residual_um: f64,
    /// Externally studentised.
    pub standardised: f64,
    /// False for a touch that does not belong to the rest.
    #[serde(default = "yes")]
    pub used: bool,
}

fn yes() -> bool {
    true
}
