//! The time of day, for stamps.
use std::time::{Duration, SystemTime};

/// Returns the time since 1970 by this computer's clock, for stamps in logs, events, recordings and names of files.
/// Users and time servers set that clock forwards and backwards: durations, expiry and order use [`std::time::Instant`]
/// and numbers instead.
#[expect(clippy::disallowed_methods, reason = "the one place of the time of day")]
pub fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}
