//! Reading whole files and writing them so that nobody ever sees half of one. Called from `cli` and `study` only.

use crate::diag::{Failure, Finding, Result};
use std::{io::Write, path::Path};

/// The bytes of a file.
///
/// # Errors
/// When it cannot be read; the message names the path and the reason.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| {
        Finding::error("file::unreadable", format!("cannot read {}: {e}", path.display()))
            .help("check the path, and that you may read the file")
            .into()
    })
}

/// The text of a file (UTF-8), without a byte order mark.
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let mut text = read_text_as_it_is(path)?;
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
    String::from_utf8(read_bytes(path)?).map_err(|e| {
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
/// When the folder cannot be written; an existing file is then untouched.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<()> {
    let fail = |e: std::io::Error| {
        // the reason without the name of the temporary file, which nobody has asked for
        let reason =
            e.raw_os_error().map_or_else(|| e.to_string(), |code| std::io::Error::from_raw_os_error(code).to_string());
        Failure::new("file::unwritable", format!("cannot write {}: {reason}", path.display()))
            .help("is every part of the path a folder, and may you write there?")
    };
    // a link is followed: the file that it names is the one that is meant
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let path = target.as_path();
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        // a device or a pipe cannot be replaced, only written to
        let mut device = std::fs::OpenOptions::new().write(true).open(path).map_err(fail)?;
        return device.write_all(contents).and_then(|()| device.flush()).map_err(fail);
    }
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(fail)?;
    let mut temporary = tempfile::Builder::new().prefix(".axiscal-").tempfile_in(folder).map_err(fail)?;
    temporary.write_all(contents).map_err(fail)?;
    temporary.as_file().sync_all().map_err(fail)?;
    #[cfg(unix)]
    {
        // a temporary file is private; the finished one is as readable as any other file of the user's
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(path).map_or(0o644, |m| m.permissions().mode());
        temporary.as_file().set_permissions(std::fs::Permissions::from_mode(mode)).map_err(fail)?;
    }
    temporary.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}
/// Takes a file away; one that is not there is no error.
///
/// # Errors
/// When it is there and cannot be removed.
pub fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::new("files::remove", format!("cannot remove {}: {e}", path.display()))
                .help("check that you may write there"))
        }
        _ => Ok(()),
    }
}
