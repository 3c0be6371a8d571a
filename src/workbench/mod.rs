//! The workbench: a study live in the browser, on this machine alone.
//!
//! [`session`] holds the study and makes every step (one writer, each step with the version that it was asked for);
//! [`shelf`] keeps the models that were fitted and fits what is likely to be asked for next;
//! [`calls`] begins the verbs that write files, [`export`] is the compensation from the page, [`upload`] a file that the page
//! sends, [`start`] the page before a study is open, [`recent`] the studies that were open before;
//! [`evidence`] works out behind it what is missing; [`guard`] says which request may be answered; [`server`] carries
//! requests there and answers back; [`desk`] knows the study's files.
//!
//! It is not: a file server. No part of a request ever becomes a path: scripts and styles are a fixed table of embedded
//! files, and what is written lies in places that the study's own name gives. The start page writes into a new folder of its own,
//! under names of plain signs.

pub mod calls;
pub mod desk;
pub mod draft;
pub mod evidence;
pub mod export;
pub mod guard;
pub mod inputs;
pub mod pages;
pub mod recent;
pub mod record;
pub mod server;
pub mod session;
pub mod shelf;
pub mod start;
pub mod upload;

use crate::diag::Finding;
use crate::model::data::Data;
use crate::study::history::History;
use crate::workflow::Loaded;
use serde_json::Value;
pub use session::Snapshot;
use std::sync::Arc;

/// A study with all that it names, read.
#[derive(Debug, Clone)]
pub struct Opened {
    pub loaded: Loaded,
    /// The touches, ready for the model.
    pub data: Arc<Data>,
    pub history: History,
    pub remarks: Vec<Finding>,
}

impl std::ops::Deref for Opened {
    type Target = Loaded;

    fn deref(&self) -> &Loaded {
        &self.loaded
    }
}

/// What a step writes. Their paths are the desk's: none is named here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    Study,
    History,
    /// The file of the user's own effects to which the formula box adds.
    Effects,
}

/// A verb that the page may call.
#[derive(Debug, Clone, PartialEq)]
pub enum Verb {
    /// `plan-next`, with the controller and the minutes.
    PlanNext(String, f64),
    /// `export`, with the controller and the answers to its questions.
    Export(String, export::ExportAnswers),
}

/// What a verb has answered.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Answered {
    /// Exit code: 0 done, 1 the answer is "no", 2 unusable.
    pub code: i32,
    pub answer: Value,
    /// What it said on the side.
    pub messages: Vec<String>,
    /// The folder beside the study.
    pub folder: String,
}
