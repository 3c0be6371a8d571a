//! Effects as data: `effects.toml`, built in and of the user's own, as written and checked.

use super::as_written::{EffectAsWritten, File, Frame, Per, SideAsWritten, TermAsWritten};
use super::formula::{FUNCTIONS, Formula, VARIABLES};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result, Source, from_toml};
use crate::machine::{Machine, Side};
use crate::units::{mm_from_um, rad_from_deg, ratio_from_ppm};

/// The effects that are built in.
pub const BUILT_IN: &str = include_str!("../../effects.toml");

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
    /// Its unit, for people.
    pub unit: String,
    /// Its unit in mm, rad or a ratio.
    pub factor: f64,
    /// Usual size, in the unit.
    pub typical: f64,
    /// Where that size comes from.
    pub source: String,
    /// For a shape parameter: start, lowest and highest value.
    pub shape: Option<(f64, f64, f64)>,
}

/// A checked effect.
#[derive(Debug, Clone)]
pub struct Effect {
    /// Short name.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// What it is.
    pub says: String,
    /// How to confirm it.
    pub look: String,
    /// What mends it.
    pub mends: String,
    /// Applies where its axis stands on this side only.
    pub side: Option<Side>,
    /// The axes that it needs.
    pub needs: Vec<AxisName>,
    /// One set of parameters for each block.
    pub per_block: bool,
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
        self.needs
            .iter()
            .all(|name| machine.axis(*name).is_some_and(|axis| self.side.is_none_or(|side| axis.side == side)))
    }
}

/// All effects that exist.
#[derive(Debug, Clone, Default)]
pub struct Catalogue {
    effects: Vec<Effect>,
}

impl Catalogue {
    /// The built-in effects.
    ///
    /// # Errors
    /// Never for a released program: a test reads the built-in file.
    pub fn built_in() -> Result<Self> {
        let mut catalogue = Self::default();
        catalogue.read(&crate::diag::source("effects.toml (built in)", BUILT_IN), true)?;
        Ok(catalogue)
    }

    /// Adds a user's effects.
    ///
    /// # Errors
    /// When the file is unusable; every finding has its place, and says which words exist.
    pub fn add_file(&mut self, source: &Source) -> Result<Findings> {
        self.read(source, false)
    }

    fn read(&mut self, source: &Source, built_in: bool) -> Result<Findings> {
        let file: File = toml::from_str(source.inner())
            .map_err(|e| from_toml(&e, source, "effects::not_toml").help("`axiscal schema effects` prints the form"))?;
        let mut check = Check { source, findings: Findings::default() };
        if file.format.as_deref().is_some_and(|f| f != "axiscal-effects/1") {
            check.error(
                &(0..0),
                "effects::format",
                "format is not axiscal-effects/1".to_owned(),
                "write format = \"axiscal-effects/1\"",
            );
        }
        let mut fresh: Vec<Effect> = Vec::new();
        for written in &file.effect {
            let id = written.id.get_ref();
            let side = written.side.map(|s| if s == SideAsWritten::Tool { Side::Tool } else { Side::Workpiece });
            let clash = |e: &Effect| &e.id == id && (e.side.is_none() || side.is_none() || e.side == side);
            if self.effects.iter().any(|e| &e.id == id && e.built_in && !built_in)
                || self.effects.iter().any(clash)
                || fresh.iter().any(clash)
            {
                check.error(
                    &written.id.span(),
                    "effects::id_twice",
                    format!("effect {id:?} exists already"),
                    "give it an id of its own",
                );
            }
            if let Some(effect) = check.effect(written, side, built_in) {
                fresh.push(effect);
            }
        }
        let ((), findings) = check.findings.finish(())?;
        self.effects.extend(fresh);
        Ok(findings)
    }

    /// All effects, built-in ones first.
    pub fn iter(&self) -> impl Iterator<Item = &Effect> {
        self.effects.iter()
    }

    /// The effect of that id that applies to a machine.
    #[must_use]
    pub fn get(&self, id: &str, machine: &Machine) -> Option<&Effect> {
        self.effects.iter().find(|e| e.id == id && e.applies_to(machine))
    }

    /// True when an effect of that id exists for some machine.
    #[must_use]
    pub fn knows(&self, id: &str) -> bool {
        self.effects.iter().any(|e| e.id == id)
    }
}

struct Check<'a> {
    source: &'a Source,
    findings: Findings,
}

impl Check<'_> {
    fn error(&mut self, span: &std::ops::Range<usize>, code: &'static str, message: String, help: &str) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span.clone()));
    }

    /// A parameter's name must be a word that a formula can use, and none that means something else there.
    fn name(&mut self, name: &str, span: &std::ops::Range<usize>) {
        let word = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !word || VARIABLES.contains(&name) || FUNCTIONS.contains(&name) {
            self.error(
                span,
                "effects::parameter",
                format!("{name:?} cannot be the name of a parameter"),
                "letters, digits and _, and none of the variables and functions of formulas",
            );
        }
    }

    /// A constant displacement is a length or an angle; with variables in it the formula may carry the rest of the unit.
    fn unit_fits(&mut self, t: &TermAsWritten) {
        let unit = t.unit.get_ref().as_str();
        let constant = Formula::parse(t.formula.get_ref(), &[]).is_ok_and(|f| f.constant().is_some());
        let wrong = match t.dof.get_ref().as_str() {
            "dx" | "dy" | "dz" | "r" | "X" | "Y" | "Z" => !matches!(unit, "um" | "mm"),
            "rx" | "ry" | "rz" | "A" | "B" | "C" => !matches!(unit, "urad" | "mrad" | "deg"),
            _ => false,
        };
        if constant && wrong && unit_factor(unit).is_some() {
            self.error(
                &t.unit.span(),
                "effects::unit",
                format!("a constant {} cannot be in {unit}", t.dof.get_ref()),
                "lengths in um or mm, angles in urad, mrad or deg",
            );
        }
    }

    fn effect(&mut self, w: &EffectAsWritten, side: Option<Side>, built_in: bool) -> Option<Effect> {
        let before = self.findings.0.len();
        let mut parameters: Vec<Parameter> = Vec::new();
        for t in &w.terms {
            let name =
                t.iso.as_deref().and_then(crate::symbols::canonical).unwrap_or_else(|| t.parameter.get_ref().clone());
            self.name(t.parameter.get_ref(), &t.parameter.span());
            self.unit_fits(t);
            let factor = unit_factor(t.unit.get_ref());
            if factor.is_none() {
                self.error(
                    &t.unit.span(),
                    "effects::unit",
                    format!("unknown unit {:?}", t.unit.get_ref()),
                    "units: um mm urad mrad deg um/m um/h um/K ppm/K ms s h 1",
                );
            }
            let typical = t.typical.unwrap_or_else(|| default_typical(t.unit.get_ref()));
            if !(typical.is_finite() && typical > 0.0) {
                self.error(
                    &t.unit.span(),
                    "effects::typical",
                    format!("typical size of {name} is {typical}"),
                    "write a positive number",
                );
            }
            match parameters.iter().find(|p| p.name == name) {
                // one factor may act in several terms, but it is one number with one unit
                Some(p) if p.unit != *t.unit.get_ref() => self.error(
                    &t.unit.span(),
                    "effects::unit",
                    format!("{name} has two units"),
                    "one parameter, one unit",
                ),
                Some(_) => {}
                None => parameters.push(Parameter {
                    name,
                    alias: t.alias.clone(),
                    unit: t.unit.get_ref().clone(),
                    factor: factor.unwrap_or(1.0),
                    typical,
                    source: t.source.clone().unwrap_or_else(|| "assumed".to_owned()),
                    shape: None,
                }),
            }
        }
        for s in &w.shape {
            self.name(s.parameter.get_ref(), &s.parameter.span());
            let (low, high) = (s.min.unwrap_or(f64::NEG_INFINITY), s.max.unwrap_or(f64::INFINITY));
            if !(s.start.is_finite() && low < high && (low..=high).contains(&s.start)) {
                self.error(
                    &s.parameter.span(),
                    "effects::shape",
                    format!("start of {} is not between min and max", s.parameter.get_ref()),
                    "write start, min and max with min < start < max",
                );
            }
            parameters.push(Parameter {
                name: s.parameter.get_ref().clone(),
                alias: None,
                unit: s.unit.clone(),
                factor: 1.0,
                typical: s.start.abs().max(1e-9),
                source: "assumed".to_owned(),
                shape: Some((s.start, low, high)),
            });
        }
        let names: Vec<String> = w
            .terms
            .iter()
            .map(|t| t.parameter.get_ref().clone())
            .chain(w.shape.iter().map(|s| s.parameter.get_ref().clone()))
            .collect();
        let mut needs = Vec::new();
        let mut terms = Vec::new();
        for t in &w.terms {
            let name =
                t.iso.as_deref().and_then(crate::symbols::canonical).unwrap_or_else(|| t.parameter.get_ref().clone());
            let at = t.at.as_ref().unwrap_or(&w.at);
            let Some(place) = place(at.get_ref(), t.frame) else {
                self.error(
                    &at.span(),
                    "effects::at",
                    format!("unknown place {:?}", at.get_ref()),
                    "places: X Y Z A B C, base, tool, workpiece, block, trigger, reading",
                );
                continue;
            };
            if let Place::Before(axis) | Place::After(axis) = place
                && !needs.contains(&axis)
            {
                needs.push(axis);
            }
            let Some(component) = component(place, t.dof.get_ref()) else {
                let known = match place {
                    Place::Trigger => "r",
                    Place::Reading => "X Y Z A B C",
                    _ => "dx dy dz rx ry rz",
                };
                self.error(
                    &t.dof.span(),
                    "effects::dof",
                    format!("unknown dof {:?} at {:?}", t.dof.get_ref(), at.get_ref()),
                    &format!("there: {known}"),
                );
                continue;
            };
            // parameters are indexed by their place in `parameters`; the formula sees them by the name as written
            let mut unique: Vec<&str> = Vec::new();
            for n in &names {
                if !unique.contains(&n.as_str()) {
                    unique.push(n);
                }
            }
            match Formula::parse(t.formula.get_ref(), &unique) {
                Ok(formula) => {
                    let parameter = parameters.iter().position(|p| p.name == name).unwrap_or(0);
                    terms.push(Term { parameter, place, component, formula });
                }
                Err(message) => self.error(
                    &t.formula.span(),
                    "effects::formula",
                    format!("formula of {:?}: {message}", w.id.get_ref()),
                    "angles A B C are radians inside a formula; unary minus binds tighter than ^: write -(x^2)",
                ),
            }
        }
        if w.terms.is_empty() {
            self.error(
                &w.id.span(),
                "effects::no_terms",
                format!("effect {:?} has no terms", w.id.get_ref()),
                "add terms = [ { parameter, unit, dof, formula } ]",
            );
        }
        if self.findings.0[before..].iter().any(|f| f.severity == crate::diag::Severity::Error) {
            return None;
        }
        Some(Effect {
            id: w.id.get_ref().clone(),
            name: if w.name.is_empty() { w.id.get_ref().clone() } else { w.name.clone() },
            says: w.says.clone(),
            look: w.look.clone(),
            mends: w.mends.clone(),
            side,
            needs,
            per_block: w.per == Some(Per::Block),
            nuisance: w.nuisance,
            paper: w.paper,
            parameters,
            terms,
            built_in,
        })
    }
}

fn unit_factor(unit: &str) -> Option<f64> {
    Some(match unit {
        "um" | "um/h" | "um/K" => mm_from_um(1.0),
        "mm" | "s" | "h" | "1" => 1.0,
        "urad" | "um/m" | "ppm/K" => ratio_from_ppm(1.0),
        // milliradians to radians, milliseconds to seconds: both a thousandth
        "mrad" | "ms" => 1e-3,
        "deg" => rad_from_deg(1.0),
        _ => return None,
    })
}

fn default_typical(unit: &str) -> f64 {
    match unit {
        "um" | "um/h" | "um/m" | "ppm/K" => 10.0,
        "um/K" => 3.0,
        "mm" => 0.03,
        "urad" => 50.0,
        "mrad" => 0.05,
        "deg" => 0.003,
        _ => 1.0,
    }
}

fn place(at: &str, frame: Option<Frame>) -> Option<Place> {
    Some(match at {
        "base" => Place::Base,
        "tool" => Place::Tool,
        "workpiece" => Place::Workpiece,
        "block" => Place::Block,
        "trigger" => Place::Trigger,
        "reading" => Place::Reading,
        _ => {
            let mut letters = at.chars();
            let axis = AxisName::from_letter(letters.next()?)?;
            if letters.next().is_some() {
                return None;
            }
            // error motions: a rotary axis's in the frame it turns in, a linear one's in the frame it carries
            let default = if axis.is_rotary() { Frame::Fixed } else { Frame::Moving };
            match frame.unwrap_or(default) {
                Frame::Fixed => Place::Before(axis),
                Frame::Moving => Place::After(axis),
            }
        }
    })
}

fn component(place: Place, dof: &str) -> Option<usize> {
    match place {
        Place::Trigger => (dof == "r").then_some(0),
        Place::Reading => {
            let mut letters = dof.chars();
            let axis = AxisName::from_letter(letters.next()?)?;
            letters.next().is_none().then_some(axis.index())
        }
        _ => ["dx", "dy", "dz", "rx", "ry", "rz"].iter().position(|d| *d == dof),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    #[test]
    fn the_built_in_catalogue_is_good() {
        let catalogue = Catalogue::built_in().unwrap();
        assert!(
            catalogue.knows("location-b") && catalogue.knows("paper-double-head") && catalogue.knows("block-setup")
        );
        assert!(catalogue.iter().all(|e| !e.says.is_empty() && !e.look.is_empty() && !e.mends.is_empty()));
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
