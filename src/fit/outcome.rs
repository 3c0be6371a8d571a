//! What a fit says: values with their doubt, what cannot be told, and why it stopped (`axiscal-fit/1`).

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format line of a fit.
pub const FORMAT: &str = "axiscal-fit/1";

/// The answer of `identify`. Displacements in mm, tilts in deg.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Where that comes from: `repeats`, `declared`, `residuals`.
    pub noise_source: String,
    /// Scatter per index visit, µm.
    pub visit_um: f64,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Combinations that the data cannot tell.
    pub undetermined: Vec<Undetermined>,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Where location errors of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
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
}

/// A combination that the data cannot tell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Undetermined {
    /// Scaled weights of the parameters in it.
    pub combination: BTreeMap<String, f64>,
    /// In words.
    pub says: String,
}

/// Is the value a result?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// Determined by the data.
    Identified,
    /// Held by the user.
    Fixed,
    /// Known from its prior rather than from the data.
    PriorDominated,
    /// The data cannot tell it.
    Undetermined,
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// ISO form, e.g. `EX0B`.
    pub name: String,
    /// The paper's form, e.g. `d_xBZ`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub alias: Option<String>,
    /// Id of its effect.
    pub effect: String,
    /// Value.
    pub value: f64,
    /// `mm`, `deg`, …
    pub unit: String,
    /// Standard uncertainty; none when undetermined or fixed.
    pub sigma: Option<f64>,
    /// Expanded uncertainty (95 %).
    pub expanded: Option<f64>,
    /// Is the value a result?
    pub status: Status,
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
}
