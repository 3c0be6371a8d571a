//! The study's model is changed: the model before and after, both fitted on the same touches.

use super::history::{history_path, read_history, step};
use super::{Environment, Loaded, load_study};
use crate::compare::change::{self, change};
use crate::compare::parameter_combinations::{Bracket, Together, bracket, together};
use crate::diag::{Failure, Result};
use crate::fit::{self, Fit, held_out};
use crate::report::ladder::HeldOutDoubt;
use crate::study::edit;
use crate::study::history::{History, Step};
use std::path::Path;

#[derive(Debug, Clone, Copy)]
pub enum Edit<'a> {
    Add(&'a [String]),
    Remove(&'a [String]),
    /// These effects and no others.
    Become(&'a [String]),
}

impl Edit<'_> {
    /// The study's text with it.
    ///
    /// # Errors
    /// When an effect is unknown, does not apply, is in the model or is not.
    pub fn text(&self, loaded: &Loaded) -> Result<String> {
        match self {
            Self::Add(ids) => {
                ids.iter().try_for_each(|id| applies(loaded, id))?;
                edit::add(&loaded.text(), ids)
            }
            Self::Remove(ids) => {
                ids.iter().try_for_each(|id| nothing_said_of(loaded, id))?;
                edit::remove(&loaded.text(), ids)
            }
            Self::Become(ids) => {
                let now = &loaded.study.effects;
                let new: Vec<String> = ids.iter().filter(|id| !now.contains(id)).cloned().collect();
                let gone: Vec<String> = now.iter().filter(|id| !ids.contains(id)).cloned().collect();
                new.iter().try_for_each(|id| applies(loaded, id))?;
                gone.iter().try_for_each(|id| nothing_said_of(loaded, id))?;
                // first what is new: a model may not be without effects
                edit::remove(&edit::add(&loaded.text(), &new)?, &gone)
            }
        }
    }
}

/// A change of the model, with what it does.
#[derive(Debug)]
pub struct Changed {
    /// The study with the new model.
    pub loaded: Loaded,
    pub before: Fit,
    pub after: Fit,
    /// The history with both models.
    pub history: History,
    pub parameters: change::Change,
    /// Error on the last run, which had no part in the fit, before and after, µm.
    pub later_run_rms_um: (Option<f64>, Option<f64>),
    pub held_out: HeldOutDoubt,
    /// Combinations of new parameters that are determined only together.
    pub together: Vec<Together>,
    /// New jumps, by the touches on both sides.
    pub between: Vec<Bracket>,
}

impl Loaded {
    /// What another model does. `nested_rms_um`: the cross-validated error where the choice of the effect was redone for
    /// each fold.
    ///
    /// # Errors
    /// When an effect is unknown, does not apply, is in the model or is not, or a fit is impossible.
    pub fn change(&self, edit: Edit, nested_rms_um: Option<f64>, mut history: History) -> Result<Changed> {
        let loaded = self.with_text(&edit.text(self)?)?;
        let (before, after) = (self.fit(&self.settings())?, loaded.fit(&loaded.settings())?);
        history.push(step(self, &before));
        history.push(Step { nested_rms_um, ..step(&loaded, &after) });
        let by_visit = (held_out::by_visit(&before), held_out::by_visit(&after));
        let fall = match &by_visit {
            (Some(b), Some(a)) => held_out::fall(b, a, &before.data.visits),
            _ => None,
        };
        let later = |fit: &Fit| held_out::later_run(fit).map(|h| h.rms_um);
        let se = |h: &Option<held_out::HeldOut>| h.as_ref().and_then(|h| h.standard_error_um);
        let held_out = HeldOutDoubt {
            standard_errors: (se(&by_visit.0), se(&by_visit.1)),
            fall,
            nested_rms_um,
            n_groups: by_visit.1.as_ref().map_or(0, |h| h.groups),
        };
        let parameters = change(&before.outcome, &after.outcome, fall);
        let new = after.outcome.effects.iter().filter(|e| !before.outcome.effects.contains(e));
        Ok(Changed {
            later_run_rms_um: (later(&before), later(&after)),
            together: new.filter_map(|id| together(&after, id)).collect(),
            between: parameters.new.iter().filter_map(|p| bracket(&after, &self.catalogue, p)).collect(),
            held_out,
            parameters,
            history,
            loaded,
            before,
            after,
        })
    }
}

/// Changes the model of the study at `path`, and keeps both models in its history. With `dry_run` the files stay as they
/// are.
///
/// # Errors
/// As [`Loaded::change`], and when the study is unusable or was changed meanwhile.
pub fn change_study(
    path: &Path,
    edit: Edit,
    nested_rms_um: Option<f64>,
    dry_run: bool,
    env: &dyn Environment,
) -> Result<Changed> {
    // from here to the last byte written nobody else changes it
    let _alone = if dry_run { None } else { Some(env.lock(path)?) };
    let before = load_study(path, env)?;
    let history = read_history(path, env)?.unwrap_or_default();
    let changed = before.change(edit, nested_rms_um, history)?;
    if !dry_run {
        if env.read(path)? != before.bytes {
            return Err(Failure::new("study::changed", format!("{} was changed meanwhile", path.display()))
                .help("nothing was written: call again"));
        }
        env.write(path, Some(&changed.loaded.bytes))?;
        env.write(&history_path(path), Some(changed.history.to_json()?.as_bytes()))?;
    }
    Ok(changed)
}

/// Is the effect known, for this machine, and not in the model?
fn applies(loaded: &Loaded, id: &str) -> Result<()> {
    if loaded.study.effects.iter().any(|e| e == id) {
        return Err(Failure::new("study::in_model", format!("effect {id:?} is in the model already"))
            .help("`axiscal identify` says what it comes to"));
    }
    if loaded.catalogue.get(id, &loaded.machine).is_some() {
        return Ok(());
    }
    if loaded.catalogue.knows(id) {
        // the sentence of the fit: which axis is missing
        return fit::effects_of(&[id.to_owned()], &loaded.catalogue, &loaded.machine).map(|_| ());
    }
    let mut near: Vec<(f64, &str)> = loaded
        .catalogue
        .iter()
        .filter(|e| e.applies_to(&loaded.machine))
        .map(|e| (strsim::jaro_winkler(id, &e.id), e.id.as_str()))
        .collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0));
    near.dedup_by(|a, b| a.1 == b.1);
    let names: Vec<&str> = near.iter().filter(|n| n.0 > 0.7).take(3).map(|n| n.1).collect();
    let help = match &names[..] {
        [] => "`axiscal effects --machine …` lists them".to_owned(),
        names => format!("did you mean {}? `axiscal effects` lists all", names.join(", ")),
    };
    Err(Failure::new("model::unknown_effect", format!("no effect is called {id:?}")).help(help))
}

/// What the study says of a parameter would be said of nothing.
fn nothing_said_of(loaded: &Loaded, id: &str) -> Result<()> {
    let mut of_effect = loaded.catalogue.iter().filter(|e| e.id == id).flat_map(|e| &e.parameters);
    let said = of_effect.find_map(|p| loaded.study.knowledge.keys().find(|k| crate::symbols::same(&p.name, k)));
    match said {
        None => Ok(()),
        Some(name) => Err(Failure::new("study::still_said", format!("the study says something of {name}"))
            .help(format!("take [model.parameters.{name}] out of the study first"))),
    }
}
