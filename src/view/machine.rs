//! The machine as it is drawn.

use super::Material;
use super::record::{AxisRecord, BlockRecord, MachineRecord, SolidRecord};
use crate::machine::{Shape, Side};

pub(super) fn machine(m: &Material) -> MachineRecord {
    let machine = m.machine;
    let three = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z];
    let axes = machine.axes.iter().map(|a| AxisRecord {
        name: a.name.to_string(),
        rotary: a.name.is_rotary(),
        side: if a.side == Side::Workpiece { "workpiece" } else { "tool" },
        direction: three(&a.direction),
        point: three(&a.point),
        range: a.range,
    });
    let solids = machine.solids.iter().map(|s| match s.shape {
        Shape::Box { centre, size } => SolidRecord {
            name: s.name.clone(),
            carrier: s.carrier.to_string(),
            at: three(&centre),
            size: Some(three(&size)),
            direction: None,
            radius_height: None,
        },
        Shape::Cylinder { foot, direction, radius, height } => SolidRecord {
            name: s.name.clone(),
            carrier: s.carrier.to_string(),
            at: three(&foot),
            size: None,
            direction: Some(three(&direction)),
            radius_height: Some([radius, height]),
        },
    });
    let mut blocks: Vec<BlockRecord> = Vec::new();
    for (run, r) in m.runs.iter().enumerate() {
        for b in &r.touches.blocks {
            // the same blocks in several runs or mountings are drawn once
            if !blocks.iter().any(|k| k.centre == b.centre && k.size == b.size && k.carrier == b.carrier) {
                blocks.push(BlockRecord {
                    name: b.name.clone(),
                    carrier: b.carrier.clone(),
                    form: b.form,
                    centre: b.centre,
                    size: b.size,
                    diameter: b.diameter,
                    run: run + 1,
                });
            }
        }
    }
    MachineRecord {
        name: machine.name.clone(),
        says: machine.says.clone(),
        axes: axes.collect(),
        pivot: three(&machine.tool.pivot),
        tool_direction: three(&machine.tool.direction),
        tool_length_mm: machine.tool.length_mm,
        solids: solids.collect(),
        blocks,
    }
}
