//! What a formula computes: its text as a flat list of steps (postfix notation).
//!
//! Nothing here calls itself, so that no formula can exhaust the stack.

use super::dual_number::Dual;
use super::formula_parser::{Steps, fold};
use super::operators::{One, Two, Value, constant};

/// Variables of a formula at most: their values fit on the stack.
pub(super) const MOST_VARIABLES: usize = 32;

/// A function of named variables.
#[derive(Debug)]
pub(super) struct Expression {
    steps: Vec<Step>,
    /// Names of the variables, sorted.
    variables: Vec<String>,
    /// Values that wait at the same time, at most.
    most_waiting: usize,
}

/// A step. It takes its values from the end of those that wait, and puts its result there.
#[derive(Debug, Clone, Copy)]
enum Step {
    Number(f64),
    Variable(usize),
    One(One),
    Two(Two),
}

impl Expression {
    /// Reads a text; `None` where it is no formula.
    pub(super) fn read(text: &str) -> Option<Self> {
        let written = fold::<Written>(text).ok()?.0;
        let names = written.iter().filter_map(|step| if let Word::Name(name) = step { Some(name) } else { None });
        let mut variables: Vec<String> = names.cloned().collect();
        variables.sort_unstable();
        variables.dedup();
        let step = |word: &Word| {
            Some(match word {
                Word::Step(step) => *step,
                Word::Name(name) => Step::Variable(variables.binary_search(name).ok()?),
                Word::Unknown => return None,
            })
        };
        let steps = written.iter().map(step).collect::<Option<Vec<Step>>>()?;
        let most_waiting = most_waiting(&steps);
        Some(Self { steps, variables, most_waiting })
    }

    /// Names of its variables, in the order in which it takes their values.
    pub(super) fn variables(&self) -> Vec<&str> {
        self.variables.iter().map(String::as_str).collect()
    }

    /// Its derivative by one of its variables, a parameter of the effect.
    pub(super) fn derivative(&self, at: usize, variables: &[f64]) -> f64 {
        let mut duals = [Dual::number(0.0); MOST_VARIABLES];
        let duals = &mut duals[..variables.len()];
        for (i, (dual, value)) in duals.iter_mut().zip(variables).enumerate() {
            *dual = if i == at { Dual::variable(*value) } else { Dual::number(*value) };
        }
        self.value(duals).slope
    }

    /// Its value, not a number where it has none.
    pub(super) fn value<V: Value>(&self, variables: &[V]) -> V {
        /// Values that wait in usual formulas.
        const USUAL: usize = 16;
        let zero = V::number(0.0);
        if self.most_waiting <= USUAL {
            self.run(variables, &mut [zero; USUAL])
        } else {
            self.run(variables, &mut vec![zero; self.most_waiting])
        }
    }

    /// Its values where each variable has many, `count` of them: each step is taken for all of them at once.
    pub(super) fn values(&self, variables: &[Vec<f64>], count: usize) -> Vec<f64> {
        let mut waiting: Vec<Vec<f64>> = Vec::with_capacity(self.most_waiting);
        for step in &self.steps {
            match *step {
                Step::Number(value) => waiting.push(vec![value; count]),
                Step::Variable(at) => waiting.push(variables[at].clone()),
                Step::One(of) => waiting.last_mut().into_iter().flatten().for_each(|value| *value = of.at(*value)),
                Step::Two(of) => {
                    let right = waiting.pop().unwrap_or_default();
                    let left = waiting.last_mut().into_iter().flatten();
                    left.zip(right).for_each(|(value, right)| *value = of.at(*value, right));
                }
            }
        }
        waiting.pop().unwrap_or_default()
    }

    /// Takes the steps, with room for the values that wait.
    fn run<V: Value>(&self, variables: &[V], waiting: &mut [V]) -> V {
        let mut count = 0;
        for step in &self.steps {
            match *step {
                Step::Number(value) => {
                    waiting[count] = V::number(value);
                    count += 1;
                }
                Step::Variable(at) => {
                    waiting[count] = variables[at];
                    count += 1;
                }
                Step::One(of) => waiting[count - 1] = waiting[count - 1].one(of),
                Step::Two(of) => {
                    count -= 1;
                    waiting[count - 1] = waiting[count - 1].two(of, waiting[count]);
                }
            }
        }
        waiting[0]
    }
}

fn most_waiting(steps: &[Step]) -> usize {
    let (mut count, mut most) = (0_usize, 0);
    for step in steps {
        match step {
            Step::Number(_) | Step::Variable(_) => count += 1,
            Step::One(_) => {}
            Step::Two(_) => count = count.saturating_sub(1),
        }
        most = most.max(count);
    }
    most
}

/// The steps of a part of a formula while it is read.
struct Written(Vec<Word>);

enum Word {
    Step(Step),
    /// A variable, which has no number yet.
    Name(String),
    /// A function that does not exist.
    Unknown,
}

impl Written {
    fn then(mut self, step: Step) -> Self {
        self.0.push(Word::Step(step));
        self
    }
}

impl Steps for Written {
    fn number(value: f64) -> Self {
        Self(vec![Word::Step(Step::Number(value))])
    }

    fn word(name: &str) -> Self {
        Self(vec![constant(name).map_or_else(|| Word::Name(name.to_owned()), |value| Word::Step(Step::Number(value)))])
    }

    fn negative(self) -> Self {
        self.then(Step::One(One::Negative))
    }

    fn operator(mut self, sign: char, right: Self) -> Self {
        self.0.extend(right.0);
        self.then(Step::Two(Two::operator(sign)))
    }

    fn call(name: &str, arguments: Vec<Self>) -> Self {
        let step = match arguments.len() {
            1 => One::named(name).map(Step::One),
            _ => Two::named(name).map(Step::Two),
        };
        let mut all: Vec<Word> = arguments.into_iter().flat_map(|argument| argument.0).collect();
        all.push(step.map_or(Word::Unknown, Word::Step));
        Self(all)
    }

    fn in_brackets(self) -> Self {
        self
    }
}
