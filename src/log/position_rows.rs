//! A log of nothing but rows of positions: which touch of the plan does each row belong to?
//!
//! Such a log may hold a row for every probing move: the fast search, the move off the face, the measuring touch, and a
//! missed search, which looks like a hit. Rows that equal the one before may have been dropped, the head of the file
//! may be cut. A row belongs to a touch when it lies on the line of its search. Rows are walked through in the order of the plan; where
//! they stand in another order, the position alone decides. Nothing is invented: what cannot be decided is a finding, and the touch is
//! missing.

use super::finding_places::Capped;
use super::matching::ranges;
use super::setup_mistakes;
use super::touch::{RawTouch, Status};
use crate::axes::Position;
use crate::diag::Finding;
use crate::machine::Machine;
use crate::post::as_written::Role;
use crate::program::plan::{Plan, PlanTouch};
use std::collections::BTreeMap;

/// A row lies on the line of a search when it is not further from it than this, mm: the axes follow the line.
const LINE_ROOM_MM: f64 = 0.1;
/// And its rotary axes are not further from the pose than this, deg.
const POSE_ROOM_DEG: f64 = 0.05;
/// A missed search ends so near its programmed end, mm: feedback is a servo cycle old.
const END_ROOM_MM: f64 = 0.02;

/// What the rows of a log are.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowForm<'a> {
    /// The rows of one touch, in order.
    pub per_touch: &'a [Role],
    /// Each row says whether the probe triggered.
    pub says_status: bool,
    /// Numbers of lines that were not understood, ascending: each may have been a row.
    pub lost: &'a [usize],
}

impl Default for RowForm<'_> {
    fn default() -> Self {
        Self { per_touch: &[Role::Search, Role::Release, Role::Measure], says_status: false, lost: &[] }
    }
}

impl RowForm<'_> {
    /// Is the second row the one behind the first, with no row lost between them? Rows by their places in the log.
    fn follows(&self, raw: &[RawTouch], before: usize, after: usize) -> bool {
        let line = |i: usize| raw.get(i).map_or(0, |row| row.line);
        let lost = self.lost.partition_point(|l| *l <= line(before));
        before + 1 == after && self.lost.get(lost).is_none_or(|l| *l >= line(after))
    }
}

/// The line of a touch's search.
struct Search {
    start: Position,
    /// Unit vector of the approach.
    toward: nalgebra::Vector3<f64>,
    /// Start to end, mm.
    length: f64,
}

impl Search {
    fn from_plan(touch: &PlanTouch) -> Self {
        let (start, end) = (touch.start_position(), touch.end_position());
        let way = end.xyz_mm() - start.xyz_mm();
        let length = way.norm();
        Self { start, toward: if length > 0.0 { way / length } else { way }, length }
    }

    /// How far along the search a position lies, mm, if it lies on it. `present`: the axes that are known.
    fn along(&self, machine: &Machine, at: &Position, present: [bool; 6]) -> Option<f64> {
        let off = at.xyz_mm() - self.start.xyz_mm();
        let along = off.dot(&self.toward);
        let aside = (off - self.toward * along).norm();
        let posed = machine
            .rotary()
            .filter(|a| present[a.name.index()])
            .all(|a| (at.get(a.name) - self.start.get(a.name)).abs() <= POSE_ROOM_DEG);
        (posed && aside <= LINE_ROOM_MM && along >= -LINE_ROOM_MM && along <= self.length + LINE_ROOM_MM)
            .then_some(along)
    }

    fn same_as(&self, other: &Self) -> bool {
        (self.start.xyz_mm() - other.start.xyz_mm()).norm() < LINE_ROOM_MM
            && (self.toward - other.toward).norm() < 1e-6
            && self.start.0[3..].iter().zip(&other.start.0[3..]).all(|(a, b)| (a - b).abs() < POSE_ROOM_DEG)
    }

    fn middle(&self) -> nalgebra::Vector3<f64> {
        self.start.xyz_mm() + self.toward * (self.length / 2.0)
    }
}

/// The searches of a plan, found by position.
pub(super) struct Lines<'m> {
    machine: &'m Machine,
    searches: Vec<Search>,
    /// The searches whose middle lies in a cube of space, in the order of the plan.
    cubes: BTreeMap<[i64; 3], Vec<usize>>,
    /// Edge of a cube, mm: no position of a search is further from its middle.
    edge_mm: f64,
}

impl<'m> Lines<'m> {
    pub(super) fn new(machine: &'m Machine, plan: &Plan) -> Self {
        let searches: Vec<Search> = plan.touches.iter().map(Search::from_plan).collect();
        let longest = searches.iter().map(|s| s.length).fold(0.0, f64::max);
        let mut lines = Self { machine, searches, cubes: BTreeMap::new(), edge_mm: longest / 2.0 + 2.0 * LINE_ROOM_MM };
        for (i, search) in lines.searches.iter().enumerate() {
            let cube = Self::cube(&search.middle(), lines.edge_mm);
            lines.cubes.entry(cube).or_default().push(i);
        }
        lines
    }

    /// The machine of the plan.
    pub(super) fn machine(&self) -> &'m Machine {
        self.machine
    }

    #[allow(clippy::cast_possible_truncation)] // what is too far away saturates
    fn cube(at: &nalgebra::Vector3<f64>, edge_mm: f64) -> [i64; 3] {
        [at.x, at.y, at.z].map(|v| (v / edge_mm).floor() as i64)
    }

    /// The searches near a position, in the order of the plan.
    fn near(&self, at: &nalgebra::Vector3<f64>) -> Vec<usize> {
        let [x, y, z] = Self::cube(at, self.edge_mm);
        let beside = |v: i64| v.saturating_sub(1)..=v.saturating_add(1);
        let mut all: Vec<usize> = Vec::new();
        for x in beside(x) {
            for y in beside(y) {
                let columns = self.cubes.range([x, y, z.saturating_sub(1)]..=[x, y, z.saturating_add(1)]);
                all.extend(columns.flat_map(|(_, searches)| searches));
            }
        }
        all.sort_unstable();
        all
    }

    /// The searches on whose lines a position lies, in the order of the plan.
    pub(super) fn at(&self, at: &Position, present: [bool; 6]) -> Vec<usize> {
        let mut all = self.near(&at.xyz_mm());
        all.retain(|i| self.along(*i, at, present).is_some());
        all
    }

    fn along(&self, search: usize, at: &Position, present: [bool; 6]) -> Option<f64> {
        self.searches.get(search)?.along(self.machine, at, present)
    }

    fn row_along(&self, search: usize, row: &RawTouch) -> Option<f64> {
        self.along(search, &row.position, row.present)
    }

    /// The touches that follow this one at the same position, this one among them.
    fn alike(&self, first: usize) -> usize {
        let Some(search) = self.searches.get(first) else { return 1 };
        self.searches[first..].iter().take_while(|s| s.same_as(search)).count().max(1)
    }

    /// All touches at the position of each, in the order of the plan; by the first of them.
    fn positions(&self) -> (Vec<usize>, BTreeMap<usize, Vec<usize>>) {
        let mut first_of: Vec<usize> = Vec::with_capacity(self.searches.len());
        let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (i, search) in self.searches.iter().enumerate() {
            let near = self.near(&search.middle());
            let first = near.into_iter().find(|j| *j < i && self.searches[*j].same_as(search)).unwrap_or(i);
            first_of.push(first);
            members.entry(first).or_default().push(i);
        }
        (first_of, members)
    }
}

/// What became of the rows.
pub(super) struct Numbered {
    /// The measuring rows, with the numbers of their touches.
    pub touches: Vec<RawTouch>,
    /// Touches whose rows are there but not clear.
    pub unclear: Vec<u64>,
    /// What is to be said.
    pub findings: Vec<Finding>,
}

/// Gives the measuring rows the numbers of their touches.
pub(super) fn number(
    machine: &Machine,
    plan: &Plan,
    raw: Vec<RawTouch>,
    form: RowForm<'_>,
    at: &dyn Fn(Finding, usize) -> Finding,
) -> Numbered {
    let lines = Lines::new(machine, plan);
    let ordered = in_order(&lines, &raw);
    let in_another_order = ordered.is_none();
    let (mut groups, unmatched) = ordered.unwrap_or_else(|| by_position(&lines, &raw));
    let on_none = unmatched.iter().filter(|i| lines.at(&raw[**i].position, raw[**i].present).is_empty()).count();
    let first_line = raw.first().map_or(1, |row| row.line);
    // one mistake in the whole log is one message, not one for each row
    if on_none > 1
        && on_none * 2 > raw.len()
        && let Some(finding) = setup_mistakes::explain_rows(plan, &lines, &raw, on_none)
    {
        return Numbered { touches: Vec::new(), unclear: Vec::new(), findings: vec![at(finding, first_line)] };
    }
    let mut findings = Vec::new();
    if in_another_order {
        let message = "the rows stand in another order than the touches of the plan: they are matched by position";
        let help = "where a position is touched several times, the order of the rows there counts";
        findings.push(at(Finding::info("log::order", message).help(help), first_line));
    }
    say_unmatched(&unmatched, &lines, &raw, at, &mut findings);
    for i in 1..groups.len() {
        // nothing was lost after a group when the next one begins with the next row
        let (before, after) = (groups[i - 1].rows.last().copied(), groups[i].rows.first().copied());
        groups[i - 1].whole = before.zip(after).is_some_and(|(b, a)| form.follows(&raw, b, a));
    }
    // behind the last group anything may be lost, unless all others have as many rows as it has
    if let Some((last, others)) = groups.split_last_mut() {
        let counts = |g: &Group| (g.touches.len(), g.rows.len());
        last.whole = others.len() > 1 && others.iter().all(|g| counts(g) == counts(last));
    }
    let mut unclear = Capped::default();
    let mut touches = Vec::new();
    let mut not_clear = Vec::new();
    for group in &groups {
        let ids: Vec<u64> = group.touches.iter().filter_map(|i| plan.touches.get(*i)).map(|t| t.id).collect();
        match group.measured(&lines, &raw, form) {
            Ok(rows) => touches.extend(ids.iter().zip(rows).map(|(id, row)| RawTouch { id: Some(*id), ..row })),
            Err(why) => {
                not_clear.extend(&ids);
                unclear.push(|| {
                    let (first, last) = (group.first_line(&raw), group.last_line(&raw));
                    let message = format!("lines {first} to {last}, touch {}: {why}; they are not used", ranges(&ids));
                    at(Finding::warning("log::ambiguous", message), first)
                });
            }
        }
    }
    findings.extend(unclear.drain("groups of rows that are not clear", "log::ambiguous"));
    Numbered { touches, unclear: not_clear, findings }
}

/// Rows in the order of the plan, in groups at one position, and the rows that are in none; `None` where a row lies at a touch that
/// was passed over, so that the order is another one.
fn in_order(lines: &Lines<'_>, raw: &[RawTouch]) -> Option<(Vec<Group>, Vec<usize>)> {
    let mut groups: Vec<Group> = Vec::new();
    let mut unmatched = Vec::new();
    let mut next = 0;
    let mut passed_over = vec![false; lines.searches.len()];
    for (index, row) in raw.iter().enumerate() {
        // the group that is open takes a row before any later touch does
        if let Some(group) = groups.last_mut()
            && lines.row_along(group.search(), row).is_some()
        {
            group.rows.push(index);
            continue;
        }
        let first = match lines.row_along(next, row) {
            Some(_) => next,
            None => {
                let at = lines.at(&row.position, row.present);
                match at.iter().copied().find(|i| *i >= next) {
                    Some(first) => first,
                    None if at.iter().any(|i| passed_over[*i]) => return None,
                    None => {
                        unmatched.push(index);
                        continue;
                    }
                }
            }
        };
        // the same place touched again and again is one group: only the count of rows can take it apart
        let alike = lines.alike(first);
        passed_over[next..first].fill(true);
        next = first + alike;
        groups.push(Group { touches: (first..next).collect(), rows: vec![index], whole: false, shared: false });
    }
    Some((groups, unmatched))
}

/// Rows in any order, in groups at one position, and the rows that are in none.
fn by_position(lines: &Lines<'_>, raw: &[RawTouch]) -> (Vec<Group>, Vec<usize>) {
    let (first_of, members) = lines.positions();
    let mut groups: Vec<Group> = Vec::new();
    let mut unmatched = Vec::new();
    for (index, row) in raw.iter().enumerate() {
        if let Some(group) = groups.last_mut()
            && lines.row_along(group.search(), row).is_some()
        {
            group.rows.push(index);
            continue;
        }
        match lines.at(&row.position, row.present).first() {
            Some(at) => {
                let first = first_of.get(*at).copied().unwrap_or(*at);
                groups.push(Group { touches: vec![first], rows: vec![index], whole: false, shared: false });
            }
            None => unmatched.push(index),
        }
    }
    let mut at_position: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, group) in groups.iter().enumerate() {
        at_position.entry(group.search()).or_default().push(i);
    }
    for (first, of) in &at_position {
        let Some(touches) = members.get(first) else { continue };
        match of[..] {
            [only] => groups[only].touches.clone_from(touches),
            _ if of.len() == touches.len() => {
                of.iter().zip(touches).for_each(|(group, touch)| groups[*group].touches = vec![*touch]);
            }
            _ => of.iter().for_each(|group| {
                groups[*group].touches.clone_from(touches);
                groups[*group].shared = true;
            }),
        }
    }
    (groups, unmatched)
}

/// The rows that are in no group.
fn say_unmatched(
    rows: &[usize],
    lines: &Lines<'_>,
    raw: &[RawTouch],
    at: &dyn Fn(Finding, usize) -> Finding,
    findings: &mut Vec<Finding>,
) {
    let mut unmatched = Capped::default();
    for row in rows.iter().filter_map(|i| raw.get(*i)) {
        unmatched.push(|| {
            let why = match lines.at(&row.position, row.present).is_empty() {
                false => "lies at a touch that has been made before",
                true => "lies on the line of no touch",
            };
            at(Finding::warning("log::unmatched", format!("the row {why}; it is not used")), row.line)
        });
    }
    findings.extend(unmatched.drain("rows at no touch", "log::unmatched"));
}

/// A row on the line of a search.
struct Along<'a> {
    /// How far along, mm.
    mm: f64,
    /// Place of the row in the log.
    place: usize,
    row: &'a RawTouch,
}

/// Rows, one after the other, on the line of one search.
struct Group {
    /// Places of its touches in the plan, all at one position. Never empty.
    touches: Vec<usize>,
    /// Places of its rows in the log. Never empty.
    rows: Vec<usize>,
    /// No row can be missing at its end.
    whole: bool,
    /// Other groups lie at the same position, and which touch each is cannot be decided.
    shared: bool,
}

impl Group {
    fn search(&self) -> usize {
        self.touches.first().copied().unwrap_or_default()
    }

    fn first_line(&self, raw: &[RawTouch]) -> usize {
        self.rows.first().and_then(|i| raw.get(*i)).map_or(0, |r| r.line)
    }

    fn last_line(&self, raw: &[RawTouch]) -> usize {
        self.rows.last().and_then(|i| raw.get(*i)).map_or(0, |r| r.line)
    }

    /// The measured row of each of the group's touches, or the reason why that cannot be told.
    fn measured(&self, lines: &Lines<'_>, raw: &[RawTouch], form: RowForm<'_>) -> Result<Vec<RawTouch>, &'static str> {
        if self.shared {
            return Err("this position is touched several times, in another count than there are groups of rows");
        }
        let search = lines.searches.get(self.search()).ok_or("no touch")?;
        let rows: Vec<Along<'_>> = self
            .rows
            .iter()
            .filter_map(|i| raw.get(*i).map(|row| (*i, row)))
            .map(|(place, row)| Along { mm: lines.row_along(self.search(), row).unwrap_or_default(), place, row })
            .collect();
        // rows well before the deepest one are ends of moves off the face
        let back = lines.machine.probe.back_off / 2.0;
        let deepest = rows.iter().map(|r| r.mm).fold(f64::NEG_INFINITY, f64::max);
        let mut runs: Vec<Vec<&Along<'_>>> = vec![Vec::new()];
        for row in &rows {
            if deepest - row.mm > back {
                if runs.last().is_some_and(|r| !r.is_empty()) {
                    runs.push(Vec::new());
                }
            } else if let Some(run) = runs.last_mut() {
                run.push(row);
            }
        }
        runs.retain(|r| !r.is_empty());
        let status = |at: &Along<'_>| {
            let missed = match form.says_status {
                true => at.row.status == Status::Miss,
                false => (search.length - at.mm).abs() <= END_ROOM_MM,
            };
            RawTouch { status: if missed { Status::Miss } else { Status::Hit }, ..at.row.clone() }
        };
        let rows_per_touch = form.per_touch.len().max(1);
        let measure = form.per_touch.iter().position(|r| *r == Role::Measure).unwrap_or(rows_per_touch - 1);
        let pick = |runs: &[Vec<&Along<'_>>]| match runs {
            // all rows of a touch lie together
            [run] if run.len() == rows_per_touch => run.get(measure).map(|r| status(r)).ok_or("no row"),
            // a missed search is the only row of its touch
            [run] if run.len() == 1 && status(run[0]).status == Status::Miss => Ok(status(run[0])),
            // rows that equal the one before were not written: the last row still holds the measuring touch, when it
            // is the last of a touch and nothing is lost behind it
            [run] if run.len() < rows_per_touch && measure + 1 == rows_per_touch && self.whole => {
                run.last().map(|r| status(r)).ok_or("no row")
            }
            [run] if run.len() < rows_per_touch => Err("the log may be cut here, and the measuring touch be lost"),
            [_] => Err("there are more rows than a touch has"),
            // moves off the face are logged too: what follows the last of them begins with the measuring touch
            [.., last] => {
                let first = last.first().ok_or("no row")?;
                let before = rows.windows(2).find(|w| w[1].place == first.place).map(|w| w[0].place);
                let unbroken = before.is_some_and(|before| form.follows(raw, before, first.place));
                if unbroken { Ok(status(first)) } else { Err("a line before the measuring touch is lost") }
            }
            [] => Err("no row"),
        };
        if self.touches.len() == 1 {
            return pick(&runs).map(|row| vec![row]);
        }
        // several touches at one place: only full sets of rows, or whole pairs of runs, can be shared out
        if let [run] = &runs[..]
            && run.len() == rows_per_touch * self.touches.len()
        {
            return Ok(run.chunks(rows_per_touch).filter_map(|c| c.get(measure)).map(|r| status(r)).collect());
        }
        if runs.len() == 2 * self.touches.len() {
            return runs.chunks(2).map(pick).collect();
        }
        Err("the touches are made at the same place, and the rows cannot be shared out among them")
    }
}
