//! A folder of files that belong together: all of the new ones or all of the old ones, never some of each.
//!
//! The new files are written to a folder beside, which then takes the place of the old one. A list in the folder
//! ([`MANIFEST`]) says which files this program wrote; every other one is the user's and stays. An interrupted call leaves
//! the old folder under a name of its own beside the new one: the next call goes on from there.

use super::inputs::real_path;
use super::lock::{Lock, lock};
use super::{check_outputs, folder_of, put, temporary, unwritable};
use crate::diag::{Failure, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};

/// The list of the files that this program wrote into a folder.
pub const MANIFEST: &str = ".axiscal-files.json";

const FORMAT: &str = "axiscal-files/1";

/// Without it no reader takes a folder for a compensation: it goes first and comes last.
const KEY_FILE: &str = "compensation.json";

/// A file with its path in the folder, parts divided by `/`.
type NewFile = (String, Vec<u8>);

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Manifest {
    format: String,
    /// Whose files they are: a controller's name.
    owner: String,
    files: BTreeSet<String>,
}

impl Manifest {
    fn new(owner: &str, files: impl Iterator<Item = String>) -> Self {
        Self { format: FORMAT.to_owned(), owner: owner.to_owned(), files: files.collect() }
    }

    /// That of a folder, where it has one that can be read.
    fn read(folder: &Path) -> Option<Self> {
        let text = fs::read(folder.join(MANIFEST)).ok()?;
        serde_json::from_slice(&text).ok().filter(|m: &Self| m.format == FORMAT)
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Failure::new("file::manifest", format!("the list of the files cannot be written: {e}")))?;
        put(&folder.join(MANIFEST), (text + "\n").as_bytes())
    }

    /// Written by this program, and of no use beside the files of another call.
    fn is_replaceable(&self, relative: &str) -> bool {
        relative == MANIFEST || (self.files.contains(relative) && !is_restoring(relative))
    }

    fn is_ours(&self, folder: &str) -> bool {
        self.files.iter().any(|file| file.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/')))
    }
}

/// A file that brings back what the control held before: it may be all that is left of that.
fn is_restoring(relative: &str) -> bool {
    relative.rsplit('/').next().is_some_and(|name| name.starts_with("restore"))
}

/// A folder that one call writes into while others wait.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    real: PathBuf,
    /// `None` where nothing can be locked: the folder above is not there yet, or is not the user's to write.
    lock: Option<Lock>,
}

impl Folder {
    /// Takes a folder, whether or not it exists, and finishes or takes back what an interrupted call began there.
    ///
    /// # Errors
    /// When another process writes into it, or what was begun cannot be ended.
    pub fn open(path: &Path) -> Result<Self> {
        let mut folder = Self { path: path.to_path_buf(), real: real_path(path), lock: None };
        folder.take()?;
        Ok(folder)
    }

    fn take(&mut self) -> Result<()> {
        if self.lock.is_some() || !folder_of(&self.real).is_dir() {
            return Ok(());
        }
        match lock(&self.real) {
            Ok(lock) => self.lock = Some(lock),
            // a folder above that cannot be written holds no unfinished work either
            Err(failure) if failure.0.iter().all(|f| f.code == "file::unwritable") => return Ok(()),
            Err(failure) => return Err(failure),
        }
        self.recover().map_err(|e| unwritable(&self.path, &e))
    }

    /// Does it hold files that an earlier call wrote, whole or interrupted?
    #[must_use]
    pub fn was_written(&self) -> bool {
        self.real.join(KEY_FILE).is_file() || self.real.join(MANIFEST).is_file()
    }

    /// Puts the files in the place of those of the earlier call. The user's own files stay, and so do restoring files of
    /// other values: under their names, or with `.earlier-1` behind it where the name is taken.
    ///
    /// # Errors
    /// When the folder holds files of another owner, a file of the user's would be lost, or nothing can be written. The folder
    /// is then as it was.
    pub fn write(mut self, owner: &str, files: &[NewFile]) -> Result<()> {
        let outputs: Vec<PathBuf> = files.iter().map(|(name, _)| self.path.join(name)).collect();
        check_outputs(&outputs)?;
        fs::create_dir_all(folder_of(&self.real)).map_err(|e| unwritable(&self.path, &e))?;
        self.take()?;
        let old = self.earlier(owner, files)?;
        let new = Manifest::new(owner, files.iter().map(|(name, _)| name.clone()));
        match self.swap(files, &old, &new) {
            Ok(()) => Ok(()),
            Err(Stopped::Cannot) => self.replace_in_place(files, &old, &new),
            Err(Stopped::Failed(failure)) => Err(failure),
        }
    }

    /// What the earlier call wrote, when this one may take its place.
    fn earlier(&self, owner: &str, files: &[NewFile]) -> Result<Manifest> {
        let is_new = |name: &str| files.iter().any(|(new, _)| new == name);
        let Some(old) = Manifest::read(&self.real) else {
            self.no_unknown_tables(&is_new)?;
            // before there was a list: what has the name of a new file is its earlier state
            let names = files.iter().map(|(name, _)| name.clone());
            let old = Manifest::new(owner, names.filter(|name| self.real.join(name).exists()));
            // the old folder must be known as such under whatever name
            if self.real.is_dir() {
                old.write(&self.real)?;
            }
            return Ok(old);
        };
        if old.owner != owner {
            return Err(Failure::new(
                "export::other_controller",
                format!("{} holds the tables of {}", self.path.display(), old.owner),
            )
            .help("nothing was written: name another folder, one for each controller"));
        }
        let is_lost = |name: &&String| {
            !is_restoring(name)
                && !old.files.contains(*name)
                && self.real.join(name.as_str()).symlink_metadata().is_ok()
        };
        match files.iter().map(|(name, _)| name).find(is_lost) {
            None => Ok(old),
            Some(name) => Err(Failure::new(
                "export::not_ours",
                format!("{} was not written by an earlier export", self.path.join(name).display()),
            )
            .help("nothing was written: move your file away, or name another folder")),
        }
    }

    /// Tables of an export of which no list was kept: loaded by mistake they would be a wrong compensation.
    fn no_unknown_tables(&self, is_new: &dyn Fn(&str) -> bool) -> Result<()> {
        let entries = fs::read_dir(&self.real).into_iter().flatten().flatten();
        let mut names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
        match names.find(|name| name.starts_with("axiscal") && !is_new(name)) {
            None => Ok(()),
            Some(name) => Err(Failure::new(
                "export::stale",
                format!("{} may be a table of an earlier export", self.path.join(name).display()),
            )
            .help("nothing was written: move it away, or name another folder")),
        }
    }

    /// The folder that the old one becomes until it is cleared.
    fn aside(&self) -> PathBuf {
        let name = self.real.file_name().unwrap_or_default().to_string_lossy();
        folder_of(&self.real).join(format!(".axiscal-old-{name}"))
    }

    /// Ends what an interrupted call began.
    fn recover(&self) -> io::Result<()> {
        temporary::sweep(&self.real);
        let aside = self.aside();
        let Some(old) = Manifest::read(&aside) else { return Ok(()) };
        if self.real.exists() { clear(&aside, &self.real, &old) } else { fs::rename(&aside, &self.real) }
    }

    /// Writes the new folder beside and exchanges the two.
    fn swap(&self, files: &[NewFile], old: &Manifest, new: &Manifest) -> std::result::Result<(), Stopped> {
        let failed = |e: io::Error| Stopped::Failed(unwritable(&self.path, &e));
        let exists = self.real.exists();
        if exists && !self.real.is_dir() {
            return Err(failed(ErrorKind::NotADirectory.into()));
        }
        // a process that stands in the old folder would stand in none
        let stands_in_it = std::env::current_dir().is_ok_and(|at| real_path(&at).starts_with(&self.real));
        if self.lock.is_none() || stands_in_it {
            if !exists {
                fs::create_dir(&self.real).map_err(failed)?;
            }
            return Err(Stopped::Cannot);
        }
        let fresh = temporary::folder_in(folder_of(&self.real)).map_err(failed)?;
        write_new(fresh.path(), files).map_err(failed)?;
        new.write(fresh.path()).map_err(Stopped::Failed)?;
        if !exists {
            return fs::rename(fresh.path(), &self.real).map_err(failed);
        }
        // what cannot be carried over can stay where it is
        let carried = carry(&self.real, fresh.path(), "", old, Carry::Link);
        carried.and_then(|()| make_alike(&self.real, fresh.path())).map_err(|_| Stopped::Cannot)?;
        let aside = self.aside();
        // a mount point, an open file: not every folder can be moved
        fs::rename(&self.real, &aside).map_err(|_| Stopped::Cannot)?;
        if let Err(e) = fs::rename(fresh.path(), &self.real) {
            fs::rename(&aside, &self.real).map_err(failed)?;
            return Err(failed(e));
        }
        clear(&aside, &self.real, old).map_err(failed)
    }

    /// Replaces the files one by one where the folder cannot be moved. The old tables go before the first new one comes, and
    /// the list names both until all is done: whoever is interrupted leaves a folder that is no compensation.
    fn replace_in_place(&self, files: &[NewFile], old: &Manifest, new: &Manifest) -> Result<()> {
        let failed = |e: io::Error| unwritable(&self.path, &e);
        let fresh = temporary::folder_in(&self.real).map_err(failed)?;
        write_new(fresh.path(), files).map_err(failed)?;
        for (name, _) in files.iter().filter(|(name, _)| is_restoring(name)) {
            keep_earlier(&self.real.join(name), &fresh.path().join(name)).map_err(failed)?;
        }
        Manifest::new(&new.owner, old.files.union(&new.files).cloned()).write(&self.real)?;
        let gone = old.files.iter().filter(|name| name.as_str() != KEY_FILE && old.is_replaceable(name));
        for name in std::iter::once(KEY_FILE).chain(gone.map(String::as_str)).filter(|name| is_inside(name)) {
            super::remove(&self.real.join(name))?;
        }
        let (key, others): (Vec<_>, Vec<_>) = files.iter().map(|(name, _)| name).partition(|name| *name == KEY_FILE);
        for name in others.into_iter().chain(key) {
            let target = self.real.join(name);
            fs::create_dir_all(folder_of(&target)).map_err(failed)?;
            fs::rename(fresh.path().join(name), target).map_err(failed)?;
        }
        new.write(&self.real)
    }
}

/// Why the folders were not exchanged.
enum Stopped {
    /// This folder cannot be moved.
    Cannot,
    /// Nothing more can be done.
    Failed(Failure),
}

fn write_new(folder: &Path, files: &[NewFile]) -> io::Result<()> {
    use io::Write;
    for (name, contents) in files {
        let path = folder.join(name);
        fs::create_dir_all(folder_of(&path))?;
        let mut file = fs::File::create(&path)?;
        file.write_all(contents)?;
        file.sync_all()?;
    }
    Ok(())
}

/// A path of a list that stays in its folder.
fn is_inside(relative: &str) -> bool {
    Path::new(relative).components().all(|part| matches!(part, Component::Normal(_)))
}

/// How what is not replaceable comes from an old folder to a new one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Carry {
    /// A second name for the same file: the old folder stays whole until it is no longer needed.
    Link,
    /// Out of the old folder, which is emptied.
    Move,
}

/// Empties an old folder into the one that took its place, and removes it.
fn clear(aside: &Path, real: &Path, old: &Manifest) -> io::Result<()> {
    carry(aside, real, "", old, Carry::Move)?;
    // last, so that an interrupted call knows whose files are left
    fs::remove_file(aside.join(MANIFEST))?;
    fs::remove_dir(aside)
}

/// Carries the user's own files and the restoring ones over.
fn carry(from: &Path, to: &Path, within: &str, old: &Manifest, by: Carry) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let name = entry.file_name();
        let relative = match within {
            "" => name.to_string_lossy().into_owned(),
            folder => format!("{folder}/{}", name.to_string_lossy()),
        };
        let (here, there) = (entry.path(), to.join(&name));
        if entry.file_type()?.is_dir() {
            if by == Carry::Link && fs::metadata(&here)?.permissions().readonly() {
                // it could not be emptied later
                return Err(ErrorKind::PermissionDenied.into());
            }
            let is_made = !old.is_ours(&relative) && !there.exists();
            if is_made {
                fs::create_dir_all(&there)?;
            }
            carry(&here, &there, &relative, old, by)?;
            if is_made {
                make_alike(&here, &there)?;
            }
            if by == Carry::Move {
                fs::remove_dir(&here)?;
            }
        } else if !old.is_replaceable(&relative) {
            carry_file(&here, &there, by)?;
        } else if by == Carry::Move && relative != MANIFEST {
            fs::remove_file(&here)?;
        }
    }
    Ok(())
}

/// Gives a new folder owner and permissions of an old one.
fn make_alike(old: &Path, new: &Path) -> io::Result<()> {
    let found = fs::metadata(old)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        // only a super-user can give a folder away
        let _ = std::os::unix::fs::chown(new, Some(found.uid()), Some(found.gid()));
    }
    fs::set_permissions(new, found.permissions())
}

fn carry_file(here: &Path, there: &Path, by: Carry) -> io::Result<()> {
    let target = match free_name(here, there) {
        Some(target) => target,
        None if by == Carry::Move => return fs::remove_file(here),
        None => return Ok(()),
    };
    fs::create_dir_all(folder_of(&target))?;
    match by {
        Carry::Move => fs::rename(here, target),
        // not every file system has second names
        Carry::Link => fs::hard_link(here, &target).or_else(|_| fs::copy(here, &target).map(drop)),
    }
}

/// Keeps a restoring file that a new one of other values replaces.
fn keep_earlier(here: &Path, new: &Path) -> io::Result<()> {
    if here.symlink_metadata().is_err() || is_same(here, new) {
        return Ok(());
    }
    match free_name(here, &numbered(here, 1)) {
        Some(target) => fs::hard_link(here, &target).or_else(|_| fs::copy(here, &target).map(drop)),
        None => Ok(()),
    }
}

/// Where a file goes that should be at `there`; `None` where it lies there already, as the same file or with the same values.
fn free_name(here: &Path, there: &Path) -> Option<PathBuf> {
    let (mut target, mut number) = (there.to_path_buf(), 0);
    while target.symlink_metadata().is_ok() {
        if is_same(here, &target) {
            return None;
        }
        number += 1;
        target = numbered(there, number);
    }
    Some(target)
}

fn numbered(path: &Path, number: usize) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".earlier-{number}"));
    path.with_file_name(name)
}

/// One file under two names, or two of the same contents; of restoring files the remarks do not count.
fn is_same(a: &Path, b: &Path) -> bool {
    if is_one_file(a, b) {
        return true;
    }
    let (Ok(a_bytes), Ok(b_bytes)) = (fs::read(a), fs::read(b)) else { return false };
    let is_restoring = a.file_name().is_some_and(|name| is_restoring(&name.to_string_lossy()));
    a_bytes == b_bytes || (is_restoring && values(&a_bytes) == values(&b_bytes))
}

#[cfg(unix)]
fn is_one_file(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |path: &Path| fs::symlink_metadata(path).ok().map(|m| (m.dev(), m.ino()));
    id(a).is_some() && id(a) == id(b)
}

#[cfg(not(unix))]
fn is_one_file(_: &Path, _: &Path) -> bool {
    false
}

/// The lines that a control reads: the head of a file names the day and the study.
fn values(bytes: &[u8]) -> Vec<&[u8]> {
    let lines = bytes.split(|b| *b == b'\n').map(<[u8]>::trim_ascii);
    lines.filter(|line| !line.is_empty() && !matches!(line[0], b'#' | b';' | b'(')).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(names: &[(&str, &str)]) -> Vec<NewFile> {
        names.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec())).collect()
    }

    const OLD: [(&str, &str); 4] =
        [("compensation.json", "1"), ("axiscal.hal", "old"), ("axiscal_x.txt", "old"), ("restore.hal", "# 1\nA")];
    const NEW: [(&str, &str); 4] =
        [("compensation.json", "2"), ("axiscal.hal", "new"), ("stock/axiscal.hal", "new"), ("restore.hal", "# 2\nB")];

    fn text(at: &Path, name: &str) -> String {
        fs::read_to_string(at.join(name)).unwrap_or_else(|e| format!("{name}: {e}"))
    }

    fn write(at: &Path, names: &[(&str, &str)]) {
        Folder::open(at).unwrap().write("c", &files(names)).unwrap();
    }

    /// What lies beside the folder, which should be nothing.
    fn beside(at: &Path) -> usize {
        fs::read_dir(at.parent().unwrap()).unwrap().count() - 1
    }

    fn of_the_user(at: &Path) {
        fs::write(at.join("axiscal-notes.txt"), "mine").unwrap();
        fs::write(at.join("restore-notes.md"), "mine").unwrap();
        fs::create_dir_all(at.join("photos/empty")).unwrap();
        fs::write(at.join("photos/1.jpg"), "mine").unwrap();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(at.join("photos"), fs::Permissions::from_mode(0o700)).unwrap();
        }
    }

    fn is_new_with_the_user_s(at: &Path) {
        for (name, contents) in NEW {
            assert_eq!(text(at, name), contents);
        }
        assert!(!at.join("axiscal_x.txt").exists());
        assert_eq!(text(at, "restore.hal.earlier-1"), "# 1\nA");
        for name in ["axiscal-notes.txt", "restore-notes.md", "photos/1.jpg"] {
            assert_eq!(text(at, name), "mine");
        }
        assert!(at.join("photos/empty").is_dir());
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(fs::metadata(at.join("photos")).unwrap().permissions().mode() & 0o777, 0o700);
        }
    }

    #[test]
    fn new_files_replace_the_old_ones_and_the_user_s_stay() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path().join("comp");
        write(&at, &OLD);
        of_the_user(&at);
        write(&at, &NEW);
        is_new_with_the_user_s(&at);
        // the same values under another head are no further restoring file
        write(&at, &[("compensation.json", "3"), ("restore.hal", "# 3\nB")]);
        assert!(!at.join("axiscal.hal").exists() && !at.join("restore.hal.earlier-2").exists());
        // a restoring file that is not written anew stays
        write(&at, &[("compensation.json", "4")]);
        assert_eq!(text(&at, "restore.hal"), "# 3\nB");
        assert_eq!(beside(&at), 0);
    }

    #[test]
    fn in_place_the_same_comes_out() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path().join("comp");
        write(&at, &OLD);
        of_the_user(&at);
        let folder = Folder::open(&at).unwrap();
        let new = files(&NEW);
        let (old, list) = (folder.earlier("c", &new).unwrap(), Manifest::new("c", new.iter().map(|f| f.0.clone())));
        folder.replace_in_place(&new, &old, &list).unwrap();
        drop(folder);
        is_new_with_the_user_s(&at);
        assert_eq!(beside(&at), 0);
    }

    #[test]
    fn an_interrupted_exchange_is_ended() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path().join("comp");
        write(&at, &OLD);
        let aside = Folder::open(&at).unwrap().aside();
        // between the two names
        fs::rename(&at, &aside).unwrap();
        drop(Folder::open(&at).unwrap());
        assert_eq!(text(&at, "axiscal.hal"), "old");
        // before the old folder is cleared
        of_the_user(&at);
        fs::rename(&at, &aside).unwrap();
        let new = files(&NEW);
        write_new(&at, &new).unwrap();
        Manifest::new("c", new.into_iter().map(|f| f.0)).write(&at).unwrap();
        drop(Folder::open(&at).unwrap());
        is_new_with_the_user_s(&at);
        assert_eq!(beside(&at), 0);
    }

    #[test]
    fn what_is_not_ours_is_not_written_over() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path().join("comp");
        write(&at, &OLD);
        let code = |owner: &str, names: &[(&str, &str)]| {
            Folder::open(&at).unwrap().write(owner, &files(names)).unwrap_err().0[0].code
        };
        assert_eq!(code("other", &NEW), "export::other_controller");
        fs::write(at.join("README.txt"), "mine").unwrap();
        assert_eq!(code("c", &[("README.txt", "new")]), "export::not_ours");
        fs::remove_file(at.join(MANIFEST)).unwrap();
        assert_eq!(code("c", &NEW), "export::stale");
        assert_eq!(text(&at, "axiscal.hal") + &text(&at, "README.txt"), "oldmine");
    }

    #[test]
    fn a_list_removes_nothing_outside() {
        assert!(is_inside("stock/axiscal.hal"));
        assert!(!is_inside("../axiscal.hal") && !is_inside("/axiscal.hal"));
    }
}
