//! The time of day, for stamps.
use std::time::{Duration, SystemTime};

/// Returns the time since 1970 by this computer's clock, for timestamps in logs, events, recordings and file names.
/// Users and time servers may set this clock forwards or backwards, so durations, expiry and order use
/// [`std::time::Instant`] and numbers instead.
#[expect(clippy::disallowed_methods, reason = "the one place of the time of day")]
pub fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}
