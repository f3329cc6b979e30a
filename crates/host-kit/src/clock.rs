//! Time of day for timestamps.
use std::time::{Duration, SystemTime};

/// Returns the time since 1970 by this computer's clock, for timestamps in logs, events, recordings and file names.
/// Users and time servers may set this clock forwards or backwards. Therefore durations and expiry times use
/// [`std::time::Instant`], and the order of events uses sequence numbers.
#[expect(clippy::disallowed_methods, reason = "the one place of the time of day")]
pub fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}
