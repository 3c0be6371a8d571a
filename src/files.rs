//! Reading whole files and writing them so that nobody ever sees half of one. Called from `cli` and `workflow` only.
//!
//! What is read is remembered, and no output takes its place ([`check_outputs`]); a verb that changes a file of its own on
//! purpose says so with [`rewrite`].

mod folder;
mod inputs;
mod lock;
mod size;
mod temporary;

pub use folder::{Folder, MANIFEST};
pub use inputs::{check_outputs, forget_inputs};
pub use lock::{Lock, lock};
pub use size::{enough_memory, max_input, read_size, set_max_input};

use crate::diag::{Failure, Result};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The bytes of a file.
///
/// # Errors
/// When it cannot be read, is no file or is too large; the message names the path and the reason.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let bytes = size::read(path)?;
    inputs::keep(path);
    Ok(bytes)
}

/// A file that belongs to what was read, read or not: nothing is written over it, and what killed calls left beside it is
/// removed.
pub fn protect(path: &Path) {
    temporary::sweep(folder_of(path));
    inputs::keep(path);
}

/// The bytes of a file that an earlier call of this program wrote and this one may write over.
///
/// # Errors
/// As [`read_bytes`].
pub fn read_own(path: &Path) -> Result<Vec<u8>> {
    size::read(path)
}

/// The text of a file (UTF-8), without a byte order mark.
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    text_of(path, read_bytes(path)?)
}

/// The bytes of a file as text, without a byte order mark.
///
/// # Errors
/// When they are not UTF-8.
pub fn text_of(path: &Path, bytes: Vec<u8>) -> Result<String> {
    let mut text = utf8(path, bytes)?;
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}

/// The text of a file (UTF-8), with a byte order mark where it has one.
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read_text_as_it_is(path: &Path) -> Result<String> {
    utf8(path, read_bytes(path)?)
}

fn utf8(path: &Path, bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|e| {
        Failure::new(
            "file::not_text",
            format!("{} is not text: byte {} is not UTF-8", path.display(), e.utf8_error().valid_up_to() + 1),
        )
        .help("is this the right file? save it as UTF-8 if it is")
    })
}

/// Writes a file whole: to a temporary file beside it, then renamed over it.
///
/// # Errors
/// When it was read by this call, or the folder cannot be written; an existing file is then untouched.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<()> {
    check_outputs(&[path])?;
    put(path, contents)
}

/// Writes a file whole that was read before, because this call is there to change it.
///
/// # Errors
/// When the folder cannot be written; an existing file is then untouched.
pub fn rewrite(path: &Path, contents: &[u8]) -> Result<()> {
    put(path, contents)?;
    inputs::replaced(path);
    Ok(())
}

/// Writes files that belong together, so that old and new ones never lie side by side: all are written beside their places,
/// the old ones but the first go, and the new ones take their places.
///
/// # Errors
/// When one of them was read by this call or cannot be written; the old ones are then untouched.
pub fn write_together(files: &[(PathBuf, &[u8])]) -> Result<()> {
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    check_outputs(&paths)?;
    let differs = |(path, contents): &&(PathBuf, &[u8])| std::fs::read(path).ok().as_deref() != Some(contents);
    let mut staged = Vec::new();
    for (path, contents) in files.iter().filter(differs) {
        staged.push((path, Staged::stage(path, contents)?));
    }
    for (path, file) in staged.iter().filter(|(path, _)| **path != files[0].0).rev() {
        if file.target.exists() {
            std::fs::remove_file(&file.target).map_err(|e| unwritable(path, &e))?;
        }
    }
    staged.into_iter().try_for_each(|(path, file)| file.persist(path))
}

/// Takes a file away; one that is not there is no error.
///
/// # Errors
/// When it is there and cannot be removed.
pub fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => {
            Err(Failure::new("files::remove", format!("cannot remove {}: {e}", path.display()))
                .help("check that you may write there"))
        }
        _ => {
            inputs::removed(path);
            Ok(())
        }
    }
}

fn put(path: &Path, contents: &[u8]) -> Result<()> {
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        // a device or a pipe cannot be replaced, only written to
        let write = || {
            let mut device = std::fs::OpenOptions::new().write(true).open(path)?;
            device.write_all(contents)?;
            device.flush()
        };
        return write().map_err(|e| unwritable(path, &e));
    }
    Staged::stage(path, contents)?.persist(path)
}

/// A new file, whole, beside the place that it will take.
struct Staged {
    file: tempfile::NamedTempFile,
    target: PathBuf,
}

impl Staged {
    fn stage(path: &Path, contents: &[u8]) -> Result<Self> {
        Self::try_of(path, contents).map_err(|e| unwritable(path, &e))
    }

    fn try_of(path: &Path, contents: &[u8]) -> std::io::Result<Self> {
        // the file that a link names is meant, whether or not it exists yet
        let target = inputs::behind_links(path)?;
        let folder = folder_of(&target);
        std::fs::create_dir_all(folder)?;
        let mut file = temporary::file_in(folder)?;
        file.write_all(contents)?;
        file.as_file().sync_all()?;
        #[cfg(unix)]
        {
            // a temporary file is private; the finished one is as readable as any other file of the user's
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::metadata(&target).map_or(0o644, |m| m.permissions().mode());
            file.as_file().set_permissions(std::fs::Permissions::from_mode(mode))?;
        }
        Ok(Self { file, target })
    }

    fn persist(self, path: &Path) -> Result<()> {
        self.file.persist(&self.target).map(drop).map_err(|e| unwritable(path, &e.error))
    }
}

/// The folder that a path lies in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn unwritable(path: &Path, e: &std::io::Error) -> Failure {
    // `tempfile` puts the name of the temporary file beside the reason; the user has not asked for that name
    let is_wrapped = e.get_ref().is_some() && e.kind() != ErrorKind::Other;
    let reason = if is_wrapped { e.kind().to_string() } else { e.to_string() };
    Failure::new("file::unwritable", format!("cannot write {}: {reason}", path.display())).help(remedy(e.kind()))
}

/// What to do where a file cannot be written.
fn remedy(why: ErrorKind) -> &'static str {
    match why {
        ErrorKind::PermissionDenied => "you may not write there: choose another folder, or change its permissions",
        ErrorKind::ReadOnlyFilesystem => "this disk can only be read: choose a folder on another disk",
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "the disk is full: free some space, or choose another disk"
        }
        _ => "is every part of the path a folder, and may you write there?",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remedy_fits_the_reason() {
        for (kind, word) in [
            (ErrorKind::PermissionDenied, "permissions"),
            (ErrorKind::ReadOnlyFilesystem, "only be read"),
            (ErrorKind::StorageFull, "the disk is full"),
            (ErrorKind::NotADirectory, "every part of the path"),
        ] {
            let Failure(findings) = unwritable(Path::new("out"), &kind.into());
            let help = findings[0].help.clone().unwrap_or_default();
            assert!(help.contains(word), "{kind}: {help}");
        }
    }

    #[test]
    fn the_name_of_a_temporary_file_is_not_shown() {
        let folder = tempfile::tempdir().unwrap();
        let gone = folder.path().join("gone");
        let error = temporary::file_in(&gone).unwrap_err();
        assert!(error.to_string().contains(" at path "), "{error}");
        let Failure(findings) = unwritable(Path::new("out"), &error);
        assert!(!findings[0].message.contains("axiscal-tmp"), "{}", findings[0].message);
    }
}
