//! Axis compensation tables of the control: what it adds to the command of an axis, by coordinate and sense.

use crate::axes::AxisName;

/// The table of one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub axis: AxisName,
    /// Machine coordinate of R's origin, mm or deg.
    pub origin: f64,
    /// Machine coordinate, added when moving up, added when moving down; ascending, mm or deg.
    pub rows: Vec<[f64; 3]>,
}

impl Table {
    /// What is added at a coordinate relative to R's origin: straight between the rows, the last value outside.
    pub fn added(&self, q: f64, up: bool) -> f64 {
        let column = if up { 1 } else { 2 };
        let at = q + self.origin;
        let above = self.rows.partition_point(|row| row[0] <= at);
        match (above.checked_sub(1).and_then(|i| self.rows.get(i)), self.rows.get(above)) {
            (Some(low), Some(high)) => low[column] + (high[column] - low[column]) * (at - low[0]) / (high[0] - low[0]),
            (Some(end), None) | (None, Some(end)) => end[column],
            (None, None) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_joined_by_straight_lines() {
        let rows = vec![[-10.0, 0.1, 0.2], [0.0, 0.3, 0.4], [10.0, 0.5, 0.2]];
        let table = Table { axis: AxisName::X, origin: 5.0, rows };
        for (q, up, added) in
            [(-20.0, true, 0.1), (-5.0, true, 0.3), (0.0, true, 0.4), (0.0, false, 0.3), (9.0, false, 0.2)]
        {
            assert!((table.added(q, up) - added).abs() < 1e-15, "{q}");
        }
    }
}
