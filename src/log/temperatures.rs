//! Which temperatures a log can have: those of a workshop, in °C. Other numbers are in another unit.

use super::finding_places::Places;
use super::touch::RawTouch;
use crate::diag::Finding;
use std::ops::RangeInclusive;

/// A temperature outside cannot be used, °C.
pub(super) const USABLE_DEG_C: RangeInclusive<f64> = -50.0..=100.0;

/// A temperature outside is used with a warning, °C.
const USUAL_DEG_C: RangeInclusive<f64> = 0.0..=50.0;

/// What a field of temperatures is expected to hold.
pub(super) const EXPECTED: &str = "a temperature_degC from -50 to 100 °C (is the value in °F or K?)";

/// The warning of a file with temperatures that no usual workshop has.
pub(super) fn unusual(touches: &[RawTouch], places: &Places<'_>) -> Option<Finding> {
    let reading = |t: &RawTouch| Some((t.temperature_deg_c.filter(|d| !USUAL_DEG_C.contains(d))?, t.line));
    let mut unusual = touches.iter().filter_map(reading);
    let (first_deg_c, line) = unusual.next()?;
    let count = 1 + unusual.count();
    let touches = if count == 1 { "touch" } else { "touches" };
    let message = format!(
        "temperature_degC is outside 0 to 50 °C at {count} {touches}: {first_deg_c} °C is the first, in line {line}"
    );
    let finding = Finding::warning("log::temperature", message)
        .help("temperature_degC is in degrees Celsius: are these values in °F or K?");
    Some(places.at_line(finding, line))
}
