//! What a control cannot carry is said, with the error that it leaves: every parameter of every effect, on every machine,
//! for every control, is either in a table or in the list of what stays. Nothing is dropped in silence.

use super::controls::{CONTROLS, accepting, tables, text};
use super::support::{MACHINES, catalogue, machine};
use axiscal::diag::{Failure, Severity};
use axiscal::fit::outcome::Status;
use axiscal::machine::Machine;
use axiscal::model::catalogue::Effect;
use axiscal::post::tables::LengthUnit;
use axiscal::tables::compensation::{Compensation, Provenance, Term};
use axiscal::tables::control::{self, Options};
use axiscal::tables::correction::{Correction, During};
use axiscal::tables::linuxcnc::{self, Left};
use std::collections::BTreeMap;

/// All parameters of these effects, as if a fit had identified each at its usual size.
fn correction(machine: &Machine, effects: &[&Effect]) -> Correction {
    let rows: Vec<_> = effects
        .iter()
        .flat_map(|effect| {
            effect.parameters.iter().map(|p| {
                let value = p.shape.map_or(p.typical, |(start, ..)| start);
                (p.name.as_str(), effect.id.as_str(), value, p.unit.as_str(), Status::Identified)
            })
        })
        .collect();
    let mut outcome = super::export::outcome(&machine.name, &rows);
    outcome.reference_mm = machine.reference.pivot.into();
    Correction::collect(
        machine,
        &catalogue(),
        &outcome,
        During { loaded: None, transformation: true },
        Provenance::default(),
    )
    .unwrap()
    .0
}

/// Where an export says what became of a parameter.
struct Said<'a> {
    terms: &'a [Term],
    in_tables: Vec<(String, String)>,
    left: &'a [Left],
    readme: &'a str,
}

impl Said<'_> {
    /// `Ok(carried)`, or what is wrong.
    fn of(&self, effect: &str, parameter: &str) -> Result<bool, String> {
        let left = self.left.iter().find(|l| l.effect == effect && l.parameter == parameter);
        let term = self.terms.iter().any(|t| t.effect == effect && t.parameter == parameter && t.value != 0.0);
        let table = self.in_tables.iter().any(|(e, p)| e == effect && p == parameter);
        if !self.readme.contains(parameter) && !self.readme.contains(effect) && !term {
            return Err("README.txt does not name it".to_owned());
        }
        match left {
            None if term || table => Ok(true),
            None => Err("it is in no table, and not among what stays".to_owned()),
            Some(l) if l.why.trim().is_empty() => Err("it stays, and nobody says why".to_owned()),
            Some(l) if !l.size(|um| format!("{um}")).contains("um") => {
                Err(format!("it stays ({}), and its size is not said", l.why))
            }
            Some(_) => Ok(false),
        }
    }
}

/// What goes with the turns of a screw is too fine for the rows of a table over the whole travel, and a part of what a head has may be
/// worse than nothing: that export is refused, for these reasons alone, and the forced one is looked at.
fn too_coarse<T>(refused: Failure, forced: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    let mut errors = refused.0.iter().filter(|f| f.severity == Severity::Error);
    if errors.all(|f| matches!(f.code, "tables::too_coarse" | "tables::worse")) { forced() } else { Err(refused) }
}

#[test]
fn every_parameter_is_carried_or_said_to_stay() {
    let catalogue = catalogue();
    let (mut wrong, mut counts) = (Vec::new(), BTreeMap::<&str, [usize; 2]>::new());
    for name in MACHINES {
        let machine = machine(name);
        for effect in catalogue.iter().filter(|e| e.applies_to(&machine) && !e.discrete) {
            let correction = correction(&machine, &[effect]);
            if !correction.of_measurement.is_empty() || correction.tool_length_mm.is_some() {
                continue;
            }
            let shapes: Vec<(String, String)> = correction
                .shapes
                .iter()
                .chain(&correction.across)
                .map(|s| (s.effect.clone(), s.parameter.clone()))
                .collect();
            let mut look = |control: &'static str, said: &Said<'_>| {
                // a parameter that only shapes the others is no error of its own
                for p in effect.parameters.iter().filter(|p| p.shape.is_none()) {
                    match said.of(&effect.id, &p.name) {
                        Ok(carried) => counts.entry(control).or_default()[usize::from(!carried)] += 1,
                        Err(why) => wrong.push(format!("{control} {name} {} ({}): {why}", p.name, effect.id)),
                    }
                }
            };
            for control in CONTROLS {
                let sheet = tables(control);
                if control::kind_of(&machine, &sheet).is_err() {
                    continue;
                }
                let with =
                    |force| control::export(&machine, control, &sheet, &correction, &Options { force, ..accepting() });
                let (export, _) = with(false).or_else(|refused| too_coarse(refused, || with(true))).unwrap();
                let has_grids = export.compensation.tables.as_ref().is_some_and(|t| !t.grids.is_empty());
                let in_tables = if has_grids { shapes.clone() } else { Vec::new() };
                let readme = text(&export, "README.txt");
                look(
                    control,
                    &Said { terms: &export.compensation.terms, in_tables, left: &export.left, readme: &readme },
                );
            }
            let with =
                |force| linuxcnc::export(&machine, &correction, &linuxcnc::Options { force, ..Default::default() });
            let (export, _) = with(false).or_else(|refused| too_coarse(refused, || with(true))).unwrap();
            let own = |c: &Compensation| c.stock.as_ref().is_some_and(|s| !s.axis_tables.is_empty());
            let readme = export.files.iter().find(|(n, _)| n == "README.txt").unwrap();
            let readme = String::from_utf8(readme.1.clone()).unwrap();
            let of = |c: &'static str, way: &linuxcnc::Way| {
                (c, way.compensation.terms.clone(), own(&way.compensation), way.left.clone())
            };
            for (control, terms, has_tables, left) in
                [of("linuxcnc", &export.component), of("linuxcnc stock", &export.stock)]
            {
                let in_tables = if has_tables { shapes.clone() } else { Vec::new() };
                look(control, &Said { terms: &terms, in_tables, left: &left, readme: &readme });
            }
        }
    }
    println!("carried, said to stay: {counts:?}");
    assert!(wrong.is_empty(), "{} are dropped:\n{}", wrong.len(), wrong.join("\n"));
    assert!(counts.len() == 6 && counts.values().all(|[carried, stay]| *carried > 10 && *stay > 10), "{counts:?}");
}

/// Where the tables do not suffice, or are of the wrong unit, a forced export leaves them out and lists what that leaves.
#[test]
fn a_forced_export_without_its_position_tables_says_what_stays() {
    let (catalogue, machine) = (catalogue(), machine("swivel-head"));
    let effects: Vec<&Effect> =
        ["scale-x", "straightness-yx"].iter().map(|id| catalogue.get(id, &machine).unwrap()).collect();
    let correction = correction(&machine, &effects);
    let sheet = tables("sinumerik");
    let inch = Options { unit: LengthUnit::Inch, ..accepting() };
    let refused = control::export(&machine, "sinumerik", &sheet, &correction, &inch).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == "tables::inch"));
    let mut few = sheet.clone();
    few.grid.as_mut().unwrap().most = 1;
    let refused = control::export(&machine, "sinumerik", &few, &correction, &accepting()).unwrap_err();
    assert!(refused.0.iter().any(|f| f.code == "tables::grids"));
    for (sheet, options) in [(&sheet, Options { force: true, ..inch }), (&few, Options { force: true, ..accepting() })]
    {
        let (export, _) = control::export(&machine, "sinumerik", sheet, &correction, &options).unwrap();
        assert!(export.compensation.tables.as_ref().unwrap().grids.is_empty());
        assert!(!export.files.iter().any(|(name, _)| name.contains("cec")));
        for p in effects.iter().flat_map(|e| &e.parameters) {
            assert!(
                export.left.iter().any(|l| l.parameter == p.name && l.left_um.is_some_and(|um| um > 0.1)),
                "{}",
                p.name
            );
            assert!(text(&export, "README.txt").contains(&format!("{} = ", p.name)), "{}", p.name);
        }
    }
}
