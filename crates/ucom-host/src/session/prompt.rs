//! Bus with a short timeout for received frames. The short timeout lets the owner of the bus check for requests
//! often. A stop therefore does not need to wait for a frame.

use std::time::Duration;

use can_link::{CanBus, CanError, CanFrame, ControllerState};

/// Longest wait for a received frame.
const WAIT: Duration = Duration::from_millis(5);

/// Wrapper of a bus with a receive timeout of at most 5 ms.
pub struct Prompt(pub Box<dyn CanBus + Send>);

impl CanBus for Prompt {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        self.0.receive(timeout.min(WAIT))
    }

    fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
        self.0.carries(frame)
    }

    fn state(&mut self) -> ControllerState {
        self.0.state()
    }

    fn times_bus_off(&self) -> u64 {
        self.0.times_bus_off()
    }
}
