//! A study is fitted and diagnosed.

use super::{Environment, Loaded};
use crate::compare::{Comparison, Lead, compare};
use crate::design;
use crate::diag::Result;
use crate::diagnose::solving::{self, Ending, Host};
use crate::diagnose::{Diagnosis, Options, Subject, diagnose};
use crate::fit::{Fit, Settings, uncertainty};

/// A diagnosis of which the verdict and the first candidate are asked: no refit, no power.
pub const VERDICT: Options<'static> = Options { at_most: 1, refit: false, power: false, planned: None };

impl Loaded {
    /// What is diagnosed: refits leave out the figures that need the whole catalogue.
    #[must_use]
    pub fn subject<'a>(&'a self, settings: &'a Settings, fit: &'a Fit) -> Subject<'a> {
        Subject { machine: &self.machine, catalogue: &self.catalogue, settings, fit }
    }

    /// The settings of the study without the figures that need the whole catalogue.
    #[must_use]
    pub fn quick_settings(&self) -> Settings {
        Settings { quick: true, ..self.settings() }
    }

    /// Which effect a fit of this study lacks. The plans are given where they are asked: for touches that would separate
    /// effects, and for mistakes that make touches miss.
    ///
    /// # Errors
    /// When a refit is impossible.
    pub fn diagnose(&self, settings: &Settings, fit: &Fit, options: &Options) -> Result<Diagnosis> {
        let is_asked = options.refit || fit.data.mostly_missed();
        let planned = if is_asked { self.planned() } else { Vec::new() };
        let settings = Settings { quick: true, ..settings.clone() };
        let options = Options { planned: is_asked.then_some(&planned[..]), ..*options };
        diagnose(self.subject(&settings, fit), &options)
    }

    /// Diagnoses, adds an effect and fits again, until the model is complete or the host ends it.
    ///
    /// # Errors
    /// When a fit is impossible, or the host's own.
    pub fn solve(&self, (at_most, at_most_size): (usize, f64), host: &mut dyn Host) -> Result<Ending> {
        let (settings, planned) = (self.settings(), self.planned());
        let request = solving::Request {
            machine: &self.machine,
            catalogue: &self.catalogue,
            settings: &settings,
            fit: &|settings| self.fit(settings),
            options: Options { planned: Some(&planned), ..Options::default() },
            at_most,
            at_most_size,
        };
        solving::solve(request, host)
    }

    /// The errors of the machine, each with its uncertainty and what limits it.
    ///
    /// # Errors
    /// When the model, the touches or a compensation are unusable.
    pub fn identify(&self, settings: &Settings, env: &dyn Environment) -> Result<Fit> {
        let mut fit = self.fit(settings)?;
        if !settings.bare {
            design::explain(&self.machine, &self.catalogue, &self.runs(), &mut fit)?;
        }
        if let Some(active) = self.active(env)? {
            let on = self.transformation() == Some(true);
            let idle = if on { 0 } else { active.idle_without_transformation(&self.machine) };
            let acts = active.terms.len().saturating_sub(idle);
            if acts > 0 || idle == 0 {
                fit.outcome.warnings.push(format!(
                    "a compensation with {acts} terms was active: the values are what it leaves, not the machine's whole errors"
                ));
            }
            if idle > 0 {
                fit.outcome.warnings.push(format!(
                    "a compensation with {idle} terms that do not act on axis positions was loaded: the values are the machine's whole errors there"
                ));
            }
        }
        Ok(fit)
    }

    /// Where a fit fails, led by what its diagnosis found.
    ///
    /// # Errors
    /// When a refit is impossible.
    pub fn compare(&self, fit: &Fit) -> Result<(Comparison, Diagnosis)> {
        let found = self.diagnose(&self.settings(), fit, &VERDICT)?;
        let mut comparison = compare(fit).led_by(&leads(&found));
        if found.verdict.most_touches_unusable() {
            comparison.says.clone_from(&found.says);
        }
        Ok((comparison, found))
    }
}

/// What a diagnosis found, as a comparison names it: best first.
pub(super) fn leads(found: &Diagnosis) -> Vec<Lead> {
    found.depends.iter().map(|w| Lead { by: w.by.clone(), share: w.share, says: w.says.clone() }).collect()
}

/// The covariance of the results, in all and of type A alone, put into the answer of a fit.
pub fn put_covariance(fit: &mut Fit) {
    fit.outcome.covariance = Some(uncertainty::full_covariance(fit));
    fit.outcome.covariance_type_a = (!fit.type_b.is_empty()).then(|| uncertainty::results_covariance(fit));
}
