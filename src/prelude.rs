//! What a program needs to run the loop: everything else of the crate may change without notice.
//!
//! | step | call |
//! |---|---|
//! | load a machine | [`load_machine`]: built in, or from a machines file |
//! | make a plan and its NC program | [`load_controller`], [`load_program`], [`generate`] |
//! | touch without a machine | [`simulate`], [`simulated_log`] |
//! | parse a log | [`LogFile::read`] |
//! | write a study, load it | [`NewStudy::text`], [`load_study`] |
//! | fit | [`Loaded::fit`], [`Loaded::identify`] |
//! | diagnose | [`Loaded::diagnose`], [`Loaded::solve`] |
//! | add or remove effects | [`Loaded::change`], [`change_study`] |
//! | choose further touches | [`plan_next`] |
//! | export | [`export`] |
//!
//! Files are read and written through an [`Environment`], which also hears remarks: [`Disk`], [`InMemory`], or a type of your
//! own. A [`Failure`] says what is wrong, where, and what to do. Lengths are in mm and angles in degrees, unless a name says
//! otherwise (`_um`, `_rad`, `_s`).
//!
//! # A program for a control
//!
//! ```
//! use axiscal::prelude::*;
//!
//! let files = InMemory::default();
//! let machine = load_machine("swivel-head", None, &files)?;
//! let control = load_controller("linuxcnc", &files)?;
//! let program = load_program("head", &machine, &files)?;
//! // every move is checked against limits and collisions, and the NC text is read back
//! let made = generate(&machine, &program, &control, &ProgramOptions::default(), &files)?;
//! assert_eq!(made.generated.plan.touches.len(), 202);
//! assert!(made.nc.text.contains("G38.3"));
//! # Ok::<(), Failure>(())
//! ```
//!
//! # From a log to tables
//!
//! ```
//! # use axiscal::prelude::*;
//! # use std::path::Path;
//! # let files = InMemory::default();
//! # let machine = load_machine("swivel-head", None, &files)?;
//! # let control = load_controller("linuxcnc", &files)?;
//! # let program = load_program("full", &machine, &files)?;
//! # let plan = generate(&machine, &program, &control, &ProgramOptions::default(), &files)?.generated.plan;
//! # let scenario = Scenario::flawless().with_noise(0.5e-3, 0.0, 1);
//! # let scenario = scenario.with(&machine, "location-b", &[("EX0B", 0.021)])?.with(&machine, "zero-b", &[("EB0B", 0.004)])?;
//! # let touches = simulate(&machine, &plan, &scenario, None)?.0;
//! # let log = simulated_log(&machine, &plan, &touches, Some(&control));
//! // what a control has written, matched to the plan
//! let log_file = LogFile { bytes: log.as_bytes(), path: Path::new("full.log"), controller: "linuxcnc", run: None };
//! assert_eq!(log_file.read(&machine, &plan, &files)?.touches.len(), plan.touches.len());
//!
//! // a study: what was measured, and what the model holds
//! files.write(Path::new("full.plan.json"), Some(plan.to_json().as_bytes()))?;
//! files.write(Path::new("full.log"), Some(log.as_bytes()))?;
//! let run = NewRun {
//!     plan: "full.plan.json".into(),
//!     log: "full.log".into(),
//!     controller: "linuxcnc".into(),
//!     compensation: None,
//! };
//! let effects = ["location-b", "block-setup", "pretravel"].map(str::to_owned);
//! let new = NewStudy { folder: Path::new(""), machines: None, effects: &effects, effects_files: &[], runs: &[run] };
//! let study = Path::new("study.toml");
//! files.write(study, Some(new.text(&machine, &files)?.as_bytes()))?;
//! let loaded = load_study(study, &files)?;
//!
//! let fit = loaded.fit(&loaded.settings())?;
//! let found = loaded.diagnose(&loaded.settings(), &fit, &DiagnosisOptions::default())?;
//! assert!(found.verdict.is_missing_effect());
//! let missing = [found.candidates[0].effect.clone()];
//!
//! let changed = change_study(study, Edit::Add(&missing), None, false, &files)?;
//! assert!(changed.after.outcome.rms_um < 0.5 * changed.before.outcome.rms_um);
//!
//! let request = ExportRequest::new("linuxcnc");
//! let form = request.form(&files)?;
//! let exported = export(&changed.loaded, &form, &request, &files)?;
//! assert!(exported.files().iter().any(|(name, _)| name == "README.txt"));
//! # Ok::<(), Failure>(())
//! ```

pub use crate::diag::{Failure, Finding, Result, Severity};
pub use crate::diagnose::next_step::NextStep;
pub use crate::diagnose::verdict::{Missing, NotNamed, TooLittle, Unexplained};
pub use crate::diagnose::{Diagnosis, Options as DiagnosisOptions, Verdict};
pub use crate::fit::{Fit, Settings};
pub use crate::machine::Machine;
pub use crate::post::Postprocessor as Controller;
pub use crate::program::{Options as ProgramOptions, ProgramSpec, plan::Plan};
pub use crate::simulate::{Scenario, run as simulate};
pub use crate::workflow::change::{Changed, Edit, change_study};
pub use crate::workflow::export::{Exported, Request as ExportRequest, export};
pub use crate::workflow::generate::{ForControl, generate, load_program};
pub use crate::workflow::new::{NewRun, NewStudy, default_effects};
pub use crate::workflow::plan_next::{Next, Request as PlanNextRequest, plan_next};
pub use crate::workflow::simulated_log::simulated_log;
pub use crate::workflow::{
    Disk, Environment, InMemory, Loaded, LogFile, load_controller, load_machine, load_plan, load_study,
};
