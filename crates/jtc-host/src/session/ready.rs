//! Function that waits until an arm is ready to move.

use std::time::Duration;

use jtc_wire::{ControllerState, Status};

use super::Session;
use crate::error::{Error, StateError};
use crate::port::Port;
use crate::{held_stop, labels};

/// Maximum time until the drives are enabled. The first enable of the drives takes 4 s.
pub const BRING_UP: Duration = Duration::from_secs(15);

impl<P: Port> Session<P> {
    /// If the controller is starting up, waits until it holds the arm with all drives enabled. Returns the status that the check of a
    /// motion needs. Before each wait, the function calls `waits` with a description of the awaited state.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::HeldStop`] if the cause of a held stop is not cleared. Returns [`StateError::NotReady`] if the controller is
    /// not starting up. Returns [`StateError::Absent`] if joints are marked as absent. Returns [`StateError::EncoderJumped`] if an encoder
    /// has jumped. Returns [`StateError::Device`] if the controller reports an error. Returns [`StateError::Timeout`] if the arm is not
    /// ready in time. Returns [`Error::Cancelled`] once `ended` returns `true`. Also returns communication errors.
    pub fn ready_to_move(
        &mut self,
        mut waits: impl FnMut(&'static str),
        ended: impl Fn() -> bool,
    ) -> Result<Status, Error> {
        let unless_ended = |status: Status| if ended() { Err(Error::Cancelled) } else { Ok(status) };
        let mut status = self.fresh_status()?;
        if status.is_coming_up() && status.jtc_init == 0 && status.errors == 0 {
            waits("the drives hold the arm");
            status = self.wait_for("HoldPos", BRING_UP, |s| {
                s.state.is_in(&[ControllerState::HoldPos, ControllerState::Error]) || ended()
            })?;
            if status.state == ControllerState::Error {
                return Err(StateError::Device { status: Box::new(status) }.into());
            }
        }
        let mut status = unless_ended(status)?;
        self.without_held_stop(&status)?;
        if status.state != ControllerState::HoldPos {
            return Err(StateError::NotReady { status: Box::new(status) }.into());
        }
        let joints = labels::absent(&status);
        if !joints.is_empty() {
            return Err(StateError::Absent { joints }.into());
        }
        let jumped = self.info()?.and_then(|info| info.reactions).map_or(0, |reactions| reactions.jumped);
        let joints = held_stop::joints(jumped);
        if !joints.is_empty() {
            return Err(StateError::EncoderJumped { joints }.into());
        }
        if !labels::is_held(&status) {
            waits("all drives are enabled");
            status = self.wait_for("all drives enabled", BRING_UP, |s| labels::is_held(s) || ended())?;
        }
        unless_ended(status)
    }
}
