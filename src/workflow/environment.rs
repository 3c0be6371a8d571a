//! Where a study is: its files, and who hears what is noticed. The disk, and memory.

use crate::diag::{Failure, Finding, Result, Source, source};
use crate::files;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Files by path, and who hears remarks. The files of a type that does not say otherwise are those on the disk.
pub trait Environment: Send + Sync {
    /// Hears what is noticed: warnings and notes, in the order in which they come up.
    fn remark(&self, findings: &[Finding]);

    /// # Errors
    /// When it cannot be read.
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        files::read_bytes(path)
    }

    fn exists(&self, path: &Path) -> bool {
        path.exists()
    }

    /// Do two paths lead to one file that exists?
    fn is_same(&self, a: &Path, b: &Path) -> bool {
        matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
    }

    /// Size and time of the last change: other ones mean that the file has changed.
    fn stamp(&self, path: &Path) -> Option<(u64, Option<SystemTime>)> {
        let found = std::fs::metadata(path).ok()?;
        Some((found.len(), found.modified().ok()))
    }

    /// Replaces a file of the study by a whole one; `None` removes it.
    ///
    /// # Errors
    /// When the folder cannot be written; an existing file is then untouched.
    fn write(&self, path: &Path, bytes: Option<&[u8]>) -> Result<()> {
        match bytes {
            Some(bytes) => files::rewrite(path, bytes),
            None => files::remove(path),
        }
    }

    /// No output of this process takes the place of the file from here on.
    fn protect(&self, path: &Path) {
        files::protect(path);
    }

    /// Keeps other processes from changing a file until what is returned is dropped.
    ///
    /// # Errors
    /// When another process holds it for too long, or nothing can be written there.
    fn lock(&self, path: &Path) -> Result<Box<dyn Send>> {
        Ok(Box::new(files::lock(path)?))
    }

    /// The text of a file (UTF-8), without a byte order mark.
    ///
    /// # Errors
    /// When it cannot be read or is no text.
    fn text(&self, path: &Path) -> Result<String> {
        files::text_of(path, self.read(path)?)
    }

    /// The same, for findings that name their place in it.
    ///
    /// # Errors
    /// When it cannot be read or is no text.
    fn source(&self, path: &Path) -> Result<Source> {
        Ok(source(path.display().to_string(), self.text(path)?))
    }
}

/// Remarks that are kept until somebody asks for them.
#[derive(Debug, Default)]
pub struct Remarks(Mutex<Vec<Finding>>);

impl Remarks {
    /// What was noticed since this was last asked.
    #[must_use]
    pub fn take(&self) -> Vec<Finding> {
        std::mem::take(&mut *self.list())
    }

    fn list(&self) -> MutexGuard<'_, Vec<Finding>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[derive(Debug, Default)]
pub struct Disk {
    pub remarks: Remarks,
}

impl Environment for Disk {
    fn remark(&self, findings: &[Finding]) {
        self.remarks.list().extend_from_slice(findings);
    }
}

/// Files that are nowhere but in memory.
#[derive(Debug, Default)]
pub struct InMemory {
    pub remarks: Remarks,
    files: Mutex<BTreeMap<PathBuf, Vec<u8>>>,
}

impl InMemory {
    fn files(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Vec<u8>>> {
        self.files.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Environment for InMemory {
    fn remark(&self, findings: &[Finding]) {
        self.remarks.list().extend_from_slice(findings);
    }

    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        let bytes = self.files().get(path).cloned();
        bytes.ok_or_else(|| Failure::new("file::unreadable", format!("there is no file {}", path.display())))
    }

    fn exists(&self, path: &Path) -> bool {
        self.files().contains_key(path)
    }

    fn is_same(&self, a: &Path, b: &Path) -> bool {
        a == b && self.exists(a)
    }

    fn stamp(&self, path: &Path) -> Option<(u64, Option<SystemTime>)> {
        self.files().get(path).map(|bytes| (bytes.len() as u64, None))
    }

    fn write(&self, path: &Path, bytes: Option<&[u8]>) -> Result<()> {
        match bytes {
            Some(bytes) => self.files().insert(path.to_path_buf(), bytes.to_vec()),
            None => self.files().remove(path),
        };
        Ok(())
    }

    fn protect(&self, _: &Path) {}

    fn lock(&self, _: &Path) -> Result<Box<dyn Send>> {
        Ok(Box::new(()))
    }
}
