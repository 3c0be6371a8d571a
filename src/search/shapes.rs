//! The dictionary of shapes: each with its value at a touch, on a curve, and as a formula of the effects file.

use super::generic::{Features, Kind};
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

    /// Text in the formula language; `free` writes the scanned number as a shape parameter of that name. `None` where
    /// formulas have no word for it.
    pub fn formula(&self, features: &Features, free: Option<&str>) -> Option<String> {
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
            Self::Product(a, b) => format!("({})*({})", a.formula(features, None)?, b.formula(features, None)?),
            Self::Along { of, .. } => return of.formula(features, free),
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
    use super::super::generic::Variable;
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
            let text = function.formula(&features, None).unwrap();
            let value = Formula::parse(&text, &[]).unwrap().eval(&state, &[]);
            assert!((value - function.at_row(&features, 0)).abs() < 1e-12, "{text}: {value}");
            if let Some((name, _, start)) = function.free_parameter(&features) {
                let text = function.formula(&features, Some(name)).unwrap();
                let value = Formula::parse(&text, &[name]).unwrap().eval(&state, &[start]);
                assert!((value - function.at_row(&features, 0)).abs() < 1e-12, "{text}");
            }
        }
    }
}
