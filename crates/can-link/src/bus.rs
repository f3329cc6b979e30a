//! The trait of all buses.

use std::time::Duration;

use crate::{CanError, CanFrame, ControllerState};

/// A member of a CAN bus.
///
/// Implementations deliver frames of every other member in the order of the bus, and none of their own.
pub trait CanBus {
    /// Puts a frame on the bus. A full transmit queue is waited for; it is no error unless it stays full for seconds, as on a
    /// bus where nobody acknowledges.
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError>;

    /// The next frame of another member; `None` when none came within `timeout`. Zero does not wait.
    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError>;

    /// How this member's controller gets on with the bus, as far as is known from what was received so far.
    fn state(&mut self) -> ControllerState {
        ControllerState::default()
    }

    /// How often this member's controller has left the bus, as far as is known from what was received so far. It may be back by
    /// now: what was sent meanwhile is lost all the same. Nothing is asked of the adapter; 0 where it does not report.
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
