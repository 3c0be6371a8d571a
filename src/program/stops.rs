//! Where a program stops for other blocks or another stylus, how it is taken up again at a later set-up, and how it ends.

use super::parts::Part;
use super::path::{Step, Stop};
use super::rotary_turns::{Turn, turn_step};
use super::route::{Router, SAME};
use super::sweep::Manner;
use crate::axes::{AxisMap, Position};

impl Router<'_, '_> {
    /// Stops before a part: up to the top, all rotary axes to 0, where a person has room and a control's own
    /// transformation has nothing to turn.
    pub(super) fn change_part(&mut self, part: usize) -> Result<(), String> {
        let (Some(next), Some(scene)) = (self.layout.parts.get(part), self.scenes.get(part)) else { return Ok(()) };
        if part == self.part {
            return Ok(());
        }
        // the plan's head says with what the program begins
        let Some(mut at) = self.at else {
            return Err("nothing can be touched in the part with which the program begins".to_owned());
        };
        let before = at;
        at.set(self.lift.axis, self.lift.top);
        self.scene
            .clear_straight(&before, &at, Manner::Guarded)
            .map_err(|hit| format!("before the stop, on the way up {hit}"))?;
        let turns = self.turns_to_0(&mut at).map_err(|reason| format!("before the stop, {reason}"))?;
        scene.clear_straight(&at, &at, Manner::Rapid).map_err(|hit| format!("after the stop {hit}"))?;
        self.rise(self.lift.top_height());
        for turn in &turns {
            self.turn(turn);
        }
        let last = self.layout.parts.get(self.part);
        let blocks = last.is_none_or(|p| p.label != next.label);
        let stylus = last.is_none_or(|p| p.stylus != next.stylus);
        self.clock.stop(blocks, stylus);
        let stood = self.layout.parts.iter().take(part).any(|p| p.label == next.label);
        self.push(Step::Stop(stop(last, next, stood)));
        self.stopped = true;
        (self.part, self.scene) = (part, scene);
        self.met.clear();
        (self.heights.over_all, self.heights.over_blocks) = (self.lift.top_height(), self.lift.top_height());
        Ok(())
    }

    /// All rotary axes to 0, one after the other from where the machine stands, each turn proven clear.
    fn turns_to_0(&self, at: &mut Position) -> Result<Vec<Turn>, String> {
        let turns = self.turns(Some((*at, self.senses)), &AxisMap::default(), &AxisMap::default())?;
        for (axis, to, _) in &turns {
            self.scene.clear_turn(at, *axis, *to).map_err(|hit| format!("as {axis} turns to {to} {hit}"))?;
            at.set(*axis, *to);
        }
        Ok(turns)
    }

    /// Up and away at the end; under a control's own transformation (`tcp`) all rotary axes to 0 as well: only there is it known
    /// what happens as it is switched off, and only there does the next run begin.
    pub(super) fn leave(&mut self, tcp: bool) {
        if self.at.is_none() {
            return;
        }
        self.rise(self.heights.over_all);
        self.rapid(self.lift.axis, self.lift.top);
        let Some(at) = self.at.filter(|_| tcp) else { return };
        // where it stands, or else above the place at which it began
        let mut began = at;
        if let Some((opening, _)) = self.opening {
            self.across().for_each(|axis| began.set(axis, opening.get(axis)));
        }
        for place in [at, began] {
            let mut turned = place;
            let way = self.lateral(&at, &place).and_then(|order| Ok((order, self.turns_to_0(&mut turned)?)));
            match way {
                Ok((order, turns)) => {
                    order.into_iter().for_each(|axis| self.rapid(axis, place.get(axis)));
                    turns.iter().for_each(|turn| self.turn(turn));
                    self.out.stays_turned = None;
                    return;
                }
                Err(reason) => self.out.stays_turned = Some(reason),
            }
        }
    }

    /// The proven way from the end of the opening to here: turns at the top, across, down.
    pub(super) fn resume(&self) -> Option<Vec<Step>> {
        let ((mut at, senses), to) = (self.opening?, self.at?);
        let mut steps = Vec::new();
        for (axis, angle, sense) in self.turns(Some((at, senses)), &AxisMap::from(to), &self.senses).ok()? {
            self.scene.clear_turn(&at, axis, angle).ok()?;
            at.set(axis, angle);
            steps.push(turn_step(axis, angle, sense));
        }
        if self.shifted_at.is_some() {
            steps.extend(self.shift_steps(&at)?);
        }
        let mut rapids = self.lateral(&at, &to).ok()?;
        if (self.lift.height(&at) - self.lift.height(&to)).abs() > SAME {
            rapids.push(self.lift.axis);
        }
        for axis in rapids {
            let mut next = at;
            next.set(axis, to.get(axis));
            self.scene.clear_straight(&at, &next, Manner::Rapid).ok()?;
            steps.push(Step::Rapid { to: AxisMap::default().with(axis, to.get(axis)) });
            at = next;
        }
        Some(steps)
    }
}

/// What must be mounted in a part, one line each.
pub(super) fn mounted(part: &Part) -> Vec<String> {
    vec![format!("mounting {}: {}", part.mounting.name, part.mounting.says), part.stylus_says()]
}

/// What a person does between two parts. `stood`: the blocks have stood there before, and stand as they did then.
fn stop(last: Option<&Part>, next: &Part, stood: bool) -> Stop {
    let mut says = Vec::new();
    let mounting = next.mounting;
    if last.is_some_and(|p| p.label == next.label) {
        says.push("leave the blocks as they stand".to_owned());
    } else if stood {
        says.push(format!("put mounting {} back exactly where it stood", mounting.name));
    } else {
        says.push(format!("put up mounting {}: {}", mounting.name, mounting.says));
    }
    if last.is_none_or(|p| p.stylus != next.stylus) {
        says.push(format!("change to the {}", next.stylus_says()));
        says.extend(next.stylus.map(|s| s.says.clone()).filter(|s| !s.is_empty()));
    } else {
        says.push(format!("the stylus stays: {}", next.stylus_says()));
    }
    Stop {
        says,
        mounted: mounted(next),
        mounting: next.label.clone(),
        tool_length_mm: next.machine.tool.length_mm,
        ball_radius_mm: next.machine.probe.ball_radius,
    }
}
