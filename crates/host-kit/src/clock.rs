//! The time of day, for stamps.
use std::time::{Duration, SystemTime};

/// Time since 1970 by this computer's clock, for stamps in logs, events, recordings and names of files. People and time servers set that
/// clock forwards and backwards: what lasts, lapses or has an order goes by [`std::time::Instant`] and by numbers.
#[expect(clippy::disallowed_methods, reason = "the one place of the time of day")]
pub fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}
