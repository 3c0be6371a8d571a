//! Two studies of one machine: which errors changed by more than their doubt, and did a compensation work?

use crate::fit::outcome::{Outcome, Status};
use crate::search::distributions::p_of_normal;
use crate::search::multiplicity::{FAMILY_LEVEL, holm};
use serde::{Deserialize, Serialize};

/// The format line of a verification.
pub const FORMAT: &str = "axiscal-verification/1";

/// Two-sided 95 % of a normal value.
const Z_95: f64 = 1.959_964;

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
    /// Is what the model leaves no more than noise?
    #[serde(default = "yes")]
    pub explained: bool,
}

/// Answers of older versions do not say it.
fn yes() -> bool {
    true
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
    /// Probability of a difference so large where nothing has changed, all errors compared counted in (Holm).
    #[serde(default)]
    pub p_adjusted: f64,
    /// Is that below 5 %?
    pub changed: bool,
}

/// An error that only one of the two studies tells.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Alone {
    /// ISO form.
    pub name: String,
    /// `before` or `after`: the study that tells it.
    pub told_by: String,
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
    NotImproved,
    /// At least one error differs by more than its doubt.
    Changed,
    /// None does.
    NotChanged,
    /// The studies hold other models: an error of one stands in others of the other.
    ModelsDiffer,
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
    /// Errors that only one of them identifies: nothing is said of their change.
    #[serde(default)]
    pub not_compared: Vec<Alone>,
    /// Effects of the study before that the model after lacks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub only_before: Vec<String>,
    /// Effects of the study after that the model before lacks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub only_after: Vec<String>,
    /// In words.
    pub says: String,
    /// What a reader must not miss.
    pub remarks: Vec<String>,
}

impl Verification {
    /// Do the two hold other models? Then no change of an error is spoken of: an effect that one of them lacks stands in its
    /// other errors.
    #[must_use]
    pub fn models_differ(&self) -> bool {
        !(self.only_before.is_empty() && self.only_after.is_empty())
    }
}

/// Effects of one model that the other lacks.
fn lacking(of: &Outcome, other: &Outcome) -> Vec<String> {
    of.effects.iter().filter(|e| !other.effects.contains(e)).cloned().collect()
}

/// Compares two fits; `figures` of both beside them.
#[must_use]
pub fn verify(
    (before, first): (&Outcome, Figures),
    (after, second): (&Outcome, Figures),
    question: Question,
    same_plans: bool,
) -> Verification {
    let mut rows: Vec<Row> = before
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
                // 95 % of a normal value lie within 1.96: the factor of few degrees of freedom is in the doubt already
                p_adjusted: p_of_normal(Z_95 * difference / expanded),
                changed: false,
            })
        })
        .collect();
    // with eight errors side by side one of them differs by more than its 95 % in every third pair of equal machines
    let adjusted = holm(&rows.iter().map(|r| r.p_adjusted).collect::<Vec<f64>>());
    let (only_before, only_after) = (lacking(before, after), lacking(after, before));
    let differ = !(only_before.is_empty() && only_after.is_empty());
    for (row, p) in rows.iter_mut().zip(adjusted) {
        (row.p_adjusted, row.changed) = (p, p < FAMILY_LEVEL && !differ);
    }
    let not_compared = [(before, after, "before"), (after, before, "after")]
        .into_iter()
        .flat_map(|(one, other, word)| {
            let told = |o: &Outcome, name: &str| {
                o.parameters.iter().any(|p| p.name == name && p.status == Status::Identified && p.sigma.is_some())
            };
            let own = one.parameters.iter().filter(|p| !p.name.contains('@'));
            let alone: Vec<Alone> = own
                .filter(|p| told(one, &p.name) && !told(other, &p.name))
                .map(|p| Alone { name: p.name.clone(), told_by: word.to_owned() })
                .collect();
            alone
        })
        .collect::<Vec<Alone>>();
    let n_changed = rows.iter().filter(|r| r.changed).count();
    // the mean square of ν normal residuals scatters by √(2/ν) of itself
    let scatter = |f: &Figures| (2.0 / f.readings_dof.max(1) as f64).sqrt();
    let clear = 1.0 - 2.0 * scatter(&first).hypot(scatter(&second));
    let improved = second.readings_rms_um.powi(2) < clear.max(0.0) * first.readings_rms_um.powi(2);
    let verdict = match question {
        Question::Compensation if improved => Verdict::Improved,
        Question::Compensation => Verdict::NotImproved,
        Question::Change if differ => Verdict::ModelsDiffer,
        Question::Change if n_changed > 0 => Verdict::Changed,
        Question::Change => Verdict::NotChanged,
    };
    let readings = format!(
        "the readings were off by {:.2} µm RMS and are off by {:.2} µm now, with a noise of {:.2} µm",
        first.readings_rms_um, second.readings_rms_um, second.noise_um
    );
    let says = match verdict {
        Verdict::Improved if second.explained => format!("the compensation works: {readings}"),
        // readings that are better by half may still be of blocks that the control takes for others
        Verdict::Improved => format!("better, but the model after does not explain all: {readings}"),
        Verdict::NotImproved => format!("no improvement: {readings}"),
        Verdict::Changed => {
            format!(
                "the machine has changed: {n_changed} of {} errors by more than their doubt; {readings}",
                rows.len()
            )
        }
        Verdict::ModelsDiffer => {
            format!("not comparable: the two studies hold other models; {readings}")
        }
        Verdict::NotChanged => {
            format!("no change: none of {} errors differs by more than its doubt; {readings}", rows.len())
        }
    };
    let mut remarks = Vec::new();
    if !same_plans {
        remarks.push("the two studies touched other points: compare the errors, not the RMS of the readings".into());
    }
    for (word, other, effects) in [("before", "after", &only_before), ("after", "before", &only_after)] {
        if !effects.is_empty() {
            remarks.push(format!(
                "the study {other} lacks {} of the model {word}: what they do stands in its other errors, which are not \
                 compared until both hold the same model",
                effects.join(", ")
            ));
        }
    }
    for (word, other) in [("before", "after"), ("after", "before")] {
        let names: Vec<&str> = not_compared.iter().filter(|a| a.told_by == word).map(|a| a.name.as_str()).collect();
        if !names.is_empty() {
            remarks.push(format!(
                "not compared, because only the study {word} determines them, and not the one {other}: {}",
                names.join(", ")
            ));
        }
    }
    if rows.is_empty() {
        remarks.push("no error is identified by both studies".into());
    }
    // where the model after fails, its errors are not the machine's: no reason to suspect what was loaded
    if question == Question::Compensation && !differ && second.explained {
        for r in rows.iter().filter(|r| r.changed && r.after.0.abs() > r.before.0.abs() + r.expanded) {
            remarks.push(format!("{} is larger than before: its sign or its unit may be wrong in the control", r.name));
        }
    }
    if verdict == Verdict::NotImproved && !differ && !rows.is_empty() && n_changed == 0 {
        let shows = |(value, sigma): (f64, f64)| value.abs() > Z_95 * sigma;
        // what no error of both tells may still be in the readings
        let off = first.readings_rms_um > 1.5 * first.noise_um;
        if off || rows.iter().any(|r| shows(r.before) && shows(r.after)) {
            remarks.push(
                "no error has changed by more than its doubt: the compensation did not act during the runs after, or its tables \
                 have no place for these errors (its README.txt says). Was it loaded and switched on, and does the study name it \
                 for the right runs?"
                    .into(),
            );
        } else if !rows.iter().any(|r| shows(r.before)) {
            remarks.push("the study before shows no error beyond its doubt: nothing was left to improve".into());
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
        not_compared,
        only_before,
        only_after,
        says,
        remarks,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::outcome::Parameter;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const NAMES: [&str; 8] = ["EX0B", "EZ0B", "EA0B", "EC0B", "EX0C", "EY0C", "EA0C", "EB0C"];

    fn outcome(values: &[f64], names: &[&str]) -> Outcome {
        let parameter = |(name, value): (&&str, &f64)| Parameter {
            name: (*name).to_owned(),
            value: *value,
            sigma: Some(1.0),
            expanded: Some(Z_95),
            interval: None,
            holds: Vec::new(),
            status: Status::Identified,
            alias: None,
            effect: String::new(),
            unit: "um".to_owned(),
            sigma_noise: None,
            sigma_type_b: None,
            sigma_with_unmodelled: None,
            moves_with_unseen: None,
        };
        Outcome { parameters: names.iter().zip(values).map(parameter).collect(), ..Outcome::default() }
    }

    fn compared(b: &Outcome, a: &Outcome) -> Verification {
        let figures =
            Figures { readings_rms_um: 1.0, readings_dof: 300, fit_rms_um: 1.0, noise_um: 1.0, explained: true };
        verify((b, figures), (a, figures), Question::Change, true)
    }

    /// Readings that are better while the model after fails prove no compensation, and its errors accuse no sign.
    #[test]
    fn what_the_model_after_does_not_explain_proves_nothing() {
        let (before, after) = (outcome(&[9.0, 1.0], &NAMES[..2]), outcome(&[0.0, 20.0], &NAMES[..2]));
        let figures = |rms, explained| Figures {
            readings_rms_um: rms,
            readings_dof: 300,
            fit_rms_um: 1.0,
            noise_um: 1.0,
            explained,
        };
        let says = |explained| {
            let answer = verify(
                (&before, figures(20.0, true)),
                (&after, figures(10.0, explained)),
                Question::Compensation,
                true,
            );
            assert_eq!(answer.verdict, Verdict::Improved);
            let accuses = answer.remarks.iter().any(|r| r.contains("EZ0B is larger than before"));
            (answer.says.starts_with("the compensation works"), accuses)
        };
        assert_eq!((says(true), says(false)), ((true, true), (false, false)));
    }

    #[test]
    fn equal_machines_are_said_to_have_changed_in_five_of_a_hundred_pairs() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(31);
        let mut draw = |more: f64| -> Outcome {
            let mut values: Vec<f64> = (0..8).map(|_| StandardNormal.sample(&mut rng)).collect();
            values[0] += more;
            outcome(&values, &NAMES)
        };
        let pairs = 1000;
        let changed = (0..pairs).filter(|_| compared(&draw(0.0), &draw(0.0)).verdict == Verdict::Changed).count();
        // 5 % and three standard errors; without counting all eight in it is a third
        assert!(changed < 71, "{changed} of {pairs}");
        assert!(changed > 20, "{changed} of {pairs}: it must be able to say so");
        let found = (0..100).filter(|_| compared(&draw(0.0), &draw(7.0)).parameters[0].changed).count();
        assert!(found > 95, "{found}");
    }

    #[test]
    fn what_one_study_alone_tells_is_listed() {
        let (b, a) = (outcome(&[1.0, 2.0], &["EX0B", "EZ0B"]), outcome(&[1.0, 2.0], &["EX0B", "EB0C"]));
        let v = compared(&b, &a);
        assert_eq!(v.parameters.len(), 1);
        let alone = |name: &str, told_by: &str| Alone { name: name.into(), told_by: told_by.into() };
        assert_eq!(v.not_compared, [alone("EZ0B", "before"), alone("EB0C", "after")]);
        assert!(v.remarks.iter().any(|r| r.contains("not compared") && r.contains("EZ0B")), "{:?}", v.remarks);
    }
}
