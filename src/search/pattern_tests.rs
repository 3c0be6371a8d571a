//! Generic shapes: what the misfit might depend on, where no effect has a name for it.
//!
//! From a plain table of what is known of each touch come polynomials, harmonics, a periodogram of each rotary axis by
//! order and of time by frequency, steps, kinks, exponentials, products of two variables, and groups that disagree:
//! all as candidates of the same tests, a scan as the variants of one candidate.

use super::library::{Library, Origin, Variant};
use super::shapes::{Function, Grouping};
use nalgebra::{DMatrix, Vector3};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Highest order of a rotary axis that is looked for.
pub const ORDERS: u32 = 12;

/// Most lobes of a probe that are looked for.
const LOBES: u32 = 8;

/// Up to so many angles, no polynomial says more than waves do.
const FEW_ANGLES: usize = 4;

/// Most frequencies of the periodogram in time.
const FREQUENCIES: usize = 120;

/// Most places of a step or kink along an axis, and of a step in time.
const PLACES: usize = 12;
const CHANGE_POINTS: usize = 48;

/// Most moments at which one block moves.
const BLOCK_CHANGE_POINTS: usize = 24;

/// Most groups that get a constant each.
const GROUPS: usize = 40;

/// What a shape depends on that is the same at every touch.
pub const CONSTANT: &str = "constant";

/// What kind of quantity a variable is: it decides which shapes are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Position of a linear axis, mm.
    Linear,
    /// Position of a rotary axis, rad.
    Rotary,
    /// Hours since the first touch.
    Time,
    /// Temperature, °C.
    Temperature,
    /// Angle of approach in the probe's frame, rad.
    Approach,
    /// Anything else: sense of motion, feed, tool length, pose before.
    Plain,
}

impl Kind {
    /// Its unit in an effects file.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Linear => "mm",
            Self::Rotary | Self::Approach | Self::Plain => "1",
            Self::Time => "h",
            Self::Temperature => "1",
        }
    }
}

/// A variable with its value at each touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Name for people.
    pub name: String,
    /// How formulas say it; `None`: they cannot.
    pub word: Option<String>,
    pub kind: Kind,
    /// Values, in the kind's unit.
    pub values: Vec<f64>,
    /// At which touches it can act at all; empty: at all of them. What an axis does wrong moves what that axis carries: a
    /// block beside the turntable sees nothing of it.
    pub acts: Vec<bool>,
}

impl Variable {
    /// A variable that formulas call by its name.
    #[must_use]
    pub fn new(name: impl Into<String>, kind: Kind, values: Vec<f64>) -> Self {
        let name = name.into();
        Self { word: Some(name.clone()), name, kind, values, acts: Vec::new() }
    }

    /// The same, acting at some of the touches only.
    #[must_use]
    pub fn acting(mut self, acts: Vec<bool>) -> Self {
        self.acts = if acts.iter().all(|a| *a) { Vec::new() } else { acts };
        self
    }

    /// Can it act at a touch?
    #[must_use]
    pub fn acts_at(&self, touch: usize) -> bool {
        self.acts.get(touch).is_none_or(|a| *a)
    }

    /// Distinct values where it acts, ascending.
    fn distinct(&self) -> Vec<f64> {
        let here = self.values.iter().enumerate().filter(|(i, v)| v.is_finite() && self.acts_at(*i));
        let mut values: Vec<f64> = here.map(|(_, v)| *v).collect();
        values.sort_by(f64::total_cmp);
        let span = values.last().zip(values.first()).map_or(0.0, |(b, a)| b - a);
        values.dedup_by(|b, a| (*b - *a).abs() <= 1e-6 * span.max(1e-300));
        values
    }
}

/// A direction in which a displacement may act: what one unit of it changes in the gap of each touch.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// Name for people.
    pub name: String,
    /// `at` of an effect that acts so.
    pub at: String,
    /// `dof` of it.
    pub dof: String,
    /// Unit of its size: um, or urad for a turn.
    pub unit: String,
    /// Change of the gap per unit, µm, at each touch.
    pub weight: Vec<f64>,
}

impl Direction {
    /// The machine's three directions (`at`: a linear axis), the carrier's three, and along the approach; from the
    /// outward normals in the machine's frame and in the carrier's.
    #[must_use]
    pub fn of_normals(machine: &[Vector3<f64>], carrier: &[Vector3<f64>], at: &str) -> Vec<Self> {
        let mut out = Vec::new();
        for (frame, at, normals, sign) in [("machine", at, machine, 1.0), ("table", "workpiece", carrier, -1.0)] {
            for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                out.push(Self {
                    name: format!("{frame}-{axis}"),
                    at: at.to_owned(),
                    dof: format!("d{}", axis.to_lowercase()),
                    unit: "um".to_owned(),
                    weight: normals.iter().map(|n| sign * n[i]).collect(),
                });
            }
        }
        out.push(Self {
            name: "approach".to_owned(),
            at: "trigger".to_owned(),
            dof: "r".to_owned(),
            unit: "um".to_owned(),
            weight: vec![1.0; machine.len()],
        });
        out
    }
}

/// What is known of each touch, without a machine: one entry per touch in every list.
#[derive(Debug, Clone, Default)]
pub struct Features {
    /// Variables that the misfit may depend on.
    pub variables: Vec<Variable>,
    /// Directions in which it may act.
    pub directions: Vec<Direction>,
    /// Number of the block.
    pub block: Vec<usize>,
    /// Number of the face.
    pub face: Vec<usize>,
    /// Number of the index visit.
    pub visit: Vec<usize>,
    /// Number of the run.
    pub run: Vec<usize>,
}

/// A generic candidate with what it is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Indices of the variables it is a function of; empty for groups of touches.
    pub variables: Vec<usize>,
    /// What it depends on, in a word: `C`, `t`, `X*B`, `block`, `face`, `visit`.
    pub depends_on: String,
    /// Index of the direction; `None`: each function has its own.
    pub direction: Option<usize>,
    /// One list of functions per variant.
    pub(super) functions: Vec<Vec<Function>>,
}

/// Generic candidates; `shapes[i]` belongs to candidate i of the library.
#[derive(Debug, Clone, Default)]
pub struct Generics {
    /// Candidates; sizes in the unit of their direction.
    pub library: Library,
    pub shapes: Vec<Shape>,
}

impl Generics {
    /// The candidates that do not depend on something.
    #[must_use]
    pub fn without(&self, depends_on: &str) -> Library {
        self.library.most(|c| self.shapes[c].depends_on != depends_on)
    }
}

/// What makes rows of a regression of columns of gaps.
pub trait Rows: Send + Sync {
    /// Rows, those of priors (zeros) included.
    fn count(&self) -> usize;

    /// Whitened rows of columns (touches × columns, µm).
    fn all(&self, columns_um: DMatrix<f64>) -> DMatrix<f64>;
}

/// All generic shapes of a table, as rows of a regression.
#[must_use]
pub fn generics(features: &Arc<Features>, rows: Arc<dyn Rows>) -> Generics {
    let planned = planned(features);
    // columns of one function in all directions follow one another: its values are worked out once for all of them
    let mut ids: HashMap<&str, usize> = HashMap::new();
    let mut order = Vec::new();
    for (place, (id, shape, _, _)) in planned.iter().enumerate() {
        let first = *ids.entry(id).or_insert(place);
        order.extend((0..shape.functions.len()).map(|variant| (first, variant, place)));
    }
    order.sort_unstable();
    let mut spans: Vec<Vec<Range<usize>>> = planned.iter().map(|(_, s, _, _)| vec![0..0; s.functions.len()]).collect();
    let mut made: Vec<(Arc<Shape>, Function)> = Vec::new();
    let bare = |(_, shape, _, _): &Planned| Arc::new(Shape { functions: Vec::new(), ..shape.clone() });
    let bare: Vec<Arc<Shape>> = planned.iter().map(bare).collect();
    for (_, variant, place) in order {
        let own = &planned[place].1.functions[variant];
        spans[place][variant] = made.len()..made.len() + own.len();
        made.extend(own.iter().map(|f| (bare[place].clone(), f.clone())));
    }
    let n_columns = made.len();
    let n_rows = rows.count();
    let names: Vec<String> = features.directions.iter().map(|d| d.name.clone()).collect();
    let features = features.clone();
    // not kept: to get memory for ten thousand columns takes longer than to make them again
    let make = move |numbers: &[usize], at: Option<&[usize]>| -> DMatrix<f64> {
        let white = rows.all(gaps(&features, numbers.iter().map(|&number| &made[number])));
        match at {
            None => white,
            Some(at) => white.select_rows(at),
        }
    };
    let mut library = Library::made(n_rows, n_columns, Arc::new(make));
    let mut shapes = Vec::new();
    for ((id, shape, values, n_scanned), spans) in planned.into_iter().zip(spans) {
        let variants = spans.into_iter().zip(values).map(|(columns, shape)| Variant { shape, columns }).collect();
        let direction = shape.direction.map_or("any", |d| names[d].as_str());
        library.place(format!("{id}:{direction}"), Origin::Generic, variants, n_scanned);
        if shape.direction.is_none() {
            library.expect_last();
        }
        shapes.push(shape);
    }
    Generics { library, shapes }
}

/// What the touches see of one unit of each of some functions, µm.
fn gaps<'a>(features: &Features, wanted: impl ExactSizeIterator<Item = &'a (Arc<Shape>, Function)>) -> DMatrix<f64> {
    let n = features.directions.first().map_or(0, |d| d.weight.len());
    let mut out = DMatrix::zeros(n, wanted.len());
    // values of a function where its variables act
    let mut known: Vec<(&Function, &[usize], Vec<f64>)> = Vec::new();
    for (mut column, (shape, function)) in out.column_iter_mut().zip(wanted) {
        let is_it = |(f, of, _): &(&Function, &[usize], Vec<f64>)| *f == function && *of == shape.variables;
        let at = known.iter().rposition(is_it).unwrap_or_else(|| {
            let acts = |touch: usize| shape.variables.iter().all(|&v| features.variables[v].acts_at(touch));
            let at = |touch: usize| if acts(touch) { function.at_row(features, touch) } else { 0.0 };
            known.push((function, &shape.variables, (0..n).map(at).collect()));
            known.len() - 1
        });
        let (gap, values) = (column.as_mut_slice(), &known[at].2);
        match shape.direction {
            Some(d) => {
                let each = gap.iter_mut().zip(values).zip(&features.directions[d].weight);
                each.for_each(|((gap, value), weight)| *gap = weight * value);
            }
            None => gap.copy_from_slice(values),
        }
    }
    out
}

/// The shapes that are tried.
fn planned(features: &Features) -> Vec<Planned> {
    let mut plan = Plan { distinct: features.variables.iter().map(Variable::distinct).collect(), shapes: Vec::new() };
    for (d, direction) in features.directions.iter().enumerate() {
        let along_approach = direction.dof == "r";
        plan.put(format!("shape:{CONSTANT}"), CONSTANT, &[], d, vec![Function::Constant]);
        for (v, variable) in features.variables.iter().enumerate() {
            plan.of_variable(d, v, variable, along_approach);
        }
        for (v, variable) in features.variables.iter().enumerate() {
            for (w, other) in features.variables.iter().enumerate().skip(v + 1) {
                plan.product(d, (v, variable), (w, other));
            }
        }
    }
    plan.of_groups(features);
    plan.shapes
}

/// Id without the direction, shape, scanned values, number of scanned parameters.
type Planned = (String, Shape, Vec<f64>, usize);

struct Plan {
    /// Distinct values of each variable.
    distinct: Vec<Vec<f64>>,
    shapes: Vec<Planned>,
}

impl Plan {
    fn put(&mut self, id: String, depends_on: &str, variables: &[usize], direction: usize, functions: Vec<Function>) {
        self.scan(id, depends_on, variables, Some(direction), vec![(0.0, functions)], 0);
    }

    fn scan(
        &mut self,
        id: String,
        depends_on: &str,
        variables: &[usize],
        direction: Option<usize>,
        variants: Vec<(f64, Vec<Function>)>,
        n_scanned: usize,
    ) {
        if variants.is_empty() {
            return;
        }
        let (values, functions) = variants.into_iter().unzip();
        let shape = Shape { variables: variables.to_vec(), depends_on: depends_on.to_owned(), direction, functions };
        self.shapes.push((id, shape, values, n_scanned));
    }

    fn of_variable(&mut self, d: usize, v: usize, variable: &Variable, along_approach: bool) {
        let values = self.distinct[v].clone();
        let (Some(&low), Some(&high)) = (values.first(), values.last()) else { return };
        if values.len() < 2 || variable.values.iter().any(|x| !x.is_finite()) {
            return;
        }
        let name = &variable.name;
        let id = |form: &str| format!("shape:{name}{form}");
        let (centre, scale) = (0.5 * (low + high), 0.5 * (high - low));
        let powers = |highest: i32| -> Vec<Function> {
            (1..=highest).map(|k| Function::Power { variable: v, centre, scale, k }).collect()
        };
        let waves = |k: u32| -> Vec<Function> {
            [false, true].map(|sine| Function::Harmonic { variable: v, k, sine }).to_vec()
        };
        match variable.kind {
            Kind::Linear => {
                self.put(id(""), name, &[v], d, powers(3));
                self.breaks(d, v, variable, &values);
            }
            Kind::Rotary => {
                self.put(id(""), name, &[v], d, (1..=3).flat_map(waves).collect());
                // through so few angles of one turn the waves go as well, and what turns comes back after a turn
                if values.len() > FEW_ANGLES || high - low > std::f64::consts::TAU - 1e-6 {
                    self.put(id("-cubic"), name, &[v], d, powers(3));
                }
                let orders = (1..=ORDERS).map(|k| (f64::from(k), waves(k))).collect();
                self.scan(id("-order"), name, &[v], Some(d), orders, 1);
                self.breaks(d, v, variable, &values);
            }
            Kind::Time => {
                self.put(id(""), name, &[v], d, powers(4));
                let steps = thinned(&middles(&values), CHANGE_POINTS);
                let steps = steps.iter().map(|&at| (at, vec![Function::Step { variable: v, at }])).collect();
                self.scan(id("-step"), name, &[v], Some(d), steps, 1);
                let constants = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0].map(|share| {
                    let constant = share * (high - low);
                    (constant, vec![Function::Exponential { variable: v, from: low, constant }])
                });
                self.scan(id("-exponential"), name, &[v], Some(d), constants.to_vec(), 1);
                self.scan(id("-period"), name, &[v], Some(d), periods(v, low, high, values.len()), 1);
            }
            Kind::Temperature => self.put(id(""), name, &[v], d, powers(2)),
            Kind::Approach if along_approach => {
                self.put(id(""), name, &[v], d, (1..=4).flat_map(waves).collect());
                // three seats of a stylus make six lobes, too
                let orders = (5..=LOBES).map(|k| (f64::from(k), waves(k))).collect();
                self.scan(id("-order"), name, &[v], Some(d), orders, 1);
            }
            Kind::Approach => {}
            Kind::Plain => self.put(id(""), name, &[v], d, powers(1)),
        }
    }

    /// Steps and kinks along an axis.
    fn breaks(&mut self, d: usize, v: usize, variable: &Variable, values: &[f64]) {
        let name = &variable.name;
        let scale = 0.5 * (values[values.len() - 1] - values[0]);
        let steps = thinned(&middles(values), PLACES);
        let steps = steps.iter().map(|&at| (at, vec![Function::Step { variable: v, at }])).collect();
        self.scan(format!("shape:{name}-step"), name, &[v], Some(d), steps, 1);
        let kinks = thinned(&values[1..values.len() - 1], PLACES);
        let kinks = kinks.iter().map(|&at| (at, vec![Function::Kink { variable: v, at, scale }])).collect();
        self.scan(format!("shape:{name}-kink"), name, &[v], Some(d), kinks, 1);
    }

    fn product(&mut self, d: usize, (v, a): (usize, &Variable), (w, b): (usize, &Variable)) {
        let factors = |index: usize, variable: &Variable| -> Vec<Function> {
            let values = &self.distinct[index];
            let (Some(&low), Some(&high)) = (values.first(), values.last()) else { return Vec::new() };
            if values.len() < 2 || variable.values.iter().any(|x| !x.is_finite()) {
                return Vec::new();
            }
            match variable.kind {
                Kind::Approach => Vec::new(),
                Kind::Rotary => [false, true].map(|sine| Function::Harmonic { variable: index, k: 1, sine }).to_vec(),
                _ => {
                    let (centre, scale) = (0.5 * (low + high), 0.5 * (high - low));
                    vec![Function::Power { variable: index, centre, scale, k: 1 }]
                }
            }
        };
        let (left, right) = (factors(v, a), factors(w, b));
        let products: Vec<Function> = left
            .iter()
            .flat_map(|l| right.iter().map(|r| Function::Product(Box::new(l.clone()), Box::new(r.clone()))))
            .collect();
        if !products.is_empty() {
            let name = format!("{}*{}", a.name, b.name);
            self.put(format!("shape:{name}"), &name, &[v, w], d, products);
        }
    }

    /// Groups of touches that disagree, and blocks that move in mid-program.
    fn of_groups(&mut self, features: &Features) {
        for (of, name, numbers) in [
            (Grouping::Block, "block", &features.block),
            (Grouping::Face, "face", &features.face),
            (Grouping::Visit, "visit", &features.visit),
            (Grouping::Run, "run", &features.run),
        ] {
            let distinct = distinct(numbers);
            if distinct.len() < 2 || distinct.len() > GROUPS {
                continue;
            }
            for d in 0..features.directions.len() {
                // a face is a direction: only along the approach is it something new
                if of == Grouping::Face && features.directions[d].dof != "r" {
                    continue;
                }
                let functions = distinct.iter().map(|&number| Function::Member { of, number }).collect();
                self.put(format!("shape:{name}"), name, &[], d, functions);
            }
        }
        let Some(time) = features.variables.iter().position(|v| v.kind == Kind::Time) else { return };
        let clock = &features.variables[time];
        self.jumps(features, time);
        for number in distinct(&features.block) {
            let own = Variable {
                values: clock
                    .values
                    .iter()
                    .zip(&features.block)
                    .filter(|(_, b)| **b == number)
                    .map(|(t, _)| *t)
                    .collect(),
                ..clock.clone()
            };
            let moments = middles(&own.distinct());
            let places = thinned(&moments, PLACES);
            self.moved_block(features, time, number, &moments);
            for d in (0..features.directions.len()).filter(|&d| features.directions[d].at == "workpiece") {
                let moved = |at: f64| {
                    let after = Function::Step { variable: time, at };
                    vec![Function::Product(Box::new(Function::Member { of: Grouping::Block, number }), Box::new(after))]
                };
                let variants = places.iter().map(|&at| (at, moved(at))).collect();
                let depends = format!("{}*block", clock.name);
                self.scan(format!("shape:{}-step-block-{number}", clock.name), &depends, &[time], Some(d), variants, 1);
            }
        }
    }
}

/// What is looked for before all other shapes: something that jumps at one moment, in whatever direction. A knock has no
/// axis, and one direction at a time would see a part of it each.
impl Plan {
    fn jumps(&mut self, features: &Features, time: usize) {
        let places = thinned(&middles(&self.distinct[time]), CHANGE_POINTS);
        let after = |at: f64| Function::Step { variable: time, at };
        let name = features.variables[time].name.clone();
        self.in_all_directions(features, "machine", format!("shape:{name}-step"), &name, time, &places, &after);
    }

    fn moved_block(&mut self, features: &Features, time: usize, number: usize, places: &[f64]) {
        let places = thinned(places, BLOCK_CHANGE_POINTS);
        let after = |at: f64| {
            let member = Function::Member { of: Grouping::Block, number };
            Function::Product(Box::new(member), Box::new(Function::Step { variable: time, at }))
        };
        let name = &features.variables[time].name;
        let (id, depends) = (format!("shape:{name}-step-block-{number}"), format!("{name}*block"));
        self.in_all_directions(features, "table", id, &depends, time, &places, &after);
    }

    #[allow(clippy::too_many_arguments)] // all of them say which shape it is
    fn in_all_directions(
        &mut self,
        features: &Features,
        frame: &str,
        id: String,
        depends: &str,
        time: usize,
        places: &[f64],
        after: &dyn Fn(f64) -> Function,
    ) {
        let own = |d: &usize| features.directions[*d].name.split('-').next() == Some(frame);
        let directions: Vec<usize> = (0..features.directions.len()).filter(own).collect();
        if directions.len() < 2 {
            return;
        }
        let along =
            |at: f64| directions.iter().map(|&d| Function::Along { direction: d, of: Box::new(after(at)) }).collect();
        let variants = places.iter().map(|&at| (at, along(at))).collect();
        self.scan(id, depends, &[time], None, variants, 1);
    }
}

fn distinct(numbers: &[usize]) -> Vec<usize> {
    let mut out = numbers.to_vec();
    out.sort_unstable();
    out.dedup();
    out
}

/// Half-way between neighbours.
fn middles(values: &[f64]) -> Vec<f64> {
    values.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
}

/// At most so many of them, evenly.
fn thinned(values: &[f64], at_most: usize) -> Vec<f64> {
    if values.len() <= at_most {
        return values.to_vec();
    }
    (0..at_most).map(|i| values[(2 * i + 1) * values.len() / (2 * at_most)]).collect()
}

/// Cosine and sine over a grid of frequencies: from one turn in the whole time, in steps of half of that, to what the
/// number of touches can tell.
fn periods(v: usize, low: f64, high: f64, n_distinct: usize) -> Vec<(f64, Vec<Function>)> {
    let span = high - low;
    let count = FREQUENCIES.min(n_distinct);
    (2..count + 2)
        .map(|i| {
            let period = 2.0 * span / i as f64;
            (period, [false, true].map(|sine| Function::Periodic { variable: v, period, sine }).to_vec())
        })
        .collect()
}
