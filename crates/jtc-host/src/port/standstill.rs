//! Whether an arm stands after a Stop.

use std::time::Duration;

use jtc_wire::{ControllerState, Status, TrajectoryState};

use super::halt::Halt;
use crate::words;

/// An arm that did not move for this time stands.
const STILL: Duration = Duration::from_millis(200);

/// The arm follows a path or can be led by hand, or a joint moves under torque.
pub fn is_moving(status: &Status) -> bool {
    status.is_executing()
        || status.state == ControllerState::Teaching
        || (has_torque(status) && words::moving_joint(status).is_some())
}

/// A trajectory is paused, and can be resumed.
pub fn is_paused(status: &Status) -> bool {
    status.trajectory == TrajectoryState::Pause && has_torque(status)
}

/// The controller holds or moves the joints.
pub(super) fn has_torque(status: &Status) -> bool {
    use ControllerState::{HoldPos, Operate, Teaching};
    status.state.is_in(&[HoldPos, Operate, Teaching])
}

/// Watches statuses until the arm stands. An arm that falls without torque does not stand, though no Stop holds it.
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
        if status.is_executing() || words::moving_joint(status).is_some() || self.is_incomplete(status) {
            return self.begin_again();
        }
        let since = *self.since.get_or_insert(now);
        self.reached = now.saturating_sub(since) >= STILL;
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

#[cfg(test)]
mod tests {
    use jtc_wire::ControllerState::{Error, HoldPos, Init, Operate, Start, Teaching};

    use super::*;

    fn status(state: ControllerState, velocity: f32) -> Status {
        let mut status = Status { state: state.into(), ..Status::default() };
        status.joints[1].velocity = velocity;
        status
    }

    /// The statuses come each 50 ms for a second.
    fn stands_after(halt: Halt, statuses: impl Fn(u32) -> Status) -> bool {
        let mut standstill = Standstill::after(halt);
        (0..20).for_each(|i| standstill.see(Duration::from_millis(50) * i, &statuses(i)));
        standstill.is_reached()
    }

    /// No arm stands that moves, with torque or without.
    #[test]
    fn an_arm_that_moves_does_not_stand_in_any_state() {
        for state in [Error, HoldPos, Init, Operate, Start] {
            for (velocity, stands) in [(0.0, true), (0.019, true), (0.05, false), (-0.3, false), (2.0, false)]
            {
                let reached = stands_after(Halt::Stop, |_| status(state, velocity));
                assert_eq!(reached, stands, "{state:?} {velocity}");
            }
            // Still for a moment only.
            let swings = |i: u32| status(state, if i % 4 == 3 { 0.1 } else { 0.0 });
            assert!(!stands_after(Halt::Stop, swings), "{state:?}");
        }
    }

    /// A Stop ends teaching and a pause; a Pause leaves its trajectory paused.
    #[test]
    fn a_stop_leaves_nothing_that_is_taught_or_can_be_resumed() {
        let paused = |state| Status { trajectory: TrajectoryState::Pause.into(), ..status(state, 0.0) };
        assert!(!stands_after(Halt::Stop, |_| status(Teaching, 0.0)));
        for state in [HoldPos, Operate] {
            assert!(!stands_after(Halt::Stop, |_| paused(state)), "{state:?}");
            assert!(stands_after(Halt::Pause, |_| paused(state)), "{state:?}");
        }
        // Without torque nothing is resumed.
        assert!(stands_after(Halt::Stop, |_| paused(Error)));
    }
}
