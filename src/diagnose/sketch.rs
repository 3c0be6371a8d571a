//! What no effect explains, as a starting effect in the user's own file.

use super::Subject;
use super::evidence::Evidence;
use super::features::{direction_words, features, shapes};
use super::words;
use crate::diag::{Failure, Result};
use crate::search::dependence::{Dependence, dependences};
use std::fmt::Write as _;

/// A starting effect.
#[derive(Debug, Clone)]
pub struct Sketch {
    /// Id that the user changes.
    pub id: String,
    /// What it depends on, in a sentence.
    pub says: String,
    /// The formula, for people.
    pub formula: String,
    /// The row of the effects file.
    pub toml: String,
}

/// The best starting formula for what is left over. `taken` are ids that exist.
///
/// # Errors
/// When nothing significant is left, or what is left has no formula.
pub fn sketch(subject: Subject, taken: &dyn Fn(&str) -> bool) -> Result<Sketch> {
    let evidence = Evidence::of(subject.fit);
    let features = features(subject.fit, subject.machine);
    let generics = shapes(subject.fit, &evidence, &features);
    let all = dependences(evidence.question(), &features, &generics);
    let level = crate::search::multiplicity::FAMILY_LEVEL;
    let significant: Vec<&Dependence> = all.iter().filter(|d| d.p_adjusted < level).collect();
    let Some(first) = significant.first() else {
        return Err(Failure::new("sketch::nothing_left", "what is left over depends on nothing that can be seen")
            .help("`axiscal diagnose` says whether the model fits; more touches at more poses show smaller errors"));
    };
    let writable = |d: &&&Dependence| d.terms.iter().all(|t| t.formula.is_some());
    let Some(best) = significant.iter().find(writable) else {
        return Err(Failure::new("sketch::no_formula", format!("formulas have no word for {}: {}", first.on, words::kind(first)))
            .help("a block that moved, a dirty face or a pose that does not come back is put right on the machine, not by a formula"));
    };
    Ok(write(subject, best, taken))
}

/// Six digits without an exponent.
fn plain(x: f64) -> String {
    let digits = if x == 0.0 { 1 } else { (5 - x.abs().log10().floor() as i32).clamp(1, 12) as usize };
    format!("{x:.digits$}")
}

fn write(subject: Subject, d: &Dependence, taken: &dyn Fn(&str) -> bool) -> Sketch {
    let stem: String = d.on.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let free = |n: usize| if n == 1 { format!("sketch-{stem}") } else { format!("sketch-{stem}-{n}") };
    let id = (1..).map(free).find(|id| !taken(id)).unwrap_or_else(|| format!("sketch-{stem}"));
    let prefix: String = id.replace('-', "_");
    let says = words::says(d, subject.fit, subject.machine);
    let shape_name = d.shape.as_ref().map(|s| format!("{prefix}_{}", s.name));
    let mut terms = String::new();
    let mut formula = Vec::new();
    for (i, term) in d.terms.iter().enumerate() {
        let text = term.formula.clone().unwrap_or_default();
        let text = match (&d.shape, &shape_name) {
            (Some(shape), Some(name)) => replace_word(&text, &shape.name, name),
            _ => text,
        };
        let typical = term.size.abs().max(term.sigma).max(0.1);
        let _ = writeln!(
            terms,
            "  {{ parameter = \"{prefix}_{}\", unit = \"{}\", dof = \"{}\", formula = \"{text}\", typical = {} }},",
            i + 1,
            d.unit,
            d.dof,
            plain(typical)
        );
        formula.push(format!("{:+.2} {} * {text}", term.size, d.unit));
    }
    let mut toml = format!(
        "[[effect]]\nid = \"{id}\"                # give it a name of your own\nname = \"Sketch: {}\"\nsays = \"{}\"\nlook = \"{}\"\nat = \"{}\"                   # {} {}\nterms = [\n{terms}]\n",
        d.on,
        says.replace('"', "'"),
        words::kind(d).replace('"', "'"),
        d.at,
        d.dof,
        direction_words(&d.direction, subject.machine)
    );
    if let (Some(shape), Some(name)) = (&d.shape, &shape_name) {
        let _ = writeln!(
            toml,
            "shape = [\n  {{ parameter = \"{name}\", unit = \"{}\", start = {}, min = {}, max = {} }},\n]",
            shape.unit,
            plain(shape.start),
            plain(shape.min),
            plain(shape.max)
        );
    }
    Sketch { id, says, formula: formula.join(" "), toml }
}

/// Replaces a whole word.
fn replace_word(text: &str, word: &str, by: &str) -> String {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(word) {
        let before = rest[..at].chars().next_back().is_some_and(is_word);
        let after = rest[at + word.len()..].chars().next().is_some_and(is_word);
        out.push_str(&rest[..at]);
        out.push_str(if before || after { word } else { by });
        rest = &rest[at + word.len()..];
    }
    out + rest
}
