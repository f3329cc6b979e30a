//! Whether an arm stands after a Stop.

use std::time::Duration;

use jtc_wire::{ControllerState, Status};

use crate::words;

/// An arm that did not move for this time stands.
const STILL: Duration = Duration::from_millis(200);

/// The arm follows a path, or a joint moves under torque.
pub fn is_moving(status: &Status) -> bool {
    status.is_executing() || (has_torque(status) && words::moving_joint(status).is_some())
}

/// The controller holds or moves the joints.
fn has_torque(status: &Status) -> bool {
    use ControllerState::{HoldPos, Operate, Teaching};
    status.state.is_in(&[HoldPos, Operate, Teaching])
}

/// Watches statuses until the arm stands. Without torque there is nothing to wait for: no Stop holds such an arm.
#[derive(Clone, Copy, Debug, Default)]
pub struct Standstill {
    since: Option<Duration>,
    reached: bool,
    moved: bool,
}

impl Standstill {
    /// Takes a status that arrived at this time.
    pub fn see(&mut self, now: Duration, status: &Status) {
        if is_moving(status) {
            (self.since, self.moved) = (None, true);
        } else {
            let since = *self.since.get_or_insert(now);
            self.reached |= !has_torque(status) || now.saturating_sub(since) >= STILL;
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
}
