//! Held stop (J-69): moving joints come to rest, the controller holds the arm, and stores the cause for the host.
use jtc_wire::{DataStatus, ExecCommand, RawPoint, Reactions, StopCause, StopKind};

use crate::controller::Controller;
use crate::last_stop::LastStop;
use crate::motion::RUSH;
use crate::motion::too_fast;
use crate::{JOINTS, TrajectoryState, joint_error};

/// Returns `error` for each joint of a mask, and 0 for the other joints.
fn errors_of(joints: u8, error: u16) -> [u16; JOINTS] {
    core::array::from_fn(|j| if joints & 1 << j != 0 { error } else { 0 })
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Begins a held stop. `errors` are the joint errors that the status shows. The first joint with an error is the cause.
    pub(crate) fn hold_stop(&mut self, errors: &[u16; JOINTS], kind: StopKind) {
        let joint = errors.iter().position(|bits| *bits != 0).unwrap_or(0);
        let (value, limit) = self.measure(kind, joint);
        self.hold_stop_for(errors, self.cause(kind, joint, value, limit));
    }

    /// Like [`Self::hold_stop`], for a stop whose cause is already known.
    pub(crate) fn hold_stop_for(&mut self, errors: &[u16; JOINTS], cause: StopCause) {
        // The controller stores only the first cause. A cause that occurs while the arm is already held is usually a
        // consequence of the first cause.
        if !self.errors.held_stop() {
            self.keep_cause(cause);
        }
        self.rest_and_hold(errors);
    }

    /// Brings moving joints to rest, and holds the arm.
    pub(crate) fn rest_and_hold(&mut self, errors: &[u16; JOINTS]) {
        self.errors.hold_joints(errors, self.config.protective_stop_latches);
        // The waiting time of a pending teach request starts again.
        self.teaching_waits_ms = 0;
        if self.trajectory == TrajectoryState::Execute && self.phase.leave().is_none() {
            self.leave_path(ExecCommand::Pause);
        }
        self.stop_jog();
    }

    /// Brings the arm to rest and holds it, also in Teaching, because the two encoders of a joint disagree (J-35).
    #[cold]
    pub(crate) fn hold_misfits(&mut self) {
        let misfits = self.nodes.misfits();
        let first = misfits.trailing_zeros() as usize;
        if self.powered()
            && let Some((kind, value)) = self.nodes.misfit(first)
        {
            self.teaching = false;
            self.hold_stop_for(
                &errors_of(misfits, joint_error::POSITION_ERROR),
                self.cause(kind, first, value, 0.0),
            );
        }
    }

    /// Ends Teaching if a hand moves a joint too fast (J-25). Teaching ends before the joint reaches its over-speed,
    /// at which the controller would switch the torque off. The arm then comes to rest, and the controller holds it.
    /// `late` is the delay of this tick in ms.
    pub(crate) fn end_fast_teaching(&mut self, late: u16) {
        let speeds = self.motion.law.hear_led_joints(&self.nodes, late);
        for j in 0..JOINTS {
            let speed = f64::from(speeds[j]);
            let limit = too_fast(&self.config.joints[j], &self.config);
            // A jump of the encoder changes the computed speed, but not the speed that the drive reports. The
            // reported speed is older, so it must exceed only half of the limit.
            if speed.abs() > limit && self.nodes.node(j).report.velocity * speed.signum() > 0.5 * limit {
                self.teaching = false;
                let cause = self.cause(StopKind::Shove, j, speed, limit);
                self.hold_stop_for(&errors_of(1 << j, joint_error::TORQUE), cause);
                return;
            }
        }
    }

    /// Refuses to execute a trajectory while the controller does not trust the positions (J-35), and records this as an occurred error.
    pub(crate) fn check_trust(&mut self) -> Result<(), DataStatus> {
        match self.nodes.untrusted() {
            0 => Ok(()),
            joints => {
                self.errors.occur_joints(&errors_of(joints, joint_error::POSITION_ERROR));
                Err(DataStatus::NotAllowed)
            }
        }
    }

    /// Creates the cause of a held stop for the joint with this index.
    pub(crate) fn cause(&self, kind: StopKind, joint: usize, value: f64, limit: f64) -> StopCause {
        StopCause { kind, joint: joint as u8 + 1, value: value as f32, limit: limit as f32 }
    }

    /// Stores this cause as the last cause of a held stop.
    pub(crate) fn keep_cause(&mut self, cause: StopCause) {
        self.last_stop = LastStop { cause, tick: self.observed.tick };
    }

    /// Returns the measured value of a joint and its limit, in the unit of this kind of cause.
    fn measure(&self, kind: StopKind, joint: usize) -> (f64, f64) {
        // The index of the joint always comes from this crate and is valid. With `min`, the compiler can see that the index is in range.
        let j = joint.min(JOINTS - 1);
        let limits = &self.config.joints[j];
        let (law, set) = (&self.motion.law, &self.motion.set);
        let of = |values: &[f64; JOINTS]| values[j];
        match kind {
            StopKind::Overload | StopKind::Unstable => (law.torque[j].sum(), limits.torque_max),
            StopKind::Push => (law.feedback(j), self.config.yield_torque_share * limits.torque_max),
            StopKind::Shove => {
                let due = of(&set.point.velocity);
                (self.nodes.node(j).young_velocity(due) - due, RUSH * limits.velocity_max)
            }
            StopKind::PositionError => {
                (of(set.due(&self.config)) - of(self.nodes.positions()), limits.position_error_max)
            }
            StopKind::Position => {
                let position = of(&set.point.position);
                (position, if position > 0.0 { limits.position_max } else { limits.position_min })
            }
            StopKind::Velocity | StopKind::FrictionTable => (of(&set.point.velocity), limits.velocity_max),
            StopKind::Acceleration => (of(&set.point.acceleration), limits.acceleration_max),
            // For these kinds of causes, the caller sets the value, or the cause has no value.
            _ => (0.0, 0.0),
        }
    }

    /// Returns the data for Info (J-69): the present reactions of the controller, and the cause of the last held stop.
    pub fn reactions(&self) -> Reactions {
        let LastStop { cause, tick } = self.last_stop;
        let ago = self.observed.tick.saturating_sub(tick).min(u32::MAX.into()) as u32;
        let mask = |is: &dyn Fn(usize) -> bool| (0..JOINTS).fold(0, |mask, j| mask | u8::from(is(j)) << j);
        Reactions {
            stop: (tick != 0).then_some((cause, ago)),
            yields: mask(&|j| self.motion.law.yields(j)),
            jumped: self.nodes.untrusted(),
            rate: if self.trajectory == TrajectoryState::Execute {
                self.phase.rate(&self.clock) as f32
            } else {
                0.0
            },
            held_back_ms: self.motion.hold_back.run_ms().into(),
        }
    }
}

#[cfg(test)]
mod tests;
