//! A log of nothing but columns: which touch of the plan does each row belong to?
//!
//! Such a log holds a row for every probing move: the fast search, the move off the face, the measuring touch, and a
//! missed search, which looks like a hit. Rows that equal the one before may have been dropped, the head of the file
//! may be cut. Rows are walked through in the order of the plan; a row belongs to a touch when it lies on the line of
//! its search. Nothing is invented: what cannot be told is a finding, and the touch is missing.

use super::matching::ranges;
use super::place::Capped;
use super::touch::{RawTouch, Status};
use crate::axes::Position;
use crate::diag::Finding;
use crate::machine::Machine;
use crate::post::as_written::Role;
use crate::program::plan::{Plan, PlanTouch};

/// A row lies on the line of a search when it is not further from it than this, mm: the axes follow the line.
const LINE_ROOM_MM: f64 = 0.1;
/// And its rotary axes are not further from the pose than this, deg.
const POSE_ROOM_DEG: f64 = 0.05;
/// A missed search ends so near its programmed end, mm: feedback is a servo cycle old.
const END_ROOM_MM: f64 = 0.02;

/// The line of a touch's search.
struct Search {
    start: Position,
    /// Unit vector of the approach.
    toward: nalgebra::Vector3<f64>,
    /// Start to end, mm.
    length: f64,
}

impl Search {
    fn of(touch: &PlanTouch) -> Self {
        let (start, end) = (touch.start_position(), touch.end_position());
        let way = end.xyz_mm() - start.xyz_mm();
        let length = way.norm();
        Self { start, toward: if length > 0.0 { way / length } else { way }, length }
    }

    /// How far along the search a row lies, mm, if it lies on it.
    fn along(&self, machine: &Machine, row: &RawTouch) -> Option<f64> {
        let off = row.position.xyz_mm() - self.start.xyz_mm();
        let along = off.dot(&self.toward);
        let aside = (off - self.toward * along).norm();
        let posed = machine
            .rotary()
            .filter(|a| row.present[a.name.index()])
            .all(|a| (row.position.get(a.name) - self.start.get(a.name)).abs() <= POSE_ROOM_DEG);
        (posed && aside <= LINE_ROOM_MM && along >= -LINE_ROOM_MM && along <= self.length + LINE_ROOM_MM)
            .then_some(along)
    }

    fn same_as(&self, other: &Self) -> bool {
        (self.start.xyz_mm() - other.start.xyz_mm()).norm() < LINE_ROOM_MM
            && (self.toward - other.toward).norm() < 1e-6
            && self.start.0[3..].iter().zip(&other.start.0[3..]).all(|(a, b)| (a - b).abs() < POSE_ROOM_DEG)
    }
}

/// Gives the measuring rows the numbers of their touches; and the touches whose rows are there but not clear. `per_touch`: the rows of one touch, in order.
pub(super) fn number(
    machine: &Machine,
    plan: &Plan,
    raw: Vec<RawTouch>,
    per_touch: &[Role],
    at: &dyn Fn(Finding, usize) -> Finding,
) -> (Vec<RawTouch>, Vec<u64>, Vec<Finding>) {
    let searches: Vec<Search> = plan.touches.iter().map(Search::of).collect();
    let mut unmatched = Capped::default();
    let mut groups: Vec<Group> = Vec::new();
    let mut next = 0;
    for row in raw {
        // the group that is open takes a row before any later touch does
        if let Some(group) = groups.last_mut()
            && let Some(along) = searches[group.first].along(machine, &row)
        {
            group.rows.push((along, row));
            continue;
        }
        let Some(index) = (next..searches.len()).find(|i| searches[*i].along(machine, &row).is_some()) else {
            unmatched.push(|| {
                let earlier = searches[..next.min(searches.len())].iter().any(|s| s.along(machine, &row).is_some());
                let why =
                    if earlier { "lies at a touch that has been made before" } else { "lies on the line of no touch" };
                at(Finding::warning("log::unmatched", format!("the row {why}; it is not used")), row.line)
            });
            continue;
        };
        // the same place touched again and again is one group: only the count of rows can take it apart
        let alike = searches[index..].iter().take_while(|s| s.same_as(&searches[index])).count().max(1);
        let along = searches[index].along(machine, &row).unwrap_or_default();
        next = index + alike;
        groups.push(Group { first: index, count: alike, rows: vec![(along, row)], whole: false });
    }
    for i in 1..groups.len() {
        // nothing was lost after a group when the next one begins in the next line
        let (before, after) = (groups[i - 1].last_line(), groups[i].first_line());
        groups[i - 1].whole = after == before + 1;
    }
    let mut findings = unmatched.drain("rows at no touch", "log::unmatched");
    let mut unclear = Capped::default();
    let mut touches = Vec::new();
    let mut not_clear = Vec::new();
    for group in groups {
        let search = &searches[group.first];
        let ids = plan.touches[group.first..].iter().take(group.count);
        match group.measured(search, machine, per_touch) {
            Ok(rows) => touches.extend(ids.zip(rows).map(|(t, row)| RawTouch { id: Some(t.id), ..row })),
            Err(why) => {
                let ids: Vec<u64> = ids.map(|t| t.id).collect();
                not_clear.extend(&ids);
                unclear.push(|| {
                    let (first, last) = (group.first_line(), group.last_line());
                    let message = format!("lines {first} to {last}, touch {}: {why}; they are not used", ranges(&ids));
                    at(Finding::warning("log::ambiguous", message), first)
                });
            }
        }
    }
    findings.extend(unclear.drain("groups of rows that are not clear", "log::ambiguous"));
    (touches, not_clear, findings)
}

/// Rows, one after the other, on the line of one search.
struct Group {
    first: usize,
    count: usize,
    /// How far along the search, mm, and the row. Never empty.
    rows: Vec<(f64, RawTouch)>,
    /// No row can be missing at its end.
    whole: bool,
}

impl Group {
    fn first_line(&self) -> usize {
        self.rows.first().map_or(0, |r| r.1.line)
    }

    fn last_line(&self) -> usize {
        self.rows.last().map_or(0, |r| r.1.line)
    }

    /// The measured row of each of the group's touches, or the reason why that cannot be told.
    fn measured(&self, search: &Search, machine: &Machine, per_touch: &[Role]) -> Result<Vec<RawTouch>, &'static str> {
        // rows well before the deepest one are ends of moves off the face
        let back = machine.probe.back_off / 2.0;
        let deepest = self.rows.iter().map(|r| r.0).fold(f64::NEG_INFINITY, f64::max);
        let mut runs: Vec<Vec<&(f64, RawTouch)>> = vec![Vec::new()];
        for row in &self.rows {
            if deepest - row.0 > back {
                if runs.last().is_some_and(|r| !r.is_empty()) {
                    runs.push(Vec::new());
                }
            } else if let Some(run) = runs.last_mut() {
                run.push(row);
            }
        }
        runs.retain(|r| !r.is_empty());
        let status = |row: &(f64, RawTouch)| {
            let missed = (search.length - row.0).abs() <= END_ROOM_MM;
            RawTouch { status: if missed { Status::Miss } else { Status::Hit }, ..row.1.clone() }
        };
        let rows_per_touch = per_touch.len().max(1);
        let measure = per_touch.iter().position(|r| *r == Role::Measure).unwrap_or(rows_per_touch - 1);
        let pick = |runs: &[Vec<&(f64, RawTouch)>]| match runs {
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
                let unbroken =
                    self.rows.windows(2).any(|w| w[1].1.line == first.1.line && w[0].1.line + 1 == first.1.line);
                if unbroken { Ok(status(first)) } else { Err("a line before the measuring touch is lost") }
            }
            [] => Err("no row"),
        };
        if self.count == 1 {
            return pick(&runs).map(|row| vec![row]);
        }
        // several touches at one place: only full sets of rows, or whole pairs of runs, can be shared out
        if let [run] = &runs[..]
            && run.len() == rows_per_touch * self.count
        {
            return Ok(run.chunks(rows_per_touch).filter_map(|c| c.get(measure)).map(|r| status(r)).collect());
        }
        if runs.len() == 2 * self.count {
            return runs.chunks(2).map(pick).collect();
        }
        Err("the touches are made at the same place, and the rows cannot be shared out among them")
    }
}
