//! The simple commands.

use std::time::Duration;

use jtc_wire::{
    ALL_NODES, ControllerState, DataStatus, ExecCommand, FrameType, Status, TrajectoryState, fixed,
};

use super::{Session, not_allowed};
use crate::check::CheckedTrajectory;
use crate::error::{Error, LinkError, MotionError, StateError, accepted};
use crate::port::Port;
use crate::words;

/// Longest that a controller waits with teaching until the arm is held, and a little more.
const TEACHING: Duration = Duration::from_secs(11);

/// What the controller wants to be given.
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
    /// Its name in messages.
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
    /// Somebody asks for a motion now: one who has a session for longer than for one motion calls this before each of them. On a line that is
    /// shared with others nothing moves the arm that was asked for before somebody else stopped it; what asks is the session's beginning, or
    /// the last call of this.
    ///
    /// # Errors
    ///
    /// [`LinkError::Port`].
    pub fn ask_to_move(&mut self) -> Result<(), LinkError> {
        Ok(self.port.ask_to_move()?)
    }

    /// Clears current errors: the controller's own, and those of the nodes in `nodes` (bits 0..6).
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`] when the controller does not allow it in its state; [`LinkError::NotConfirmed`], [`LinkError::NoLink`] and
    /// [`LinkError::Port`] of the line.
    pub fn clear(&mut self, jtc: bool, nodes: u8) -> Result<(), LinkError> {
        self.command(&fixed::clear_current_errors(jtc, nodes))
    }

    /// Like [`clear`](Self::clear), but returns false when the controller refuses it because nothing can be cleared yet (J-21): the fault of
    /// a node is still there.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn clear_if_possible(&mut self, jtc: bool, nodes: u8) -> Result<bool, LinkError> {
        match self.clear(jtc, nodes) {
            Ok(()) => Ok(true),
            Err(LinkError::Refused { code: DataStatus::NotAllowed, .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Clears current and occurred errors.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn clear_occurred(&mut self) -> Result<(), LinkError> {
        self.command(&fixed::CLEAR_OCCURRED_ERRORS)
    }

    /// Clears the errors of the controller and of all nodes, and those that have occurred.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn clear_all(&mut self) -> Result<(), LinkError> {
        self.clear(true, ALL_NODES)?;
        self.clear_occurred()
    }

    /// Resets the nodes in `nodes` (bits 0..6).
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn reset(&mut self, nodes: u8) -> Result<(), LinkError> {
        self.command(&fixed::reset_can_devices(nodes))
    }

    /// Teaching on (only in HoldPos) or off. It begins once the arm is held at rest; this waits for it.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`]; [`StateError::Timeout`] when teaching does not begin, because the arm does not come to rest;
    /// [`StateError::Device`] when the controller has an error instead.
    pub fn teach(&mut self, on: bool) -> Result<(), Error> {
        if on {
            return self.teach_until(|| false);
        }
        Ok(self.command(&fixed::empty(FrameType::TeachingModeDisable))?)
    }

    /// Ends teaching, whoever has switched it on.
    ///
    /// # Errors
    ///
    /// Those of [`Session::teach`], except a denial: an agent that denies this has ended the teaching of its other client itself.
    pub fn end_teaching(&mut self) -> Result<(), Error> {
        match self.teach(false) {
            Err(Error::Link(LinkError::Denied { .. })) => Ok(()),
            ended => ended,
        }
    }

    /// Teaching on, and no more waiting for it once `ended` returns true. Teaching that does not begin is switched off again: the controller
    /// would begin it as soon as the arm rests, when nobody reckons with an arm that gives way.
    ///
    /// # Errors
    ///
    /// Those of [`Session::teach`]; [`Error::Cancelled`].
    pub fn teach_until(&mut self, ended: impl Fn() -> bool) -> Result<(), Error> {
        self.introduce()?;
        self.read_host_timeout()?;
        self.presence.command(self.port.now());
        let begun = match self.command(&fixed::empty(FrameType::TeachingModeEnable)) {
            // It does not teach, or for somebody else.
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
            // The first error is the one to report; what is accepted in every state needs no answer here.
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

    /// Pump on or off.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn gripper(&mut self, pump: bool) -> Result<(), LinkError> {
        self.command(&fixed::gripper_control(pump))
    }

    /// Commands the controller to use its default of one parameter.
    ///
    /// # Errors
    ///
    /// Those of [`Session::clear`].
    pub fn use_default(&mut self, parameter: Parameter) -> Result<(), LinkError> {
        self.command(&fixed::empty(parameter.use_default()))
    }

    /// Commands the controller to use its defaults: friction polynomial, gains and arm model.
    ///
    /// # Errors
    ///
    /// Those of [`Session::use_default`], of the first that is not accepted.
    pub fn use_defaults(&mut self) -> Result<(), LinkError> {
        [Parameter::FrictionPolynomial, Parameter::Pid, Parameter::ArmModel]
            .into_iter()
            .try_for_each(|p| self.use_default(p))
    }

    /// Starts the trajectory that was just uploaded, from its first point; after a pause it goes on from there. **The arm moves.**
    ///
    /// # Errors
    ///
    /// [`MotionError::NotUploaded`], and nothing is sent, unless this session uploaded exactly this trajectory and the controller still
    /// holds it. [`LinkError::Refused`] when the controller does not start it: the arm is not at the first point (J-34), or is not held.
    /// [`MotionError::LinkLost`] when no confirmation came: the arm may be moving.
    pub fn execute(&mut self, checked: &CheckedTrajectory) -> Result<(), Error> {
        self.catch_up()?;
        if self.uploaded.as_ref().map(CheckedTrajectory::number) != Some(checked.number()) {
            return Err(MotionError::NotUploaded.into());
        }
        self.go()
    }

    /// Execute, whatever the controller holds.
    pub(super) fn go(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Execute, Status::is_executing)
    }

    /// Goes on after a pause. What remains of a trajectory that this session uploaded is checked again where settings or payload were
    /// changed since its check; of another one the session knows nothing to check.
    ///
    /// # Errors
    ///
    /// [`MotionError::RestRefused`], and nothing is sent, when what remains does not pass any more.
    /// [`StateError::HeldStop`], and nothing is sent, while the cause of a held stop is not cleared.
    /// [`MotionError::NotPaused`], and nothing is sent, when nothing is paused; [`LinkError::Refused`] when the arm was moved since;
    /// [`MotionError::LinkLost`] when no confirmation came.
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

    /// Pauses on the path.
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`] when nothing moves; [`MotionError::LinkLost`] when no confirmation came: the arm may be moving.
    pub fn pause(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Pause, |s| s.trajectory == TrajectoryState::Pause)
    }

    /// Ends the trajectory; the next execution begins at its start.
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`] when there is nothing to stop; [`MotionError::LinkLost`] when no confirmation came: the arm may be moving.
    pub fn stop(&mut self) -> Result<(), Error> {
        self.exec(ExecCommand::Stop, |s| s.trajectory == TrajectoryState::Stop)
    }

    /// Without a confirmation it is not known whether the arm moves: [`MotionError::LinkLost`] states it.
    fn exec(&mut self, command: ExecCommand, reached: impl Fn(&Status) -> bool) -> Result<(), Error> {
        let stopping = command != ExecCommand::Execute;
        // Nothing comes before a Stop or a Pause.
        if !stopping {
            self.introduce()?;
            self.read_host_timeout()?;
            self.presence.command(self.port.now());
        }
        let retries = self.statistics.retries;
        let mut record = match self.request(&fixed::exec(command)) {
            Ok(record) => record,
            // Only its record was lost.
            Err(LinkError::NotConfirmed { .. }) if !stopping && self.last.is_some_and(|s| reached(&s)) => {
                return Ok(());
            }
            Err(error) => return Err(self.link_lost(error, command == ExecCommand::Stop)),
        };
        if stopping && record.data == DataStatus::IncorrectValue {
            // For want of an introduction: there is nothing to be wrong about a Stop but its time (J-51).
            record.data = DataStatus::NotAllowed;
        }
        if accepted(&record) {
            return Ok(());
        }
        // Sent again after its confirmation was lost, it is refused although the first one did its work.
        if not_allowed(&record) && self.statistics.retries > retries && self.last.is_some_and(|s| reached(&s))
        {
            return Ok(());
        }
        Err(self.refused(record).into())
    }

    /// An error of the link while the arm moves or may move, with what is known about the motion; a refusal as it is.
    pub(super) fn link_lost(&self, error: LinkError, stop_sent: bool) -> Error {
        if !error.is_loss() {
            return error.into();
        }
        MotionError::LinkLost { last: self.last.map(Box::new), stop_sent, source: Box::new(error) }.into()
    }

    /// Waits until the controller is in HoldPos; an error at once when it reports errors.
    ///
    /// # Errors
    ///
    /// [`StateError::Device`] when the controller reports errors, [`StateError::HeldStop`] while the cause of one is not cleared,
    /// [`StateError::Timeout`] when it is not in HoldPos in this time;
    /// those of [`Session::next_status`].
    pub fn wait_hold(&mut self, timeout: Duration) -> Result<Status, Error> {
        let status = self.wait_for("HoldPos", timeout, |s| {
            s.state.is_in(&[ControllerState::HoldPos, ControllerState::Error])
        })?;
        self.without_error(status)
    }

    /// Waits until the controller holds the arm in HoldPos with every drive enabled, but those of joints that are set absent; an error at once when it reports errors. The
    /// positions of the status are then measured ones, the pose that a run starts from.
    ///
    /// # Errors
    ///
    /// [`StateError::Device`] when the controller reports errors, [`StateError::HeldStop`] while the cause of one is not cleared,
    /// [`StateError::Timeout`] when it does not hold the arm in this time (it
    /// may still lack parameters); those of [`Session::next_status`].
    pub fn wait_ready(&mut self, timeout: Duration) -> Result<Status, Error> {
        self.wait_ready_until(timeout, || false)
    }

    /// The same, and no more waiting once `ended` returns true.
    ///
    /// # Errors
    ///
    /// Those of [`Session::wait_ready`]; [`Error::Cancelled`].
    pub fn wait_ready_until(&mut self, timeout: Duration, ended: impl Fn() -> bool) -> Result<Status, Error> {
        let ready = |s: &Status| s.state == ControllerState::HoldPos && words::is_held(s);
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
