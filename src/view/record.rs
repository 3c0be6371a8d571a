//! The records of a view. Lengths mm and angles deg, µm where a name ends in `_um`, hours in `_h`.
//!
//! Touches stand column by column, because there may be ten thousand of them and the page that holds them is mailed.

use super::ViewMaterial;
use crate::compare::Split;
use crate::compare::model_ladder::{Curve, Kind};
use crate::diagnose::answer::Candidate;
use crate::diagnose::{Diagnosis, Verdict};
use crate::fit::outcome::{Combination, Status, Undetermined};
use crate::machine::Form;
use crate::search::multiplicity::FAMILY_LEVEL;
use crate::study::tolerance::Tolerance;
use crate::tables::compensation::Term;
use crate::words::headline::Headline;
use crate::words::next_steps::Next;
use serde::Serialize;
use std::collections::BTreeMap;

/// Everything that is shown.
#[derive(Debug, Clone, Serialize)]
pub struct View {
    /// `axiscal-view/1`
    pub format: &'static str,
    /// Program and version.
    pub program: String,
    /// What was measured.
    pub study: StudyRecord,
    /// The verdict in words.
    pub headline: Headline,
    /// What to do, the first thing first.
    pub next: Vec<Next>,
    /// The error in numbers.
    pub errors: Errors,
    /// The results with their doubt, against the tolerance.
    pub parameters: Vec<ParameterRecord>,
    /// The same with what the diagnosis proposes in the model; empty where it proposes nothing.
    pub proposed: Vec<ParameterRecord>,
    pub tolerance: Tolerance,
    /// The models on these touches.
    pub ladder: Vec<RungRecord>,
    /// What a reader of the ladder must know.
    pub ladder_notes: Vec<String>,
    /// Verdict, candidates, what the misfit depends on.
    pub diagnosis: DiagnosisRecord,
    /// Ways to split the touches, best first.
    pub splits: Vec<Split>,
    /// Where the model fails, in a sentence.
    pub comparison_says: String,
    /// How the results hang together.
    pub correlation: Correlation,
    /// What this data cannot tell.
    pub undetermined: Vec<Undetermined>,
    /// What it tells badly.
    pub weak: Vec<Combination>,
    /// Remarks of the fit.
    pub warnings: Vec<String>,
    /// What a compensation carries, and what it leaves.
    pub compensation: Compensation,
    /// The machine to be drawn.
    pub machine: MachineRecord,
    /// Every touch that the model can use.
    pub touches: Touches,
    /// Every touch that it cannot.
    pub unusable: Vec<UnusableRecord>,
    /// What residuals are drawn against.
    pub variables: Vec<Variable>,
    /// What was added between two models, against each variable.
    pub curves: Vec<Curve>,
}

/// What was measured.
#[derive(Debug, Clone, Serialize)]
pub struct StudyRecord {
    /// The study's file.
    pub name: String,
    /// SHA-256 of the study and all that it names.
    pub sha256: String,
    /// Where the commands of the report run, in a sentence; empty where they run anywhere.
    pub commands_run_in: String,
    /// Day of the data.
    pub date: String,
    /// Ids of the effects in the model.
    pub effects: Vec<String>,
    pub runs: Vec<RunRecord>,
}

#[derive(Debug, Clone, Serialize)]
pub struct RunRecord {
    /// File of the plan.
    pub plan: String,
    /// Name of the program.
    pub program: String,
    /// File of the log.
    pub log: String,
    pub controller: String,
    /// Touches of the plan.
    pub touches: usize,
}

/// The error in numbers.
#[derive(Debug, Clone, Serialize)]
pub struct Errors {
    /// Number of the rung that is shown as "before", from 0.
    pub before: usize,
    /// Number of the rung that is shown as "after", from 0.
    pub after: usize,
    /// Standard deviation of a touch.
    pub noise_um: f64,
    /// Where that comes from.
    pub noise_says: String,
    /// Reduced chi-square of the study's model.
    pub chi2_per_dof: f64,
    /// Error left by the study's model.
    pub rms_um: f64,
    /// The same on touches left out.
    pub held_out_rms_um: Option<f64>,
    /// Touches made.
    pub touches: usize,
    /// Touches used.
    pub used: usize,
    /// Free parameters.
    pub unknowns: usize,
    /// Degrees of freedom.
    pub dof: usize,
    /// Did the fit converge?
    pub converged: bool,
}

/// How a result stands to its tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Judgement {
    /// Smaller than the tolerance with its doubt added.
    Within,
    /// Larger than the tolerance with its doubt taken off.
    Beyond,
    /// The doubt spans the tolerance.
    Open,
    /// There is no value, no doubt or no tolerance.
    None,
}

impl Judgement {
    /// In a word.
    #[must_use]
    pub fn says(self) -> &'static str {
        crate::words::standing::judgement(self)
    }
}

/// A result.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterRecord {
    /// ISO form.
    pub name: String,
    /// The paper's symbol.
    pub alias: Option<String>,
    /// What it is, in words.
    pub says: String,
    /// Id of its effect.
    pub effect: String,
    pub effect_name: String,
    pub mends: String,
    pub value: f64,
    pub unit: String,
    /// Standard uncertainty.
    pub sigma: Option<f64>,
    /// Expanded uncertainty, 95 %.
    pub expanded: Option<f64>,
    /// Is the value a result?
    pub status: Status,
    /// What it does to a point at the tolerance's radius, µm; none where its unit says nothing about that.
    pub at_radius_um: Option<f64>,
    /// Expanded uncertainty of that.
    pub at_radius_expanded_um: Option<f64>,
    /// Its tolerance, in its unit.
    pub tolerance: Option<f64>,
    /// Its tolerance as error at the radius.
    pub tolerance_um: Option<f64>,
    /// How it stands to it.
    pub judgement: Judgement,
    /// The same in a word.
    pub judgement_says: &'static str,
}

/// A model on these touches.
#[derive(Debug, Clone, Serialize)]
pub struct RungRecord {
    /// What it stands for.
    pub kind: Kind,
    /// In words: `the machine as it stands`, `+zero-b`.
    pub label: String,
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// What it has that the one before has not.
    pub added: Vec<String>,
    /// What the one before has that it has not.
    pub removed: Vec<String>,
    /// Error left.
    pub rms_um: f64,
    /// The same on touches left out.
    pub held_out_rms_um: Option<f64>,
    /// Reduced chi-square.
    pub chi2_per_dof: f64,
    /// Free parameters.
    pub unknowns: usize,
}

/// The diagnosis with what the catalogue says of its candidates.
#[derive(Debug, Clone, Serialize)]
pub struct DiagnosisRecord {
    /// As `axiscal diagnose --json` gives it.
    #[serde(flatten)]
    pub answer: Diagnosis,
    /// How each candidate stands.
    #[serde(skip)]
    pub standings: Vec<Standing>,
    /// The same in words.
    pub standings_say: Vec<&'static str>,
    /// By id of an effect: name and what mends it, for every effect that is named anywhere in the view.
    pub effects: BTreeMap<String, EffectRecord>,
}

/// How a candidate stands: does it pass, was it tried on touches left out, is it the first?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    Proposed,
    /// Two effects are named together.
    ProposedTogether,
    NoMoreThanNoise,
    /// There is too little data.
    CannotBeJudged,
    /// These poses do not allow to leave touches out.
    CannotBeTried,
    /// It passes, and touches left out do not bear it out.
    NotBorneOut,
    /// The first candidate explains more.
    LessThanTheFirst,
}

impl Standing {
    /// Those that explain a part.
    pub const PARTS: [Self; 4] = [Self::CannotBeJudged, Self::CannotBeTried, Self::NotBorneOut, Self::LessThanTheFirst];

    fn of(d: &Diagnosis, place: usize, candidate: &Candidate) -> Self {
        let sizes = [candidate.held_out_before_um, candidate.held_out_after_um];
        let is_tried = sizes.iter().flatten().any(|um| *um > 0.0);
        match d.verdict {
            _ if candidate.proposed && candidate.together_with.is_some() => Self::ProposedTogether,
            _ if candidate.proposed => Self::Proposed,
            _ if candidate.p_adjusted >= FAMILY_LEVEL => Self::NoMoreThanNoise,
            Verdict::TooLittleData(_) => Self::CannotBeJudged,
            Verdict::Unexplained(_) if !is_tried => Self::CannotBeTried,
            _ if place == 0 => Self::NotBorneOut,
            _ => Self::LessThanTheFirst,
        }
    }
}

/// An effect in words.
#[derive(Debug, Clone, Serialize)]
pub struct EffectRecord {
    /// Name for people.
    pub name: String,
    pub says: String,
    /// How to confirm it.
    pub look: String,
    pub mends: String,
}

/// Correlation coefficients.
#[derive(Debug, Clone, Serialize)]
pub struct Correlation {
    /// The results.
    pub names: Vec<String>,
    /// Row by row; null where one of the two has no uncertainty.
    pub matrix: Vec<Vec<Option<f64>>>,
}

/// What a compensation carries.
#[derive(Debug, Clone, Serialize)]
pub struct Compensation {
    /// Why none can be made.
    pub refused: Option<String>,
    /// A compensation was active during the measurement.
    pub active: bool,
    /// What is carried, mm or deg.
    pub terms: Vec<Term>,
    /// Errors of an axis's own position that a table of this axis holds.
    pub shapes: Vec<ShapeRecord>,
    /// The tool is this much longer than the study assumed, mm.
    pub tool_length_mm: Option<f64>,
    /// What is not carried.
    pub left: Vec<LeftRecord>,
    /// Effects of the measurement, which no compensation needs.
    pub of_measurement: Vec<String>,
    /// Where tilts and offsets of workpiece-side axes are stated, mm in R.
    pub reference_mm: [f64; 3],
}

/// An error of an axis's own position.
#[derive(Debug, Clone, Serialize)]
pub struct ShapeRecord {
    /// ISO form.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    pub axis: String,
}

/// What a compensation leaves.
#[derive(Debug, Clone, Serialize)]
pub struct LeftRecord {
    /// ISO form.
    pub parameter: String,
    /// Id of its effect.
    pub effect: String,
    pub value: f64,
    pub unit: String,
    /// What it leaves at the tolerance's radius, µm.
    pub left_um: Option<f64>,
    pub why: String,
    /// A known error of the machine, so that leaving it out leaves that error.
    pub known: bool,
}

/// A machine to be drawn, mm in R with all axes at zero.
#[derive(Debug, Clone, Serialize)]
pub struct MachineRecord {
    /// Short name.
    pub name: String,
    pub says: String,
    /// The axes, workpiece side from the base on, then tool side from the base on.
    pub axes: Vec<AxisRecord>,
    /// Pivot of the spindle.
    pub pivot: [f64; 3],
    /// From the ball to the spindle.
    pub tool_direction: [f64; 3],
    /// Pivot to the ball's centre.
    pub tool_length_mm: f64,
    /// Table and other solids that are always there.
    pub solids: Vec<SolidRecord>,
    /// The blocks of the plans.
    pub blocks: Vec<BlockRecord>,
}

#[derive(Debug, Clone, Serialize)]
pub struct AxisRecord {
    /// Its letter.
    pub name: String,
    /// Does it turn?
    pub rotary: bool,
    /// `workpiece` or `tool`.
    pub side: &'static str,
    pub direction: [f64; 3],
    /// A point of a rotary axis.
    pub point: [f64; 3],
    /// Lowest and highest coordinate.
    pub range: [f64; 2],
}

/// A solid; a cylinder where it has a radius.
#[derive(Debug, Clone, Serialize)]
pub struct SolidRecord {
    pub name: String,
    /// What bears it.
    pub carrier: String,
    /// Centre (of a cylinder: of its foot).
    pub at: [f64; 3],
    /// Full edges of a box.
    pub size: Option<[f64; 3]>,
    /// From the foot of a cylinder to its other end.
    pub direction: Option<[f64; 3]>,
    /// Radius and height of a cylinder.
    pub radius_height: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Serialize)]
pub struct BlockRecord {
    pub name: String,
    /// What bears it.
    pub carrier: String,
    /// What it is; without it a box.
    #[serde(skip_serializing_if = "Form::is_box")]
    pub form: Form,
    pub centre: [f64; 3],
    /// Full edges of the box that holds it.
    pub size: [f64; 3],
    /// Of a sphere, a cylinder or a hole.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diameter: Option<f64>,
    /// Number of the run, from 1.
    pub run: usize,
}

/// Every touch that the model can use, column by column.
#[derive(Debug, Clone, Serialize)]
pub struct Touches {
    /// How many.
    pub n: usize,
    /// Number of the run, from 1.
    pub run: Vec<usize>,
    /// Number in the plan.
    pub id: Vec<u64>,
    /// Line in the run's log.
    pub line: Vec<usize>,
    /// Words that `stage`, `block` and `face` count, from 0.
    pub words: Vec<String>,
    /// Stage of the program.
    pub stage: Vec<usize>,
    /// The block as it stood.
    pub block: Vec<usize>,
    pub face: Vec<usize>,
    /// Index visit.
    pub visit: Vec<usize>,
    /// Axis positions at the trigger, by letter.
    pub axes: BTreeMap<String, Vec<f64>>,
    /// Hours since the first touch.
    pub time_h: Vec<f64>,
    /// Pivot to ball, mm.
    pub stylus_mm: Vec<f64>,
    /// Direction of the approach about the probe's axis, deg; null along it.
    pub approach_deg: Vec<Option<f64>>,
    /// Nominal contact point, in the carrier's frame (R with all axes at zero).
    pub point: Vec<[f64; 3]>,
    /// Outward normal, in the same frame.
    pub normal: Vec<[f64; 3]>,
    /// Outward normal in R at the touch.
    pub normal_r: Vec<[f64; 3]>,
    /// Direction of R in which the touch shows a displacement: 0 1 2 = X Y Z.
    pub towards: Vec<usize>,
    /// +1 or -1: the residual times this is the displacement of the ball in that direction.
    pub sign: Vec<i8>,
    /// Measured less model along the outward normal, one list per rung of the ladder.
    pub residual_um: Vec<Vec<f64>>,
    /// Externally studentised, with the study's model.
    pub standardised: Vec<f64>,
    /// Why a touch is not used; null where it is.
    pub rejected: Vec<Option<String>>,
}

impl Touches {
    /// A variable of the view at a touch.
    #[must_use]
    pub fn value(&self, variable: &str, touch: usize) -> Option<f64> {
        match variable {
            "time" => Some(self.time_h[touch]),
            "order" => Some((touch + 1) as f64),
            "approach" => self.approach_deg[touch],
            "stylus" => Some(self.stylus_mm[touch]),
            axis => self.axes.get(axis).and_then(|a| a.get(touch)).copied(),
        }
    }
}

/// A touch that the model cannot use.
#[derive(Debug, Clone, Serialize)]
pub struct UnusableRecord {
    /// Number of the run, from 1.
    pub run: usize,
    /// Number in the plan.
    pub id: u64,
    /// Line in the log.
    pub line: usize,
    /// Why.
    pub reason: String,
}

/// What residuals are drawn against.
#[derive(Debug, Clone, Serialize)]
pub struct Variable {
    /// An axis letter, `time`, `order`, `approach`, `stylus`.
    pub id: String,
    /// Title of the axis of the plot, with its unit.
    pub title: String,
    /// Share of the misfit that goes with it, 0 to 1, where that is known.
    pub share: Option<f64>,
}

/// The diagnosis with the words of the catalogue.
pub(super) fn diagnosis(m: &ViewMaterial) -> DiagnosisRecord {
    let d = m.diagnosis;
    let mut ids: Vec<&str> = m.fit.outcome.effects.iter().map(String::as_str).collect();
    for c in &d.candidates {
        ids.push(&c.effect);
        ids.extend(c.same_as.iter().map(String::as_str));
    }
    ids.extend(m.ladder.rungs.iter().flat_map(|r| r.effects.iter().map(String::as_str)));
    ids.extend(d.not_seen.iter().map(String::as_str));
    ids.extend(d.power.iter().map(|p| p.effect.as_str()));
    let mut effects = BTreeMap::new();
    for id in ids {
        if let Some(e) = m.catalogue.get(id, m.machine) {
            effects.entry(id.to_owned()).or_insert_with(|| EffectRecord {
                name: e.name.clone(),
                says: e.says.clone(),
                look: e.look.clone(),
                mends: e.mends.clone(),
            });
        }
    }
    let standings: Vec<Standing> = d.candidates.iter().enumerate().map(|(i, c)| Standing::of(d, i, c)).collect();
    let standings_say = standings.iter().map(|s| crate::words::standing::candidate(*s)).collect();
    DiagnosisRecord { answer: d.clone(), standings, standings_say, effects }
}
