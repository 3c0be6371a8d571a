//! Two studies of one machine: which errors changed by more than their doubt, and did a compensation work?

use crate::fit::outcome::{Outcome, Status};
use serde::{Deserialize, Serialize};

/// The format line of a verification.
pub const FORMAT: &str = "axiscal-verification/1";

/// What was measured of one of the two studies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// RMS of the readings when only the blocks' set-up and the pre-travel are fitted, µm: the machine's errors as they
    /// show.
    pub readings_rms_um: f64,
    /// Degrees of freedom of that.
    pub readings_dof: usize,
    /// RMS of what the study's model leaves, µm.
    pub fit_rms_um: f64,
    /// Standard deviation of a touch, µm.
    pub noise_um: f64,
}

/// One error in both studies. mm, deg or as the unit says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// ISO form.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Value and standard uncertainty before.
    pub before: (f64, f64),
    /// Value and standard uncertainty after.
    pub after: (f64, f64),
    /// After less before.
    pub difference: f64,
    /// Expanded uncertainty (95 %) of the difference.
    pub expanded: f64,
    /// Is the difference larger than that?
    pub changed: bool,
}

/// What was done between the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// Another compensation acted in the second: did it help?
    Compensation,
    /// Nothing: has the machine changed?
    Change,
}

/// The answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The machine's errors are smaller than before.
    Improved,
    /// They are not.
    NotImproved,
    /// At least one error differs by more than its doubt.
    Changed,
    /// None does.
    NotChanged,
}

/// Two studies side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// `axiscal-verification/1`
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// What was asked.
    pub question: Question,
    /// The answer.
    pub verdict: Verdict,
    /// The first study.
    pub before: Figures,
    /// The second study.
    pub after: Figures,
    /// Errors that both identify.
    pub parameters: Vec<Row>,
    /// In words.
    pub says: String,
    /// What a reader must not miss.
    pub remarks: Vec<String>,
}

/// Compares two fits; `figures` of both beside them.
#[must_use]
pub fn verify(
    (before, first): (&Outcome, Figures),
    (after, second): (&Outcome, Figures),
    question: Question,
    same_plans: bool,
) -> Verification {
    let rows: Vec<Row> = before
        .parameters
        .iter()
        .filter(|p| !p.name.contains('@') && p.status == Status::Identified)
        .filter_map(|b| {
            let a = after.parameters.iter().find(|a| a.name == b.name && a.status == Status::Identified)?;
            let (sb, sa, eb, ea) = (b.sigma?, a.sigma?, b.expanded?, a.expanded?);
            let difference = a.value - b.value;
            let expanded = eb.hypot(ea);
            Some(Row {
                name: b.name.clone(),
                unit: b.unit.clone(),
                before: (b.value, sb),
                after: (a.value, sa),
                difference,
                expanded,
                changed: difference.abs() > expanded,
            })
        })
        .collect();
    let n_changed = rows.iter().filter(|r| r.changed).count();
    // the mean square of ν normal residuals scatters by √(2/ν) of itself
    let scatter = |f: &Figures| (2.0 / f.readings_dof.max(1) as f64).sqrt();
    let clear = 1.0 - 2.0 * scatter(&first).hypot(scatter(&second));
    let improved = second.readings_rms_um.powi(2) < clear.max(0.0) * first.readings_rms_um.powi(2);
    let verdict = match question {
        Question::Compensation if improved => Verdict::Improved,
        Question::Compensation => Verdict::NotImproved,
        Question::Change if n_changed > 0 => Verdict::Changed,
        Question::Change => Verdict::NotChanged,
    };
    let readings = format!(
        "the readings were off by {:.2} um RMS and are off by {:.2} um now, with a noise of {:.2} um",
        first.readings_rms_um, second.readings_rms_um, second.noise_um
    );
    let says = match verdict {
        Verdict::Improved => format!("the compensation works: {readings}"),
        Verdict::NotImproved => format!("no improvement: {readings}"),
        Verdict::Changed => {
            format!("the machine has changed: {n_changed} of {} errors by more than their doubt; {readings}", rows.len())
        }
        Verdict::NotChanged => {
            format!("no change: none of {} errors differs by more than its doubt; {readings}", rows.len())
        }
    };
    let mut remarks = Vec::new();
    if !same_plans {
        remarks.push("the two studies touched other points: compare the errors, not the RMS of the readings".into());
    }
    if rows.is_empty() {
        remarks.push("no error is identified by both studies".into());
    }
    if question == Question::Compensation {
        for r in rows.iter().filter(|r| r.changed && r.after.0.abs() > r.before.0.abs()) {
            remarks.push(format!("{} is larger than before: its sign or its unit may be wrong in the control", r.name));
        }
    }
    let reference = |o: &Outcome| o.reference_mm;
    if reference(before) != reference(after) {
        remarks.push("the location errors are stated at different points".into());
    }
    Verification {
        format: FORMAT.into(),
        machine: before.machine.clone(),
        question,
        verdict,
        before: first,
        after: second,
        parameters: rows,
        says,
        remarks,
    }
}
