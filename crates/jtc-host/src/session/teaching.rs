//! Recording of a motion for which the operator guides the arm by hand.
use std::ops::ControlFlow;
use std::time::Duration;

use jtc_wire::ControllerState;

use crate::Session;
use crate::error::{Error, StateError};
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Records the positions of the joints in Teaching until `ended` returns `true` or `sample` returns
    /// [`ControlFlow::Break`].
    ///
    /// `ended` receives the time since the start of the recording. `sample` receives the positions (rad) of each
    /// status, and the time since the start of the recording. This function does not begin or end Teaching.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError`](crate::LinkError) if no status arrives, and [`StateError::TeachingFault`] if the
    /// controller reports errors. Returns [`StateError::TeachingEnded`] if Teaching ends, for example because of a
    /// Stop of another program.
    pub fn record_teaching(
        &mut self,
        ended: impl Fn(Duration) -> bool,
        mut sample: impl FnMut(Duration, [f64; 6]) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        let start = self.now();
        while !ended(self.now() - start) {
            let status = self.next_status()?;
            if status.is_faulty() {
                return Err(StateError::TeachingFault { status: Box::new(status) }.into());
            }
            let time = self.now() - start;
            if status.state == ControllerState::Teaching {
                if sample(time, status.positions()).is_break() {
                    break;
                }
            } else if !ended(time) {
                return Err(StateError::TeachingEnded { state: status.state }.into());
            }
        }
        Ok(())
    }
}
