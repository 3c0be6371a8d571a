//! Did the probe trigger at a planned touch, and near its place? Outliers are decided in `fit/outlier_loop.rs`.

/// Did the probe trigger?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// It did: the position is that of the trigger.
    Hit,
    /// It did not: the position is where the search ended.
    Miss,
    /// The position is far from where this touch can be: it is kept as the log has it, and not used.
    Elsewhere,
}
