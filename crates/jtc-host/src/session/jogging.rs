//! Jogging from its begin to standstill.

use std::time::Duration;

use jtc_wire::{ControllerState, DataStatus, JOINTS, Status, TrajectoryState};

use super::Session;
use crate::error::{Error, LinkError, StateError};
use crate::port::halt::Halt;
use crate::port::{Port, Standstill};

/// How often a velocity is sent again: the controller forgets it after 200 ms (J-58).
pub const JOG_AGAIN: Duration = Duration::from_millis(50);
/// An arm comes to rest within this time.
const REST: Duration = Duration::from_secs(3);

impl<P: Port> Session<P> {
    /// Waits until joints may be jogged: those whose load has just been caught are not jogged yet. Anything else that forbids it is an
    /// error at once.
    ///
    /// # Errors
    ///
    /// [`StateError::HeldStop`] while the cause of one is not cleared; those of [`Session::jog`].
    pub fn settle_for_jog(&mut self) -> Result<(), Error> {
        self.settle_for_jog_until(|| false)
    }

    /// The same, and no more waiting once `ended` returns true.
    ///
    /// # Errors
    ///
    /// Those of [`Session::jog`]; [`Error::Cancelled`].
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

    /// Jogs at this velocity (rad/s) until `over`. **The arm moves.** [`Session::jog_to_rest`] belongs behind it.
    ///
    /// # Errors
    ///
    /// Those of [`Session::jog`].
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

    /// Jogs no more, and waits until every joint stands; `None` where one does not within 3 s.
    ///
    /// # Errors
    ///
    /// [`StateError::Device`] when the controller has released the arm, [`StateError::HeldStop`] when it has stopped it; those of the line.
    pub fn jog_to_rest(&mut self) -> Result<Option<Status>, Error> {
        // Refused where nothing is jogged any more, which is just as well.
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
                // A load may sink for longer than that; the controller has it.
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

    /// Takes statuses for this time.
    ///
    /// # Errors
    ///
    /// [`LinkError::Port`].
    pub fn pass(&mut self, time: Duration) -> Result<(), LinkError> {
        let end = self.now() + time;
        while self.now() < end {
            self.poll(end.saturating_sub(self.now()))?;
        }
        Ok(())
    }
}
