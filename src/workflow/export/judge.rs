//! What a model that lacks something means for the values that are exported.

use crate::diag::{Finding, Result, Severity};
use crate::diagnose::Diagnosis;
use crate::diagnose::consequence::Consequence;
use crate::fit::Fit;
use crate::report::fit::significant;
use crate::tables::correction::left_um;
use crate::tables::place::{Meaning, meaning};
use crate::units::Plain;
use crate::workflow::examine::VERDICT;
use crate::workflow::{Environment, Loaded};
use serde::Serialize;

/// What the diagnosis says of an export.
#[derive(Debug, Default)]
pub(super) struct Judged {
    /// What speaks against it, where it was forced all the same.
    pub forced: Option<String>,
    /// By how much each exported value could be wrong because of what is missing, the worst against its tolerance first.
    pub doubts: Vec<Doubt>,
}

/// By how much an exported value could be wrong.
#[derive(Debug, Serialize)]
pub struct Doubt {
    #[serde(flatten)]
    pub what: Consequence,
    /// What that does at the tolerance's radius, um; none where the unit says nothing about that.
    pub off_um: Option<f64>,
    /// Its tolerance, in its unit.
    pub tolerance: f64,
}

impl Doubt {
    /// How often the tolerance goes into it.
    fn ratio(&self) -> f64 {
        self.what.off / self.tolerance
    }

    fn says(&self, radius_mm: f64) -> String {
        let Consequence { parameter, unit, off, because, .. } = &self.what;
        let size = match self.off_um {
            Some(um) => format!("{} µm at {} mm", significant(um), Plain(radius_mm)),
            None => format!("{} {unit}", significant(*off)),
        };
        // in the same unit, so that the two can be compared
        let limit = match self.off_um.filter(|_| self.ratio() > 0.0) {
            Some(um) => format!("{} µm", significant(um / self.ratio())),
            None => format!("{} {unit}", significant(self.tolerance)),
        };
        format!("{parameter} could be wrong by {size}; its tolerance is {limit} (cause: {because})")
    }
}

/// The values that go into tables, with how wrong they could be.
fn doubts(loaded: &Loaded, found: &Diagnosis) -> Vec<Doubt> {
    let tolerance = &loaded.study.tolerance;
    let is_exported = |c: &&Consequence| {
        let effect = loaded.catalogue.get(&c.effect, &loaded.machine);
        effect.is_some_and(|effect| {
            let index = effect.parameters.iter().position(|p| p.name == c.parameter);
            index.is_some_and(|i| meaning(effect, i, &loaded.machine) != Meaning::Measurement)
        })
    };
    let doubt = |c: &Consequence| {
        let tolerance_of = tolerance.limit(&c.parameter, &c.unit)?;
        let off_um = left_um(c.off, &c.unit, tolerance.radius_mm);
        Some(Doubt { what: c.clone(), off_um, tolerance: tolerance_of })
    };
    let mut out: Vec<Doubt> = found.consequences.iter().filter(is_exported).filter_map(doubt).collect();
    out.sort_by(|a, b| b.ratio().total_cmp(&a.ratio()));
    out
}

/// What a model lacks stands in part in its parameters. That is a remark where no exported value could be wrong by more than its
/// tolerance, and else refuses the export.
pub(super) fn judged(loaded: &Loaded, fit: &Fit, force: bool, env: &dyn Environment) -> Result<Judged> {
    let found = loaded.diagnose(&loaded.settings(), fit, &VERDICT)?;
    if !found.verdict.is_no() {
        return Ok(Judged::default());
    }
    let word = found.verdict.as_str();
    let doubts = doubts(loaded, &found);
    let two = found.proposed().get(1);
    let named = found.candidates.first().into_iter().chain(two).map(|c| c.effect.as_str());
    let named = match found.verdict.is_missing_effect() {
        true => format!(" ({})", named.collect::<Vec<_>>().join(" and ")),
        false => String::new(),
    };
    let radius_mm = loaded.study.tolerance.radius_mm;
    let refused = match (found.mistake(), doubts.first()) {
        (Some(mistake), _) => Some(mistake),
        (None, Some(worst)) if worst.ratio() > 1.0 => Some(worst.says(radius_mm)),
        (None, worst) => {
            let most = worst.map_or_else(|| "no exported value depends on it".to_owned(), |d| d.says(radius_mm));
            let says = format!("the diagnosis is {word}{named}; the largest consequence: {most}");
            let remark = if found.verdict.is_weak_pattern() {
                Finding::info("export::verdict", says)
            } else {
                Finding::warning("export::verdict", says)
            };
            env.remark(&[remark.help("`axiscal diagnose` shows what is missing")]);
            None
        }
    };
    let Some(why) = refused else { return Ok(Judged { forced: None, doubts }) };
    let finding = Finding::error("export::verdict", format!("the diagnosis is {word}{named}: {why}"))
        .help("`axiscal diagnose` shows it, `axiscal add` puts an effect into the study; --force exports all the same");
    if force {
        let says = finding.message.clone();
        env.remark(&[Finding { severity: Severity::Warning, help: None, ..finding }]);
        return Ok(Judged { forced: Some(says), doubts });
    }
    Err(finding.into())
}
