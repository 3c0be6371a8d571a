//! `axiscal machines`: what is built in or found, one line each; `machines show NAME` prints one.

use super::{Answer, Io};
use crate::diag::Result;
use crate::machine::artefact::one_machine;
use crate::machine::{Axis, Carrier, Machine, Side};
use crate::report::fit::{number, table};
use crate::units::um_from_mm;
use crate::workflow::{load_machine, load_machines, machines_file};
use comfy_table::Cell;
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// `show NAME` prints one machine
    #[command(subcommand)]
    pub what: Option<MachinesCommand>,
    /// A machines.toml of your own (default: the one built in)
    #[arg(long, value_name = "FILE", global = true)]
    pub machines: Option<PathBuf>,
}

/// What to print.
#[derive(Debug, clap::Subcommand)]
pub enum MachinesCommand {
    /// Print one machine
    Show {
        /// Its name
        name: String,
        /// As a file: to save, change and use with --machines FILE
        #[arg(long)]
        toml: bool,
    },
}

/// # Errors
/// When the file is unusable or there is no such machine.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    match &args.what {
        Some(MachinesCommand::Show { name, toml: false }) => {
            show(&load_machine(name, args.machines.as_deref(), io)?, io);
        }
        Some(MachinesCommand::Show { name, toml: true }) => {
            // a machine that cannot be used is no template
            load_machine(name, args.machines.as_deref(), io)?;
            let text = one_machine(&machines_file(args.machines.as_deref(), io)?, name)?;
            io.say(text.trim_end());
            io.answer(&json!({ "name": name, "text": text }));
        }
        None => {
            let machines = load_machines(args.machines.as_deref(), io)?;
            let mut t = table(&["machine", "workpiece side", "tool side", "what it is"]);
            for m in &machines {
                t.add_row(vec![m.name.clone(), letters(m, Side::Workpiece), letters(m, Side::Tool), m.says.clone()]);
            }
            io.say(t.to_string());
            io.answer(&json!({ "machines": machines.iter().map(as_json).collect::<Vec<_>>() }));
        }
    }
    Ok(Answer::Done)
}

fn letters(m: &Machine, side: Side) -> String {
    m.side(side).map(|a| a.name.to_string()).collect::<Vec<_>>().join(" ")
}

fn show(m: &Machine, io: &Io) {
    io.say(format!("{}: {}\n", m.name, m.says));
    let mut t = table(&["axis", "side", "direction", "point, mm", "direction of +", "range (machine)", "indexing, µm"]);
    for a in &m.axes {
        let d = a.direction;
        let [low, high] = machine_range(m, a);
        t.add_row(vec![
            Cell::new(a.name),
            Cell::new(if a.side == Side::Tool { "tool" } else { "workpiece" }),
            Cell::new(format!("{} {} {}", d.x, d.y, d.z)),
            Cell::new(if a.name.is_rotary() {
                format!("{} {} {}", a.point.x, a.point.y, a.point.z)
            } else {
                "-".into()
            }),
            number(if a.name.is_rotary() { format!("{:+}", a.sense) } else { "-".into() }),
            number(format!("{low} … {high} {}", if a.name.is_rotary() { "deg" } else { "mm" })),
            number(if a.name.is_rotary() {
                let assumed = if m.assumed_indexing.contains(&a.name) { " (assumed)" } else { "" };
                format!("{}{assumed}", um_from_mm(a.indexing_repeatability_mm))
            } else {
                "-".into()
            }),
        ]);
    }
    io.say(t.to_string());
    io.say("ranges in machine coordinates; directions, points and centres in R");
    let p = &m.probe;
    io.say(format!(
        "tool: {} mm from the pivot to the ball's centre\nprobe: ball {} mm, stem {} x {} mm, body {} x {} mm, head {} mm (diameters); repeatability {} um, overtravel {} mm\n       search {} mm/min, measuring touch {} mm/min, protected positioning {} mm/min",
        m.tool.length_mm, 2.0 * p.ball_radius, 2.0 * p.stem_radius, p.stem_length, 2.0 * p.body_radius, p.body_length, 2.0 * p.head_radius, p.repeatability_um, p.overtravel, p.fast_feed, p.slow_feed, p.position_feed
    ));
    for s in &m.styli {
        io.say(format!("stylus {:?}: {} ({:+} mm, ball {} mm)", s.name, s.says, s.longer, 2.0 * s.ball_radius));
    }
    for mounting in &m.mountings {
        io.say(format!("mounting {:?}: {} (carried by {})", mounting.name, mounting.says, mounting.carrier));
        for b in &mounting.blocks {
            let riser = b.riser.map_or_else(String::new, |r| format!(", on a riser of {} mm", r.height));
            let own = b.carrier != mounting.carrier;
            let borne = if own { format!(", carried by {}", b.carrier) } else { String::new() };
            io.say(format!(
                "  block {:<3} centre {} {} {} mm, edges {} {} {} mm{riser}{borne}",
                b.name, b.centre.x, b.centre.y, b.centre.z, b.size.x, b.size.y, b.size.z
            ));
        }
    }
    io.answer(&as_json(m));
}

/// As the file has it: what the control shows.
fn machine_range(m: &Machine, a: &Axis) -> [f64; 2] {
    let origin = m.origin.get(a.name).unwrap_or(0.0);
    // the way to R and back leaves its rounding: no control shows less than a nanometre
    a.range.map(|end| ((end + origin) * 1e6).round() / 1e6)
}

fn as_json(m: &Machine) -> serde_json::Value {
    let axes: Vec<_> = m
        .axes
        .iter()
        .map(|a| {
            json!({ "name": a.name, "side": if a.side == Side::Tool { "tool" } else { "workpiece" },
                "kind": if a.name.is_rotary() { "rotary" } else { "linear" },
                "direction": a.direction.as_slice(), "point_mm": a.point.as_slice(), "sense": a.sense, "range": a.range,
                "range_machine": machine_range(m, a),
                "indexing_repeatability_um": a.name.is_rotary().then(|| um_from_mm(a.indexing_repeatability_mm)),
                "indexing_repeatability_assumed": m.assumed_indexing.contains(&a.name) })
        })
        .collect();
    let mountings: Vec<_> = m
        .mountings
        .iter()
        .map(|x| {
            json!({ "name": x.name, "says": x.says, "carrier": carrier(x.carrier),
                "blocks": x.blocks.iter().map(|b| json!({ "name": b.name, "carrier": carrier(b.carrier), "centre": b.centre.as_slice(), "size": b.size.as_slice() })).collect::<Vec<_>>() })
        })
        .collect();
    let styli: Vec<_> = m
        .styli
        .iter()
        .map(|s| json!({ "name": s.name, "says": s.says, "longer_mm": s.longer, "ball_radius_mm": s.ball_radius }))
        .collect();
    json!({ "name": m.name, "says": m.says, "workpiece_side": letters(m, Side::Workpiece), "tool_side": letters(m, Side::Tool),
        "axes": axes, "tool_length_mm": m.tool.length_mm, "ball_radius_mm": m.probe.ball_radius, "styli": styli, "mountings": mountings, "sha256": m.sha256 })
}

fn carrier(c: Carrier) -> String {
    c.to_string()
}
