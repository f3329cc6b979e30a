//! Jogging, from the start of the motion to standstill.

use std::time::Duration;

use jtc_wire::{ControllerState, DataStatus, JOINTS, Status, TrajectoryState};

use super::Session;
use crate::error::{Error, LinkError, StateError};
use crate::port::halt::Halt;
use crate::port::{Port, Standstill};

/// Interval at which the session repeats a jog velocity. The controller drops a velocity after 200 ms (J-58).
pub const JOG_AGAIN: Duration = Duration::from_millis(50);
/// Maximum time that an arm needs to come to rest.
const REST: Duration = Duration::from_secs(3);

impl<P: Port> Session<P> {
    /// Waits until joints may be jogged. After the drives are enabled, the controller rejects jogging until it holds
    /// the arm at rest. If the controller rejects jogging for another reason, returns an error at once.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::HeldStop`] while the cause of a held stop is not cleared. Also returns the errors of
    /// [`Session::jog`].
    pub fn settle_for_jog(&mut self) -> Result<(), Error> {
        self.settle_for_jog_until(|| false)
    }

    /// Like [`Session::settle_for_jog`], but stops waiting once `ended` returns `true`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::jog`], and [`Error::Cancelled`] if the caller cancels.
    pub fn settle_for_jog_until(&mut self, ended: impl Fn() -> bool) -> Result<(), Error> {
        let end = self.now() + REST;
        loop {
            if ended() {
                return Err(Error::Cancelled);
            }
            if let Some(status) = self.last().copied() {
                self.without_held_stop(&status)?;
            }
            match self.jog(&[0.0; JOINTS]) {
                Err(Error::Link(LinkError::Refused {
                    code: DataStatus::NotAllowed,
                    state,
                    trajectory,
                    ..
                })) if state == ControllerState::HoldPos
                    && trajectory != TrajectoryState::Pause
                    && self.now() < end =>
                {
                    self.pass(JOG_AGAIN)?;
                }
                done => return done,
            }
        }
    }

    /// Jogs at these joint velocities (rad/s) until `over` returns `true`. **The arm moves.** Call
    /// [`Session::jog_to_rest`] afterwards.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::jog`].
    pub fn jog_while(
        &mut self,
        velocity: &[f64; JOINTS],
        mut over: impl FnMut(&Self) -> bool,
    ) -> Result<(), Error> {
        while !over(self) {
            self.jog(velocity)?;
            self.pass(JOG_AGAIN)?;
        }
        Ok(())
    }

    /// Stops jogging and waits until every joint is at rest. Returns `None` if a joint is not at rest within 3 s.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::Device`] if the controller has switched the torque off. Returns [`StateError::HeldStop`] if the controller is
    /// in a held stop. Also returns communication errors.
    pub fn jog_to_rest(&mut self) -> Result<Option<Status>, Error> {
        // A rejection is ignored. The controller rejects this frame only if no joint is being jogged, and then the
        // arm does not need to be stopped.
        match self.jog(&[0.0; JOINTS]) {
            Ok(()) | Err(Error::Link(LinkError::Refused { .. } | LinkError::NoExtension { .. })) => {}
            Err(error) => return Err(error),
        }
        let (end, mut standstill) = (self.now() + REST, Standstill::after(Halt::Pause));
        loop {
            let status = self.next_status()?;
            if status.state == ControllerState::Error {
                return Err(StateError::Device { status: Box::new(status) }.into());
            }
            standstill.see(self.now(), &status);
            let late = self.now() > end;
            if late || standstill.is_reached() {
                // If a joint still lowers a load at this time, the controller is in a held stop, which is returned as
                // an error.
                self.without_held_stop(&status)?;
            }
            if standstill.is_reached() {
                return Ok(Some(status));
            }
            if late {
                return Ok(None);
            }
        }
    }

    /// Receives statuses for the duration `time`.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Port`] if the port fails.
    pub fn pass(&mut self, time: Duration) -> Result<(), LinkError> {
        let end = self.now() + time;
        while self.now() < end {
            self.poll(end.saturating_sub(self.now()))?;
        }
        Ok(())
    }
}
