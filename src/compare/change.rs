//! One study, two models: what the change made better and what it made worse.

use crate::fit::outcome::{Outcome, Parameter, Status};
use serde::{Deserialize, Serialize};

/// A standard uncertainty that grows by more than this is worth a warning.
const MUCH_WORSE: f64 = 3.0;

/// A residual that falls or rises by less than this share of itself has not changed.
const WORTH_SAYING: f64 = 1e-3;

/// A parameter before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pair {
    /// ISO form.
    pub name: String,
    /// `mm`, `deg`, …
    pub unit: String,
    /// Value and standard uncertainty before; none where it was not told.
    pub before: Option<(f64, f64)>,
    /// The same after.
    pub after: Option<(f64, f64)>,
    /// Uncertainty after over that before.
    pub times: Option<f64>,
}

/// What a change of the model did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Results of both models.
    pub kept: Vec<Pair>,
    /// Results of the new model alone.
    pub new: Vec<Parameter>,
    /// What a reader must not miss.
    pub remarks: Vec<String>,
}

fn known(p: &Parameter) -> Option<(f64, f64)> {
    p.sigma.filter(|_| matches!(p.status, Status::Identified | Status::PriorDominated)).map(|s| (p.value, s))
}

/// Compares two fits of the same touches.
///
/// `fall`: by how much the error on touches left out falls, with its standard error, µm.
#[must_use]
pub fn change(before: &Outcome, after: &Outcome, fall: Option<(f64, f64)>) -> Change {
    let results =
        |o: &Outcome| -> Vec<Parameter> { o.parameters.iter().filter(|p| !p.name.contains('@')).cloned().collect() };
    let (was, is) = (results(before), results(after));
    let kept: Vec<Pair> = was
        .iter()
        .filter_map(|b| {
            let a = is.iter().find(|a| a.name == b.name)?;
            let (before, after) = (known(b), known(a));
            let times = before.zip(after).map(|(b, a)| a.1 / b.1).filter(|t| t.is_finite());
            Some(Pair { name: b.name.clone(), unit: b.unit.clone(), before, after, times })
        })
        .collect();
    let new: Vec<Parameter> = is.iter().filter(|a| !was.iter().any(|b| b.name == a.name)).cloned().collect();
    let mut remarks = Vec::new();
    let fell = after.rms_um < (1.0 - WORTH_SAYING) * before.rms_um;
    let lead = if fell { "the residual fell, but " } else { "" };
    for p in &kept {
        match (p.times, p.before, p.after) {
            (Some(times), ..) if times > MUCH_WORSE => {
                remarks.push(format!("{lead}{} is now known {times:.1} times worse", p.name));
            }
            (None, Some(_), None) => remarks.push(format!("{lead}{} can no longer be determined", p.name)),
            _ => {}
        }
    }
    if let Some((fall, se)) = fall.filter(|f| f.0 < -WORTH_SAYING * after.rms_um) {
        let much = if -fall > se { "" } else { ", which is within its standard error" };
        remarks.push(format!("the cross-validated error rises by {:.3} ± {se:.3} µm{much}", -fall));
    }
    for u in after.undetermined.iter().filter(|u| !before.undetermined.iter().any(|b| b.says == u.says)) {
        remarks.push(format!("new, cannot be determined: {}", u.says));
    }
    let gone: Vec<&Parameter> = new.iter().filter(|p| p.status == Status::Identified).collect();
    for p in gone {
        if p.expanded.is_some_and(|e| p.value.abs() < e) {
            remarks.push(format!("{} is smaller than its 95 % uncertainty: this data does not show it", p.name));
        }
    }
    if !after.converged {
        remarks.push(format!("the search did not converge: {}", after.stopped));
    }
    Change { kept, new, remarks }
}
