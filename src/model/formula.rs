//! Formulas of effects: parsed once, evaluated at the state of a touch, with partial derivatives for shape parameters.
//!
//! `model::expression` evaluates and differentiates; this module fixes the variables that a formula may use (docs/guide/effects.md) and
//! turns a mistake into a sentence that names it.

use super::expression::{Expression, MOST_VARIABLES};
use super::formula_parser::bare_number;
use std::sync::Arc;

/// The variables of a touch that a formula may use, in the order of [`State`]. A new one is also written in `fit::MOVING` (if it
/// changes between two visits of one pose), `workbench/draft.rs`, `simulate/own/formula.rs` and, where patterns of it are to be searched,
/// `diagnose/features.rs` and `words::diagnose::is_plain`.
pub const VARIABLES: [&str; 58] = [
    "X", "Y", "Z", "A", "B", "C", "t", "T", "nx", "ny", "nz", "mx", "my", "mz", "sX", "sY", "sZ", "sA", "sB", "sC",
    "feed", "S", "gx", "gy", "gz", "L", "L0", "bx", "by", "bz", "px", "py", "pz", "ox", "oy", "oz", "edge", "wA", "wB",
    "wC", "wayA", "wayB", "wayC", "speed1", "on1", "off1", "speed2", "on2", "off2", "speed3", "on3", "off3", "speed4",
    "on4", "off4", "hx", "hy", "hz",
];

/// Where groups of variables begin in a [`State`].
pub mod slot {
    /// `X Y Z A B C`.
    pub const AXES: usize = 0;
    /// `t`.
    pub const HOURS: usize = 6;
    /// `T`.
    pub const TEMPERATURE: usize = 7;
    /// `nx ny nz`.
    pub const NORMAL_IN_R: usize = 8;
    /// `mx my mz`.
    pub const NORMAL_IN_PROBE: usize = 11;
    /// `sX … sC`.
    pub const SENSES: usize = 14;
    /// `feed`.
    pub const FEED: usize = 20;
    /// `S`.
    pub const SPINDLE: usize = 21;
    /// `gx gy gz`.
    pub const GRAVITY: usize = 22;
    /// `L L0`.
    pub const LENGTHS: usize = 25;
    /// `bx by bz`.
    pub const NORMAL_OF_BLOCK: usize = 27;
    /// `px py pz`.
    pub const POINT: usize = 30;
    /// `ox oy oz`.
    pub const OUTWARD: usize = 33;
    /// `edge`.
    pub const EDGE: usize = 36;
    /// `wA wB wC`.
    pub const BEFORE: usize = 37;
    /// `wayA wayB wayC`.
    pub const WAY: usize = 40;
    /// `speed1 on1 off1 … off4`.
    pub const SPINDLE_RUNS: usize = 43;
    /// `hx hy hz`.
    pub const GRAVITY_AT_BLOCK: usize = 55;
}

/// Values of [`VARIABLES`] at one touch: X Y Z mm; A B C rad; t h; T °C; normals; senses ±1; feed mm/min; spindle rad;
/// gravity in the tool's frame and in the carrier's; lengths, point and edge mm; outward from the carrier's centre line; where the rotary axes
/// stood before they came to their pose, rad (0 until they have moved), how far they have gone since their last reversal, rad;
/// and the latest stretches in which the spindle ran (`model::spindle`).
pub type State = [f64; VARIABLES.len()];

/// The variables that some formulas use, each with its values at all touches: a formula that goes through many touches would
/// fetch whole states for a number or two.
#[derive(Debug)]
pub struct States {
    /// By variable; nothing where no formula uses it.
    columns: Vec<Vec<f64>>,
}

impl States {
    /// What formulas use of the states of all touches.
    pub fn new<'f, 's>(
        formulas: impl Iterator<Item = &'f Formula>,
        states: impl ExactSizeIterator<Item = &'s State>,
    ) -> Self {
        let of_state = |o: &Origin| if let Origin::State(i) = o { Some(*i) } else { None };
        let mut used: Vec<usize> = formulas.flat_map(|f| f.origins().iter().filter_map(of_state)).collect();
        used.sort_unstable();
        used.dedup();
        let mut columns = vec![Vec::new(); VARIABLES.len()];
        used.iter().for_each(|&i| columns[i].reserve_exact(states.len()));
        for state in states {
            used.iter().for_each(|&i| columns[i].push(state[i]));
        }
        Self { columns }
    }
}

/// Functions that a formula may use.
pub const FUNCTIONS: [&str; 15] =
    ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "ln", "sqrt", "abs", "sign", "floor", "mod", "step"];

/// Numbers that have a name, or that a reader takes a word for: no parameter may be called so.
pub const CONSTANTS: [&str; 4] = ["pi", "PI", "e", "E"];

/// Where the value of a variable of an expression comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Origin {
    State(usize),
    Shape(usize),
}

impl Origin {
    fn value(self, state: &State, shapes: &[f64]) -> f64 {
        match self {
            Self::State(i) => state[i],
            Self::Shape(i) => shapes.get(i).copied().unwrap_or(f64::NAN),
        }
    }
}

/// What a formula is once its words are known.
#[derive(Debug)]
enum Parts {
    Constant(f64),
    /// An expression with the origins of its variables.
    Expression(Expression, Vec<Origin>),
}

impl Parts {
    fn from_expression(expression: Expression, shapes: &[&str]) -> Result<Self, String> {
        let origins = origins(&expression.variables(), shapes)?;
        Ok(if origins.is_empty() {
            Self::Constant(expression.value(&[]))
        } else {
            Self::Expression(expression, origins)
        })
    }
}

/// A formula. Copies share one record.
#[derive(Debug, Clone)]
pub struct Formula(Arc<Compiled>);

#[derive(Debug)]
struct Compiled {
    text: String,
    parts: Parts,
}

impl Formula {
    /// Parses a formula; `shapes` are the names of the effect's parameters that may stand inside it.
    ///
    /// # Errors
    /// A sentence that says what is wrong and which words exist.
    pub fn parse(text: &str, shapes: &[&str]) -> Result<Self, String> {
        match super::formula_errors::find(text, shapes) {
            Some(wrong) => Err(wrong.says),
            None => Self::compile(text, shapes),
        }
    }

    /// The same without the search for mistakes.
    ///
    /// # Errors
    /// A sentence that says what is wrong and which words exist.
    pub(super) fn compile(text: &str, shapes: &[&str]) -> Result<Self, String> {
        let parts = match bare_number(text) {
            Some(constant) => Parts::Constant(constant),
            None => compile(text, shapes)?,
        };
        Ok(Self(Arc::new(Compiled { text: text.to_owned(), parts })))
    }

    fn parts(&self) -> &Parts {
        &self.0.parts
    }

    /// The formula as it was written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// Its value where it uses no variable.
    #[must_use]
    pub fn constant(&self) -> Option<f64> {
        if let Parts::Constant(constant) = self.parts() { Some(*constant) } else { None }
    }

    /// Where its variables come from; none for a number.
    fn origins(&self) -> &[Origin] {
        if let Parts::Expression(_, origins) = self.parts() { origins } else { &[] }
    }

    /// True when a parameter of the effect stands inside.
    #[must_use]
    pub fn has_shape(&self) -> bool {
        self.origins().iter().any(|o| matches!(o, Origin::Shape(_)))
    }

    /// Does this parameter of the effect stand inside?
    #[must_use]
    pub fn holds(&self, shape: usize) -> bool {
        self.origins().contains(&Origin::Shape(shape))
    }

    /// The state variables that it uses.
    #[must_use]
    pub fn variables(&self) -> Vec<&'static str> {
        let name = |o: &Origin| if let Origin::State(i) = o { Some(VARIABLES[*i]) } else { None };
        self.origins().iter().filter_map(name).collect()
    }

    /// Value at a state; `shapes` are the parameters' values in their own units.
    #[must_use]
    pub fn eval(&self, state: &State, shapes: &[f64]) -> f64 {
        match self.parts() {
            Parts::Constant(constant) => *constant,
            Parts::Expression(expression, origins) => {
                with_values(origins, state, shapes, |values| expression.value(values))
            }
        }
    }

    /// Values at many touches. Those of one pose mostly follow one another: where the variables are those of the touch before,
    /// so is the value.
    pub fn eval_each(&self, states: &States, touches: impl Iterator<Item = usize>, shapes: &[f64]) -> Vec<f64> {
        let (expression, origins) = match self.parts() {
            Parts::Constant(constant) => return touches.map(|_| *constant).collect(),
            Parts::Expression(expression, origins) => (expression, origins),
        };
        let column = |origin: &Origin| match origin {
            Origin::State(i) => Ok(states.columns[*i].as_slice()),
            Origin::Shape(i) => Err(shapes.get(*i).copied().unwrap_or(f64::NAN)),
        };
        let columns: Vec<std::result::Result<&[f64], f64>> = origins.iter().map(column).collect();
        // by variable, the values that differ from those of the touch before; and which of them each touch has
        let (mut distinct, mut place) = (vec![Vec::new(); columns.len()], Vec::with_capacity(touches.size_hint().0));
        let (mut before, mut count) = (None, 0);
        for touch in touches {
            let is_same = |from: usize, column: &[f64]| column[from].to_bits() == column[touch].to_bits();
            if !before.is_some_and(|from| columns.iter().flatten().all(|column| is_same(from, column))) {
                for (distinct, column) in distinct.iter_mut().zip(&columns) {
                    distinct.push(column.map_or_else(|number| number, |column| column[touch]));
                }
                count += 1;
            }
            place.push(count - 1);
            before = Some(touch);
        }
        let values = expression.values(&distinct, count);
        place.into_iter().map(|place| values[place]).collect()
    }

    /// Derivatives with respect to the shape parameters that stand inside: (which, value).
    pub fn partials<'a>(&'a self, state: &'a State, shapes: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let of_shape =
            |(at, origin): (usize, &Origin)| if let Origin::Shape(k) = origin { Some((at, *k)) } else { None };
        self.origins().iter().enumerate().filter_map(of_shape).map(move |(at, shape)| {
            let value = self.derivative(at, state, shapes);
            (shape, if value.is_finite() { value } else { self.difference(shape, state, shapes) })
        })
    }

    fn derivative(&self, at: usize, state: &State, shapes: &[f64]) -> f64 {
        let Parts::Expression(expression, origins) = self.parts() else { return f64::NAN };
        with_values(origins, state, shapes, |values| expression.derivative(at, values))
    }

    fn difference(&self, shape: usize, state: &State, shapes: &[f64]) -> f64 {
        let step = 1e-6 * shapes[shape].abs().max(1e-3);
        let mut at = shapes.to_vec();
        at[shape] += step;
        let plus = self.eval(state, &at);
        at[shape] -= 2.0 * step;
        (plus - self.eval(state, &at)) / (2.0 * step)
    }
}

fn compile(text: &str, shapes: &[&str]) -> Result<Parts, String> {
    let cannot = || format!("it cannot be read (functions: {})", FUNCTIONS.join(" "));
    let expression = Expression::read(text).ok_or_else(cannot)?;
    Parts::from_expression(expression, shapes)
}

/// Hands on the values of an expression's variables.
fn with_values<T>(origins: &[Origin], state: &State, shapes: &[f64], of: impl FnOnce(&[f64]) -> T) -> T {
    let mut values = [0.0; MOST_VARIABLES];
    let values = &mut values[..origins.len()];
    for (value, origin) in values.iter_mut().zip(origins) {
        *value = origin.value(state, shapes);
    }
    of(values)
}

fn origins(names: &[&str], shapes: &[&str]) -> Result<Vec<Origin>, String> {
    if names.len() > MOST_VARIABLES {
        return Err(format!("a formula has more than {MOST_VARIABLES} variables"));
    }
    names
        .iter()
        .map(|name| {
            // a parameter of the effect goes before a variable of the same name
            if let Some(i) = shapes.iter().position(|s| s == name) {
                Ok(Origin::Shape(i))
            } else if let Some(i) = VARIABLES.iter().position(|v| v == name) {
                Ok(Origin::State(i))
            } else {
                let own = if shapes.is_empty() { String::new() } else { format!("; parameters: {}", shapes.join(" ")) };
                Err(format!(
                    "unknown word {name:?} (variables: {}{own}; functions: {})",
                    VARIABLES.join(" "),
                    FUNCTIONS.join(" ")
                ))
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(name: &str, value: f64) -> State {
        let mut state = [0.0; VARIABLES.len()];
        state[VARIABLES.iter().position(|v| *v == name).unwrap()] = value;
        state
    }

    #[test]
    fn many_values_are_those_of_each() {
        let formula = Formula::parse("atan2(B, -1) * exp(-t / tau)", &["tau"]).unwrap();
        // 0 and -0 are two angles to atan2; the same state comes again, and later
        let states: Vec<State> = [(0.0, 1.0), (0.0, 1.0), (-0.0, 1.0), (-0.0, 2.0), (0.5, 2.0), (0.0, 1.0)]
            .map(|(b, t)| {
                let mut state = at("B", b);
                state[slot::HOURS] = t;
                state
            })
            .to_vec();
        let each: Vec<u64> = states.iter().map(|s| formula.eval(s, &[3.0]).to_bits()).collect();
        let used = States::new(std::iter::once(&formula), states.iter());
        let all: Vec<u64> = formula.eval_each(&used, 0..6, &[3.0]).into_iter().map(f64::to_bits).collect();
        assert_eq!(all, each);
        assert_ne!(each[1], each[2]);
        // a bare number, and a shape that nobody gave
        assert_eq!(Formula::parse("2", &[]).unwrap().eval_each(&used, 0..6, &[]), [2.0; 6]);
        assert!(formula.eval_each(&used, 0..6, &[]).iter().all(|v| v.is_nan()));
        // some of them, in any order
        let some: Vec<u64> =
            formula.eval_each(&used, [4, 2].into_iter(), &[3.0]).into_iter().map(f64::to_bits).collect();
        assert_eq!(some, [each[4], each[2]]);
    }

    #[test]
    fn documented_functions_are_understood() {
        for (text, b, expected) in [
            ("1 - cos(B)", 0.5, 1.0 - 0.5f64.cos()),
            ("mod(B, 0.3)", 0.5, 0.2),
            ("step(B - 1)", 0.5, 0.0),
            ("sign(B) * abs(sin(2*B))", -0.5, -(1.0f64.sin())),
            ("atan2(B, 1) + floor(1.7) + 2^3", 0.5, 0.5f64.atan2(1.0) + 9.0),
            ("sqrt(exp(ln(4)))", 0.0, 2.0),
        ] {
            let value = Formula::parse(text, &[]).unwrap().eval(&at("B", b), &[]);
            assert!((value - expected).abs() < 1e-14, "{text}: {value}");
        }
    }

    #[test]
    fn every_function_is_known() {
        for function in FUNCTIONS {
            let second = if matches!(function, "atan2" | "mod") { ", 0.7" } else { "" };
            let value = Formula::parse(&format!("{function}(B{second})"), &[]).unwrap().eval(&at("B", 0.3), &[]);
            let x: f64 = 0.3;
            let expected = match function {
                "sin" => x.sin(),
                "cos" => x.cos(),
                "tan" => x.tan(),
                "asin" => x.asin(),
                "acos" => x.acos(),
                "atan" => x.atan(),
                "atan2" => x.atan2(0.7),
                "exp" => x.exp(),
                "ln" => x.ln(),
                "sqrt" => x.sqrt(),
                "floor" => 0.0,
                "sign" | "step" => 1.0,
                "abs" | "mod" => x,
                _ => panic!("{function} has no value to compare with"),
            };
            assert_eq!(value, expected, "{function}");
        }
    }

    #[test]
    fn mistakes_are_named() {
        assert!(Formula::parse("1 - cos(Q)", &[]).unwrap_err().contains("\"Q\""));
        assert!(Formula::parse("sinh(B)", &[]).is_err());
        assert!(Formula::parse("1 +", &[]).is_err());
        assert!(Formula::parse("", &[]).is_err());
    }

    #[test]
    fn numbers_may_have_exponents() {
        for (text, expected) in [("1e-3", 1e-3), ("2.5E+2 * 1", 250.0), (".5e1", 5.0), ("B*1e3", 500.0)] {
            let value = Formula::parse(text, &[]).unwrap().eval(&at("B", 0.5), &[]);
            assert!((value - expected).abs() < 1e-12, "{text}: {value}");
        }
        assert!(Formula::parse("1e999", &[]).unwrap_err().contains("too large"));
        assert!(Formula::parse("sine(B)", &[]).unwrap_err().contains("unknown function \"sine\""));
    }

    #[test]
    fn shape_parameters_have_derivatives() {
        let f = Formula::parse("1 - exp(-t/tau)", &["tau"]).unwrap();
        let (state, tau) = (at("t", 0.7), 0.4);
        let (which, derivative) = f.partials(&state, &[tau]).next().unwrap();
        assert_eq!(which, 0);
        let expected = -(-0.7f64 / tau).exp() * 0.7 / (tau * tau);
        assert!((derivative - expected).abs() < 1e-12);
    }

    /// A table that Python computed (tests/formulas/make.py).
    fn table(text: &str) -> (serde_json::Value, Vec<(String, f64)>) {
        let table: serde_json::Value = serde_json::from_str(text).unwrap();
        let row = |r: &serde_json::Value| (r["formula"].as_str().unwrap().to_owned(), r["value"].as_f64().unwrap());
        let rows = table["rows"].as_array().unwrap().iter().map(row).collect();
        (table, rows)
    }

    fn state_of(variables: &serde_json::Value) -> State {
        let mut state = [0.0; VARIABLES.len()];
        for (name, value) in variables.as_object().unwrap() {
            state[VARIABLES.iter().position(|v| v == name).unwrap()] = value.as_f64().unwrap();
        }
        state
    }

    #[test]
    fn formulas_have_the_values_that_python_computes() {
        let (table, rows) = table(include_str!("../../tests/formulas/expressions.json"));
        let state = state_of(&table["variables"]);
        assert_eq!(rows.len(), 300);
        let mut wrong = Vec::new();
        for (text, expected) in rows {
            let value = Formula::parse(&text, &[]).unwrap_or_else(|e| panic!("{text}: {e}")).eval(&state, &[]);
            if (value - expected).abs() > 1e-9 * expected.abs().max(1.0) {
                wrong.push(format!("{text}: {value}, and {expected} in Python"));
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }

    #[test]
    fn built_in_formulas_have_the_values_that_python_computes() {
        let (table, rows) = table(include_str!("../../tests/formulas/built_in.json"));
        let state = state_of(&table["variables"]);
        let shapes = table["shapes"].as_object().unwrap();
        let names: Vec<&str> = shapes.keys().map(String::as_str).collect();
        let values: Vec<f64> = shapes.values().map(|v| v.as_f64().unwrap()).collect();
        for (text, expected) in &rows {
            let value = Formula::parse(text, &names).unwrap().eval(&state, &values);
            assert!((value - expected).abs() <= 1e-9 * expected.abs().max(1.0), "{text}: {value} {expected}");
        }
    }
}
