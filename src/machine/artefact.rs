//! Artefacts as files of their own (`axiscal-artefacts/1`): what is mounted, for whatever machine. On a machine it becomes one of
//! its mountings.

use super::as_written as w;
use super::{Machine, Side, load};
use crate::diag::{Failure, Finding, Findings, Result, Source, from_toml, source};
use serde::Deserialize;
use toml::Spanned;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, value};

/// The format line of an artefact.
pub const FORMAT: &str = "axiscal-artefacts/1";

/// How a machines file begins that an artefact was written into.
const WRITTEN: &str = "# written by `axiscal generate`";

/// Was a machines file written here? Then it may be written again.
#[must_use]
pub fn is_our_own(text: &str) -> bool {
    text.starts_with(WRITTEN)
}

/// A text without the line that says so.
fn without_mark(text: &str) -> &str {
    match text.split_once('\n') {
        Some((first, rest)) if is_our_own(first) => rest,
        _ => text,
    }
}

/// The artefacts that are built in: name and text.
pub const BUILT_IN: [(&str, &str); 5] = [
    ("sphere", include_str!("../../artefacts/sphere.toml")),
    ("two-spheres", include_str!("../../artefacts/two-spheres.toml")),
    ("ring", include_str!("../../artefacts/ring.toml")),
    ("pin", include_str!("../../artefacts/pin.toml")),
    ("cube", include_str!("../../artefacts/cube.toml")),
];

/// An artefact's file.
#[derive(Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// `axiscal-artefacts/1`
    #[schemars(with = "String")]
    pub format: Spanned<String>,
    /// Short name: what the mounting is called.
    #[schemars(with = "String")]
    pub name: Spanned<String>,
    /// What to do at the machine, in one line.
    #[serde(default)]
    pub says: String,
    /// What bears it; without it the last rotary axis of the workpiece side, else the table.
    #[schemars(with = "Option<String>")]
    pub carrier: Option<Spanned<String>>,
    /// What each body stands on.
    pub riser: Option<w::Riser>,
    /// Further solids, mounted with them.
    #[serde(default)]
    pub solid: Vec<w::Solid>,
    /// The bodies that are touched.
    #[serde(default)]
    pub block: Vec<Body>,
}

/// A body: as in a machine's file, or with its place counted from the table.
#[derive(Debug, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Short name.
    pub name: String,
    /// What it is; without it a box.
    #[serde(default)]
    pub form: super::Form,
    /// Its centre, mm in R at zero.
    #[schemars(with = "Option<[f64; 3]>")]
    pub centre: Option<Spanned<[f64; 3]>>,
    /// Its centre, mm from the machine's `reference.table`, along the axes of R.
    #[schemars(with = "Option<[f64; 3]>")]
    pub from_table: Option<Spanned<[f64; 3]>>,
    /// Full edges of a box, of the body round a bore, of a plane.
    pub size: Option<[f64; 3]>,
    /// Of a sphere, a cylinder or a bore.
    pub diameter: Option<f64>,
    /// Of a cylinder.
    pub height: Option<f64>,
    /// Where it differs from that of all.
    pub riser: Option<w::Riser>,
    /// What bears it, where it differs.
    pub carrier: Option<String>,
}

/// A machine with an artefact mounted.
#[derive(Debug, Clone)]
pub struct WithArtefact {
    /// A machines file of this machine alone, the artefact among its mountings.
    pub text: String,
    pub machine: Machine,
    /// Name of the mounting.
    pub mounting: String,
}

/// The JSON schema of an artefact's file.
#[must_use]
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(File)
}

/// A machines file that holds one machine of another, with its remarks.
///
/// # Errors
/// When the text is no TOML, or has no such machine.
pub fn one_machine(machines: &Source, name: &str) -> Result<String> {
    document(machines, name).map(|doc| doc.to_string())
}

fn document(machines: &Source, name: &str) -> Result<DocumentMut> {
    let unusable = |why: String| Failure::new("machine::not_toml", format!("{}: {why}", machines.name()));
    let mut doc: DocumentMut =
        machines.inner().parse().map_err(|e: toml_edit::TomlError| unusable(e.message().to_owned()))?;
    let Some(all) = doc.get_mut("machine").and_then(Item::as_array_of_tables_mut) else {
        return Err(unusable("it holds no [[machine]]".to_owned()));
    };
    all.retain(|m| m.get("name").and_then(Item::as_str) == Some(name));
    if all.is_empty() {
        return Err(unusable(format!("it holds no machine {name:?}")));
    }
    Ok(doc)
}

/// Mounts an artefact on a machine. `machines`: the file that it comes from.
///
/// # Errors
/// When the artefact's file is not of this form, or does not fit the machine.
pub fn mount(machines: &Source, machine: &Machine, artefact: &Source) -> Result<(WithArtefact, Findings)> {
    let file: File = toml::from_str(artefact.inner()).map_err(|e| {
        from_toml(&e, artefact, "artefact::not_toml")
            .help("`axiscal schema artefacts` prints the form; `axiscal artefacts show sphere` shows an example")
    })?;
    check(&file, artefact)?;
    let mut doc = document(machines, &machine.name)?;
    let mounting = mounting(&file, machine, artefact)?;
    let name = file.name.get_ref().clone();
    if let Some(one) = doc.get_mut("machine").and_then(Item::as_array_of_tables_mut).and_then(|all| all.get_mut(0)) {
        let all = one.entry("mounting").or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
        if let Some(all) = all.as_array_of_tables_mut() {
            // the same artefact at another place: the new one counts
            all.retain(|m| m.get("name").and_then(Item::as_str) != Some(&name));
            all.push(mounting);
        }
    }
    let text = format!("{WRITTEN}: {} with {name:?}\n{}", machine.name, without_mark(&doc.to_string()));
    let (mut machines, findings) = load(&source(format!("{} on {}", artefact.name(), machine.name), text.clone()))?;
    let machine = machines.pop().ok_or_else(|| Failure::new("machine::unknown", "the machine is gone"))?;
    Ok((WithArtefact { text, machine, mounting: name }, findings))
}

fn check(file: &File, artefact: &Source) -> Result<()> {
    let mut findings = Vec::new();
    let mut error = |span: std::ops::Range<usize>, code: &'static str, says: String, help: &str| {
        findings.push(Finding::error(code, says).help(help.to_owned()).at(artefact, span));
    };
    if file.format.get_ref() != FORMAT {
        let says = format!("format is {:?}, expected {FORMAT:?}", file.format.get_ref());
        error(file.format.span(), "artefact::format", says, "write the format line of this version");
    }
    if file.name.get_ref().trim().is_empty() {
        error(file.name.span(), "artefact::name", "it has no name".to_owned(), "write name = \"sphere\"");
    }
    for body in &file.block {
        let place = body.centre.as_ref().or(body.from_table.as_ref()).map_or(file.name.span(), Spanned::span);
        if body.centre.is_some() == body.from_table.is_some() {
            let says = format!("the place of {:?} is not given once", body.name);
            let help = "write either centre = [x, y, z] (mm in R at zero) or from_table = [x, y, z] (mm from the middle of the table's face)";
            error(place, "artefact::place", says, help);
        }
    }
    if findings.is_empty() { Ok(()) } else { Err(Failure(findings)) }
}

/// The artefact as a mounting of a machine's file: its own text with places in R and the carrier named.
fn mounting(file: &File, machine: &Machine, artefact: &Source) -> Result<Table> {
    let unusable = |e: toml_edit::TomlError| Failure::new("artefact::not_toml", e.message().to_owned());
    let mut table = artefact.inner().parse::<DocumentMut>().map_err(unusable)?.as_table().clone();
    table.remove("format");
    if file.carrier.is_none() {
        let rotary = machine.side(Side::Workpiece).filter(|a| a.name.is_rotary()).last();
        table.insert("carrier", value(rotary.map_or_else(|| "table".to_owned(), |a| a.name.to_string())));
    }
    let origin = machine.reference.table;
    if let Some(bodies) = table.get_mut("block").and_then(Item::as_array_of_tables_mut) {
        for (written, body) in bodies.iter_mut().zip(&file.block) {
            if let Some(at) = &body.from_table {
                let at = at.get_ref();
                written.remove("from_table");
                let centre = (0..3).map(|i| ((origin[i] + at[i]) * 1e6).round() / 1e6);
                written.insert("centre", value(centre.collect::<toml_edit::Array>()));
            }
        }
    }
    without_positions(&mut table);
    Ok(table)
}

/// Tables of another file have their places there: here they follow their parents.
fn without_positions(table: &mut Table) {
    table.set_position(None);
    for (_, item) in table.iter_mut() {
        match item {
            Item::Table(inner) => without_positions(inner),
            Item::ArrayOfTables(inner) => inner.iter_mut().for_each(without_positions),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_artefact_stands_on_every_built_in_machine() {
        let all = source("machines.toml", super::super::BUILT_IN);
        let (machines, _) = load(&all).unwrap();
        for machine in &machines {
            for (name, text) in BUILT_IN {
                let (with, findings) = mount(&all, machine, &source(name, text)).unwrap();
                assert!(!findings.has_errors());
                let mounting = with.machine.mounting(name).unwrap();
                assert!(!mounting.blocks.is_empty(), "{name}");
                // written and read again: the same machine
                let (again, _) = load(&source("again", with.text.clone())).unwrap();
                assert_eq!((again.len(), &again[0].sha256), (1, &with.machine.sha256));
                // the same once more: it replaces the one that is there
                let (twice, _) = mount(&source("again", with.text), &with.machine, &source(name, text)).unwrap();
                assert_eq!(twice.machine.mountings.len(), with.machine.mountings.len());
                assert!(is_our_own(&twice.text) && twice.text.matches(WRITTEN).count() == 1);
            }
        }
        let trunnion = machines.iter().find(|m| m.name == "trunnion").unwrap();
        let (with, _) = mount(&all, trunnion, &source("sphere", BUILT_IN[0].1)).unwrap();
        let ball = &with.machine.mounting("sphere").unwrap().blocks[0];
        let above = ball.centre - trunnion.reference.table;
        assert!((above - nalgebra::Vector3::new(60.0, 0.0, 92.5)).norm() < 1e-9, "{above:?}");
    }

    #[test]
    fn a_stem_that_is_a_table_of_its_own_stays_with_its_sphere() {
        let all = source("machines.toml", super::super::BUILT_IN);
        let (machines, _) = load(&all).unwrap();
        let trunnion = machines.iter().find(|m| m.name == "trunnion").unwrap();
        let inline = "riser = { height = 80.0, diameter = 12.0 }  # the stem with its base";
        assert!(BUILT_IN[0].1.contains(inline));
        let text = BUILT_IN[0].1.replace(inline, "[block.riser]\nheight = 80.0\ndiameter = 12.0");
        let (with, _) = mount(&all, trunnion, &source("mine.toml", text)).unwrap();
        let riser = with.machine.mounting("sphere").unwrap().blocks[0].riser.unwrap();
        assert_eq!((riser.height, riser.diameter), (80.0, Some(12.0)));
    }

    #[test]
    fn what_is_wrong_with_an_artefact_has_its_place() {
        let all = source("machines.toml", super::super::BUILT_IN);
        let (machines, _) = load(&all).unwrap();
        let said = |edit: &dyn Fn(&str) -> String| {
            let text = edit(BUILT_IN[0].1);
            mount(&all, &machines[0], &source("ball.toml", text)).unwrap_err().0.remove(0)
        };
        let no_place = said(&|t| t.replace("from_table = [60.0, 0.0, 92.5]", ""));
        assert_eq!(no_place.code, "artefact::place");
        assert_eq!(said(&|t| t.replace("artefacts/1", "artefacts/2")).code, "artefact::format");
        let unknown = said(&|t| t.replace("diameter = 25.0", "radius = 12.5"));
        assert!(unknown.place().is_some_and(|p| p.starts_with("ball.toml:10:")), "{unknown:?}");
        assert_eq!(said(&|t| t.replace("diameter = 25.0 ", "size = [1.0, 1.0, 1.0]")).code, "machine::block_form");
    }
}
