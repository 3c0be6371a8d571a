//! What may be read: files up to a size, and streams that are given on purpose. Anything else is refused before it is read.

use crate::diag::{Failure, Finding, Result};
use std::fs::{File, Metadata};
use std::io::{IsTerminal, Read};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// The largest input, bytes.
static MOST: AtomicU64 = AtomicU64::new(2 << 30);

/// Sets the largest input that is read.
pub fn set_max_input(bytes: u64) {
    MOST.store(bytes, Ordering::Relaxed);
}

/// The largest input that is read, bytes.
#[must_use]
pub fn max_input() -> u64 {
    MOST.load(Ordering::Relaxed)
}

/// A size as a person writes it: `500000`, `20K`, `300M`, `4G` (of 1024).
///
/// # Errors
/// When it is no size; the sentence says how one is written.
pub fn read_size(word: &str) -> std::result::Result<u64, String> {
    let digits = word.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match word[digits.len()..].to_ascii_uppercase().as_str() {
        "" => 1,
        "K" => 1 << 10,
        "M" => 1 << 20,
        "G" => 1 << 30,
        _ => return Err("write bytes, or a number with K, M or G behind it".to_owned()),
    };
    let number: u64 = digits.parse().map_err(|_| "write a whole number, with K, M or G behind it if you like")?;
    number.checked_mul(factor).filter(|n| *n > 0).ok_or_else(|| "this size is out of range".to_owned())
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    let unreadable = |e: std::io::Error| -> Failure {
        Finding::error("file::unreadable", format!("cannot read {}: {e}", path.display()))
            .help("check the path, and that you may read the file")
            .into()
    };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() && !is_stream(path, &found) {
        return Err(no_file(path, &found));
    }
    let most = max_input();
    if found.len() > most {
        return Err(too_large(path, most));
    }
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(usize::try_from(found.len()).unwrap_or(usize::MAX))
        .map_err(|_| no_memory(path, found.len()))?;
    // a stream, and a file that grows, says nothing true of its length
    let file = File::open(path).map_err(unreadable)?;
    file.take(most.saturating_add(1)).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > most {
        return Err(too_large(path, most));
    }
    Ok(bytes)
}

/// Something that ends and that the caller has given on purpose: stdin, the pipe of a shell, the empty device.
#[cfg(unix)]
fn is_stream(path: &Path, found: &Metadata) -> bool {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    let is = |name: &str| {
        let other = std::fs::metadata(name);
        other.is_ok_and(|other| (other.dev(), other.ino()) == (found.dev(), found.ino()))
    };
    // one with a name in a folder may wait for its writer for ever; one without is a shell's
    let is_endless = found.file_type().is_char_device() && !is("/dev/null") && !std::io::stdin().is_terminal();
    let is_unnamed_pipe = found.file_type().is_fifo() && path.canonicalize().is_err();
    !found.is_dir() && !is_endless && (is_unnamed_pipe || is("/dev/stdin") || is("/dev/null"))
}

#[cfg(not(unix))]
fn is_stream(_: &Path, found: &Metadata) -> bool {
    !found.is_dir()
}

fn no_file(path: &Path, found: &Metadata) -> Failure {
    let what = if found.is_dir() { "a folder" } else { "a device or a pipe" };
    Failure::new("file::no_file", format!("{} is {what}, not a file", path.display()))
        .help("name a file; a stream can be given as /dev/stdin")
}

fn no_memory(path: &Path, bytes: u64) -> Failure {
    Failure::new("file::no_memory", format!("{} has {bytes} bytes; there is not so much memory free", path.display()))
        .help("close other programs, or read it on a computer with more memory")
}

fn too_large(path: &Path, most: u64) -> Failure {
    Failure::new("file::too_large", format!("{} is larger than {most} bytes", path.display()))
        .help("is this the right file? If it is, give a larger limit with --max-input, for example --max-input 8G")
}

/// Memory that one touch takes at most in a command that reads a study (measured: docs/testing.md), bytes.
const BYTES_PER_TOUCH: u64 = 30_000;

/// Refuses so many touches that the system would end the process for want of memory. Only Linux says how much is free.
///
/// # Errors
/// When there is not so much memory free.
pub fn enough_memory(n_touches: usize) -> Result<()> {
    let said = std::fs::read_to_string("/proc/meminfo").ok();
    enough_of(n_touches, said.and_then(|text| available_bytes(&text)))
}

/// What `/proc/meminfo` says is free.
fn available_bytes(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}

fn enough_of(n_touches: usize, available: Option<u64>) -> Result<()> {
    let needed = BYTES_PER_TOUCH.saturating_mul(n_touches as u64);
    let Some(free) = available.filter(|free| *free < needed) else { return Ok(()) };
    let mb = |bytes: u64| bytes / 1_000_000;
    let says = format!("{n_touches} touches need about {} MB of memory; {} MB are free", mb(needed), mb(free));
    Err(Failure::new("file::no_memory", says)
        .help("close other programs, use a computer with more memory, or divide the runs between several studies"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_read_as_it_is_written() {
        assert_eq!(read_size("500"), Ok(500));
        assert_eq!(read_size("20K"), Ok(20 << 10));
        assert_eq!(read_size("3m"), Ok(3 << 20));
        assert_eq!(read_size("2G"), Ok(2 << 30));
        for wrong in ["", "0", "G", "-1", "1.5G", "3T", "1KB", "99999999999999999999", "18446744073709551615K", "3µ"] {
            assert!(read_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn too_many_touches_for_the_memory_are_refused() {
        let meminfo = "MemTotal:       24000000 kB\nMemAvailable:    1000000 kB\n";
        assert_eq!(available_bytes(meminfo), Some(1_024_000_000));
        assert_eq!(available_bytes("MemTotal: 24000000 kB\n"), None);
        assert!(enough_of(30_000, available_bytes(meminfo)).is_ok());
        assert!(enough_of(usize::MAX, None).is_ok(), "nothing is known of the memory");
        let refused = enough_of(40_000, available_bytes(meminfo)).unwrap_err().to_string();
        assert!(refused.contains("40000 touches need about 1200 MB of memory; 1024 MB are free"), "{refused}");
    }
}
