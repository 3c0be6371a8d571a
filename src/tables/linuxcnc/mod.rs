//! LinuxCNC: a kinematics component of the machine's own chain that carries every location error, and beside it what
//! the stock means of LinuxCNC carry (`stock/`).
//!
//! Everything here is a pure function from a correction to files; the caller writes them. Tested against LinuxCNC
//! 2.9.0~pre1; the meaning of the stock modules' pins is in `stock.rs`, that of the axis tables in `axis_table.rs`.

pub mod axis_table;
pub mod component;
pub mod ini;
mod pack;
pub mod readme;
pub mod stock;
pub mod work_offset;

use super::compensation::{Compensation, Mode};
use super::correction::{Correction, Limits, left_um};
use super::rows::TableError;
use crate::diag::{Failure, Finding, Findings, Result, Severity};
use crate::machine::Machine;
use crate::post::{Postprocessor, Release};
use ini::UserIni;
use std::collections::BTreeMap;

/// Id of the controller.
pub const CONTROLLER: &str = "linuxcnc";

/// HAL names have at most this many characters (`HAL_NAME_LEN`).
pub const HAL_NAME_LEN: usize = 47;

/// How to export.
#[derive(Debug, Clone)]
pub struct Options {
    /// Distance from the reference point at which what is left is stated, mm.
    pub radius_mm: f64,
    /// Above these an export is refused.
    pub limits: Limits,
    /// Export all the same.
    pub force: bool,
    /// The machine's INI file, for its old values and the numbers of its joints.
    pub ini: Option<UserIni>,
    /// Present values of the pins of the stock module in use, as the person gave them, mm.
    pub old_pins: BTreeMap<String, f64>,
    /// The version of LinuxCNC that the files are written for; absent: the one that the built-in controller names.
    pub release: Option<Release>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            radius_mm: 100.0,
            limits: Limits::default(),
            force: false,
            ini: None,
            old_pins: BTreeMap::new(),
            release: None,
        }
    }
}

/// An error that stays after loading.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Left {
    /// ISO symbol.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// Distance at which a tilt acts, mm.
    pub lever_mm: f64,
    /// The error that it leaves there, µm; none where the unit says nothing about that or it is not known.
    pub left_um: Option<f64>,
    /// Why it is not carried.
    pub why: String,
}

impl Left {
    /// The error that it leaves, in words; `show` writes a number. What grows with time or temperature is said per hour or
    /// kelvin.
    #[must_use]
    pub fn size(&self, show: impl Fn(f64) -> String) -> String {
        if let Some(um) = self.left_um {
            return format!("{} um", show(um));
        }
        let growing = self.unit.rsplit_once('/').and_then(|(unit, per)| {
            let unit = if unit == "ppm" { "um/m" } else { unit };
            matches!(per, "h" | "K").then(|| left_um(self.value, unit, self.lever_mm))?.map(|um| (um, per))
        });
        growing.map_or_else(|| "an error of unknown size".to_owned(), |(um, per)| format!("{} um per {per}", show(um)))
    }
}

/// What one way of loading carries and leaves.
#[derive(Debug, Clone)]
pub struct Way {
    /// Its record, as written to `compensation.json`.
    pub compensation: Compensation,
    /// What it leaves.
    pub left: Vec<Left>,
}

/// By how much a value changes whose present one is not known.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Changed {
    /// The sheet that says it.
    pub file: String,
    /// What changes, as LinuxCNC names it.
    pub name: String,
    /// What is added to the present value.
    pub change: f64,
    /// Its unit: `mm`, `inch` or `deg`.
    pub unit: &'static str,
}

/// The files of an export, with what they carry.
#[derive(Debug, Clone)]
pub struct Export {
    /// Path below the output directory, and contents.
    pub files: Vec<(String, Vec<u8>)>,
    /// By the kinematics component.
    pub component: Way,
    /// By what LinuxCNC has without it.
    pub stock: Way,
    /// What each axis table leaves, whichever way is loaded.
    pub table_errors: Vec<TableError>,
    /// What is given as changes, because the present values are not known.
    pub changes: Vec<Changed>,
}

/// Program and version, as every file names it.
#[must_use]
pub fn program() -> String {
    format!("axiscal {}", env!("CARGO_PKG_VERSION"))
}

/// The compensation files for LinuxCNC.
///
/// # Errors
/// When a value is beyond the limits and `force` is not set, the active compensation belongs to another machine or
/// controller, or the INI does not fit the machine.
pub fn export(machine: &Machine, correction: &Correction, options: &Options) -> Result<(Export, Findings)> {
    let mut findings = Findings::default();
    if !(options.radius_mm.is_finite() && options.radius_mm > 0.0) {
        return Err(Failure::new("tables::radius", format!("the radius is {} mm", options.radius_mm))
            .help("give the radius of the workpiece about the rotary axis, above 0"));
    }
    let mut correction = correction.clone();
    let mut beyond = correction.beyond(&options.limits);
    beyond.extend(component_in_use(machine, &correction, options.ini.as_ref()));
    if options.force {
        force(&mut beyond, &mut correction);
    }
    findings.0.extend(beyond);
    let correction = &correction;
    if let Some(active) = &correction.active {
        match active.check_belongs(machine, CONTROLLER) {
            Ok(more) => findings.0.extend(more.0),
            Err(failure) => findings.0.extend(failure.0),
        }
        findings.push(mode_note(active, correction.transformation || active.idle_without_transformation(machine) == 0));
    }
    let joints = match ini::Joints::for_machine(machine, options.ini.as_ref()) {
        Ok(joints) => Some(joints),
        Err(failure) => {
            findings.0.extend(failure.0);
            None
        }
    };
    if correction.terms.is_empty() && correction.shapes.is_empty() {
        findings.push(
            Finding::warning("tables::nothing", "no parameter of status \"identified\" that a table can hold").help(
                "`axiscal identify` says what these touches cannot determine; `axiscal effects` lists the effects",
            ),
        );
    }
    let (joints, findings) = findings.finish(joints)?;
    let Some(joints) = joints else {
        return Err(Failure(findings.0));
    };
    let release = match &options.release {
        Some(release) => release.clone(),
        None => Postprocessor::load_built_in_or_file(CONTROLLER)?.0.release(None)?.clone(),
    };
    let (export, more) = pack::pack(machine, correction, options, (&joints, &release))?;
    let mut findings = findings;
    findings.0.extend(more.0);
    Ok((export, findings))
}

/// The pins of a component that is in use hold values that acted on the touches: written anew, all of them would be lost.
fn component_in_use(machine: &Machine, correction: &Correction, ini: Option<&UserIni>) -> Option<Finding> {
    let component = component::name(machine);
    let in_use = ini?.kinematics.as_deref()?.split_whitespace().next()? == component;
    (in_use && correction.active.is_none()).then(|| {
        let says = format!(
            "the INI file uses {component}, the component of an earlier export, and the study names no compensation"
        );
        Finding::error("tables::component_in_use", says).help(
            "write `compensation = \"FOLDER\"` of that export beside each run of the study in which it was loaded; where it was not \
             loaded, give the INI file with which the machine ran",
        )
    })
}

fn mode_note(active: &Compensation, acted: bool) -> Finding {
    let mode = active.mode;
    let other = match mode {
        Mode::Component => "stock/",
        Mode::Stock | Mode::Table => "the component",
    };
    Finding::info(
        "tables::one_way",
        if acted {
            format!("during the measurement the control applied a compensation of mode \"{mode}\"; its values are in the totals")
        } else {
            format!("during the measurement a compensation of mode \"{mode}\" was loaded, whose pins do not act on axis positions: what was found takes their place")
        },
    )
    .help(format!("before changing to {other}, load the restoring files of the old one: the two ways must never act together"))
}

/// Renders a template with a context; templates are part of the program, so that failing is a fault of ours that the
/// user sees as an error, not as a panic.
pub(in crate::tables) fn render(name: &str, template: &str, context: &minijinja::Value) -> Result<String> {
    let fault = |e: minijinja::Error| {
        Failure::new("tables::template", format!("template {name}: {e:#}"))
            .help("this is a fault of the program: please report it with the study and the machine file")
    };
    let mut syntax = minijinja::syntax::SyntaxConfig::builder();
    syntax.trim_blocks(true).lstrip_blocks(true).keep_trailing_newline(true);
    let mut environment = minijinja::Environment::new();
    environment.set_syntax(syntax.build().map_err(fault)?);
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    environment.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
    environment.add_template(name, template).map_err(fault)?;
    environment.get_template(name).and_then(|t| t.render(context)).map_err(fault)
}

/// A text of the user's on one line of a comment: no line ends, no end of a C comment, no brackets that an NC comment
/// would end at.
pub(in crate::tables) fn one_line(text: &str) -> String {
    let cleaned: String = text
        .chars()
        .map(|c| match c {
            '(' => '[',
            ')' => ']',
            c if c.is_control() => ' ',
            c => c,
        })
        .collect();
    cleaned.replace("*/", "* /").replace("/*", "/ *").replace("??/", "?? /").trim_end_matches('\\').to_owned()
}

/// The lines at the head of every file.
pub(in crate::tables) fn head(machine: &Machine, correction: &Correction) -> Vec<String> {
    let p = &correction.provenance;
    let or = |text: &str| if text.is_empty() { "not stated".to_owned() } else { one_line(text) };
    let mut lines = vec![
        format!("Written by {} for machine {}.", program(), one_line(&machine.name)),
        format!("Study: {}", or(&p.study)),
        format!("Study sha256: {}", or(&p.study_sha256)),
        format!("Date of the data: {}", or(&p.data_date)),
    ];
    // whoever loads it has not seen the screen
    if !p.forced.is_empty() {
        lines.push(format!("FORCED, {} spoke against it (listed in README.txt)", count(p.forced.len())));
    }
    lines
}

fn count(n: usize) -> String {
    if n == 1 { "1 finding".to_owned() } else { format!("{n} findings") }
}

/// Turns what refuses an export into warnings, and notes it for the files.
pub(in crate::tables) fn force(findings: &mut [Finding], correction: &mut Correction) {
    for finding in findings.iter_mut().filter(|f| f.severity == Severity::Error) {
        finding.severity = Severity::Warning;
        finding.help = Some("exported because it was forced: move the machine slowly at first".to_owned());
        correction.provenance.forced.push(finding.message.clone());
    }
}
