//! What residuals are drawn against.

use super::Point;
use crate::machine::Machine;

/// A variable that may stand on the horizontal axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlotVariable {
    /// An axis letter, `time`, `order`, `approach`, `stylus`.
    pub id: String,
    /// Title of the axis of the plot, with its unit.
    pub title: String,
    pub kind: VariableKind,
}

/// What a variable is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VariableKind {
    /// The angle of a rotary axis.
    Angle,
    /// The position of a linear axis.
    Position,
    /// Time, order, approach, stylus.
    Other,
}

/// Id and title of what is no axis.
const OTHERS: [(&str, &str); 4] = [
    ("time", "time since the first touch, h"),
    ("order", "order of the touches, number"),
    ("approach", "direction of approach about the probe's axis, °"),
    ("stylus", "pivot to ball, mm"),
];

/// The rotary axes, the linear ones, then time, order and approach; only what varies.
#[must_use]
pub fn plot_variables(machine: &Machine, points: &[Point]) -> Vec<PlotVariable> {
    let (rotary, linear): (Vec<_>, Vec<_>) = machine.axes.iter().map(|a| a.name).partition(|a| a.is_rotary());
    let angle = |a: &crate::axes::AxisName| (a.to_string(), format!("angle of axis {a}, °"), VariableKind::Angle);
    let position =
        |a: &crate::axes::AxisName| (a.to_string(), format!("position of axis {a}, mm"), VariableKind::Position);
    let axes = rotary.iter().map(angle).chain(linear.iter().map(position));
    let all = axes.chain(OTHERS.iter().map(|(id, title)| ((*id).to_owned(), (*title).to_owned(), VariableKind::Other)));
    let varies = |id: &str| {
        let mut values = points.iter().filter_map(|p| p.value(id));
        let first = values.next();
        values.any(|x| first.is_some_and(|f| (x - f).abs() > 1e-6))
    };
    all.filter(|(id, ..)| varies(id)).map(|(id, title, kind)| PlotVariable { id, title, kind }).collect()
}
