//! Execution of a trajectory (J-30 to J-36), from Execute to standstill at any point of the path.
pub(crate) mod phase;

use jtc_wire::{DataStatus, ExecCommand, RawPoint, StopCause, StopKind};

use crate::controller::Controller;
use crate::motion::{self, ControlMode, LawInputs};
use crate::motion::{HoldBack, HoldBackStep};
use crate::trajectory::check::PathRange;
use crate::trajectory::path::PathClock;
use crate::{ControllerState, JOINTS, TrajectoryState, joint_error};
use phase::Phase;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Starts the path after Execute in Stop or Finish.
    pub(crate) fn start_path(&mut self) -> Result<(), DataStatus> {
        let first = self.store.first().ok_or(DataStatus::NotAllowed)?;
        // The check of the approach needs the held positions of all joints. If a joint is not enabled yet, the
        // controller makes this check later, when all joints are enabled.
        if !self.near(&first) || (self.motion.set.all_holding() && self.approach_to(&first).is_none()) {
            return Err(DataStatus::StartPositionMismatch);
        }
        self.clock = PathClock::default();
        self.phase = Phase::BEGIN;
        self.braking_ms = None;
        self.motion.hold_back = HoldBack::default();
        self.set_trajectory(TrajectoryState::Execute);
        Ok(())
    }

    /// Returns `true` if every measured position is within the start tolerance of `position`.
    fn near(&self, position: &[f64; JOINTS]) -> bool {
        let tolerance = self.config.start_tolerance_rad;
        (0..JOINTS).all(|j| (self.nodes.positions()[j] - position[j]).abs() <= tolerance)
    }

    /// Resumes the path after Execute in Pause. The arm must be at the paused point.
    pub(crate) fn resume_path(&mut self) -> Result<(), DataStatus> {
        let paused = self.path_point();
        let there = self.motion.set.point.position == paused;
        let approach = match self.near(&paused) {
            true if there => Some(Phase::Running { leave: None }),
            true => self.approach_to(&paused),
            false => None,
        };
        let approach = approach.ok_or(DataStatus::StartPositionMismatch)?;
        self.braking_ms = None;
        self.motion.hold_back = HoldBack::default();
        self.phase = if self.clock.time == 0.0 || self.parameters.blend_left_ms() > 0 {
            Phase::BEGIN
        } else {
            approach
        };
        if self.phase == (Phase::Running { leave: None }) {
            self.go_on();
        }
        self.set_trajectory(TrajectoryState::Execute);
        Ok(())
    }

    /// Returns the phase that moves the arm from the held position to `point` of the path. Returns `None` if a joint would leave its range,
    /// or if the available torque is not sufficient for an approach. An arm that is exactly at the first point needs no approach.
    fn approach_to(&mut self, point: &[f64; JOINTS]) -> Option<Phase> {
        let from = self.motion.set.point.position;
        if from == *point && self.clock.time == 0.0 {
            return Some(Phase::AtStart);
        }
        // An arm that is already outside its limits may begin a path at its present position (J-36).
        let within = |j: usize| {
            let (low, high) = PathRange::of(&self.config, j, self.store.step_ms()).of_path(from[j]);
            point[j] >= low && point[j] <= high
        };
        if !(0..JOINTS).all(within) {
            return None;
        }
        let (nodes, config, parameters) = (&self.nodes, &self.config, self.parameters.control());
        self.motion.ramp.begin(nodes, config, parameters.dynamics);
        let inputs = LawInputs { mode: ControlMode::Approach, braking: false, nodes, config, parameters };
        Some(Phase::approach(from, self.motion.approach_ms(point, &inputs)?))
    }

    /// Accelerates path time along a ramp from standstill to the configured speed.
    fn go_on(&mut self) {
        self.clock.go(self.config.speed);
        self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
    }

    /// Changes the speed on the path (J-57). The rate of path time changes along the ramp of J-33.
    pub(crate) fn set_speed(&mut self, speed: f64) {
        self.config.speed = speed;
        if self.clock.set_pace(speed) {
            self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
        }
    }

    /// Slows down the clock of the path or of the approach, because this motion overloads a joint (J-75). Returns
    /// `false` if the arm is not on a path or an approach, or if it is already stopping.
    ///
    /// If the arm arrives at its target in this tick, no reaction to the overload is necessary. The function then
    /// returns `true` and changes nothing.
    pub(crate) fn hold_back(&mut self) -> bool {
        if self.state != ControllerState::Operate {
            return false;
        }
        if !self.phase.goes_on() {
            return self.phase == Phase::AtStart;
        }
        if self.trajectory != TrajectoryState::Execute {
            return true;
        }
        if self.motion.hold_back.begin() {
            self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
        }
        true
    }

    /// Executes one tick of a motion whose clock (of the path or of the approach) is slowed down or returns to its normal rate.
    pub(crate) fn step_hold_back(&mut self) {
        if !self.motion.hold_back.is_watched() || !self.phase.goes_on() {
            return;
        }
        let (pressed, lags) = self.motion.presses(&self.nodes, &self.config);
        let clock = match &self.phase {
            Phase::Approaching { clock, .. } => clock,
            _ => &self.clock,
        };
        let next = self.motion.hold_back.step(&pressed, clock);
        if next == HoldBackStep::Stop || lags.contains(&true) {
            self.stop_held_back(&lags);
        } else if next == HoldBackStep::Restore {
            self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
        }
    }

    /// Begins a held stop, because the arm is still overloaded although the path was slowed down. `lags` is `true`
    /// for each joint whose position error is too large.
    #[cold]
    fn stop_held_back(&mut self, lags: &[bool; JOINTS]) {
        let errors = core::array::from_fn(|j| match (lags[j], self.motion.hold_back.has_pressed(j)) {
            (true, _) => joint_error::POSITION_ERROR,
            (false, true) => joint_error::TORQUE,
            (false, false) => 0,
        });
        // If a joint has a position error that is too large, this joint is the cause of the stop. A joint at its
        // torque limit is the cause only if no joint lags.
        match lags.iter().position(|lags| *lags) {
            Some(joint) => {
                let (error, limit) = self.motion.lag(joint, &self.nodes, &self.config);
                let cause = self.cause(StopKind::PositionError, joint, error, limit);
                self.hold_stop_for(&errors, cause);
            }
            None => self.hold_stop(&errors, StopKind::Overload),
        }
    }

    /// Pauses or stops the execution of the trajectory. The execution state (TES) stays Execute until standstill (J-33).
    pub(crate) fn leave_path(&mut self, command: ExecCommand) {
        let to = if command == ExecCommand::Pause { TrajectoryState::Pause } else { TrajectoryState::Stop };
        match &mut self.phase {
            Phase::Running { leave } => {
                if leave.replace(to).is_none() {
                    self.clock.halt();
                    self.motion.hold_back.end();
                    self.begin_braking();
                }
            }
            // A pause or stop during the approach stops the arm before it reaches the target of the approach.
            Phase::Approaching { clock, leave, .. } if clock.time > 0.0 => {
                if leave.replace(to).is_none() {
                    clock.halt();
                    self.motion.hold_back.end();
                    self.begin_braking();
                }
            }
            Phase::Waiting { .. } | Phase::Approaching { .. } | Phase::AtStart => self.set_trajectory(to),
        }
    }

    /// Begins braking, which may use all available torque.
    pub(crate) fn begin_braking(&mut self) {
        self.braking_ms = Some(0);
        self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
    }

    /// Computes the set values in state Operate.
    pub(crate) fn walk(&mut self) {
        match self.phase {
            Phase::Waiting { elapsed_ms } => {
                // Drives can need seconds to enable. Until all drives are enabled, the controller holds the arm,
                // which can sag in this time.
                self.motion.set.hold(&self.config);
                if self.parameters.blend_left_ms() > 0 {
                    self.motion.law.payload_comes();
                }
                self.parameters.blend_payload();
                // The model must not change while the arm is on the path (J-60).
                if !self.motion.set.all_holding() || self.parameters.blend_left_ms() > 0 {
                    // After the enabling timeout, the operator no longer expects a motion, so the controller stops waiting (J-16).
                    self.phase = Phase::Waiting { elapsed_ms: elapsed_ms.saturating_add(1) };
                    if elapsed_ms >= self.config.enable_timeout_ms {
                        self.set_trajectory(TrajectoryState::Stop);
                    }
                } else {
                    let to = self.path_point();
                    match if self.near(&to) { self.approach_to(&to) } else { None } {
                        Some(phase) => self.phase = phase,
                        None => {
                            // The controller has already accepted Execute, so it cannot refuse this command any more.
                            // The controller stores the cause of the stop for the host.
                            self.keep_cause(StopCause { kind: StopKind::Approach, ..StopCause::default() });
                            self.set_trajectory(TrajectoryState::Stop);
                        }
                    }
                }
            }
            Phase::Approaching { from, length_ms, mut clock, leave } => {
                if clock.time == 0.0 {
                    // Friction compensation begins in this tick. The transfer blends it in, so that the torque has no
                    // step.
                    self.motion.law.change_mode();
                }
                clock.advance(length_ms);
                let at = motion::approach(&from, &self.path_point(), clock.time / length_ms, length_ms);
                self.motion.follow(&at, &mut clock, &self.config);
                let arrived = clock.time >= length_ms;
                if let Some(trajectory) = leave.filter(|_| arrived || clock.standing()) {
                    self.set_trajectory(trajectory);
                } else if !arrived {
                    self.phase = Phase::Approaching { from, length_ms, clock, leave };
                } else {
                    // The approach has ended, so the controller does not hold it back any more. The path begins at
                    // rest.
                    self.motion.hold_back.end();
                    if self.clock.time == 0.0 {
                        self.phase = Phase::AtStart;
                    } else {
                        self.go_on();
                        self.phase = Phase::Running { leave: None };
                    }
                }
            }
            Phase::AtStart => {
                self.motion.law.change_mode();
                self.clock = PathClock::start(self.config.speed);
                self.phase = Phase::Running { leave: None };
                self.follow();
                self.finish_at_end();
            }
            Phase::Running { leave } => {
                self.clock.advance(f64::from(self.store.duration_ms()));
                self.follow();
                match leave {
                    // The velocity at the last point is zero, so the arm stops at this point even if the rate of path time is not zero.
                    Some(trajectory) if self.clock.standing() || self.at_end() => {
                        self.clock.rest();
                        self.set_trajectory(trajectory);
                    }
                    Some(_) => {}
                    None => self.finish_at_end(),
                }
            }
        }
    }

    /// Computes the set values at the present path time.
    fn follow(&mut self) {
        if self.clock.at_full_speed() && !self.motion.hold_back.is_active() {
            self.clock.slope = 0.0;
            self.store.put(self.clock.time, &mut self.motion.set.point);
            return;
        }
        let Some(at) = self.store.at(self.clock.time) else { return };
        self.motion.follow(&at, &mut self.clock, &self.config);
    }

    /// Returns the positions at the present path time. Returns the held position if no trajectory is stored (Execute is then refused).
    fn path_point(&self) -> [f64; JOINTS] {
        self.store.at(self.clock.time).map_or(self.motion.set.point.position, |at| at.position)
    }

    /// Returns `true` if the last point was commanded in this tick (J-31).
    fn at_end(&self) -> bool {
        self.clock.time >= f64::from(self.store.duration_ms())
    }

    fn finish_at_end(&mut self) {
        if self.at_end() {
            self.set_trajectory(TrajectoryState::Finish);
        }
    }

    /// Executes one more tick of a pause or stop. Returns `true` if the arm still moves and the stop continues.
    ///
    /// During a pause or stop, the controller may use all available torque for braking. After `stop_ms`, the stop
    /// ends as soon as every joint is slow enough to count as at rest. If path time or a jog has not stopped at the
    /// end of the braking time, the available torque was too low. The moving joints then count as overloaded. If the
    /// commanded motion has ended by then but an external force moves the arm, the normal limits apply.
    pub(crate) fn brake(&mut self) -> bool {
        if self.motion.set.jogs_on() {
            // A jog is active and is not coming to rest, so no pause or stop is in progress any more.
            self.braking_ms = None;
        }
        let Some(ms) = self.braking_ms else { return false };
        let moving = self.motion.set.moving(&self.nodes);
        let stands = moving == [false; JOINTS];
        if self.trajectory == TrajectoryState::Execute
            && let Some(trajectory) = self.phase.leave()
            && stands
            && ms >= self.config.stop_ms
        {
            self.clock.rest();
            self.set_trajectory(trajectory);
        }
        let still = self.trajectory != TrajectoryState::Execute && stands;
        let over = ms >= self.config.braking_ms_max;
        let jogged = self.motion.set.jogging();
        if over && (jogged || self.trajectory == TrajectoryState::Execute) {
            let causes = moving.map(|moves| if moves { joint_error::TORQUE } else { 0 });
            if self.config.torque_release {
                self.errors.raise_joints(&causes);
            } else {
                // Path time stops, and each joint that still moves lowers its load (J-70).
                self.motion.begin_yields(&[false; JOINTS], &moving, &self.config);
                self.hold_stop(&causes, StopKind::Overload);
                if jogged {
                    self.motion.set.drop_jog();
                } else {
                    self.clock.rest();
                    self.set_trajectory(self.phase.leave().unwrap_or(TrajectoryState::Pause));
                }
            }
        }
        self.braking_ms = if over || still { None } else { Some(ms + 1) };
        self.braking_ms.is_some()
    }
}

#[cfg(test)]
mod tests;
