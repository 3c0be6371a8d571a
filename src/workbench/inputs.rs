//! What the page is told once for each reading of the files: touches, effects, words, the machine and its index positions.

use super::desk::Desk;
use super::draft::MEANING;
use super::record::{FORMAT, Message, bytes, messages, short};
use super::session::Snapshot;
use crate::compare::variables::plot_variables;
use crate::machine::Shape;
use crate::model::formula::FUNCTIONS;
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Serialize)]
struct Inputs<'a> {
    format: &'static str,
    inputs: u64,
    study: String,
    remarks: Vec<Message>,
    runs: Vec<RunRecord<'a>>,
    effects: Vec<EffectRecord<'a>>,
    words: Words,
    controllers: Vec<String>,
    effects_file: String,
    machine: MachineRecord<'a>,
    touches: Touches,
    variables: Vec<Variable>,
}

#[derive(Serialize)]
struct RunRecord<'a> {
    plan: &'a str,
    log: &'a str,
    controller: &'a str,
}

#[derive(Serialize)]
struct EffectRecord<'a> {
    id: &'a str,
    name: &'a str,
    family: &'a str,
    says: &'a str,
    look: &'a str,
    mends: &'a str,
    own: bool,
    nuisance: bool,
    paper: bool,
    formulas: Vec<String>,
}

/// What the formula box offers.
#[derive(Serialize)]
struct Words {
    variables: Vec<FormulaVariable>,
    functions: &'static [&'static str],
    places: Vec<PlaceWord>,
    units: &'static [&'static str],
}

#[derive(Serialize)]
struct FormulaVariable {
    name: &'static str,
    says: &'static str,
    /// Lowest and highest value in these touches.
    range: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct PlaceWord {
    at: String,
    says: String,
    dofs: Vec<&'static str>,
}

#[derive(Serialize)]
struct MachineRecord<'a> {
    name: &'a str,
    says: &'a str,
    solids: Vec<Solid<'a>>,
    blocks: Vec<Block<'a>>,
    axes: Vec<AxisRecord>,
    /// Each index position: where the parts of the machine stand there.
    poses: Vec<Pose>,
}

/// An index position.
#[derive(Serialize)]
struct Pose {
    /// Number of the visit, from 1.
    visit: usize,
    /// Rotary axes, deg.
    says: String,
    /// By carrier: rows of rotation and translation, mm, of its frame in R.
    frames: BTreeMap<String, [f64; 12]>,
    /// Pivot and ball of the nominal tool in R, mm, with the linear axes at the mean of their touches.
    tool: [[f64; 3]; 2],
}

#[derive(Serialize)]
struct AxisRecord {
    name: String,
    rotary: bool,
    direction: [f64; 3],
    point: [f64; 3],
}

#[derive(Serialize)]
struct Solid<'a> {
    name: &'a str,
    carrier: String,
    at: [f64; 3],
    size: Option<[f64; 3]>,
    direction: Option<[f64; 3]>,
    radius_height: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct Block<'a> {
    name: &'a str,
    carrier: String,
    centre: [f64; 3],
}

/// Every touch that the model can use.
#[derive(Serialize, Default)]
struct Touches {
    n: usize,
    run: Vec<usize>,
    id: Vec<u64>,
    line: Vec<usize>,
    /// Words that `stage`, `block`, `face` and `carrier` count, from 0.
    words: Vec<String>,
    stage: Vec<usize>,
    block: Vec<usize>,
    face: Vec<usize>,
    visit: Vec<usize>,
    /// What carries the artefact.
    carrier: Vec<usize>,
    axes: BTreeMap<String, Vec<f64>>,
    time_h: Vec<f64>,
    approach_deg: Vec<Option<f64>>,
    /// Pivot to ball, mm.
    stylus_mm: Vec<f64>,
    /// Nominal contact point and outward normal, in the carrier's frame.
    point: Vec<[f64; 3]>,
    normal: Vec<[f64; 3]>,
    /// Outward normal in R at the touch.
    normal_r: Vec<[f64; 3]>,
}

/// What residuals are drawn against.
#[derive(Serialize)]
struct Variable {
    id: String,
    title: String,
}

/// What stays the same until other data are read.
#[must_use]
pub fn inputs(now: &Snapshot) -> Vec<u8> {
    let opened = &*now.opened;
    let machine = &*opened.machine;
    let applying = opened.catalogue.iter().filter(|e| e.applies_to(machine) && !e.discrete);
    let points = crate::compare::points(&now.fit);
    let variables =
        plot_variables(machine, &points).into_iter().map(|v| Variable { title: v.title_on_page(), id: v.id }).collect();
    bytes(&Inputs {
        format: FORMAT,
        inputs: now.inputs,
        study: opened.name(),
        remarks: messages(&opened.remarks),
        runs: opened
            .study
            .data
            .iter()
            .map(|d| RunRecord { plan: &d.plan, log: &d.log, controller: &d.controller })
            .collect(),
        effects: applying
            .map(|e| EffectRecord {
                id: &e.id,
                name: &e.name,
                family: &e.family,
                says: &e.says,
                look: &e.look,
                mends: &e.mends,
                own: !e.built_in,
                nuisance: e.nuisance,
                paper: e.paper,
                formulas: e.terms.iter().take(8).map(|t| t.formula.text().to_owned()).collect(),
            })
            .collect(),
        words: words(now),
        controllers: Desk::controllers(),
        effects_file: Desk::effects_file(&opened.study),
        variables,
        machine: machine_record(now),
        touches: touches(now, points),
    })
}

fn words(now: &Snapshot) -> Words {
    let range = |slot: usize| {
        let values = now.fit.data.observations.iter().map(|o| o.state[slot]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (low <= high).then_some([low, high])
    };
    let motion = ["dx", "dy", "dz", "rx", "ry", "rz"];
    let mut places: Vec<PlaceWord> = Vec::new();
    for a in &now.opened.machine.axes {
        let says = format!("error motion of axis {}, in the frame that it moves in", a.name);
        places.push(PlaceWord { at: a.name.to_string(), says, dofs: motion.to_vec() });
    }
    let fixed: [(&str, &str, &[&'static str]); 6] = [
        ("base", "between the tool's chain and the workpiece's, in the machine's frame", &motion),
        ("tool", "of the tool, in its own frame", &motion),
        ("workpiece", "of what bears the workpiece", &motion),
        ("block", "of each touched block, about its centre", &motion),
        ("trigger", "of the probe's trigger, along the approach: positive comes late", &["r"]),
        ("reading", "of what the control shows for an axis", &["X", "Y", "Z", "A", "B", "C"]),
    ];
    for (at, says, dofs) in fixed {
        places.push(PlaceWord { at: at.into(), says: says.into(), dofs: dofs.to_vec() });
    }
    Words {
        variables: MEANING
            .iter()
            .enumerate()
            .map(|(slot, (name, says))| FormulaVariable { name, says, range: range(slot) })
            .collect(),
        functions: &FUNCTIONS,
        places,
        units: &["um", "mm", "urad", "mrad", "deg", "um/m", "um/h", "um/K", "ppm/K", "ms", "s", "h", "1"],
    }
}

fn machine_record(now: &Snapshot) -> MachineRecord<'_> {
    let machine = &*now.opened.machine;
    let three = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z];
    let solids = machine.solids.iter().map(|s| match s.shape {
        Shape::Box { centre, size } => Solid {
            name: &s.name,
            carrier: s.carrier.to_string(),
            at: three(&centre),
            size: Some(three(&size)),
            direction: None,
            radius_height: None,
        },
        Shape::Cylinder { foot, direction, radius, height } => Solid {
            name: &s.name,
            carrier: s.carrier.to_string(),
            at: three(&foot),
            size: None,
            direction: Some(three(&direction)),
            radius_height: Some([radius, height]),
        },
    });
    let set_ups = &now.opened.data.set_ups;
    MachineRecord {
        name: &machine.name,
        says: &machine.says,
        solids: solids.collect(),
        blocks: set_ups
            .iter()
            .map(|s| Block { name: &s.label, carrier: s.carrier.to_string(), centre: three(&s.centre) })
            .collect(),
        poses: poses(now),
        axes: machine
            .axes
            .iter()
            .map(|a| AxisRecord {
                name: a.name.to_string(),
                rotary: a.name.is_rotary(),
                direction: three(&a.direction),
                point: three(&a.point),
            })
            .collect(),
    }
}

/// Index positions in their order; the linear axes at the mean of the touches there.
fn poses(now: &Snapshot) -> Vec<Pose> {
    let (machine, data) = (&*now.opened.machine, &now.fit.data);
    let carriers: std::collections::BTreeMap<String, crate::machine::Carrier> = machine
        .solids
        .iter()
        .map(|s| s.carrier)
        .chain(data.set_ups.iter().map(|s| s.carrier))
        .map(|c| (c.to_string(), c))
        .collect();
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, visit) in data.visits.iter().enumerate() {
        members.entry(visit + 1).or_default().push(i);
    }
    let pose = |(visit, members): (usize, Vec<usize>)| {
        let mut at = data.observations[members[0]].position;
        for axis in machine.axes.iter().filter(|a| !a.name.is_rotary()) {
            let sum: f64 = members.iter().map(|&i| data.observations[i].position.get(axis.name)).sum();
            at.set(axis.name, sum / members.len() as f64);
        }
        let rotary = machine.axes.iter().filter(|a| a.name.is_rotary());
        let says: Vec<String> = rotary.map(|a| format!("{} {}°", a.name, short(at.get(a.name), 1e3))).collect();
        let frames = carriers.iter().map(|(name, carrier)| {
            let frame = machine.carrier_frame(*carrier, &at).to_homogeneous();
            let row = |r: usize| [0, 1, 2, 3].map(|c| short(frame[(r, c)], 1e6));
            let [a, b, c] = [row(0), row(1), row(2)];
            (name.clone(), [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], c[0], c[1], c[2], c[3]])
        });
        let tool_frame = machine.tool_frame(&at);
        let ends = [machine.tool.pivot, machine.tool.ball_at_zero(machine.tool.length_mm)];
        let tool = ends.map(|p| {
            let p = crate::geometry::apply(&tool_frame, &p);
            [p.x, p.y, p.z].map(|v| short(v, 1e3))
        });
        Pose { visit, says: says.join(", "), frames: frames.collect(), tool }
    };
    members.into_iter().map(pose).collect()
}

fn touches(now: &Snapshot, points: Vec<crate::compare::Point>) -> Touches {
    let mut out = Touches { n: points.len(), ..Touches::default() };
    let mut known: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
    let mut words: Vec<String> = Vec::new();
    let mut word = |text: String| {
        *known.entry(text).or_insert_with_key(|text| {
            words.push(text.clone());
            words.len() - 1
        })
    };
    let position = |x: f64| short(x, 1e5);
    let three = |v: &nalgebra::Vector3<f64>| [position(v.x), position(v.y), position(v.z)];
    for (p, o) in points.into_iter().zip(&now.fit.data.observations) {
        out.run.push(p.run);
        out.id.push(p.id);
        out.line.push(p.line);
        out.stage.push(word(p.stage));
        out.block.push(word(p.block));
        out.face.push(word(p.face));
        out.visit.push(p.visit);
        out.carrier.push(word(now.fit.data.set_ups[o.set_up].carrier.to_string()));
        for (name, value) in p.axes {
            out.axes.entry(name).or_default().push(position(value));
        }
        out.time_h.push(short(p.time_h, 1e6));
        out.approach_deg.push(p.approach_deg.map(|a| short(a, 1e3)));
        out.stylus_mm.push(short(p.stylus_mm, 1e4));
        out.point.push(three(&o.point));
        out.normal.push(three(&o.normal));
        out.normal_r.push(p.normal.map(position));
    }
    out.words = words;
    out
}
