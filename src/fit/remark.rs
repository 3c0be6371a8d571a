//! What a fit remarks on: facts, of which `words::fit` makes sentences.

use super::candidates::NoValue;
use super::noise::Noise;
use crate::log::LogMistake;
use crate::model::temperatures::TemperatureGap;
use serde::{Deserialize, Serialize};

/// Where the standard deviation of a touch comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NoiseSource {
    /// From touches repeated at once.
    Repeats,
    /// As the study states it.
    Study,
    /// As the machine file declares it.
    #[default]
    Declared,
}

impl NoiseSource {
    /// As files and the JSON have it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Repeats => "repeats",
            Self::Study => "study",
            Self::Declared => "declared",
        }
    }
}

/// Where the scatter of index positions comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum VisitSource {
    /// From poses that were visited again.
    Revisits,
    /// As the study states it.
    Study,
    /// As the axes declare it.
    #[default]
    #[serde(alias = "")]
    Declared,
    /// There is one pose only: nothing scatters.
    #[serde(rename = "one pose")]
    OnePose,
}

impl VisitSource {
    /// As files and the JSON have it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Revisits => "revisits",
            Self::Study => "study",
            Self::Declared => "declared",
            Self::OnePose => "one pose",
        }
    }
}

/// Why a touch is not used.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// The user excluded it.
    Masked {
        /// What the user says of it.
        reason: String,
    },
    /// It does not agree with the others.
    Outlier {
        /// By how much it misses what the others predict, mm along the outward normal.
        off_mm: f64,
        /// The same in standard deviations.
        standardised: f64,
        /// Only a robust fit shows it: among the others it is within the limit.
        robust_only: bool,
    },
}

impl Reason {
    /// Did the fit exclude it, and not the user?
    #[must_use]
    pub fn is_outlier(&self) -> bool {
        matches!(self, Self::Outlier { .. })
    }

    /// In words.
    #[must_use]
    pub fn says(&self) -> String {
        crate::words::fit::reason(self)
    }
}

/// What the touches say of a parameter without what is stated of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Found {
    /// Standard uncertainty.
    Sigma(f64),
    /// 95 % interval.
    Interval([f64; 2]),
}

/// A value that the user states and that the touches contradict.
#[derive(Debug, Clone, PartialEq)]
pub struct Contradiction {
    /// Parameter and its unit.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The stated value.
    pub stated: f64,
    /// Standard deviation of the prior; none where the value is held.
    pub sigma: Option<f64>,
    /// The value without it …
    pub value: f64,
    /// … and its uncertainty.
    pub found: Found,
    /// Both are so many standard deviations apart.
    pub apart: f64,
    /// By how much χ² would fall without it.
    pub chi2: f64,
}

/// Something that a reader of a fit must know.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // the fields are what their names say, lengths in mm
pub enum Remark {
    /// An effect depends on the temperature, and no touch has one.
    NoTemperature { effect: String },
    /// Some touches have a temperature and others do not.
    TemperatureGap(TemperatureGap),
    /// A size is larger than any machine's.
    NotCredible { name: String, times: f64 },
    /// A value follows combinations that cannot be determined by more than its own uncertainty.
    FollowsUnseen { name: String, meaning: String },
    /// The search did not converge.
    NotConverged { stopped: String },
    /// As many unknowns as touches.
    NoRedundancy,
    /// Effects outside of the model are not counted with so many touches.
    UnmodelledNotCounted { most_touches: usize },
    /// Many touches are far from their nominal positions, and a sign, a unit or an axis explains it.
    SetUpMistake { far: usize, of: usize, right: usize, mistake: LogMistake },
    /// More outliers than are excluded.
    OutliersBeyond { found: usize, of: usize, excluded: usize },
    /// So many outliers that they are a finding by themselves.
    ManyOutliers { excluded: usize, of: usize },
    /// The repeats contradict the stated noise of a touch.
    NoiseContradicted { stated_mm: f64, found_mm: f64, dof: f64 },
    /// Revisited poses contradict the stated scatter of index positions.
    VisitsContradicted { stated_mm: f64, found_mm: f64, dof: f64 },
    /// Index positions scatter by far more than the axes declare.
    VisitsBeyond { tau_mm: f64, dof: f64, declared_mm: f64 },
    /// Repeats scatter by far more than the probe's file declares.
    RepeatsBeyond { sigma_mm: f64, dof: f64, declared_mm: f64 },
    /// The last digit of the log takes away more than the noise.
    CoarseLog { rounding_mm: f64 },
    /// The touches scatter by far less than a noise that no repeats confirm.
    NoiseTooLarge { times_better: f64, sigma_mm: f64, source: NoiseSource },
    /// The touches contradict what the user states of a parameter.
    Contradiction(Contradiction),
    /// The residuals are larger than noise: √(χ²/dof).
    Misfit { times: f64, with_type_b: bool, noise: Box<Noise> },
    /// A shape parameter left its range during the search and is held at the end that fits better.
    OutOfRange { name: String, prior: Option<(f64, f64)> },
    /// A shape parameter has several values that fit about as well.
    OtherValues { name: String, unit: String, value: f64, others: Vec<f64> },
    /// A shape is not determined, and the uncertainty of its sizes is that beside one value of it.
    SizesBesideOneValue { name: String, unit: String, value: f64, sizes: Vec<String>, quick: bool, most_touches: usize },
    /// Results that may be much else beside other values of shapes.
    LostBesideShapes { shapes: Vec<String>, results: Vec<String>, n_blocks: usize },
    /// Parameters that cannot be determined and that nothing else names.
    NotDetermined { names: Vec<String> },
    /// A type B row depends on the temperature, and no touch has one: counted at 1 K.
    TypeBPerKelvin { name: String },
    /// A type B row has no effect on these touches.
    TypeBWithoutEffect { name: String },
    /// An effect outside of the model could not be counted.
    NotCounted(NoValue),
    /// A mask of a touch that does not exist.
    UnknownMask { id: u64, run: usize },
}

impl Remark {
    /// Order in which a reader needs them, the most important first: what makes all values wrong, what makes some of them wrong,
    /// what makes their uncertainties wrong, what is only to be known.
    #[must_use]
    pub fn rank(&self) -> u8 {
        match self {
            Self::NotConverged { .. } | Self::SetUpMistake { .. } => 0,
            Self::OutliersBeyond { .. } | Self::NotCredible { .. } => 1,
            Self::Misfit { .. } | Self::ManyOutliers { .. } | Self::NoRedundancy => 2,
            Self::Contradiction(_) | Self::NoiseContradicted { .. } | Self::VisitsContradicted { .. } => 3,
            Self::OutOfRange { .. }
            | Self::OtherValues { .. }
            | Self::SizesBesideOneValue { .. }
            | Self::LostBesideShapes { .. }
            | Self::NotDetermined { .. }
            | Self::FollowsUnseen { .. }
            | Self::NoTemperature { .. } => 4,
            Self::RepeatsBeyond { .. }
            | Self::VisitsBeyond { .. }
            | Self::CoarseLog { .. }
            | Self::NoiseTooLarge { .. } => 5,
            Self::TemperatureGap(_)
            | Self::UnmodelledNotCounted { .. }
            | Self::TypeBPerKelvin { .. }
            | Self::TypeBWithoutEffect { .. }
            | Self::NotCounted(_)
            | Self::UnknownMask { .. } => 6,
        }
    }

    /// Parameters that it says not to be determined.
    pub fn names(&self) -> Vec<&str> {
        match self {
            Self::OutOfRange { name, .. }
            | Self::OtherValues { name, .. }
            | Self::SizesBesideOneValue { name, .. }
            | Self::FollowsUnseen { name, .. } => vec![name],
            Self::LostBesideShapes { shapes, results, .. } => {
                shapes.iter().chain(results).map(String::as_str).collect()
            }
            Self::NotDetermined { names } => names.iter().map(String::as_str).collect(),
            _ => Vec::new(),
        }
    }
}
