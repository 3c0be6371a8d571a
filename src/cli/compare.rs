//! `axiscal compare`: model against measurement, where it fails.

use super::common::of_fit;
use super::load::load_study;
use super::{Answer, Io};
use crate::compare::Lead;
use crate::diag::Result;
use crate::diagnose::{Diagnosis, Options, Subject, diagnose};
use crate::{compare, files, report};
use std::path::PathBuf;

/// Arguments of `compare`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Every touch with its residual and what it may depend on, as CSV
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// All groups and plots, not only those that explain something
    #[arg(long)]
    pub all: bool,
    /// Plots of plain ASCII signs (as in a pipe)
    #[arg(long)]
    pub ascii: bool,
}

/// What a diagnosis found, as a comparison names it: best first.
pub(super) fn leads(found: &Diagnosis) -> Vec<Lead> {
    found.depends.iter().map(|w| Lead { by: w.by.clone(), share: w.share, says: w.says.clone() }).collect()
}

/// Runs `compare`.
///
/// # Errors
/// When the study or a file that it names is unusable, or the CSV cannot be written.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let fit = loaded.fit(&loaded.settings())?;
    let mut settings = loaded.settings();
    settings.quick = true;
    let subject = Subject { machine: &loaded.machine, catalogue: &loaded.catalogue, settings: &settings, fit: &fit };
    let missed = fit.data.mostly_missed();
    let planned = if missed { loaded.planned() } else { Vec::new() };
    let found = diagnose(
        subject,
        &Options { at_most: 1, refit: false, power: false, planned: missed.then_some(&planned[..]) },
    )?;
    let leads = leads(&found);
    let mut comparison = compare::compare(&fit).led_by(&leads);
    if found.verdict.most_touches_unusable() {
        comparison.says.clone_from(&found.says);
    }
    if let Some(path) = &args.csv {
        files::write_whole(path, report::compare::csv(&comparison).as_bytes())?;
    }
    io.say(report::compare::comparison(&comparison, io.paper(args.ascii), args.all));
    for u in &fit.outcome.undetermined {
        io.say(format!("cannot be determined: {}", u.says));
    }
    if !comparison.explained_by_noise || !leads.is_empty() {
        io.say_as_it_is(format!("next: axiscal diagnose {}", super::next::quoted(&args.study)));
    }
    io.answer(&comparison);
    Ok(of_fit(&fit.outcome, Answer::Done, io))
}
