//! The built-in catalogue is read once, while the program is built: `effects.toml`, row by row, as MessagePack, which a process
//! reads in a tenth of the time, and its formulas as program text. Nothing is changed here, and nothing is checked but that a formula can
//! be read: tests compare what comes of both with what a user's file becomes (`model::catalogue`).

#[path = "src/model/spelling.rs"]
mod spelling;
#[path = "src/model/words.rs"]
mod words;

use exmex::prelude::*;
use exmex::{MakeOperators, Operator};
use spelling::{bare_number, spelled_out};
use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Write as _;
use std::num::ParseFloatError;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::path::PathBuf;
use std::str::FromStr;
use words::{Value, operators};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/model/spelling.rs");
    println!("cargo::rerun-if-changed=src/model/words.rs");
    println!("cargo::rerun-if-changed=effects.toml");
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    let file: toml::Table = toml::from_str(&std::fs::read_to_string("effects.toml")?)?;
    let rows = file.get("effect").and_then(toml::Value::as_array).ok_or("effects.toml has no [[effect]]")?;
    let (mut bytes, mut ends) = (Vec::new(), Vec::new());
    for row in rows {
        let id = row.get("id").and_then(toml::Value::as_str).ok_or("a row of effects.toml has no id")?;
        bytes.extend(rmp_serde::to_vec_named(row)?);
        ends.push((id, bytes.len()));
    }
    std::fs::write(out.join("effects.msgpack"), &bytes)?;
    std::fs::write(out.join("effects_ends.rs"), format!("&{ends:?}"))?;
    std::fs::write(out.join("formulas.rs"), formulas(rows)?)?;
    Ok(())
}

/// Every formula of the rows, in the order of their texts, as `model::expression::BUILT_IN` has them.
fn formulas(rows: &[toml::Value]) -> Result<String, Box<dyn Error>> {
    let all = |list, word| {
        let entries = rows.iter().filter_map(move |row| row.get(list)?.as_array()).flatten();
        entries.filter_map(move |entry| entry.get(word)?.as_str()).collect::<BTreeSet<&str>>()
    };
    let shapes = all("shape", "parameter");
    let mut out = String::from("&[");
    for text in all("terms", "formula") {
        if bare_number(text).is_some() {
            continue;
        }
        let not_read = |says: &str| format!("effects.toml: formula {text:?}: {says}");
        let plain = spelled_out(text).map_err(|says| not_read(&says))?;
        let flat = Flat::parse(&plain).map_err(|e| not_read(e.msg()))?;
        let variables = flat.var_names();
        let place = |name: &String| variables.iter().position(|own| own == name);
        // the crate takes every step of the formula, and each writes itself down
        let body = |flat: &Flat| -> Option<String> {
            let values = flat.var_names().iter().map(|name| Some(Code::text(format!("v[{}]", place(name)?))));
            let Code { code, .. } = flat.eval(&values.collect::<Option<Vec<_>>>()?).ok()?;
            Some(format!("|{}| {code}", if code.contains("v[") { "v" } else { "_" }))
        };
        let derivative = |at: usize| {
            let is_shape = shapes.contains(variables[at].as_str());
            is_shape.then(|| flat.clone().partial(at).ok().and_then(|of| body(&of))).flatten()
        };
        let value = body(&flat).ok_or_else(|| not_read("it has no value"))?;
        write!(out, "BuiltIn {{ text: {text:?}, variables: &{variables:?}, value: {value}, derivatives: &[")?;
        for at in 0..variables.len() {
            match derivative(at) {
                Some(derivative) => write!(out, "Some({derivative}), ")?,
                None => out.push_str("None, "),
            }
        }
        out.push_str("] },\n");
    }
    out.push(']');
    Ok(out)
}

/// The text of a program that computes a number.
#[derive(Debug, Clone, Default)]
struct Code {
    code: String,
    /// The number itself, where no variable has a part in it: the crate leaves out factors of 1 and summands of 0.
    constant: Option<f64>,
}

impl PartialEq for Code {
    fn eq(&self, other: &Self) -> bool {
        match (self.constant, other.constant) {
            (None, None) => self.code == other.code,
            (one, two) => one == two,
        }
    }
}

type Flat = FlatEx<Code, Words>;

/// The words of formulas, in program text.
#[derive(Debug, Clone)]
struct Words;

impl MakeOperators<Code> for Words {
    fn make<'a>() -> Vec<Operator<'a, Code>> {
        operators()
    }
}

impl Code {
    fn number(value: f64) -> Self {
        let code =
            if value.is_finite() { format!("{value:?}_f64") } else { format!("f64::from_bits({})", value.to_bits()) };
        Self { code, constant: Some(value) }
    }

    fn text(code: String) -> Self {
        Self { code, constant: None }
    }

    /// A step with one number: `of` it where it is known, else its text.
    fn one(self, of: impl Fn(f64) -> f64, text: impl Fn(&str) -> String) -> Self {
        self.constant.map_or_else(|| Self::text(text(&self.code)), |x| Self::number(of(x)))
    }

    /// A step with two.
    fn two(self, other: Self, of: impl Fn(f64, f64) -> f64, text: impl Fn(&str, &str) -> String) -> Self {
        match (self.constant, other.constant) {
            (Some(a), Some(b)) => Self::number(of(a, b)),
            _ => Self::text(text(&self.code, &other.code)),
        }
    }

    fn call(self, name: &str, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        self.two(other, of, |a, b| format!("Value::{name}({a}, {b})"))
    }
}

impl FromStr for Code {
    type Err = ParseFloatError;

    fn from_str(digits: &str) -> Result<Self, ParseFloatError> {
        digits.parse().map(Self::number)
    }
}

impl From<u8> for Code {
    fn from(value: u8) -> Self {
        Self::number(value.into())
    }
}

impl From<f32> for Code {
    fn from(value: f32) -> Self {
        Self::number(value.into())
    }
}

/// Rust's own operators between texts.
macro_rules! between {
    ($($of:ident $method:ident $sign:literal)*) => {$(
        impl $of for Code {
            type Output = Self;

            fn $method(self, other: Self) -> Self {
                self.two(other, |a, b| $of::$method(a, b), |a, b| format!("({a} {} {b})", $sign))
            }
        }
    )*};
}

between! { Add add "+" Sub sub "-" Mul mul "*" Div div "/" }

impl Neg for Code {
    type Output = Self;

    fn neg(self) -> Self {
        self.one(|x| -x, |x| format!("(-{x})"))
    }
}

impl Value for Code {
    fn pi() -> Self {
        Self::number(f64::pi())
    }

    fn power(self, power: Self) -> Self {
        self.call("power", power, Value::power)
    }

    fn atan2(self, x: Self) -> Self {
        self.call("atan2", x, Value::atan2)
    }

    fn modulo(self, period: Self) -> Self {
        self.call("modulo", period, Value::modulo)
    }

    fn sign(self) -> Self {
        self.one(Value::sign, |x| format!("Value::sign({x})"))
    }

    fn step(self) -> Self {
        self.one(Value::step, |x| format!("Value::step({x})"))
    }

    fn function(self, name: &'static str, of: fn(f64) -> f64) -> Self {
        self.one(of, |x| format!("f64::{name}({x})"))
    }
}
