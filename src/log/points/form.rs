//! A form of inspection results as its file describes it.

use crate::diag::{Finding, Findings, Result, Source, from_toml, source};
use crate::post::as_written::LengthUnit;
use serde::Deserialize;
use toml::Spanned;

const FORMAT: &str = "axiscal-log-form/1";
/// Those that are built in: file name, text.
pub const BUILT_IN: [(&str, &str); 1] = [("msr.toml", include_str!("../../../postprocessors/msr.toml"))];

/// The file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AsWritten {
    format: Spanned<String>,
    name: String,
    says: String,
    decimal_mark: Spanned<String>,
    #[serde(default)]
    unit: LengthUnit,
    begin: Spanned<String>,
    end: Spanned<String>,
    remark: String,
    orientation: Spanned<String>,
    nominal: Spanned<String>,
    centre: Spanned<String>,
    #[serde(default)]
    skip: Vec<String>,
    source: Option<String>,
    unverified: Option<String>,
}

/// A checked form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointsForm {
    /// Short name.
    pub name: String,
    /// What it is, in one line.
    pub says: String,
    /// `.` or `,`
    pub mark: u8,
    /// What lengths are in: the form itself does not say it.
    pub unit: LengthUnit,
    /// The line with which a block begins.
    pub begin: String,
    pub end: String,
    /// What begins a remark.
    pub remark: String,
    /// First word of an orientation.
    pub orientation: String,
    /// First word of a nominal point.
    pub nominal: String,
    /// First word of a ball's centre.
    pub centre: String,
    /// First words of lines that are no part of the points.
    pub skip: Vec<String>,
    /// Where the form comes from.
    pub source: String,
    /// Why it is not verified.
    pub unverified: Option<String>,
    /// The file as it was read.
    pub text: String,
}

impl PointsForm {
    /// Whether a text is such a file at all (and no postprocessor).
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        #[derive(Deserialize)]
        struct Format {
            format: String,
        }
        toml::from_str::<Format>(text).is_ok_and(|f| f.format == FORMAT)
    }

    /// Reads and checks such a file.
    ///
    /// # Errors
    /// When the text is not TOML of this form; every finding has its place and remedy.
    pub fn parse(source: &Source) -> Result<(Self, Findings)> {
        let text = source.inner();
        let w: AsWritten = toml::from_str(text).map_err(|e| {
            from_toml(&e, source, "form::not_toml").help("`axiscal controllers show msr` prints an example")
        })?;
        let mut findings = Findings::default();
        let mut error = |at: &Spanned<String>, message: String, help: &str| {
            findings.push(Finding::error("form::word", message).help(help).at(source, at.span()));
        };
        if w.format.get_ref() != FORMAT {
            error(
                &w.format,
                format!("format is {:?}, expected {FORMAT:?}", w.format.get_ref()),
                "write the format line of this version",
            );
        }
        if !matches!(w.decimal_mark.get_ref().as_str(), "." | ",") {
            error(&w.decimal_mark, format!("decimal_mark is {:?}", w.decimal_mark.get_ref()), "\".\" or \",\"");
        }
        for word in [&w.begin, &w.end, &w.orientation, &w.nominal, &w.centre] {
            let good = |b: u8| b.is_ascii_alphanumeric();
            if word.get_ref().is_empty() || !word.get_ref().bytes().all(good) {
                error(word, format!("{:?} is no word of a line", word.get_ref()), "capital letters and digits");
            }
        }
        if w.source.is_none() && w.unverified.is_none() {
            error(&w.format, "the file does not say where the form comes from".into(), "write source or unverified");
        }
        let form = Self {
            name: w.name,
            says: w.says,
            mark: if w.decimal_mark.get_ref() == "," { b',' } else { b'.' },
            unit: w.unit,
            begin: w.begin.into_inner(),
            end: w.end.into_inner(),
            remark: w.remark,
            orientation: w.orientation.into_inner(),
            nominal: w.nominal.into_inner(),
            centre: w.centre.into_inner(),
            skip: w.skip,
            source: w.source.unwrap_or_default(),
            unverified: w.unverified,
            text: text.clone(),
        };
        findings.finish(form)
    }

    /// All that are built in.
    ///
    /// # Errors
    /// Never for the files that are shipped: a test reads them.
    pub fn built_in() -> Result<Vec<Self>> {
        let one = |(file, text): &(&str, &str)| {
            Self::parse(&source(format!("postprocessors/{file} (built in)"), *text)).map(|(form, _)| form)
        };
        BUILT_IN.iter().map(one).collect()
    }
}
