//! The verdict of a diagnosis with what refines it. `words::diagnose` makes sentences of it.

use super::next_step::MachineCheck;
use serde::ser::{Serialize, SerializeMap, Serializer};

/// Is something missing?
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Verdict {
    /// Nothing is missing that these touches can show.
    #[default]
    Adequate,
    /// An effect or a set-up mistake explains the residuals, and unused measurements confirm it.
    MissingEffect(Missing),
    /// The model fails, and nothing is named.
    Unexplained(Unexplained),
    /// The touches cannot decide it.
    TooLittleData(TooLittle),
}

#[derive(Debug, Clone, PartialEq)]
pub enum Missing {
    /// The first candidate. Its name may be wrong.
    Effect(Option<NameDoubt>),
    /// Most touches are far from their planned positions, and a set-up mistake explains it.
    TouchesFarOff {
        /// So many touches are far off …
        far: usize,
        /// … of so many.
        of: usize,
        /// So many would be where the plan has them without the mistake.
        right: usize,
        mistake: String,
    },
    /// Most touches found nothing, and one of these set-up mistakes explains it.
    TouchesMissed {
        /// So many touches cannot be used …
        unusable: usize,
        /// … of so many.
        of: usize,
        mistakes: Vec<String>,
        /// Share of the touches that would hit or miss as they did.
        agrees: f64,
    },
}

/// Why the name of the first candidate may be wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum NameDoubt {
    /// Another form of the same dependence explains so much more.
    OtherForm {
        /// What it depends on, as in `where`.
        by: String,
        /// The share that it explains beyond the candidate.
        more: f64,
    },
    /// A pattern that is no effect explains more: what it depends on, in a sentence.
    Pattern(String),
}

/// What is known of residuals that nothing explains.
#[derive(Debug, Clone, PartialEq)]
pub struct Unexplained {
    /// Why nothing is named.
    pub why: NotNamed,
    pub check: MachineCheck,
    /// Can `sketch-effect` write what is seen as a formula?
    pub sketchable: bool,
}

/// Why no effect is named.
#[derive(Debug, Clone, PartialEq)]
pub enum NotNamed {
    /// The noise explains the size of the residuals, but not a weak pattern in them.
    WeakPattern,
    /// Index positions scatter, and no effect explains it.
    Scatter,
    /// An effect passes its test, and patterns that are no effect explain clearly more.
    PatternExplainsMore {
        /// The first pattern alone does.
        alone: bool,
    },
    /// An effect passes its test and is not confirmed on unused measurements.
    NotConfirmed,
    /// These effects pass their test, and there are too few poses to confirm them on unused measurements.
    CannotBeConfirmed(Vec<String>),
    /// No effect passes its test.
    NoEffectPasses,
}

/// Why the touches cannot decide it.
#[derive(Debug, Clone, PartialEq)]
pub enum TooLittle {
    /// Too few touches.
    FewTouches {
        /// Touches used.
        used: usize,
        /// Unknowns of the model.
        unknowns: usize,
    },
    /// No touch is used; so many are excluded.
    NoneUsed {
        /// Excluded touches.
        excluded: usize,
    },
    /// None of the errors that the model is there for can be determined.
    NothingDetermined(Vec<String>),
    /// Most touches cannot be used, and no set-up mistake explains it.
    MostUnusable {
        /// So many touches cannot be used …
        unusable: usize,
        /// … of so many.
        of: usize,
        /// Most of them are far from their planned positions; else the probe did not trigger.
        far: bool,
    },
}

impl Verdict {
    /// As the JSON has it.
    #[must_use]
    pub fn as_str(&self) -> &'static str {
        match self {
            Self::Adequate => "adequate",
            Self::MissingEffect(_) => "missing-effect",
            Self::Unexplained(_) => "unexplained",
            Self::TooLittleData(_) => "too-little-data",
        }
    }

    /// Is an effect or a set-up mistake named?
    #[must_use]
    pub fn is_missing_effect(&self) -> bool {
        matches!(self, Self::MissingEffect(_))
    }

    /// What is known of residuals that nothing explains.
    #[must_use]
    pub fn unexplained(&self) -> Option<&Unexplained> {
        match self {
            Self::Unexplained(found) => Some(found),
            _ => None,
        }
    }

    /// Does the noise explain all but a weak pattern?
    #[must_use]
    pub fn is_weak_pattern(&self) -> bool {
        self.unexplained().is_some_and(|u| u.why == NotNamed::WeakPattern)
    }

    /// Can most touches not be used? The others are then no sample of the machine.
    #[must_use]
    pub fn most_touches_unusable(&self) -> bool {
        matches!(
            self,
            Self::MissingEffect(Missing::TouchesFarOff { .. } | Missing::TouchesMissed { .. })
                | Self::TooLittleData(TooLittle::MostUnusable { .. })
        )
    }

    /// Does the model fail on these touches, or do most touches?
    #[must_use]
    pub fn is_no(&self) -> bool {
        matches!(self, Self::MissingEffect(_) | Self::Unexplained(_)) || self.most_touches_unusable()
    }

    /// How bad it is: something that no effect explains is worse than an effect that is missing and has a name, and a model with
    /// too many unknowns to judge is worst.
    #[must_use]
    pub fn badness(&self) -> u8 {
        match self {
            Self::Adequate => 0,
            Self::Unexplained(_) if self.is_weak_pattern() => 1,
            Self::MissingEffect(_) => 2,
            Self::Unexplained(_) => 3,
            Self::TooLittleData(_) => 4,
        }
    }

    /// May the name of the first candidate be wrong?
    #[must_use]
    pub fn name_in_doubt(&self) -> bool {
        matches!(self, Self::MissingEffect(Missing::Effect(Some(_))))
    }

    /// The block that moved during the measurement.
    #[must_use]
    pub fn moved_block(&self) -> Option<&str> {
        match self.unexplained().map(|u| &u.check) {
            Some(MachineCheck::MovedBlock(block)) => Some(block),
            _ => None,
        }
    }

    /// Faces that differ from the others: `full/a +X`.
    #[must_use]
    pub fn faces(&self) -> &[String] {
        match self.unexplained().map(|u| &u.check) {
            Some(MachineCheck::NamedFaces(faces)) => faces,
            _ => &[],
        }
    }

    /// Blocks that differ from the others, the worst first.
    #[must_use]
    pub fn blocks(&self) -> &[String] {
        match self.unexplained().map(|u| &u.check) {
            Some(MachineCheck::NamedBlocks(blocks)) => blocks,
            _ => &[],
        }
    }
}

/// The keys that stand beside `verdict` in the JSON.
impl Serialize for Verdict {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("verdict", self.as_str())?;
        if let Some(block) = self.moved_block() {
            map.serialize_entry("moved_block", block)?;
        }
        if !self.faces().is_empty() {
            map.serialize_entry("faces", self.faces())?;
        }
        if !self.blocks().is_empty() {
            map.serialize_entry("blocks", self.blocks())?;
        }
        map.serialize_entry("faint", &self.is_weak_pattern())?;
        map.serialize_entry("name_in_doubt", &self.name_in_doubt())?;
        map.end()
    }
}
