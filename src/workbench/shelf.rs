//! Fits that were made already, and what the touches say beside them: a way back to a model that was looked at costs
//! nothing, and what is likely to be clicked next is fitted before it is.
//!
//! A fit depends on the touches, the catalogue and the settings, and on nothing else: not on the models before it. What
//! the shelf gives is therefore what a fresh fit would say, to the bit.

use super::record::Behind;
use super::session::Snapshot;
use super::{Opened, server};
use crate::diag::Result;
use crate::fit::{self, Fit, Settings};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Instant;

const MOST_FITS: usize = 32;
/// Touches of all fits that are kept: some hundred megabytes.
const MOST_TOUCHES: usize = 160_000;
/// Candidates that are fitted before anybody asks.
const AHEAD: usize = 3;

struct Kept {
    /// Number of the reading.
    inputs: u64,
    settings: Settings,
    fit: Arc<Fit>,
    behind: Option<Behind>,
}

/// The models that were fitted, the last used one first.
#[derive(Default)]
pub struct Shelf {
    kept: Mutex<VecDeque<Kept>>,
}

impl Shelf {
    /// The fit of a study as reading number `inputs` has it, and the milliseconds that it took: none where it is here.
    ///
    /// # Errors
    /// As [`fit::identify_data`].
    pub fn fit(&self, opened: &Opened, inputs: u64, settings: Settings) -> Result<(Arc<Fit>, f64)> {
        if let Some(fit) = self.with(inputs, &settings, |kept| kept.fit.clone()) {
            return Ok((fit, 0.0));
        }
        let began = Instant::now();
        let data = crate::model::data::Data::clone(&opened.data);
        let fit = Arc::new(fit::identify_data(&opened.machine, &opened.catalogue, data, &settings)?);
        let mut all = server::lock(&self.kept);
        all.push_front(Kept { inputs, settings, fit: fit.clone(), behind: None });
        // other readings do not come back
        all.retain(|k| k.inputs == inputs);
        let touches = fit.data.observations.len().max(1);
        all.truncate(MOST_FITS.min((MOST_TOUCHES / touches).max(2)));
        Ok((fit, began.elapsed().as_secs_f64() * 1e3))
    }

    fn with<T>(&self, inputs: u64, settings: &Settings, take: impl FnOnce(&mut Kept) -> T) -> Option<T> {
        let mut all = server::lock(&self.kept);
        let at = all.iter().position(|k| k.inputs == inputs && k.settings == *settings)?;
        let mut kept = all.remove(at)?;
        let taken = take(&mut kept);
        all.push_front(kept);
        Some(taken)
    }

    /// What the touches say beside a state, where it was worked out before.
    #[must_use]
    pub fn behind(&self, now: &Snapshot) -> Option<Behind> {
        let found = self.with(now.inputs, &now.opened.quick_settings(), |kept| kept.behind.clone())??;
        Some(Behind { version: now.version, ms: 0.0, ..found })
    }

    pub fn keep_behind(&self, now: &Snapshot, behind: &Behind) {
        self.with(now.inputs, &now.opened.quick_settings(), |kept| kept.behind = Some(behind.clone()));
    }

    /// Fits what is likely to be clicked next: the first candidates switched on, then each effect switched off, the last
    /// one first. Ends as soon as `wanted` says so.
    pub fn ahead(&self, now: &Snapshot, behind: &Behind, wanted: impl Fn() -> bool) {
        let base = now.opened.quick_settings();
        let with = behind.diagnosis.iter().flat_map(|d| &d.candidates).take(AHEAD).map(|c| {
            let mut effects = base.effects.clone();
            effects.push(c.effect.clone());
            effects
        });
        let without = base.effects.iter().rev().filter(|_| base.effects.len() > 1).map(|gone| {
            let left = base.effects.iter().filter(|e| *e != gone);
            left.cloned().collect::<Vec<_>>()
        });
        // time constants and periods are searched from several starts, which takes long: what is said of the next state
        // must not wait for that
        let searched = |id: &String| {
            let effect = now.opened.catalogue.get(id, &now.opened.machine);
            effect.is_some_and(|e| e.parameters.iter().any(|p| p.shape.is_some()))
        };
        for effects in with.chain(without).filter(|effects| !effects.iter().any(searched)) {
            if !wanted() {
                return;
            }
            // what cannot be fitted says so when it is asked for
            let _ = self.fit(&now.opened, now.inputs, Settings { effects, ..base.clone() });
        }
    }
}
