//! The axes as a chain: who bears whom, and do the linear ones span space.

use super::{Check, LARGEST_SQUARENESS_DEG, Loose};
use crate::axes::AxisName;
use crate::diag::Finding;
use crate::machine::{Axis, Side};
use std::ops::Range;

/// Cosine of 45 degrees: a linear axis that is further off the axis of its letter has another letter's direction.
const LEAST_ALONG_ITS_LETTER: f64 = std::f64::consts::FRAC_1_SQRT_2 - 1e-9;

impl Check<'_> {
    /// From an end (workpiece or tool) down to the base; the answer begins at the base.
    pub(super) fn chain(
        &mut self,
        machine: &str,
        loose: &[Loose],
        refused: &[String],
        end: &toml::Spanned<String>,
        side: Side,
    ) -> Vec<Axis> {
        let mut out: Vec<Axis> = Vec::new();
        let (mut word, mut span) = (end.get_ref().clone(), end.span());
        while word != "base" {
            if refused.contains(&word) {
                break;
            }
            let Some(found) = loose.iter().find(|l| l.axis.name.to_string() == word) else {
                self.error(
                    &span,
                    "machine::unknown_parent",
                    format!("parent {word:?} is no axis of {machine:?}"),
                    "a parent is \"base\" or the letter of an axis of this machine",
                );
                break;
            };
            if out.iter().any(|a| a.name == found.axis.name) {
                self.error(
                    &found.span,
                    "machine::cyclic",
                    format!("axis {word} of {machine:?} bears itself: the chain is cyclic"),
                    "follow the parents: one of them must be \"base\"",
                );
                break;
            }
            out.push(Axis { side, ..found.axis.clone() });
            (word, span) = (found.parent.clone(), found.span.clone());
        }
        out.reverse();
        out
    }

    pub(super) fn linear_axes_span_space(&mut self, here: &Range<usize>, machine: &str, axes: &[Axis]) {
        let linear: Vec<_> = axes.iter().filter(|a| !a.name.is_rotary()).map(|a| a.direction.into_inner()).collect();
        let spans = linear.len() == 3 && nalgebra::Matrix3::from_columns(&linear).determinant().abs() > 0.1;
        if !spans {
            let names: Vec<String> = axes.iter().filter(|a| !a.name.is_rotary()).map(|a| a.name.to_string()).collect();
            self.error(
                here,
                "machine::linear_axes",
                format!("the linear axes of {machine:?} in the chain ({}) do not span space", names.join(" ")),
                "X, Y and Z must be there, roughly square to each other",
            );
        }
    }

    /// Frame R is right-handed, and each linear axis moves the tool over the workpiece along the axis of its letter. The
    /// directions are those of this motion on both sides of the chain.
    pub(super) fn linear_axes_follow_r(&mut self, here: &Range<usize>, machine: &str, axes: &[Axis]) {
        let linear: Vec<&Axis> = axes.iter().filter(|a| !a.name.is_rotary()).collect();
        let along = |a: &Axis| a.direction[a.name.index()];
        let away: Vec<String> = linear
            .iter()
            .filter(|a| along(a) < LEAST_ALONG_ITS_LETTER)
            .map(|a| format!("{} is [{:.2}, {:.2}, {:.2}]", a.name, a.direction.x, a.direction.y, a.direction.z))
            .collect();
        let by_letter = [AxisName::X, AxisName::Y, AxisName::Z].map(|n| linear.iter().find(|a| a.name == n));
        let is_left_handed = match by_letter {
            [Some(x), Some(y), Some(z)] => x.direction.cross(&y.direction).dot(&z.direction) < 0.0,
            _ => false,
        };
        let mut wrong = Vec::new();
        if !away.is_empty() {
            wrong.push(format!("not along X, Y and Z of frame R ({})", away.join(", ")));
        }
        if is_left_handed {
            wrong.push("left-handed".to_owned());
        }
        if wrong.is_empty() {
            return;
        }
        let message = format!("the directions of the linear axes of {machine:?} are {}", wrong.join(", and "));
        let help = "correct the directions: each is the way of the tool over the workpiece for a positive move, and R is right-handed \
                    with X, Y and Z along them";
        self.findings.push(Finding::warning("machine::not_along_r", message).help(help).at(self.source, here.clone()));
    }

    /// Every pair of linear axes, in the order of their letters.
    pub(super) fn linear_axes_square(&mut self, machine: &str, loose: &[Loose]) {
        for (i, a) in loose.iter().enumerate().filter(|(_, a)| !a.axis.name.is_rotary()) {
            for b in loose[..i].iter().filter(|b| !b.axis.name.is_rotary() && b.axis.name != a.axis.name) {
                let off = crate::units::deg_from_rad(a.axis.direction.dot(&b.axis.direction).clamp(-1.0, 1.0).asin());
                if off.abs() > LARGEST_SQUARENESS_DEG {
                    self.findings.push(
                        Finding::warning(
                            "machine::not_square",
                            format!(
                                "axes {} and {} of {machine:?} are {:.3} degrees off square",
                                b.axis.name,
                                a.axis.name,
                                off.abs()
                            ),
                        )
                        .help(
                            "write the axes as they are meant to be, square to each other: that they are not quite is \
                             an error to be identified, not a part of the description",
                        )
                        .at(self.source, a.span.clone()),
                    );
                }
            }
        }
    }
}
