//! The controller: state machine and tick (section 4).
use jtc_wire::{RawPoint, Response, STATUS_LEN};

use crate::check::{TrajectoryCheck, Violation};
use crate::config::Config;
use crate::errors::Errors;
use crate::execution::Path;
use crate::host::overtaking::Overtaking;
use crate::host::slices::SliceProgress;
use crate::io::{Inputs, Outputs};
use crate::late::LateTicks;
use crate::motion::{ControlMode, LawInputs, Motion};
use crate::nodes::{Goal, Nodes};
use crate::path::PathClock;
use crate::received::ReceivedParameters;
use crate::response_queue::{HOST_LINES, ResponseQueues};
use crate::store::Store;
use crate::telemetry::Telemetry;
use crate::{ControllerState, JOINTS, TrajectoryState};

/// The joint trajectory controller. `M` is the memory of its trajectory: [`crate::POINTS_MAX`] points.
///
/// Parts with state of their own are in modules of their own: `nodes` (the bus), `host` (commands), `store` (trajectory),
/// `motion` (control law), `errors`. This type connects them; [`Controller::tick`] is the figure of the manual, top to bottom.
#[derive(Clone, Debug)]
pub struct Controller<M> {
    pub(crate) config: Config,
    pub(crate) state: ControllerState,
    pub(crate) errors: Errors,
    pub(crate) nodes: Nodes,
    // Received from the host.
    pub(crate) parameters: ReceivedParameters,
    pub(crate) teaching: bool,
    /// Milliseconds for which teaching has waited until the arm is held.
    teaching_waits_ms: u32,
    pub(crate) pump: bool,
    // The trajectory and its execution.
    pub(crate) store: Store<M>,
    pub(crate) check: TrajectoryCheck,
    pub(crate) violation: Option<Violation>,
    pub(crate) trajectory: TrajectoryState,
    pub(crate) clock: PathClock,
    pub(crate) path: Path,
    /// Ticks since a pause or stop was commanded on the path, until the arm stands (J-33).
    pub(crate) braking_ms: Option<u16>,
    pub(crate) motion: Motion,
    // The link to the host.
    pub(crate) slice_progress: SliceProgress,
    pub(crate) overtaking: [Overtaking; HOST_LINES],
    pub(crate) records: ResponseQueues,
    pub(crate) since_status_ms: u16,
    late_ticks: LateTicks,
    status_frame: [u8; STATUS_LEN],
    pub(crate) telemetry: Telemetry,
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// A controller in Start. The first tick takes it to Init.
    pub fn new(config: Config, points: M) -> Self {
        Self {
            state: ControllerState::Start,
            errors: Errors::default(),
            nodes: Nodes::new(&config),
            parameters: ReceivedParameters::new(&config),
            teaching: false,
            teaching_waits_ms: 0,
            pump: false,
            store: Store::new(points),
            check: TrajectoryCheck::new(&config, 1, None),
            violation: None,
            trajectory: TrajectoryState::Null,
            clock: PathClock::default(),
            path: Path::BEGIN,
            braking_ms: None,
            motion: Motion::default(),
            slice_progress: SliceProgress::Begin,
            overtaking: [Overtaking::default(); HOST_LINES],
            records: ResponseQueues::new(),
            since_status_ms: 0,
            late_ticks: LateTicks::default(),
            status_frame: [0; STATUS_LEN],
            telemetry: Telemetry::default(),
            config,
        }
    }

    /// The device failed, and was reset because of it (J-12): an internal error that no other bit explains. It
    /// latches like any other (J-21). For the board to call before the first tick.
    pub fn raise_internal(&mut self) {
        self.errors.raise_device();
    }

    /// One millisecond, with a bounded amount of work whatever the inputs.
    pub fn tick(&mut self, inputs: &Inputs<'_>) -> Outputs {
        // What has come in.
        let before = self.state;
        self.nodes.take(inputs, &self.config, self.goal(), &self.motion.set.point.velocity);
        self.pump &= !self.nodes.gripper_lost();
        if self.late_ticks.count(inputs.missed_ticks) {
            self.errors.raise_device();
        }
        // A fault is known before a command that may clear it: a clear in this very tick does not hide it.
        self.check_errors(inputs);
        if self.errors.any() {
            self.enter(ControllerState::Error);
        }
        // In Start nothing is executed yet; the events are offered again.
        let host_done = if before == ControllerState::Start { 0 } else { self.serve_host(inputs) };

        // What state that makes. What persists is raised again, where a host may have cleared it.
        if !inputs.host.is_empty() {
            self.check_errors(inputs);
        }
        self.select_state();

        // What to do in it.
        let mut torque = match self.state {
            ControllerState::Start | ControllerState::Init | ControllerState::Error => {
                self.motion.release(&self.nodes);
                [0.0; JOINTS]
            }
            ControllerState::Teaching => self.teach(),
            ControllerState::HoldPos => self.hold(),
            ControllerState::Operate => self.operate(),
        };

        // An error found now zeroes the torque of this same tick.
        if self.errors.any() {
            self.enter(ControllerState::Error);
            torque = [0.0; JOINTS];
        }

        // What goes out.
        // Drives keep their last torque: taking it away comes before everything else.
        let new_error = self.state == ControllerState::Error && before != ControllerState::Error;
        let must_move = new_error || (before.has_torque() && !self.powered());
        let bus = self.nodes.frame(&self.config, self.goal(), torque, self.pump, must_move);
        self.observe(&torque);
        // J-22: 0 in Start and while an internal error is latched.
        let safety_output = self.state != ControllerState::Start && !self.errors.internal();
        let status = self.status_due(inputs.status_free);
        let mut record_line = None;
        if status {
            let record = self.records.pop();
            record_line = record.map(|(line, _)| line);
            self.status_frame = self.status(record.map_or(Response::NONE, |(_, record)| record)).emit();
        }
        Outputs { bus: Some(bus), safety_output, status, record_line, host_done }
    }

    /// The JtcStatus frame of the last tick whose outputs had `status` set; zeros before the first.
    pub fn status_frame(&self) -> &[u8; STATUS_LEN] {
        &self.status_frame
    }

    /// What the last tick computed.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Why the last segment or the last Execute was refused by the check of J-36; `None` when it was not.
    pub fn violation(&self) -> Option<&Violation> {
        self.violation.as_ref()
    }

    /// The settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Frames of the joint bus that were ignored because they were not understood (J-15).
    pub fn ignored_frames(&self) -> u32 {
        self.nodes.ignored
    }

    /// In a state that commands torque.
    pub(crate) fn powered(&self) -> bool {
        self.state.has_torque()
    }

    /// Where the nodes are wanted in the present state.
    fn goal(&self) -> Goal {
        match self.state {
            ControllerState::Start | ControllerState::Init => Goal::Ready,
            ControllerState::HoldPos | ControllerState::Operate | ControllerState::Teaching => Goal::Enabled,
            ControllerState::Error => Goal::Down,
        }
    }

    /// Errors from outside the control law; they latch (J-21).
    fn check_errors(&mut self, inputs: &Inputs<'_>) {
        if !inputs.safety_input {
            self.errors.raise_emergency_input();
        }
        self.errors.raise_can(self.nodes.can_flags(inputs, &self.config));
        self.errors.show_can(self.nodes.gripper_flags(&self.config));
        if self.nodes.external_error(self.powered()) {
            self.errors.raise_external_joints();
        }
    }

    /// Priority: Error, Init, Teaching, HoldPos, Operate.
    fn select_state(&mut self) {
        // Init ends with every node in ReadyToOperate; afterwards they may also be enabled.
        let initialised = self.parameters.missing() == 0
            && !self.nodes.clearing()
            && if self.powered() { !self.nodes.fallen_back() } else { self.nodes.all_ready(&self.config) };
        if initialised && !self.powered() && !self.parameters.holdable(self.nodes.positions(), &self.config) {
            // Received before the positions were known: the host has to send it again.
            self.parameters.withdraw_model();
            return self.enter(if self.errors.any() {
                ControllerState::Error
            } else {
                ControllerState::Init
            });
        }
        let next = if self.errors.any() || (self.state == ControllerState::Error && self.nodes.clearing()) {
            ControllerState::Error
        } else if !initialised {
            ControllerState::Init
        } else if self.teaching
            && (self.state == ControllerState::Teaching || self.motion.may_be_taught(&self.config))
        {
            // Accepted, it waits until every joint is held at rest: what the arm carries is found only then (J-25).
            ControllerState::Teaching
        } else if self.trajectory == TrajectoryState::Execute {
            ControllerState::Operate
        } else {
            ControllerState::HoldPos
        };
        self.enter(next);
    }

    pub(crate) fn enter(&mut self, next: ControllerState) {
        let last = core::mem::replace(&mut self.state, next);
        if last == next {
            return;
        }
        if matches!(next, ControllerState::Error | ControllerState::Init | ControllerState::Teaching) {
            // J-24: a trajectory is never resumed after these; it has to be sent again.
            self.store.clear();
            self.set_trajectory(TrajectoryState::Null);
        }
        if !matches!(next, ControllerState::HoldPos | ControllerState::Operate) {
            self.braking_ms = None;
        }
        match next {
            ControllerState::Error | ControllerState::Init | ControllerState::Start => {
                self.teaching = false;
                self.motion.release(&self.nodes);
                // A pump that does not run on is off until it is commanded again.
                self.pump &= self.nodes.gripper_keeps_part(&self.config);
            }
            ControllerState::HoldPos if last == ControllerState::Teaching => {
                self.motion.end_teaching(&self.nodes, &self.config, &self.parameters.pid);
            }
            ControllerState::Teaching => {
                self.motion.law.begin_teaching(&self.nodes, &self.config, &self.parameters.dynamics)
            }
            ControllerState::HoldPos | ControllerState::Operate => {}
        }
        self.motion.law.change_mode();
    }

    pub(crate) fn set_trajectory(&mut self, trajectory: TrajectoryState) {
        self.trajectory = trajectory;
        if matches!(trajectory, TrajectoryState::Null | TrajectoryState::Stop) {
            self.clock = PathClock::default();
        }
    }

    fn hold(&mut self) -> [f64; JOINTS] {
        // The wait ends: the operator no longer expects the arm to go soft then.
        self.teaching_waits_ms = if self.teaching { self.teaching_waits_ms.saturating_add(1) } else { 0 };
        self.teaching &= self.teaching_waits_ms < self.config.enable_timeout_ms;
        self.motion.latch(&self.nodes, &self.config);
        self.motion.set.hold(&self.config);
        self.control(ControlMode::Hold)
    }

    fn teach(&mut self) -> [f64; JOINTS] {
        self.motion.set.point = crate::SetPoint::still(*self.nodes.positions());
        self.control(ControlMode::Teach)
    }

    /// The control step in Operate: a function of its own, so that its instructions can be counted. On the path they are the
    /// same number in every tick.
    #[inline(never)]
    fn operate(&mut self) -> [f64; JOINTS] {
        self.motion.latch(&self.nodes, &self.config);
        let mode = self.path.mode();
        self.walk();
        self.control(mode)
    }

    /// The control law; returns the torque to command. Errors of the joints are acted upon, or raised.
    pub(crate) fn control(&mut self, mode: ControlMode) -> [f64; JOINTS] {
        // A joint that is faster than it may be is out of control: nothing to react to but by taking its torque away.
        self.errors.raise_joints(&self.motion.over_speed.watch(&self.nodes, &self.config));
        let (mut torque, mut errors) = self.compute(mode);
        if errors != [0; JOINTS] {
            if self.gives_way(&errors) {
                (torque, errors) = self.compute(ControlMode::Hold);
            } else if self.stops_on_path(mode, &errors) {
                errors = [0; JOINTS];
            }
            self.errors.raise_joints(&errors);
        }
        torque
    }

    /// Torques of the control law, and the joint errors found on the way.
    fn compute(&mut self, mode: ControlMode) -> ([f64; JOINTS], [u16; JOINTS]) {
        let braking = self.brake();
        let (nodes, config, parameters) = (&self.nodes, &self.config, self.parameters.control());
        self.motion.control(&LawInputs { mode, braking, nodes, config, parameters })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::POINTS_MAX;

    /// The controller with its trajectory, without the buffer of the host link.
    #[test]
    fn memory_fits_448_kib() {
        let bytes = size_of::<Controller<[RawPoint; POINTS_MAX]>>();
        assert_eq!(size_of::<[RawPoint; POINTS_MAX]>(), 432_000);
        assert!(bytes <= 448 * 1024, "{bytes} bytes");
    }

    /// An accepted teaching waits as long as enabling may take, and is over then: the operator no longer expects the arm to go soft.
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
}
