//! Who wrote a log: a word of the command line or a study → the rule by which the log is read.

use super::Writer;
use super::points::PointsForm;
use crate::diag::{Failure, Finding, Result, source};
use crate::post::Postprocessor;
use std::path::Path;

/// What a log is read with.
#[derive(Debug, Clone)]
pub enum Reader {
    Controller(Box<Postprocessor>),
    /// Inspection results of another program.
    Points(Box<PointsForm>),
    /// The project's own form.
    Csv,
}

impl Reader {
    /// `csv`, the name of a controller or a form that is built in, or the path of a file of the user's own.
    ///
    /// `read` fetches the text of a file.
    ///
    /// # Errors
    /// When there is none of that name, or the file is unusable; the message lists what there is.
    pub fn load(word: &str, read: impl Fn(&Path) -> Result<String>) -> Result<(Self, Vec<Finding>)> {
        if word == "csv" {
            return Ok((Self::Csv, Vec::new()));
        }
        if word.ends_with(".toml") || word.contains(['/', '\\']) {
            let text = read(Path::new(word))?;
            let file = source(word, text);
            if PointsForm::is_one(file.inner()) {
                return PointsForm::parse(&file).map(|(form, f)| (Self::Points(Box::new(form)), f.0));
            }
            return Postprocessor::load(word, read).map(|(post, f)| (Self::Controller(Box::new(post)), f));
        }
        if let Some(form) = PointsForm::built_in()?.into_iter().find(|f| f.name == word) {
            return Ok((Self::Points(Box::new(form)), Vec::new()));
        }
        Postprocessor::load(word, read).map(|(post, f)| (Self::Controller(Box::new(post)), f)).map_err(|failure| {
            let forms = PointsForm::built_in().unwrap_or_default();
            let names: Vec<String> = forms.into_iter().map(|f| f.name).collect();
            let more = format!("; for logs also csv, {}", names.join(", "));
            Failure(
                failure
                    .0
                    .into_iter()
                    .map(|f| match (f.code, &f.help) {
                        ("post::unknown", Some(help)) => {
                            let help = help.clone() + &more;
                            f.help(help)
                        }
                        _ => f,
                    })
                    .collect(),
            )
        })
    }

    /// For [`super::read`].
    #[must_use]
    pub fn writer(&self) -> Writer<'_> {
        match self {
            Self::Controller(post) => Writer::Controller(post),
            Self::Points(form) => Writer::Points(form),
            Self::Csv => Writer::Csv,
        }
    }
}
