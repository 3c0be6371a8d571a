use super::*;
use crate::axes::AxisMap;
use crate::machine::Machine;
use crate::program::path::{self, Step, TouchStep};
use crate::program::plan::{ControllerFrame, Plan};

pub(crate) fn machine(name: &str) -> Machine {
    let (machines, _) = crate::machine::load(&source("m", crate::machine::BUILT_IN)).unwrap();
    machines.into_iter().find(|m| m.name == name).unwrap()
}

/// A plan of a few touches on one block of a mounting: two down on its upper face, one from the side, at rotary zero.
pub(crate) fn plan(machine: &Machine, mounting: &str, block: &str) -> Plan {
    let mounting = machine.mounting(mounting).unwrap();
    let b = mounting.blocks.iter().find(|b| b.name == block).unwrap();
    let ball = machine.tool.ball_at_zero(machine.tool.length_mm);
    let pose: serde_json::Map<_, _> = machine.rotary().map(|a| (a.name.to_string(), 0.0.into())).collect();
    let touch = |id: u64, face: &str, point: [f64; 3], normal: [f64; 3]| {
        let along = |off: f64| {
            let p = |i: usize| point[i] + normal[i] * (3.0 + off) - ball[i];
            serde_json::json!({"X": p(0), "Y": p(1), "Z": p(2)})
        };
        serde_json::json!({"id": id, "stage": "t", "carrier": mounting.carrier.to_string(), "block": block, "face": face,
            "point": point, "normal": normal, "pose": pose, "start": along(2.0), "nominal": along(0.0), "end": along(-2.0),
            "first": id == 1})
    };
    let c = b.centre;
    let json = serde_json::json!({"format": "axiscal-plan/1", "machine": machine.name, "program": "t",
        "mounting": mounting.name, "ball_radius_mm": 3.0, "tool_length_mm": machine.tool.length_mm,
        "blocks": [{"name": block, "carrier": mounting.carrier.to_string(), "centre": [c.x, c.y, c.z], "size": [b.size.x, b.size.y, b.size.z]}],
        "touches": [touch(1, "+Z", [c.x - 2.0, c.y, c.z + 5.0], [0.0, 0.0, 1.0]),
                    touch(2, "+Z", [c.x + 2.0, c.y + 1.0, c.z + 5.0], [0.0, 0.0, 1.0]),
                    touch(3, "+X", [c.x + 5.0, c.y, c.z + 2.0], [1.0, 0.0, 0.0])]});
    Plan::parse(&source("plan", json.to_string())).unwrap().0
}

/// A path over the plan's touches, by hand: up, turn, over, down, touch, back.
pub(crate) fn path(plan: &Plan, probe: &crate::machine::as_written::Probe) -> path::Path {
    let high = 60.0;
    let z = |v: f64| AxisMap::default().with(AxisName::Z, v);
    let mut steps = vec![
        Step::Note("up first".into()),
        Step::Rapid { to: z(high) },
        Step::Rotary { to: plan.touches[0].pose, sense: AxisMap::default() },
        Step::Rapid { to: AxisMap::default().with(AxisName::X, 0.0) },
        Step::Rapid { to: AxisMap::default().with(AxisName::Y, 0.0) },
    ];
    for (i, t) in plan.touches.iter().enumerate() {
        if i != 1 {
            steps.push(Step::Setup { number: 1 + u32::from(i > 1), says: format!("face {}", t.face) });
        }
        let start = t.start;
        for axis in [AxisName::X, AxisName::Y] {
            steps.push(Step::Rapid { to: AxisMap::default().with(axis, start.get(axis).unwrap()) });
        }
        steps.push(Step::Protected { to: z(start.get(AxisName::Z).unwrap()), feed: probe.position_feed });
        steps.push(Step::Touch(TouchStep {
            id: t.id,
            says: format!("block {} face {}", t.block, t.face),
            start,
            nominal: t.nominal,
            end: t.end,
            pose: t.pose,
            first: t.first,
            tolerance_mm: probe.placement_tolerance,
            search_feed: if t.first { probe.slow_feed } else { probe.fast_feed },
            measure_feed: probe.slow_feed,
            back_off_mm: probe.back_off,
        }));
        let axis = if t.face == "+X" { AxisName::X } else { AxisName::Z };
        let to = AxisMap::default().with(axis, start.get(axis).unwrap());
        steps.push(Step::Retract { to, feed: probe.position_feed });
        steps.push(Step::Protected { to: z(high), feed: probe.position_feed });
    }
    path::Path { head: vec!["three touches (by hand), about 1 min".into()], steps, seconds: 60.0, start_near: None }
}

fn program_of(name: &str, mounting: &str, block: &str, frame: ControllerFrame) -> String {
    let machine = machine(name);
    let mut plan = plan(&machine, mounting, block);
    plan.controller_frame = frame;
    let path = path(&plan, &machine.probe);
    let post = Postprocessor::load_built_in_or_file("linuxcnc").unwrap().0;
    let program = post.program(&machine, &plan, &path).unwrap_or_else(|e| panic!("{:#?}", e.0));
    if let Some(folder) = option_env!("AXISCAL_KEEP") {
        let stem = format!("{folder}/{name}-{frame:?}");
        std::fs::write(format!("{stem}.ngc"), &program.text).unwrap();
        std::fs::write(format!("{stem}.plan.json"), plan.to_json()).unwrap();
    }
    program.text
}

#[test]
fn what_is_shipped_can_be_used() {
    let all = Postprocessor::built_in().unwrap_or_else(|e| panic!("{:#?}", e.0));
    assert_eq!(all[0].name, "linuxcnc");
    assert!(all[0].unverified.is_empty());
    program_of("swivel-head", "head", "x+", ControllerFrame::Axes);
}
