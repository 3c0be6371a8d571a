//! Where in the chain a shape without a name acts: every place and direction is tried with the same formula, and the one
//! that leaves least is the start of a user's effect.

use super::Subject;
use super::evidence::Evidence;
use super::first_order::FirstOrder;
use crate::diag::source;
use crate::fit::candidates::columns;
use crate::model::catalogue::Catalogue;
use crate::search::dependence::Dependence;
use crate::search::{KEPT, Library, Origin, Question, Search};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;
use std::fmt::Write as _;

/// Displacements and turns of a place.
const DOFS: [&str; 6] = ["dx", "dy", "dz", "rx", "ry", "rz"];

/// Directions that one effect takes at most.
const MOST_DOFS: usize = 3;

/// A further direction must pay at this level, all directions of all places counted in.
const WORTH_A_TERM: f64 = 1e-4;

/// Places whose criterion (Schwarz's) differs by less cannot be told apart by these touches; the nearest to the variable
/// is then written.
const AS_GOOD: f64 = 6.0;

/// Other places that are listed as comments.
const MOST_LISTED: usize = 6;

/// A place with the directions that pay there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tried {
    /// `at` of the effect.
    pub at: String,
    /// Direction, number of the formula's term, size and standard uncertainty in the direction's unit.
    pub terms: Vec<(String, usize, f64, f64)>,
    /// RMS over the touches that is left, µm, as a refit has it to first order.
    pub left_um: f64,
    /// Schwarz's criterion: what is left, and what the terms cost.
    #[serde(skip)]
    pub criterion: f64,
}

impl Tried {
    /// The dependence as its own test has it.
    #[must_use]
    pub fn from_dependence(d: &Dependence) -> Self {
        let terms = d.terms.iter().enumerate().map(|(i, t)| (d.dof.clone(), i, t.size, t.sigma)).collect();
        Self { at: d.at.clone(), terms, left_um: f64::NAN, criterion: 0.0 }
    }

    /// Do these touches not tell it from a better one?
    #[must_use]
    pub fn as_good_as(&self, better: &Self) -> bool {
        self.criterion - better.criterion < AS_GOOD
    }

    /// Its directions.
    #[must_use]
    pub fn dofs(&self) -> Vec<String> {
        let mut out: Vec<String> = self.terms.iter().map(|t| t.0.clone()).collect();
        out.dedup();
        out
    }
}

/// Unit of a size in a direction.
#[must_use]
pub fn unit_of(dof: &str) -> &'static str {
    if dof.len() == 2 && dof.starts_with('r') { "urad" } else { "um" }
}

/// All places, best first: the nearest to the variable among those that leave equally little.
#[must_use]
pub fn tried(subject: Subject, evidence: &Evidence, d: &Dependence) -> Vec<Tried> {
    let Some(formulas) = d.terms.iter().map(|t| t.formula.clone()).collect::<Option<Vec<String>>>() else {
        return Vec::new();
    };
    // the axis that the formula speaks of, then where the test found it, then the rest from the base to the block
    let mut places: Vec<String> = Vec::new();
    let mut add = |at: &str| {
        if !places.iter().any(|p| p == at) {
            places.push(at.to_owned());
        }
    };
    for axis in &subject.machine.axes {
        let name = axis.name.to_string();
        if d.on.split(['*', ' ']).any(|word| word == name || word == format!("s{name}")) {
            add(&name);
        }
    }
    add(&d.at);
    add("base");
    for axis in &subject.machine.axes {
        add(&axis.name.to_string());
    }
    for at in ["tool", "workpiece", "block", "trigger"] {
        add(at);
    }
    let first_order = FirstOrder::from_fit(subject.fit);
    let mut out: Vec<Tried> = places
        .par_iter()
        .filter_map(|at| {
            let dofs: &[&str] = if at == "trigger" { &["r"] } else { &DOFS };
            let ways: Vec<Way> = dofs
                .iter()
                .filter_map(|dof| {
                    let raw_mm = columns_of(subject, at, dof, &formulas, d)?;
                    Some(Way { dof: (*dof).to_owned(), white: evidence.whiten(raw_mm.clone()), raw_mm })
                })
                .collect();
            forward(evidence, &first_order, at, &ways)
        })
        .collect();
    let best = out.iter().map(|t| t.criterion).fold(f64::INFINITY, f64::min);
    // stable: what is as good stays in the order of the places
    out.sort_by(|a, b| {
        let behind = |t: &Tried| if t.criterion - best < AS_GOOD { best } else { t.criterion };
        behind(a).total_cmp(&behind(b))
    });
    out
}

/// A direction of a place.
struct Way {
    dof: String,
    /// Its columns, mm per unit, one row per touch.
    raw_mm: DMatrix<f64>,
    /// The same as rows of the tests.
    white: DMatrix<f64>,
}

/// Columns of a formula that acts in one direction of a place, mm, one for each of its terms; `None` where nothing is seen.
fn columns_of(subject: Subject, at: &str, dof: &str, formulas: &[String], d: &Dependence) -> Option<DMatrix<f64>> {
    let mut text = format!("[[effect]]\nid = \"place\"\nat = \"{at}\"\nterms = [\n");
    for (i, formula) in formulas.iter().enumerate() {
        let _ = writeln!(
            text,
            "{{ parameter = \"p{i}\", unit = \"{}\", dof = \"{dof}\", formula = \"{formula}\" }},",
            unit_of(dof)
        );
    }
    text += "]\n";
    if let Some(s) = &d.shape {
        // a period or constant of 6 h or 0.15 h: plain digits, and a point in them
        let _ = writeln!(
            text,
            "shape = [{{ parameter = \"{}\", unit = \"{}\", start = {:?}, min = {:?}, max = {:?} }}]",
            s.name, s.unit, s.start, s.min, s.max
        );
    }
    let mut own = Catalogue::default();
    own.add_file(&source("place", text)).ok()?;
    let effect = own.get("place", subject.machine)?;
    let fit = subject.fit;
    // where the plan has the touches: along its normal a reading carries the noise that is to be explained
    let made = columns(subject.machine, &[effect], &fit.data, &fit.data.nominal, fit.model.reference, None);
    let linear: Vec<usize> = (0..made.unknowns.len()).filter(|&i| !made.unknowns[i].shape).collect();
    let values = made.values.select_columns(&linear);
    let seen = values.ncols() == formulas.len() && values.iter().all(|v| v.is_finite());
    (seen && values.norm() > 0.0).then_some(values)
}

/// The directions of one place that pay, one after the other.
fn forward(evidence: &Evidence, first_order: &FirstOrder, at: &str, ways: &[Way]) -> Option<Tried> {
    let question = evidence.question();
    let mut base = question.base.clone();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < MOST_DOFS {
        let mut library = Library::new(evidence.n_rows());
        let open: Vec<usize> = (0..ways.len()).filter(|i| !chosen.contains(i)).collect();
        for &i in &open {
            library.push(ways[i].dof.clone(), Origin::User, &ways[i].white);
        }
        let now = Question { base: &base, ..question };
        let search = Search::new(now, &library);
        let Some(&first) = search.ranking().first() else { break };
        if !chosen.is_empty() && search.scores[first].p > WORTH_A_TERM {
            break;
        }
        base.extend(&ways[open[first]].white, KEPT);
        chosen.push(open[first]);
    }
    if chosen.is_empty() {
        return None;
    }
    let kept = told(&question, chosen.iter().map(|&i| &ways[i]));
    if kept.is_empty() {
        return None;
    }
    // sizes of all terms together
    let together = |of: &dyn Fn(&Way) -> &DMatrix<f64>| {
        let columns: Vec<_> = kept.iter().map(|&(way, k)| of(way).column(k)).collect();
        DMatrix::from_columns(&columns)
    };
    let terms: Vec<(String, usize)> = kept.iter().map(|&(way, k)| (way.dof.clone(), k)).collect();
    let mut library = Library::new(evidence.n_rows());
    library.push("all", Origin::User, &together(&|way| &way.white));
    let search = Search::new(question, &library);
    let score = search.scores.first()?;
    let total = question.base.project(question.residual).norm_squared();
    let left = (total - score.delta_ss).max(f64::MIN_POSITIVE);
    let n = evidence.used.len().max(1) as f64;
    let sized = terms
        .into_iter()
        .enumerate()
        .map(|(k, (dof, which))| (dof, which, score.estimate[k], score.covariance[(k, k)].max(0.0).sqrt()));
    Some(Tried {
        at: at.to_owned(),
        terms: sized.collect(),
        left_um: first_order.rms_um(&together(&|way| &way.raw_mm)),
        criterion: n * (left / n).ln() + score.q as f64 * n.ln(),
    })
}

/// Columns that say something of their own beside the model and those before them, the simplest first: of a spindle that stood at
/// three angles no touch tells six waves.
fn told<'w>(question: &Question, ways: impl Iterator<Item = &'w Way>) -> Vec<(&'w Way, usize)> {
    /// A column with less than this share of the largest one is the rounding of a function that is zero at every touch.
    const ROUNDING: f64 = 1e-9;
    let mut base = question.base.clone();
    let mut kept = Vec::new();
    for way in ways {
        let norms: Vec<f64> = way.white.column_iter().map(|c| c.norm()).collect();
        let least = ROUNDING * norms.iter().copied().fold(0.0, f64::max);
        for k in (0..norms.len()).filter(|&k| norms[k] > least) {
            if base.extend(&way.white.columns(k, 1).into_owned(), KEPT) > 0 {
                kept.push((way, k));
            }
        }
    }
    kept
}

/// The others with their figures, as comments of the file.
#[must_use]
pub fn comment(tried: &[Tried]) -> String {
    let Some(first) = tried.first() else { return String::new() };
    let mut out = format!(
        "# places that were tried with this formula: {} ({}) leaves {:.2} um\n",
        first.at,
        first.dofs().join(" "),
        first.left_um
    );
    for t in tried.iter().skip(1).take(MOST_LISTED) {
        let same = if t.as_good_as(first) { ": these touches cannot separate it from the first" } else { "" };
        let _ = writeln!(out, "#   {} ({}) leaves {:.2} um{same}", t.at, t.dofs().join(" "), t.left_um);
    }
    out
}
