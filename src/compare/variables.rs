//! What residuals are drawn against.

use super::Point;
use crate::axes::AxisName;
use crate::machine::Machine;

/// A variable that may stand on the horizontal axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlotVariable {
    /// An axis letter, `time`, `order`, `approach`, `stylus`.
    pub id: String,
    /// What it is, without its unit.
    pub name: String,
    /// `deg`, `mm`, `h`, `number`.
    pub unit: &'static str,
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

/// Id, name and unit of what is no axis.
const OTHERS: [(&str, &str, &str); 4] = [
    ("time", "time since the first touch", "h"),
    ("order", "order of the touches", "number"),
    ("approach", "direction of approach about the probe's axis", "deg"),
    ("stylus", "pivot to ball", "mm"),
];

impl PlotVariable {
    fn axis(name: AxisName) -> Self {
        let (kind, what, unit) = match name.is_rotary() {
            true => (VariableKind::Angle, "angle", "deg"),
            false => (VariableKind::Position, "position", "mm"),
        };
        Self { id: name.to_string(), name: format!("{what} of axis {name}"), unit, kind }
    }

    /// Title of the axis of a plot, in ASCII for files.
    #[must_use]
    pub fn title(&self) -> String {
        format!("{}, {}", self.name, self.unit)
    }

    /// Title of the axis of a plot on a page.
    #[must_use]
    pub fn title_on_page(&self) -> String {
        format!("{}, {}", self.name, if self.unit == "deg" { "\u{b0}" } else { self.unit })
    }
}

/// The rotary axes, the linear ones, then time, order and approach; only what varies.
#[must_use]
pub fn plot_variables(machine: &Machine, points: &[Point]) -> Vec<PlotVariable> {
    let (rotary, linear): (Vec<_>, Vec<_>) = machine.axes.iter().map(|a| a.name).partition(|a| a.is_rotary());
    let axes = rotary.into_iter().chain(linear).map(PlotVariable::axis);
    let others = OTHERS.iter().map(|&(id, name, unit)| PlotVariable {
        id: id.to_owned(),
        name: name.to_owned(),
        unit,
        kind: VariableKind::Other,
    });
    let varies = |v: &PlotVariable| {
        let mut values = points.iter().filter_map(|p| p.value(&v.id));
        let first = values.next();
        values.any(|x| first.is_some_and(|f| (x - f).abs() > 1e-6))
    };
    axes.chain(others).filter(varies).collect()
}
