//! What a formula computes: a built-in one as machine code that was made of it when the program was built, any other as the expression
//! crate reads it.
//!
//! Both come of the same crate, the same words and the same steps in the same order (`build.rs`); a test holds their values together.

use super::words::{Value, operators};
use exmex::prelude::*;
use exmex::{MakeOperators, Operator};
use std::sync::{LazyLock, OnceLock};

/// A function of the variables of an expression.
type Compiled = fn(&[f64]) -> f64;

/// A built-in formula.
#[derive(Debug)]
pub(super) struct BuiltIn {
    text: &'static str,
    variables: &'static [&'static str],
    value: Compiled,
    /// By variable: where it may be a parameter of the effect, and there is a derivative.
    derivatives: &'static [Option<Compiled>],
}

/// All of them, in the order of their texts.
#[allow(clippy::all, unused_parens)] // machine-made
static BUILT_IN: &[BuiltIn] = include!(concat!(env!("OUT_DIR"), "/formulas.rs"));

/// The words that a formula may use.
#[derive(Clone, Debug)]
pub(super) struct Words;

/// Made once: the expression crate asks for them several times for each formula.
static WORDS: LazyLock<Vec<Operator<'static, f64>>> = LazyLock::new(operators);

impl MakeOperators<f64> for Words {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        WORDS.clone()
    }
}

type Flat = FlatEx<f64, Words>;

/// An expression that somebody wrote.
#[derive(Debug)]
pub(super) struct Read {
    flat: Flat,
    /// By variable: made when somebody asks for it, which takes longer than the formula itself.
    derivatives: Vec<OnceLock<Option<Derivative>>>,
}

/// A derivative, and which of the expression's variables its own are.
#[derive(Debug)]
struct Derivative {
    flat: Flat,
    variables: Vec<usize>,
}

impl Read {
    fn derivative(&self, at: usize) -> Option<&Derivative> {
        let make = || {
            let flat = self.flat.clone().partial(at).ok()?;
            let of_name = |name: &String| self.flat.var_names().iter().position(|own| own == name);
            let variables = flat.var_names().iter().map(of_name).collect::<Option<Vec<_>>>()?;
            Some(Derivative { flat, variables })
        };
        self.derivatives.get(at)?.get_or_init(make).as_ref()
    }
}

/// A function of named variables.
#[derive(Debug)]
pub(super) enum Expression {
    /// Of the catalogue.
    BuiltIn(&'static BuiltIn),
    /// Of a user's file. As the crate has it, it is large (twenty kilobytes, whatever stands in it).
    Read(Box<Read>),
}

impl Expression {
    /// A built-in one by its text.
    pub(super) fn built_in(text: &str) -> Option<Self> {
        let found = BUILT_IN.binary_search_by(|formula| formula.text.cmp(text)).ok()?;
        Some(Self::BuiltIn(&BUILT_IN[found]))
    }

    /// Reads a text; `None` where the crate does not understand it.
    pub(super) fn read(text: &str) -> Option<Self> {
        let flat = Flat::parse(text).ok()?;
        let derivatives = flat.var_names().iter().map(|_| OnceLock::new()).collect();
        Some(Self::Read(Box::new(Read { flat, derivatives })))
    }

    /// Names of its variables, in the order in which it takes their values.
    pub(super) fn variables(&self) -> Vec<&str> {
        match self {
            Self::BuiltIn(formula) => formula.variables.to_vec(),
            Self::Read(read) => read.flat.var_names().iter().map(String::as_str).collect(),
        }
    }

    /// Its value, not a number where it has none.
    pub(super) fn value(&self, variables: &[f64]) -> f64 {
        match self {
            Self::BuiltIn(formula) => (formula.value)(variables),
            Self::Read(read) => read.flat.eval(variables).unwrap_or(f64::NAN),
        }
    }

    /// Its derivative with respect to one of its variables, a parameter of the effect; `None` where the crate cannot differentiate it
    /// (`floor`, `step`, …).
    pub(super) fn derivative(&self, at: usize, variables: &[f64]) -> Option<f64> {
        match self {
            Self::BuiltIn(formula) => formula.derivatives.get(at).copied().flatten().map(|of| of(variables)),
            Self::Read(read) => {
                let of = read.derivative(at)?;
                let own: Vec<f64> = of.variables.iter().map(|&i| variables[i]).collect();
                Some(of.flat.eval(&own).unwrap_or(f64::NAN))
            }
        }
    }
}
