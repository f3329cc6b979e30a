//! Memory and state changes of the controller (J-20 to J-25).
use jtc_wire::{RawPoint, STATUS_LEN};

use crate::config::Config;
use crate::errors::Errors;
use crate::execution::phase::Phase;
use crate::extension::state::Extensions;
use crate::host::line_upload::LineUpload;
use crate::host::priority::Priority;
use crate::host::slices::SliceProgress;
use crate::host_parameters::HostParameters;
use crate::last_stop::LastStop;
use crate::motion::Motion;
use crate::nodes::{Goal, Nodes};
use crate::response_queue::{HOST_LINES, ResponseQueues};
use crate::states::{Conditions, next_state};
use crate::telemetry::Observed;
use crate::tick_overruns::TickOverruns;
use crate::trajectory::check::{TrajectoryCheck, Violation};
use crate::trajectory::path::PathClock;
use crate::trajectory::store::Store;
use crate::{ControllerState, TrajectoryState};

/// Joint trajectory controller. `M` is the memory for the trajectory, with space for [`crate::POINTS_MAX`] points.
///
/// The parts of the controller that have a state are separate modules: `nodes` (the bus), `host_parameters`, `store` (trajectory), `motion`
/// (control law) and `errors`. `Controller` connects these parts. [`Controller::tick`] executes the steps of the figure in the manual from
/// top to bottom.
#[derive(Clone, Debug)]
pub struct Controller<M> {
    pub(crate) config: Config,
    pub(crate) state: ControllerState,
    pub(crate) errors: Errors,
    pub(crate) nodes: Nodes,
    // Parameters and commands that the controller has received from the host.
    pub(crate) parameters: HostParameters,
    pub(crate) teaching: bool,
    /// Time for which an accepted request for Teaching has waited, ms. Teaching begins when the controller holds the
    /// arm.
    pub(crate) teaching_waits_ms: u32,
    pub(crate) pump: bool,
    // Store of the trajectory. The next fields belong to its execution.
    pub(crate) store: Store<M>,
    pub(crate) check: TrajectoryCheck,
    pub(crate) violation: Option<Violation>,
    pub(crate) trajectory: TrajectoryState,
    pub(crate) clock: PathClock,
    pub(crate) phase: Phase,
    /// Ticks since a pause or stop was commanded on the path (J-33). `None` if the arm is not braking.
    pub(crate) braking_ms: Option<u16>,
    /// Ticks since the safety input began to stop a motion. When the motion has stopped, the controller switches the
    /// torque off (J-22).
    pub(crate) safety_stop_ms: Option<u16>,
    pub(crate) motion: Motion,
    /// Cause of the last held stop (J-69).
    pub(crate) last_stop: LastStop,
    // Progress of the present host command. The next fields belong to the link to the host.
    pub(crate) slice_progress: SliceProgress,
    pub(crate) priorities: [Priority; HOST_LINES],
    pub(crate) uploads: [LineUpload; HOST_LINES],
    pub(crate) records: ResponseQueues,
    pub(crate) since_status_ms: u16,
    pub(crate) tick_overruns: TickOverruns,
    pub(crate) status_frame: [u8; STATUS_LEN],
    pub(crate) observed: Observed,
    pub(crate) extensions: Extensions,
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Creates a controller in state Start. In the first tick, the state changes to Init.
    pub fn new(config: Config, points: M) -> Self {
        Self {
            state: ControllerState::Start,
            errors: Errors::default(),
            nodes: Nodes::new(&config),
            parameters: HostParameters::new(&config),
            teaching: false,
            teaching_waits_ms: 0,
            pump: false,
            store: Store::new(points),
            check: TrajectoryCheck::new(&config, 1, None),
            violation: None,
            trajectory: TrajectoryState::Null,
            clock: PathClock::default(),
            phase: Phase::BEGIN,
            braking_ms: None,
            safety_stop_ms: None,
            motion: Motion::default(),
            last_stop: LastStop::default(),
            slice_progress: SliceProgress::Begin,
            priorities: [Priority::default(); HOST_LINES],
            uploads: [LineUpload::default(); HOST_LINES],
            records: ResponseQueues::new(),
            since_status_ms: 0,
            tick_overruns: TickOverruns::default(),
            status_frame: [0; STATUS_LEN],
            observed: Observed::default(),
            extensions: Extensions::new(),
            config,
        }
    }

    /// Raises an internal error of the device itself, not of a joint or of the bus. The board calls this function
    /// before the first tick, if the device has failed and was therefore reset (J-12). The error latches like any
    /// other error (J-21).
    pub fn raise_internal(&mut self) {
        self.errors.raise_device();
    }

    /// Returns the JtcStatus frame of the last tick whose outputs had `status` set. Returns zeros before the first status.
    pub fn status_frame(&self) -> &[u8; STATUS_LEN] {
        &self.status_frame
    }

    /// Returns the reason why the check of J-36 refused the last segment or the last Execute. Returns `None` if the
    /// check did not refuse it.
    pub fn violation(&self) -> Option<&Violation> {
        self.violation.as_ref()
    }

    /// Returns the settings of the controller.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Returns the number of frames on the joint bus that were ignored because they could not be decoded (J-15).
    pub fn ignored_frames(&self) -> u32 {
        self.nodes.ignored
    }

    /// Returns `true` in a state in which the controller commands torque.
    pub(crate) fn powered(&self) -> bool {
        self.state.has_torque()
    }

    /// Returns the state that the controller requests from the nodes in its present state.
    pub(crate) fn goal(&self) -> Goal {
        match self.state {
            ControllerState::Start | ControllerState::Init => Goal::Ready,
            ControllerState::HoldPos | ControllerState::Operate | ControllerState::Teaching => Goal::Enabled,
            ControllerState::Error => Goal::Down,
        }
    }

    /// Selects the controller state of this tick.
    pub(crate) fn choose_state(&mut self) {
        let conditions = self.conditions();
        self.enter(next_state(self.state, &conditions));
    }

    /// Evaluates the conditions that determine the controller state of this tick.
    fn conditions(&mut self) -> Conditions {
        let clearing = self.nodes.clearing();
        // Init ends when every node is in ReadyToOperate. After Init, the nodes may also be enabled.
        let mut initialised = self.parameters.missing() == 0
            && !clearing
            && if self.powered() { !self.nodes.fallen_back() } else { self.nodes.all_ready(&self.config) };
        if initialised && !self.powered() && !self.parameters.holdable(self.nodes.positions(), &self.config) {
            // With this model, the torque limits cannot hold the arm. The model was not checked earlier, because it
            // arrived before the positions were known. The host must send it again.
            self.parameters.withdraw_model();
            initialised = false;
        }
        Conditions {
            error: self.errors.any(),
            clearing,
            initialised,
            teaching: self.teaching,
            // J-60: Teaching waits until the whole payload has been blended into the model. Before that, the
            // controller cannot determine the load that the model does not contain.
            teachable: self.teaching
                && self.parameters.blend_left_ms() == 0
                && self.motion.may_be_taught(&self.config, self.errors.held_stop(), self.teaching_waits_ms),
            execute: self.trajectory == TrajectoryState::Execute,
        }
    }

    pub(crate) fn enter(&mut self, next: ControllerState) {
        let last = core::mem::replace(&mut self.state, next);
        if last == next {
            return;
        }
        if matches!(next, ControllerState::Error | ControllerState::Init | ControllerState::Teaching) {
            // J-24: the controller never resumes a trajectory after Error, Init or Teaching, so the host must send it again.
            self.store.clear();
            self.set_trajectory(TrajectoryState::Null);
        }
        if !matches!(next, ControllerState::HoldPos | ControllerState::Operate) {
            self.braking_ms = None;
        }
        match next {
            ControllerState::Error | ControllerState::Init | ControllerState::Start => {
                self.end_trial();
                self.teaching = false;
                self.motion.release(&self.nodes);
                self.errors.end_held_stop();
                // If the gripper does not keep its workpiece, the pump stays off until the host switches it on again.
                self.pump &= self.nodes.gripper_keeps_part(&self.config);
            }
            ControllerState::HoldPos if last == ControllerState::Teaching => {
                self.motion.end_teaching(&self.nodes, &self.config, &self.parameters.pid);
            }
            ControllerState::Teaching => {
                self.motion.law.begin_teaching(&self.nodes, &self.config);
            }
            ControllerState::HoldPos | ControllerState::Operate => {}
        }
        if last == ControllerState::Teaching {
            // After Teaching, the model torque also contains the torque that decelerates the arm. Therefore no part
            // of the torque may have a step, including the model torque.
            self.motion.law.change_whole_torque();
        } else {
            self.motion.law.change_mode();
        }
    }

    pub(crate) fn set_trajectory(&mut self, trajectory: TrajectoryState) {
        self.trajectory = trajectory;
        if matches!(trajectory, TrajectoryState::Null | TrajectoryState::Stop) {
            self.clock = PathClock::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::ControlMode;
    use crate::{JOINTS, POINTS_MAX};

    /// Checks the size of the controller without the trajectory, because this part must fit into the fast memory of the board.
    #[test]
    fn memory_beside_the_trajectory_fits_40_kib() {
        let bytes = size_of::<Controller<[RawPoint; POINTS_MAX]>>() - size_of::<[RawPoint; POINTS_MAX]>();
        assert_eq!(size_of::<[RawPoint; POINTS_MAX]>(), 432_000);
        assert!(bytes <= 40 * 1024, "{bytes} bytes");
    }

    fn holding() -> Controller<[RawPoint; 4]> {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.state = ControllerState::HoldPos;
        controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        controller.motion.set.hold_for_test();
        controller.motion.law.find_loads_for_test();
        controller
    }

    /// Teaching begins when it was requested, the model contains the whole payload, and the arm is held with known loads.
    #[test]
    fn j25_j60_each_condition_alone_delays_teaching() {
        for (teaching, blends, jogs, teachable) in [
            (true, false, false, true),
            (false, false, false, false),
            (true, true, false, false),
            (true, false, true, false),
            (false, true, false, false),
        ] {
            let mut controller = holding();
            controller.teaching = teaching;
            if blends {
                controller.parameters.change_payload(&Config::avena(), 1.0);
            }
            if jogs {
                controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
            }
            let conditions = controller.conditions();
            assert_eq!(conditions.teachable, teachable, "{teaching} {blends} {jogs}");
        }
    }

    /// The last torque consists of 8 N·m from the model and 4 N·m for friction. After Teaching, the next torque
    /// begins at the sum of 12 N·m. After other states, only the 4 N·m for friction continue, because a step of the
    /// model torque is allowed.
    #[test]
    fn j25_j44_after_teaching_no_part_of_the_torque_steps() {
        for (last, whole) in [(ControllerState::Teaching, true), (ControllerState::Operate, false)] {
            let mut controller = holding();
            controller.state = last;
            (controller.motion.law.torque[1].model, controller.motion.law.torque[1].friction) = (8.0, 4.0);
            controller.enter(ControllerState::HoldPos);
            controller.control(ControlMode::Hold);
            let torque = controller.motion.law.torque[1];
            let correction = torque.sum() - torque.model;
            let (continued, expected) = if whole { (torque.sum(), 12.0) } else { (correction, 4.0) };
            assert!((continued - expected).abs() < 1e-9, "{last:?}: {continued}");
            assert!((torque.model - 8.0).abs() > 0.1, "the torque of the model would step: {torque:?}");
        }
    }
}
