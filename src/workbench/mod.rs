//! The workbench: a study live in the browser, on this machine alone.
//!
//! [`session`] holds the study and makes every step (one writer, each step with the version that it was asked for);
//! [`shelf`] keeps the models that were fitted and fits what is likely to be asked for next;
//! [`evidence`] works out behind it what is missing; [`guard`] says which request may be answered; [`server`] carries
//! requests there and answers back. What touches the disk comes in as a [`Host`]: `cli` is it.
//!
//! It is not: a file server. No part of a request ever becomes a path: scripts and styles are a fixed table of embedded
//! files, and what is written lies in places that the study's own name gives.

pub mod draft;
pub mod evidence;
pub mod guard;
pub mod pages;
pub mod record;
pub mod server;
pub mod session;
pub mod shelf;

use crate::diag::{Finding, Result};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::model::data::Data;
use crate::study::Study;
use crate::study::history::History;
use serde_json::Value;
use std::sync::Arc;

/// A study with all that it names, read.
#[derive(Debug, Clone)]
pub struct Opened {
    /// The bytes of the study, as they lie on the disk.
    pub bytes: Vec<u8>,
    /// The study.
    pub study: Study,
    /// Its machine.
    pub machine: Arc<Machine>,
    /// The effects that exist for it.
    pub catalogue: Arc<Catalogue>,
    /// The touches, ready for the model.
    pub data: Arc<Data>,
    /// SHA-256 over plans and logs.
    pub data_sha256: String,
    /// The ladder beside the study.
    pub history: History,
    /// What was noticed on reading.
    pub remarks: Vec<Finding>,
}

/// What a step writes. Places are the host's: none is named here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The study.
    Study,
    /// The ladder beside it.
    History,
    /// The file of the user's own effects to which the formula box adds.
    Effects,
}

/// A verb that the page may call.
#[derive(Debug, Clone, PartialEq)]
pub enum Verb {
    /// `plan-next`, with the controller and the minutes.
    PlanNext(String, f64),
    /// `export`, with the controller.
    Export(String),
}

/// What a verb has answered.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Answered {
    /// Exit code: 0 done, 1 the answer is "no", 2 unusable.
    pub code: i32,
    /// Its JSON.
    pub answer: Value,
    /// What it said on the side.
    pub messages: Vec<String>,
    /// The folder beside the study.
    pub folder: String,
}

/// The disk and the other verbs, as the workbench sees them.
pub trait Host: Send + Sync + 'static {
    /// What the page calls the study.
    fn name(&self) -> String;
    /// Reads the study and all that it names.
    ///
    /// # Errors
    /// When something is missing or unusable.
    fn open(&self) -> Result<Opened>;
    /// Keeps other processes from changing the study until what is returned is dropped.
    ///
    /// # Errors
    /// When one of them does so for longer than is waited, or nothing can be written there.
    fn alone(&self) -> Result<Box<dyn Send>>;
    /// The bytes of a file of ours; `None` where it is not there.
    ///
    /// # Errors
    /// When it is there and cannot be read.
    fn read(&self, place: Place) -> Result<Option<Vec<u8>>>;
    /// Writes a file of ours whole, or takes it away.
    ///
    /// # Errors
    /// When the folder cannot be written.
    fn write(&self, place: Place, bytes: Option<&[u8]>) -> Result<()>;
    /// What [`Place::Effects`] is called in the study: `my-effects.toml`, or the first file that it names.
    fn effects_file(&self, study: &Study) -> String;
    /// Something that changes when a file of the study does.
    fn mark(&self, study: &Study) -> u64;
    /// Calls a verb on the study as it lies on the disk; takes its time.
    ///
    /// # Errors
    /// When it cannot be called at all.
    fn call(&self, verb: &Verb) -> Result<Answered>;
    /// Controllers that have programs, by name.
    fn controllers(&self) -> Vec<String>;
}

/// How the file of the user's own effects is called where a study names none.
pub const OWN_EFFECTS: &str = "my-effects.toml";
