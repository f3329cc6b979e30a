//! What the controller does about what it finds of a joint while it can still act (J-66), rather than take the torque away.
//!
//! | found | reaction |
//! |---|---|
//! | a torque that is no number; with `torque_reaction` 1 an overloaded joint | release: the torque of all joints becomes zero (J-21) |
//! | anything else in Teaching | none: what it adds to the model is bounded (J-25) |
//! | a joint whose swing grows while its load is caught: its gains make the loop unstable | it yields (J-68) |
//! | an overloaded joint that has not settled since it was enabled | it lowers its load (J-70) |
//! | a joint that is pushed, or overloaded by its feedback torque; a position error | it yields (J-68), the others stop |
//! | a joint that is overloaded otherwise: on the path | path time is held back (J-75); where that does not help the arm stops on its path |
//! | the same on the approach, or in a jog | the arm stops, or its jog ends (J-33) |
//! | the same at rest, or still in motion when a stop has taken its time | it lowers its load |
//! | a limit of the path | the arm stops on its path, or its jog ends |
//!
//! The first row that applies to a joint wins. All but the first end in a held stop (J-69): the arm is held, the cause is shown, and
//! nothing moves until the host clears it.
use jtc_wire::{ExecCommand, RawPoint};

use crate::controller::Controller;
use crate::motion::{ControlMode, Found};
use crate::{JOINTS, TrajectoryState, joint_error};

/// Limits of the path.
const PATH: u16 =
    joint_error::POSITION | joint_error::VELOCITY | joint_error::ACCELERATION | joint_error::FRICTION_TABLE;

/// What the controller does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reaction {
    /// The torque of all joints becomes zero.
    Release,
    /// The joint yields.
    Yield,
    /// The joint lowers its load.
    Lower,
    /// The arm stops where it is commanded to move.
    Stop,
}

/// The reaction to what was found of a joint, and its cause as joint errors.
fn reaction(found: &Found, mode: ControlMode, releases: bool) -> Option<(Reaction, u16)> {
    let Found { errors, overloaded, pushed, strained, settled, unstable } = *found;
    let torque = joint_error::TORQUE;
    if errors & torque != 0 || (overloaded && releases) {
        Some((Reaction::Release, torque))
    } else if mode == ControlMode::Teach {
        None
    } else if unstable {
        Some((Reaction::Yield, torque))
    } else if overloaded && !settled {
        Some((Reaction::Lower, torque))
    } else if (pushed && !releases) || (overloaded && strained) {
        Some((Reaction::Yield, torque))
    } else if errors & joint_error::POSITION_ERROR != 0 {
        Some((Reaction::Yield, joint_error::POSITION_ERROR))
    } else if overloaded {
        Some((if mode.moves() { Reaction::Stop } else { Reaction::Lower }, torque))
    } else if errors & PATH != 0 {
        Some((Reaction::Stop, errors & PATH))
    } else {
        None
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Reacts to what the control law has found of the joints. Returns the joint errors that release the arm.
    pub(crate) fn react(&mut self, mode: ControlMode, found: &[Found; JOINTS]) -> [u16; JOINTS] {
        let (mut release, mut causes) = ([0; JOINTS], [0; JOINTS]);
        let (mut yields, mut lowers) = ([false; JOINTS], [false; JOINTS]);
        for (j, found) in found.iter().enumerate() {
            let Some((reaction, cause)) = reaction(found, mode, self.config.torque_release) else {
                continue;
            };
            match reaction {
                Reaction::Release => release[j] = cause,
                Reaction::Stop if cause == joint_error::TORQUE && self.hold_back() => {}
                _ => causes[j] = cause,
            }
            (yields[j], lowers[j]) = (reaction == Reaction::Yield, reaction == Reaction::Lower);
        }
        if causes == [0; JOINTS] || release != [0; JOINTS] {
            return release;
        }
        let before = self.braking_ms;
        self.hold_stop(&causes);
        if yields != lowers {
            // The begin of a stop has computed the inertia already: one mass matrix in a tick.
            if self.braking_ms == before {
                self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
            }
            self.motion.begin_yields(&yields, &lowers, &self.config);
        }
        release
    }

    /// A held stop begins (J-69): what moves comes to rest, and the arm is held.
    pub(crate) fn hold_stop(&mut self, causes: &[u16; JOINTS]) {
        self.errors.hold_joints(causes, self.config.protective_stop_latches);
        if self.trajectory == TrajectoryState::Execute && self.phase.leave().is_none() {
            self.leave_path(ExecCommand::Pause);
        }
        if self.motion.set.jogging() {
            self.motion.set.end_jog();
            self.extensions.refuse_jogs();
        }
    }

    /// The controller still reacts: it is too early to clear the cause (J-69).
    pub(crate) fn is_reacting(&self) -> bool {
        let moves = self.trajectory == TrajectoryState::Execute || self.motion.set.jogging();
        self.motion.law.is_yielding() || (self.errors.held_stop() && moves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HELD: Found = Found {
        errors: 0,
        overloaded: false,
        pushed: false,
        strained: false,
        settled: true,
        unstable: false,
    };

    #[test]
    fn j66_the_first_row_that_applies_wins() {
        use Reaction::*;
        let (torque, error, path) = (joint_error::TORQUE, joint_error::POSITION_ERROR, joint_error::VELOCITY);
        let (hold, follow) = (ControlMode::Hold, ControlMode::Follow);
        let overloaded = Found { overloaded: true, ..HELD };
        let rows = [
            (HELD, hold, None),
            (Found { errors: torque, ..HELD }, hold, Some((Release, torque))),
            (Found { errors: torque | error, unstable: true, ..overloaded }, follow, Some((Release, torque))),
            (Found { unstable: true, settled: false, ..overloaded }, hold, Some((Yield, torque))),
            (Found { settled: false, strained: true, ..overloaded }, hold, Some((Lower, torque))),
            (Found { pushed: true, strained: true, ..HELD }, follow, Some((Yield, torque))),
            (Found { strained: true, ..overloaded }, follow, Some((Yield, torque))),
            (Found { strained: true, ..HELD }, hold, None),
            (Found { errors: error | path, ..HELD }, follow, Some((Yield, error))),
            (Found { errors: error, ..overloaded }, follow, Some((Yield, error))),
            (overloaded, follow, Some((Stop, torque))),
            (overloaded, ControlMode::Approach, Some((Stop, torque))),
            (overloaded, hold, Some((Lower, torque))),
            (Found { errors: path, ..HELD }, follow, Some((Stop, path))),
            (Found { errors: joint_error::POSITION, ..HELD }, follow, Some((Stop, joint_error::POSITION))),
        ];
        for (found, mode, expected) in rows {
            assert_eq!(reaction(&found, mode, false), expected, "{found:?} {mode:?}");
            let taught = reaction(&found, ControlMode::Teach, false);
            assert_eq!(taught, expected.filter(|(reaction, _)| *reaction == Release), "{found:?}");
            assert_eq!(found.is_any(), expected.is_some(), "{found:?}");
            // With the manual's words torque alone releases, and is no push before that.
            let released = reaction(&found, mode, true);
            if found.overloaded {
                assert_eq!(released, Some((Release, torque)), "{found:?}");
            } else if found.pushed {
                assert_eq!(released, None, "{found:?}");
            } else {
                assert_eq!(released, expected, "{found:?}");
            }
        }
    }
}
