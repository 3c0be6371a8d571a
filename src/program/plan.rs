//! The plan: the touches of a program with their nominal places (`axiscal-plan/1`, docs/formats.md).

use super::plan_digest::{self, Fields};
use crate::axes::{AxisMap, Position};
use crate::diag::{Findings, Result, Source, from_json};
use crate::machine::Form;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The format line of a plan.
pub const FORMAT: &str = "axiscal-plan/1";

/// A whole plan. Lengths mm, angles deg, times s; axis positions are NC coordinates relative to R.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// `axiscal-plan/1`
    pub format: String,
    /// Name of the machine.
    pub machine: String,
    /// SHA-256 of the machine's description when the plan was made.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub machine_sha256: String,
    /// Name of the program.
    pub program: String,
    /// The artefact's mounting.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub mounting: String,
    /// The blocks are put up for this program, and stand nowhere that an earlier one knows.
    #[serde(default, skip_serializing_if = "is_false")]
    pub blocks_anew: bool,
    /// What the controller's coordinates mean: axis positions, or the place in the workpiece under its transformation.
    #[serde(default, skip_serializing_if = "ControllerFrame::is_axes")]
    pub controller_frame: ControllerFrame,
    pub ball_radius_mm: f64,
    /// Pivot to ball's centre.
    pub tool_length_mm: f64,
    /// How far a block may stand from where it should.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placement_tolerance_mm: Option<f64>,
    /// The artefact was put down by eye: how the program finds it before its first touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub find: Option<Find>,
    pub blocks: Vec<PlanBlock>,
    /// The touches, in the order in which they are made.
    pub touches: Vec<PlanTouch>,
    /// Touches that the program asks for and that were left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
    /// What was lost by leaving touches out, and other remarks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What the programs do that were written for this plan, by controller: `check` shows whether one was changed.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub programs: BTreeMap<String, Proof>,
}

/// How a program finds an artefact that was put down by eye. All rotary axes stand at 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Find {
    /// The block's name.
    pub block: String,
    /// How far it may stand from its place along each of X, Y and Z.
    pub tolerance_mm: f64,
    /// How far from its nominal place one of these touches may trigger.
    pub room_mm: f64,
    /// In the order in which they are made. They are in no log: the log holds what they found.
    pub touches: Vec<FindTouch>,
}

/// A touch that finds the artefact. Its places are nominal: those after the first are made relative to what was found by then.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FindTouch {
    /// For messages.
    pub face: String,
    /// Where the search begins.
    pub start: AxisMap,
    /// Where an errorless machine triggers on an artefact at its place.
    pub nominal: AxisMap,
    /// Where the search gives up.
    pub end: AxisMap,
    /// By how much what was found changes for each mm that the probe triggers further along the search.
    pub moves: AxisMap,
}

impl Find {
    /// From this touch on moves are relative to what it has found: the last one of an axis.
    #[must_use]
    pub fn counts_after(&self, place: usize) -> bool {
        let axis = |place: usize| self.touches.get(place).map(|t| t.moves.iter().map(|(a, _)| a).collect::<Vec<_>>());
        axis(place) != axis(place + 1)
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_false(value: &bool) -> bool {
    !*value
}

/// What a program does, as [`crate::check`] has found it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Proof {
    /// The same as `steps_sha256`; in plans of older versions a digest of its actions.
    pub sha256: String,
    /// Of older versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<String>,
    /// Digest of its statements as they are read: remarks, blanks, numbers of blocks, how a number is spelled and what is shown to
    /// the operator do not matter. Empty in plans of older versions.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub steps_sha256: String,
    /// Four digits for each statement, 32 of them in a piece: they show which one was changed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub steps: Vec<String>,
    /// Digest of what is shown to the operator.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub texts_sha256: String,
    /// Digest of the whole text, remarks and all.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub text_sha256: String,
}

/// What the controller's coordinates mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ControllerFrame {
    /// Axis positions (default).
    #[default]
    Axes,
    /// The tool centre point in the workpiece, under the control's own transformation.
    Tcp,
}

impl ControllerFrame {
    #[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
    fn is_axes(&self) -> bool {
        *self == Self::Axes
    }
}

/// A body that is touched as the plan knows it, in the carrier's frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanBlock {
    /// Short name.
    pub name: String,
    /// `table` or the letter of a rotary axis.
    pub carrier: String,
    /// Its mounting, where it differs from the plan's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mounting: Option<String>,
    /// What it is; without it a box.
    #[serde(default, skip_serializing_if = "Form::is_box")]
    pub form: Form,
    /// Its centre, mm.
    pub centre: [f64; 3],
    /// Full edges of the box that holds it, mm.
    pub size: [f64; 3],
    /// Of a sphere, a cylinder or a hole, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diameter: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanTouch {
    /// Its number, unique in the plan.
    pub id: u64,
    /// Stage of the procedure, e.g. `head`.
    pub stage: String,
    /// Which repeat of the same point, from 1.
    #[serde(default = "one")]
    pub repeat: u32,
    /// `table` or the letter of a rotary axis.
    pub carrier: String,
    /// The block's mounting, where it differs from the plan's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mounting: Option<String>,
    /// The block's name.
    pub block: String,
    /// The block's own face at all axes 0; on what is round the direction: azimuth and elevation, deg.
    pub face: String,
    /// Nominal contact in the carrier's frame, mm.
    pub point: [f64; 3],
    /// Outward unit normal in the carrier's frame.
    pub normal: [f64; 3],
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// Where the search begins.
    pub start: AxisMap,
    /// Where an errorless machine triggers.
    pub nominal: AxisMap,
    /// Where the search gives up.
    pub end: AxisMap,
    /// Predicted time since the program began, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Number of the index visit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visit: Option<u32>,
    /// Feed of the measuring touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed_mm_min: Option<f64>,
    /// Orientation of the spindle, right-handed about the tool frame's +z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spindle_deg: Option<f64>,
    /// Where it differs from the plan's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool_length_mm: Option<f64>,
    /// Where it differs from the plan's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ball_radius_mm: Option<f64>,
    /// The sense (+1, -1) in which a rotary axis came to the pose.
    #[serde(default, skip_serializing_if = "AxisMap::is_empty")]
    pub from: AxisMap,
    /// True on the first touch of each block: a wide, slow search.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub first: bool,
}

fn one() -> u32 {
    1
}

impl PlanTouch {
    /// Full axis positions at the nominal trigger.
    #[must_use]
    pub fn nominal_position(&self) -> Position {
        self.nominal.or(&self.pose).position()
    }

    /// Full axis positions at the beginning of the search.
    #[must_use]
    pub fn start_position(&self) -> Position {
        self.start.or(&self.pose).position()
    }

    /// Full axis positions at the end of the search.
    #[must_use]
    pub fn end_position(&self) -> Position {
        self.end.or(&self.pose).position()
    }
}

/// A touch that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Skipped {
    /// Stage of the procedure.
    pub stage: String,
    /// The block's name.
    pub block: String,
    /// The block's own face.
    pub face: String,
    /// Nominal contact in the carrier's frame, mm.
    pub point: [f64; 3],
    /// Rotary axes, deg.
    pub pose: AxisMap,
    /// Why.
    pub reason: String,
}

/// A plan's file: what it holds beside the plan.
#[derive(Deserialize)]
struct AsWritten {
    #[serde(default)]
    fields_sha256: Fields,
}

/// A plan's file, to be written.
#[derive(Serialize)]
struct ToWrite<'a> {
    #[serde(flatten)]
    plan: &'a Plan,
    fields_sha256: Fields,
}

/// A record of a plan's text.
fn from_text<T: DeserializeOwned>(source: &Source) -> Result<T> {
    Ok(serde_json::from_str(source.inner()).map_err(|e| {
        from_json(&e, source, "plan::not_json").help("a plan is written by `axiscal generate` (axiscal-plan/1)")
    })?)
}

/// The touches of a plan by their numbers.
#[derive(Debug, Clone)]
pub struct Numbered<'a> {
    touches: &'a [PlanTouch],
    /// Places of the touches by their numbers; empty where the touches count upwards.
    order: Vec<usize>,
}

impl<'a> Numbered<'a> {
    /// A touch by its number.
    #[must_use]
    pub fn touch(&self, id: u64) -> Option<&'a PlanTouch> {
        // numbers run from 1 in plans of our own: look there first
        let guess = usize::try_from(id).ok().and_then(|i| i.checked_sub(1)).and_then(|i| self.touches.get(i));
        if let Some(touch) = guess.filter(|t| t.id == id && self.order.is_empty()) {
            return Some(touch);
        }
        let place = if self.order.is_empty() {
            self.touches.binary_search_by_key(&id, |t| t.id).ok()?
        } else {
            self.order[self.order.binary_search_by_key(&id, |i| self.touches[*i].id).ok()?]
        };
        self.touches.get(place)
    }
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// When the text is not JSON of this form, holds what cannot be so on any machine, or was changed since it was written.
    pub fn parse(source: &Source) -> Result<(Self, Findings)> {
        let ((plan, written), mut findings) = Self::read(source)?;
        findings.0.extend(plan_digest::changed(&written, &plan_digest::field_digests(&plan), source));
        findings.finish(plan)
    }

    /// The same with the digests of the fields as they were written, which are not looked at: empty in plans of earlier versions.
    ///
    /// # Errors
    /// When the text is not JSON of this form, or holds what cannot be so on any machine.
    pub(crate) fn read(source: &Source) -> Result<((Self, Fields), Findings)> {
        let plan: Self = from_text(source)?;
        let AsWritten { fields_sha256 } = from_text(source)?;
        super::plan_check::by_itself(&plan).findings(&plan, source).finish((plan, fields_sha256))
    }

    /// The plan as JSON, the same bytes for the same plan; each touch in a line of its own, behind them the digests of the fields.
    #[must_use]
    pub fn to_json(&self) -> String {
        // a plan holds only strings and finite numbers: serialisation cannot fail
        const EMPTY: &str = "\"touches\": []";
        let plan = &Self { touches: Vec::new(), ..self.clone() };
        let frame = ToWrite { plan, fields_sha256: plan_digest::field_digests(self) };
        let mut text = serde_json::to_string_pretty(&frame).unwrap_or_default();
        text.push('\n');
        let lines: Vec<String> =
            self.touches.iter().map(|t| format!("\n    {}", serde_json::to_string(t).unwrap_or_default())).collect();
        if lines.is_empty() {
            return text;
        }
        // quotes inside of strings are escaped: this stands there once
        text.replacen(EMPTY, &format!("\"touches\": [{}\n  ]", lines.join(",")), 1)
    }

    #[must_use]
    pub fn block_of(&self, touch: &PlanTouch) -> Option<&PlanBlock> {
        self.blocks.iter().find(|b| {
            b.name == touch.block
                && b.carrier == touch.carrier
                && b.mounting.as_deref().unwrap_or(&self.mounting)
                    == touch.mounting.as_deref().unwrap_or(&self.mounting)
        })
    }

    /// The touches by their numbers, for who looks up many.
    #[must_use]
    pub fn numbered(&self) -> Numbered<'_> {
        let touches = &self.touches[..];
        let mut order = Vec::new();
        // plans of our own count upwards
        if !touches.is_sorted_by_key(|t| t.id) {
            order.extend(0..touches.len());
            order.sort_by_key(|i| touches[*i].id);
        }
        Numbered { touches, order }
    }

    /// A touch by its number; who looks up many calls [`Plan::numbered`].
    #[must_use]
    pub fn touch(&self, id: u64) -> Option<&PlanTouch> {
        // ids run from 1 in plans of our own: look there first
        let guess = usize::try_from(id).ok().and_then(|i| i.checked_sub(1)).and_then(|i| self.touches.get(i));
        guess.filter(|t| t.id == id).or_else(|| self.touches.iter().find(|t| t.id == id))
    }
}

#[cfg(test)]
mod tests {
    use crate::post::tests::{machine, plan};

    #[test]
    fn touches_are_found_by_their_numbers_in_whatever_order_they_stand() {
        let whole = plan(&machine("swivel-head"), "head", "x+");
        for ids in [[1, 2, 3], [5, 7, 11], [2, 1, 3], [30, 20, 10]] {
            let mut plan = whole.clone();
            plan.touches.iter_mut().zip(ids).for_each(|(t, id)| t.id = id);
            let numbered = plan.numbered();
            for id in 0..40 {
                assert_eq!(numbered.touch(id).map(|t| t.id), ids.contains(&id).then_some(id), "{ids:?}");
                assert_eq!(numbered.touch(id), plan.touch(id));
            }
            assert!(numbered.touch(u64::MAX).is_none());
        }
    }
}
