//! What the controller does about an error of a joint while it can still act (J-66), rather than take the torque away.
//!
//! A limit of the path that is found in motion stops the arm on its path. A position error, and a commanded position outside its
//! limits, let the arm give way: it is held where it is measured, with the torque of the model and a little more. Only when that
//! fails, and for every other error, the torque becomes zero (J-21).
use jtc_wire::{ExecCommand, RawPoint};

use crate::controller::Controller;
use crate::execution::phase::Phase;
use crate::motion::ControlMode;
use crate::{JOINTS, TrajectoryState, joint_error};

/// Errors that stop the arm on its path.
const STOP: u16 = joint_error::VELOCITY | joint_error::ACCELERATION | joint_error::FRICTION_TABLE;
/// Errors to which the arm gives way; the others may come with them.
const GIVE_WAY: u16 = joint_error::POSITION | joint_error::POSITION_ERROR;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// The arm gives way to these errors: from now on it is held where it is, and the torque has to be computed anew. False when
    /// it does not, or does already.
    pub(crate) fn gives_way(&mut self, errors: &[u16; JOINTS]) -> bool {
        let all = all(errors);
        if all & GIVE_WAY == 0 || all & !(GIVE_WAY | STOP) != 0 || self.motion.law.yielding() {
            return false;
        }
        self.errors.note_joints(errors);
        self.motion.give_way(&self.nodes, &self.config);
        self.motion.set.hold(&self.config);
        self.clock.rest();
        self.braking_ms = None;
        if self.trajectory == TrajectoryState::Execute {
            // Where a Pause or Stop was on its way, that is what it ends in (J-33).
            self.set_trajectory(self.phase.leave().unwrap_or(TrajectoryState::Pause));
        }
        true
    }

    /// The arm stops on its path because of these errors, or is about to. False when it is on none, or when the time for it is
    /// over.
    pub(crate) fn stops_on_path(&mut self, mode: ControlMode, errors: &[u16; JOINTS]) -> bool {
        let Phase::Running { leave } = self.phase else { return false };
        if mode != ControlMode::Follow || all(errors) & !STOP != 0 {
            return false;
        }
        if leave.is_none() {
            self.leave_path(ExecCommand::Pause);
        }
        let stops = self.braking_ms.is_some();
        if stops {
            self.errors.note_joints(errors);
        }
        stops
    }
}

/// Errors that any joint has.
fn all(errors: &[u16; JOINTS]) -> u16 {
    errors.iter().fold(0, |all, bits| all | bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, error};

    type Bench = Controller<[RawPoint; 4]>;

    fn running() -> Bench {
        let mut controller = Bench::new(Config::avena(), [RawPoint::default(); 4]);
        controller.phase = Phase::Running { leave: None };
        controller.trajectory = TrajectoryState::Execute;
        controller
    }

    /// What is checked when a trajectory is loaded cannot be met in motion; settings that change later may make it so.
    #[test]
    fn j66_a_limit_of_the_path_found_in_motion_pauses_on_the_path() {
        for bit in [joint_error::VELOCITY, joint_error::ACCELERATION, joint_error::FRICTION_TABLE] {
            let (mut controller, errors) = (running(), [0, bit, 0, 0, 0, 0]);
            assert!(controller.stops_on_path(ControlMode::Follow, &errors));
            assert_eq!(controller.phase, Phase::Running { leave: Some(TrajectoryState::Pause) });
            assert_eq!((controller.errors.word(), controller.errors.joint(1)), (0, (0, bit)));
            // Still outside while it brakes; when the time for that is over, it is an error.
            controller.braking_ms = Some(700);
            assert!(controller.stops_on_path(ControlMode::Follow, &errors));
            assert_eq!(controller.braking_ms, Some(700));
            controller.braking_ms = None;
            assert!(!controller.stops_on_path(ControlMode::Follow, &errors));
        }
    }

    #[test]
    fn j66_what_the_law_finds_in_motion_is_what_the_arm_reacts_to() {
        let found = |velocity: f64, offset: f64| {
            let mut controller = running();
            controller.config.delay_ticks = 0;
            controller.motion.set.hold_for_test();
            controller.motion.set.point.velocity[1] = velocity;
            controller.motion.set.point.position[1] = controller.nodes.positions()[1] + offset;
            let (torque, errors) = controller.control(ControlMode::Follow);
            controller.form_error_flags_again(torque, &errors);
            (controller.phase, controller.trajectory, controller.errors.word(), controller.errors.joint(1))
        };
        let limits = Config::avena().joints[1];
        let (too_fast, too_far) = (1.01 * limits.velocity_max, 1.01 * limits.position_error_max);
        let stops = Phase::Running { leave: Some(TrajectoryState::Pause) };
        assert_eq!(found(too_fast, 0.0), (stops, TrajectoryState::Execute, 0, (0, joint_error::VELOCITY)));
        let (_, trajectory, word, joint) = found(0.0, too_far);
        assert_eq!((trajectory, word, joint), (TrajectoryState::Pause, 0, (0, joint_error::POSITION_ERROR)));
    }

    #[test]
    fn j66_other_errors_and_other_states_do_not_stop_on_the_path() {
        for bit in [joint_error::TORQUE, joint_error::POSITION_ERROR, joint_error::POSITION] {
            assert!(
                !running().stops_on_path(ControlMode::Follow, &[0, bit | joint_error::VELOCITY, 0, 0, 0, 0])
            );
        }
        let mut held = Bench::new(Config::avena(), [RawPoint::default(); 4]);
        assert!(!held.stops_on_path(ControlMode::Hold, &[joint_error::VELOCITY; JOINTS]));
        assert!(!running().stops_on_path(ControlMode::Hold, &[joint_error::VELOCITY; JOINTS]));
    }

    #[test]
    fn j66_torque_over_its_limit_is_nothing_to_give_way_to() {
        for bits in [joint_error::TORQUE, joint_error::TORQUE | joint_error::POSITION_ERROR, 0, STOP] {
            assert!(!running().gives_way(&[0, 0, bits, 0, 0, 0]));
        }
        let mut controller = running();
        assert!(controller.gives_way(&[0, 0, joint_error::POSITION | joint_error::VELOCITY, 0, 0, 0]));
        assert_eq!((controller.trajectory, controller.errors.word()), (TrajectoryState::Pause, 0));
        assert!(!controller.gives_way(&[joint_error::POSITION_ERROR; JOINTS]), "it does already");
    }

    /// A Stop that is on its way stays a Stop; what comes when its time is over is an error, and not one that was acted upon.
    #[test]
    fn j33_j66_a_limit_found_during_a_stop_changes_nothing_about_it() {
        for (braking_ms, stops, occurred) in
            [(Some(5), true, error::INTERNAL | error::INTERNAL_JOINTS), (None, false, 0)]
        {
            let mut controller = running();
            let stop = Phase::Running { leave: Some(TrajectoryState::Stop) };
            (controller.phase, controller.braking_ms) = (stop, braking_ms);
            assert_eq!(
                controller.stops_on_path(ControlMode::Follow, &[0, joint_error::VELOCITY, 0, 0, 0, 0]),
                stops
            );
            assert_eq!((controller.phase, controller.braking_ms), (stop, braking_ms));
            assert_eq!(controller.errors.occurred(), occurred, "{braking_ms:?}");
        }
    }
}
