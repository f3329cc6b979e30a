//! Operator for tests. The operator uses the small host to start the controller, to upload and execute trajectories,
//! and to wait in virtual time.
use core::fmt;

use jtc_bus::{JOINTS, NodeState};
use jtc_core::{ControllerState, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameStatus, FrameType, RawPoint, Response};

use crate::config::SimConfig;
use crate::host::{self, Listener};
use crate::world::World;

/// Reason why an action of the operator failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OperatorError {
    /// A condition was not fulfilled in time.
    Late {
        /// Condition for which the operator waited.
        waited_for: &'static str,
        /// Duration of the wait, ms.
        ms: u64,
        /// State of the controller at the end of the wait.
        state: ControllerState,
        /// Error word of the controller at the end of the wait.
        errors: u16,
    },
    /// The controller rejected a frame.
    Refused(Response),
}

impl fmt::Display for OperatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Late { waited_for, ms, state, errors } => {
                write!(
                    f,
                    "{waited_for}: not within {ms} ms; the controller is in {state:?}, errors 0x{errors:04X}"
                )
            }
            Self::Refused(response) => write!(f, "refused: {response:?}"),
        }
    }
}

impl std::error::Error for OperatorError {}

/// An operator with a simulation.
pub struct Operator {
    /// Simulation that the operator uses.
    pub world: World,
    /// Collector of the bytes that the device sends.
    pub listener: Listener,
}

impl Operator {
    /// Creates an operator for a simulation that has just been switched on.
    pub fn new(config: SimConfig) -> Self {
        Self { world: World::new(config), listener: Listener::default() }
    }

    /// Returns the state of the controller.
    pub fn state(&self) -> ControllerState {
        self.world.telemetry().state
    }

    /// Simulates one millisecond.
    pub fn step(&mut self) {
        self.world.step();
        self.listener.listen(&mut self.world);
    }

    /// Simulates `ms` milliseconds.
    pub fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    /// Simulates until `done` returns `true`, but at most `ms` milliseconds. If the time ends first, the error contains
    /// `waited_for` as the description of the condition.
    pub fn wait(
        &mut self,
        waited_for: &'static str,
        ms: u64,
        mut done: impl FnMut(&World) -> bool,
    ) -> Result<(), OperatorError> {
        for _ in 0..ms {
            if done(&self.world) {
                return Ok(());
            }
            self.step();
        }
        if done(&self.world) {
            return Ok(());
        }
        let telemetry = self.world.telemetry();
        Err(OperatorError::Late { waited_for, ms, state: telemetry.state, errors: telemetry.errors })
    }

    /// Sends a frame and waits for the controller's response, which must report no error.
    pub fn ask(&mut self, frame: &[u8]) -> Result<(), OperatorError> {
        let response = self.response(frame)?;
        let good = response.status == FrameStatus::NoError && response.data == DataStatus::NoError;
        if good { Ok(()) } else { Err(OperatorError::Refused(response)) }
    }

    /// Sends a frame and waits for the controller's response.
    pub fn response(&mut self, frame: &[u8]) -> Result<Response, OperatorError> {
        self.listener.responses.clear();
        self.world.host_write(frame);
        // The limit is long, because the transmission of a long frame takes time.
        for _ in 0..8_000 {
            self.step();
            if !self.listener.responses.is_empty() {
                return Ok(self.listener.responses.remove(0));
            }
        }
        let telemetry = self.world.telemetry();
        Err(OperatorError::Late {
            waited_for: "response",
            ms: 8_000,
            state: telemetry.state,
            errors: telemetry.errors,
        })
    }

    /// Sends the default parameters and waits until every joint is enabled and holds its position.
    pub fn bring_up(&mut self) -> Result<(), OperatorError> {
        self.world.host_write(&host::use_defaults());
        self.wait_for_hold(12_000)
    }

    /// Waits until every joint is enabled and holds its position.
    pub fn wait_for_hold(&mut self, ms: u64) -> Result<(), OperatorError> {
        self.wait("HoldPos with all joints enabled", ms, |world| {
            world.telemetry().state == ControllerState::HoldPos
                && world.node_states()[..JOINTS] == [NodeState::ENABLED; JOINTS]
        })
    }

    /// Sends a trajectory. Returns an error if the controller rejects a segment.
    pub fn upload(&mut self, points: &[RawPoint], step_ms: u16) -> Result<(), OperatorError> {
        for segment in host::trajectory(points, step_ms, 113) {
            self.ask(&segment)?;
        }
        self.wait("trajectory complete", 100, |world| world.telemetry().trajectory == TrajectoryState::Stop)
    }

    /// Executes the uploaded trajectory until it is finished.
    pub fn execute(&mut self, ms: u64) -> Result<(), OperatorError> {
        self.ask(&host::exec(ExecCommand::Execute))?;
        self.wait("end of the trajectory", ms, |world| {
            world.telemetry().trajectory == TrajectoryState::Finish
        })
    }

    /// Clears all errors and waits until the controller holds the arm again.
    pub fn recover(&mut self) -> Result<(), OperatorError> {
        self.ask(&host::clear_all())?;
        self.wait_for_hold(15_000)
    }

    /// Starts Teaching.
    pub fn teach(&mut self) -> Result<(), OperatorError> {
        self.ask(&host::frame(FrameType::TeachingModeEnable, &[]))?;
        self.wait("Teaching", 600, |world| world.telemetry().state == ControllerState::Teaching)
    }
}
