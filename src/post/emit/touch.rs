//! A touch, in the words of its template.

use super::{Named, Writer, xyz};
use crate::axes::{AxisMap, AxisName};
use crate::diag::Result;
use crate::program::path::TouchStep;
use minijinja::{Value, context};

impl Writer<'_> {
    pub(super) fn touch(&mut self, touch: &TouchStep) -> Result<()> {
        let begins = touch.start.or(&touch.pose);
        let wrong = begins.iter().find(|(a, v)| self.at.get(*a).is_some_and(|stands| (stands - v).abs() > 1e-6));
        if let Some((axis, value)) = wrong.filter(|_| !self.loose) {
            let stands = self.at.get(axis).unwrap_or(value);
            return Err(
                self.broken(format!("touch {} begins at {axis} {value}, axis {axis} stands at {stands}", touch.id))
            );
        }
        self.last = Named { id: touch.id, says: touch.says.clone() };
        let stands = begins.or(&self.at);
        let place = |map: &AxisMap| self.controller(&map.or(&stands)).xyz_mm();
        let (start, nominal, end) = (place(&touch.start), place(&touch.nominal), place(&touch.end));
        let way = end - start;
        let length = way.norm();
        if !(length > 1e-3 && length.is_finite() && (nominal - start).norm().is_finite()) {
            return Err(self.broken(format!("the search of touch {} has the length {length} mm", touch.id)));
        }
        let direction = way / length;
        let target = self.post.number.moved(&xyz(&start), &xyz(&end));
        let approach: Vec<Value> = target
            .iter()
            .map(|(axis, _)| {
                let i = axis.index();
                context! {
                    axis => axis.to_string(),
                    name => self.post.number.name(axis),
                    direction => self.number(direction[i]),
                    vector => self.vector(&direction, axis),
                    start => self.length(self.shown(axis, start[i])),
                    nominal => self.length(self.shown(axis, nominal[i])),
                    end => self.length(self.shown(axis, end[i])),
                    back_off => self.length(direction[i] * touch.back_off_mm),
                }
            })
            .collect();
        let from = self.words(&xyz(&start))?;
        let all = self.fresh(&xyz(&end))?;
        let by = AxisName::ALL.into_iter().zip(way.iter()).map(|(axis, mm)| {
            let value = self.post.number.position(axis, *mm);
            let fresh = self.is_fresh(&format!("by {axis}"), &value);
            context! { axis => axis.to_string(), value, fresh }
        });
        let by = by.collect::<Vec<Value>>();
        let leaves = self.leaves(&start);
        let before = self.met_before(touch);
        let way = self.length((nominal - start).norm());
        let search_feed = self.feed(touch.search_feed)?;
        let fresh = context! {
            way => self.is_fresh("way", &way),
            search_feed => self.is_fresh("search_feed", &search_feed) || before.is_some(),
            measure_feed => self.is_fresh("measure_feed", &self.feed(touch.measure_feed)?),
        };
        if before.is_some() {
            self.said.remove("search_feed");
        }
        let context = context! {
            announces => self.announces(),
            fresh,
            from,
            id => touch.id,
            says => touch.says.clone(),
            face => self.face(&touch.says),
            first => touch.first,
            before,
            end => self.words(&target)?,
            pose => self.words(&touch.pose)?,
            all,
            by,
            leaves,
            length => self.length(length),
            approach => approach.clone(),
            way,
            tolerance => self.length(touch.tolerance_mm),
            search_feed,
            measure_feed => self.feed(touch.measure_feed)?,
            back_off => self.length(touch.back_off_mm),
            half_back_off => self.length(touch.back_off_mm / 2.0),
        };
        self.render(if self.post.touch_with_cycle { "cycle" } else { "touch" }, context)?;
        // the routine goes back to where it began
        self.fresh(&xyz(&start))?;
        self.approach = approach;
        let back = |axis: AxisName| {
            let vector = self.vector(&-direction, axis);
            let direction = self.number(-direction[axis.index()]);
            context! { axis => axis.to_string(), name => self.post.number.name(axis), direction, vector }
        };
        self.heading_back = target.iter().map(|(axis, _)| back(axis)).collect();
        self.way = self.length((nominal - start).norm());
        self.back_off = self.length(touch.back_off_mm);
        self.began = touch.start.or(&stands);
        self.at = touch.end.or(&stands);
        self.loose = true;
        Ok(())
    }
}
