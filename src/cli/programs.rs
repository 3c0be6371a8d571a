//! `axiscal programs`: what is built in, one line each; `programs show NAME` prints the set-ups of one.

use super::{Answer, Io};
use crate::diag::{Failure, Result, source};
use crate::files;
use crate::program::layout::{Layout, lay_out};
use crate::program::{self, ProgramSpec, pose_says};
use crate::report::fit::{number, table};
use crate::workflow::generate::is_file;
use crate::workflow::load_machine;
use comfy_table::Cell;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// `show NAME` prints one program
    #[command(subcommand)]
    pub what: Option<ProgramsCommand>,
}

/// What to print.
#[derive(Debug, clap::Subcommand)]
pub enum ProgramsCommand {
    /// Print the set-ups of one program and their counts
    Show {
        /// Its name, or a file of your own: FILE.toml
        name: String,
        /// On this machine (default: the one that the program was written for)
        #[arg(long, short)]
        machine: Option<String>,
        /// A machines.toml of your own (default: the one built in)
        #[arg(long, value_name = "FILE")]
        machines: Option<PathBuf>,
        /// Print the file itself, to copy and adapt
        #[arg(long)]
        toml: bool,
    },
}

/// # Errors
/// When there is no such program, or a file is unusable.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let Some(ProgramsCommand::Show { name, machine, machines, toml }) = &args.what else {
        let specs = program::built_in()?;
        let mut t = table(&["program", "machine", "mounting", "what it is for"]);
        for s in &specs {
            t.add_row(vec![s.name.clone(), machine_of(s), mountings(s).join(", "), s.says.clone()]);
        }
        io.say(t.to_string());
        io.answer(&json!({ "programs": specs.iter().map(|s| as_json(s, None)).collect::<Vec<_>>() }));
        return Ok(Answer::Done);
    };
    let mut specs = find(name)?;
    if let Some(machine) = machine {
        specs = vec![program::choose(specs, &name_of(name)?, &load_machine(machine, machines.as_deref(), io)?)?];
    }
    let mut answers = Vec::new();
    for spec in &specs {
        if *toml {
            io.say(spec.source.inner());
        }
        let on = machine.clone().or_else(|| spec.machine.as_ref().map(|m| m.value.clone()));
        let on = on.map(|m| load_machine(&m, machines.as_deref(), io)).transpose()?;
        match &on {
            Some(machine) => {
                let (layout, findings) = lay_out(machine, spec)?;
                io.report(&findings.0);
                if !toml {
                    show(spec, &machine.name, &layout, io);
                }
                answers.push(as_json(spec, Some(&layout)));
            }
            None => {
                io.say(format!("{}: {}\nname a machine (--machine) to see its set-ups", spec.name, spec.says));
                answers.push(as_json(spec, None));
            }
        }
    }
    io.answer(&json!({ "programs": answers }));
    Ok(Answer::Done)
}

/// The programs of a name, or the one in a file.
fn find(word: &str) -> Result<Vec<ProgramSpec>> {
    if is_file(word) {
        return Ok(vec![program::load(&source(word, files::read_text(Path::new(word))?))?.0]);
    }
    let all = program::built_in()?;
    let mut names: Vec<String> = all.iter().map(|s| s.name.clone()).collect();
    names.dedup();
    let found: Vec<ProgramSpec> = all.into_iter().filter(|s| s.name == word).collect();
    if found.is_empty() {
        return Err(Failure::new("program::unknown", format!("no program is called {word:?}"))
            .help(format!("there are: {}; a file of your own is named with its ending: FILE.toml", names.join(", "))));
    }
    Ok(found)
}

/// The name of the program that a word means.
fn name_of(word: &str) -> Result<String> {
    Ok(find(word)?.into_iter().next().map_or_else(|| word.to_owned(), |s| s.name))
}

/// Each mounting once, in the order in which they are put up.
fn mountings(spec: &ProgramSpec) -> Vec<String> {
    let mut names: Vec<String> = spec.parts.iter().map(|p| p.mounting.value.clone()).collect();
    let mut seen = std::collections::BTreeSet::new();
    names.retain(|name| seen.insert(name.clone()));
    names
}

/// The styli that the machine must have beside the probe's own.
fn styli(spec: &ProgramSpec) -> std::collections::BTreeSet<&str> {
    spec.parts.iter().filter_map(|p| p.stylus.as_ref()).map(|s| s.value.as_str()).collect()
}

fn machine_of(spec: &ProgramSpec) -> String {
    spec.machine.as_ref().map_or_else(|| "any".to_owned(), |m| m.value.clone())
}

fn show(spec: &ProgramSpec, machine: &str, layout: &Layout, io: &Io) {
    io.say(format!("{} on {machine}: {}", spec.name, spec.says));
    for (i, part) in layout.parts.iter().enumerate() {
        let stop = if i == 0 { String::new() } else { format!("stop {i}: ") };
        let stylus = part.stylus.map_or_else(String::new, |s| format!(", stylus {:?}", s.name));
        io.say(format!("{stop}mounting {:?}{stylus}: {}", part.label, part.mounting.says));
    }
    let mut t = table(&["stage", "pose (deg)", "blocks", "faces", "repeats", "touches"]);
    let mut total = 0;
    for s in &layout.setups {
        let touches = s.targets.len() * s.spec.repeats as usize;
        total += touches;
        let faces = s.spec.faces.iter().map(|f| format!("{} {}", f.face.value, f.grid.value));
        let faces: Vec<String> = faces.chain(s.spec.rings.iter().map(|r| r.name.value.clone())).collect();
        t.add_row(vec![
            Cell::new(&s.spec.stage),
            Cell::new(pose_says(&s.pose)),
            Cell::new(block_names(layout, s).join(" ")),
            Cell::new(faces.join(", ")),
            number(s.spec.repeats),
            number(touches),
        ]);
    }
    io.say(t.to_string());
    io.say(format!("{total} touches; `axiscal generate` says which of them can be reached\n"));
}

fn block_names<'a>(layout: &'a Layout, setup: &program::layout::Setup) -> Vec<&'a str> {
    let mut names: Vec<&str> =
        setup.targets.iter().filter_map(|t| layout.block(setup, t)).map(|b| b.name.as_str()).collect();
    names.dedup();
    names
}

fn as_json(spec: &ProgramSpec, layout: Option<&Layout>) -> Value {
    let mut answer = json!({
        "name": spec.name,
        "machine": spec.machine.as_ref().map(|m| m.value.clone()),
        "says": spec.says,
        "mounting": mountings(spec).first(),
        "mountings": mountings(spec),
        "styli": styli(spec),
    });
    if let (Some(layout), Some(object)) = (layout, answer.as_object_mut()) {
        let setups: Vec<Value> = layout
            .setups
            .iter()
            .map(|s| {
                json!({
                    "stage": s.spec.stage,
                    "pose": s.pose,
                    "blocks": block_names(layout, s),
                    "repeats": s.spec.repeats,
                    "touches": s.targets.len() * s.spec.repeats as usize,
                })
            })
            .collect();
        object.insert("setups".to_owned(), Value::Array(setups));
    }
    answer
}
