//! The verbs: arguments as typed → records → functions of `workflow` → what is printed. A file per verb.
//!
//! Only this room writes outputs and reads the clock and the environment's variables. Exit codes: 0 done (warnings included), 1 the answer is
//! "no", 2 the input or the call was unusable.

mod add;
mod artefacts;
mod assess;
mod centres;
mod check;
mod common;
mod compare;
mod completions;
mod controllers;
mod demo;
mod diagnose;
mod effects;
mod export;
mod generate;
mod guard;
mod identify;
mod machines;
mod new;
mod parse;
mod plan_next;
mod programs;
mod report;
mod reproduce;
mod schema;
mod simulate;
mod sketch_effect;
mod solve;
mod verify;
mod workbench;

pub use common::{Answer, Io};

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measures the errors of a five-axis machine with its own touch probe, finds missing effects, and writes the compensation.
#[derive(Debug, Parser)]
#[command(name = "axiscal", version, about, propagate_version = true, arg_required_else_help = true)]
struct Cli {
    /// One JSON object on stdout, messages on stderr
    #[arg(long, global = true)]
    json: bool,
    /// Largest input that is read, in bytes; K, M and G are accepted
    #[arg(long, global = true, value_name = "BYTES", default_value = "2G", value_parser = crate::files::read_size)]
    max_input: u64,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run the whole loop on built-in data: programs, virtual machine, logs, fit, tables
    Demo(demo::Args),
    /// List the machines that are built in or found, or show one
    Machines(machines::Args),
    /// List the effects that are built in or found, or show one
    Effects(effects::Args),
    /// List the artefacts that are built in, or show one
    Artefacts(artefacts::Args),
    /// List the controllers that are built in or found, or show one
    Controllers(controllers::Args),
    /// List the probing programs that are built in or found, or show one
    Programs(programs::Args),
    /// Before the first touch: what a plan can determine, and what it cannot
    Assess(assess::Args),
    /// Write an NC probing program and its plan
    Generate(generate::Args),
    /// Read an NC program back, run it on the virtual machine: limits, collisions, unguarded moves, touches, settings
    Check(check::Args),
    /// Run the virtual machine: write the log that the controller would have written
    Simulate(simulate::Args),
    /// Read a controller's log into a touches CSV
    Parse(parse::Args),
    /// Print the paper's tables: given, identified, deviation
    Reproduce(reproduce::Args),
    /// Write a study: the measured runs and the effects of the model
    New(Box<new::Args>),
    /// Identify the machine's errors from a study
    Identify(identify::Args),
    /// Find the physical effect that is missing: verdict, candidates, and what these touches cannot separate
    Diagnose(diagnose::Args),
    /// Diagnose, add the missing effect, fit again, until the model is complete
    Solve(solve::Args),
    /// Write a starting formula for what no known effect explains
    SketchEffect(sketch_effect::Args),
    /// Compare model and measurement: where it fails, and on what that depends
    Compare(compare::Args),
    /// Write the probing program that best separates what the data cannot
    PlanNext(plan_next::Args),
    /// Add effects to the study's model, fit again, and print what changed
    Add(add::Args),
    /// Remove effects from the study's model, fit again, and print what changed
    Remove(add::Args),
    /// All models tried so far, with their residual and their cross-validated error
    History(add::HistoryArgs),
    /// Compare two studies: did the compensation work, has the machine changed?
    Verify(verify::Args),
    /// Write the compensation as the controller's own tables
    Export(export::Args),
    /// Open a study in the browser: switch effects on and off and watch the error
    Workbench(workbench::Args),
    /// Write one page with the verdict, the plots and every touch; it needs no network
    Report(report::Args),
    /// Print the JSON schema of a file, for editors
    Schema(schema::Args),
    /// Print the completions of verbs and options for a shell
    Completions(completions::CompletionArgs),
    /// Write the manual pages
    Man(completions::ManArgs),
}

/// Runs the program with the arguments of the process.
#[must_use]
pub fn main() -> ExitCode {
    guard::listen();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        // clap exits with 2 for a bad call and 0 for --help and --version, which is what scripts rely on
        Err(e) => e.exit(),
    };
    let io = Io::new(cli.json);
    crate::files::set_max_input(cli.max_input);
    io.finish(guard::guarded(|| dispatch(cli.verb, &io)))
}

/// Another verb, called by one of them with the words that a user would type.
fn call(words: &[String], io: &Io) -> crate::diag::Result<Answer> {
    let typed = std::iter::once("axiscal").chain(words.iter().map(String::as_str));
    let cli = Cli::try_parse_from(typed).map_err(|e| {
        crate::diag::Failure::new("cli::call", e.to_string()).help("report this: it is a fault of the program")
    })?;
    // a step may write over what the one before has read
    crate::files::forget_inputs();
    dispatch(cli.verb, io)
}

fn dispatch(verb: Verb, io: &Io) -> crate::diag::Result<Answer> {
    match verb {
        Verb::Demo(args) => demo::run(&args, io),
        Verb::Machines(args) => machines::run(&args, io),
        Verb::Effects(args) => effects::run(&args, io),
        Verb::Artefacts(args) => artefacts::run(&args, io),
        Verb::Controllers(args) => controllers::run(&args, io),
        Verb::Programs(args) => programs::run(&args, io),
        Verb::Assess(args) => assess::run(&args, io),
        Verb::Generate(args) => generate::run(&args, io),
        Verb::Check(args) => check::run(&args, io),
        Verb::Simulate(args) => simulate::run(&args, io),
        Verb::Parse(args) => parse::run(&args, io),
        Verb::Reproduce(args) => reproduce::run(&args, io),
        Verb::New(args) => new::run(&args, io),
        Verb::Identify(args) => identify::run(&args, io),
        Verb::Diagnose(args) => diagnose::run(&args, io),
        Verb::Solve(args) => solve::run(&args, io),
        Verb::SketchEffect(args) => sketch_effect::run(&args, io),
        Verb::Compare(args) => compare::run(&args, io),
        Verb::PlanNext(args) => plan_next::run(&args, io),
        Verb::Add(args) => add::add(&args, io),
        Verb::Remove(args) => add::remove(&args, io),
        Verb::History(args) => add::history(&args, io),
        Verb::Verify(args) => verify::run(&args, io),
        Verb::Export(args) => export::run(&args, io),
        Verb::Workbench(args) => workbench::run(&args, io),
        Verb::Report(args) => report::run(&args, io),
        Verb::Schema(args) => schema::run(&args, io),
        Verb::Completions(args) => completions::completions(&args, io),
        Verb::Man(args) => completions::man(&args, io),
    }
}
