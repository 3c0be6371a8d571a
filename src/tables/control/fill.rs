//! Lines → the vectors of a control's table, on top of its old values, rounded to what it stores.

use super::backup::Old;
use super::replace::{Replaced, hold_along_the_lines};
use crate::diag::{Finding, Findings};
use crate::machine::{Machine, Side};
use crate::post::tables::{Kind, LengthUnit, Point, Tables, Turn, VectorForm, doubt};
use crate::tables::correction::{Limits, rounded};
use crate::tables::lines::{Line, Seen};
use crate::units::{deg_from_rad, inch_from_mm, mm_from_inch};
use nalgebra::{Unit, Vector3};
use std::collections::BTreeMap;

/// A value of a table, in the control's unit.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Value {
    /// Short name of the vector or angle.
    pub id: String,
    pub says: String,
    /// Spelling → name.
    pub names: BTreeMap<String, String>,
    /// What the control held.
    pub old: f64,
    /// What it is to hold.
    pub new: f64,
    /// `mm`, `inch`, `deg`, or nothing for a direction.
    pub unit: &'static str,
    /// Digits behind the point.
    pub decimals: usize,
    /// The old value is the user's own.
    pub known: bool,
    /// Some software of the control has it in place of the others.
    pub instead: bool,
    /// Why it is not verified.
    pub unverified: Option<String>,
    /// By which name the user gave the old value.
    #[serde(skip)]
    pub given: Option<String>,
    /// It was given by the name of another of the control's tables: this one's own is not known.
    #[serde(skip)]
    pub elsewhere: bool,
}

impl Value {
    /// Is it the zero position of a rotary axis, and no component of a vector?
    #[must_use]
    pub fn is_zero_position(&self) -> bool {
        self.unit == "deg"
    }

    /// By how much it changes, in its unit.
    #[must_use]
    pub fn change(&self) -> f64 {
        rounded(self.new - self.old)
    }

    /// Its name in one of the control's tables, or the first one.
    #[must_use]
    pub fn name(&self, spelling: Option<&str>) -> Option<&String> {
        match spelling {
            Some(spelling) => self.names.get(spelling),
            None => self.names.values().next(),
        }
    }
}

/// A filled table.
#[derive(Debug, Clone)]
pub struct Filled {
    pub values: Vec<Value>,
    /// Its vectors, mm or components of a direction.
    pub vectors: Vec<(VectorForm, Vector3<f64>)>,
    /// The machine as this table describes it, in the terms of the machine's own description.
    pub seen: Seen,
    /// By how much machine coordinates at rotary zero change, mm: the old vectors did not close, the new ones do.
    pub opened_mm: Option<Vector3<f64>>,
}

impl Filled {
    /// Did every old value come from the user? Where software has either of two sets of vectors, one is enough.
    #[must_use]
    pub fn known(&self) -> bool {
        let vectors = self.complete(false) || (self.values.iter().any(|v| v.instead) && self.complete(true));
        vectors && self.values.iter().filter(|v| v.is_zero_position()).all(|v| v.known)
    }

    /// Are the old values of all vectors of a set known?
    fn complete(&self, instead: bool) -> bool {
        self.values.iter().filter(|v| !v.is_zero_position() && v.instead == instead).all(|v| v.known)
    }

    /// What a file of this table holds: of two sets of vectors those whose old values are known.
    pub fn entries(&self) -> impl Iterator<Item = &Value> {
        let sets = [self.complete(false), self.complete(true)];
        self.values.iter().filter(move |v| v.is_zero_position() || sets[usize::from(v.instead)])
    }

    /// Names by which the user gave old lengths.
    pub fn given_lengths(&self) -> impl Iterator<Item = &String> {
        self.values.iter().filter(|v| matches!(v.unit, "mm" | "inch")).filter_map(|v| v.given.as_ref())
    }

    /// Names of the values that a person would have to give so that all of a set are known: of the set of which some are, as the
    /// user's own are spelled.
    #[must_use]
    pub fn lacking(&self, old: &Old, first: Option<&str>) -> Vec<String> {
        let is_given = |v: &Value| v.given.is_some();
        let begun = |instead: bool| self.values.iter().any(|v| v.instead == instead && is_given(v));
        let mut given = self.values.iter().flat_map(|v| &v.names).filter(|(_, name)| old.values.contains_key(*name));
        let spelling = given.next().map(|(spelling, _)| spelling.as_str()).or(first).unwrap_or_default();
        let name = |v: &Value| v.names.get(spelling).or(v.names.values().next()).cloned();
        let instead = begun(true) && !begun(false);
        let lacks = self.values.iter().filter(|v| (v.is_zero_position() || v.instead == instead) && !is_given(v));
        if self.known() { Vec::new() } else { lacks.filter_map(name).collect() }
    }
}

/// What the filling needs to know.
pub struct Question<'a> {
    pub machine: &'a Machine,
    /// What the control has.
    pub tables: &'a Tables,
    /// Its kind for this machine.
    pub kind: &'a Kind,
    /// With what was active during the measurement.
    pub before: &'a Seen,
    pub now: &'a Seen,
    /// Where the old values did not act on the touches: what was found takes their place.
    pub replaced: Option<&'a Replaced>,
    /// The user's old values.
    pub old: &'a Old,
    /// Whose names are meant first, where the control has several tables of the same values.
    pub spelling: Option<&'a str>,
    /// Unit of the control.
    pub unit: LengthUnit,
    /// How far old values may lie off the description.
    pub limits: Limits,
}

const OTHER_PLACE: &str =
    "are `origin`, `point` and `pivot` in machines.toml those of this machine, is it this machine's backup?";

/// How far the length of a direction may be off 1.
const UNIT_LENGTH: f64 = 1e-3;

/// Digits behind the point that a step needs.
#[must_use]
pub fn decimals(step: f64) -> usize {
    (-step.log10() - 1e-9).ceil().clamp(0.0, 15.0) as usize
}

/// The line of a kind's axis.
#[must_use]
pub fn line_of(seen: &Seen, turn: Turn) -> Option<(Side, usize, &Line)> {
    let (side, place) = turn.place();
    Some((side, place, seen.side(side).get(place)?))
}

/// A crossing of two axes that miss each other by more than this does not exist, mm: a control that knows nothing else
/// would turn the workpiece about a line that is not there.
const LARGEST_MISS_MM: f64 = 0.5;

/// By how much two lines miss each other, mm.
fn miss_mm(first: &Line, second: &Line) -> f64 {
    let between = second.point - first.point;
    let square = first.direction.cross(&second.direction);
    match square.try_normalize(1e-9) {
        Some(across) => between.dot(&across).abs(),
        None => first.direction.cross(&between).norm(),
    }
}

fn point_of(seen: &Seen, point: Point) -> Vector3<f64> {
    if point == Point::WorkpieceCrossing {
        let lines = [Turn::Workpiece1, Turn::Workpiece2].map(|turn| line_of(seen, turn));
        let [Some((_, _, first)), Some((_, _, second))] = lines else { return Vector3::zeros() };
        return first.point + first.direction.into_inner() * first.direction.dot(&(second.point - first.point));
    }
    point.turn().and_then(|t| line_of(seen, t)).map_or_else(Vector3::zeros, |(_, _, line)| line.point)
}

/// +1, or -1 where the control counts a direction against the motion.
fn sign(form: &VectorForm) -> f64 {
    let moves_work = form.direction.is_some_and(|t| t.place().0 == Side::Workpiece);
    if form.reversed && moves_work { -1.0 } else { 1.0 }
}

/// Vectors that lead on from where another one ends come after it; directions and closing ones last.
fn in_order<'a, T>(all: impl Iterator<Item = &'a T>, form: impl Fn(&T) -> &VectorForm) -> Vec<&'a T> {
    let mut waiting: Vec<&T> = all.collect();
    let (mut out, mut reached) = (Vec::new(), vec![Point::MachineZero, Point::ToolAdapter]);
    while let Some(next) = waiting.iter().position(|t| form(t).from.is_some_and(|p| reached.contains(&p))) {
        let found = waiting.remove(next);
        reached.extend(form(found).to);
        out.push(found);
    }
    out.extend(waiting);
    out
}

impl Question<'_> {
    fn step_mm(&self) -> f64 {
        match self.unit {
            LengthUnit::Mm => *self.tables.step_mm.get_ref(),
            LengthUnit::Inch => mm_from_inch(*self.tables.step_inch.get_ref()),
        }
    }

    fn in_unit(&self, mm: f64) -> f64 {
        match self.unit {
            LengthUnit::Mm => mm,
            LengthUnit::Inch => inch_from_mm(mm),
        }
    }

    /// The name by which the user gave an old value: the table's own, else that of another table.
    fn given<'n>(&self, names: &'n BTreeMap<String, [String; 3]>, k: usize) -> Option<(&'n String, bool)> {
        let own = self.spelling.and_then(|spelling| names.get(spelling));
        let there = |n: &&'n String| self.old.values.contains_key(*n);
        let mine = own.map(|n| &n[k]).filter(there);
        mine.map(|n| (n, false)).or_else(|| names.values().map(|n| &n[k]).find(there).map(|n| (n, own.is_some())))
    }

    /// An old value, in mm for a length.
    fn old_value(&self, names: &BTreeMap<String, [String; 3]>, k: usize, length: bool) -> Option<f64> {
        let (value, unit) = self.given(names, k).and_then(|(n, _)| self.old.values.get(n))?;
        let inch = length && unit.unwrap_or(self.unit) == LengthUnit::Inch;
        Some(if inch { mm_from_inch(*value) } else { *value })
    }

    /// The old vector: the user's numbers where they are known, else as described.
    fn old_vector(&self, form: &VectorForm, described: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| {
            let no_name = form.names.values().all(|n| n[k].is_empty());
            let given = self.old_value(&form.names, k, form.direction.is_none());
            given.filter(|_| !no_name).unwrap_or(described[k])
        })
    }

    /// By how much the axes of a vector to their crossing miss each other, where there is no such crossing, mm.
    fn no_crossing_mm(&self, form: &VectorForm) -> Option<f64> {
        let of = |turn| line_of(self.before, turn).map(|(_, _, line)| line);
        let (first, second) = (of(Turn::Workpiece1)?, of(Turn::Workpiece2)?);
        let mm = miss_mm(first, second);
        (form.to == Some(Point::WorkpieceCrossing) && mm > LARGEST_MISS_MM).then_some(mm)
    }

    fn described(&self, form: &VectorForm, seen: &Seen) -> Vector3<f64> {
        match (form.from, form.to, form.direction) {
            (Some(from), Some(to), _) => point_of(seen, to) - point_of(seen, from),
            (_, _, Some(turn)) => {
                line_of(seen, turn).map_or_else(Vector3::zeros, |(_, _, line)| line.direction.into_inner() * sign(form))
            }
            _ => {
                let parts = self.kind.vector.iter().filter(|v| form.close.iter().flatten().any(|id| *id == v.id));
                -parts.map(|v| self.described(v, seen)).sum::<Vector3<f64>>()
            }
        }
    }

    /// Fills the table.
    #[must_use]
    pub fn fill(&self) -> (Filled, Findings) {
        let mut findings = Findings::default();
        // where the user's numbers put the points, against the description
        let mut off: BTreeMap<Point, Vector3<f64>> = BTreeMap::new();
        let mut turned: BTreeMap<Turn, Vector3<f64>> = BTreeMap::new();
        let mut opened_mm = None;
        for form in in_order(self.kind.vector.iter(), |f| f) {
            let described = self.described(form, self.before);
            let old = self.old_vector(form, described);
            if let Some(mm) = self.no_crossing_mm(form) {
                let says = format!("{} is not written: the two axes miss each other by {mm:.3} mm", form.id);
                findings.push(
                    Finding::info("tables::no_crossing", says)
                        .help("software that has only a common point of the two axes cannot drive this machine"),
                );
                continue;
            }
            if form.instead {
                self.compare_instead(form, old - described, &mut findings);
                continue;
            }
            match (form.from, form.to, form.direction) {
                (Some(from), Some(to), _) => {
                    let base = off.get(&from).copied().unwrap_or_default();
                    off.insert(to, base + old - described);
                }
                (_, _, Some(turn)) => {
                    if (old.norm() - 1.0).abs() > UNIT_LENGTH {
                        let says = format!("the old direction {} has the length {:.4}, not 1", form.id, old.norm());
                        findings.push(
                            Finding::warning("tables::direction_length", says).help(
                                "the new one has the length 1: is it this machine's backup, complete and unedited?",
                            ),
                        );
                    }
                    turned.insert(turn, (old.try_normalize(1e-9).unwrap_or(described) - described) * sign(form));
                }
                _ => {
                    let sum: Vector3<f64> = form
                        .close
                        .iter()
                        .flatten()
                        .filter_map(|id| self.kind.vector.iter().find(|v| v.id == *id))
                        .map(|v| self.old_vector(v, self.described(v, self.before)))
                        .sum();
                    if (sum + old).amax() > 2.5 * self.step_mm() {
                        opened_mm = Some(sum + old);
                        findings.push(self.open_chain(form, sum + old));
                    }
                }
            }
        }
        self.compare(&off, &turned, &mut findings);
        let given = off.clone();
        self.keep_what_stays(&mut off, &mut turned, &mut findings);
        let (mut seen, mut target) = (self.now.clone(), self.now.clone());
        for (point, by) in &off {
            let Some((side, place)) = point.turn().map(Turn::place) else { continue };
            let (Some(was), Some(line)) = (self.before.side(side).get(place), target.side_mut(side).get_mut(place))
            else {
                continue;
            };
            // further along a line that has tilted, its points have moved further
            let along = by.dot(&was.direction);
            line.point += by + along * (line.direction.into_inner() - was.direction.into_inner());
        }
        for (turn, by) in &turned {
            let (side, place) = turn.place();
            if let Some(line) = target.side_mut(side).get_mut(place) {
                line.direction = Unit::new_normalize(line.direction.into_inner() + by);
            }
        }
        hold_along_the_lines(self.before, &given, &mut target);
        let mut values = Vec::new();
        let mut vectors: Vec<(VectorForm, Vector3<f64>)> = Vec::new();
        let step = self.step_mm();
        let direction_step = 0.1_f64.powi(i32::try_from(self.tables.direction_decimals).unwrap_or(9));
        for form in self.kind.vector.iter().filter(|f| self.no_crossing_mm(f).is_none()) {
            let described = self.described(form, self.before);
            let old = self.old_vector(form, described);
            let direction = form.direction.is_some();
            let step = if direction { direction_step } else { step };
            let exact = match &form.close {
                // of the written ones, so that they close to the last digit
                Some(ids) => {
                    -vectors.iter().filter(|(f, _)| ids.contains(&f.id)).map(|(_, v)| *v).sum::<Vector3<f64>>()
                }
                // the user's own numbers of the other set say nothing of this one
                None if form.instead => self.described(form, self.now) + self.kept_instead(form, old - described),
                None => self.described(form, &target),
            };
            let new = exact.map(|v| (v / step).round() * step);
            for k in 0..3 {
                let names: BTreeMap<String, String> = form
                    .names
                    .iter()
                    .filter(|(_, n)| !n[k].is_empty())
                    .map(|(spelling, n)| (spelling.clone(), n[k].clone()))
                    .collect();
                if names.is_empty() {
                    continue;
                }
                if !direction && new[k].abs() > self.tables.limit_mm {
                    findings.push(
                        Finding::error(
                            "tables::range",
                            format!(
                                "{} of {} is {:.4} mm, the control takes up to {} mm",
                                ["X", "Y", "Z"][k],
                                form.id,
                                new[k],
                                self.tables.limit_mm
                            ),
                        )
                        .help("check `origin` in machines.toml"),
                    );
                }
                let shown = |v: f64| if direction { v } else { self.in_unit(v) };
                let given = self.given(&form.names, k);
                values.push(Value {
                    id: format!("{}.{}", form.id, ["x", "y", "z"][k]),
                    says: form.says.clone(),
                    names,
                    old: rounded(shown(old[k])),
                    new: rounded(shown(new[k])),
                    unit: match (direction, self.unit) {
                        (true, _) => "",
                        (_, LengthUnit::Mm) => "mm",
                        (_, LengthUnit::Inch) => "inch",
                    },
                    // the table's own, and no assumption of an earlier export
                    known: given.is_some_and(|(n, elsewhere)| !elsewhere && !self.old.assumed.contains(n)),
                    given: given.map(|(n, _)| n.clone()),
                    elsewhere: given.is_some_and(|(_, elsewhere)| elsewhere),
                    instead: form.instead,
                    decimals: if direction { self.tables.direction_decimals } else { decimals(self.in_unit(step)) },
                    unverified: doubt(form.source.as_ref(), form.unverified.as_ref()),
                });
            }
            // components that the control has no place for stay as they are described
            let held =
                Vector3::from_fn(
                    |k, _| {
                        if form.names.values().all(|n| n[k].is_empty()) { described[k] } else { new[k] }
                    },
                );
            vectors.push((form.clone(), held));
        }
        self.as_written(&vectors, &off, &turned, &mut seen);
        (Filled { values, vectors, seen, opened_mm }, findings)
    }

    /// Old vectors that do not close: the new ones do, and machine coordinates at rotary zero go by the gap.
    fn open_chain(&self, form: &VectorForm, gap: Vector3<f64>) -> Finding {
        let of = form.close.iter().flatten().cloned().collect::<Vec<_>>().join(" and ");
        let says = format!(
            "the old vectors do not close: {} is {:.4} {:.4} {:.4} mm off minus the sum of {of}",
            form.id, gap.x, gap.y, gap.z
        );
        if gap.norm() > self.limits.mm {
            return Finding::error("tables::open_chain", says).help(
                "the new ones close: at rotary zero machine coordinates would change by that much. Is it this machine's backup, \
                 complete, and does its builder keep a length there that belongs into the tool table? --force closes them all the same",
            );
        }
        Finding::warning("tables::open_chain", says)
            .help("the new ones close: machine coordinates at rotary zero change by that much, so touch off all work offsets again")
    }

    /// What the other set is off the description, and stays so.
    fn kept_instead(&self, form: &VectorForm, off: Vector3<f64>) -> Vector3<f64> {
        self.replaced.map_or(off, |r| r.place(off, |seen| self.described(form, seen)))
    }

    /// Where the old values did not act on the touches, what of them stays; a difference that is replaced is said.
    fn keep_what_stays(
        &self,
        off: &mut BTreeMap<Point, Vector3<f64>>,
        turned: &mut BTreeMap<Turn, Vector3<f64>>,
        findings: &mut Findings,
    ) {
        let Some(replaced) = self.replaced else { return };
        let worst = replaced.keep((self.before, self.now), off, turned);
        if let Some((mm, axis)) = worst.filter(|(mm, _)| *mm > self.step_mm().max(1e-3)) {
            let says = format!(
                "the old values place axis {axis} {mm:.4} mm from where the machine's description has it; the program gave axis \
                 positions, on which they did not act, so that the description with what was found takes their place"
            );
            findings.push(Finding::info("tables::old_did_not_act", says));
        }
    }

    /// The machine that the written vectors describe, without what the user's numbers are off the description.
    fn as_written(
        &self,
        vectors: &[(VectorForm, Vector3<f64>)],
        off: &BTreeMap<Point, Vector3<f64>>,
        turned: &BTreeMap<Turn, Vector3<f64>>,
        seen: &mut Seen,
    ) {
        let mut points: BTreeMap<Point, Vector3<f64>> = BTreeMap::new();
        for (form, value) in in_order(vectors.iter(), |(form, _)| form) {
            if let (Some(from), Some(to)) = (form.from, form.to) {
                let base = points.get(&from).copied().unwrap_or_default();
                points.insert(to, base + value);
            }
            if let Some(turn) = form.direction {
                let (side, place) = turn.place();
                let by = turned.get(&turn).copied().unwrap_or_default();
                if let Some(line) = seen.side_mut(side).get_mut(place) {
                    line.direction = Unit::new_normalize(value * sign(form) - by);
                }
            }
        }
        for (point, at) in points {
            let Some((side, place)) = point.turn().map(Turn::place) else { continue };
            let along = self.before.side(side).get(place).map(|l| l.direction);
            let by = off.get(&point).copied().unwrap_or_default();
            let (Some(line), Some(was)) = (seen.side_mut(side).get_mut(place), along) else { continue };
            let further = by.dot(&was) * (line.direction.into_inner() - was.into_inner());
            line.point = at - by - further;
        }
    }

    /// What `--force` would do with old values that are those of another machine.
    fn forced(&self, help: &str) -> String {
        let does = match self.replaced {
            Some(_) => "replaces the old values by the description with what was found",
            None => "adds what was found to the old values",
        };
        format!("{help} --force {does} all the same")
    }

    /// Do the user's numbers of the other set describe the machine that was measured?
    fn compare_instead(&self, form: &VectorForm, off: Vector3<f64>, findings: &mut Findings) {
        if off.norm() > self.limits.mm {
            let says = format!(
                "the old values place {} {:.3} mm from where the machine's description has it",
                form.to.map_or_else(|| form.id.clone(), |p| p.to_string()),
                off.norm()
            );
            findings.push(Finding::error("tables::other_place", says).help(self.forced(OTHER_PLACE)));
        }
    }

    /// Do the user's numbers describe the machine that was measured?
    fn compare(
        &self,
        off: &BTreeMap<Point, Vector3<f64>>,
        turned: &BTreeMap<Turn, Vector3<f64>>,
        findings: &mut Findings,
    ) {
        for (point, by) in off {
            let Some((_, _, line)) = point.turn().and_then(|t| line_of(self.before, t)) else { continue };
            let across = by - line.direction.into_inner() * by.dot(&line.direction);
            if across.norm() > self.limits.mm {
                findings.push(
                    Finding::error(
                        "tables::other_place",
                        format!(
                            "the old values place axis {} {:.3} mm from where the machine's description has it",
                            line.axis,
                            across.norm()
                        ),
                    )
                    .help(self.forced(OTHER_PLACE)),
                );
            }
        }
        for (turn, by) in turned {
            let Some((_, _, line)) = line_of(self.before, *turn) else { continue };
            let angle = deg_from_rad(2.0 * (by.norm() / 2.0).min(1.0).asin());
            if angle > self.limits.deg {
                findings.push(
                    Finding::error(
                        "tables::other_direction",
                        format!("the old values turn axis {} about a direction {angle:.3} deg from that of the machine's description", line.axis),
                    )
                    .help(self.forced("is `sense` in machines.toml right, is it this machine's backup?")),
                );
            }
        }
    }
}
