//! The safety input (J-22): at 0 it takes the torque away, at once or after a stop.
use jtc_wire::{ExecCommand, RawPoint};

use crate::controller::Controller;
use crate::{ControllerState, JOINTS, TrajectoryState};

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// The `level` of the safety input in this tick. With `safety_input_ramp_ms` an arm that moves comes to rest first (stop category 1 of
    /// IEC 60204-1), also where the input is 1 again meanwhile.
    pub(crate) fn watch_safety_input(&mut self, level: bool) {
        let ramp_ms = self.config.safety_input_ramp_ms;
        self.safety_stop_ms = match self.safety_stop_ms {
            _ if !self.powered() => None,
            None if level || ramp_ms == 0 || self.stands_still() => None,
            None => {
                self.come_to_rest();
                Some(0)
            }
            Some(_) if self.stands_still() => Some(ramp_ms),
            Some(ms) => Some(ms.saturating_add(1).min(ramp_ms)),
        };
    }

    /// The safety input takes the torque away in this tick.
    pub(crate) fn safety_input_releases(&self, level: bool) -> bool {
        match self.safety_stop_ms {
            Some(ms) => ms >= self.config.safety_input_ramp_ms,
            None => !level,
        }
    }

    /// What moves comes to rest as by a Stop (J-33).
    fn come_to_rest(&mut self) {
        self.teaching = false;
        if self.trajectory == TrajectoryState::Execute {
            self.leave_path(ExecCommand::Stop);
        }
        if self.motion.set.jogging() {
            self.motion.set.end_jog();
            self.extensions.refuse_jogs();
        }
    }

    /// The arm is held at rest: nothing moves, and nothing is to.
    fn stands_still(&self) -> bool {
        self.state == ControllerState::HoldPos
            && self.trajectory != TrajectoryState::Execute
            && !self.motion.set.coming_to_rest()
            && self.motion.set.moving(&self.nodes) == [false; JOINTS]
    }
}
