//! `axiscal add`, `remove` and `history`: the study's model is changed in place, and every model tried is kept.

use super::common::of_fit;
use super::load::{Loaded, load_study};
use super::{Answer, Io};
use crate::compare::{change, parameter_combinations};
use crate::diag::{Failure, Finding, Result, source};
use crate::fit::{self, Fit, held_out};
use crate::study::edit;
use crate::study::history::{History, Step};
use crate::{files, report};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Arguments of `add` and `remove`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study; it is edited in place
    pub study: PathBuf,
    /// Ids of the effects (`axiscal effects` lists them)
    #[arg(required = true)]
    pub effects: Vec<String>,
    /// Fit and compare, but leave the study as it is
    #[arg(long)]
    pub dry_run: bool,
}

/// Arguments of `history`.
#[derive(Debug, clap::Args)]
pub struct HistoryArgs {
    /// The study
    pub study: PathBuf,
    /// Plots of plain ASCII signs (as in a pipe)
    #[arg(long)]
    pub ascii: bool,
}

/// Runs `add`.
///
/// # Errors
/// When the study is unusable, an effect is unknown, does not apply or is in the model, or the study changed meanwhile.
pub fn add(args: &Args, io: &Io) -> Result<Answer> {
    add_chosen(args, io, None)
}

/// The same for an effect that the search chose, with the error that it leaves on touches which had no part in choosing it.
pub(super) fn add_chosen(args: &Args, io: &Io, nested_rms_um: Option<f64>) -> Result<Answer> {
    run(args, io, nested_rms_um, |loaded, text| {
        for id in &args.effects {
            applies(loaded, id)?;
        }
        edit::add(text, &args.effects)
    })
}

/// Runs `remove`.
///
/// # Errors
/// When the study is unusable, an effect is not in the model, or the study changed meanwhile.
pub fn remove(args: &Args, io: &Io) -> Result<Answer> {
    run(args, io, None, |loaded, text| {
        let gone = |name: &str| {
            loaded.catalogue.iter().any(|e| {
                args.effects.contains(&e.id) && e.parameters.iter().any(|p| crate::symbols::same(&p.name, name))
            })
        };
        if let Some(name) = loaded.study.knowledge.keys().find(|k| gone(k)) {
            return Err(Failure::new("study::still_said", format!("the study says something of {name}"))
                .help(format!("take [model.parameters.{name}] out of the study first")));
        }
        edit::remove(text, &args.effects)
    })
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

fn run(
    args: &Args,
    io: &Io,
    nested_rms_um: Option<f64>,
    edit: impl Fn(&Loaded, &str) -> Result<String>,
) -> Result<Answer> {
    // from here to the last byte written nobody else changes it
    let _alone = if args.dry_run { None } else { Some(files::lock(&args.study)?) };
    let bytes = files::read_bytes(&args.study)?;
    let text = files::read_text(&args.study)?;
    let mut loaded = load_study(&args.study, io)?;
    let edited = edit(&loaded, &text)?;
    let history_path = history_path(&args.study);
    let mut history = read_history(&history_path)?.unwrap_or_default();
    let fit_of = |loaded: &Loaded| loaded.fit(&loaded.settings());
    let before = fit_of(&loaded)?;
    history.push(step(&loaded, &before));
    let (study, _) = crate::study::Study::parse(&source(args.study.display().to_string(), edited.clone()))?;
    loaded.study = study;
    let after = fit_of(&loaded)?;
    history.push(Step { nested_rms_um, ..step(&loaded, &after) });
    let left_out = (held_out::by_visit(&before), held_out::by_visit(&after));
    let fall = match &left_out {
        (Some(b), Some(a)) => held_out::fall(b, a, &before.data.visits),
        _ => None,
    };
    let changes = change::change(&before.outcome, &after.outcome, fall);
    if !args.dry_run {
        if files::read_bytes(&args.study)? != bytes {
            return Err(Failure::new("study::changed", format!("{} was changed meanwhile", args.study.display()))
                .help("nothing was written: call again"));
        }
        // a mark at the beginning of the file is no part of the text, but of the file
        let mark: &[u8] = if bytes.starts_with(b"\xef\xbb\xbf") { &bytes[..3] } else { &[] };
        files::rewrite(&args.study, &[mark, edited.as_bytes()].concat())?;
        files::rewrite(&history_path, history.to_json()?.as_bytes())?;
    }
    let rms = |fit: &Fit| held_out::later_run(fit).map(|h| h.rms_um);
    let later = (rms(&before), rms(&after));
    let se = |h: &Option<held_out::HeldOut>| h.as_ref().and_then(|h| h.standard_error_um);
    let doubt = report::ladder::HeldOutDoubt {
        standard_errors: (se(&left_out.0), se(&left_out.1)),
        fall,
        nested_rms_um,
        n_groups: left_out.1.as_ref().map_or(0, |h| h.groups),
    };
    io.say(report::ladder::change((&before.outcome, &after.outcome), &changes, later, &doubt, io.paper(false)));
    // what has no size of its own is told together, and a jump by the touches on both sides of it
    let fresh: Vec<&String> = after.outcome.effects.iter().filter(|e| !before.outcome.effects.contains(e)).collect();
    let together: Vec<parameter_combinations::Together> =
        fresh.iter().filter_map(|id| parameter_combinations::together(&after, id)).collect();
    let brackets: Vec<parameter_combinations::Bracket> =
        changes.new.iter().filter_map(|p| parameter_combinations::bracket(&after, &loaded.catalogue, p)).collect();
    for t in &together {
        io.say(format!("{}: parameters without a value cannot be determined alone; {}", t.effect, t.says()));
    }
    for b in &brackets {
        io.say(format!("{}: no touch lies in between", b.says()));
    }
    io.say(if args.dry_run {
        format!("{} is as it was (--dry-run)", args.study.display())
    } else {
        format!("{}: the model is now {}", args.study.display(), loaded.study.effects.join(", "))
    });
    let plain = |fit: &Fit| fit::outcome::Outcome { residuals: None, ..fit.outcome.clone() };
    io.answer(&json!({
        "before": plain(&before), "after": plain(&after), "remarks": changes.remarks, "written": !args.dry_run,
        "together": together, "between": brackets,
        "held_out": {
            "se_before_um": doubt.standard_errors.0, "se_after_um": doubt.standard_errors.1,
            "fall_um": fall.map(|f| f.0), "fall_se_um": fall.map(|f| f.1), "nested_rms_um": nested_rms_um,
        },
    }));
    Ok(of_fit(&after.outcome, Answer::Done, io))
}

/// Runs `history`.
///
/// # Errors
/// When the study or its history is unusable.
pub fn history(args: &HistoryArgs, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let mut history = read_history(&history_path(&args.study))?.unwrap_or_default();
    let current =
        history.steps.last().is_some_and(|s| s.effects == loaded.study.effects && s.data_sha256 == loaded.data_sha256);
    if !current {
        let fit = loaded.fit(&loaded.settings())?;
        history.push(step(&loaded, &fit));
    }
    let other = history.on_other_data(&loaded.data_sha256);
    if !other.is_empty() {
        let steps: Vec<String> = other.iter().map(ToString::to_string).collect();
        io.report(&[Finding::warning(
            "history::other_data",
            format!("the plans or logs have changed since step {}: its figures are of other touches", steps.join(", ")),
        )
        .help("delete the history file next to the study to begin a new one")]);
    }
    io.say(report::ladder::history(&history, io.paper(args.ascii)));
    io.answer(&history);
    Ok(Answer::Done)
}

/// `study.toml` → `study.history.json` beside it.
#[must_use]
pub fn history_path(study: &Path) -> PathBuf {
    study.with_extension("history.json")
}

/// The history beside a study, where there is one.
///
/// # Errors
/// When it is there and cannot be read.
pub fn read_history(path: &Path) -> Result<Option<History>> {
    if !path.exists() {
        return Ok(None);
    }
    History::parse(&source(path.display().to_string(), files::read_text(path)?)).map(Some)
}

/// A fit as a step of the ladder.
#[must_use]
pub fn step(loaded: &Loaded, fit: &Fit) -> Step {
    let o = &fit.outcome;
    Step {
        effects: loaded.study.effects.clone(),
        rms_um: o.rms_um,
        held_out_rms_um: o.held_out_rms_um,
        held_out_se_um: held_out::by_visit(fit).and_then(|h| h.standard_error_um),
        later_run_rms_um: held_out::later_run(fit).map(|h| h.rms_um),
        chi2_per_dof: o.chi2_per_dof,
        noise_um: Some(o.noise_um),
        visit_um: Some(o.visit_um),
        unknowns: o.unknowns,
        data_sha256: loaded.data_sha256.clone(),
        ..Step::default()
    }
}
