//! Units: the only place with π/180, 1000 and 3600.
//!
//! Files carry millimetres, degrees and micrometres where a name ends in `_um`; inside, everything is millimetres and
//! radians. A conversion is written with one of these functions, so that a reader can search for each of them.

/// Degrees to radians.
#[must_use]
pub fn rad_from_deg(deg: f64) -> f64 {
    deg.to_radians()
}

/// Radians to degrees.
#[must_use]
pub fn deg_from_rad(rad: f64) -> f64 {
    rad.to_degrees()
}

/// Micrometres to millimetres.
#[must_use]
pub fn mm_from_um(um: f64) -> f64 {
    um * 1e-3
}

/// Millimetres to micrometres.
#[must_use]
pub fn um_from_mm(mm: f64) -> f64 {
    mm * 1e3
}

/// Seconds to hours.
#[must_use]
pub fn hours_from_s(s: f64) -> f64 {
    s / 3600.0
}

/// Hours to seconds.
#[must_use]
pub fn s_from_h(h: f64) -> f64 {
    h * 3600.0
}

/// Milliseconds to seconds.
#[must_use]
pub fn s_from_ms(ms: f64) -> f64 {
    ms * 1e-3
}

/// A speed in mm/min to mm/s.
#[must_use]
pub fn mm_s_from_mm_min(mm_min: f64) -> f64 {
    mm_min / 60.0
}

/// Milliradians to radians.
#[must_use]
pub fn rad_from_mrad(mrad: f64) -> f64 {
    mrad * 1e-3
}

/// Micrometres per metre (or µrad) to a plain ratio (or rad).
#[must_use]
pub fn ratio_from_ppm(ppm: f64) -> f64 {
    ppm * 1e-6
}

/// Inches to millimetres.
#[must_use]
pub fn mm_from_inch(inch: f64) -> f64 {
    inch * 25.4
}

/// Millimetres to inches.
#[must_use]
pub fn inch_from_mm(mm: f64) -> f64 {
    mm / 25.4
}

/// A number with so many significant digits, and no more zeros than needed.
#[must_use]
pub fn significant(x: f64, digits: i32) -> String {
    let magnitude = if x == 0.0 || !x.is_finite() { 0 } else { x.abs().log10().floor() as i32 };
    let text = format!("{x:.*}", usize::try_from((digits - 1 - magnitude).clamp(0, 12)).unwrap_or(0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number as messages show it: with an exponent where its digits would fill the line, and without the last ones of a sum
/// (61.7, not 61.69999999999999).
#[derive(Debug, Clone, Copy)]
pub struct Plain(pub f64);

impl std::fmt::Display for Plain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let size = self.0.abs();
        if size.is_finite() && size != 0.0 && !(1e-9..=1e9).contains(&size) {
            write!(f, "{:e}", self.0)
        } else if (1e-3..1e9).contains(&size) {
            // what is larger has fewer digits behind the point
            let per = if size < 1e6 { 1e9 } else { 1e6 };
            write!(f, "{}", (self.0 * per).round() / per)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_are_their_own_inverses() {
        assert_eq!(um_from_mm(mm_from_um(1.5)), 1.5);
        assert!((deg_from_rad(rad_from_deg(33.0)) - 33.0).abs() < 1e-13);
        assert_eq!(hours_from_s(1800.0), 0.5);
    }

    #[test]
    fn significant_digits() {
        for (value, digits, shown) in [
            (10.0494, 4, "10.05"),
            (0.00041236, 3, "0.000412"),
            (-3.1, 3, "-3.1"),
            (1234.5, 3, "1234"),
            (0.0, 4, "0"),
            (f64::INFINITY, 3, "inf"),
        ] {
            assert_eq!(significant(value, digits), shown);
        }
    }

    #[test]
    fn numbers_are_shown_without_the_dirt_of_a_sum() {
        for (value, shown) in [
            (0.1 + 0.2, "0.3"),
            (61.69999999999999, "61.7"),
            (-500.0, "-500"),
            (1e-12, "1e-12"),
            (2e-5, "0.00002"),
            (0.0, "0"),
            (1e300, "1e300"),
            (11_300_002.799_999_999, "11300002.8"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(Plain(value).to_string(), shown);
        }
    }
}
