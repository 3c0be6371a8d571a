//! The studies that were open before, newest first: a small file among the user's own data.

use crate::files;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const FORMAT: &str = "axiscal-recent/1";
const MOST: usize = 10;

/// Where the list is; nowhere, where the system names no place for it.
#[derive(Debug, Clone, Default)]
pub struct Recent {
    file: Option<PathBuf>,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct Kept {
    format: String,
    studies: Vec<PathBuf>,
}

impl Recent {
    /// In the folder of the program's data.
    #[must_use]
    pub fn new(folder: Option<PathBuf>) -> Self {
        Self { file: folder.map(|folder| folder.join("recent.json")) }
    }

    /// Those that are still there. A list that cannot be read is an empty one.
    #[must_use]
    pub fn list(&self) -> Vec<PathBuf> {
        let kept = self.file.as_ref().and_then(|file| files::read_own(file).ok());
        let kept: Kept = kept.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        kept.studies.into_iter().filter(|study| study.is_absolute() && study.is_file()).take(MOST).collect()
    }

    /// Puts a study first. That the list cannot be written is no reason to stop.
    pub fn add(&self, study: &Path) {
        let Some(file) = &self.file else { return };
        let mut studies = self.list();
        studies.retain(|other| other != study);
        studies.insert(0, study.to_path_buf());
        studies.truncate(MOST);
        let kept = Kept { format: FORMAT.to_owned(), studies };
        if let Ok(text) = serde_json::to_string_pretty(&kept)
            && file.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok())
        {
            let _ = files::rewrite(file, text.as_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_is_first_and_what_is_gone_is_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let recent = Recent::new(Some(dir.path().join("data/axiscal")));
        assert!(recent.list().is_empty());
        let studies: Vec<PathBuf> = (0..12).map(|i| dir.path().join(format!("{i}.toml"))).collect();
        for study in &studies {
            std::fs::write(study, "").unwrap();
            recent.add(study);
        }
        recent.add(&studies[5]);
        std::fs::remove_file(&studies[11]).unwrap();
        let list = recent.list();
        assert_eq!((list.len(), &list[0], &list[1]), (9, &studies[5], &studies[10]));
        std::fs::write(dir.path().join("data/axiscal/recent.json"), "{").unwrap();
        assert!(recent.list().is_empty());
        Recent::default().add(&studies[0]);
    }
}
