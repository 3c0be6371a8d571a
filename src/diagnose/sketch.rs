//! What no effect explains, as a starting effect in the user's own file.

use super::Subject;
use super::error_locations;
use super::features::features;
use super::visit_scatter::Regression;
use crate::diag::{Failure, Result};
use crate::fit::Fit;
use crate::search::Search;
use crate::search::dependence::{Dependence, dependences};
use crate::words::diagnose as words;
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
    pub tried: Vec<error_locations::Tried>,
}

/// The best starting formula for what is left over. `taken` are ids that exist.
///
/// # Errors
/// When nothing significant is left, or what is left has no formula.
pub fn sketch(subject: Subject, taken: &dyn Fn(&str) -> bool) -> Result<Sketch> {
    let features = std::sync::Arc::new(features(subject.fit, subject.machine));
    let Regression { evidence, generics, .. } =
        Regression::new(subject.fit, subject.machine, subject.catalogue, &features);
    let all = dependences(&Search::new(evidence.question(), &generics.library), &features, &generics);
    let best = best(&all, subject.fit)?;
    let share = super::assemble_diagnosis::beyond_the_noise(&evidence, best.share, best.terms.len());
    if best.on == words::MOVED_BLOCK {
        return Ok(write_moved(subject, (best, share), taken));
    }
    let tried = error_locations::tried(subject, &evidence, best);
    Ok(write(subject, (best, share), &tried, taken))
}

/// What a formula is written for, of all that the misfit depends on: what `diagnose` names first, or nothing, because the
/// second would be sketched from what the first has left in it.
///
/// # Errors
/// When nothing is significant, or formulas have no word for the first.
pub(super) fn best<'d>(all: &'d [Dependence], fit: &Fit) -> Result<&'d Dependence> {
    let level = crate::search::multiplicity::FAMILY_LEVEL;
    let Some(first) = all.iter().find(|d| d.p_adjusted < level) else {
        return Err(Failure::new("sketch::nothing_left", "the residual depends on nothing that these touches show")
            .help("`axiscal diagnose` says whether the model fits; more touches at more poses show smaller errors"));
    };
    if first.on == words::MOVED_BLOCK || first.terms.iter().all(|t| t.formula.is_some()) {
        return Ok(first);
    }
    let says =
        format!("no formula is written for what goes with {}: {}", words::plain(&first.on), words::kind(first, fit));
    Err(Failure::new("sketch::no_formula", says)
        .help("a dirty face, a block of another size or a pose that does not come back is put right on the machine"))
}

/// A block that stands elsewhere from some moment on: formulas do not name a block, but an effect may have a size for each.
fn write_moved(subject: Subject, (d, share): (&Dependence, f64), taken: &dyn Fn(&str) -> bool) -> Sketch {
    let id = free_id("moved-block", taken);
    let prefix = id.replace('-', "_");
    let says = words::says(d, share, subject.fit, subject.machine);
    let size = d.terms.first().map_or(0.0, |t| t.size.abs().max(t.sigma));
    let typical = plain(size.max(0.1));
    let formula = format!("step(t - {})", plain(d.scanned));
    let terms: String = ["dx", "dy", "dz"]
        .map(|dof| {
            format!("  {{ parameter = \"{prefix}_{dof}\", unit = \"um\", dof = \"{dof}\", formula = \"{formula}\", typical = {typical} }},\n")
        })
        .concat();
    let block = words::moved_block(d, subject.fit).unwrap_or_default();
    let toml = format!(
        "[[effect]]\nid = \"{id}\"                # give it a name of your own\nname = \"Sketch: block {block} moved\"\nsays = \"{}\"\nlook = \"{}\"\n# every block has sizes of its own: those of the blocks that stood still come to nothing\nper = \"block\"\nat = \"block\"\nterms = [\n{terms}]\n",
        says.replace('"', "'"),
        words::kind(d, subject.fit).replace('"', "'"),
    );
    let formula = format!("{formula} [block dx dy dz, each block by itself]");
    Sketch { id, says, formula, toml, sizes: Vec::new(), tried: Vec::new() }
}

/// An id that nothing has yet.
fn free_id(stem: &str, taken: &dyn Fn(&str) -> bool) -> String {
    let free = |n: usize| if n == 1 { format!("sketch-{stem}") } else { format!("sketch-{stem}-{n}") };
    (1..).map(free).find(|id| !taken(id)).unwrap_or_else(|| format!("sketch-{stem}"))
}

/// Six digits without an exponent.
fn plain(x: f64) -> String {
    let digits = if x == 0.0 { 1 } else { (5 - x.abs().log10().floor() as i32).clamp(1, 12) as usize };
    format!("{x:.digits$}")
}

fn write(
    subject: Subject,
    (d, share): (&Dependence, f64),
    tried: &[error_locations::Tried],
    taken: &dyn Fn(&str) -> bool,
) -> Sketch {
    let stem: String = d.on.to_lowercase().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let id = free_id(&stem, taken);
    let prefix: String = id.replace('-', "_");
    let says = words::says(d, share, subject.fit, subject.machine);
    let shape_name = d.shape.as_ref().map(|s| format!("{prefix}_{}", s.name));
    let own = error_locations::Tried::from_dependence(d);
    let place = tried.first().unwrap_or(&own);
    let mut terms = String::new();
    let (mut formula, mut sizes) = (Vec::new(), Vec::new());
    for (i, (dof, which, size, sigma)) in place.terms.iter().enumerate() {
        let text = d.terms.get(*which).and_then(|t| t.formula.clone()).unwrap_or_default();
        let text = match (&d.shape, &shape_name) {
            (Some(shape), Some(name)) => replace_word(&text, &shape.name, name),
            _ => text,
        };
        let (unit, typical) = (error_locations::unit_of(dof), size.abs().max(*sigma).max(0.1));
        sizes.push(size / typical);
        let _ = writeln!(
            terms,
            "  {{ parameter = \"{prefix}_{}\", unit = \"{unit}\", dof = \"{dof}\", formula = \"{text}\", typical = {} }},",
            i + 1,
            plain(typical)
        );
        formula.push(format!("{size:+.2} {unit} * ({text}) [{} {dof}]", place.at));
    }
    let mut toml = format!(
        "[[effect]]\nid = \"{id}\"                # give it a name of your own\nname = \"Sketch: {}\"\nsays = \"{}\"\nlook = \"{}\"\n{}at = \"{}\"\nterms = [\n{terms}]\n",
        d.on,
        says.replace('"', "'"),
        words::kind(d, subject.fit).replace('"', "'"),
        error_locations::comment(tried),
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
