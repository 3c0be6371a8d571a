//! What this call has read, so that nothing is written over it: under whatever spelling, through links of either kind.

use crate::diag::{Failure, Result};
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Device and number of a file: the same for all its names.
type Id = (u64, u64);

/// A file, whether or not it exists yet.
#[derive(Debug, Clone)]
struct Place {
    real: PathBuf,
    id: Option<Id>,
}

impl Place {
    /// `None` for a device or a pipe: those are never written over.
    fn resolve(path: &Path) -> Option<Self> {
        let found = std::fs::metadata(path).ok();
        if found.as_ref().is_some_and(|f| !f.is_file() && !f.is_dir()) {
            return None;
        }
        let real = real_path(path);
        let found = found.or_else(|| std::fs::metadata(&real).ok());
        Some(Self { id: found.as_ref().and_then(id), real })
    }

    fn is(&self, other: &Self) -> bool {
        self.real == other.real || (self.id.is_some() && self.id == other.id)
    }
}

#[cfg(unix)]
#[allow(clippy::unnecessary_wraps)] // elsewhere there is none
fn id(found: &std::fs::Metadata) -> Option<Id> {
    use std::os::unix::fs::MetadataExt;
    Some((found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn id(_: &std::fs::Metadata) -> Option<Id> {
    None
}

#[derive(Debug)]
struct Input {
    /// As it was named.
    path: PathBuf,
    place: Place,
}

static INPUTS: Mutex<Vec<Input>> = Mutex::new(Vec::new());

fn inputs() -> MutexGuard<'static, Vec<Input>> {
    INPUTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Remembers a file that was read.
pub(super) fn keep(path: &Path) {
    let Some(place) = Place::resolve(path) else { return };
    let mut inputs = inputs();
    inputs.retain(|known| known.place.real != place.real);
    inputs.push(Input { path: path.to_path_buf(), place });
}

/// A file that is known may be another one of the same name now.
pub(super) fn replaced(path: &Path) {
    let Some(place) = Place::resolve(path) else { return };
    for known in inputs().iter_mut().filter(|known| known.place.real == place.real) {
        known.place = place.clone();
    }
}

/// A file that is known is no more.
pub(super) fn removed(path: &Path) {
    let real = real_path(path);
    inputs().retain(|known| known.place.real != real);
}

/// Begins a new call: what an earlier one of this process has read may be written over.
pub fn forget_inputs() {
    inputs().clear();
}

/// Refuses outputs that would take the place of an input or of each other. A verb with several outputs asks before it writes
/// the first.
///
/// # Errors
/// When an output was read by this call, or is named twice.
pub fn check_outputs<P: AsRef<Path>>(outputs: &[P]) -> Result<()> {
    let inputs = inputs();
    let mut seen: Vec<(&Path, Place)> = Vec::new();
    for output in outputs.iter().map(AsRef::as_ref) {
        let Some(place) = Place::resolve(output) else { continue };
        if let Some(input) = inputs.iter().find(|input| input.place.is(&place)) {
            return Err(Failure::new(
                "file::is_input",
                format!("{} would be written over {}, which is read here", output.display(), input.path.display()),
            )
            .help("nothing was written: name another file or folder to write to"));
        }
        if let Some((other, _)) = seen.iter().find(|(_, known)| known.is(&place)) {
            return Err(Failure::new(
                "file::same_output",
                format!("{} and {} are the same file, and both would be written", other.display(), output.display()),
            )
            .help("nothing was written: name a file of its own for each"));
        }
        seen.push((output, place));
    }
    Ok(())
}

/// The file that is meant by a path: links are followed, also one whose file does not exist yet.
pub(super) fn behind_links(path: &Path) -> std::io::Result<PathBuf> {
    const MOST_LINKS: usize = 40;
    let mut at = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        if let Ok(real) = at.canonicalize() {
            return Ok(real);
        }
        let Ok(next) = std::fs::read_link(&at) else { return Ok(at) };
        at = at.parent().map_or_else(|| next.clone(), |folder| folder.join(&next));
    }
    Err(std::io::Error::other("the link leads back to itself"))
}

/// The path without links and detours, also where its last parts do not exist yet.
pub(super) fn real_path(path: &Path) -> PathBuf {
    let path = behind_links(path).unwrap_or_else(|_| path.to_path_buf());
    let absolute = std::path::absolute(&path).unwrap_or(path);
    let mut above = absolute.as_path();
    let mut rest: Vec<OsString> = Vec::new();
    loop {
        if let Ok(mut real) = above.canonicalize() {
            for part in rest.iter().rev() {
                if part == ".." {
                    real.pop();
                } else {
                    real.push(part);
                }
            }
            // behind a detour it may exist after all
            return real.canonicalize().unwrap_or(real);
        }
        let Some(part) = above.components().next_back().filter(|part| !matches!(part, Component::RootDir)) else {
            return absolute;
        };
        rest.push(part.as_os_str().to_owned());
        let Some(parent) = above.parent() else { return absolute };
        above = parent;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_that_does_not_exist_has_one_spelling() {
        let dir = tempfile::tempdir().unwrap();
        let real = dir.path().canonicalize().unwrap();
        assert_eq!(real_path(&dir.path().join("new/../a/./b.csv")), real.join("a/b.csv"));
        std::fs::write(dir.path().join("a"), "").unwrap();
        assert_eq!(real_path(&dir.path().join("new/../a")), real.join("a"));
        assert_eq!(real_path(&dir.path().join("..")), real.parent().unwrap());
    }
}
