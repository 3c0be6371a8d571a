//! What a search for shape parameters works with.

use super::{Fit, Knowledge, Settings, identify_from};
use crate::diag::Result;
use crate::machine::Machine;
use crate::model::catalogue::{Catalogue, Effect};
use crate::model::data::Data;
use std::collections::{BTreeMap, BTreeSet};

/// Values to begin at, by name of the unknown.
pub(super) type Starts = BTreeMap<String, f64>;

/// A fit as the search for shapes wants it: the user's settings, and which shapes the search itself holds.
#[derive(Debug, Clone, Default)]
pub(super) struct ShapeSearch {
    /// What the user asks for. Among what is known are the shapes that the search holds.
    pub settings: Settings,
    /// Shapes that are held at an end of their range.
    pub held: BTreeSet<String>,
    /// Moments at which something jumps: each is held at the best of the moments between touches.
    pub jumps: BTreeSet<String>,
}

impl ShapeSearch {
    /// Holds an unknown, whatever the user says of it: its exact name goes before any other spelling.
    pub fn hold(&mut self, name: &str, value: f64) {
        self.settings.knowledge.insert(name.to_owned(), Knowledge::Fixed(value));
    }

    /// The same as a trial fit.
    pub fn quick(&self) -> Self {
        let mut quick = self.clone();
        quick.settings.quick = true;
        quick
    }
}

/// Machine, catalogue and effects of a fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Job<'a> {
    pub machine: &'a Machine,
    pub catalogue: &'a Catalogue,
    pub effects: &'a [&'a Effect],
}

impl Job<'_> {
    /// The fit from given start values.
    pub fn fit(&self, data: Data, search: &ShapeSearch, starts: &Starts) -> Result<Fit> {
        identify_from(self.machine, self.catalogue, self.effects, data, search, starts)
    }
}

/// What is asked of the result besides the fit.
pub(super) struct Asked<'a> {
    pub machine: &'a Machine,
    pub effects: &'a [&'a Effect],
    pub search: &'a ShapeSearch,
}
