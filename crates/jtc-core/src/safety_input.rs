//! Safety input (J-22). If the input is 0, the controller switches the torque off, at once or after a stop.
use jtc_wire::{ExecCommand, RawPoint};

use crate::controller::Controller;
use crate::io::Inputs;
use crate::{ControllerState, JOINTS, TrajectoryState};

/// Value that marks the end of the time for a stop.
const OVER: u16 = u16::MAX;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Executes a tick in which the safety input is 0, or has been 0 before. If `safety_input_ramp_ms` is set, a
    /// commanded motion comes to rest first (stop category 1 of IEC 60204-1). This stop continues even if the input
    /// returns to 1. The controller raises the error in every case, even if the torque is already off.
    #[cold]
    pub(crate) fn watch_safety_input(&mut self, inputs: &Inputs<'_>) {
        let ramp_ms = self.config.safety_input_ramp_ms;
        self.safety_stop_ms = match self.safety_stop_ms {
            // The stop has ended, and the controller raised the error in the last tick.
            Some(OVER) => None,
            Some(_) if !self.powered() || self.stands_still() || self.motion.law.is_yielding() => Some(OVER),
            Some(ms) => {
                let ms = ms.saturating_add(1).saturating_add(inputs.missed_ticks);
                Some(if ms < ramp_ms { ms } else { OVER })
            }
            None if inputs.safety_input || ramp_ms == 0 || !self.has_to_stop() => None,
            None => {
                self.come_to_rest();
                Some(0)
            }
        };
    }

    /// Returns `true` if the safety input switches the torque off in this tick.
    pub(crate) fn safety_input_releases(&self, level: bool) -> bool {
        match self.safety_stop_ms {
            Some(ms) => ms == OVER,
            None => !level,
        }
    }

    /// Brings the moving arm to rest like a Stop (J-33).
    fn come_to_rest(&mut self) {
        self.teaching = false;
        if self.trajectory == TrajectoryState::Execute {
            self.leave_path(ExecCommand::Stop);
        }
        self.stop_jog();
    }

    /// Returns `true` if a command or a hand moves the arm, and every joint has torque. In all other cases, for
    /// example if a joint yields, a stop would only delay switching the torque off.
    fn has_to_stop(&self) -> bool {
        let enabled = |j: usize| self.nodes.node(j).enabled() || self.config.absent.get(j) == Some(&true);
        let moves = match self.state {
            ControllerState::Teaching => true,
            ControllerState::Operate => !self.phase.waits(),
            ControllerState::HoldPos => self.motion.set.coming_to_rest(),
            _ => false,
        };
        moves && !self.motion.law.is_yielding() && (0..JOINTS).all(enabled)
    }

    /// Returns `true` if the arm is held at rest and no motion is commanded.
    fn stands_still(&self) -> bool {
        self.state == ControllerState::HoldPos
            && self.trajectory != TrajectoryState::Execute
            && !self.motion.set.coming_to_rest()
            && self.motion.set.moving(&self.nodes) == [false; JOINTS]
    }
}

#[cfg(test)]
mod tests;
