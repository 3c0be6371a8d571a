//! The ladder: every model that was tried on a study, with its errors (`axiscal-history/1`).

use crate::diag::{Failure, Result, Source, from_json};
use serde::{Deserialize, Serialize};

/// The format line of a history.
pub const FORMAT: &str = "axiscal-history/1";

/// All models that were tried, the first one first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct History {
    /// `axiscal-history/1`
    pub format: String,
    /// The models.
    pub steps: Vec<Step>,
}

/// One model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number, from 1.
    pub step: usize,
    /// Ids of the effects.
    pub effects: Vec<String>,
    /// Effects that it has and the model before had not.
    #[serde(default)]
    pub added: Vec<String>,
    /// Effects that the model before had and it has not.
    #[serde(default)]
    pub removed: Vec<String>,
    /// √(Σr²/n) over the touches used, µm.
    pub rms_um: f64,
    /// RMS on index visits that were left out of the fit, µm.
    pub held_out_rms_um: Option<f64>,
    /// Standard error of that, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out_se_um: Option<f64>,
    /// Where the search chose what was added: the same with the choice redone for each visit left out, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nested_rms_um: Option<f64>,
    /// RMS on the study's last run when the others alone are fitted, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub later_run_rms_um: Option<f64>,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Standard deviation of a touch that it is held against, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_um: Option<f64>,
    /// Scatter of index visits that it is held against, µm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visit_um: Option<f64>,
    /// Free parameters.
    #[serde(default)]
    pub unknowns: usize,
    /// SHA-256 of the plans and logs on which it was fitted.
    #[serde(default)]
    pub data_sha256: String,
}

impl Default for History {
    fn default() -> Self {
        Self { format: FORMAT.into(), steps: Vec::new() }
    }
}

impl History {
    /// Reads a history.
    ///
    /// # Errors
    /// When the text is no history.
    pub fn parse(source: &Source) -> Result<Self> {
        let help = "it is written by `axiscal add` and `remove`; delete it to begin a new ladder";
        let history: Self =
            serde_json::from_str(source.inner()).map_err(|e| from_json(&e, source, "history::not_json").help(help))?;
        if history.format != FORMAT {
            return Err(Failure::new(
                "history::format",
                format!("{} is no history of this program: its format is {:?}", source.name(), history.format),
            )
            .help(help));
        }
        Ok(history)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// Never for numbers that JSON can hold.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map(|text| text + "\n")
            .map_err(|e| Failure::new("history::unwritable", format!("the history cannot be written: {e}")))
    }

    /// Puts a model at the end, unless it is the one that stands there already, on the same data.
    pub fn push(&mut self, mut step: Step) {
        if let Some(last) = self.steps.last_mut() {
            if last.effects == step.effects && last.data_sha256 == step.data_sha256 {
                let nested_rms_um = step.nested_rms_um.or(last.nested_rms_um);
                let (added, removed) = (last.added.clone(), last.removed.clone());
                step = Step { step: last.step, added, removed, nested_rms_um, ..step };
                *last = step;
                return;
            }
            step.added = step.effects.iter().filter(|e| !last.effects.contains(e)).cloned().collect();
            step.removed = last.effects.iter().filter(|e| !step.effects.contains(e)).cloned().collect();
        }
        step.step = self.steps.last().map_or(1, |last| last.step + 1);
        self.steps.push(step);
    }

    /// This one with the steps at its end that `other` has made since both were as `before`.
    #[must_use]
    pub fn followed_by(mut self, other: &Self, before: &Self) -> Self {
        // the last step of then may have got further figures since
        for step in other.steps.iter().skip(before.steps.len().saturating_sub(1)) {
            let of_now = |s: &&mut Step| s.effects == step.effects && s.data_sha256 == step.data_sha256;
            match self.steps.iter_mut().skip(before.steps.len().saturating_sub(1)).find(of_now) {
                Some(there) if there.held_out_rms_um.is_some() => {}
                Some(there) => {
                    let (number, added, removed) = (there.step, there.added.clone(), there.removed.clone());
                    *there = Step { step: number, added, removed, ..step.clone() };
                }
                None => self.push(step.clone()),
            }
        }
        self
    }

    /// Steps that were fitted on other data than these.
    #[must_use]
    pub fn on_other_data(&self, data_sha256: &str) -> Vec<usize> {
        self.steps
            .iter()
            .filter(|s| !s.data_sha256.is_empty() && s.data_sha256 != data_sha256)
            .map(|s| s.step)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_two_writers_are_all_kept() {
        let step = |effects: &str, held_out_rms_um| Step {
            effects: effects.split('+').map(str::to_owned).collect(),
            held_out_rms_um,
            ..Step::default()
        };
        let mut before = History::default();
        before.push(step("a", None));
        let (mut there, mut own) = (before.clone(), before.clone());
        there.push(step("a+b", None));
        own.push(step("a", Some(1.0)));
        own.push(step("a+c", Some(2.0)));
        let merged = there.followed_by(&own, &before);
        let steps: Vec<(usize, String, Option<f64>)> =
            merged.steps.iter().map(|s| (s.step, s.effects.join("+"), s.held_out_rms_um)).collect();
        assert_eq!(
            steps,
            [(1, "a".to_owned(), Some(1.0)), (2, "a+b".to_owned(), None), (3, "a+c".to_owned(), Some(2.0))]
        );
        assert_eq!(
            (merged.steps[2].added.clone(), merged.steps[2].removed.clone()),
            (vec!["c".to_owned()], vec!["b".to_owned()])
        );
    }
}
