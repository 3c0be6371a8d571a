//! What the workflow asks of the files of a study; the disk and the memory as they answer.

use crate::diag::{Failure, Result, Source, source};
use crate::files;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// Files by path.
pub trait Files: Send + Sync {
    /// The bytes of a file.
    ///
    /// # Errors
    /// When it cannot be read.
    fn read(&self, path: &Path) -> Result<Vec<u8>>;
    /// Is there such a file?
    fn exists(&self, path: &Path) -> bool;
    /// Do two paths lead to one file that exists?
    fn is_same(&self, a: &Path, b: &Path) -> bool;
    /// Size and time of the last change: other ones mean that the file has changed.
    fn stamp(&self, path: &Path) -> Option<(u64, Option<SystemTime>)>;
    /// Replaces a file of the study by a whole one; `None` removes it.
    ///
    /// # Errors
    /// When the folder cannot be written; an existing file is then untouched.
    fn write(&self, path: &Path, bytes: Option<&[u8]>) -> Result<()>;
    /// Keeps other processes from changing a file until what is returned is dropped.
    ///
    /// # Errors
    /// When another process holds it for too long, or nothing can be written there.
    fn lock(&self, path: &Path) -> Result<Box<dyn Send>>;

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

/// The disk.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl Files for Disk {
    fn read(&self, path: &Path) -> Result<Vec<u8>> {
        files::read_bytes(path)
    }

    fn exists(&self, path: &Path) -> bool {
        path.exists()
    }

    fn is_same(&self, a: &Path, b: &Path) -> bool {
        matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
    }

    fn stamp(&self, path: &Path) -> Option<(u64, Option<SystemTime>)> {
        let found = std::fs::metadata(path).ok()?;
        Some((found.len(), found.modified().ok()))
    }

    fn write(&self, path: &Path, bytes: Option<&[u8]>) -> Result<()> {
        match bytes {
            Some(bytes) => files::rewrite(path, bytes),
            None => files::remove(path),
        }
    }

    fn lock(&self, path: &Path) -> Result<Box<dyn Send>> {
        Ok(Box::new(files::lock(path)?))
    }
}

/// Files that are nowhere but in memory.
#[derive(Debug, Default)]
pub struct InMemory(Mutex<BTreeMap<PathBuf, Vec<u8>>>);

impl InMemory {
    fn files(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Vec<u8>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Files for InMemory {
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

    fn lock(&self, _: &Path) -> Result<Box<dyn Send>> {
        Ok(Box::new(()))
    }
}
