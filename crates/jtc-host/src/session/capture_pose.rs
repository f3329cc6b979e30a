//! Capture of the arm's pose at rest.

use std::time::Duration;

use jtc_wire::{Joint, Status};

use super::Session;
use crate::error::{Error, StateError};
use crate::port::Port;
use crate::{labels, sample};

/// Maximum movement (rad) during [`WATCHED`] at which an arm counts as at rest. In this time, the slowest jog moves
/// the arm twice as far.
const STILL: f64 = 1.2e-3;
/// Time for which the arm is observed. A slow jog does not appear in any field of a single status, but it changes the
/// positions during this time.
const WATCHED: Duration = Duration::from_millis(250);

impl<P: Port> Session<P> {
    /// Observes the arm and returns its status if it is at rest. The positions in the status can be saved as a pose.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::Moving`] if the arm moves. Returns [`StateError::NotMeasured`] if the position of a joint is unknown. Also
    /// returns the errors of [`Session::next_status`].
    pub fn standing(&mut self) -> Result<Status, Error> {
        let begin = self.fresh_status()?;
        let (start, mut now) = (self.now(), begin);
        loop {
            stands(&begin, &now)?;
            if self.now() - start >= WATCHED {
                return Ok(now);
            }
            now = self.next_status()?;
        }
    }
}

fn stands(begin: &Status, now: &Status) -> Result<(), StateError> {
    let moving = |what: String| Err(StateError::Moving { what });
    // At its beginning, at its end and at a reversal, a motion has the speed 0. Only the execution state shows that
    // the arm is still in motion.
    if now.is_executing() {
        return moving("the arm is on the path of a trajectory".into());
    }
    for joint in Joint::ALL {
        let j = joint.index();
        if !sample::is_measured(now, j) || labels::is_absent(now, j) {
            return Err(StateError::NotMeasured { joint });
        }
    }
    if let Some((joint, speed)) = labels::moving_joint(now) {
        return moving(format!("{joint} moves at {speed:.2} rad/s"));
    }
    for joint in Joint::ALL {
        let j = joint.index();
        let way = now.positions()[j] - begin.positions()[j];
        if way.abs() > STILL {
            return moving(format!("{joint} moves slowly: {:.1} mrad since the check began", way * 1e3));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use host_kit::{Diagnose as _, ErrorKind};
    use jtc_wire::TrajectoryState;

    use super::*;

    /// A slow jog does not appear in any field of one status. The arm counts as moving because the positions of two
    /// statuses differ.
    #[test]
    fn an_arm_that_is_jogged_slowly_does_not_stand() {
        let at = |q: f32| {
            let mut status = Status::default();
            status.joints[3].position = q;
            status.joints.iter_mut().for_each(|joint| joint.velocity = 0.01);
            status
        };
        stands(&at(0.5), &at(0.5005)).unwrap();
        for (begin, now) in [(0.5, 0.5025), (0.5025, 0.5)] {
            let error = stands(&at(begin), &at(now)).unwrap_err();
            assert!(error.to_string().starts_with("joint 4 moves slowly"), "{error}");
        }
        let executing = Status { trajectory: TrajectoryState::Execute.into(), ..at(0.5) };
        assert_eq!(stands(&executing, &executing).unwrap_err().diagnosis().kind, ErrorKind::Refused);
        // A pose can also be saved while a motion is paused, if the arm is at rest.
        stands(&at(0.5), &Status { trajectory: TrajectoryState::Pause.into(), ..at(0.5) }).unwrap();
    }
}
