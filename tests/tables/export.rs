//! What an export writes.

use axiscal::fit::outcome::{Outcome, Parameter, Status};

/// A fit with these parameters: name, effect, value, unit, status.
pub fn outcome(machine: &str, parameters: &[(&str, &str, f64, &str, Status)]) -> Outcome {
    let parameters = parameters
        .iter()
        .map(|(name, effect, value, unit, status)| Parameter {
            name: (*name).to_owned(),
            alias: None,
            effect: (*effect).to_owned(),
            value: *value,
            unit: (*unit).to_owned(),
            sigma: Some(0.0002),
            expanded: Some(0.0004),
            status: *status,
        })
        .collect();
    Outcome {
        format: axiscal::fit::outcome::FORMAT.to_owned(),
        machine: machine.to_owned(),
        effects: vec![],
        converged: true,
        iterations: 4,
        stopped: String::new(),
        touches: 202,
        rejected: vec![],
        unknowns: 5,
        rank: 5,
        dof: 197,
        condition: 13.7,
        rms_um: 1.0,
        held_out_rms_um: None,
        noise_um: 1.0,
        noise_source: "declared".to_owned(),
        visit_um: 0.0,
        chi2_per_dof: 1.0,
        undetermined: vec![],
        parameters,
        reference_mm: [0.0; 3],
        residuals: None,
        warnings: vec![],
    }
}
