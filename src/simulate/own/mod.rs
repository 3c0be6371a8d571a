//! A user's own effects in the virtual machine. The file is read here once more, placed in the virtual machine's own chain
//! and given its own state: with the code that predicts it shares the form of the file only.

pub mod formula;

use super::catalogue::unit::Unit;
use super::scenario::axis_named;
use super::terms::{Shape, Target, Term};
use crate::axes::AxisName;
use crate::diag::{Finding, Findings, Result, Source};
use crate::keys::not_of_form;
use crate::machine::{Machine, Side};
use formula::Formula;
use serde::Deserialize;
use std::ops::Range;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OwnFile {
    #[serde(default, rename = "format")]
    _format: String,
    #[serde(default)]
    effect: Vec<OwnEffect>,
}

/// An effect as it stands in the file; what only people read is passed over.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct OwnEffect {
    id: Spanned<String>,
    #[serde(default)]
    axes: Vec<Spanned<String>>,
    #[serde(default)]
    with_previous: bool,
    at: Spanned<String>,
    side: Option<OwnSide>,
    about: Option<OwnAbout>,
    /// `x`, `y` or `z`.
    arm: Option<Spanned<String>>,
    #[serde(default)]
    needs: Vec<Spanned<String>>,
    #[serde(default)]
    unless: Vec<Spanned<String>>,
    #[serde(default)]
    terms: Vec<OwnTerm>,
    #[serde(default)]
    shape: Vec<OwnShape>,
    #[serde(default, rename = "name")]
    _name: String,
    #[serde(default, rename = "says")]
    _says: String,
    #[serde(default, rename = "look")]
    _look: String,
    #[serde(default, rename = "mends")]
    _mends: String,
    #[serde(default, rename = "too_large")]
    _too_large: String,
    #[serde(default, rename = "family")]
    _family: String,
    #[serde(rename = "includes")]
    _includes: Option<toml::Value>,
    #[serde(rename = "per")]
    _per: Option<toml::Value>,
    #[serde(rename = "nuisance")]
    _nuisance: Option<bool>,
    #[serde(rename = "discrete")]
    _discrete: Option<bool>,
    #[serde(rename = "paper")]
    _paper: Option<bool>,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum OwnAbout {
    /// Rotations of a linear axis that bears the workpiece leave the place of the ball's centre at zero where it is.
    Ball,
    /// Constant errors of a rotary axis count on its own line, as those that vary always do.
    Line,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum OwnSide {
    Workpiece,
    Tool,
}

#[derive(Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum OwnFrame {
    Fixed,
    Moving,
}

#[derive(Clone, Deserialize)]
struct OwnTerm {
    parameter: Spanned<String>,
    unit: Spanned<String>,
    dof: Spanned<String>,
    formula: Spanned<String>,
    at: Option<Spanned<String>>,
    frame: Option<OwnFrame>,
}

#[derive(Clone, Deserialize)]
struct OwnShape {
    parameter: Spanned<String>,
    unit: Spanned<String>,
    start: f64,
}

/// A parameter of a user's effect.
#[derive(Debug, Clone)]
pub struct OwnParameter {
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// What it is when it is not given: 0, or the start of one that stands inside the formulas.
    default: f64,
}

/// A user's effect as a machine has it.
#[derive(Debug, Clone)]
pub struct Own {
    pub id: String,
    pub parameters: Vec<OwnParameter>,
    /// Which parameter acts where, how, and by how much.
    acts: Vec<(usize, Target, Formula, f64)>,
    /// Why the machine does not have it.
    pub not_here: Option<String>,
}

impl Own {
    /// The terms of values (by parameter, in its unit) on all blocks, or on one; formulas are numbered from `first`.
    pub fn plant(&self, values: &[(usize, f64)], only: Option<&str>, first: usize) -> (Vec<Term>, Vec<Formula>) {
        let mut all: Vec<f64> = self.parameters.iter().map(|p| p.default).collect();
        for &(i, value) in values {
            all[i] = value;
        }
        let given = self.acts.iter().filter(|(i, ..)| values.iter().any(|(v, _)| v == i));
        let (mut terms, mut formulas) = (Vec::new(), Vec::new());
        for (parameter, target, formula, by) in given {
            let amount = by * inside(self.parameters[*parameter].unit) * all[*parameter];
            terms.push(Term { target: *target, shape: Shape::Formula(first + formulas.len()), amount });
            formulas.push(formula.with(&all, only));
        }
        (terms, formulas)
    }

    /// Parameter names with their units, for messages.
    pub fn written(&self) -> String {
        let each = self.parameters.iter().map(|p| format!("{} ({})", p.name, p.unit.word()));
        each.collect::<Vec<_>>().join(", ")
    }
}

/// What one of a unit is inside a term: mm, rad, seconds, hours, or what the formula makes of them.
fn inside(unit: Unit) -> f64 {
    match unit {
        Unit::H | Unit::S => 1.0,
        Unit::Ms => crate::units::s_from_ms(1.0),
        other => other.base(1.0),
    }
}

impl OwnEffect {
    /// The row for one of its axes.
    fn for_axis(&self, axis: AxisName) -> Self {
        let mut row = self.clone();
        let fill = |word: &mut Spanned<String>| *word.get_mut() = axis.fill_in(word.get_ref());
        [&mut row.id, &mut row.at].into_iter().chain(&mut row.needs).chain(&mut row.unless).for_each(fill);
        for term in &mut row.terms {
            let always = [&mut term.parameter, &mut term.dof, &mut term.formula];
            always.into_iter().chain(&mut term.at).for_each(fill);
        }
        row.shape.iter_mut().for_each(|shape| fill(&mut shape.parameter));
        row
    }
}

/// A value that was given in `from`, in `to`. `None` when they measure different things.
pub fn converted(value: f64, from: Unit, to: Unit) -> Option<f64> {
    if from == to {
        return Some(value);
    }
    (from.kind() == to.kind()).then(|| from.base(value) / to.base(1.0))
}

/// Reads a file of effects for a machine. Rows of one id are taken together: the first that the machine has.
///
/// # Errors
/// When something in the file cannot be understood: all findings, each with its place.
pub fn read(source: &Source, machine: &Machine) -> Result<Vec<Own>> {
    let file: OwnFile = toml::from_str(source.inner()).map_err(|e| {
        not_of_form::<OwnFile>(&e, source, "effects::not_toml", "`axiscal schema effects` prints the form")
    })?;
    let mut reader = Reader { source, machine, findings: Findings::default() };
    let mut out: Vec<Own> = Vec::new();
    let mut rows = Vec::new();
    for together in file.effect.chunk_by(|_, next| next.with_previous) {
        let letters = together.first().map(|row| reader.axes(&row.axes)).unwrap_or_default();
        if letters.is_empty() {
            rows.extend_from_slice(together);
        }
        letters.into_iter().for_each(|axis| rows.extend(together.iter().map(|row| row.for_axis(axis))));
    }
    for row in &rows {
        if super::catalogue::is_known(row.id.get_ref(), machine) {
            let message = format!("effect {:?} exists already", row.id.get_ref());
            reader.error(row.id.span(), "effects::id_twice", message, "give it an id of its own".to_owned());
        }
        let Some(own) = reader.effect(row) else { continue };
        match out.iter_mut().find(|o| o.id == own.id) {
            Some(earlier) if earlier.not_here.is_some() => *earlier = own,
            Some(_) if own.not_here.is_some() => {}
            Some(_) => {
                let message = format!("effect {:?} stands twice for machine {:?}", own.id, machine.name);
                reader.error(row.id.span(), "effects::id_twice", message, "give it an id of its own".to_owned());
            }
            None => out.push(own),
        }
    }
    reader.findings.finish(out).map(|(out, _)| out)
}

struct Reader<'a> {
    source: &'a Source,
    machine: &'a Machine,
    findings: Findings,
}

impl Reader<'_> {
    fn error(&mut self, span: Range<usize>, code: &'static str, message: String, help: String) {
        self.findings.push(Finding::error(code, message).help(help).at(self.source, span));
    }

    fn unit(&mut self, word: &Spanned<String>) -> Option<Unit> {
        let unit = Unit::parse(word.get_ref());
        if unit.is_none() {
            let known: Vec<&str> = Unit::ALL.iter().map(|u| u.word()).collect();
            let message = format!("unknown unit {:?}", word.get_ref());
            self.error(word.span(), "effects::unit", message, format!("units: {}", known.join(" ")));
        }
        unit
    }

    fn axes(&mut self, words: &[Spanned<String>]) -> Vec<AxisName> {
        let mut out = Vec::new();
        for word in words {
            match axis_named(word.get_ref()) {
                Some(name) => out.push(name),
                None => {
                    let message = format!("{:?} is no axis", word.get_ref());
                    self.error(word.span(), "effects::axis", message, "axes: X Y Z A B C".to_owned());
                }
            }
        }
        out
    }

    fn effect(&mut self, row: &OwnEffect) -> Option<Own> {
        let before = self.findings.0.len();
        let mut parameters: Vec<OwnParameter> = Vec::new();
        let factors = row.terms.iter().map(|t| (&t.parameter, &t.unit, 0.0));
        for (name, unit, default) in factors.chain(row.shape.iter().map(|s| (&s.parameter, &s.unit, s.start))) {
            let unit = self.unit(unit).unwrap_or(Unit::One);
            if !parameters.iter().any(|p| &p.name == name.get_ref()) {
                if !formula::is_free(name.get_ref()) {
                    let message = format!("{:?} cannot be the name of a parameter", name.get_ref());
                    let help =
                        "letters, digits and _, and none of the variables, functions and constants (pi, e) of formulas";
                    self.error(name.span(), "effects::parameter", message, help.to_owned());
                }
                parameters.push(OwnParameter { name: name.get_ref().clone(), unit, default });
            }
        }
        let mut names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
        let arm = row.arm.as_ref().and_then(|along| self.arm(row, along));
        if let Some((name, _)) = &arm {
            names.push(name.clone());
            parameters.push(OwnParameter { name: name.clone(), unit: Unit::Mm, default: 0.0 });
        }
        let mut needs = self.axes(&row.needs);
        let unless = self.axes(&row.unless);
        let mut acts = Vec::new();
        for term in &row.terms {
            let at = term.at.as_ref().unwrap_or(&row.at);
            let target = self.target(at, &term.dof, term.frame);
            if let Some(Target::Axis { axis, .. } | Target::OwnLine { axis, .. } | Target::Reading(axis)) = target {
                needs.push(axis);
            }
            let formula = self.formula(row, term, &names);
            let parameter = names.iter().position(|n| n == term.parameter.get_ref());
            if let (Some(parameter), Some(target), Some(formula)) = (parameter, target, formula) {
                let target = self.on_own_line(target, &formula, row.about);
                if let Some((name, along)) = &arm {
                    acts.extend(super::catalogue::axes::shift_of_a_turn(target, *along).and_then(|(to, by)| {
                        let text = format!("({})*{name}", term.formula.get_ref());
                        let formula = Formula::read(&self.placed(row, &text)?, &names).ok()?;
                        Some((parameter, to, formula, by))
                    }));
                }
                if let Some(OwnAbout::Ball) = row.about {
                    let back = super::catalogue::axes::back_to_the_ball(target, self.machine);
                    acts.extend(back.into_iter().map(|(target, by)| (parameter, target, formula.clone(), by)));
                }
                acts.push((parameter, target, formula, 1.0));
            }
        }
        if self.findings.0.len() > before {
            return None;
        }
        let side = row.side.map(|s| match s {
            OwnSide::Workpiece => Side::Workpiece,
            OwnSide::Tool => Side::Tool,
        });
        let here = |name: &AxisName| {
            self.machine.axes.iter().any(|a| a.name == *name && side.is_none_or(|side| side == a.side))
        };
        let lacks =
            needs.iter().find(|n| !here(n)).map(|n| format!("machine {:?} has no axis {n} there", self.machine.name));
        let has = unless.iter().find(|n| here(n)).map(|n| format!("machine {:?} has an axis {n}", self.machine.name));
        Some(Own { id: row.id.get_ref().clone(), parameters, acts, not_here: lacks.or(has) })
    }

    /// The parameter of a lever arm, and its direction.
    fn arm(&mut self, row: &OwnEffect, along: &Spanned<String>) -> Option<(String, usize)> {
        let direction = ["x", "y", "z"].iter().position(|d| d == along.get_ref());
        if direction.is_none() {
            let message = format!("unknown direction {:?}", along.get_ref());
            self.error(along.span(), "effects::arm", message, "x, y or z".to_owned());
        }
        Some((format!("arm_{}", row.id.get_ref().replace('-', "_")), direction?))
    }

    fn formula(&mut self, row: &OwnEffect, term: &OwnTerm, names: &[String]) -> Option<Formula> {
        let text = term.formula.get_ref();
        let Some(placed) = self.placed(row, text) else {
            let message =
                format!("a formula of {:?} has {{place}}, and `at` is no linear axis of the machine", row.id.get_ref());
            self.error(term.formula.span(), "effects::place", message, "at = \"X\", \"Y\" or \"Z\"".to_owned());
            return None;
        };
        match Formula::read(&placed, names) {
            Ok(formula) => Some(formula),
            Err((says, help)) => {
                let message = format!("formula of {:?}: {says}", row.id.get_ref());
                self.error(term.formula.span(), "effects::formula", message, help);
                None
            }
        }
    }

    /// A formula with the place of the row's axis on its guideway.
    fn placed(&self, row: &OwnEffect, text: &str) -> Option<String> {
        if !text.contains("{place}") {
            return Some(text.to_owned());
        }
        let axis = axis_named(row.at.get_ref()).filter(|name| !name.is_rotary())?;
        // what the machine lacks stands nowhere, and the row is passed over
        let backwards = self.machine.axis(axis).is_some_and(super::chain::goes_backwards);
        Some(text.replace("{place}", &format!("({}{axis})", if backwards { "0 - " } else { "" })))
    }

    /// How a rotary axis runs counts on its own line; what is constant says where that line lies, unless it turns a table
    /// about itself.
    fn on_own_line(&self, target: Target, formula: &Formula, about: Option<OwnAbout>) -> Target {
        let Target::Axis { axis, after, dof } = target else { return target };
        let Some(here) = self.machine.axis(axis).filter(|_| axis.is_rotary()) else { return target };
        let letter = [here.direction.x, here.direction.y, here.direction.z][axis.index() % 3];
        let about_itself = here.side == Side::Workpiece && dof == axis.index() && letter.abs() > 1.0 - 1e-9;
        let own = about == Some(OwnAbout::Line) || about_itself || !formula.is_constant();
        if own { Target::OwnLine { axis, after, dof } } else { target }
    }

    /// Where a term acts.
    fn target(&mut self, at: &Spanned<String>, dof: &Spanned<String>, frame: Option<OwnFrame>) -> Option<Target> {
        const SIX: [&str; 6] = ["dx", "dy", "dz", "rx", "ry", "rz"];
        let component = SIX.iter().position(|d| d == dof.get_ref());
        let (target, known) = match at.get_ref().as_str() {
            "base" => (component.map(Target::Base), "dx dy dz rx ry rz"),
            "tool" => (component.map(Target::Tool), "dx dy dz rx ry rz"),
            "workpiece" => (component.map(Target::Workpiece), "dx dy dz rx ry rz"),
            "block" => (component.map(Target::Block), "dx dy dz rx ry rz"),
            "trigger" => ((dof.get_ref() == "r").then_some(Target::Late), "r"),
            "reading" => (axis_named(dof.get_ref()).map(Target::Reading), "X Y Z A B C"),
            word => {
                let Some(axis) = axis_named(word) else {
                    let message = format!("unknown place {word:?}");
                    let help = "places: X Y Z A B C, base, tool, workpiece, block, trigger, reading";
                    self.error(at.span(), "effects::at", message, help.to_owned());
                    return None;
                };
                // what a linear axis carries moves with it; a rotary axis's errors stand in the frame before it
                let after = frame.map_or(!axis.is_rotary(), |f| f == OwnFrame::Moving);
                (component.map(|dof| Target::Axis { axis, after, dof }), "dx dy dz rx ry rz")
            }
        };
        if target.is_none() {
            let message = format!("unknown dof {:?} at {:?}", dof.get_ref(), at.get_ref());
            self.error(dof.span(), "effects::dof", message, format!("there: {known}"));
        }
        target
    }
}
