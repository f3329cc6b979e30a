//! Numbers of Python that have a range: one outside it is an error with the value and the limit, and none is changed in silence.

use std::ops::RangeInclusive;
use std::time::Duration;

use host_kit::Facts;

use crate::error::Failure;

/// The number, where it is in this range; `what` names it, `unit` follows it.
pub fn within(value: f64, range: RangeInclusive<f64>, what: &str, unit: &str) -> Result<f64, Failure> {
    if range.contains(&value) {
        return Ok(value);
    }
    let (low, high) = range.into_inner();
    let limit = if value < low { low } else { high };
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let failure =
        Failure::usage(format!("{what}: {value}{unit} is outside {low}..{high}{unit}; nothing was sent"));
    Err(failure.with(Facts::beyond(value, limit)))
}

/// s, up to this many.
pub fn seconds(value: f64, most: f64, what: &str) -> Result<Duration, Failure> {
    within(value, 0.0..=most, what, "s").map(Duration::from_secs_f64)
}

/// How long somebody waits, s: not at all where it is negative, and as long as it takes where no clock can count it.
pub fn timeout(value: f64, what: &str) -> Result<Duration, Failure> {
    if value.is_nan() {
        return seconds(value, f64::INFINITY, what);
    }
    Ok(Duration::try_from_secs_f64(value.max(0.0)).unwrap_or(Duration::MAX))
}
