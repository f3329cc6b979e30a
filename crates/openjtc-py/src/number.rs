//! Range checks of numbers from Python. If a number is out of range, the error contains the value and the limit. A number is never
//! changed silently.

use std::ops::RangeInclusive;
use std::time::Duration;

use host_kit::Facts;

use crate::error::Failure;

/// Returns the number if it is in this range; otherwise returns an error. The error contains `what` and `unit` as the name and the
/// unit of the number.
pub(crate) fn within(value: f64, range: RangeInclusive<f64>, what: &str, unit: &str) -> Result<f64, Failure> {
    if range.contains(&value) {
        return Ok(value);
    }
    let (low, high) = range.into_inner();
    let limit = if value < low { low } else { high };
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let failure = Failure::usage(format!(
        "{what}: {value}{unit} is out of range ({low} to {high}{unit}); nothing was sent"
    ));
    Err(failure.with(Facts::beyond(value, limit)))
}

/// Converts a number to a duration of up to `most` seconds.
pub(crate) fn seconds(value: f64, most: f64, what: &str) -> Result<Duration, Failure> {
    within(value, 0.0..=most, what, "s").map(Duration::from_secs_f64)
}

/// Converts seconds to a timeout. A negative number gives a timeout of zero. If the number is too large for the clock, the timeout has
/// no limit.
pub(crate) fn timeout(value: f64, what: &str) -> Result<Duration, Failure> {
    if value.is_nan() {
        return seconds(value, f64::INFINITY, what);
    }
    Ok(Duration::try_from_secs_f64(value.max(0.0)).unwrap_or(Duration::MAX))
}
