//! One writer at a time: a lock file beside what is changed, held from reading it to writing it.

use super::inputs::real_path;
use super::{folder_of, unwritable};
use crate::diag::{Failure, Result};
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// For so long another writer is waited for.
const WAIT: Duration = Duration::from_secs(5);
/// How often it is asked whether that one has ended.
const ASK_EVERY: Duration = Duration::from_millis(5);

/// What is locked stays with its holder until this is dropped; the end of the process ends it as well.
#[derive(Debug)]
pub struct Lock(Option<(File, PathBuf)>);

impl Drop for Lock {
    fn drop(&mut self) {
        let Some((file, path)) = self.0.take() else { return };
        // removed while it is still held: who waits for it sees that it is no longer the one beside the study. One that is not
        // empty is somebody else's
        if cfg!(unix) && file.metadata().is_ok_and(|m| m.len() == 0) {
            let _ = std::fs::remove_file(path);
        }
        let _ = file.unlock();
    }
}

/// Locks a file or folder against other processes of this program, also against other threads of this one.
///
/// # Errors
/// When another one holds it for longer than a few seconds, or nothing can be written beside it.
pub fn lock(target: &Path) -> Result<Lock> {
    let real = real_path(target);
    let (folder, name) = (folder_of(&real), real.file_name().unwrap_or_default().to_string_lossy());
    if !folder.is_dir() || std::fs::metadata(&real).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        // nothing there that two could change
        return Ok(Lock(None));
    }
    let path = folder.join(format!(".{name}.lock"));
    let began = Instant::now();
    loop {
        let file = File::options().create(true).truncate(false).write(true).open(&path);
        let file = file.map_err(|e| unwritable(target, &e))?;
        match file.try_lock() {
            Ok(()) if is_at(&file, &path) => return Ok(Lock(Some((file, path)))),
            // the one before has just removed it: there is another one, or none
            Ok(()) => continue,
            Err(TryLockError::WouldBlock) if began.elapsed() < WAIT => std::thread::sleep(ASK_EVERY),
            Err(TryLockError::WouldBlock) => {
                return Err(Failure::new(
                    "file::busy",
                    format!("another axiscal process is changing {}", target.display()),
                )
                .help("nothing was written: wait until the other process has ended, then call again"));
            }
            // a file system without locks
            Err(TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => return Ok(Lock(None)),
            Err(TryLockError::Error(e)) => return Err(unwritable(target, &e)),
        }
    }
}

/// Is this open file the one of that name?
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |m: std::fs::Metadata| (m.dev(), m.ino());
    file.metadata().ok().map(id).is_some_and(|own| std::fs::metadata(path).ok().map(id) == Some(own))
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn one_holds_it_at_a_time_and_nothing_is_left() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("count.txt");
        std::fs::write(&target, "0").unwrap();
        let within = AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..50 {
                        let _alone = lock(&target).unwrap();
                        assert_eq!(within.fetch_add(1, Ordering::SeqCst), 0);
                        let n: u32 = std::fs::read_to_string(&target).unwrap().parse().unwrap();
                        std::fs::write(&target, (n + 1).to_string()).unwrap();
                        within.fetch_sub(1, Ordering::SeqCst);
                    }
                });
            }
        });
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "200");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn who_waits_too_long_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("study.toml");
        let held = lock(&target).unwrap();
        assert_eq!(lock(&target).unwrap_err().0[0].code, "file::busy");
        drop(held);
        lock(&target).unwrap();
    }
}
