//! The one check of a plan: what it says by itself, and what it says of a machine. Every verb that reads a plan runs both.

use super::plan::{FORMAT, Plan, PlanBlock, PlanTouch};
use crate::axes::{AxisMap, Position};
use crate::diag::{Finding, Findings, Source, in_json};
use crate::machine::{BallPlaces, Form, Machine};
use crate::units::Plain;
use nalgebra::Vector3;
use std::collections::BTreeSet;

/// No coordinate of a plan is larger, mm or deg: more is a slip of the pen.
const LARGEST: f64 = 1e5;

/// No ball of a probe is larger, radius in mm.
const LARGEST_BALL_MM: f64 = 100.0;

/// A normal is a direction: its length may be off 1 by this.
const NORMAL_LENGTH: f64 = 1e-6;

/// Point, normal, nominal, pose and tool length of a touch agree to this, mm, in plans that `generate` wrote for the machine as it is
/// described now: they hold nine decimals, and an edit of a hundredth would make an error of the machine.
const AGREES_AS_GENERATED_MM: f64 = 0.002;

/// The same in other plans, which may hold fewer digits than they were computed with.
const AGREES_MM: f64 = 0.05;

/// Points of what is round lie on its surface to this, mm.
const ROUND_MM: f64 = 0.001;

/// Positions may be this far beyond the ranges of the axes, mm and deg: a description may have changed since the plan was made.
const BEYOND_RANGE_MM: f64 = 100.0;
const BEYOND_RANGE_DEG: f64 = 10.0;

/// Which part of a plan a fault is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Plan,
    /// A block by its place in the list.
    Block(usize),
    /// A touch by its place in the list.
    Touch(usize),
}

/// Something that cannot be so. A fault of one kind is said once, at the first place that has it.
#[derive(Debug, Clone, PartialEq)]
struct Fault {
    code: &'static str,
    part: Part,
    field: &'static str,
    says: String,
    help: &'static str,
    /// Further places with a fault of this kind.
    more: usize,
}

/// What cannot be so in a plan, each kind once with its first place.
#[derive(Debug, Default)]
pub struct Faults(Vec<Fault>);

impl Faults {
    fn add(&mut self, code: &'static str, (part, field): (Part, &'static str), help: &'static str, says: String) {
        match self.0.iter_mut().find(|f| f.code == code) {
            Some(first) => first.more += 1,
            None => self.0.push(Fault { code, part, field, says, help, more: 0 }),
        }
    }

    /// Nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// As errors with their places in the plan's text.
    #[must_use]
    pub fn findings(self, plan: &Plan, source: &Source) -> Findings {
        let finding = |fault: Fault| {
            let (entry, which) = match fault.part {
                Part::Plan => (None, String::new()),
                Part::Block(i) => (Some(("blocks", i)), format!("block {:?}: ", plan.blocks[i].name)),
                Part::Touch(i) => (Some(("touches", i)), format!("touch {}: ", plan.touches[i].id)),
            };
            let more = match (fault.more, fault.part) {
                (0, _) => String::new(),
                (n, Part::Touch(_)) => format!(" ({n} more touches)"),
                (n, _) => format!(" ({n} more)"),
            };
            let place = in_json(source.inner(), entry, fault.field).unwrap_or(0..0);
            Finding::error(fault.code, format!("{which}{}{more}", fault.says)).help(fault.help).at(source, place)
        };
        Findings(self.0.into_iter().map(finding).collect())
    }
}

const AGAIN: &str = "make the plan again with `axiscal generate`, or restore the file as it was written";

/// What cannot be so in any plan, on whatever machine.
#[must_use]
pub fn by_itself(plan: &Plan) -> Faults {
    let mut faults = Faults::default();
    if plan.format != FORMAT {
        faults.add(
            "plan::format",
            (Part::Plan, "format"),
            "is this a plan? `axiscal generate` writes NAME.plan.json",
            format!("format is {:?}, expected {FORMAT:?}", plan.format),
        );
    }
    let only_centres = !plan.blocks.is_empty() && plan.blocks.iter().all(|b| b.form.is_centre());
    stylus(&mut faults, Part::Plan, Some(plan.ball_radius_mm), Some(plan.tool_length_mm), only_centres);
    if let Some(mm) = plan.placement_tolerance_mm.filter(|mm| !(0.0..=LARGEST).contains(mm)) {
        let says = format!("placement_tolerance_mm is {}, expected 0 or more", Plain(mm));
        faults.add("plan::number", (Part::Plan, "placement_tolerance_mm"), AGAIN, says);
    }
    for (i, block) in plan.blocks.iter().enumerate() {
        check_block(&mut faults, i, block);
    }
    // plans of our own count upwards: then no number stands twice
    let ascending = plan.touches.is_sorted_by(|a, b| a.id < b.id);
    let mut seen = BTreeSet::new();
    for (i, touch) in plan.touches.iter().enumerate() {
        let part = Part::Touch(i);
        if !ascending && !seen.insert(touch.id) {
            faults.add("plan::id_twice", (part, "id"), AGAIN, "its id stands twice in the plan".to_owned());
        }
        if plan.block_of(touch).is_none() {
            let says = format!("the plan has no block {:?} on carrier {:?}", touch.block, touch.carrier);
            faults.add("plan::no_block", (part, "block"), AGAIN, says);
        }
        check_touch(&mut faults, part, touch);
    }
    faults
}

fn is_coordinate(value: f64) -> bool {
    value.abs() <= LARGEST
}

/// `of_centres`: what something else has measured is the centre itself, without a ball that touches it.
fn stylus(faults: &mut Faults, part: Part, ball_radius_mm: Option<f64>, tool_length_mm: Option<f64>, of_centres: bool) {
    let is_none = |mm: f64| of_centres && mm == 0.0;
    if let Some(mm) = ball_radius_mm.filter(|mm| !(*mm > 0.0 && *mm <= LARGEST_BALL_MM || is_none(*mm))) {
        let says = format!("ball_radius_mm is {}, expected more than 0 and up to {LARGEST_BALL_MM}", Plain(mm));
        faults.add("plan::ball_radius", (part, "ball_radius_mm"), AGAIN, says);
    }
    if let Some(mm) = tool_length_mm.filter(|mm| !(*mm > 0.0 && *mm <= LARGEST)) {
        let says = format!("tool_length_mm is {}, expected more than 0 and up to {LARGEST}", Plain(mm));
        faults.add("plan::tool_length", (part, "tool_length_mm"), AGAIN, says);
    }
}

fn check_block(faults: &mut Faults, i: usize, block: &PlanBlock) {
    if !block.centre.iter().all(|c| is_coordinate(*c)) {
        let says = format!("centre is {:?}, expected mm up to {LARGEST}", block.centre);
        faults.add("plan::block_centre", (Part::Block(i), "centre"), AGAIN, says);
    }
    if !block.size.iter().all(|s| *s > 0.0 && *s <= LARGEST) {
        let says = format!("size is {:?}, expected three edges of more than 0 and up to {LARGEST} mm", block.size);
        faults.add("plan::block_size", (Part::Block(i), "size"), AGAIN, says);
    }
    let fits = match (block.form.is_round(), block.diameter) {
        (false, given) => given.is_none(),
        (true, None) => false,
        // a sphere and a cylinder fill the box that holds them, a hole is narrower
        (true, Some(mm)) if block.form == Form::Bore => mm > 0.0 && mm < block.size[0].min(block.size[1]),
        (true, Some(mm)) => (mm - block.size[0]).abs() < AGREES_MM && (mm - block.size[1]).abs() < AGREES_MM,
    };
    if !fits {
        let given = block.diameter.map_or_else(|| "no diameter".to_owned(), |mm| format!("diameter {} mm", Plain(mm)));
        let says = format!("{} of size {:?} has {given}", block.form.as_str(), block.size);
        faults.add("plan::block_form", (Part::Block(i), "size"), AGAIN, says);
    }
}

fn check_touch(faults: &mut Faults, part: Part, touch: &PlanTouch) {
    let length = touch.normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length.is_nan() || (length - 1.0).abs() >= NORMAL_LENGTH {
        let says = format!("normal has length {}, expected 1", Plain(length));
        faults.add("plan::normal", (part, "normal"), "an outward unit normal is expected", says);
    }
    if !touch.point.iter().all(|x| is_coordinate(*x)) {
        let says = format!("point is {:?}, expected mm up to {LARGEST}", touch.point);
        faults.add("plan::point", (part, "point"), AGAIN, says);
    }
    let maps = [("pose", &touch.pose), ("start", &touch.start), ("nominal", &touch.nominal), ("end", &touch.end)];
    for (field, map) in maps {
        if let Some((axis, value)) = map.iter().find(|(_, value)| !is_coordinate(*value)) {
            let says = format!("{field} has {axis} = {}, expected mm or deg up to {LARGEST}", Plain(value));
            faults.add("plan::position", (part, field), AGAIN, says);
        }
    }
    if touch.start_position() == touch.end_position() {
        let says = "its search ends where it starts".to_owned();
        faults.add("plan::no_search", (part, "end"), AGAIN, says);
    }
    stylus(faults, part, touch.ball_radius_mm, touch.tool_length_mm, false);
    let numbers = [
        // since the program began; a hundred days and more are none
        ("time_s", touch.time_s, 0.0..=1e7),
        ("feed_mm_min", touch.feed_mm_min, f64::MIN_POSITIVE..=1e6),
        ("spindle_deg", touch.spindle_deg, -LARGEST..=LARGEST),
    ];
    for (field, value, range) in numbers {
        if let Some(value) = value.filter(|value| !range.contains(value)) {
            faults.add("plan::number", (part, field), AGAIN, format!("{field} is {}", Plain(value)));
        }
    }
}

/// What cannot be so on this machine: point, normal, nominal, pose and machine must agree.
#[must_use]
pub fn on_machine(plan: &Plan, machine: &Machine) -> Faults {
    let mut faults = Faults::default();
    let placement_mm = plan.placement_tolerance_mm.unwrap_or(machine.probe.placement_tolerance);
    let agrees_mm = match plan.machine_sha256.as_str() {
        "" => AGREES_MM,
        same if same == machine.sha256 => AGREES_AS_GENERATED_MM,
        // a description that has changed since moves the nominal positions: by less than the search allows
        _ => AGREES_MM + placement_mm,
    };
    for (i, touch) in plan.touches.iter().enumerate() {
        let part = Part::Touch(i);
        let Some(carrier) = machine.carrier(&touch.carrier) else {
            let says = format!("carrier {:?} is no part of machine {:?}", touch.carrier, machine.name);
            faults.add("plan::carrier", (part, "carrier"), AGAIN, says);
            continue;
        };
        if !positions(&mut faults, part, touch, machine) {
            continue;
        }
        if let Some(block) = plan.block_of(touch) {
            on_block(&mut faults, part, touch, block, placement_mm + AGREES_MM);
        }
        let length_mm = touch.tool_length_mm.unwrap_or(plan.tool_length_mm);
        let Some(places) = machine.ball_places(carrier, &touch.pose.position(), length_mm) else { continue };
        let ball_radius_mm = touch.ball_radius_mm.unwrap_or(plan.ball_radius_mm);
        at_the_ball(&mut faults, part, touch, &places, ball_radius_mm, agrees_mm);
    }
    faults
}

/// Axes that exist, within their ranges, and rotary axes that stand still; `false`: it is not worth looking further.
fn positions(faults: &mut Faults, part: Part, touch: &PlanTouch, machine: &Machine) -> bool {
    let before = faults.0.iter().map(|f| 1 + f.more).sum::<usize>();
    let maps: [(&'static str, &AxisMap); 4] =
        [("pose", &touch.pose), ("start", &touch.start), ("nominal", &touch.nominal), ("end", &touch.end)];
    for (field, map) in maps {
        for (name, value) in map.iter() {
            let Some(axis) = machine.axis(name) else {
                if value != 0.0 {
                    let says = format!(
                        "{field} has {name} = {}, and machine {:?} has no axis {name}",
                        Plain(value),
                        machine.name
                    );
                    faults.add("plan::unknown_axis", (part, field), AGAIN, says);
                }
                continue;
            };
            let [low, high] = axis.range;
            let (beyond, unit) = if name.is_rotary() { (BEYOND_RANGE_DEG, "deg") } else { (BEYOND_RANGE_MM, "mm") };
            if value < low - beyond || value > high + beyond {
                let says = format!(
                    "{field} has {name} = {} {unit}, far beyond its range of {} to {}",
                    Plain(value),
                    Plain(low),
                    Plain(high)
                );
                faults.add("plan::out_of_range", (part, field), AGAIN, says);
            }
            let turns = name.is_rotary() && touch.pose.get(name).unwrap_or(0.0) != value;
            if turns {
                let says = format!("{field} has {name} = {}, and pose has another angle", Plain(value));
                faults.add("plan::turns", (part, field), AGAIN, says);
            }
        }
    }
    faults.0.iter().map(|f| 1 + f.more).sum::<usize>() == before
}

/// A point is on its block.
fn on_block(faults: &mut Faults, part: Part, touch: &PlanTouch, block: &PlanBlock, within_mm: f64) {
    let off = (0..3).map(|i| (touch.point[i] - block.centre[i]).abs() - block.size[i] / 2.0).fold(0.0, f64::max);
    if off > within_mm {
        let says = format!("point is {off:.3} mm outside of block {:?}", block.name);
        faults.add("plan::off_block", (part, "point"), AGAIN, says);
    }
    // on what is round the normal goes through the middle: a part in a thousand of the radius is a touch of something else
    if let Some(radius) = block.diameter.map(|d| d / 2.0) {
        let normal = Vector3::from(touch.normal);
        let mut arm = Vector3::from(touch.point) - Vector3::from(block.centre);
        let on_end = block.form != Form::Sphere && normal.z.abs() > 0.5;
        let outward = if block.form == Form::Bore { -normal } else { normal };
        if block.form != Form::Sphere {
            arm.z = 0.0;
        }
        let off = (arm - outward * radius).norm();
        if !on_end && off > ROUND_MM {
            let says = format!("point and normal are {off:.3} mm off the surface of {:?}", block.name);
            faults.add("plan::off_block", (part, "point"), AGAIN, says);
        }
    }
}

/// The ball is on the point where the plan says that it triggers, outside of the face before and inside behind.
fn at_the_ball(
    faults: &mut Faults,
    part: Part,
    touch: &PlanTouch,
    places: &BallPlaces,
    ball_radius_mm: f64,
    agrees_mm: f64,
) {
    let (point, normal) = (Vector3::from(touch.point), Vector3::from(touch.normal));
    let linear = |ball: Vector3<f64>| places.linear_for(&ball);
    let expected = linear(point + normal * ball_radius_mm);
    // what the linear axes do per mm away from the face
    let outward = linear(point + normal * (ball_radius_mm + 1.0)) - expected;
    let along = |position: Position| {
        let [x, y, z, ..] = position.0;
        (Vector3::new(x, y, z) - expected).dot(&outward) / outward.norm_squared()
    };
    let [x, y, z, ..] = touch.nominal_position().0;
    let off = (Vector3::new(x, y, z) - expected).norm();
    if off.is_nan() || off > agrees_mm {
        let says = format!(
            "nominal is {off:.3} mm off the position at which the ball touches point with this normal, pose, tool length and machine (X{:.3} Y{:.3} Z{:.3})",
            expected.x, expected.y, expected.z
        );
        faults.add("plan::disagrees", (part, "nominal"), AGAIN, says);
        return;
    }
    let (start, end) = (along(touch.start_position()), along(touch.end_position()));
    if start <= -agrees_mm || end >= agrees_mm || start <= end {
        let says = format!(
            "its search does not go into the face: it starts {start:.3} mm off the contact and ends at {end:.3} mm"
        );
        faults.add("plan::away", (part, "end"), AGAIN, says);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;
    use crate::post::tests::{machine, plan};
    use serde_json::{Value, json};

    /// Codes and places of what is found in a plan after an edit of its JSON.
    fn found(edit: impl Fn(&mut Value)) -> Vec<(&'static str, String)> {
        let machine = machine("swivel-head");
        let text = plan(&machine, "head", "x+").to_json();
        let mut written: Value = serde_json::from_str(&text).unwrap();
        edit(&mut written);
        // a touch in a line of its own, as plans are written
        let edited: Plan = serde_json::from_value(written).unwrap();
        let src = source("p.json", edited.to_json());
        let findings = match Plan::parse(&src) {
            Err(failure) => failure.0,
            Ok((plan, _)) => on_machine(&plan, &machine).findings(&plan, &src).0,
        };
        assert!(findings.iter().all(|f| f.help.is_some()));
        let at = |f: &Finding| src.inner()[f.span.clone().unwrap()].to_owned();
        findings.iter().map(|f| (f.code, at(f))).collect()
    }

    #[test]
    fn an_untouched_plan_has_no_fault() {
        assert_eq!(found(|_| {}), []);
    }

    #[test]
    fn every_fault_has_its_code_and_its_place() {
        type Edit = fn(&mut Value);
        let faults: [(&str, &str, Edit); 26] = [
            ("plan::ball_radius", "0.0", |p| p["ball_radius_mm"] = json!(0.0)),
            ("plan::ball_radius", "-3.0", |p| p["ball_radius_mm"] = json!(-3.0)),
            ("plan::ball_radius", "1000000000000.0", |p| p["ball_radius_mm"] = json!(1e12)),
            ("plan::tool_length", "0.0", |p| p["tool_length_mm"] = json!(0.0)),
            ("plan::tool_length", "1e", |p| p["tool_length_mm"] = json!(1e308)),
            ("plan::ball_radius", "0.0", |p| p["touches"][1]["ball_radius_mm"] = json!(0.0)),
            ("plan::number", "-1.0", |p| p["placement_tolerance_mm"] = json!(-1.0)),
            ("plan::block_size", "[", |p| p["blocks"][0]["size"][1] = json!(0.0)),
            ("plan::block_centre", "[", |p| p["blocks"][0]["centre"][1] = json!(1e9)),
            ("plan::no_block", "\"no\"", |p| p["touches"][1]["block"] = json!("no")),
            ("plan::id_twice", "1", |p| p["touches"][1]["id"] = json!(1)),
            ("plan::normal", "[0.0,0.0,0.9]", |p| p["touches"][1]["normal"] = json!([0, 0, 0.9])),
            ("plan::point", "[", |p| p["touches"][1]["point"][1] = json!(1e300)),
            ("plan::position", "{", |p| p["touches"][1]["start"]["X"] = json!(-1e7)),
            ("plan::no_search", "{", |p| p["touches"][1]["end"] = p["touches"][1]["start"].clone()),
            ("plan::number", "0.0", |p| p["touches"][1]["feed_mm_min"] = json!(0.0)),
            ("plan::carrier", "\"B\"", |p| {
                // a block and its touches on an axis that carries no workpiece
                p["blocks"][0]["carrier"] = json!("B");
                p["touches"].as_array_mut().unwrap().iter_mut().for_each(|t| t["carrier"] = json!("B"));
            }),
            ("plan::unknown_axis", "{", |p| p["touches"][1]["pose"]["A"] = json!(10.0)),
            ("plan::out_of_range", "{", |p| p["touches"][1]["start"]["Z"] = json!(5000.0)),
            ("plan::turns", "{", |p| p["touches"][1]["end"]["B"] = json!(3.0)),
            ("plan::off_block", "[", |p| p["blocks"][0]["centre"][0] = json!(60.0)),
            ("plan::disagrees", "{", |p| {
                p["touches"][1]["point"][1] = json!(p["touches"][1]["point"][1].as_f64().unwrap() + 0.4)
            }),
            ("plan::disagrees", "{", |p| p["touches"][1]["normal"] = json!([0.0, 0.0, -1.0])),
            ("plan::disagrees", "{", |p| p["touches"][1]["pose"]["B"] = json!(5.0)),
            ("plan::disagrees", "{", |p| p["tool_length_mm"] = json!(203.0)),
            ("plan::away", "{", |p| {
                let t = &mut p["touches"][1];
                let (start, end) = (t["start"].clone(), t["end"].clone());
                (t["start"], t["end"]) = (end, start);
            }),
        ];
        for (i, (code, place, edit)) in faults.into_iter().enumerate() {
            let found = found(edit);
            let it = found.iter().find(|f| f.0 == code);
            assert!(it.is_some_and(|f| f.1.starts_with(place)), "{i} {code}: {found:?}");
            // one mistake is one message
            assert_eq!(found.len(), 1, "{i} {code}: {found:?}");
        }
    }

    #[test]
    fn a_fault_of_all_touches_is_said_once_and_names_the_first() {
        let machine = machine("swivel-head");
        let mut plan = plan(&machine, "head", "x+");
        plan.touches.iter_mut().for_each(|t| t.point[1] = 100.0);
        let faults = on_machine(&plan, &machine);
        assert_eq!(faults.0.len(), 2, "{faults:?}");
        assert!(faults.0.iter().all(|f| f.part == Part::Touch(0) && f.more == plan.touches.len() - 1), "{faults:?}");
    }

    /// Positions with few digits, a description that was changed a little, an axis beyond its range by little.
    #[test]
    fn what_is_only_rounded_or_a_little_older_is_no_fault() {
        let machine = machine("swivel-head");
        let mut plan = plan(&machine, "head", "x+");
        plan.touches.iter_mut().for_each(|t| t.point[1] += 0.02);
        assert!(on_machine(&plan, &machine).is_empty());
        plan.touches.iter_mut().for_each(|t| t.point[1] += 0.3);
        assert!(!on_machine(&plan, &machine).is_empty());
        plan.machine_sha256 = "of an earlier description".to_owned();
        assert!(on_machine(&plan, &machine).is_empty());
    }

    /// In a plan of this description of the machine an edit of some micrometres is seen.
    #[test]
    fn what_was_generated_agrees_to_two_micrometres() {
        let machine = machine("swivel-head");
        let mut plan = plan(&machine, "head", "x+");
        plan.machine_sha256.clone_from(&machine.sha256);
        let z = plan.touches[1].nominal_position().0[2];
        plan.touches[1].nominal.set(crate::axes::AxisName::Z, z + 0.0005);
        assert!(on_machine(&plan, &machine).is_empty());
        for (length_mm, radius_mm) in [(0.005, 0.0), (0.0, 0.005)] {
            let mut edited = plan.clone();
            edited.tool_length_mm += length_mm;
            edited.ball_radius_mm += radius_mm;
            let faults = on_machine(&edited, &machine);
            let found: Vec<(&str, Part)> = faults.0.iter().map(|f| (f.code, f.part)).collect();
            assert_eq!(found, [("plan::disagrees", Part::Touch(0))]);
        }
    }

    #[test]
    fn every_plan_that_is_generated_passes() {
        let specs = crate::program::built_in().unwrap();
        let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
        let mut checked = 0;
        for machine in &machines {
            let mut names: Vec<&str> = specs.iter().map(|s| s.name.as_str()).collect();
            names.dedup();
            for name in names {
                let Ok(spec) = crate::program::choose(specs.clone(), name, machine) else { continue };
                for tcp in [false, true] {
                    let options = crate::program::Options { tcp, ..Default::default() };
                    let Ok((made, _)) = crate::program::generate(machine, &spec, &options) else { continue };
                    let src = source("p.json", made.plan.to_json());
                    let (read, _) = Plan::parse(&src).unwrap();
                    let faults = on_machine(&read, machine);
                    assert!(faults.is_empty(), "{} {name} tcp {tcp}: {faults:?}", machine.name);
                    checked += 1;
                }
            }
        }
        assert!(checked >= 2 * machines.len(), "{checked}");
    }
}
