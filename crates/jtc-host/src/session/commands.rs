//! Simple commands.

use std::time::Duration;

use jtc_wire::{
    ALL_NODES, ControllerState, DataStatus, ExecCommand, FrameType, Status, TrajectoryState, fixed,
};

use super::{Session, not_allowed};
use crate::check::CheckedTrajectory;
use crate::error::{Error, LinkError, MotionError, StateError, accepted};
use crate::labels;
use crate::port::Port;

/// Maximum time until teaching begins, with a reserve. The controller waits up to 10 s until it holds all joints at
/// rest.
const TEACHING: Duration = Duration::from_secs(11);

/// Parameter that a controller needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Parameter {
    /// Friction table.
    FrictionTable,
    /// Friction polynomial.
    FrictionPolynomial,
    /// Gains.
    Pid,
    /// Kinematics and masses.
    ArmModel,
}

impl Parameter {
    /// Returns the name of the parameter for messages.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::FrictionTable => "friction table",
            Parameter::FrictionPolynomial => "friction polynomial",
            Parameter::Pid => "PID gains",
            Parameter::ArmModel => "arm model",
        }
    }

    fn use_default(self) -> FrameType {
        match self {
            Parameter::FrictionTable => FrameType::FrictionTableUseDefault,
            Parameter::FrictionPolynomial => FrameType::FrictionPolynomialUseDefault,
            Parameter::Pid => FrameType::PidParamUseDefault,
            Parameter::ArmModel => FrameType::ArmModelUseDefault,
        }
    }
}

impl<P: Port> Session<P> {
    /// Marks the start of a motion request. A shared line rejects a request that was made before another client's
    /// Stop. If a session is used for several motions, the caller must call this function before each motion. Without
    /// a call, the start of the session counts as the time of the request.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Port`] if the port fails.
    pub fn ask_to_move(&mut self) -> Result<(), LinkError> {
        Ok(self.port.ask_to_move()?)
    }

    /// Clears current errors of the controller itself and of the nodes in `nodes` (bits 0..6).
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if the controller rejects the command in its current state. Returns [`LinkError::NotConfirmed`],
    /// [`LinkError::NoLink`] and [`LinkError::Port`] for communication errors.
    pub fn clear(&mut self, jtc: bool, nodes: u8) -> Result<(), LinkError> {
        self.command(&fixed::clear_current_errors(jtc, nodes))
    }

    /// Like [`clear`](Self::clear), but returns `false` if the controller rejects the command because the fault of a
    /// node is still present (J-21).
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn clear_if_possible(&mut self, jtc: bool, nodes: u8) -> Result<bool, LinkError> {
        match self.clear(jtc, nodes) {
            Ok(()) => Ok(true),
            Err(LinkError::Refused { code: DataStatus::NotAllowed, .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Clears the current errors and the errors that occurred earlier.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn clear_occurred(&mut self) -> Result<(), LinkError> {
        self.command(&fixed::CLEAR_OCCURRED_ERRORS)
    }

    /// Clears the current errors of the controller and of all nodes, and the errors that occurred earlier.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn clear_all(&mut self) -> Result<(), LinkError> {
        self.clear(true, ALL_NODES)?;
        self.clear_occurred()
    }

    /// Resets the nodes in `nodes` (bits 0..6).
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn reset(&mut self, nodes: u8) -> Result<(), LinkError> {
        self.command(&fixed::reset_can_devices(nodes))
    }

    /// Switches teaching on (only in HoldPos) or off. Teaching begins when the arm is at rest and the controller holds the arm. This
    /// function waits until teaching begins.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`]. Returns [`StateError::Timeout`] if teaching does not begin because the arm does not come
    /// to rest. Returns [`StateError::Device`] if the controller reports an error.
    pub fn teach(&mut self, on: bool) -> Result<(), Error> {
        if on {
            return self.teach_until(|| false);
        }
        Ok(self.command(&fixed::empty(FrameType::TeachingModeDisable))?)
    }

    /// Ends teaching, even if another client has switched teaching on.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::teach`], except a denial by an agent. If the agent denies the request, it has
    /// already ended the teaching of the other client itself.
    pub fn end_teaching(&mut self) -> Result<(), Error> {
        match self.teach(false) {
            Err(Error::Link(LinkError::Denied { .. })) => Ok(()),
            ended => ended,
        }
    }

    /// Switches teaching on and waits until it begins. If teaching does not begin in time, or if `ended` returns
    /// `true`, the function switches teaching off again. Otherwise the arm could become compliant later, when the
    /// operator no longer expects this.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::teach`], and [`Error::Cancelled`] if the caller cancels.
    pub fn teach_until(&mut self, ended: impl Fn() -> bool) -> Result<(), Error> {
        self.introduce()?;
        self.read_host_timeout()?;
        self.presence.command(self.port.now());
        let begun = match self.command(&fixed::empty(FrameType::TeachingModeEnable)) {
            // The controller has rejected the request, so teaching was not switched on by this function. Teaching may
            // belong to another client, so it is not switched off here.
            Err(error) if !error.is_loss() => return Err(error.into()),
            Err(error) => Err(error.into()),
            Ok(()) => {
                self.presence.wait_for_teaching(true);
                let begun = self.wait_for_teaching(&ended);
                self.presence.wait_for_teaching(false);
                begun
            }
        };
        if begun.is_err() {
            // The caller receives the first error. The result of switching teaching off is ignored, because the controller accepts this
            // command in every state.
            let _ = self.teach(false);
        }
        begun
    }

    fn wait_for_teaching(&mut self, ended: impl Fn() -> bool) -> Result<(), Error> {
        let status = self.wait_for("teaching", TEACHING, |s| {
            s.state.is_in(&[ControllerState::Teaching, ControllerState::Error]) || ended()
        })?;
        let taught = self.without_error(status)?.state == ControllerState::Teaching;
        if taught && !ended() { Ok(()) } else { Err(Error::Cancelled) }
    }

    /// Switches the pump on or off.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn gripper(&mut self, pump: bool) -> Result<(), LinkError> {
        self.command(&fixed::gripper_control(pump))
    }

    /// Commands the controller to use its default for one parameter (J-54). The default is the value of the stored arm. If no arm is
    /// stored, the default is the built-in value.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::clear`].
    pub fn use_default(&mut self, parameter: Parameter) -> Result<(), LinkError> {
        self.command(&fixed::empty(parameter.use_default()))
    }

    /// Like [`use_default`](Self::use_default), for the friction polynomial, the gains and the arm model together.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::use_default`] for the first parameter that is not accepted.
    pub fn use_defaults(&mut self) -> Result<(), LinkError> {
        [Parameter::FrictionPolynomial, Parameter::Pid, Parameter::ArmModel]
            .into_iter()
            .try_for_each(|p| self.use_default(p))
    }

    /// Starts the trajectory that was just uploaded, from its first point. If the trajectory is paused, it continues at the point of the
    /// pause. **The arm moves.**
    ///
    /// # Errors
    ///
    /// Returns [`MotionError::NotUploaded`], before a frame is sent, if this session did not upload exactly this trajectory, or if the
    /// controller no longer has the trajectory. Returns [`LinkError::Refused`] if the controller does not start the trajectory because the
    /// arm is not at the first point (J-34) or not in position hold. Returns [`MotionError::LinkLost`] if no confirmation arrived; the arm
    /// may then be moving.
    pub fn execute(&mut self, checked: &CheckedTrajectory) -> Result<(), Error> {
        self.catch_up()?;
        if self.uploaded.as_ref().map(CheckedTrajectory::number) != Some(checked.number()) {
            return Err(MotionError::NotUploaded.into());
        }
        self.go()
    }

    /// Sends Execute without checking which trajectory the controller has.
    pub(super) fn go(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Execute, Status::is_executing)
    }

    /// Resumes after a pause. Checks the remainder of the trajectory again if settings or payload have changed since the first check. The
    /// session can check only a trajectory that it uploaded itself.
    ///
    /// # Errors
    ///
    /// Returns [`MotionError::RestRefused`], before Execute is sent, if the remainder of the trajectory no longer passes the check. Returns
    /// [`StateError::HeldStop`], before Execute is sent, while the cause of a held stop is not cleared. Returns [`MotionError::NotPaused`],
    /// before a frame is sent, if no motion is paused. Returns [`LinkError::Refused`] if the arm was moved after the pause. Returns
    /// [`MotionError::LinkLost`] if no confirmation arrived.
    pub fn resume(&mut self) -> Result<(), Error> {
        self.port.ask_to_resume().map_err(LinkError::Port)?;
        let status = self.fresh_status()?;
        let status = self.without_error(status)?;
        if status.trajectory != TrajectoryState::Pause {
            return Err(MotionError::NotPaused { state: status.state, trajectory: status.trajectory }.into());
        }
        if let Some(checked) = self.uploaded.clone()
            && self.has_extensions()
        {
            let device = self.device_config()?;
            checked
                .check_rest(&device, status.point)
                .map_err(|why| MotionError::RestRefused { point: status.point, why: Box::new(why) })?;
        }
        self.go()
    }

    /// Pauses the motion on the path.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if no motion is in progress. Returns [`MotionError::LinkLost`] if no confirmation arrived; the arm
    /// may then be moving.
    pub fn pause(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Pause, |s| s.trajectory == TrajectoryState::Pause)
    }

    /// Ends the trajectory. The next execution begins at the first point of the trajectory.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if no motion can be stopped. Returns [`MotionError::LinkLost`] if no confirmation arrived; the arm
    /// may then be moving.
    pub fn stop(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Stop, |s| s.trajectory == TrajectoryState::Stop)
    }

    /// Sends an execution command. Returns [`MotionError::LinkLost`] if the command is not confirmed, because the arm may then be moving.
    fn exec(&mut self, command: ExecCommand, reached: impl Fn(&Status) -> bool) -> Result<(), Error> {
        let stopping = command != ExecCommand::Execute;
        // Before a Stop or a Pause, no other frame is sent, because it would delay the command.
        if !stopping {
            self.introduce()?;
            self.read_host_timeout()?;
            self.presence.command(self.port.now());
        }
        let retries = self.statistics.retries;
        let mut record = match self.request(&fixed::exec(command)) {
            Ok(record) => record,
            // The status shows that the command was executed, so only its response record was lost.
            Err(LinkError::NotConfirmed { .. }) if !stopping && self.last.is_some_and(|s| reached(&s)) => {
                return Ok(());
            }
            Err(error) => return Err(self.link_lost(error, command == ExecCommand::Stop)),
        };
        if stopping && record.data == DataStatus::IncorrectValue {
            // Without an earlier extension request, the controller reports only the general code "incorrect value"
            // (J-51). A Stop or a Pause can be rejected only because of the controller's state, so the code is
            // replaced by the more specific code.
            record.data = DataStatus::NotAllowed;
        }
        if accepted(&record) {
            return Ok(());
        }
        // The confirmation of the first transmission was lost, so the command was sent again. The controller rejects the repeated command,
        // because the first command has already taken effect.
        if not_allowed(&record) && self.statistics.retries > retries && self.last.is_some_and(|s| reached(&s))
        {
            return Ok(());
        }
        Err(self.refused(record).into())
    }

    /// Adds the known facts about the motion to a link error that occurs while the arm moves or may move. An error
    /// that is a rejection by the controller is returned unchanged.
    pub(super) fn link_lost(&self, error: LinkError, stop_sent: bool) -> Error {
        if !error.is_loss() {
            return error.into();
        }
        MotionError::LinkLost { last: self.last.map(Box::new), stop_sent, source: Box::new(error) }.into()
    }

    /// Waits until the controller is in HoldPos. Returns an error at once if the controller reports errors.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::Device`] if the controller reports errors. Returns [`StateError::HeldStop`] while the cause of a held stop is
    /// not cleared. Returns [`StateError::Timeout`] if the controller is not in HoldPos within `timeout`. Also returns the errors of
    /// [`Session::next_status`].
    pub fn wait_hold(&mut self, timeout: Duration) -> Result<Status, Error> {
        let status = self.wait_for("HoldPos", timeout, |s| {
            s.state.is_in(&[ControllerState::HoldPos, ControllerState::Error])
        })?;
        self.without_error(status)
    }

    /// Waits until the controller holds the arm in HoldPos with all drives enabled. Drives of joints that are marked as absent need not be
    /// enabled. Returns an error at once if the controller reports errors. The positions in the returned status are measured. A trajectory
    /// starts at these positions.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::Device`] if the controller reports errors. Returns [`StateError::HeldStop`] while the cause of a held stop is
    /// not cleared. Returns [`StateError::Timeout`] if the arm is not held within `timeout`, for example because parameters are missing.
    /// Also returns the errors of [`Session::next_status`].
    pub fn wait_ready(&mut self, timeout: Duration) -> Result<Status, Error> {
        self.wait_ready_until(timeout, || false)
    }

    /// Like [`Session::wait_ready`], but stops waiting once `ended` returns `true`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::wait_ready`], and [`Error::Cancelled`] if the caller cancels.
    pub fn wait_ready_until(&mut self, timeout: Duration, ended: impl Fn() -> bool) -> Result<Status, Error> {
        let ready = |s: &Status| s.state == ControllerState::HoldPos && labels::is_held(s);
        let status = self.wait_for("HoldPos with all drives enabled", timeout, |s| {
            s.state == ControllerState::Error || ready(s) || ended()
        })?;
        let status = self.without_error(status)?;
        if ready(&status) { Ok(status) } else { Err(Error::Cancelled) }
    }

    fn without_error(&mut self, status: Status) -> Result<Status, Error> {
        self.without_held_stop(&status)?;
        if status.state == ControllerState::Error {
            return Err(StateError::Device { status: Box::new(status) }.into());
        }
        Ok(status)
    }
}
