//! Following an execution to its end.

use std::time::Duration;

use jtc_wire::{ControllerState, ExecCommand, Status, TrajectoryState, fixed};

use super::Session;
use crate::error::{Error, LinkError, MotionError};
use crate::port::{Port, PortError};

/// What a callback wants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    #[default]
    Continue,
    /// Pause on the path (only while following).
    Pause,
    /// Go on after a pause (only while following).
    Resume,
    /// Another speed on the path, in percent (only while following, and where the device can).
    Speed(u8),
    /// Stop the motion and follow it to standstill (only while following).
    Stop,
    /// Leave at once; a motion goes on without us.
    Cancel,
}

/// How an execution ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// At its last point.
    Finished(Status),
    /// Stopped on the way, here or by somebody else.
    Stopped(Status),
}

/// A confirmed command shows in the status within this time.
const SETTLE: Duration = Duration::from_millis(300);

impl<P: Port> Session<P> {
    /// Follows the execution that was just started. `each` sees every status.
    ///
    /// When the link is lost on the way, a stop is sent that may still arrive, and the error states that the arm may be moving.
    ///
    /// # Errors
    ///
    /// [`MotionError::RunFault`] when the controller ended the motion with an error, [`MotionError::HeldStop`] when it stopped it and holds
    /// the arm, [`Error::Cancelled`] when `each` left it, [`MotionError::LinkLost`] when nothing is received any more: the arm
    /// may be moving.
    pub fn follow(&mut self, each: impl FnMut(&Status) -> Flow) -> Result<Outcome, Error> {
        self.follow_with(each, |_, _| {})
    }

    /// The same; `done` is called with each thing that `each` wanted and what came of it: a speed or a resume that was refused does not end
    /// the motion.
    ///
    /// # Errors
    ///
    /// Those of [`Session::follow`].
    pub fn follow_with(
        &mut self,
        mut each: impl FnMut(&Status) -> Flow,
        mut done: impl FnMut(Flow, &Result<(), Error>),
    ) -> Result<Outcome, Error> {
        let start = self.port.now();
        let (mut begun, mut stopping) = (false, false);
        // On an error the controller forgets the trajectory, and its point with it.
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
                // The trajectory is gone, or nodes fell out of operation.
                (Some(TrajectoryState::Null), _)
                | (_, Some(ControllerState::Start | ControllerState::Init))
                    if begun =>
                {
                    return Err(MotionError::RunFault { point, status: Box::new(status) }.into());
                }
                _ => {}
            }
            // A motion that is being stopped is stopped, whatever key comes then and whoever pauses it.
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
                // Once accepted it needs no repetition: the controller slows down to standstill by itself.
                Flow::Stop if !stopping || again => {
                    stopping = true;
                    unless_ended(self.stop())
                }
                Flow::Pause | Flow::Stop => Ok(()),
            };
            done(flow, &did);
            match (flow, did) {
                (_, Ok(())) => {}
                // The motion goes on as it was, or stays paused, and is followed.
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

    /// Nothing comes back any more; what goes out may still arrive, and an arm that nobody follows had better stand.
    fn lost_in_motion(&mut self, error: LinkError) -> Error {
        let sent =
            self.last.is_none_or(|s| s.is_executing()) && self.write(&fixed::exec(ExecCommand::Stop)).is_ok();
        self.link_lost(error, sent)
    }
}

/// Errors of the joints that have occurred: what the controller acted upon by itself adds to them (J-66).
fn errors_occurred(status: &Status) -> [u16; 6] {
    status.joints.map(|joint| joint.internal_occurred)
}

/// A pause or stop may cross with the end of the motion, or a pause with the Stop of another program: it is refused then, and that is no
/// failure.
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
