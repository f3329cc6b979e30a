//! Detection of an arm at rest after a Stop.

use std::time::Duration;

use jtc_wire::{ControllerState, Status, TrajectoryState};

use super::halt::Halt;
use crate::labels;

/// If the arm does not move for this time, it is considered at rest.
const STILL: Duration = Duration::from_millis(200);

/// Returns `true` if the arm follows a path or can be guided by hand, or if a joint moves under torque.
pub fn is_moving(status: &Status) -> bool {
    status.is_executing()
        || status.state == ControllerState::Teaching
        || (has_torque(status) && labels::moving_joint(status).is_some())
}

/// Returns `true` if a trajectory is paused and can be resumed.
pub fn is_paused(status: &Status) -> bool {
    status.trajectory == TrajectoryState::Pause && has_torque(status)
}

/// Returns `true` if the controller holds or moves the joints.
pub(super) fn has_torque(status: &Status) -> bool {
    use ControllerState::{HoldPos, Operate, Teaching};
    status.state.is_in(&[HoldPos, Operate, Teaching])
}

/// Detector of an arm at rest, which evaluates status frames after a Stop or Pause. An arm that falls without torque
/// is not at rest, although a Stop cannot hold the arm.
#[derive(Clone, Copy, Debug)]
pub struct Standstill {
    halt: Halt,
    since: Option<Duration>,
    reached: bool,
    moved: bool,
}

impl Standstill {
    /// Creates the evaluation of status frames after a Stop or Pause.
    pub fn after(halt: Halt) -> Self {
        Self { halt, since: None, reached: false, moved: false }
    }

    /// Evaluates a status that arrived at `now`.
    pub fn see(&mut self, now: Duration, status: &Status) {
        self.moved |= is_moving(status);
        if status.is_executing() || labels::moving_joint(status).is_some() || self.is_incomplete(status) {
            return self.begin_again();
        }
        let since = *self.since.get_or_insert(now);
        self.reached = now.saturating_sub(since) >= STILL;
    }

    /// Returns `true` if a Stop has not yet taken full effect: the arm is still in teaching, or a motion can still be
    /// resumed.
    fn is_incomplete(&self, status: &Status) -> bool {
        self.halt == Halt::Stop && (status.state == ControllerState::Teaching || is_paused(status))
    }

    /// Restarts the measurement of the time for which the arm must be at rest.
    pub(super) fn begin_again(&mut self) {
        (self.since, self.reached) = (None, false);
    }

    /// Returns `true` if the arm is at rest.
    pub fn is_reached(&self) -> bool {
        self.reached
    }

    /// Returns `true` if the arm has moved after the Stop or Pause.
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

    /// Evaluates one status every 50 ms for one second. Returns `true` if the arm counts as at rest after this
    /// second.
    fn stands_after(halt: Halt, statuses: impl Fn(u32) -> Status) -> bool {
        let mut standstill = Standstill::after(halt);
        (0..20).for_each(|i| standstill.see(Duration::from_millis(50) * i, &statuses(i)));
        standstill.is_reached()
    }

    /// A moving arm is not at rest, with or without torque.
    #[test]
    fn an_arm_that_moves_does_not_stand_in_any_state() {
        for state in [Error, HoldPos, Init, Operate, Start] {
            for (velocity, stands) in [(0.0, true), (0.019, true), (0.05, false), (-0.3, false), (2.0, false)]
            {
                let reached = stands_after(Halt::Stop, |_| status(state, velocity));
                assert_eq!(reached, stands, "{state:?} {velocity}");
            }
            // A joint oscillates: its speed is 0.1 rad/s in every fourth status, and 0 in the others. The arm must
            // not count as at rest.
            let swings = |i: u32| status(state, if i % 4 == 3 { 0.1 } else { 0.0 });
            assert!(!stands_after(Halt::Stop, swings), "{state:?}");
        }
    }

    /// After a Stop, the arm is considered at rest only if teaching has ended and no motion is paused. After a Pause,
    /// the motion stays paused.
    #[test]
    fn a_stop_leaves_nothing_that_is_taught_or_can_be_resumed() {
        let paused = |state| Status { trajectory: TrajectoryState::Pause.into(), ..status(state, 0.0) };
        assert!(!stands_after(Halt::Stop, |_| status(Teaching, 0.0)));
        for state in [HoldPos, Operate] {
            assert!(!stands_after(Halt::Stop, |_| paused(state)), "{state:?}");
            assert!(stands_after(Halt::Pause, |_| paused(state)), "{state:?}");
        }
        // Without torque, a paused motion cannot be resumed. Therefore the pause does not prevent that the arm counts
        // as at rest.
        assert!(stands_after(Halt::Stop, |_| paused(Error)));
    }
}
