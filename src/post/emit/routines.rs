//! What a program of routines and calls is given: whole places as arguments, and what is the same in every touch.

use super::Writer;
use crate::axes::{AxisMap, AxisName};
use crate::diag::{Failure, Result};
use crate::program::path::{Path, Step};
use minijinja::{Value, context};

const LINEAR: [AxisName; 3] = [AxisName::X, AxisName::Y, AxisName::Z];

/// Numbers that are equal.
const SAME: f64 = 1e-6;

/// The blocks and faces that a path touches, in the order in which they come.
pub(super) fn faces(path: &Path) -> Vec<&str> {
    let mut faces: Vec<&str> = Vec::new();
    for step in &path.steps {
        if let Some(touch) = step.touch()
            && !faces.contains(&touch.says.as_str())
        {
            faces.push(&touch.says);
        }
    }
    faces
}

impl Writer<'_> {
    /// The number of a face, from 1; 0 where nothing is touched.
    pub(super) fn face(&self, says: &str) -> usize {
        self.faces.iter().position(|face| *face == says).map_or(0, |at| at + 1)
    }

    /// X, Y and Z of where a move ends, all three of them; nothing where one is not known yet.
    pub(super) fn place(&mut self, to: &AxisMap) -> Result<Value> {
        let target = to.or(&self.at);
        if LINEAR.iter().any(|axis| target.get(*axis).is_none()) {
            return Ok(Value::from(()));
        }
        let at = self.controller(&target);
        self.fresh(&AxisMap::xyz(at.0[0], at.0[1], at.0[2]))
    }

    /// Words of a place, each with whether it is another one than was given last: `fresh`.
    pub(super) fn fresh(&mut self, at: &AxisMap) -> Result<Value> {
        let words = self.words(at)?;
        let fresh: Vec<bool> = at
            .iter()
            .map(|(axis, value)| {
                let word = self.post.number.position(axis, self.shown(axis, value));
                self.is_fresh(&axis.to_string(), &word)
            })
            .collect();
        let with = |(word, fresh): (Value, bool)| context! { fresh, ..word };
        let words: Vec<Value> = words.try_iter().into_iter().flatten().zip(fresh).map(with).collect();
        Ok(Value::from(words))
    }

    /// Is this another value than was given last under this name? It is given by that.
    pub(super) fn is_fresh(&mut self, name: &str, value: &str) -> bool {
        self.said.insert(name.to_owned(), value.to_owned()).is_none_or(|before| before != value)
    }

    /// Is the touch that comes next another one than was announced last? Its face, too, where that is another one.
    pub(super) fn announces(&mut self) -> Value {
        let next = self.next_touch();
        let touch = self.is_fresh("touch", &next.id.to_string());
        let face = self.is_fresh("face", &next.says);
        if touch {
            context! { face }
        } else {
            Value::from(())
        }
    }

    /// The arguments of a turn: all rotary axes, behind X, Y and Z under a transformation; nothing where one is not known yet.
    pub(super) fn turned(&self, to: &AxisMap, sense: &AxisMap) -> Result<Value> {
        let target = to.or(&self.at);
        let rotary = self.axes.iter().copied().filter(|a| a.is_rotary());
        let linear = LINEAR.into_iter().filter(|_| self.frame.is_tcp());
        let mut place = AxisMap::default();
        for axis in linear.chain(rotary) {
            match target.get(axis) {
                Some(value) => place.set(axis, value),
                None => return Ok(Value::from(())),
            }
        }
        self.words_by(&place, sense)
    }

    /// Is this where the touch made last began?
    pub(super) fn is_start(&self, to: &AxisMap) -> bool {
        to.iter().all(|(axis, value)| self.began.get(axis).is_some_and(|began| (began - value).abs() < SAME))
    }

    /// Where the lift goes right after a touch, if that is a guarded move of the lift alone from where the touch began.
    fn lift_after(&self, touch: usize) -> Option<f64> {
        let (lift, _) = self.lift_top()?;
        let [Step::Touch(made), Step::Retract { to: back, .. }, Step::Protected { to, .. }] =
            self.path.steps.get(touch..touch + 3)?
        else {
            return None;
        };
        let is_start = back.iter().all(|(axis, value)| made.start.get(axis).is_none_or(|at| (at - value).abs() < SAME));
        to.get(lift).filter(|_| is_start && to.iter().count() == 1)
    }

    /// Is this guarded move a part of the touch before it?
    pub(super) fn is_made_by_touch(&self, step: usize) -> bool {
        self.post.touch_leaves() && step.checked_sub(2).is_some_and(|touch| self.lift_after(touch).is_some())
    }

    /// Where the lift stands when the routine of a touch is over, as the control takes it; nothing without a lift.
    pub(super) fn leaves(&mut self, start: &nalgebra::Vector3<f64>) -> Value {
        let Some((lift, _)) = self.lift_top() else { return Value::from(()) };
        let at = self.lift_after(self.index).unwrap_or(start[lift.index()]);
        let value = self.post.number.position(lift, self.shown(lift, at));
        let fresh = self.is_fresh("leaves", &value);
        context! { value, fresh }
    }

    /// What routines hold that is the same in every call.
    pub(super) fn of_routines(&self) -> Result<Value> {
        let probe = &self.machine.probe;
        let other = |what: &str| Err(self.broken(format!("not every {what} is that of the machine")));
        for step in &self.path.steps {
            match step {
                Step::Touch(t) | Step::Find(t) if (t.tolerance_mm - probe.placement_tolerance).abs() > SAME => {
                    return other("tolerance");
                }
                Step::Touch(t) | Step::Find(t) if (t.back_off_mm - probe.back_off).abs() > SAME => {
                    return other("back_off");
                }
                Step::Protected { feed, .. } | Step::Retract { feed, .. }
                    if (feed - probe.position_feed).abs() > SAME =>
                {
                    return other("feed of positioning");
                }
                _ => {}
            }
        }
        let lift = self.lift_top();
        let height = self.post.dry_run_mm;
        if height > 0.0 && lift.is_none() {
            return Err(Failure::new("post::dry_run", "this program has no dry run: its moves cannot be lifted")
                .help("generate it without --tcp, for a path that begins at the top of the lift"));
        }
        let dry_run = lift.map(|_| context! { height => self.length(height) });
        let lift = lift.map(|(axis, top)| {
            context! {
                axis => axis.to_string(),
                name => self.post.number.name(axis),
                number => axis.index() + 1,
                top => self.post.number.position(axis, self.shown(axis, top)),
            }
        });
        Ok(context! {
            faces => self.faces.iter().map(ToString::to_string).collect::<Vec<String>>(),
            tolerance => self.length(probe.placement_tolerance),
            back_off => self.length(probe.back_off),
            half_back_off => self.length(probe.back_off / 2.0),
            position_feed => self.feed(probe.position_feed)?,
            dry_run => dry_run.unwrap_or_else(|| Value::from(())),
            lift => lift.unwrap_or_else(|| Value::from(())),
        })
    }

    /// The linear axis that lifts the probe, and its top. Under a transformation no word of the program is that axis alone.
    fn lift_top(&self) -> Option<(AxisName, f64)> {
        let axis = self.opening.lift().filter(|_| !self.frame.is_tcp() && !self.post.without_dry_run)?;
        let top = self.opening.steps.iter().find_map(|at| match self.path.steps.get(*at) {
            Some(Step::Rapid { to }) => to.get(axis),
            _ => None,
        })?;
        Some((axis, top))
    }
}
