//! The verbs: arguments as typed → records → functions of `workflow` → what is printed. A file per verb.
//!
//! Only this room writes outputs and reads the clock and the environment's variables. Exit codes: 0 done (warnings included), 1 the answer is
//! "no", 2 the input or the call was unusable.

mod add;
mod assess;
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
mod next;
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

/// A five-axis machine measures itself with its own touch probe, learns what is wrong with it, and is put right.
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
    /// The whole loop on built-in data: programs, virtual machine, logs, fit, tables
    Demo(demo::Args),
    /// List the machines that are built in or found, or show one
    Machines(machines::Args),
    /// List the effects that are built in or found, or show one
    Effects(effects::Args),
    /// List the controllers that are built in or found, or show one
    Controllers(controllers::Args),
    /// List the probing programs that are built in or found, or show one
    Programs(programs::Args),
    /// Before the first touch: what a plan will be able to tell, and what it cannot
    Assess(assess::Args),
    /// Write an NC probing program and its plan
    Generate(generate::Args),
    /// Read an NC program back, run it on the virtual machine: limits, collisions, unguarded moves, touches, settings
    Check(check::Args),
    /// The virtual machine: write the log that the controller would have written
    Simulate(simulate::Args),
    /// Read a controller's log into a touches CSV
    Parse(parse::Args),
    /// The paper's tables: given, identified, deviation
    Reproduce(reproduce::Args),
    /// Write a study: which runs were measured and what the model holds
    New(new::Args),
    /// Identify the machine's errors from a study
    Identify(identify::Args),
    /// Which physical effect is missing: verdict, candidates, and what these touches cannot tell apart
    Diagnose(diagnose::Args),
    /// The loop, step by step: diagnose, add, look again, until nothing is left to find
    Solve(solve::Args),
    /// Write a starting formula for what no known effect explains
    SketchEffect(sketch_effect::Args),
    /// Model against measurement: where it fails, and on what that depends
    Compare(compare::Args),
    /// The probing program that best separates what the data cannot tell apart
    PlanNext(plan_next::Args),
    /// Put effects into the study's model, refit, and say what that changed
    Add(add::Args),
    /// Take effects out of the study's model, refit, and say what that changed
    Remove(add::Args),
    /// The ladder: every model tried, with its error on the touches and on touches left out
    History(add::HistoryArgs),
    /// Two studies side by side: did the compensation work, has the machine changed?
    Verify(verify::Args),
    /// Write the compensation as the controller's own tables
    Export(export::Args),
    /// A study live in the browser: switch effects on and off and watch the error
    Workbench(workbench::Args),
    /// One page with the verdict, the plots and every touch: opens with no network
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
