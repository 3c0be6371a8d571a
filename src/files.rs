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

/// The text of a file (UTF-8).
///
/// # Errors
/// When it cannot be read or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = read_bytes(path)?;
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
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
/// When the folder cannot be written; an existing file is then untouched.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<()> {
    let fail = |e: std::io::Error| {
        Failure::new("file::unwritable", format!("cannot write {}: {e}", path.display()))
            .help("does the folder exist, and may you write there?")
    };
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
