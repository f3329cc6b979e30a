//! Following an execution to its end.

use std::time::Duration;

use jtc_wire::Status;

use super::Session;
use crate::Error;
use crate::port::Port;

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
    pub fn follow(&mut self, mut each: impl FnMut(&Status) -> Flow) -> Result<Outcome, Error> {
        let start = self.port.now();
        let mut begun = false;
        // On an error the controller forgets the trajectory, and its point with it.
        let mut point = 0;
        loop {
            let status = self.next_status()?;
            begun |= status.tes == 3 || self.port.now() - start > SETTLE;
            if status.fsm == 3 {
                point = status.point;
            }
            let flow = each(&status);
            if status.fsm == 5 || status.errors != 0 {
                return Err(Error::RunFault { point, status: Box::new(status) });
            }
            match (status.tes, status.fsm) {
                (4, _) if begun => return Ok(Outcome::Finished(status)),
                (1, _) if begun => return Ok(Outcome::Stopped(status)),
                // The trajectory is gone, or nodes fell out of operation.
                (0, _) | (_, 0 | 1) if begun => {
                    return Err(Error::RunFault { point, status: Box::new(status) });
                }
                _ => {}
            }
            match flow {
                Flow::Continue => {}
                Flow::Pause if status.tes == 3 => self.pause()?,
                Flow::Resume if status.tes == 2 => self.execute()?,
                Flow::Stop => self.stop_gently()?,
                Flow::Pause | Flow::Resume => {}
                Flow::Cancel => return Err(Error::Cancelled),
            }
        }
    }

    /// Stop, which may cross with the end of the motion.
    fn stop_gently(&mut self) -> Result<(), Error> {
        match self.stop() {
            Err(Error::Refused { tes: 1 | 4, .. }) => Ok(()),
            other => other,
        }
    }
}
