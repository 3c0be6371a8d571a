//! `study.toml`: what was measured and what the model holds (docs/formats.md).
//!
//! Reading gives checked records with the findings' places; writing edits the text in place, so that the user's comments
//! and order stay. Nothing here opens the files that a study names: `workflow` does.

mod join;
pub mod mask;

pub use join::{Joined, join};
pub mod edit;
pub mod history;
pub mod tolerance;

use crate::diag::{Failure, Finding, Findings, Result, Source};
use crate::fit::{Knowledge, Mask, Settings};
use crate::keys::not_of_form;
use crate::model::spindle::{MOST_STRETCHES, SpindleStretch};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// No probe and no axis scatters by less or more, um.
const USABLE_UM: std::ops::RangeInclusive<f64> = 1e-9..=1e6;

/// A prior that is surer than this, in its parameter's unit, is a held value.
const SUREST: f64 = 1e-12;

/// The study as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AsWritten {
    /// A machines.toml of the user's own, relative to the study (default: the one built in).
    pub machines: Option<String>,
    /// Name of the machine.
    #[schemars(with = "String")]
    pub machine: Spanned<String>,
    /// Effects of the user's own, relative to the study.
    #[serde(default)]
    pub effects_file: Vec<String>,
    /// The measurement runs, in the order in which they were run.
    #[serde(default)]
    pub data: Vec<DataAsWritten>,
    /// What the model holds.
    #[serde(default)]
    pub model: ModelAsWritten,
    /// What the user states about the noise.
    #[serde(default)]
    pub noise: NoiseAsWritten,
    /// Type B rows: standard uncertainty of parameters that are not in the model, in their units (`size_X = 0.5`).
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, f64>")]
    pub uncertainty: BTreeMap<String, Spanned<f64>>,
    /// Touches that are not to be used.
    #[serde(default)]
    pub mask: Vec<MaskAsWritten>,
    /// How large an error may be before somebody has to do something.
    pub tolerance: Option<tolerance::AsWritten>,
}

/// A touch that is not to be used.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MaskAsWritten {
    /// Which run, from 1.
    #[schemars(with = "usize")]
    pub run: Spanned<usize>,
    /// Number in the plan.
    #[schemars(with = "u64")]
    pub id: Spanned<u64>,
    /// Why.
    pub reason: String,
}

/// One run as written.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataAsWritten {
    /// The plan, relative to the study.
    #[schemars(with = "String")]
    pub plan: Spanned<String>,
    /// The log, relative to the study.
    #[schemars(with = "String")]
    pub log: Spanned<String>,
    /// A controller, a postprocessor file, or `csv`.
    #[schemars(with = "String")]
    pub controller: Spanned<String>,
    /// When the run began, s on the study's one clock.
    #[schemars(with = "Option<f64>")]
    pub started: Option<Spanned<f64>>,
    /// Which run, from 1, where the log holds several (default: the last complete one).
    #[schemars(with = "Option<usize>")]
    pub run: Option<usize>,
    /// Blocks of equal mounting, carrier and name share one set-up.
    pub mounting: Option<String>,
    /// The compensation that the control applied during this run: the directory or file that `export` wrote.
    pub compensation: Option<String>,
    /// When the spindle ran: `[[start_s, end_s, rpm], …]`, s on the study's clock (default: since the first touch).
    #[schemars(with = "Option<Vec<[f64; 3]>>")]
    pub spindle: Option<Spanned<Vec<[f64; 3]>>>,
}

/// The model as written.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelAsWritten {
    /// Ids of the effects: the whole model.
    #[serde(default)]
    #[schemars(with = "Vec<String>")]
    pub effects: Vec<Spanned<String>>,
    /// Parameters that are held or have a prior.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, ParameterAsWritten>")]
    pub parameters: BTreeMap<String, Spanned<ParameterAsWritten>>,
}

/// What is said of one parameter.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterAsWritten {
    /// Its value, in its unit.
    pub value: Option<f64>,
    /// Held at the value.
    #[serde(default)]
    pub fixed: bool,
    /// Or known to this standard deviation.
    pub sigma: Option<f64>,
}

/// What the user states about the noise.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseAsWritten {
    /// Standard deviation of a touch, µm.
    #[schemars(with = "Option<f64>")]
    pub touch_um: Option<Spanned<f64>>,
    /// Standard deviation of each component of the displacement of an index visit, µm.
    #[schemars(with = "Option<f64>")]
    pub visit_um: Option<Spanned<f64>>,
}

/// A checked study. Paths are as written: relative to the study.
#[derive(Debug, Clone)]
pub struct Study {
    /// A machines.toml of the user's own.
    pub machines: Option<String>,
    /// Name of the machine.
    pub machine: String,
    /// Effects of the user's own.
    pub effects_files: Vec<String>,
    /// The measurement runs.
    pub data: Vec<DataEntry>,
    /// Ids of the effects.
    pub effects: Vec<String>,
    /// Parameters that are held or have a prior.
    pub knowledge: BTreeMap<String, Knowledge>,
    /// Standard deviation of a touch, mm, where stated.
    pub touch_sigma_mm: Option<f64>,
    /// Standard deviation of each component of the displacement of an index visit, mm, where stated.
    pub visit_sigma_mm: Option<f64>,
    /// Type B rows, in the parameters' units.
    pub type_b: BTreeMap<String, f64>,
    /// Touches that are not to be used.
    pub masked: Vec<Mask>,
    /// How large an error may be.
    pub tolerance: tolerance::Tolerance,
}

/// One run.
#[derive(Debug, Clone, PartialEq)]
pub struct DataEntry {
    pub plan: String,
    pub log: String,
    /// A controller, a postprocessor file, or `csv`.
    pub controller: String,
    /// When the run began, s.
    pub started_s: Option<f64>,
    /// Which run of the log, from 1.
    pub run: Option<usize>,
    /// Blocks of equal mounting, carrier and name share one set-up.
    pub mounting: Option<String>,
    /// The compensation that was active.
    pub compensation: Option<String>,
    /// When the spindle ran; nothing where the study does not say it.
    pub spindle: Vec<SpindleStretch>,
}

/// A word of the whole study that stands in one of its tables: what follows a `[[data]]` belongs to it.
fn misplaced(error: &toml::de::Error) -> Option<&'static str> {
    let word = error.message().strip_prefix("unknown field `")?.split('`').next()?;
    ["effects_file", "machine", "machines"].into_iter().find(|key| *key == word)
}

/// Where the number of a masked touch is in the study's text. `nth` counts all `[[mask]]`, from 0.
#[must_use]
pub fn place_of_mask(source: &Source, nth: usize) -> Option<std::ops::Range<usize>> {
    let written: AsWritten = toml::from_str(source.inner()).ok()?;
    written.mask.get(nth).map(|m| m.id.span())
}

/// The stretches of a run in which the spindle ran.
fn spindle_of(run: &DataAsWritten, source: &Source, findings: &mut Findings) -> Vec<SpindleStretch> {
    let Some(written) = &run.spindle else { return Vec::new() };
    let mut out: Vec<SpindleStretch> = Vec::new();
    for &[from_s, to_s, rpm] in written.get_ref() {
        let usable = [from_s, to_s, rpm].iter().all(|x| x.is_finite()) && from_s < to_s && rpm > 0.0;
        if !usable || out.last().is_some_and(|last| last.to_s > from_s) {
            findings.push(
                Finding::error("study::spindle", "a stretch of the spindle is not usable")
                    .help("write spindle = [[0, 1800, 12000], [3600, 5400, 8000]]: start and end in s on the study's clock, one after the other, and the speed, greater than 0")
                    .at(source, written.span()),
            );
            break;
        }
        out.push(SpindleStretch { from_s, to_s, rpm });
    }
    out
}

impl Study {
    /// Reads a study.
    ///
    /// # Errors
    /// When the text is not TOML of this form or contradicts itself; every finding has its place.
    pub fn parse(source: &Source) -> Result<(Self, Findings)> {
        let w: AsWritten = toml::from_str(source.inner()).map_err(|e| {
            let help = match misplaced(&e) {
                Some(key) => format!("`{key}` is a word of the whole study: put it above the first [[data]]"),
                None => "`axiscal new` writes a study; `axiscal schema study` prints the form".to_owned(),
            };
            not_of_form::<AsWritten>(&e, source, "study::not_toml", &help)
        })?;
        let mut findings = Findings::default();
        if w.data.is_empty() {
            findings.push(
                Finding::error("study::no_data", "the study names no measurement")
                    .help("add a [[data]] table with plan, log and controller")
                    .at(source, 0..0),
            );
        }
        if w.model.effects.is_empty() {
            findings.push(
                Finding::error("study::no_effects", "the model has no effect")
                    .help("write [model] effects = [\"location-b\", …]: `axiscal effects` lists them")
                    .at(source, 0..0),
            );
        }
        let mut data = Vec::new();
        for d in &w.data {
            if let Some(started) = &d.started
                && !started.get_ref().is_finite()
            {
                findings.push(
                    Finding::error("study::started", "started is not a number")
                        .help("seconds on the study's clock")
                        .at(source, started.span()),
                );
            }
            data.push(DataEntry {
                plan: d.plan.get_ref().clone(),
                log: d.log.get_ref().clone(),
                controller: d.controller.get_ref().clone(),
                started_s: d.started.as_ref().map(|s| *s.get_ref()),
                run: d.run,
                mounting: d.mounting.clone(),
                compensation: d.compensation.clone(),
                spindle: spindle_of(d, source, &mut findings),
            });
        }
        let stretches: usize = data.iter().map(|d| d.spindle.len()).sum();
        if stretches > MOST_STRETCHES {
            let place = w.data.iter().filter_map(|d| d.spindle.as_ref()).next_back().map_or(0..0, Spanned::span);
            let message = format!("the spindle ran in {stretches} stretches; at most {MOST_STRETCHES} are used");
            let help = "join stretches with short pauses, and leave out those that ended hours before the first touch";
            findings.push(Finding::error("study::spindle", message).help(help).at(source, place));
        }
        let mut knowledge = BTreeMap::new();
        for (name, spanned) in &w.model.parameters {
            let p = spanned.get_ref();
            let known = match (p.value, p.fixed, p.sigma) {
                (Some(value), true, None) if value.is_finite() => Some(Knowledge::Fixed(value)),
                (Some(value), false, Some(sigma)) if value.is_finite() && (SUREST..f64::MAX).contains(&sigma) => {
                    Some(Knowledge::Prior { value, sigma })
                }
                _ => None,
            };
            match known {
                Some(known) => {
                    knowledge.insert(name.clone(), known);
                }
                None => findings.push(
                    Finding::error("study::parameter", format!("what is said of {name} is not usable"))
                        .help("write value and fixed = true, or value and sigma (1e-12 or more, in its unit)")
                        .at(source, spanned.span()),
                ),
            }
        }
        let mm = |um: &Option<Spanned<f64>>| um.as_ref().map(|um| crate::units::mm_from_um(*um.get_ref()));
        let place = |um: &Option<Spanned<f64>>| um.as_ref().map_or(0..0, Spanned::span);
        let touch_sigma_mm = mm(&w.noise.touch_um);
        let usable = |um: &Spanned<f64>| USABLE_UM.contains(um.get_ref());
        if w.noise.touch_um.as_ref().is_some_and(|um| !usable(um)) {
            findings.push(
                Finding::error("study::noise", "touch_um is no usable number")
                    .help("the standard deviation of one touch in um: greater than 0, between 1e-9 and 1e6")
                    .at(source, place(&w.noise.touch_um)),
            );
        }
        let visit_sigma_mm = mm(&w.noise.visit_um);
        if w.noise.visit_um.as_ref().is_some_and(|um| *um.get_ref() != 0.0 && !usable(um)) {
            findings.push(
                Finding::error("study::noise", "visit_um is no usable number")
                    .help("the standard deviation of the ball's place from one index to the next in um: 0, or between 1e-9 and 1e6")
                    .at(source, place(&w.noise.visit_um)),
            );
        }
        for (name, sigma) in &w.uncertainty {
            if !(sigma.get_ref().is_finite() && *sigma.get_ref() > 0.0) {
                findings.push(
                    Finding::error("study::uncertainty", format!("the uncertainty of {name} is no positive number"))
                        .help("a standard uncertainty (1 sigma) in the parameter's unit")
                        .at(source, sigma.span()),
                );
            }
        }
        let mut masked = Vec::new();
        for m in &w.mask {
            match m.run.get_ref().checked_sub(1).filter(|run| *run < data.len()) {
                Some(run) => masked.push(Mask { run, id: *m.id.get_ref(), reason: m.reason.clone() }),
                None => findings.push(
                    Finding::error("study::mask", format!("there is no run {}", m.run.get_ref()))
                        .help(format!("runs are counted from 1; the study has {}", data.len()))
                        .at(source, m.run.span()),
                ),
            }
        }
        let tolerance = tolerance::Tolerance::read(w.tolerance, source, &mut findings);
        findings.finish(Self {
            machines: w.machines,
            machine: w.machine.into_inner(),
            effects_files: w.effects_file,
            data,
            effects: w.model.effects.into_iter().map(Spanned::into_inner).collect(),
            knowledge,
            touch_sigma_mm,
            visit_sigma_mm,
            type_b: w.uncertainty.into_iter().map(|(name, sigma)| (name, sigma.into_inner())).collect(),
            masked,
            tolerance,
        })
    }

    /// What the study asks of the fit.
    #[must_use]
    pub fn settings(&self) -> Settings {
        Settings {
            effects: self.effects.clone(),
            knowledge: self.knowledge.clone(),
            touch_sigma_mm: self.touch_sigma_mm,
            visit_sigma_mm: self.visit_sigma_mm,
            reference: None,
            type_b: self.type_b.clone(),
            masked: self.masked.clone(),
            bare: false,
            quick: false,
            all_in: false,
        }
    }

    /// The text of a fresh study.
    ///
    /// # Errors
    /// Never for strings that TOML can hold; the text is read back before it is returned.
    pub fn fresh(&self) -> Result<String> {
        use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value, value};
        let mut doc = DocumentMut::new();
        if let Some(machines) = &self.machines {
            doc["machines"] = value(machines);
        }
        doc["machine"] = value(&self.machine);
        if !self.effects_files.is_empty() {
            doc["effects_file"] = value(self.effects_files.iter().collect::<Array>());
        }
        let mut runs = ArrayOfTables::new();
        for entry in &self.data {
            let mut run = Table::new();
            run["plan"] = value(&entry.plan);
            run["log"] = value(&entry.log);
            run["controller"] = value(&entry.controller);
            if let Some(n) = entry.run {
                run["run"] = value(i64::try_from(n).unwrap_or(i64::MAX));
            }
            if let Some(s) = entry.started_s {
                run["started"] = value(s);
            }
            if let Some(m) = &entry.mounting {
                run["mounting"] = value(m);
            }
            if !entry.spindle.is_empty() {
                let stretch = |s: &SpindleStretch| Value::from_iter([s.from_s, s.to_s, s.rpm]);
                run["spindle"] = value(Value::from_iter(entry.spindle.iter().map(stretch)));
            }
            if let Some(c) = &entry.compensation {
                run["compensation"] = value(c);
            }
            runs.push(run);
        }
        doc["data"] = Item::ArrayOfTables(runs);
        let mut model = Table::new();
        model["effects"] = value(self.effects.iter().collect::<Array>());
        model
            .decor_mut()
            .set_prefix("\n# the whole model: nothing is added to it. `axiscal effects` lists what there is\n");
        doc["model"] = Item::Table(model);
        let mut noise = Table::new();
        for (word, sigma) in [("touch_um", self.touch_sigma_mm), ("visit_um", self.visit_sigma_mm)] {
            if let Some(sigma) = sigma {
                noise[word] = value(crate::units::um_from_mm(sigma));
            }
        }
        if !noise.is_empty() {
            doc["noise"] = Item::Table(noise);
        }
        if !self.type_b.is_empty() {
            let mut rows = Table::new();
            for (name, sigma) in &self.type_b {
                rows[name.as_str()] = value(*sigma);
            }
            doc["uncertainty"] = Item::Table(rows);
        }
        let text = format!("# what was measured, and the effects of the model (docs/guide)\n{doc}");
        Self::parse(&crate::diag::source("study.toml", text.clone()))
            .map_err(|f| Failure::new("study::unwritable", format!("the study cannot be written: {f}")))?;
        Ok(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::source;

    fn example() -> Study {
        Study {
            machines: None,
            machine: "swivel-head".into(),
            effects_files: vec![],
            data: vec![DataEntry {
                plan: "head.plan.json".into(),
                log: "head \"1\".log".into(),
                controller: "linuxcnc".into(),
                started_s: Some(3.0),
                run: None,
                mounting: None,
                compensation: None,
                spindle: vec![],
            }],
            effects: vec!["location-b".into(), "block-setup".into()],
            knowledge: BTreeMap::new(),
            touch_sigma_mm: None,
            visit_sigma_mm: None,
            type_b: BTreeMap::new(),
            masked: vec![],
            tolerance: tolerance::Tolerance::default(),
        }
    }

    #[test]
    fn a_fresh_study_reads_back() {
        let text = example().fresh().unwrap();
        let (back, _) = Study::parse(&source("s.toml", text)).unwrap();
        assert_eq!(back.data, example().data);
        assert_eq!(back.effects, example().effects);
    }

    #[test]
    fn knowledge_is_read() {
        let text = "machine = \"m\"\n[[data]]\nplan=\"p\"\nlog=\"l\"\ncontroller=\"csv\"\n[model]\neffects=[\"location-b\"]\n[model.parameters.EX0B]\nvalue = 0.03\nfixed = true\n[model.parameters.EZ0B]\nvalue=0.0\nsigma=0.005\n";
        let (study, _) = Study::parse(&source("s.toml", text)).unwrap();
        assert_eq!(study.knowledge["EX0B"], Knowledge::Fixed(0.03));
        assert_eq!(study.knowledge["EZ0B"], Knowledge::Prior { value: 0.0, sigma: 0.005 });
    }

    #[test]
    fn mistakes_have_their_place() {
        let text = "machine = \"m\"\n[[data]]\nplan=\"p\"\nlog=\"l\"\ncontroller=\"csv\"\n[model]\neffects=[\"location-b\"]\n[model.parameters.EX0B]\nvalue = 0.03\n";
        let failure = Study::parse(&source("s.toml", text)).unwrap_err();
        assert!(failure.0[0].place().unwrap().starts_with("s.toml:8:"), "{:?}", failure.0[0].place());
        assert!(Study::parse(&source("s.toml", "machine = ")).is_err());
        let noise = "machine = \"m\"\n[[data]]\nplan=\"p\"\nlog=\"l\"\ncontroller=\"csv\"\n[model]\neffects=[\"location-b\"]\n[noise]\ntouch_um = -1\nvisit_um = nan\n";
        let failure = Study::parse(&source("s.toml", noise)).unwrap_err();
        let places: Vec<_> = failure.0.iter().map(|f| f.place().unwrap()).collect();
        assert_eq!(places, ["s.toml:9:12", "s.toml:10:12"]);
    }
}
