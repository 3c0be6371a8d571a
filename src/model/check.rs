//! Effects as written → checked records; every finding has its place and says which words exist.

use super::as_written::{
    About, EffectAsWritten, File, Frame, Per, Placed, Scan, ShapeAsWritten, SideAsWritten, TermAsWritten, Typical,
};
use super::catalogue::{Effect, Parameter, Place, Term};
use super::formula::{CONSTANTS, FUNCTIONS, Formula, VARIABLES};
use super::formula_errors::MOST_SHAPES;
use super::lever_arm::arm_of;
use super::{degrees_in_formula, formula_errors};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Severity, Source};
use crate::machine::Side;
use crate::units::{mm_from_um, rad_from_deg, ratio_from_ppm};

/// Name of the file's format.
const FORMAT: &str = "axiscal-effects/1";

/// Variables of formulas that are lengths, mm.
const LENGTHS: [&str; 9] = ["X", "Y", "Z", "L", "L0", "px", "py", "pz", "edge"];

/// Source of a size that no publication stands behind.
const ASSUMED: &str = "assumed";

/// Reads effects as written and gathers what is wrong with them.
pub(super) struct Check<'a> {
    source: &'a Source,
    /// Built-in effects are checked by a test, not at every start.
    built_in: bool,
    pub(super) findings: Findings,
}

impl<'a> Check<'a> {
    pub(super) fn new(source: &'a Source, built_in: bool) -> Self {
        Self { source, built_in, findings: Findings::default() }
    }

    /// The file must be of this format, if it says so.
    pub(super) fn format(&mut self, file: &File) {
        if file.format.as_deref().is_some_and(|f| f != FORMAT) {
            self.error(
                &(0..0),
                "effects::format",
                format!("format is not {FORMAT}"),
                &format!("write format = \"{FORMAT}\""),
            );
        }
    }

    /// An id that exists already.
    pub(super) fn twice(&mut self, written: &EffectAsWritten) {
        self.error(
            &written.id.span(),
            "effects::id_twice",
            format!("effect {:?} exists already", written.id.get_ref()),
            "give it an id of its own; rows of one id must apply to different machines (side, needs, unless)",
        );
    }

    fn error(&mut self, span: &std::ops::Range<usize>, code: &'static str, message: String, help: &str) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span.clone()));
    }

    /// A parameter's name must be a word that a formula can use, and none that means something else there.
    fn name(&mut self, name: &str, span: &std::ops::Range<usize>) {
        let word = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !word || [&VARIABLES[..], &FUNCTIONS, &CONSTANTS].iter().any(|words| words.contains(&name)) {
            self.error(
                span,
                "effects::parameter",
                format!("{name:?} cannot be the name of a parameter"),
                "letters, digits and _, and none of the variables, functions and constants (pi, e) of formulas",
            );
        }
    }

    /// A displacement is a length and a turn an angle. With variables in it the formula may carry the rest of the unit, but
    /// only one that holds a length makes a turn of a length, or a length of a turn.
    fn unit_fits(&mut self, w: &EffectAsWritten, t: &TermAsWritten) {
        let unit = t.unit.get_ref().as_str();
        let shapes: Vec<&str> = w.shape.iter().map(|s| s.parameter.get_ref().as_str()).collect();
        let Ok(formula) = Formula::parse(t.formula.get_ref(), &shapes) else { return };
        let (is_length, is_turn) = match t.dof.get_ref().as_str() {
            "dx" | "dy" | "dz" | "r" | "X" | "Y" | "Z" => (true, false),
            "rx" | "ry" | "rz" | "A" | "B" | "C" => (false, true),
            _ => return,
        };
        if unit_factor(unit).is_none() {
            return;
        }
        let fits = if formula.constant().is_some() {
            if is_length { matches!(unit, "um" | "mm") } else { matches!(unit, "urad" | "mrad" | "deg") }
        } else {
            let of_length = is_turn && matches!(unit, "um" | "mm" | "um/h" | "um/K");
            let of_turn = is_length && matches!(unit, "urad" | "mrad" | "deg" | "um/m" | "ppm/K");
            let carries = formula.variables().iter().any(|v| LENGTHS.contains(v))
                || w.shape.iter().any(|s| matches!(s.unit.get_ref().as_str(), "um" | "mm"));
            carries || !(of_length || of_turn)
        };
        if !fits {
            let what = if is_length { "a length" } else { "a turn" };
            let constant = if formula.constant().is_some() { "constant " } else { "" };
            self.error(
                &t.unit.span(),
                "effects::unit",
                format!("a {constant}{} cannot be in {unit}: it is {what}", t.dof.get_ref()),
                "lengths in um or mm, angles in urad, mrad or deg; or a formula with a length in it (X, px, L, edge …)",
            );
        }
    }

    /// One effect; `None` where it is unusable.
    pub(super) fn effect(&mut self, w: &EffectAsWritten) -> Option<Effect> {
        let before = self.findings.0.len();
        if let Some(arm) = w.arm.as_ref().filter(|arm| !["x", "y", "z"].contains(&arm.get_ref().as_str())) {
            let message = format!("{:?} is no direction of a lever arm", arm.get_ref());
            self.error(&arm.span(), "effects::arm", message, "write \"x\", \"y\" or \"z\"");
        }
        if w.has_place() {
            let message = format!("a formula of {:?} has {{place}}, and `at` is no linear axis", w.id.get_ref());
            self.error(
                &w.at.span(),
                "effects::place",
                message,
                "at = \"X\", \"Y\" or \"Z\": {place} is where its carriage stands",
            );
            return None;
        }
        let mut parameters: Vec<Parameter> = Vec::new();
        for t in &w.terms {
            self.factor(w, t, &mut parameters);
        }
        for s in &w.shape {
            self.shape(s, &mut parameters);
        }
        let names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
        let mut needs = self.axes(&w.needs);
        let unless = self.axes(&w.unless);
        let mut terms: Vec<Term> = Vec::with_capacity(w.terms.len());
        for t in &w.terms {
            // the components of an effect mostly go by one formula
            let known = terms.iter().find(|k| k.formula.text() == t.formula.get_ref()).map(|k| k.formula.clone());
            terms.extend(self.term(w, t, &names, known, &mut needs));
        }
        if !self.built_in {
            self.usable(w);
            self.about_fits(w, &terms);
        }
        if w.terms.is_empty() {
            self.error(
                &w.id.span(),
                "effects::no_terms",
                format!("effect {:?} has no terms", w.id.get_ref()),
                "add terms = [ { parameter, unit, dof, formula } ]",
            );
        }
        if self.findings.0[before..].iter().any(|f| f.severity == Severity::Error) {
            return None;
        }
        let arm = arm_of(w, &names);
        Some(Effect {
            id: w.id.get_ref().clone(),
            name: if w.name.is_empty() { w.id.get_ref().clone() } else { w.name.clone() },
            says: w.says.clone(),
            look: w.look.clone(),
            mends: w.mends.clone(),
            too_large: w.too_large.clone(),
            side: w.side.map(|s| if s == SideAsWritten::Tool { Side::Tool } else { Side::Workpiece }),
            place_on: axis(w.at.get_ref()).zip(w.place_on),
            needs,
            unless,
            includes: w.includes.iter().map(|id| id.get_ref().clone()).collect(),
            family: if w.family.is_empty() { "own".to_owned() } else { w.family.clone() },
            discrete: w.discrete,
            about: w.about,
            arm,
            per_block: w.per == Some(Per::Block),
            of: w.of.clone(),
            per_run: w.per == Some(Per::Run),
            nuisance: w.nuisance,
            paper: w.paper,
            parameters,
            terms,
            built_in: self.built_in,
        })
    }

    /// `about` says something of one kind of axis only.
    fn about_fits(&mut self, w: &EffectAsWritten, terms: &[Term]) {
        let at = |rotary: bool| {
            terms.iter().any(|t| matches!(t.place, Place::Before(a) | Place::After(a) if a.is_rotary() == rotary))
        };
        let idle = match w.about {
            Some(About::Line) if !at(true) => ("line", "a rotary"),
            Some(About::Ball) if !at(false) => ("ball", "a linear"),
            _ => return,
        };
        let message = format!("about = {:?} of {:?} says something of {} axis only", idle.0, w.id.get_ref(), idle.1);
        let help = "leave it out: error motions of a rotary axis always turn about its own line";
        self.findings.push(Finding::warning("effects::about", message).help(help).at(self.source, w.id.span()));
    }

    /// An effect needs an id to be put into a model by, and a number that no formula uses would never be known.
    fn usable(&mut self, w: &EffectAsWritten) {
        if w.id.get_ref().trim().is_empty() {
            self.error(
                &w.id.span(),
                "effects::id",
                "an effect has no id".to_owned(),
                "write a word, such as id = \"my-sag\"",
            );
        }
        let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let used =
            |name: &str| w.terms.iter().any(|t| t.formula.get_ref().split(|c| !part(c)).any(|word| word == name));
        if let Some(beyond) = w.shape.get(MOST_SHAPES) {
            self.error(
                &beyond.parameter.span(),
                "effects::shape",
                format!(
                    "{:?} has {} shape parameters, and {MOST_SHAPES} at most are read",
                    w.id.get_ref(),
                    w.shape.len()
                ),
                "write those that are known as numbers, or make several effects of it",
            );
        }
        for s in &w.shape {
            let name = s.parameter.get_ref();
            if !w.terms.is_empty() && !used(name) {
                self.error(
                    &s.parameter.span(),
                    "effects::shape",
                    format!("shape parameter {name:?} stands in no formula of {:?}", w.id.get_ref()),
                    "write it into a formula, or take it out of shape",
                );
            }
        }
    }

    /// A term is its parameter times its formula: what is 0, or holds the parameter once more, is hardly what was meant.
    fn acts(&mut self, w: &EffectAsWritten, t: &TermAsWritten, formula: &Formula, parameter: usize) {
        let (name, id) = (t.parameter.get_ref(), w.id.get_ref());
        let mut warn = |code, message: String, help: String| {
            self.findings.push(Finding::warning(code, message).help(help).at(self.source, t.formula.span()));
        };
        if formula.constant() == Some(0.0) {
            warn(
                "effects::nothing",
                format!("a formula of {id:?} is 0: the term does nothing, whatever {name} is"),
                "write what it depends on, or take the term out".to_owned(),
            );
        }
        if formula.holds(parameter) {
            warn(
                "effects::twice_inside",
                format!(
                    "{name} stands in its own formula of {id:?}: the term is {name} times the formula, so that it acts with \
                     the square of {name}, and a small {name} has no effect that a test can detect"
                ),
                format!(
                    "leave {name} out of the formula; what bends with a size of its own gets a name of its own under shape"
                ),
            );
        }
    }

    /// The parameter that a term is multiplied by; one parameter may stand before several terms.
    fn factor(&mut self, w: &EffectAsWritten, t: &TermAsWritten, parameters: &mut Vec<Parameter>) {
        let name = t.parameter.get_ref();
        let unit = t.unit.get_ref();
        let factor = unit_factor(unit);
        let typical = match &t.typical {
            Some(Typical::All(size)) => *size,
            Some(Typical::Each(_)) => f64::NAN,
            None => default_typical(unit),
        };
        if !self.built_in {
            self.name(name, &t.parameter.span());
            self.unit_fits(w, t);
        }
        if factor.is_none() {
            self.unknown_unit(&t.unit);
        }
        if !(typical.is_finite() && typical > 0.0) {
            self.error(
                &t.unit.span(),
                "effects::typical",
                format!("typical size of {name} is {typical}"),
                "write a positive number; a list of them, one for each axis, in a row with `axes` only",
            );
        }
        match parameters.iter().find(|p| &p.name == name) {
            // one factor may act in several terms, but it is one number with one unit
            Some(p) if &p.unit != unit => {
                self.error(&t.unit.span(), "effects::unit", format!("{name} has two units"), "one parameter, one unit");
            }
            Some(_) => {}
            None => parameters.push(Parameter {
                name: name.clone(),
                alias: t.alias.clone(),
                iso: t.iso.as_deref().map(|iso| crate::symbols::canonical(iso).unwrap_or_else(|| iso.to_owned())),
                unit: unit.clone(),
                factor: factor.unwrap_or(1.0),
                typical,
                source: t.source.clone().unwrap_or_else(|| ASSUMED.to_owned()),
                positive: t.sign.is_some(),
                shape: None,
                scan: Vec::new(),
                between: None,
            }),
        }
    }

    /// A parameter that stands inside the formulas.
    fn shape(&mut self, s: &ShapeAsWritten, parameters: &mut Vec<Parameter>) {
        let (name, span) = (s.parameter.get_ref(), s.parameter.span());
        self.name(name, &span);
        if unit_factor(s.unit.get_ref()).is_none() {
            self.unknown_unit(&s.unit);
        }
        if parameters.iter().any(|p| &p.name == name) {
            self.error(
                &span,
                "effects::parameter",
                format!("{name} stands before a term and inside: two parameters of one name"),
                "give the one inside a name of its own",
            );
        }
        let (low, high) = (s.min.unwrap_or(f64::NEG_INFINITY), s.max.unwrap_or(f64::INFINITY));
        if !(s.start.is_finite() && low < high && (low..=high).contains(&s.start)) {
            self.error(
                &span,
                "effects::shape",
                format!("start of {name} is not between min and max"),
                "write start, min and max with min < start < max",
            );
        }
        let scan = s.scan.as_ref().map(Scan::values);
        if scan.as_ref().is_some_and(|v| !v.as_ref().is_some_and(|v| v.iter().all(|x| (low..=high).contains(x)))) {
            self.error(
                &span,
                "effects::scan",
                format!("scan of {name} holds no usable values"),
                "write scan = [5, 10, 20] or scan = { from = 0.1, to = 5, points = 12, log = true }, from min to max",
            );
        }
        let place = |word: &Placed| VARIABLES.iter().position(|v| v == word.get_ref());
        let between = s.between.as_ref().and_then(place);
        if let Some(word) = s.between.as_ref().filter(|_| between.is_none()) {
            self.error(
                &word.span(),
                "effects::between",
                format!("{:?} is no variable of formulas", word.get_ref()),
                "write the variable at whose value something jumps, for instance between = \"t\"",
            );
        }
        parameters.push(Parameter {
            name: name.clone(),
            alias: None,
            iso: None,
            unit: s.unit.get_ref().clone(),
            factor: 1.0,
            typical: s.start.abs().max(1e-9),
            source: s.source.clone().unwrap_or_else(|| ASSUMED.to_owned()),
            positive: false,
            shape: Some((s.start, low, high)),
            scan: scan.flatten().unwrap_or_default(),
            between,
        });
    }

    /// Letters of axes.
    pub(super) fn axes(&mut self, written: &[Placed]) -> Vec<AxisName> {
        let mut out = Vec::new();
        for word in written {
            match axis(word.get_ref()) {
                Some(name) => out.push(name),
                None => self.error(
                    &word.span(),
                    "effects::axis",
                    format!("{:?} is no axis", word.get_ref()),
                    "axes: X Y Z A B C",
                ),
            }
        }
        out
    }

    fn term(
        &mut self,
        w: &EffectAsWritten,
        t: &TermAsWritten,
        names: &[String],
        known: Option<Formula>,
        needs: &mut Vec<AxisName>,
    ) -> Option<Term> {
        let at = t.at.as_ref().unwrap_or(&w.at);
        let Some(place) = place(at.get_ref(), t.frame) else {
            self.error(
                &at.span(),
                "effects::at",
                format!("unknown place {:?}", at.get_ref()),
                "places: X Y Z A B C, base, tool, workpiece, block, trigger, reading",
            );
            return None;
        };
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
            return None;
        };
        let needed = match place {
            Place::Before(axis) | Place::After(axis) => Some(axis),
            Place::Reading => AxisName::ALL.get(component).copied(),
            _ => None,
        };
        needs.extend(needed.filter(|axis| !needs.contains(axis)));
        let text = t.formula.get_ref();
        let words = || names.iter().map(String::as_str).collect::<Vec<_>>();
        let formula = match known {
            Some(formula) => Ok(formula),
            None if self.built_in => Formula::compile(text, &words()),
            None => Formula::parse(text, &words()),
        };
        match formula {
            Ok(formula) if !self.built_in && formula.constant().is_some_and(|c| !c.is_finite()) => {
                self.error(
                    &t.formula.span(),
                    "effects::no_value",
                    format!("formula {text:?} of {:?} has no value", w.id.get_ref()),
                    "a division by zero, or a root or logarithm of a negative number",
                );
                None
            }
            Ok(formula) => {
                let parameter = names.iter().position(|name| name == t.parameter.get_ref())?;
                if !self.built_in {
                    self.acts(w, t, &formula, parameter);
                    self.in_degrees(w, t, &words());
                }
                Some(Term { parameter, place, component, formula })
            }
            Err(message) => {
                let found = formula_errors::find(text, &words());
                let help = found.as_ref().and_then(|m| m.help).unwrap_or("angles A B C are radians inside a formula");
                let place = found.and_then(|m| self.inside(&t.formula, m.at));
                self.error(
                    &place.unwrap_or_else(|| t.formula.span()),
                    "effects::formula",
                    format!("formula of {:?}: {message}", w.id.get_ref()),
                    help,
                );
                None
            }
        }
    }

    /// A number of degrees where radians are meant.
    fn in_degrees(&mut self, w: &EffectAsWritten, t: &TermAsWritten, shapes: &[&str]) {
        if let Some(found) = degrees_in_formula::find(t.formula.get_ref(), shapes) {
            let says = format!("formula {:?} of {:?}: {found}", t.formula.get_ref(), w.id.get_ref());
            let finding = Finding::warning("effects::in_degrees", says).help(found.remedy());
            self.findings.push(finding.at(self.source, t.formula.span()));
        }
    }

    /// Where a part of a formula stands in the file; `None` where it is not written there as it reads.
    fn inside(&self, formula: &Placed, part: std::ops::Range<usize>) -> Option<std::ops::Range<usize>> {
        let span = formula.span();
        let written = self.source.inner().get(span.clone())?;
        let from = span.start + written.find(formula.get_ref().as_str())?;
        (!part.is_empty()).then_some(from + part.start..from + part.end)
    }

    fn unknown_unit(&mut self, unit: &Placed) {
        self.error(
            &unit.span(),
            "effects::unit",
            format!("unknown unit {:?}", unit.get_ref()),
            "units: um mm urad mrad deg um/m um/h um/K ppm/K ms s h 1",
        );
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
            let axis = axis(at)?;
            // error motions: a rotary axis's in the frame it turns in, a linear one's in the frame it carries
            let default = if axis.is_rotary() { Frame::Fixed } else { Frame::Moving };
            match frame.unwrap_or(default) {
                Frame::Fixed => Place::Before(axis),
                Frame::Moving => Place::After(axis),
            }
        }
    })
}

/// The axis of a letter.
fn axis(word: &str) -> Option<AxisName> {
    let mut letters = word.chars();
    let name = AxisName::from_letter(letters.next()?)?;
    letters.next().is_none().then_some(name)
}

fn component(place: Place, dof: &str) -> Option<usize> {
    match place {
        Place::Trigger => (dof == "r").then_some(0),
        Place::Reading => axis(dof).map(AxisName::index),
        _ => ["dx", "dy", "dz", "rx", "ry", "rz"].iter().position(|d| *d == dof),
    }
}
