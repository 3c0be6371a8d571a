//! The dictionary of shapes: each with its value at a touch, on a curve, and as a formula of the effects file.

use super::pattern_tests::{Features, Kind};
use std::f64::consts::TAU;

/// A function of one or two variables, or of a group of touches. Variables by index in the feature table.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Function {
    /// 1 everywhere.
    Constant,
    /// ((x − centre)/scale)^k
    Power { variable: usize, centre: f64, scale: f64, k: i32 },
    /// cos(k x) or sin(k x)
    Harmonic { variable: usize, k: u32, sine: bool },
    /// cos(2π x/period) or sin(2π x/period)
    Periodic { variable: usize, period: f64, sine: bool },
    /// 0 below, 1 from `at` on
    Step { variable: usize, at: f64 },
    /// |x − at|/scale
    Kink { variable: usize, at: f64, scale: f64 },
    /// 1 − exp(−(x − from)/constant)
    Exponential { variable: usize, from: f64, constant: f64 },
    /// Product of two functions.
    Product(Box<Function>, Box<Function>),
    /// A function in a direction of its own, where several act at once.
    Along { direction: usize, of: Box<Function> },
    /// 1 on the touches of a group, else 0.
    Member { of: Grouping, number: usize },
}

/// Ways in which touches fall into groups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Grouping {
    Block,
    Face,
    Visit,
    Run,
}

/// A number for a formula: six digits, in parentheses where it is negative.
fn number(x: f64) -> String {
    let digits = if x == 0.0 { 0 } else { (5 - x.abs().log10().floor() as i32).clamp(0, 12) as usize };
    let text = format!("{x:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text.starts_with('-') { format!("({text})") } else { text.to_owned() }
}

impl Function {
    /// Its value at a touch.
    pub fn at_row(&self, features: &Features, row: usize) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Product(a, b) => a.at_row(features, row) * b.at_row(features, row),
            Self::Along { direction, of } => features.directions[*direction].weight[row] * of.at_row(features, row),
            Self::Member { of, number } => {
                let groups = match of {
                    Grouping::Block => &features.block,
                    Grouping::Face => &features.face,
                    Grouping::Visit => &features.visit,
                    Grouping::Run => &features.run,
                };
                f64::from(u8::from(groups.get(row) == Some(number)))
            }
            _ => self.variable().map_or(0.0, |v| self.at(features.variables[v].values[row])),
        }
    }

    /// Its value at a value of its variable, on the touches of its group where it is of one.
    pub fn at(&self, x: f64) -> f64 {
        match *self {
            Self::Power { centre, scale, k, .. } => ((x - centre) / scale).powi(k),
            Self::Harmonic { k, sine, .. } => wave(f64::from(k) * x, sine),
            Self::Periodic { period, sine, .. } => wave(TAU * x / period, sine),
            Self::Step { at, .. } => f64::from(u8::from(x >= at)),
            Self::Kink { at, scale, .. } => (x - at).abs() / scale,
            Self::Exponential { from, constant, .. } => 1.0 - (-(x - from) / constant).exp(),
            Self::Along { ref of, .. } => of.at(x),
            Self::Product(ref a, ref b) => a.at(x) * b.at(x),
            Self::Constant | Self::Member { .. } => 1.0,
        }
    }

    /// The group of touches that it is of.
    pub fn group(&self) -> Option<(Grouping, usize)> {
        match self {
            Self::Member { of, number } => Some((*of, *number)),
            Self::Along { of, .. } => of.group(),
            Self::Product(a, b) => a.group().or_else(|| b.group()),
            _ => None,
        }
    }

    fn variable(&self) -> Option<usize> {
        match *self {
            Self::Power { variable, .. }
            | Self::Harmonic { variable, .. }
            | Self::Periodic { variable, .. }
            | Self::Step { variable, .. }
            | Self::Kink { variable, .. }
            | Self::Exponential { variable, .. } => Some(variable),
            Self::Along { ref of, .. } => of.variable(),
            Self::Constant | Self::Product(..) | Self::Member { .. } => None,
        }
    }

    /// Text in the formula language, 0 at the home position (all axes at 0): a part that is there at home is a location error,
    /// and an effect that held it would move that. `free` writes the scanned number as a shape parameter of that name.
    /// `None` where formulas have no word for it.
    pub fn formula(&self, features: &Features, free: Option<&str>) -> Option<String> {
        let less_home = |of: &Self| -> Option<String> {
            let text = of.as_it_is(features, free)?;
            Some(match of.at_home(features, free) {
                Some(home) if home != "0" => format!("{text} - {home}"),
                _ => text,
            })
        };
        match self {
            Self::Along { of, .. } => of.formula(features, free),
            // what does not depend on axes multiplies the part that does, less its value at home
            Self::Product(a, b) if a.of_axes(features) != b.of_axes(features) => {
                Some(format!("({})*({})", a.formula(features, None)?, b.formula(features, None)?))
            }
            of => less_home(of),
        }
    }

    /// Is it a function of axis positions alone?
    fn of_axes(&self, features: &Features) -> bool {
        match self {
            Self::Product(a, b) => a.of_axes(features) && b.of_axes(features),
            _ => self.variable().is_some_and(|v| matches!(features.variables[v].kind, Kind::Linear | Kind::Rotary)),
        }
    }

    /// Its value at the home position, for a formula; `None` where that is no number: it does not depend on axes alone.
    fn at_home(&self, features: &Features, free: Option<&str>) -> Option<String> {
        if !self.of_axes(features) {
            return None;
        }
        Some(match (self, free) {
            (Self::Kink { scale, .. }, Some(name)) => format!("abs({name})/{}", number(*scale)),
            _ => number(self.value_at_home() + 0.0),
        })
    }

    fn value_at_home(&self) -> f64 {
        match self {
            Self::Product(a, b) => a.value_at_home() * b.value_at_home(),
            _ => self.at(0.0),
        }
    }

    /// Text in the formula language, as [`Self::at`] has it.
    fn as_it_is(&self, features: &Features, free: Option<&str>) -> Option<String> {
        let word = |v: usize| features.variables[v].word.clone();
        let given = |x: f64| free.map_or_else(|| number(x), str::to_owned);
        let less = |word: String, x: f64| if x == 0.0 { word } else { format!("({word} - {})", number(x)) };
        Some(match self {
            Self::Constant => "1".to_owned(),
            Self::Power { variable, centre, scale, k } => {
                let of = format!("{}/{}", less(word(*variable)?, *centre), number(*scale));
                if *k == 1 { of } else { format!("({of})^{k}") }
            }
            Self::Harmonic { variable, k, sine } => {
                let name = if *sine { "sin" } else { "cos" };
                let w = word(*variable)?;
                if *k == 1 { format!("{name}({w})") } else { format!("{name}({k}*{w})") }
            }
            Self::Periodic { variable, period, sine } => {
                let name = if *sine { "sin" } else { "cos" };
                format!("{name}(2*pi*{}/{})", word(*variable)?, given(*period))
            }
            Self::Step { variable, at } => format!("step({} - {})", word(*variable)?, number(*at)),
            Self::Kink { variable, at, scale } => {
                format!("abs({} - {})/{}", word(*variable)?, given(*at), number(*scale))
            }
            Self::Exponential { variable, from, constant } => {
                format!("1 - exp(0 - {}/{})", less(word(*variable)?, *from), given(*constant))
            }
            Self::Product(a, b) => format!("({})*({})", a.as_it_is(features, None)?, b.as_it_is(features, None)?),
            Self::Along { of, .. } => return of.as_it_is(features, free),
            Self::Member { .. } => return None,
        })
    }

    /// The number that a scan found, as a shape parameter: name, unit, start. None where a formula's derivative by it
    /// would not be one (steps), or where nothing was scanned.
    pub fn free_parameter(&self, features: &Features) -> Option<(&'static str, &'static str, f64)> {
        match *self {
            Self::Periodic { variable, period, .. } => {
                Some(("period", features.variables[variable].kind.unit(), period))
            }
            Self::Exponential { variable, constant, .. } => {
                Some(("tau", features.variables[variable].kind.unit(), constant))
            }
            Self::Kink { variable, at, .. } if features.variables[variable].kind == Kind::Linear => {
                Some(("corner", "mm", at))
            }
            _ => None,
        }
    }
}

fn wave(x: f64, sine: bool) -> f64 {
    if sine { x.sin() } else { x.cos() }
}

#[cfg(test)]
mod tests {
    use super::super::pattern_tests::Variable;
    use super::*;
    use crate::model::formula::{Formula, State, VARIABLES};

    #[test]
    fn formulas_have_the_values_of_their_shapes() {
        let (b, x, t) = (-0.7, 33.25, 1.3);
        let features = Features {
            variables: vec![
                Variable::new("B", Kind::Rotary, vec![b]),
                Variable::new("X", Kind::Linear, vec![x]),
                Variable::new("t", Kind::Time, vec![t]),
            ],
            ..Features::default()
        };
        let mut state: State = [0.0; VARIABLES.len()];
        for (name, value) in [("B", b), ("X", x), ("t", t)] {
            state[VARIABLES.iter().position(|v| *v == name).unwrap()] = value;
        }
        let x_power = Function::Power { variable: 1, centre: -12.5, scale: 150.0, k: 3 };
        for function in [
            x_power.clone(),
            Function::Power { variable: 1, centre: 0.0, scale: 150.0, k: 1 },
            Function::Harmonic { variable: 0, k: 7, sine: true },
            Function::Harmonic { variable: 0, k: 1, sine: false },
            Function::Periodic { variable: 2, period: 0.15, sine: true },
            Function::Step { variable: 0, at: -0.75 },
            Function::Kink { variable: 1, at: -20.0, scale: 100.0 },
            Function::Exponential { variable: 2, from: 0.25, constant: 0.5 },
            Function::Product(Box::new(x_power), Box::new(Function::Harmonic { variable: 0, k: 2, sine: false })),
        ] {
            let home: State = [0.0; VARIABLES.len()];
            let of_axes = function.of_axes(&features);
            let level = if of_axes { function.value_at_home() } else { 0.0 };
            let text = function.formula(&features, None).unwrap();
            let formula = Formula::parse(&text, &[]).unwrap();
            let value = formula.eval(&state, &[]);
            // six digits of what it is at home
            assert!(
                (value - function.at_row(&features, 0) + level).abs() < 1e-5 * level.abs().max(1e-7),
                "{text}: {value}"
            );
            assert!(!of_axes || formula.eval(&home, &[]).abs() < 1e-5, "{text}");
            if let Some((name, _, start)) = function.free_parameter(&features) {
                let text = function.formula(&features, Some(name)).unwrap();
                let formula = Formula::parse(&text, &[name]).unwrap();
                let value = formula.eval(&state, &[start]);
                assert!((value - function.at_row(&features, 0) + level).abs() < 1e-12, "{text}");
                assert!(!of_axes || formula.eval(&home, &[start]).abs() < 1e-12, "{text}");
            }
        }
    }

    #[test]
    fn what_depends_on_an_axis_is_nothing_at_home() {
        let features = Features {
            variables: vec![
                Variable::new("C", Kind::Rotary, vec![2.0]),
                Variable::new("X", Kind::Linear, vec![50.0]),
                Variable::new("t", Kind::Time, vec![1.3]),
            ],
            ..Features::default()
        };
        let cos = || Box::new(Function::Harmonic { variable: 0, k: 2, sine: false });
        let far = || Box::new(Function::Power { variable: 1, centre: 100.0, scale: 50.0, k: 2 });
        let hours = || Box::new(Function::Exponential { variable: 2, from: 0.5, constant: 2.0 });
        for (function, expected) in [
            (*cos(), "cos(2*C) - 1"),
            (*far(), "((X - 100)/50)^2 - 4"),
            (Function::Product(cos(), far()), "(cos(2*C))*(((X - 100)/50)^2) - 4"),
            // what changes with the time keeps its own level
            (Function::Product(cos(), hours()), "(cos(2*C) - 1)*(1 - exp(0 - (t - 0.5)/2))"),
            (*hours(), "1 - exp(0 - (t - 0.5)/2)"),
            (Function::Step { variable: 0, at: -1.0 }, "step(C - (-1)) - 1"),
            (Function::Step { variable: 0, at: 1.0 }, "step(C - 1)"),
            (Function::Harmonic { variable: 0, k: 3, sine: true }, "sin(3*C)"),
        ] {
            assert_eq!(function.formula(&features, None).as_deref(), Some(expected));
        }
        let corner = Function::Kink { variable: 1, at: 20.0, scale: 100.0 };
        assert_eq!(corner.formula(&features, Some("corner")).as_deref(), Some("abs(X - corner)/100 - abs(corner)/100"));
    }
}
