//! A program as text, with the files that go with it.

use crate::diag::{Findings, Source, source};

/// A program as the control reads it.
#[derive(Debug, Clone)]
pub struct NcProgram {
    /// The text; the same bytes for the same input.
    pub text: String,
    /// Of the file, without the dot.
    pub extension: String,
    /// Files that the control needs beside it.
    pub beside: Vec<SideFile>,
    /// What the person must be told.
    pub findings: Findings,
}

/// A file that the control needs beside the program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SideFile {
    pub name: String,
    pub says: String,
    pub text: String,
    /// It is loaded into the control; the others are for the person.
    pub to_control: bool,
}

impl NcProgram {
    /// All files that are written for a program of this name: the program itself, then what stands beside it.
    pub fn files(&self, stem: &str) -> Vec<(String, &str)> {
        let program = (format!("{stem}.{}", self.extension), self.text.as_str());
        std::iter::once(program).chain(self.beside.iter().map(|f| (f.name.clone(), f.text.as_str()))).collect()
    }

    /// The files beside the program as `check` takes them.
    #[must_use]
    pub fn sources(&self) -> Vec<(String, Source)> {
        self.beside
            .iter()
            .map(|f| (f.name.clone(), source(format!("{} (not written)", f.name), f.text.as_str())))
            .collect()
    }
}
