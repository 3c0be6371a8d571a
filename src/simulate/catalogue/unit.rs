//! Units of planted values: what may be written, and what it is inside (mm, rad, hours, °C).

use crate::units::{hours_from_s, mm_from_um, rad_from_deg, rad_from_mrad, ratio_from_ppm, s_from_ms};

/// A unit in which a value may be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Unit {
    Um,
    Mm,
    Urad,
    Mrad,
    Deg,
    UmPerM,
    UmPerH,
    UmPerK,
    PpmPerK,
    Ms,
    S,
    H,
    One,
}

/// What a unit measures: only units of the same kind can stand for each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Kind {
    Length,
    Angle,
    Ratio,
    Speed,
    LengthPerKelvin,
    PerKelvin,
    Time,
}

impl Unit {
    pub const ALL: [Self; 13] = [
        Self::Um,
        Self::Mm,
        Self::Urad,
        Self::Mrad,
        Self::Deg,
        Self::UmPerM,
        Self::UmPerH,
        Self::UmPerK,
        Self::PpmPerK,
        Self::Ms,
        Self::S,
        Self::H,
        Self::One,
    ];

    /// As it is written.
    pub fn word(self) -> &'static str {
        match self {
            Self::Um => "um",
            Self::Mm => "mm",
            Self::Urad => "urad",
            Self::Mrad => "mrad",
            Self::Deg => "deg",
            Self::UmPerM => "um/m",
            Self::UmPerH => "um/h",
            Self::UmPerK => "um/K",
            Self::PpmPerK => "ppm/K",
            Self::Ms => "ms",
            Self::S => "s",
            Self::H => "h",
            Self::One => "1",
        }
    }

    pub fn parse(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|u| u.word() == word)
    }

    /// What it measures.
    pub fn kind(self) -> Kind {
        match self {
            Self::Um | Self::Mm => Kind::Length,
            Self::Urad | Self::Mrad | Self::Deg => Kind::Angle,
            Self::UmPerM | Self::One => Kind::Ratio,
            Self::UmPerH => Kind::Speed,
            Self::UmPerK => Kind::LengthPerKelvin,
            Self::PpmPerK => Kind::PerKelvin,
            Self::Ms | Self::S | Self::H => Kind::Time,
        }
    }

    /// A value in mm, rad, hours, and what is made of them.
    pub fn base(self, value: f64) -> f64 {
        match self {
            Self::Mm | Self::H | Self::One => value,
            Self::Um | Self::UmPerH | Self::UmPerK => mm_from_um(value),
            Self::Urad | Self::UmPerM | Self::PpmPerK => ratio_from_ppm(value),
            Self::Mrad => rad_from_mrad(value),
            Self::Deg => rad_from_deg(value),
            Self::Ms => hours_from_s(s_from_ms(value)),
            Self::S => hours_from_s(value),
        }
    }
}
