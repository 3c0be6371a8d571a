//! `axiscal effects`: what is built in or found, one line each; `effects show ID` prints one.

use super::{Answer, Io};
use crate::axes::AxisName;
use crate::diag::{Failure, Result};
use crate::machine::{Machine, Side};
use crate::model::catalogue::{Catalogue, Effect, Parameter, Place, Term};
use crate::workflow::{load_effects, load_machine, load_machines};
use serde_json::json;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// `show ID` prints one effect
    #[command(subcommand)]
    pub what: Option<EffectsCommand>,
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
pub enum EffectsCommand {
    /// Print one effect
    Show {
        /// Its id
        id: String,
    },
}

/// # Errors
/// When a file is unusable or there is no such effect.
pub fn run(args: &Args, io: &Io) -> Result<Answer> {
    let catalogue = load_effects(&args.effects_file, io)?;
    let machine = match &args.machine {
        Some(name) => Some(load_machine(name, args.machines.as_deref(), io)?),
        None => None,
    };
    let here = |e: &&Effect| machine.as_ref().is_none_or(|m| e.applies_to(m));
    match &args.what {
        Some(EffectsCommand::Show { id }) => {
            let rows: Vec<&Effect> = catalogue.iter().filter(|e| &e.id == id).filter(here).collect();
            if rows.is_empty() {
                return Err(unknown(id, &catalogue, machine.as_ref()));
            }
            let machines = load_machines(args.machines.as_deref(), io)?;
            let texts: Vec<String> = rows.iter().map(|e| show(e, &machines)).collect();
            io.say(texts.join("\n").trim_end());
            io.answer(&json!({ "effects": rows.iter().map(|e| as_json(e)).collect::<Vec<_>>() }));
        }
        None => {
            let rows: Vec<&Effect> = catalogue.iter().filter(here).collect();
            io.say(list(&rows, machine.as_ref()).trim_end());
            io.answer(&json!({ "effects": rows.iter().map(|e| as_json(e)).collect::<Vec<_>>() }));
        }
    }
    Ok(Answer::Done)
}

/// An id that does not exist, or not on the machine: says which is near.
fn unknown(id: &str, catalogue: &Catalogue, machine: Option<&Machine>) -> Failure {
    if let Some(machine) = machine.filter(|_| catalogue.knows(id)) {
        return Failure::new(
            "effects::not_here",
            format!("effect {id:?} does not apply to machine {:?}", machine.name),
        )
        .help("without --machine it is shown with the axes that it needs");
    }
    let mut near: Vec<&str> = catalogue.iter().map(|e| e.id.as_str()).collect();
    near.dedup();
    near.sort_by(|a, b| strsim::jaro_winkler(id, b).total_cmp(&strsim::jaro_winkler(id, a)));
    near.truncate(8);
    Failure::new("effects::unknown", format!("no effect is called {id:?}"))
        .help(format!("did you mean {}? `axiscal effects` lists all", near.join(", ")))
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

/// Columns of the list: where each begins.
const COLUMNS: [usize; 4] = [0, 23, 34, 48];

/// Width of the text that people read.
const WIDTH: usize = 80;

/// Effects by family, one line each (or a few): id, ISO symbols, usual sizes, name.
fn list(rows: &[&Effect], machine: Option<&Machine>) -> String {
    let mut families: Vec<&str> = Vec::new();
    for e in rows {
        if !families.contains(&e.family.as_str()) {
            families.push(&e.family);
        }
    }
    let mut out = lines(["effect", "ISO 230", "usual size", "what it is"].map(|head| vec![head.to_owned()]));
    let mut seen: Vec<&str> = Vec::new();
    for family in families {
        out += &format!("{family}\n");
        for e in rows.iter().filter(|e| e.family == family) {
            // rows of one id are for different machines: the list names the id once
            if seen.contains(&e.id.as_str()) {
                continue;
            }
            seen.push(&e.id);
            let mut symbols: Vec<&str> = Vec::new();
            let mut sizes: Vec<String> = Vec::new();
            for p in e.parameters.iter().filter(|p| p.shape.is_none()) {
                symbols.extend(p.iso.as_deref().filter(|iso| !symbols.contains(iso)));
                let size = format!("{} {}", p.typical, p.unit);
                if !sizes.contains(&size) {
                    sizes.push(size);
                }
            }
            let width = |column: usize| COLUMNS.get(column + 1).unwrap_or(&WIDTH) - COLUMNS[column] - 1;
            out += &lines([
                vec![format!("  {}", e.id)],
                wrapped(&symbols.join(" "), width(1)),
                if e.discrete { vec!["0 or 1".to_owned()] } else { sizes },
                wrapped(&e.name, width(3)),
            ]);
        }
    }
    let where_ = machine.map_or("(--machine M: those of one)".to_owned(), |m| format!("on {}", m.name));
    out + &format!("{} effects {where_}; `axiscal effects show ID` prints one\n", seen.len())
}

/// Cells beside each other, each of as many lines as it has.
fn lines(cells: [Vec<String>; 4]) -> String {
    let height = cells.iter().map(Vec::len).max().unwrap_or(0);
    let mut out = String::new();
    for i in 0..height {
        let mut line = String::new();
        for (cell, from) in cells.iter().zip(COLUMNS) {
            if let Some(text) = cell.get(i) {
                // a long id keeps a blank before what follows
                let fill = from.saturating_sub(line.chars().count()).max(usize::from(!line.is_empty()));
                line += &" ".repeat(fill);
                line += text;
            }
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

/// Lines of at most so many characters, broken at blanks.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match out.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => out.push(word.to_owned()),
        }
    }
    out
}

/// A heading with a text beside it.
fn entry(word: &str, text: &str) -> String {
    const INDENT: usize = 18;
    let text = wrapped(text, WIDTH - INDENT).join(&format!("\n{}", " ".repeat(INDENT)));
    let gap = if word.chars().count() < INDENT - 2 { "" } else { " " };
    format!("  {word:<width$}{gap}{text}\n", width = INDENT - 2)
}

/// On which machines an effect applies, in words.
fn applies(e: &Effect, machines: &[Machine]) -> String {
    let letters = |axes: &[AxisName]| axes.iter().map(AxisName::to_string).collect::<Vec<_>>().join(" and ");
    let side = match e.side {
        Some(Side::Tool) => " on the tool side",
        Some(Side::Workpiece) => " on the workpiece side",
        None => "",
    };
    let mut text = if e.needs.is_empty() {
        "every machine".to_owned()
    } else {
        format!("machines with {}{side}", letters(&e.needs))
    };
    if !e.unless.is_empty() {
        text += &format!(", without {} there", letters(&e.unless));
    }
    let here: Vec<&str> = machines.iter().filter(|m| e.applies_to(m)).map(|m| m.name.as_str()).collect();
    if here.is_empty() { format!("{text} (none that is known)") } else { format!("{text} ({})", here.join(", ")) }
}

const DOFS: [&str; 6] = ["dx", "dy", "dz", "rx", "ry", "rz"];

fn dof(t: &Term) -> String {
    match t.place {
        Place::Trigger => "r".to_owned(),
        Place::Reading => AxisName::ALL[t.component].to_string(),
        _ => DOFS[t.component].to_owned(),
    }
}

fn show(e: &Effect, machines: &[Machine]) -> String {
    let mut out = format!("{}: {}\n", e.id, e.name);
    for (word, text) in [("what it is", &e.says), ("how to confirm", &e.look), ("what mends it", &e.mends)] {
        if !text.is_empty() {
            out += &entry(word, text);
        }
    }
    out += &entry("applies to", &applies(e, machines));
    let mut kinds = vec![e.family.as_str()];
    kinds.extend(e.nuisance.then_some("solved for, but no result"));
    kinds.extend(e.per_block.then_some("one set of parameters for each block"));
    kinds.extend(e.per_run.then_some("one set of parameters for each run after the first"));
    kinds.extend(e.discrete.then_some("a set-up mistake, 0 or 1, tried where the error is very large"));
    out += &entry("family", &kinds.join("; "));
    for (i, p) in e.parameters.iter().enumerate() {
        let other = [("ISO", p.iso.as_ref().filter(|iso| **iso != p.name)), ("paper", p.alias.as_ref())];
        let other: Vec<String> = other.into_iter().filter_map(|(w, s)| Some(format!(" ({w} {})", s?))).collect();
        out += &match p.shape {
            None => {
                let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
                entry(&p.name, &format!("usually {}{unit}{}; {}", p.typical, other.concat(), p.source))
            }
            Some((start, low, high)) => {
                let tried =
                    p.scan.iter().map(|v| format!("{v:.3}").trim_end_matches('0').trim_end_matches('.').to_owned());
                let tried: Vec<String> = tried.collect();
                let tried = match tried.as_slice() {
                    [] => String::new(),
                    [first, .., last] if tried.len() > 12 => {
                        format!("; tried: {} values from {first} to {last}", tried.len())
                    }
                    all => format!("; tried: {}", all.join(" ")),
                };
                let text =
                    format!("inside the functions: {start} {} ({low} to {high}){tried}; source: {}", p.unit, p.source);
                entry(&p.name, &text)
            }
        };
        for t in e.terms.iter().filter(|t| t.parameter == i) {
            out += &entry("", &format!("{} of {}: {}", dof(t), word(t.place), t.formula.text()));
        }
    }
    out
}

fn as_json(e: &Effect) -> serde_json::Value {
    let side = e.side.map(|s| if s == Side::Tool { "tool" } else { "workpiece" });
    let letters = |axes: &[AxisName]| axes.iter().map(AxisName::to_string).collect::<Vec<_>>();
    let parameter = |p: &Parameter| {
        let shape = p.shape.map(|(start, min, max)| {
            let bound = |v: f64| v.is_finite().then_some(v);
            json!({ "start": start, "min": bound(min), "max": bound(max), "scan": p.scan })
        });
        json!({ "name": p.name, "alias": p.alias, "iso": p.iso, "unit": p.unit, "typical": p.typical,
            "positive": p.positive, "source": p.source, "shape": shape })
    };
    let term = |t: &Term| {
        json!({ "parameter": e.parameters[t.parameter].name, "place": word(t.place), "dof": dof(t),
            "formula": t.formula.text() })
    };
    json!({ "id": e.id, "family": e.family, "name": e.name, "says": e.says, "look": e.look, "mends": e.mends,
        "side": side, "needs": letters(&e.needs), "unless": letters(&e.unless), "nuisance": e.nuisance,
        "per_block": e.per_block, "per_run": e.per_run, "discrete": e.discrete, "paper": e.paper, "built_in": e.built_in,
        "parameters": e.parameters.iter().map(parameter).collect::<Vec<_>>(),
        "terms": e.terms.iter().map(term).collect::<Vec<_>>() })
}
