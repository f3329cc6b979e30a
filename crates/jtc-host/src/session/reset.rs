//! Resets of nodes. A reset can remove the torque that holds the arm.

use jtc_bus::GRIPPER;
use jtc_wire::{Code, ControllerState};

use super::Session;
use crate::error::{Error, StateError};
use crate::labels;
use crate::port::Port;

/// Returns `true` if the arm has torque in this state, and if a reset of these nodes (bits 0..6) can remove the torque.
///
/// # Errors
///
/// Returns [`StateError::WouldFall`] if the arm moves and a joint is among the nodes.
pub fn reset_takes_torque(nodes: u8, state: Code<ControllerState>) -> Result<bool, StateError> {
    let moves = state.is_in(&[ControllerState::Operate, ControllerState::Teaching]);
    if moves && nodes & !(1 << GRIPPER) != 0 {
        return Err(StateError::WouldFall { nodes: labels::node_names(nodes).join(", "), state });
    }
    Ok(state.known().is_some_and(ControllerState::has_torque))
}

impl<P: Port> Session<P> {
    /// Resets nodes (bits 0..6). If the arm has torque, the caller must set `may_fall`.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::WouldFall`], before a frame is sent, if the arm moves and a joint is among the nodes. Returns
    /// [`StateError::MayFall`], before a frame is sent, if the arm can lose its torque and `may_fall` is not set. Also returns the errors
    /// of [`Session::reset`].
    pub fn reset_held(&mut self, nodes: u8, may_fall: bool) -> Result<(), Error> {
        let state = self.fresh_status()?.state;
        if reset_takes_torque(nodes, state)? && !may_fall {
            return Err(StateError::MayFall { nodes: labels::node_names(nodes).join(", "), state }.into());
        }
        Ok(self.reset(nodes)?)
    }
}
