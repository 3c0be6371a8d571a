//! What no effect explains, as a starting effect in the user's own file.

use super::Subject;
use super::evidence::Evidence;
use super::features::{features, shapes};
use super::places;
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
    /// Sizes of its terms as the data have them, in their typical sizes.
    pub sizes: Vec<f64>,
    /// Places where it may act, the one that leaves least first.
    pub tried: Vec<places::Tried>,
}

/// The best starting formula for what is left over. `taken` are ids that exist.
///
/// # Errors
/// When nothing significant is left, or what is left has no formula.
pub fn sketch(subject: Subject, taken: &dyn Fn(&str) -> bool) -> Result<Sketch> {
    let features = features(subject.fit, subject.machine);
    let evidence = super::calm(subject.fit, subject.machine, subject.catalogue, &features)
        .unwrap_or_else(|| Evidence::of(subject.fit));
    let generics = shapes(subject.fit, &evidence, &features);
    let all = dependences(evidence.question(), &features, &generics);
    let level = crate::search::multiplicity::FAMILY_LEVEL;
    let significant: Vec<&Dependence> = all.iter().filter(|d| d.p_adjusted < level).collect();
    let Some(first) = significant.first() else {
        return Err(Failure::new("sketch::nothing_left", "what is left over depends on nothing that can be seen")
            .help("`axiscal diagnose` says whether the model fits; more touches at more poses show smaller errors"));
    };
    // what `diagnose` names first, or nothing: the second would be sketched from what the first has left in it
    let Some(best) = Some(*first).filter(|d| d.terms.iter().all(|t| t.formula.is_some())) else {
        return Err(Failure::new("sketch::no_formula", format!("formulas have no word for {}: {}", first.on, words::kind(first)))
            .help("a block that moved, a dirty face or a pose that does not come back is put right on the machine, not by a formula"));
    };
    let tried = places::tried(subject, &evidence, best);
    let share = super::findings::beyond_the_noise(&evidence, best.share, best.terms.len());
    Ok(write(subject, (best, share), &tried, taken))
}

/// Six digits without an exponent.
fn plain(x: f64) -> String {
    let digits = if x == 0.0 { 1 } else { (5 - x.abs().log10().floor() as i32).clamp(1, 12) as usize };
    format!("{x:.digits$}")
}

fn write(
    subject: Subject,
    (d, share): (&Dependence, f64),
    tried: &[places::Tried],
    taken: &dyn Fn(&str) -> bool,
) -> Sketch {
    let stem: String = d.on.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let free = |n: usize| if n == 1 { format!("sketch-{stem}") } else { format!("sketch-{stem}-{n}") };
    let id = (1..).map(free).find(|id| !taken(id)).unwrap_or_else(|| format!("sketch-{stem}"));
    let prefix: String = id.replace('-', "_");
    let says = words::says(d, share, subject.fit, subject.machine);
    let shape_name = d.shape.as_ref().map(|s| format!("{prefix}_{}", s.name));
    let own = places::Tried::of(d);
    let place = tried.first().unwrap_or(&own);
    let mut terms = String::new();
    let (mut formula, mut sizes) = (Vec::new(), Vec::new());
    for (i, (dof, which, size, sigma)) in place.terms.iter().enumerate() {
        let text = d.terms.get(*which).and_then(|t| t.formula.clone()).unwrap_or_default();
        let text = match (&d.shape, &shape_name) {
            (Some(shape), Some(name)) => replace_word(&text, &shape.name, name),
            _ => text,
        };
        let (unit, typical) = (places::unit_of(dof), size.abs().max(*sigma).max(0.1));
        sizes.push(size / typical);
        let _ = writeln!(
            terms,
            "  {{ parameter = \"{prefix}_{}\", unit = \"{unit}\", dof = \"{dof}\", formula = \"{text}\", typical = {} }},",
            i + 1,
            plain(typical)
        );
        formula.push(format!("{size:+.2} {unit} * {text} [{} {dof}]", place.at));
    }
    let mut toml = format!(
        "[[effect]]\nid = \"{id}\"                # give it a name of your own\nname = \"Sketch: {}\"\nsays = \"{}\"\nlook = \"{}\"\n{}at = \"{}\"\nterms = [\n{terms}]\n",
        d.on,
        says.replace('"', "'"),
        words::kind(d).replace('"', "'"),
        places::comment(tried),
        place.at,
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
    Sketch { id, says, formula: formula.join(" "), toml, sizes, tried: tried.to_vec() }
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
