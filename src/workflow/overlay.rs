//! Files that are about to be written, seen as if they were there.

use super::Environment;
use crate::diag::{Finding, Result};
use std::path::{Path, PathBuf};

/// Files by path in front of those of another environment.
pub struct Overlay<'a> {
    pub beneath: &'a dyn Environment,
    pub files: &'a [(PathBuf, String)],
}

impl Environment for Overlay<'_> {
    fn remark(&self, findings: &[Finding]) {
        self.beneath.remark(findings);
    }

    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        match self.files.iter().find(|(own, _)| own == path) {
            Some((_, text)) => Ok(text.as_bytes().to_vec()),
            None => self.beneath.read(path),
        }
    }

    fn exists(&self, path: &Path) -> bool {
        self.files.iter().any(|(own, _)| own == path) || self.beneath.exists(path)
    }
}
