//! A further run is put into a study in place: comments and order stay.

use super::Study;
use crate::diag::{Failure, Result, source};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, value};

/// A run that joins a study. Paths as the study sees them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Joined {
    pub plan: String,
    pub log: String,
    /// A controller, a postprocessor file, or `csv`.
    pub controller: String,
    /// The blocks stand as the last run left them: what that run calls them, and what this one does.
    pub stood: Option<(String, String)>,
}

/// The study's text with the run at the end of its `[[data]]`.
///
/// # Errors
/// When the text is no study.
pub fn join(text: &str, run: &Joined) -> Result<String> {
    let mut doc: DocumentMut = text.parse().map_err(|e| {
        Failure::new("study::not_toml", format!("the study is no TOML: {e}")).help("correct it by hand first")
    })?;
    let runs =
        doc.entry("data").or_insert(Item::ArrayOfTables(ArrayOfTables::new())).as_array_of_tables_mut().ok_or_else(
            || Failure::new("study::data", "data is no list of tables").help("write [[data]] for each run"),
        )?;
    let count = runs.len();
    if let (Some((before, _)), Some(last)) = (&run.stood, count.checked_sub(1).and_then(|i| runs.get_mut(i)))
        && !last.contains_key("mounting")
    {
        last["mounting"] = value(before);
    }
    let mut table = Table::new();
    table["plan"] = value(&run.plan);
    table["log"] = value(&run.log);
    table["controller"] = value(&run.controller);
    if let Some((_, own)) = &run.stood {
        table["mounting"] = value(own);
    }
    table.decor_mut().set_prefix("\n");
    runs.push(table);
    let text = doc.to_string();
    Study::parse(&source("study.toml", text.clone()))?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_stay_and_blocks_are_shared() {
        let text = "# mine\nmachine = \"swivel-head\" # paper\n\n[[data]] # first\nplan = \"a.plan.json\"\nlog = \"a.log\"\ncontroller = \"csv\"\n\n[model]\neffects = [\"location-b\"] # all\n";
        let run = Joined {
            plan: "n.plan.json".into(),
            log: "n.log".into(),
            controller: "linuxcnc".into(),
            stood: Some(("full-1".into(), "full-1".into())),
        };
        let out = join(text, &run).unwrap();
        for part in ["# mine", "# paper", "# first", "# all"] {
            assert!(out.contains(part), "{out}");
        }
        let (study, _) = Study::parse(&source("s", out)).unwrap();
        assert_eq!(study.data.len(), 2);
        assert_eq!(study.data[0].mounting.as_deref(), Some("full-1"));
        assert_eq!(study.data[1].mounting.as_deref(), Some("full-1"));
        let moved = join(text, &Joined { stood: None, ..run }).unwrap();
        let (study, _) = Study::parse(&source("s", moved)).unwrap();
        assert!(study.data.iter().all(|d| d.mounting.is_none()));
    }
}
