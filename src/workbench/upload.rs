//! A file that the page sends: its contents, and a name under which it may be kept.

use crate::diag::{Failure, Result};
use base64::Engine;
use serde::Deserialize;

/// Longest name of a kept file, characters.
const LONGEST_NAME: usize = 60;
/// Names that Windows gives to devices.
const DEVICES: [&str; 22] = [
    "con", "prn", "aux", "nul", "com1", "com2", "com3", "com4", "com5", "com6", "com7", "com8", "com9", "lpt1", "lpt2",
    "lpt3", "lpt4", "lpt5", "lpt6", "lpt7", "lpt8", "lpt9",
];

/// A file as the page sends it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Upload {
    /// As it is called on the user's disk.
    pub name: String,
    /// Its contents, Base64.
    pub data: String,
}

impl Upload {
    /// The contents.
    ///
    /// # Errors
    /// When they are no Base64.
    pub fn bytes(&self) -> Result<Vec<u8>> {
        base64::engine::general_purpose::STANDARD.decode(&self.data).map_err(|e| {
            Failure::new("workbench::upload", format!("{}: the contents cannot be read: {e}", self.name))
                .help("choose the file again")
        })
    }
}

/// A name of one part without signs that mean something to a shell or a file system; `otherwise` where nothing is left.
#[must_use]
pub fn kept_name(name: &str, otherwise: &str) -> String {
    let allowed = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let plain: String = name.chars().map(allowed).collect();
    let plain: String = plain.trim_matches(['.', '-']).chars().take(LONGEST_NAME).collect();
    let stem = plain.split('.').next().unwrap_or_default().to_lowercase();
    if plain.is_empty() {
        otherwise.to_owned()
    } else if DEVICES.contains(&stem.as_str()) {
        format!("file-{plain}")
    } else {
        plain
    }
}

/// The names under which several files are kept: no two alike, not even for a file system that knows no capitals.
#[must_use]
pub fn kept_names<'a>(names: impl Iterator<Item = &'a str>, taken: &[&str]) -> Vec<String> {
    let mut seen: Vec<String> = taken.iter().map(|name| name.to_lowercase()).collect();
    let mut out = Vec::new();
    for (i, name) in names.enumerate() {
        let plain = kept_name(name, &format!("file-{}", i + 1));
        let mut free = plain.clone();
        let mut number = 2;
        while seen.contains(&free.to_lowercase()) {
            free = format!("{number}-{plain}");
            number += 1;
        }
        seen.push(free.to_lowercase());
        out.push(free);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kept_name_is_one_plain_part() {
        for (name, kept) in [
            ("head.log", "head.log"),
            ("../../etc/passwd", "etc-passwd"),
            ("C:\\Users\\x\\a b.log", "C--Users-x-a-b.log"),
            ("<script>\"'.log", "script---.log"),
            (".hidden", "hidden"),
            ("..", "study"),
            ("", "study"),
            ("Müller µ.csv", "Müller-µ.csv"),
            ("nul.txt", "file-nul.txt"),
            ("a\0b\n", "a-b"),
            ("--out=x", "out-x"),
        ] {
            assert_eq!(kept_name(name, "study"), kept, "{name}");
        }
        assert_eq!(kept_name(&"x".repeat(500), "").chars().count(), 60);
    }

    #[test]
    fn no_two_files_are_kept_under_one_name() {
        let names = ["a.log", "A.LOG", "a.log", "study.toml"];
        assert_eq!(kept_names(names.into_iter(), &["study.toml"]), ["a.log", "2-A.LOG", "3-a.log", "2-study.toml"]);
    }

    #[test]
    fn contents_come_back() {
        let upload = |data: &str| Upload { name: "x".into(), data: data.into() };
        assert_eq!(upload("AP9h").bytes().unwrap(), [0, 255, b'a']);
        assert!(upload("!").bytes().is_err());
    }
}
