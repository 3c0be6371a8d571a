//! Values whose present value in the control is not known: no file holds them, a sheet says by how much each one changes.
//!
//! A control adds nothing up: what is loaded takes the place of what it held. A pivot vector of 152.318 mm that is to become
//! 152.331 mm must not become the 0.013 mm that the machine's description and the measurement know of.

use super::backup::Old;
use super::fill::{Filled, decimals};
use super::{digits, grids};
use crate::post::tables::{FileForm, Tables};
use crate::tables::compensation::{Grid, Tables as Record};
use crate::tables::correction::rounded;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the sheet.
pub const SHEET: &str = "axiscal_changes.txt";

/// By how much a value changes.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Change {
    /// The control's names of the value, one in each of its tables.
    pub names: Vec<String>,
    pub says: String,
    /// What is added to the present value, in the unit.
    pub change: f64,
    /// `mm`, `inch`, `deg`, or nothing for a direction.
    pub unit: &'static str,
    /// Digits behind the point.
    pub decimals: usize,
    /// The present value of a control that holds the machine's description.
    pub described: f64,
}

impl Change {
    /// The number with its sign.
    #[must_use]
    pub fn signed(&self) -> String {
        let text = digits(self.change, self.decimals, false);
        if text.starts_with('-') { text } else { format!("+{text}") }
    }
}

/// Which files are written, and what is given as changes in place of the others.
#[derive(Debug, Clone, Default)]
pub struct Division {
    /// Names of the files: every present value that they add to is known.
    pub files: BTreeSet<String>,
    /// Changes of vectors, directions and zero positions.
    pub values: Vec<Change>,
    /// Changes of points of position tables.
    pub points: Vec<Change>,
    /// Some file holds the vectors, directions and zero positions.
    pub values_known: bool,
    /// What the position tables held is known.
    pub grids_known: bool,
}

impl Division {
    /// Divides the tables of an export.
    pub(super) fn new(
        tables: &Tables,
        (first, others): (&Filled, &BTreeMap<&str, Filled>),
        list: &[Grid],
        active: Option<&Record>,
        old: &Old,
    ) -> Self {
        let grids_known =
            tables.grid.as_ref().is_none_or(|form| list.iter().all(|g| grids::known(form, g, active, old)));
        let filled = |form: &FileForm| form.spelling.as_deref().and_then(|s| others.get(s)).unwrap_or(first);
        let is_written =
            |form: &&FileForm| if form.grids { grids_known && !list.is_empty() } else { filled(form).known() };
        let values_known = tables.file.iter().filter(|f| !f.grids).any(|f| is_written(&f));
        let not_zero = |c: &Change| c.signed().chars().any(|c| ('1'..='9').contains(&c));
        let of_value = |v: &super::fill::Value| Change {
            names: v.names.values().cloned().collect::<BTreeSet<_>>().into_iter().collect(),
            says: v.says.clone(),
            change: v.change(),
            unit: v.unit,
            decimals: v.decimals,
            described: v.old,
        };
        let values = first.values.iter().map(of_value).filter(|c| not_zero(c) && !values_known).collect();
        let points = list.iter().filter(|_| !grids_known).flat_map(|g| of_grid(tables, g, active)).filter(not_zero);
        Self {
            files: tables.file.iter().filter(is_written).map(|f| f.name.clone()).collect(),
            values,
            points: points.collect(),
            values_known,
            grids_known,
        }
    }

    /// Is every present value known?
    #[must_use]
    pub fn complete(&self) -> bool {
        self.values_known && self.grids_known
    }

    pub fn changes(&self) -> impl Iterator<Item = &Change> {
        self.values.iter().chain(&self.points)
    }

    /// By the control's name, as the record has them.
    pub(super) fn by_name(&self) -> BTreeMap<String, f64> {
        self.changes().flat_map(|c| c.names.iter().map(|n| (n.clone(), c.change))).collect()
    }
}

fn of_grid(tables: &Tables, grid: &Grid, active: Option<&Record>) -> Vec<Change> {
    let step = *if grid.output.is_rotary() { tables.step_deg.get_ref() } else { tables.step_mm.get_ref() };
    let before = grids::before(active, grid);
    let point = |(i, new): (usize, &f64)| {
        let at = grid.min + grid.step * i as f64;
        let was = before.at(at);
        Change {
            names: tables.grid.iter().filter_map(|form| form.point_name(grid.number, i)).collect(),
            says: format!("{} at {} {}", grid.output, grid.input, rounded(at)),
            change: rounded(new - was),
            unit: if grid.output.is_rotary() { "deg" } else { "mm" },
            decimals: decimals(step),
            described: was,
        }
    };
    grid.values.iter().enumerate().map(point).collect()
}
