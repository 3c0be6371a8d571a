//! Names of files on their way to their place, and the ones that a killed run left behind.
//!
//! The name holds the number of the process, so that only what belongs to no running process is removed.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

const PREFIX: &str = ".axiscal-tmp-";
/// Signs behind the number of the process, chosen so that no two names are the same.
const SIGNS: usize = 6;
/// Where nobody knows which processes run, what is as old as this belongs to none.
const OLD: Duration = Duration::from_secs(24 * 3600);

pub(super) fn file_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    sweep(folder);
    tempfile::Builder::new().prefix(&prefix()).rand_bytes(SIGNS).tempfile_in(folder)
}

pub(super) fn folder_in(folder: &Path) -> io::Result<tempfile::TempDir> {
    sweep(folder);
    let prefix = prefix();
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).rand_bytes(SIGNS);
    #[cfg(unix)]
    {
        // it becomes the user's folder: as readable as any other
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o777));
    }
    builder.tempdir_in(folder)
}

fn prefix() -> String {
    format!("{PREFIX}{}-", std::process::id())
}

/// Removes what killed runs left in a folder; once for each folder in the life of the process.
pub(super) fn sweep(folder: &Path) {
    static SWEPT: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
    {
        let mut swept = SWEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if swept.iter().any(|known| known == folder) {
            return;
        }
        swept.push(folder.to_path_buf());
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(process) = name.to_str().and_then(process_of) else { continue };
        let Ok(found) = entry.metadata() else { continue };
        let age = found.modified().ok().and_then(|at| at.elapsed().ok()).unwrap_or_default();
        if !has_ended(process, age) {
            continue;
        }
        // one that cannot be removed hurts nobody
        let _ = if found.is_dir() { std::fs::remove_dir_all(entry.path()) } else { std::fs::remove_file(entry.path()) };
    }
}

/// The process that a temporary name belongs to; `None` for every other name.
fn process_of(name: &str) -> Option<u32> {
    let (process, signs) = name.strip_prefix(PREFIX)?.split_once('-')?;
    let ours = signs.len() == SIGNS && signs.bytes().all(|b| b.is_ascii_alphanumeric());
    process.parse().ok().filter(|_| ours && process.bytes().all(|b| b.is_ascii_digit()))
}

fn has_ended(process: u32, age: Duration) -> bool {
    let processes = Path::new("/proc");
    if cfg!(target_os = "linux") && processes.join("self").exists() {
        return !processes.join(process.to_string()).exists();
    }
    age >= OLD
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A process that ran a moment ago and does no more.
    fn ended() -> u32 {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }

    #[test]
    fn only_what_an_ended_process_left_is_removed() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        let (gone, here) = (ended(), std::process::id());
        let left = [format!("{PREFIX}{gone}-abc123"), format!("{PREFIX}{gone}-Xyz789")];
        let others = [
            format!("{PREFIX}{here}-abc123"),
            format!("{PREFIX}{gone}-notes"),
            format!("{PREFIX}{gone}"),
            format!("{PREFIX}mine-abc123"),
            ".axiscal-abc123".to_owned(),
            "axiscal.hal".to_owned(),
        ];
        std::fs::create_dir(at(&left[0])).unwrap();
        std::fs::write(at(&left[0]).join("axiscal.hal"), "").unwrap();
        std::fs::write(at(&left[1]), "").unwrap();
        others.iter().for_each(|name| std::fs::write(at(name), "").unwrap());
        super::super::write_whole(&at("new.txt"), b"new").unwrap();
        assert!(left.iter().all(|name| !at(name).exists()));
        for name in &others {
            assert!(at(name).exists(), "{name}");
        }
    }
}
