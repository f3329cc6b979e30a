//! Functions that follow the execution of a trajectory to its end.

use std::time::Duration;

use jtc_wire::{ControllerState, ExecCommand, Status, TrajectoryState, fixed};

use super::Session;
use crate::error::{Error, LinkError, MotionError};
use crate::port::{Port, PortError};

/// Action that a callback requests. Continue and Cancel are always possible. All other actions are possible only
/// while the session follows a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flow {
    /// Continue unchanged.
    #[default]
    Continue,
    /// Pause on the path.
    Pause,
    /// Resume after a pause.
    Resume,
    /// Set the speed on the path (%), if the device supports it.
    Speed(u8),
    /// Stop the motion, and follow the motion until the arm is at rest.
    Stop,
    /// Return from the function at once. The session sends no Stop and no longer follows the motion, so the arm
    /// continues to move.
    Cancel,
}

/// Result of an execution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The motion reached its last point.
    Finished(Status),
    /// This client or another client stopped the motion before its end.
    Stopped(Status),
}

/// Maximum time from the confirmation of a command until a status shows its effect.
const SETTLE: Duration = Duration::from_millis(300);

impl<P: Port> Session<P> {
    /// Follows the execution that was just started. The callback `each` receives every status.
    ///
    /// If the link is lost during the motion, the function sends a Stop, because the controller may still receive frames. The returned
    /// error states that the arm may be moving.
    ///
    /// # Errors
    ///
    /// Returns [`MotionError::RunFault`] if the controller ended the motion with an error. Returns [`MotionError::HeldStop`] if the
    /// controller stopped the motion and holds the arm. Returns [`Error::Cancelled`] if `each` returned [`Flow::Cancel`]. Returns
    /// [`MotionError::LinkLost`] if data no longer arrive; the arm may then be moving.
    pub fn follow(&mut self, each: impl FnMut(&Status) -> Flow) -> Result<Outcome, Error> {
        self.follow_with(each, |_, _| {})
    }

    /// Like [`Session::follow`]. Calls `done` with each action that `each` requested, and with its result. If the controller rejects a new
    /// speed or a resume, the session continues to follow the motion.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::follow`].
    pub fn follow_with(
        &mut self,
        mut each: impl FnMut(&Status) -> Flow,
        mut done: impl FnMut(Flow, &Result<(), Error>),
    ) -> Result<Outcome, Error> {
        let start = self.port.now();
        let (mut begun, mut stopping) = (false, false);
        // Last point index before an error. The index is stored because the controller deletes the trajectory and its
        // point index after an error.
        let mut point = 0;
        let mut occurred = None;
        loop {
            let status = match self.next_status() {
                Ok(status) => status,
                Err(e) => return Err(self.lost_in_motion(e)),
            };
            begun |= status.is_executing() || self.port.now() - start > SETTLE;
            if status.state == ControllerState::Operate {
                point = status.point;
            }
            let flow = each(&status);
            if status.is_faulty() {
                return Err(MotionError::RunFault { point, status: Box::new(status) }.into());
            }
            let before = *occurred.get_or_insert(errors_occurred(&status));
            let held = status.is_held_stop() || errors_occurred(&status) != before;
            let ended = status.trajectory.is_in(&[TrajectoryState::Stop, TrajectoryState::Finish]);
            if status.trajectory == TrajectoryState::Pause && held || begun && ended && status.is_held_stop()
            {
                let cause = self.stop_cause();
                return Err(MotionError::HeldStop { point, before, status: Box::new(status), cause }.into());
            }
            match (status.trajectory.known(), status.state.known()) {
                (Some(TrajectoryState::Finish), _) if begun => return Ok(Outcome::Finished(status)),
                (Some(TrajectoryState::Stop), _) if begun => return Ok(Outcome::Stopped(status)),
                // The controller has deleted the trajectory, or has returned to Start or Init. Therefore the run has
                // failed.
                (Some(TrajectoryState::Null), _)
                | (_, Some(ControllerState::Start | ControllerState::Init))
                    if begun =>
                {
                    return Err(MotionError::RunFault { point, status: Box::new(status) }.into());
                }
                _ => {}
            }
            // After a requested Stop, the motion must not continue, so a Pause or Resume from the user is ignored. If
            // another client pauses the motion instead, the session sends the Stop again.
            let again = stopping && status.trajectory == TrajectoryState::Pause;
            let flow = match flow {
                _ if again => Flow::Stop,
                Flow::Pause | Flow::Resume if stopping => Flow::Continue,
                flow => flow,
            };
            let did = match flow {
                Flow::Continue => continue,
                Flow::Cancel => return Err(Error::Cancelled),
                Flow::Pause if status.is_executing() => unless_ended(self.pause()),
                Flow::Resume => self.resume(),
                Flow::Speed(percent) => self.set_speed(f64::from(percent) / 100.0),
                // An accepted Stop is not repeated, because the controller then decelerates to standstill without
                // further commands.
                Flow::Stop if !stopping || again => {
                    stopping = true;
                    unless_ended(self.stop())
                }
                Flow::Pause | Flow::Stop => Ok(()),
            };
            done(flow, &did);
            match (flow, did) {
                (_, Ok(())) => {}
                // If a resume or a new speed is rejected, the motion continues unchanged or stays paused. Therefore
                // the session continues to follow it.
                (
                    Flow::Resume,
                    Err(Error::Link(LinkError::Denied { .. } | LinkError::Port(PortError::Halted { .. }))),
                ) => {}
                (
                    Flow::Resume,
                    Err(Error::Motion(MotionError::NotPaused { .. } | MotionError::RestRefused { .. })),
                ) => {}
                (Flow::Speed(_), Err(Error::Link(LinkError::Port(error)))) => {
                    return Err(self.lost_in_motion(error.into()));
                }
                (Flow::Speed(_), Err(Error::Link(_))) => {}
                (_, Err(error)) => return Err(error),
            }
        }
    }

    /// Sends a Stop after the link is lost. The controller may still receive frames, and an arm that the host cannot
    /// observe should not move.
    fn lost_in_motion(&mut self, error: LinkError) -> Error {
        let sent =
            self.last.is_none_or(|s| s.is_executing()) && self.write(&fixed::exec(ExecCommand::Stop)).is_ok();
        self.link_lost(error, sent)
    }
}

/// Returns the errors of the joints that have occurred since the occurred errors were last cleared. These errors
/// include errors to which the controller itself reacts (J-66).
fn errors_occurred(status: &Status) -> [u16; 6] {
    status.joints.map(|joint| joint.internal_occurred)
}

/// Ignores two errors of a Pause or Stop that are not failures. First, the controller rejects the command because the
/// motion is already paused or has just ended. Second, the port blocks a Pause because another program has just sent
/// a Stop.
fn unless_ended(done: Result<(), Error>) -> Result<(), Error> {
    match done {
        Err(Error::Link(LinkError::Port(PortError::Halted { .. }))) => Ok(()),
        Err(Error::Link(LinkError::Refused { trajectory, .. }))
            if trajectory.is_in(&[
                TrajectoryState::Stop,
                TrajectoryState::Pause,
                TrajectoryState::Finish,
            ]) =>
        {
            Ok(())
        }
        other => other,
    }
}
