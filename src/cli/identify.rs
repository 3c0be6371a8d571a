//! `axiscal identify`: the fit of a study.

use super::common::of_fit;
use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::workflow::examine::put_covariance;
use crate::workflow::load_study;
use nalgebra::Vector3;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The study
    pub study: PathBuf,
    /// Where location errors of workpiece-side axes are stated: pivot, ball, table, or X,Y,Z in mm in R
    #[arg(long, value_name = "POINT", default_value = "pivot", allow_hyphen_values = true)]
    pub reference: String,
    /// With the residual of every touch
    #[arg(long)]
    pub residuals: bool,
    /// With the covariance matrix of the results (--json)
    #[arg(long)]
    pub covariance: bool,
    /// Without the figures that need the whole catalogue: what unmodelled effects may add, weak combinations, cross-validated error
    #[arg(long)]
    pub quick: bool,
    /// All remarks, all columns and the details of the fit
    #[arg(long, short)]
    pub verbose: bool,
}

/// # Errors
/// When the study or a file that it names is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let loaded = load_study(&args.study, io)?;
    let mut settings = loaded.settings();
    settings.reference = Some(reference(&args.reference, &loaded.machine)?);
    settings.bare = args.quick;
    let mut fit = loaded.identify(&settings, io)?;
    if args.covariance {
        put_covariance(&mut fit);
    }
    let mut outcome = fit.outcome;
    if !args.residuals {
        outcome.residuals = None;
    }
    if io.json {
        io.answer(&outcome);
        return Ok(of_fit(&outcome, Answer::Done, io));
    }
    io.say(crate::report::fit::outcome(&outcome, io.paper(false), args.verbose).trim_end());
    if let Some(residuals) = &outcome.residuals {
        let mut t = crate::report::fit::table(&["run", "touch", "residual um", "standardised"]);
        for r in residuals {
            t.add_row(vec![
                r.run.to_string(),
                r.id.to_string(),
                format!("{:.3}", r.residual_um),
                format!("{:.2}", r.standardised),
            ]);
        }
        crate::report::lay::lay(&mut t, io.paper(false).width, &[]);
        io.say(io.paper(false).plain(t.to_string()));
    }
    io.say_as_it_is(format!("next: axiscal diagnose {}", crate::words::command::quoted_path(&args.study)));
    Ok(of_fit(&outcome, Answer::Done, io))
}

/// No machine is as large: a reference beyond it is a slip of the keyboard, mm.
const FARTHEST_MM: f64 = 1e6;

/// Reads a reference point.
///
/// # Errors
/// When the word is neither a known point nor three numbers.
pub fn reference(word: &str, machine: &Machine) -> Result<Vector3<f64>> {
    match word {
        "pivot" => return Ok(machine.reference.pivot),
        "ball" => return Ok(machine.reference.ball),
        "table" => return Ok(machine.reference.table),
        _ => {}
    }
    let numbers: Vec<f64> = word
        .split([',', ' '])
        .filter(|w| !w.is_empty())
        .filter_map(|w| w.parse().ok())
        .filter(|v: &f64| v.is_finite())
        .collect();
    match numbers[..] {
        [x, y, z] if [x, y, z].iter().any(|v| v.abs() > FARTHEST_MM) => {
            Err(Failure::new("cli::reference", format!("reference {word:?} is more than a kilometre off the machine"))
                .help("X,Y,Z in mm in R, for instance 0,0,-202.684"))
        }
        [x, y, z] if word.split([',', ' ']).filter(|w| !w.is_empty()).count() == 3 => Ok(Vector3::new(x, y, z)),
        _ => Err(Failure::new("cli::reference", format!("reference {word:?} is no point"))
            .help("write pivot, ball, table, or X,Y,Z in mm in R, for instance 0,0,-202.684")),
    }
}
