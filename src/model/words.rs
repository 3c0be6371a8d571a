//! The words of formulas: what may stand between variables and numbers, and what it means.
//!
//! Generic in what a formula is worth: for the program that is a number. `build.rs` shares this file and evaluates the built-in
//! formulas in program text.

use exmex::{BinOp, Operator};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// What the words of a formula can be applied to.
pub trait Value:
    Clone + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The ratio of a circle's circumference to its diameter.
    fn pi() -> Self;
    /// `self ^ power`
    fn power(self, power: Self) -> Self;
    /// Angle of the direction (x, self).
    fn atan2(self, x: Self) -> Self;
    /// What is left of `self` after whole periods, with the period's sign.
    fn modulo(self, period: Self) -> Self;
    /// -1, 0 or 1.
    fn sign(self) -> Self;
    /// 0 below 0, else 1.
    fn step(self) -> Self;
    /// A function that numbers have already, with its name there.
    fn function(self, name: &'static str, of: fn(f64) -> f64) -> Self;
}

impl Value for f64 {
    fn pi() -> Self {
        std::f64::consts::PI
    }

    fn power(self, power: Self) -> Self {
        self.powf(power)
    }

    fn atan2(self, x: Self) -> Self {
        self.atan2(x)
    }

    fn modulo(self, period: Self) -> Self {
        self - period * (self / period).floor()
    }

    fn sign(self) -> Self {
        if self == 0.0 { 0.0 } else { self.signum() }
    }

    fn step(self) -> Self {
        if self >= 0.0 { 1.0 } else { 0.0 }
    }

    fn function(self, _name: &'static str, of: fn(f64) -> f64) -> Self {
        of(self)
    }
}

/// The operators of a formula (docs/guide/effects.md). Those that the expression crate has itself have its priorities; `mod`, `sign` and
/// `step` are ours.
#[must_use]
pub fn operators<T: Value>() -> Vec<Operator<'static, T>> {
    fn binary<T: Value>(
        word: &'static str,
        prio: i64,
        is_commutative: bool,
        apply: fn(T, T) -> T,
    ) -> Operator<'static, T> {
        Operator::make_bin(word, BinOp { apply, prio, is_commutative })
    }
    fn signed<T: Value>(
        word: &'static str,
        prio: i64,
        is_commutative: bool,
        apply: fn(T, T) -> T,
        of_one: fn(T) -> T,
    ) -> Operator<'static, T> {
        Operator::make_bin_unary(word, BinOp { apply, prio, is_commutative }, of_one)
    }
    macro_rules! function {
        ($name:ident) => {
            Operator::make_unary(stringify!($name), |x: T| x.function(stringify!($name), f64::$name))
        };
    }
    vec![
        binary("^", 4, false, T::power),
        binary("*", 2, true, |a, b| a * b),
        binary("/", 3, false, |a, b| a / b),
        signed("+", 0, true, |a, b| a + b, |a| a),
        signed("-", 1, false, |a, b| a - b, |a| -a),
        binary("atan2", 0, false, T::atan2),
        binary("mod", 4, false, T::modulo),
        Operator::make_unary("sign", T::sign),
        Operator::make_unary("step", T::step),
        function!(sin),
        function!(cos),
        function!(tan),
        function!(asin),
        function!(acos),
        function!(atan),
        function!(exp),
        function!(ln),
        function!(sqrt),
        function!(abs),
        function!(floor),
        Operator::make_constant("pi", T::pi()),
        Operator::make_constant("PI", T::pi()),
    ]
}
