//! Whether an arm stands after a Stop.

use std::time::Duration;

use jtc_wire::{Joint, Status};

use crate::words;

/// An arm that did not move for this time stands.
const STILL: Duration = Duration::from_millis(200);

/// The arm follows a path, or a joint moves.
pub fn is_moving(status: &Status) -> bool {
    status.is_executing() || words::moving_joint(status).is_some()
}

/// Watches statuses until the arm stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standstill {
    since: Option<Duration>,
    reached: bool,
    moved: bool,
    fastest: Option<(Joint, f64)>,
}

impl Standstill {
    /// Takes a status that arrived at this time.
    pub fn see(&mut self, now: Duration, status: &Status) {
        if is_moving(status) {
            (self.since, self.moved) = (None, true);
            self.fastest = words::moving_joint(status);
        } else {
            let since = *self.since.get_or_insert(now);
            self.reached |= now.saturating_sub(since) >= STILL;
        }
    }

    /// The arm stands.
    pub fn is_reached(&self) -> bool {
        self.reached
    }

    /// The arm moved at first.
    pub fn moved(&self) -> bool {
        self.moved
    }

    /// The joint that moved fastest when the arm moved last, with its velocity, rad/s.
    pub fn fastest(&self) -> Option<(Joint, f64)> {
        self.fastest
    }
}
