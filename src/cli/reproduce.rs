//! `axiscal reproduce`: the paper's tables and its statements of rank.

use super::{Answer, Io};
use crate::diag::{Failure, Result};
use crate::machine::Machine;
use crate::model::catalogue::Catalogue;
use crate::paper::ranks;
use crate::paper::tables::{self, Bench, Table};
use crate::program;
use crate::program::plan::Plan;
use crate::report::fit::{number, table};
use crate::workflow::load_machines;
use comfy_table::Cell;
use serde_json::json;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Distance from the B pivot to the ball's centre, mm (the paper prints none)
    #[arg(long, value_name = "MM", default_value_t = 202.684)]
    pub z_b: f64,
}

/// # Errors
/// When `--z-b` is no length.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    if !(args.z_b.is_finite() && args.z_b > 0.0) {
        return Err(Failure::new("cli::z_b", format!("--z-b {} is no length", args.z_b)).help("mm, greater than 0"));
    }
    let machines = load_machines(None, io)?;
    let catalogue = Catalogue::built_in()?;
    let (head, head_plan) = bench(&machines, "swivel-head", "head", args.z_b)?;
    let (table_machine, table_plan) = bench(&machines, "swivel-head", "table", args.z_b)?;
    let (double, double_plan) = bench(&machines, "double-head", "double-head", args.z_b)?;
    let tables = tables::all(
        Bench { machine: &head, plan: &head_plan, catalogue: &catalogue },
        Bench { machine: &table_machine, plan: &table_plan, catalogue: &catalogue },
        Bench { machine: &double, plan: &double_plan, catalogue: &catalogue },
    )?;
    let ranks = ranks::statements(&machines)?;
    for t in &tables {
        say(t, io);
    }
    let mut r = table(&["machine", "unknowns", "poses (B, A)", "number", "rank"]);
    for s in &ranks {
        r.add_row(vec![
            Cell::new(&s.machine),
            Cell::new(&s.unknowns),
            Cell::new(&s.poses),
            number(s.number),
            number(s.rank),
        ]);
    }
    io.say("\"deviation\" is closed form less given, \"least squ.\" the deviation of the least squares, \"print\" whether both equal the\nprinted line at four decimals\n");
    io.say(format!("What poses can determine (x, y, z of the ball at each):\n{r}"));
    let n_rows = tables.iter().map(|t| t.rows.len()).sum::<usize>();
    let n_equal = tables.iter().flat_map(|t| &t.rows).filter(|r| r.equals_print()).count();
    io.say(format!(
        "{n_equal} of {n_rows} lines equal the print at four decimals, by closed form and by least squares"
    ));
    io.answer(&json!({ "format": "axiscal-paper/1", "z_b_mm": args.z_b, "ranks": ranks, "tables": tables }));
    Ok(Answer::Done)
}

/// A machine with another tool length, and a program's touches on it (whether they can be reached is not asked).
fn bench(machines: &[Machine], machine: &str, name: &str, z_b: f64) -> Result<(Machine, Plan)> {
    let mut machine = machines
        .iter()
        .find(|m| m.name == machine)
        .cloned()
        .ok_or_else(|| Failure::new("paper::machine", format!("machine {machine:?} is missing")))?;
    machine.tool.length_mm = z_b;
    let spec = program::choose(program::built_in()?, name, &machine)?;
    let plan = program::plan_without_path(&machine, &spec)?;
    Ok((machine, plan))
}

fn say(t: &Table, io: &Io) {
    let mode = t.mode.as_ref().map_or_else(String::new, |m| format!(", mode {m}"));
    let mut out = table(&["parameter", "unit", "given", "closed form", "deviation", "least squ.", "print"]);
    for r in &t.rows {
        out.add_row(vec![
            Cell::new(&r.parameter),
            Cell::new(&r.unit),
            number(format!("{:.4}", r.given)),
            number(format!("{:.12}", r.closed_form)),
            number(format!("{:+.3e}", r.closed_form - r.given)),
            number(format!("{:+.1e}", r.least_squares - r.given)),
            Cell::new(if r.equals_print() { "equal" } else { "differs" }),
        ]);
    }
    io.say(format!("Table {}, set {}{mode}\n{out}\n", t.table, t.set));
}
