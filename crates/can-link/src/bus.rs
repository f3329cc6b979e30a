//! The trait that all buses implement.

use std::time::Duration;

use crate::{CanError, CanFrame, ControllerState};

/// A member of a CAN bus.
///
/// `receive` returns the frames of all other members in the order in which they were on the bus. The function never
/// returns the member's own frames.
pub trait CanBus {
    /// Sends a frame. Waits while the transmit queue is full. Returns an error if the queue stays full for several
    /// seconds, for example because no other member acknowledges frames.
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError>;

    /// Returns the next frame of another member, or `None` if none arrived within `timeout`. With a timeout of zero,
    /// the call does not wait.
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError>;

    /// Returns an error if this bus can never carry the frame. `send` returns the same error. The check sends nothing.
    fn carries(&self, _frame: &CanFrame) -> Result<(), CanError> {
        Ok(())
    }

    /// Returns the state of this member's CAN controller, derived from the frames received so far.
    fn state(&mut self) -> ControllerState {
        ControllerState::default()
    }

    /// Returns how many times this member's CAN controller has been bus-off, derived from the frames received so far.
    /// If the number has increased, frames were lost, even if the controller is active again. `times_bus_off` does
    /// not query the adapter. The number is 0 if the adapter does not report bus-off.
    fn times_bus_off(&self) -> u64 {
        0
    }
}

macro_rules! what_leads_to_a_bus_is_one {
    ($($pointer:ty),+) => {$(
        impl<B: CanBus + ?Sized> CanBus for $pointer {
            fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
                (**self).send(frame)
            }
            fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
                (**self).receive(timeout)
            }
            fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
                (**self).carries(frame)
            }
            fn state(&mut self) -> ControllerState {
                (**self).state()
            }
            fn times_bus_off(&self) -> u64 {
                (**self).times_bus_off()
            }
        }
    )+};
}

what_leads_to_a_bus_is_one!(&mut B, Box<B>);
