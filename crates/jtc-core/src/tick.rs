//! Control tick, with the steps in the order of docs/architecture.md.
use jtc_bus::Frame;
use jtc_wire::{RawPoint, Response};

use crate::controller::Controller;
use crate::interpolation::ROUNDING;
use crate::io::{Inputs, Outputs};
use crate::motion::{ControlMode, Found, LawInputs};
use crate::trajectory::check::PathRange;
use crate::{ControllerState, JOINTS, joint_error};

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Executes one control tick (1 ms). The amount of work is bounded for any inputs.
    pub fn tick(&mut self, inputs: &Inputs<'_>) -> Outputs {
        let before = self.state;
        // 1. Evaluate the inputs. The controller sets the error flags before it executes the commands of the host, so that a clear cannot
        //    hide a fault of the same tick. In Start, the controller does not execute commands yet, and the board passes the events again
        //    in the next tick.
        self.take_answers(inputs);
        if !inputs.safety_input || self.safety_stop_ms.is_some() {
            self.watch_safety_input(inputs);
        }
        self.form_error_flags(inputs);
        if self.errors.any() {
            self.enter(ControllerState::Error);
        }
        let host_done = if before == ControllerState::Start { 0 } else { self.serve_host(inputs) };
        self.watch_hosts(inputs, host_done);

        // 2. Choose the next state. An error whose cause persists is raised again, because a host may have cleared the error.
        if !inputs.host.is_empty() {
            self.form_error_flags(inputs);
        }
        self.choose_state();

        // 3. Execute the work of this state.
        let (torque, found) = self.work();

        // 4. An error that was found in step 3 sets the torque of the present tick to zero.
        let torque = self.form_error_flags_again(torque, &found);

        // 5. Make the frame for the bus.
        let bus = self.frame(before, torque);
        self.observe(&torque);

        // 6. Set the outputs for the board and the hosts. J-22: the safety output is 0 in Start and while an internal error is latched.
        let safety_output = self.state != ControllerState::Start && !self.errors.internal();
        let status = self.status_due(inputs.status_free);
        let record_line = if status { self.prepare_status() } else { None };
        // J-50: a status that is due is sent before an answer.
        let answer_line = if inputs.status_free && !status { self.extensions.answers.send() } else { None };
        let store = core::mem::take(&mut self.extensions.store_requested);
        Outputs { bus: Some(bus), safety_output, status, record_line, answer_line, store, host_done }
    }

    /// Evaluates the answers of the nodes, and checks that this tick is on time.
    fn take_answers(&mut self, inputs: &Inputs<'_>) {
        let found_moving = self.motion.set.next_tick();
        let commanded = &self.motion.set.commanded;
        if found_moving != [false; JOINTS] {
            self.nodes.go_on_moving(&found_moving, commanded.due_velocity(&self.config));
        }
        self.nodes.take(inputs, &self.config, self.goal(), commanded);
        if self.nodes.misfits() != 0 {
            self.hold_misfits();
        }
        if self.state == ControllerState::Teaching {
            self.end_fast_teaching(inputs.missed_ticks);
        }
        self.pump &= !self.nodes.gripper_lost();
        if self.tick_overruns.count(inputs.missed_ticks) {
            self.errors.raise_device();
        }
    }

    /// Raises errors whose cause is outside the control law. Errors from outside the control law are latched (J-21).
    fn form_error_flags(&mut self, inputs: &Inputs<'_>) {
        if self.safety_input_releases(inputs.safety_input) {
            self.errors.raise_emergency_input();
        }
        self.errors.raise_can(self.nodes.can_flags(inputs, &self.config));
        self.errors.show_can(self.nodes.gripper_flags(&self.config));
        if self.nodes.external_error(self.powered()) {
            self.errors.raise_external_joints();
        }
    }

    /// Executes the work of the present state. Returns torques within their limits, and the joint errors that were found.
    fn work(&mut self) -> ([f64; JOINTS], [u16; JOINTS]) {
        match self.state {
            ControllerState::Start | ControllerState::Init | ControllerState::Error => {
                // All other parts of the motion were already reset when this state began.
                self.motion.set.release(&self.nodes);
                self.parameters.end_blend();
                ([0.0; JOINTS], [0; JOINTS])
            }
            ControllerState::Teaching => self.teach(),
            ControllerState::HoldPos => self.hold(),
            ControllerState::Operate => self.operate(),
        }
    }

    fn hold(&mut self) -> ([f64; JOINTS], [u16; JOINTS]) {
        // The controller cancels a teach request that has waited too long, because the operator no longer expects the
        // arm to become compliant.
        self.teaching_waits_ms = if self.teaching { self.teaching_waits_ms.saturating_add(1) } else { 0 };
        self.teaching &= self.teaching_waits_ms < self.config.enable_timeout_ms;
        if self.parameters.blend_left_ms() > 0 {
            self.motion.law.payload_comes();
        }
        self.parameters.blend_payload();
        self.motion.latch(&self.nodes, &self.config);
        let jogged = self.motion.set.jogging();
        if self.motion.set.jog_ends() {
            self.begin_braking();
        }
        self.motion.hold(&self.config);
        if self.motion.set.jogging() {
            return self.control(ControlMode::Approach);
        }
        if self.motion.set.is_led() {
            return self.rest();
        }
        if jogged {
            // The jog has ended and the arm is at rest, so the control mode changes.
            self.motion.law.change_mode();
        }
        self.control(ControlMode::Hold)
    }

    /// Executes one tick in which the arm comes to rest after a hand has moved it.
    fn rest(&mut self) -> ([f64; JOINTS], [u16; JOINTS]) {
        let mode = if self.motion.set.led_to_rest(&self.config) {
            self.motion.law.change_mode();
            ControlMode::Hold
        } else {
            ControlMode::Rest
        };
        self.control(mode)
    }

    fn teach(&mut self) -> ([f64; JOINTS], [u16; JOINTS]) {
        self.motion.keep_ramp(&self.nodes, &self.config, &self.parameters.dynamics);
        self.motion.set.follow_measured(&self.nodes);
        if self.parameters.blend_left_ms() > 0 {
            // The model takes over a part of the mass that Teaching has estimated. Teaching therefore reduces its own
            // estimate.
            self.motion.law.give_way_to_payload(self.parameters.next_mass());
            self.parameters.blend_payload();
        }
        self.control(ControlMode::Teach)
    }

    /// Executes the control step in Operate. The control step is a separate function, so that a test can count its instructions. On the
    /// path, the number of instructions is the same in every tick.
    #[inline(never)]
    fn operate(&mut self) -> ([f64; JOINTS], [u16; JOINTS]) {
        self.motion.latch(&self.nodes, &self.config);
        let mode = self.phase.mode();
        self.walk();
        let torque = self.control(mode);
        self.step_hold_back();
        torque
    }

    /// Executes the control law and the limiter. Returns the torques to command, and the joint errors for which the controller must release
    /// the arm (J-66).
    pub(crate) fn control(&mut self, mode: ControlMode) -> ([f64; JOINTS], [u16; JOINTS]) {
        // A joint above its over-speed threshold is out of control. If a joint is out of control, the controller switches the torque off.
        let too_fast = self.motion.over_speed.watch(&self.nodes, &self.config);
        let braking = self.brake();
        let blended = if self.parameters.trial.runs() && mode != ControlMode::Teach {
            self.parameters.try_gains(self.motion.holds(&self.config))
        } else {
            None
        };
        let (nodes, config, mut parameters) = (&self.nodes, &self.config, self.parameters.control());
        if let Some(gains) = &blended {
            parameters.pid = gains;
        }
        let limited = self.motion.control(&LawInputs { mode, braking, nodes, config, parameters });
        let Some(mut found) = limited.found else { return (limited.torque, too_fast) };
        self.tolerate_positions(&mut found);
        let errors = self.react(mode, &found);
        (limited.torque, core::array::from_fn(|j| too_fast[j] | errors[j]))
    }

    /// Ignores positions outside their limits in motion (J-43) if the check of the trajectory has accepted the path outside the limits
    /// (J-36).
    #[cold]
    fn tolerate_positions(&self, found: &mut [Found; JOINTS]) {
        let Some(first) = self.store.first() else { return };
        let outside = |found: &Found| found.errors & joint_error::POSITION != 0;
        for (j, found) in found.iter_mut().enumerate().filter(|(_, found)| outside(found)) {
            let (low, high) = PathRange::of(&self.config, j, self.store.step_ms()).of_path(first[j]);
            let position = self.motion.set.point.position[j];
            if position >= low - ROUNDING && position <= high + ROUNDING {
                found.errors &= !joint_error::POSITION;
            }
        }
    }

    /// Raises the joint errors in `found`. Returns the torques to command, which are zero if an error is latched (J-21).
    pub(crate) fn form_error_flags_again(
        &mut self,
        torque: [f64; JOINTS],
        found: &[u16; JOINTS],
    ) -> [f64; JOINTS] {
        self.errors.raise_joints(found);
        if self.errors.any() {
            self.enter(ControllerState::Error);
            return [0.0; JOINTS];
        }
        torque
    }

    /// Returns the frame of this tick (J-12).
    pub(crate) fn frame(&mut self, before: ControllerState, torque: [f64; JOINTS]) -> Frame {
        // Drives keep their last torque, so the Move that switches the torque off has priority over all other frames.
        let new_error = self.state == ControllerState::Error && before != ControllerState::Error;
        let must_move = new_error || (before.has_torque() && !self.powered());
        // J-61: up to this line, all torques are torques at the joints.
        let torque = core::array::from_fn(|j| torque[j] * self.config.joints[j].torque_gain);
        self.nodes.frame(&self.config, self.goal(), torque, self.pump, must_move)
    }

    /// Puts the oldest response record into a status. Returns the host line of this record.
    fn prepare_status(&mut self) -> Option<usize> {
        let record = self.records.pop();
        let status = self.status(record.map_or(Response::NONE, |(_, record)| record));
        status.emit_to(&mut self.status_frame);
        record.map(|(line, _)| line)
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::Segment;

    use super::*;
    use crate::Config;
    use crate::nodes::Nodes;
    use crate::parameters::PidGains;

    /// An accepted teach request waits at most as long as enabling may take. After the timeout, the operator no longer expects the arm to
    /// become compliant.
    #[test]
    fn j25_teaching_waits_for_a_while_only() {
        let most = Config::avena().enable_timeout_ms;
        for (waited_ms, waits) in [(0, true), (most - 2, true), (most - 1, false), (most, false)] {
            let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
            (controller.state, controller.teaching) = (ControllerState::HoldPos, true);
            controller.teaching_waits_ms = waited_ms;
            controller.hold();
            assert_eq!(controller.teaching, waits, "{waited_ms} ms");
        }
    }

    fn holding() -> Controller<[RawPoint; 4]> {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.state = ControllerState::HoldPos;
        controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        controller.motion.set.hold_for_test();
        controller
    }

    /// Ten late ticks within a second are a failure of the device.
    #[test]
    fn j12_ten_missed_ticks_are_an_internal_error() {
        for (missed_ticks, failed) in [(0, false), (9, false), (10, true), (11, true)] {
            let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
            controller.tick(&Inputs::QUIET);
            controller.tick(&Inputs { missed_ticks, ..Inputs::QUIET });
            assert_eq!(controller.errors.internal(), failed, "{missed_ticks}");
            assert_eq!(controller.state == ControllerState::Error, failed, "{missed_ticks}");
        }
    }

    /// When the arm has come to rest after a jog, the control mode changes. The friction torque of the jog (8 N·m) is
    /// then blended out.
    #[test]
    fn j44_a_jog_ends_without_a_torque_step() {
        for (jogs, blended) in [(false, 0.0), (true, 8.0)] {
            let mut controller = holding();
            if jogs {
                controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
                controller.motion.set.end_jog();
            }
            controller.motion.law.torque[0].friction = 8.0;
            controller.hold();
            assert!(!controller.motion.set.jogging());
            assert_eq!(controller.motion.law.torque[0].blend, blended, "{jogs}");
        }
    }

    /// In Teaching, the gains have no effect, so the blend to new gains pauses.
    #[test]
    fn j71_new_gains_are_blended_in_while_the_gains_have_an_effect() {
        for (mode, goes_on) in
            [(ControlMode::Hold, true), (ControlMode::Follow, true), (ControlMode::Teach, false)]
        {
            let mut controller = holding();
            let before = controller.parameters.pid;
            let after = before.map(|gains| PidGains { kp: 0.5 * gains.kp, ..gains });
            controller.parameters.trial.begin(&before, &after);
            controller.parameters.put_pid(&after);
            let begun = controller.parameters.trial.blended(&after).expect("a blend");
            for _ in 0..10 {
                controller.control(mode);
            }
            let gains = controller.parameters.trial.blended(&after).expect("a blend");
            assert_eq!(gains[0].kp < begun[0].kp, goes_on, "{mode:?}");
        }
    }

    /// In motion, a position is tolerated if it is inside the range of the path that the check has accepted. An
    /// allowance of 1e-9 rad covers the rounding of the interpolation.
    #[test]
    fn j43_only_positions_that_the_check_has_accepted_are_tolerated() {
        let (low, high) = PathRange::of(&Config::avena(), 1, 10).of_path(0.0);
        let (least, most) = (low - 1e-9, high + 1e-9);
        assert!(least < low && low < high && high < most);
        let other = joint_error::VELOCITY;
        for (position, errors) in [
            (least.next_down(), joint_error::POSITION | other),
            (least, other),
            (low, other),
            (0.0, other),
            (high, other),
            (most, other),
            (most.next_up(), joint_error::POSITION | other),
            (f64::NAN, joint_error::POSITION | other),
        ] {
            let mut controller = holding();
            let mut body = [0, 1, 0, 0, 0, 1, 0, 10].to_vec();
            body.resize(body.len() + 36 * 2, 0);
            let segment = Segment::parse(&body).expect("a segment");
            controller.store.begin(&segment, false, false);
            controller.store.copy(&segment, 0, 2);
            let passed = controller.check.passed();
            controller.store.commit(&segment, passed);
            controller.motion.set.point.position[1] = position;
            let mut found = [Found::default(); JOINTS];
            found[1].errors = joint_error::POSITION | other;
            found[2].errors = other;
            controller.tolerate_positions(&mut found);
            assert_eq!((found[1].errors, found[2].errors), (errors, other), "{position}");
        }
    }
}
