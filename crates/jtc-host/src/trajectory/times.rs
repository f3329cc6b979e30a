//! Times without a unit in their name.

use super::fit::FitError;
use crate::file::{FileError, short};

/// Smallest mean step that is probably not in s.
const STEP_S: f64 = 5.0;
/// Number of points from which a mean step of a second is probably not in s.
const MANY: usize = 50;

/// Longest duration of times since 1970, s.
const DAY_S: f64 = 86_400.0;
/// Smallest time that is never in s.
const NEVER_S: f64 = 1e11;

/// Converts times since 1970 in ms, µs or ns to s, and returns a note about this unit. Also returns a note if the times could be in ms.
pub(super) fn in_seconds(times: &mut [f64], column: &str, table: bool) -> Result<Vec<String>, FileError> {
    let column = short(column);
    let (Some(first), Some(last)) = (times.first().copied(), times.last().copied()) else {
        return Ok(Vec::new());
    };
    // Seconds since 1970 have ten digits. Times of a duration must not be read as times since 1970: these begin in 2001.
    let since_1970 = match first {
        1e18..1e19 => Some(("nanoseconds", 1e-9)),
        1e15..1e16 => Some(("microseconds", 1e-6)),
        1e12..1e13 => Some(("milliseconds", 1e-3)),
        _ => None,
    };
    if let Some((unit, factor)) = since_1970.filter(|(_, factor)| (last - first) * factor <= DAY_S) {
        times.iter_mut().for_each(|t| *t = (*t - first) * factor);
        return Ok(vec![format!("the times in {column} are read as {unit} since 1970")]);
    }
    if first.abs() >= NEVER_S || last.abs() >= NEVER_S {
        let advice = if table { "name the column t_ms, t_us or t_ns" } else { "write times in seconds" };
        return Err(FileError::form(format!("the times in {column} are not in seconds; {advice}")));
    }
    let step = (last - first) / (times.len().max(2) - 1) as f64;
    let doubtful = times.len() > 2 && step >= STEP_S || times.len() >= MANY && step >= 1.0;
    if !doubtful || !step.is_finite() {
        return Ok(Vec::new());
    }
    let advice = if table { "; for milliseconds, name the column t_ms" } else { "" };
    Ok(vec![format!(
        "the times in {column} are read as seconds: a mean step of {step:.3} s, {:.3} s in all{advice}",
        last - first
    )])
}

/// Returns the advice for times that are too long to be in s.
pub(super) fn hint(times: &[f64], error: &FitError, table: bool) -> &'static str {
    let FitError::Duration(duration) = error else { return "" };
    if !table {
        return "; the times of the points are read as seconds";
    }
    match duration / (times.len().max(2) - 1) as f64 {
        1e6.. => "; for times in nanoseconds, name the column t_ns, for microseconds t_us",
        1e3..1e6 => "; for times in microseconds, name the column t_us, for milliseconds t_ms",
        0.0..1e3 => "; for times in milliseconds, name the column t_ms",
        _ => "",
    }
}
