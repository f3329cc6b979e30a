//! Whether an arm stands after a Stop.

use std::time::Duration;

use jtc_wire::{ControllerState, Status, TrajectoryState};

use super::halt::Halt;
use crate::words;

/// An arm that did not move for this time stands.
const STILL: Duration = Duration::from_millis(200);

/// The arm follows a path, or a joint moves under torque.
pub fn is_moving(status: &Status) -> bool {
    status.is_executing() || (has_torque(status) && words::moving_joint(status).is_some())
}

/// A trajectory is paused, and can be resumed.
pub fn is_paused(status: &Status) -> bool {
    status.trajectory == TrajectoryState::Pause && has_torque(status)
}

/// The controller holds or moves the joints.
fn has_torque(status: &Status) -> bool {
    use ControllerState::{HoldPos, Operate, Teaching};
    status.state.is_in(&[HoldPos, Operate, Teaching])
}

/// Watches statuses until the arm stands. Without torque there is nothing to wait for: no Stop holds such an arm.
#[derive(Clone, Copy, Debug)]
pub struct Standstill {
    halt: Halt,
    since: Option<Duration>,
    reached: bool,
    moved: bool,
}

impl Standstill {
    /// Watches what a Stop or Pause brings about.
    pub fn after(halt: Halt) -> Self {
        Self { halt, since: None, reached: false, moved: false }
    }

    /// Takes a status that arrived at this time.
    pub fn see(&mut self, now: Duration, status: &Status) {
        self.moved |= is_moving(status);
        if is_moving(status) || self.is_incomplete(status) {
            return self.begin_again();
        }
        let since = *self.since.get_or_insert(now);
        self.reached = !has_torque(status) || now.saturating_sub(since) >= STILL;
    }

    /// The arm was still, but a Stop holds it and leaves nothing that can be resumed.
    fn is_incomplete(&self, status: &Status) -> bool {
        self.halt == Halt::Stop && (status.state == ControllerState::Teaching || is_paused(status))
    }

    /// The arm must be still for the whole time again.
    pub(super) fn begin_again(&mut self) {
        (self.since, self.reached) = (None, false);
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
