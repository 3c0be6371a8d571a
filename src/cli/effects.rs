//! `axiscal effects`: what is built in or found, one line each; `effects show ID` prints one.

use super::common::load_machine;
use super::{Answer, Io};
use crate::diag::{Failure, Result, source};
use crate::files;
use crate::machine::Side;
use crate::model::catalogue::{Catalogue, Effect, Place};
use crate::report::fit::table;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `effects`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// `show ID` prints one effect
    #[command(subcommand)]
    pub what: Option<What>,
    /// Only those that apply to this machine
    #[arg(long, short, global = true)]
    pub machine: Option<String>,
    /// A machines.toml of your own (default: the one built in)
    #[arg(long, value_name = "FILE", global = true)]
    pub machines: Option<PathBuf>,
    /// Effects of your own, besides the built-in ones
    #[arg(long, value_name = "FILE", global = true)]
    pub effects_file: Vec<PathBuf>,
}

/// What to print.
#[derive(Debug, clap::Subcommand)]
pub enum What {
    /// Print one effect
    Show {
        /// Its id
        id: String,
    },
}

/// Runs `effects`.
///
/// # Errors
/// When a file is unusable or there is no such effect.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let mut catalogue = Catalogue::built_in()?;
    for file in &args.effects_file {
        io.report(&catalogue.add_file(&source(file.display().to_string(), files::read_text(file)?))?.0);
    }
    let machine = match &args.machine {
        Some(name) => Some(load_machine(name, args.machines.as_deref(), io)?),
        None => None,
    };
    let here = |e: &&Effect| machine.as_ref().is_none_or(|m| e.applies_to(m));
    match &args.what {
        Some(What::Show { id }) => {
            let rows: Vec<&Effect> = catalogue.iter().filter(|e| &e.id == id).filter(here).collect();
            if rows.is_empty() {
                let ids: Vec<&str> = catalogue.iter().filter(here).map(|e| e.id.as_str()).collect();
                return Err(Failure::new("effects::unknown", format!("no effect is called {id:?}"))
                    .help(format!("there are: {}", ids.join(", "))));
            }
            for e in &rows {
                show(e, io);
            }
            io.answer(&json!({ "effects": rows.iter().map(|e| as_json(e)).collect::<Vec<_>>() }));
        }
        None => {
            let mut t = table(&["effect", "at", "parameters", "what it is"]);
            let rows: Vec<&Effect> = catalogue.iter().filter(here).collect();
            for e in &rows {
                let names: Vec<&str> = e.parameters.iter().map(|p| p.name.as_str()).collect();
                t.add_row(vec![e.id.clone(), places(e), names.join(" "), e.says.clone()]);
            }
            io.say(t.to_string());
            io.answer(&json!({ "effects": rows.iter().map(|e| as_json(e)).collect::<Vec<_>>() }));
        }
    }
    Ok(Answer::Done)
}

fn word(place: Place) -> String {
    match place {
        Place::Before(axis) => format!("{axis}, before its motion"),
        Place::After(axis) => format!("{axis}, after its motion"),
        Place::Base => "base".into(),
        Place::Tool => "tool".into(),
        Place::Workpiece => "workpiece".into(),
        Place::Block => "block".into(),
        Place::Trigger => "trigger".into(),
        Place::Reading => "reading".into(),
    }
}

fn places(e: &Effect) -> String {
    let side = match e.side {
        Some(Side::Tool) => " (tool side)",
        Some(Side::Workpiece) => " (workpiece side)",
        None => "",
    };
    let mut all: Vec<String> = e
        .terms
        .iter()
        .map(|t| match t.place {
            Place::Before(a) | Place::After(a) => a.to_string(),
            other => word(other),
        })
        .collect();
    all.dedup();
    format!("{}{side}", all.join(" "))
}

fn show(e: &Effect, io: &Io) {
    io.say(format!("{}: {}", e.id, e.name));
    for (word, text) in [("what it is", &e.says), ("how to confirm", &e.look), ("what mends it", &e.mends)] {
        if !text.is_empty() {
            io.say(format!("  {word:<15} {text}"));
        }
    }
    let mut t = table(&["parameter", "paper", "unit", "typical", "source", "place", "direction", "function"]);
    const DOFS: [&str; 6] = ["dx", "dy", "dz", "rx", "ry", "rz"];
    for term in &e.terms {
        let p = &e.parameters[term.parameter];
        let dof = match term.place {
            Place::Trigger => "r".to_owned(),
            Place::Reading => crate::axes::AxisName::ALL[term.component].to_string(),
            _ => DOFS[term.component].to_owned(),
        };
        t.add_row(vec![
            p.name.clone(),
            p.alias.clone().unwrap_or_default(),
            p.unit.clone(),
            p.typical.to_string(),
            p.source.clone(),
            word(term.place),
            dof,
            term.formula.text().to_owned(),
        ]);
    }
    for p in e.parameters.iter().filter(|p| p.shape.is_some()) {
        if let Some((start, low, high)) = p.shape {
            t.add_row(vec![
                p.name.clone(),
                String::new(),
                p.unit.clone(),
                format!("{start} ({low} … {high})"),
                String::new(),
                "shape".into(),
                String::new(),
                String::new(),
            ]);
        }
    }
    io.say(t.to_string());
}

fn as_json(e: &Effect) -> serde_json::Value {
    json!({ "id": e.id, "name": e.name, "says": e.says, "look": e.look, "mends": e.mends, "nuisance": e.nuisance, "built_in": e.built_in,
        "parameters": e.parameters.iter().map(|p| json!({ "name": p.name, "alias": p.alias, "unit": p.unit, "typical": p.typical, "source": p.source })).collect::<Vec<_>>(),
        "terms": e.terms.iter().map(|t| json!({ "parameter": e.parameters[t.parameter].name, "place": word(t.place), "formula": t.formula.text() })).collect::<Vec<_>>() })
}
