//! Effects as data: `effects.toml`, built in and of the user's own, as written and checked.

pub use super::as_written::About;
use super::as_written::File;
use super::check::Check;
use super::for_each_axis::expand;
use super::formula::{Formula, slot};
pub use super::lever_arm::Arm;
use super::surface::Body;
use crate::axes::AxisName;
use crate::diag::{Findings, Result, Source};
use crate::keys::not_of_form;
use crate::machine::{Machine, Side};
use std::sync::LazyLock;

/// The effects that are built in, as they are written.
const BUILT_IN_TEXT: &str = include_str!("../../effects.toml");

/// Place of a displacement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// Error of an axis, before its motion.
    Before(AxisName),
    /// Error of an axis, after its motion.
    After(AxisName),
    /// Of the tool's chain against the workpiece's, in R.
    Base,
    /// In the tool's frame.
    Tool,
    /// In the frame of what bears the workpiece.
    Workpiece,
    /// Of the touched block, about its centre.
    Block,
    /// Of the trigger, along the approach: positive comes late.
    Trigger,
    /// Of what a control shows for an axis.
    Reading,
}

/// A checked displacement.
#[derive(Debug, Clone)]
pub struct Term {
    /// Index of its factor in the effect's parameters.
    pub parameter: usize,
    /// Where it acts.
    pub place: Place,
    /// Component 0..6 = dx dy dz rx ry rz, or the axis of a reading (X..C), or 0 for a trigger.
    pub component: usize,
    /// Its function of the state.
    pub formula: Formula,
}

/// A checked parameter.
#[derive(Debug, Clone)]
pub struct Parameter {
    /// Name, the ISO form where there is one.
    pub name: String,
    /// The paper's symbol.
    pub alias: Option<String>,
    /// ISO 230 symbol of the error motion or location error that it belongs to.
    pub iso: Option<String>,
    /// Its unit, for people.
    pub unit: String,
    /// Its unit in mm, rad or a ratio.
    pub factor: f64,
    /// Usual size, in the unit.
    pub typical: f64,
    /// Where that size comes from.
    pub source: String,
    /// True where its size is positive by nature: lost motion, sag.
    pub positive: bool,
    /// For a shape parameter: start, lowest and highest value.
    pub shape: Option<(f64, f64, f64)>,
    /// Values of a shape parameter to be tried; empty where the search from its start is enough.
    pub scan: Vec<f64>,
    /// Index of the variable of formulas at whose value something jumps.
    pub between: Option<usize>,
}

/// A checked effect.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Short name.
    pub id: String,
    /// Name for people.
    pub name: String,
    pub says: String,
    /// How to confirm it.
    pub look: String,
    pub mends: String,
    /// What usually makes it far larger than machines have it; may be empty.
    pub too_large: String,
    /// Applies where its axes stand on this side only.
    pub side: Option<Side>,
    /// Of a row with `{place}` in a formula: its axis, which stands on this side.
    pub place_on: Option<(AxisName, Side)>,
    /// The axes that it needs.
    pub needs: Vec<AxisName>,
    /// The axes without which it applies only.
    pub unless: Vec<AxisName>,
    /// Ids of effects that are special cases of it: no touches separate them from it.
    pub includes: Vec<String>,
    /// Short word that groups effects in lists.
    pub family: String,
    /// Its parameters are 0 or 1: a supposition that is tried where the error is gross.
    pub discrete: bool,
    /// About which point its rotations are stated, where the place does not say it.
    pub about: Option<About>,
    /// Its turns act about a point at an unknown distance.
    pub arm: Option<Arm>,
    /// One set of parameters for each block.
    pub per_block: bool,
    /// The bodies that have such a set; empty: all.
    pub of: Vec<Body>,
    /// One set of parameters for each run after the first: how it differs from that one.
    pub per_run: bool,
    /// Solved for, but no result.
    pub nuisance: bool,
    /// A parameter set of the paper.
    pub paper: bool,
    /// Its parameters: factors first, then shapes.
    pub parameters: Vec<Parameter>,
    /// Its displacements.
    pub terms: Vec<Term>,
    /// Built in, or of the user's own.
    pub built_in: bool,
}

impl Effect {
    /// True when a machine has what the effect needs.
    #[must_use]
    pub fn applies_to(&self, machine: &Machine) -> bool {
        let here =
            |name: &AxisName| machine.axis(*name).is_some_and(|axis| self.side.is_none_or(|side| axis.side == side));
        let stands = |(name, side): (AxisName, Side)| machine.axis(name).is_some_and(|axis| axis.side == side);
        self.needs.iter().all(here) && !self.unless.iter().any(here) && self.place_on.is_none_or(stands)
    }

    /// True when it may act on a machine beside any model: it applies, and is no set of the paper's and no hypothesis.
    #[must_use]
    pub fn acts_on(&self, machine: &Machine) -> bool {
        !self.paper && !self.discrete && self.applies_to(machine)
    }

    /// True when it has as many sets of parameters as there are blocks, or runs.
    #[must_use]
    pub fn is_repeated(&self) -> bool {
        self.per_block || self.per_run
    }

    /// True when it happens at one moment: blocks that slipped, a position that was lost.
    #[must_use]
    pub fn is_incident(&self) -> bool {
        self.parameters.iter().any(|p| p.between == Some(slot::HOURS))
    }

    /// True when no body has both: their parameters carry the names of their bodies.
    #[must_use]
    pub fn is_of_other_bodies_than(&self, other: &Self) -> bool {
        let named = |e: &Self| e.per_block && !e.of.is_empty();
        named(self) && named(other) && !self.of.iter().any(|body| other.of.contains(body))
    }

    /// True when no machine can have both: rows of one id must differ so.
    pub(super) fn excludes(&self, other: &Self) -> bool {
        let shared = |a: &[AxisName], b: &[AxisName]| a.iter().any(|name| b.contains(name));
        // of a place the rows differ in the side of its axis
        if self.place_on.zip(other.place_on).is_some_and(|(a, b)| a.0 == b.0 && a.1 != b.1) {
            return true;
        }
        match (self.side, other.side) {
            (a, b) if a == b => shared(&self.needs, &other.unless) || shared(&other.needs, &self.unless),
            (Some(_), Some(_)) => shared(&self.needs, &other.needs),
            _ => false,
        }
    }
}

/// The built-in effects, read once in a process.
static BUILT_IN: LazyLock<Vec<Effect>> = LazyLock::new(|| {
    let source = crate::diag::source("effects.toml (built in)", BUILT_IN_TEXT);
    // a test reads the same text as a user's file, with every check
    let Ok(file) = toml::from_str::<File>(source.inner()) else { return Vec::new() };
    let mut check = Check::new(&source, true);
    let rows = expand(file.effect, |letters| check.axes(letters));
    rows.iter().filter_map(|written| check.effect(written)).collect()
});

/// All effects that exist.
#[derive(Debug, Clone, Default)]
pub struct Catalogue {
    built_in: &'static [Effect],
    own: Vec<Effect>,
}

impl Catalogue {
    /// The built-in effects.
    ///
    /// # Errors
    /// Never for a released program: a test reads the built-in file as a user's is read.
    pub fn built_in() -> Result<Self> {
        Ok(Self { built_in: &BUILT_IN, own: Vec::new() })
    }

    /// Adds a user's effects.
    ///
    /// # Errors
    /// When the file is unusable; every finding has its place, and says which words exist.
    pub fn add_file(&mut self, source: &Source) -> Result<Findings> {
        let (fresh, findings) = read(source, &|effect| {
            self.built_in.iter().any(|row| row.id == effect.id)
                || self.own.iter().any(|own| own.id == effect.id && !own.excludes(effect))
        })?;
        self.own.extend(fresh);
        Ok(findings)
    }

    /// The effects that may act on a machine, built-in ones first, without the paper's sets and without hypotheses.
    pub fn acting_on(&self, machine: &Machine) -> impl Iterator<Item = &Effect> {
        self.iter().filter(|e| e.acts_on(machine))
    }

    /// All effects, built-in ones first.
    pub fn iter(&self) -> impl Iterator<Item = &Effect> {
        self.built_in.iter().chain(&self.own)
    }

    /// The effect of that id that applies to a machine.
    #[must_use]
    pub fn get(&self, id: &str, machine: &Machine) -> Option<&Effect> {
        self.iter().find(|e| e.id == id && e.applies_to(machine))
    }

    /// True when an effect of that id exists for some machine.
    #[must_use]
    pub fn knows(&self, id: &str) -> bool {
        self.iter().any(|e| e.id == id)
    }
}

/// The effects of a file; `taken` says that an effect of that id exists already.
fn read(source: &Source, taken: &dyn Fn(&Effect) -> bool) -> Result<(Vec<Effect>, Findings)> {
    let file: File = toml::from_str(source.inner()).map_err(|e| {
        not_of_form::<File>(&e, source, "effects::not_toml", "`axiscal schema effects` prints the form")
    })?;
    let mut check = Check::new(source, false);
    check.format(&file);
    let mut fresh: Vec<Effect> = Vec::new();
    for written in &expand(file.effect, |letters| check.axes(letters)) {
        let Some(effect) = check.effect(written) else { continue };
        if taken(&effect) || fresh.iter().any(|e| e.id == effect.id && !e.excludes(&effect)) {
            check.twice(written);
        }
        fresh.push(effect);
    }
    check.findings.finish(fresh)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::model::formula::VARIABLES;

    #[test]
    fn the_built_in_catalogue_is_good() {
        // read as a user's file is: every formula is compiled and every unit checked
        let mut catalogue = Catalogue::default();
        catalogue.add_file(&source("effects.toml", BUILT_IN_TEXT)).unwrap();
        assert!(
            catalogue.knows("location-b") && catalogue.knows("paper-double-head") && catalogue.knows("block-setup")
        );
        let ids = |c: &Catalogue| c.iter().map(|e| e.id.clone()).collect::<Vec<_>>();
        assert_eq!(ids(&Catalogue::built_in().unwrap()), ids(&catalogue));
        for e in catalogue.iter() {
            let said = [&e.name, &e.says, &e.look, &e.mends, &e.family];
            assert!(said.iter().all(|text| !text.is_empty()), "{}", e.id);
            assert!(e.parameters.iter().all(|p| !p.source.is_empty()), "{}", e.id);
            assert!(e.includes.iter().all(|id| catalogue.knows(id)), "{}: {:?}", e.id, e.includes);
            let shapes: Vec<f64> = e.parameters.iter().map(|p| p.shape.map_or(0.0, |s| s.0)).collect();
            for t in &e.terms {
                assert!(t.formula.eval(&[0.5; VARIABLES.len()], &shapes).is_finite(), "{} {}", e.id, t.formula.text());
            }
        }
    }

    #[test]
    fn mistakes_in_a_users_file_have_their_place() {
        let cases = [
            (
                "[[effect]]\nid = \"x\"\nat = \"B\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dq\", formula = \"1\" }]",
                "effects::dof",
                4,
            ),
            (
                "[[effect]]\nid = \"x\"\nat = \"B\"\nterms = [{ parameter = \"p\", unit = \"inch\", dof = \"dx\", formula = \"1\" }]",
                "effects::unit",
                4,
            ),
            (
                "[[effect]]\nid = \"x\"\nat = \"Q\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"1\" }]",
                "effects::at",
                3,
            ),
            (
                "[[effect]]\nid = \"x\"\nat = \"B\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"foo(B)\" }]",
                "effects::formula",
                4,
            ),
            (
                "[[effect]]\nid = \"pretravel\"\nat = \"B\"\nterms = [{ parameter = \"p\", unit = \"um\", dof = \"dx\", formula = \"1\" }]",
                "effects::id_twice",
                2,
            ),
            ("[[effect]]\nid = \"x\"\nat = \"B\"\n", "effects::no_terms", 2),
        ];
        for (text, code, line) in cases {
            let mut catalogue = Catalogue::built_in().unwrap();
            let failure = catalogue.add_file(&source("my.toml", text)).unwrap_err();
            assert_eq!(failure.0[0].code, code, "{text}");
            assert!(
                failure.0[0].place().unwrap().starts_with(&format!("my.toml:{line}:")),
                "{:?}",
                failure.0[0].place()
            );
        }
    }
}
