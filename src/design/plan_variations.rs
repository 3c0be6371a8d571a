//! Habits of good measurement as data: what else could be touched (or looked up), and what it costs.

use super::linearised_plan::{Known, MOUNTING_S, Planned, STYLUS_S};
use super::vary::{Change, Visit, again, append, duration_s, faces_the_spindle, visits};
use crate::axes::{AxisMap, AxisName};
use crate::geometry::apply;
use crate::machine::{Axis, Machine, Side};
use crate::model::predict::{Model, SetUp};
use crate::program::plan::{Plan, PlanBlock, PlanTouch};
use nalgebra::Vector3;
use std::collections::{BTreeSet, HashSet};

/// A stylus that is this much longer, mm, where the machine's file knows no other.
const LONGER_MM: f64 = 100.0;

/// A block that stands this much higher, mm.
const HIGHER_MM: f64 = 40.0;

/// Faster touches: times the feed.
const FASTER: f64 = 4.0;

/// Standard uncertainty of a certified distance between two blocks or of a ring gauge, mm.
const CERTIFIED_MM: f64 = 0.0005;

/// Standard uncertainty of an edge that was indicated along an axis, deg: 0.5 µm over 100 mm.
const INDICATED_DEG: f64 = 0.0003;

/// Reading a certificate into the study, or indicating an edge, s.
const CERTIFICATE_S: f64 = 300.0;

/// Angles of an axis that swivels which may be added, deg.
const SWIVELS_DEG: [f64; 10] = [-15.0, 30.0, -45.0, -75.0, 60.0, 15.0, -60.0, 45.0, -90.0, 90.0];

/// New angles that one variation takes.
const NEW_ANGLES: usize = 3;

/// A variation of the planned touches.
#[derive(Debug, Clone)]
pub struct Variation {
    /// Short word, unique.
    pub id: String,
    /// What a person does.
    pub says: String,
    /// Further visits at the end of a run, by its place among the runs.
    pub added: Vec<(usize, Vec<Vec<PlanTouch>>)>,
    /// A further block, and the run in which it stands.
    pub block: Option<(usize, PlanBlock)>,
    /// What is known beside the touches.
    pub known: Vec<Known>,
    /// Further touches.
    pub touches: usize,
    /// What it takes, s.
    pub seconds: f64,
}

impl Variation {
    /// The runs with the further touches at their ends: made when they are asked for, since each is as long as all that was measured.
    #[must_use]
    pub fn runs(&self, before: &[Planned]) -> Vec<Planned> {
        let mut runs = before.to_vec();
        if let Some((run, block)) = &self.block {
            runs[*run].plan.blocks.push(block.clone());
        }
        for (run, visits) in &self.added {
            append(&mut runs[*run].plan, visits.clone());
        }
        runs
    }

    /// Touches that a further program could make: of the blocks as they stand, with a stylus that the machine's file knows. A
    /// gauge is no touch, and a riser or a star is nothing that a program has.
    #[must_use]
    pub fn is_a_program(&self, machine: &Machine) -> bool {
        let bought = match self.id.as_str() {
            "riser" | "second-block" | "downward-face" => true,
            "other-stylus" => machine.styli.is_empty(),
            _ => false,
        };
        self.touches > 0 && !bought
    }
}

/// All variations that this machine and these runs allow, cheapest first. `model` names the blocks' unknowns.
#[must_use]
pub fn variations(machine: &Machine, runs: &[Planned], model: &Model) -> Vec<Variation> {
    let mut pool = Pool { machine, runs, model, out: Vec::new() };
    let all: Vec<Visit> = runs.iter().enumerate().flat_map(|(i, r)| visits(i, &r.plan)).collect();
    pool.at_the_best(&all);
    for axis in machine.rotary() {
        pool.both_sides(&all, axis);
        pool.other_angles(&all, axis);
    }
    pool.other_stylus(&all);
    pool.all_faces(&all);
    pool.downward_face(&all);
    pool.higher_block(&all);
    pool.second_block(&all);
    pool.revisit(&all);
    pool.certificates();
    pool.out.sort_by(|a, b| a.seconds.total_cmp(&b.seconds).then_with(|| a.id.cmp(&b.id)));
    pool.out
}

struct Pool<'a> {
    machine: &'a Machine,
    runs: &'a [Planned],
    model: &'a Model,
    out: Vec<Variation>,
}

impl Pool<'_> {
    fn plan(&self, run: usize) -> &Plan {
        &self.runs[run].plan
    }

    /// Puts a variation into the pool unless nothing of it can be touched.
    fn push(&mut self, id: &str, says: String, added: Vec<(usize, Vec<Vec<PlanTouch>>)>, more_s: f64) {
        self.push_all(id, says, added, None, more_s);
    }

    fn push_all(
        &mut self,
        id: &str,
        says: String,
        added: Vec<(usize, Vec<Vec<PlanTouch>>)>,
        block: Option<(usize, PlanBlock)>,
        more_s: f64,
    ) {
        let touches = added.iter().flat_map(|(_, visits)| visits).map(Vec::len).sum();
        let seconds = more_s + added.iter().map(|(_, visits)| duration_s(visits)).sum::<f64>();
        if touches > 0 {
            self.out.push(Variation { id: id.into(), says, added, block, known: Vec::new(), touches, seconds });
        }
    }

    fn once_more(&self, visit: &Visit, change: &Change) -> Vec<PlanTouch> {
        let plan = self.plan(visit.run);
        visit.light().iter().filter_map(|t| again(self.machine, plan, t, change)).collect()
    }

    /// The visit with the most faces, late ones first: the blocks still stand there.
    fn best<'v, 'p>(all: &'v [Visit<'p>]) -> Option<&'v Visit<'p>> {
        all.iter().max_by_key(|v| v.light().len())
    }

    fn at_the_best(&mut self, all: &[Visit]) {
        let Some(best) = Self::best(all) else { return };
        let stands = best.touches.first().and_then(|t| t.spindle_deg).unwrap_or(0.0);
        let turned = |by: f64| Change { spindle_deg: Some(stands + by), ..Change::default() };
        let (half, quarter) = (self.once_more(best, &turned(180.0)), self.once_more(best, &turned(90.0)));
        self.push(
            "spindle-180",
            "turn the spindle by 180° (M19) and touch again".into(),
            vec![(best.run, vec![half.clone()])],
            0.0,
        );
        self.push(
            "spindle-90-180",
            "turn the spindle by 90° and by 180° (M19) and touch again".into(),
            vec![(best.run, vec![quarter, half])],
            0.0,
        );
        let feed = best.touches.first().and_then(|t| t.feed_mm_min).unwrap_or(self.machine.probe.slow_feed);
        let faster = self.once_more(best, &Change { feed_mm_min: Some(FASTER * feed), ..Change::default() });
        self.push("feed", format!("touch again at {} times the feed", FASTER), vec![(best.run, vec![faster])], 0.0);
    }

    fn both_sides(&mut self, all: &[Visit], axis: &Axis) {
        let Some(best) = Self::best(all) else { return };
        let come = |sense: f64| Change { from: AxisMap::default().with(axis.name, sense), ..Change::default() };
        let both = vec![self.once_more(best, &come(1.0)), self.once_more(best, &come(-1.0))];
        let id = format!("other-side-{}", axis.name.letter().to_ascii_lowercase());
        self.push(
            &id,
            format!("come to one pose with {} turning up and with it turning down", axis.name),
            vec![(best.run, both)],
            0.0,
        );
    }

    fn other_angles(&mut self, all: &[Visit], axis: &Axis) {
        let [low, high] = axis.range;
        let carried = |t: &PlanTouch| {
            let carrier = self.machine.carrier(&t.carrier);
            axis.side == Side::Tool
                || carrier.is_some_and(|c| self.machine.carrier_chain(c).iter().any(|a| a.name == axis.name))
        };
        let sees: Vec<&Visit> = all.iter().filter(|v| v.touches.iter().any(|t| carried(t))).collect();
        let used: BTreeSet<i64> = sees.iter().map(|v| (v.pose().get(axis.name) * 1e3).round() as i64).collect();
        let is_new = |a: f64| !used.contains(&((a * 1e3).round() as i64));
        let sweeps = high - low >= 350.0;
        let wanted: Vec<f64> = if sweeps { vec![45.0, 135.0, 225.0, 290.0] } else { SWIVELS_DEG.to_vec() };
        let fresh: Vec<f64> = wanted.into_iter().filter(|a| (low..=high).contains(a) && is_new(*a)).collect();
        let mut sets: Vec<(String, Vec<f64>)> = Vec::new();
        let letter = axis.name.letter().to_ascii_lowercase();
        if sweeps {
            sets.push((format!("angle-{letter}"), fresh.iter().copied().take(1).collect()));
        }
        sets.push((format!("angles-{letter}"), fresh.iter().copied().take(NEW_ANGLES).collect()));
        sets.push((format!("more-angles-{letter}"), fresh.iter().copied().take(2 * NEW_ANGLES).collect()));
        let mut last = 0;
        for (id, angles) in sets {
            let mut added: Vec<(usize, Vec<Vec<PlanTouch>>)> = Vec::new();
            let mut said = Vec::new();
            for &angle in &angles {
                // from the visit that has most faces left at the new angle
                let change = Change { pose: AxisMap::default().with(axis.name, angle), ..Change::default() };
                let best = sees.iter().map(|v| (v.run, self.once_more(v, &change))).max_by_key(|(_, t)| t.len());
                if let Some((run, touches)) = best.filter(|(_, t)| !t.is_empty()) {
                    added.push((run, vec![touches]));
                    said.push(format!("{angle}°"));
                }
            }
            if said.len() > last {
                last = said.len();
                self.push(&id, format!("touch at {} = {} too", axis.name, said.join(", ")), added, 0.0);
            }
        }
    }

    fn other_stylus(&mut self, all: &[Visit]) {
        let Some(first) = all.first() else { return };
        let own = self.plan(first.run).tool_length_mm;
        let longer = self.machine.styli.iter().map(|s| s.longer).fold(0.0, f64::max);
        let length = self.machine.tool.length_mm + if longer > 0.0 { longer } else { LONGER_MM };
        let change = Change { length_mm: Some(length), ..Change::default() };
        // one visit for each place of the axes that turn the tool, else of all
        let turns_tool: Vec<AxisName> =
            self.machine.rotary().filter(|a| a.side == Side::Tool).map(|a| a.name).collect();
        let key_of =
            |v: &Visit| -> Vec<i64> { turns_tool.iter().map(|a| (v.pose().get(*a) * 1e3).round() as i64).collect() };
        // where the plan uses it already, it is no other one
        let has_it = |v: &&Visit| {
            let is =
                |t: &&PlanTouch| (t.tool_length_mm.unwrap_or(self.plan(v.run).tool_length_mm) - length).abs() < 0.5;
            v.touches.iter().any(is)
        };
        let used: Vec<Vec<i64>> = all.iter().filter(has_it).map(key_of).collect();
        let mut seen: Vec<Vec<i64>> = Vec::new();
        let mut added = Vec::new();
        for v in all {
            let key = key_of(v);
            if !used.contains(&key) && !seen.contains(&key) && seen.len() < 4 {
                let touches = self.once_more(v, &change);
                if !touches.is_empty() {
                    seen.push(key);
                    added.push((v.run, vec![touches]));
                }
            }
        }
        self.push(
            "other-stylus",
            format!("change to a stylus of another length ({:+.0} mm) and touch again", length - own),
            added,
            STYLUS_S,
        );
    }

    fn all_faces(&mut self, all: &[Visit]) {
        let mut added: Vec<(usize, Vec<Vec<PlanTouch>>)> = Vec::new();
        let mut where_at: BTreeSet<String> = BTreeSet::new();
        // a plan touches few places, each of them in many poses
        let places: Vec<Vec<&PlanTouch>> = self.runs.iter().map(|run| places(&run.plan)).collect();
        for v in all {
            let plan = self.plan(v.run);
            let Some(like) = v.touches.first() else { continue };
            let here = |n: &[f64; 3], block: &str| v.touches.iter().any(|t| t.block == block && t.normal == *n);
            let mut light: Vec<PlanTouch> = Vec::new();
            for &t in &places[v.run] {
                let of_visit =
                    v.touches.iter().any(|o| o.block == t.block && o.carrier == t.carrier && o.mounting == t.mounting);
                let of_face = |o: &&PlanTouch| o.block == t.block && o.normal == t.normal;
                if !of_visit
                    || here(&t.normal, &t.block)
                    || light.iter().filter(of_face).count() >= 2
                    || light.iter().any(|o| o.point == t.point)
                {
                    continue;
                }
                let change = Change {
                    pose: like.pose,
                    spindle_deg: like.spindle_deg,
                    length_mm: like.tool_length_mm,
                    from: like.from,
                    ..Change::default()
                };
                light.extend(again(self.machine, plan, t, &change));
            }
            if !light.is_empty() {
                for t in &light {
                    where_at.insert(format!("{} at {}", in_r(self.machine, t), pose_words(&t.pose)));
                }
                added.push((v.run, vec![light]));
            }
        }
        if !where_at.is_empty() {
            let list: Vec<String> = where_at.into_iter().take(4).collect();
            self.push(
                "all-faces",
                format!("touch the faces that are not touched yet ({})", list.join(", ")),
                added,
                0.0,
            );
        }
    }

    fn downward_face(&mut self, all: &[Visit]) {
        let upright =
            |v: &Visit| self.machine.tool_frame(&v.pose()).rotation * self.machine.tool.direction.into_inner();
        let lies = |v: &Visit| upright(v).z.abs() < 0.3;
        // where the spindle lies a straight stylus comes to it, else a disc or a star
        let star = !all.iter().any(lies);
        let change = Change { star, ..Change::default() };
        let found = all.iter().filter(|v| star || lies(v)).find_map(|v| {
            let plan = self.plan(v.run);
            let top = v.touches.iter().find(|t| {
                let carrier = self.machine.carrier(&t.carrier);
                carrier.is_some_and(|c| {
                    let n = self.machine.carrier_frame(c, &v.pose()).rotation * Vector3::from(t.normal);
                    n.z > 0.9
                })
            })?;
            let block = plan.block_of(top)?;
            let below: Vec<PlanTouch> = v
                .touches
                .iter()
                .filter(|t| t.block == top.block && t.normal == top.normal)
                .take(3)
                .filter_map(|t| {
                    let (n, p, c) = (Vector3::from(t.normal), Vector3::from(t.point), Vector3::from(block.centre));
                    let other = p - n * (2.0 * (p - c).dot(&n));
                    let face = turned_face(&t.face);
                    let mirrored = PlanTouch { point: other.into(), normal: (-n).into(), face, ..(*t).clone() };
                    again(self.machine, plan, &mirrored, &change)
                })
                .collect();
            (!below.is_empty()).then(|| (v.run, vec![below]))
        });
        if let Some(added) = found {
            let (with, more_s) = if star { (" with a disc or a star on the stylus,", STYLUS_S) } else { ("", 0.0) };
            self.push(
                "downward-face",
                format!("touch a face that looks down,{with} on a block that overhangs what bears it"),
                vec![added],
                MOUNTING_S + more_s,
            );
        }
    }

    /// A block once more, standing elsewhere: its place and tilt are unknown again.
    fn moved_block(
        &mut self,
        (id, says): (&str, &str),
        all: &[Visit],
        (run, of): (usize, &PlanTouch),
        place: impl Fn(&Vector3<f64>) -> Vector3<f64>,
        most: usize,
    ) {
        let plan = self.plan(run).clone();
        let Some(block) = plan.block_of(of).cloned() else { return };
        let name = format!("{} {id}", block.name);
        let mut fresh = block.clone();
        fresh.name.clone_from(&name);
        fresh.centre = place(&Vector3::from(block.centre)).into();
        let shift = Vector3::from(fresh.centre) - Vector3::from(block.centre);
        let mut added = Vec::new();
        let mut poses: Vec<AxisMap> = Vec::new();
        for v in all.iter().filter(|v| v.run == run) {
            let Some(first) = v.touches.first() else { continue };
            if poses.contains(&first.pose) || poses.len() >= most {
                continue;
            }
            let own = Visit {
                run,
                touches: v.touches.iter().copied().filter(|t| t.block == of.block && t.carrier == of.carrier).collect(),
            };
            let there: Vec<PlanTouch> = own
                .light()
                .into_iter()
                .map(|t| PlanTouch { block: name.as_str().into(), point: (Vector3::from(t.point) + shift).into(), ..t })
                .filter_map(|t| again(self.machine, &plan, &t, &Change::default()))
                .collect();
            if !there.is_empty() {
                poses.push(first.pose);
                added.push(there);
            }
        }
        self.push_all(id, says.into(), vec![(run, added)], Some((run, fresh)), MOUNTING_S);
    }

    fn higher_block(&mut self, all: &[Visit]) {
        let Some((run, first)) = Self::best(all).and_then(|v| Some((v.run, (*v.touches.first()?).clone()))) else {
            return;
        };
        let says = format!("put a block {HIGHER_MM} mm higher (a riser) and touch it in the same poses");
        self.moved_block(("riser", &says), all, (run, &first), |c| c + Vector3::z() * HIGHER_MM, 4);
    }

    /// A block on the other side of the axis that carries it, where it stands there alone.
    fn second_block(&mut self, all: &[Visit]) {
        for (run, planned) in self.runs.iter().enumerate() {
            for axis in self.machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()) {
                let letter = axis.name.to_string();
                let on_it: Vec<&str> =
                    planned.plan.blocks.iter().filter(|b| b.carrier == letter).map(|b| b.name.as_str()).collect();
                let Some(first) = planned.plan.touches.iter().find(|t| t.carrier == letter).cloned() else { continue };
                if on_it.len() != 1 {
                    continue;
                }
                let half = crate::geometry::rotation_about(&axis.point, &axis.direction, std::f64::consts::PI);
                let says = format!("put a second block on the other side of {letter} and touch it in the same poses");
                self.moved_block(("second-block", &says), all, (run, &first), |c| apply(&half, c), usize::MAX);
                return;
            }
        }
    }

    fn revisit(&mut self, all: &[Visit]) {
        let mut added = Vec::new();
        for run in 0..self.runs.len() {
            let own: Vec<&Visit> = all.iter().filter(|v| v.run == run).collect();
            let picked = [0, own.len() / 2];
            let again: Vec<Vec<PlanTouch>> =
                picked.iter().filter_map(|&i| own.get(i)).map(|v| self.once_more(v, &Change::default())).collect();
            if run + 1 == self.runs.len() {
                added.push((run, again));
            }
        }
        self.push("revisit", "come back to the first index position and to a middle one at the end".into(), added, 0.0);
    }

    /// What is known without a touch of this program.
    fn certificates(&mut self) {
        let named = |name: &str| self.model.unknowns.iter().any(|u| u.name == name);
        let set_ups = self.model.set_ups();
        let group = |s: &SetUp| s.label.rsplit_once('/').map_or_else(String::new, |(g, _)| g.to_owned());
        let mut known = Vec::new();
        let mut longest: Option<(f64, &SetUp, &SetUp)> = None;
        for (i, a) in set_ups.iter().enumerate() {
            for b in &set_ups[..i] {
                let apart = (a.centre - b.centre).norm();
                if a.carrier == b.carrier && group(a) == group(b) && longest.is_none_or(|l| apart > l.0) {
                    longest = Some((apart, a, b));
                }
            }
        }
        if let Some((apart, a, b)) = longest.filter(|l| l.0 > 0.0) {
            let along = (a.centre - b.centre) / apart;
            let sum: Vec<(String, f64)> = ["SX", "SY", "SZ"]
                .iter()
                .zip(along.iter())
                .flat_map(|(d, c)| [(format!("{d}@{}", a.label), *c), (format!("{d}@{}", b.label), -*c)])
                .filter(|(_, c)| c.abs() > 1e-9)
                .collect();
            if sum.iter().all(|(name, _)| named(name)) {
                let says = format!("have the distance of blocks {} and {} certified ({apart:.0} mm)", b.label, a.label);
                known.push(("certified-distance", says, vec![Known { sum, sigma: CERTIFIED_MM }]));
            }
        }
        if let Some(s) = set_ups.iter().max_by_key(|s| matches!(s.carrier, crate::machine::Carrier::Axis(_))) {
            let rows: Vec<Known> = ["SA", "SB", "SC"]
                .iter()
                .map(|d| Known { sum: vec![(format!("{d}@{}", s.label), 1.0)], sigma: INDICATED_DEG })
                .filter(|k| k.sum.iter().all(|(name, _)| named(name)))
                .collect();
            if !rows.is_empty() {
                let at = if self.machine.axis(AxisName::C).is_some() { " at C = 0" } else { "" };
                let says = format!(
                    "indicate the edges of block {} along the linear axes{at} (a calibrated direction)",
                    s.label
                );
                known.push(("calibrated-direction", says, rows));
            }
        }
        if named("pretravel") {
            let row = Known { sum: vec![("pretravel".into(), 1.0)], sigma: CERTIFIED_MM };
            known.push((
                "ring-gauge",
                "calibrate the ball in a ring gauge or on a sphere of known size".into(),
                vec![row],
            ));
        }
        for (id, says, known) in known {
            self.out.push(Variation {
                id: id.into(),
                says,
                added: Vec::new(),
                block: None,
                known,
                touches: 0,
                seconds: CERTIFICATE_S,
            });
        }
    }
}

/// The first touch of each place on a block.
fn places(plan: &Plan) -> Vec<&PlanTouch> {
    let mut seen = HashSet::new();
    let place = |t: &PlanTouch| (t.mounting.clone(), t.carrier.clone(), t.block.clone(), t.point.map(f64::to_bits));
    plan.touches.iter().filter(|t| seen.insert((place(t), t.normal.map(f64::to_bits)))).collect()
}

/// The machine direction into which a face looks, in words.
fn in_r(machine: &Machine, t: &PlanTouch) -> String {
    let Some(carrier) = machine.carrier(&t.carrier) else { return t.face.to_string() };
    let n = machine.carrier_frame(carrier, &t.pose.position()).rotation * Vector3::from(t.normal);
    debug_assert!(faces_the_spindle(machine, carrier, &t.pose.position(), &t.normal.into()));
    let axis = n.iamax();
    format!("{}{}", if n[axis] > 0.0 { '+' } else { '-' }, ["X", "Y", "Z"][axis])
}

fn pose_words(pose: &AxisMap) -> String {
    pose.iter().map(|(a, v)| format!("{a} = {v}°")).collect::<Vec<_>>().join(", ")
}

/// `+Z` ↔ `-Z`.
fn turned_face(face: &str) -> String {
    match face.split_at_checked(1) {
        Some(("+", rest)) => format!("-{rest}"),
        Some(("-", rest)) => format!("+{rest}"),
        _ => face.to_owned(),
    }
}
