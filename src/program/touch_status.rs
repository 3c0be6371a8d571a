//! What became of a planned touch.

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
