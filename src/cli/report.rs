//! `axiscal report`: one page with everything that a study says.

use super::common::of_fit;
use super::{Answer, Io};
use crate::diag::{Failure, Finding, Result};
use crate::files;
use crate::workflow::history::read_history;
use crate::workflow::load_study;
use crate::workflow::view::{view_of, work_out};
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// The page to write: one file that opens with no network
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    pub out: PathBuf,
    /// Every plot as SVG and PNG, with its numbers as CSV
    #[arg(long, value_name = "DIR")]
    pub plots: Option<PathBuf>,
    /// What the page is drawn from, as JSON (axiscal-view/1)
    #[arg(long, value_name = "FILE")]
    pub view: Option<PathBuf>,
}

/// # Errors
/// When the study or a file that it names is unusable, or a file cannot be written.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let history = read_history(&args.study, io)?;
    let worked = work_out(&loaded, history.as_ref(), io)?;
    let view = view_of(&loaded, &worked);
    io.report(&view.ladder_notes.iter().map(|n| Finding::info("report::ladder", n.clone())).collect::<Vec<_>>());
    let mut outputs: Vec<(PathBuf, Vec<u8>)> = Vec::new();
    if let Some(path) = &args.view {
        let text = serde_json::to_string(&view)
            .map_err(|e| Failure::new("report::view", format!("the view cannot be written: {e}")))?;
        outputs.push((path.clone(), text.into_bytes()));
    }
    let page = crate::page::page(&view)?;
    outputs.push((args.out.clone(), page.clone().into_bytes()));
    let mut plots = Vec::new();
    if let Some(folder) = &args.plots {
        for (name, contents) in crate::plots::files(&view)? {
            let path = folder.join(name);
            plots.push(path.display().to_string());
            outputs.push((path, contents));
        }
    }
    files::check_outputs(&outputs.iter().map(|(path, _)| path).collect::<Vec<_>>())?;
    for (path, contents) in &outputs {
        files::write_whole(path, contents)?;
    }
    io.say(&view.headline.sentence);
    io.say(format!("{}: open it in a browser, mail it, print it", args.out.display()));
    if let Some(folder) = &args.plots {
        io.say(format!("{}: {} files", folder.display(), plots.len()));
    }
    io.answer(&json!({
        "format": "axiscal-report/1",
        "out": args.out.display().to_string(),
        "bytes": page.len(),
        "plots": plots,
        "headline": view.headline,
        "next": view.next,
    }));
    Ok(of_fit(&worked.fit.outcome, Answer::Done, io))
}
