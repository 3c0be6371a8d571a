//! `axiscal assess`: what a plan will be able to tell, before the first touch.

use super::common::MachineArgs;
use super::identify::reference;
use super::{Answer, Io};
use crate::design::{Noise, Planned, Request, Task, assess};
use crate::diag::{Failure, Result};
use crate::fit::effects_of;
use crate::machine::Machine;
use crate::program::plan::Plan;
use crate::program::{self, Options};
use crate::units::mm_from_um;
use crate::workflow::generate::load_program;
use crate::workflow::new::default_effects;
use crate::workflow::{load_effects, load_plan};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub machine: MachineArgs,
    /// A plan.json, a program by name or a program file; several runs of one study with commas (head,table). Repeat it to
    /// see plans side by side
    #[arg(long, required = true, value_name = "PLAN[,PLAN…]")]
    pub plan: Vec<String>,
    /// Effects of the model (default: what `axiscal new` writes)
    #[arg(long, value_delimiter = ',')]
    pub effects: Vec<String>,
    /// The blocks are exactly where the plan says: their positions are not solved for
    #[arg(long)]
    pub known_blocks: bool,
    /// A file with effects of your own
    #[arg(long, value_name = "FILE")]
    pub effects_file: Vec<PathBuf>,
    /// Standard deviation of a touch, µm (default: the probe's repeatability in the machine's file)
    #[arg(long, value_name = "UM", allow_hyphen_values = true)]
    pub noise_um: Option<f64>,
    /// Scatter of the ball's place from one index to the next, µm (default: as the machine's file declares it; the
    /// uncertainty from probe noise alone leaves it out)
    #[arg(long, value_name = "UM", allow_hyphen_values = true)]
    pub visit_um: Option<f64>,
    /// Where location errors of workpiece-side axes are stated: pivot, ball, table, or X,Y,Z in mm in R
    #[arg(long, value_name = "POINT", default_value = "pivot", allow_hyphen_values = true)]
    pub reference: String,
    /// No touch will carry a temperature
    #[arg(long)]
    pub no_temperature: bool,
}

/// # Errors
/// When machine, plan or effects are unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let machine = args.machine.load(io)?;
    let catalogue = load_effects(&args.effects_file, io)?;
    let noise_um = args.noise_um.unwrap_or(machine.probe.repeatability_um);
    let unusable = |word: &str, um: f64, least: &str| {
        Err(Failure::new("assess::noise", format!("{word} is {um}, expected micrometres, {least}"))
            .help("write micrometres: --noise-um above 0, --visit-um 0 or more"))
    };
    let usable = |um: f64, least: f64| um.is_finite() && um >= least && um < 1e6;
    if !usable(noise_um, 1e-6) {
        return unusable("--noise-um", noise_um, "above 0");
    }
    if let Some(um) = args.visit_um.filter(|um| !usable(*um, 0.0)) {
        return unusable("--visit-um", um, "0 or more");
    }
    let mut asked = Vec::new();
    for words in &args.plan {
        let names: Vec<String> = words.split(',').map(|w| w.trim().to_owned()).filter(|w| !w.is_empty()).collect();
        let plans = names.iter().map(|w| plan_of(w, &machine, io)).collect::<Result<Vec<Plan>>>()?;
        asked.push((names, plans));
    }
    let ids = if args.effects.is_empty() {
        let plans: Vec<&Plan> = asked.iter().flat_map(|(_, plans)| plans).collect();
        default_effects(&machine, &plans, args.known_blocks)
    } else {
        args.effects.clone()
    };
    let task = Task {
        machine: &machine,
        catalogue: &catalogue,
        effects: effects_of(&ids, &catalogue, &machine)?,
        held: Vec::new(),
        reference: reference(&args.reference, &machine)?,
        temperature: !args.no_temperature,
    };
    let mut answers = Vec::new();
    for (names, plans) in asked {
        answers.push(assess(&Request {
            task: task.clone(),
            runs: plans.into_iter().map(Planned::new).collect(),
            names,
            probe: Noise { sigma_mm: mm_from_um(noise_um), tau_mm: 0.0 },
            acting_tau_mm: args.visit_um.map(mm_from_um),
        })?);
    }
    let mut answers = answers.into_iter();
    let Some(mut first) = answers.next() else { return Ok(Answer::Done) };
    first.compared = answers.collect();
    io.say(crate::report::assess::assessment(&first, io.paper(false)));
    io.answer(&first);
    Ok(Answer::Done)
}

/// A plan by file, or of a program by name or file.
///
/// # Errors
/// When it is unusable or not for this machine.
pub(super) fn plan_of(word: &str, machine: &Machine, io: &Io) -> Result<Plan> {
    if word.ends_with(".json") {
        return load_plan(Path::new(word), machine, io);
    }
    let spec = load_program(word, machine, io)?;
    let (generated, findings) = program::generate(machine, &spec, &Options::default())?;
    io.report(&findings.0);
    Ok(generated.plan)
}
