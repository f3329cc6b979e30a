//! Reactions of the controller to findings about a joint (J-66), for cases in which the controller need not switch
//! the torque off.
//!
//! | finding | reaction |
//! |---|---|
//! | a torque of NaN; an overloaded joint if `torque_reaction` is 1 | release: the torque of all joints becomes zero (J-21) |
//! | any other finding in Teaching | none: Teaching adds a bounded torque, and ends if a hand moves a joint too fast (J-25) |
//! | an unstable loop: torque jumping between limits, or a growing swing | earlier or softer gains are used; the joint yields (J-68) |
//! | the same joint is unstable again within 500 ms | release |
//! | an overloaded joint that has not settled since it was enabled | the joint lowers its load (J-70) |
//! | a joint that is pushed, or overloaded by its feedback torque; a position error | the joint yields (J-68), the other joints stop |
//! | any other overloaded joint, on the path or the approach | path time is held back (J-75); if the overload continues, the arm stops |
//! | any other overloaded joint, in a jog | the jog ends (J-33) |
//! | any other overloaded joint, at rest, or still moving at the end of the time for a stop | the joint lowers its load |
//! | a set value outside a limit of the path | the arm stops on its path, or its jog ends |
//!
//! The first row that applies to a joint is used. A joint *lowers its load* if its torque limit cannot hold the load:
//! the joint then sinks slowly. All reactions except releasing the arm and holding back path time end in a held stop
//! (J-69). In a held stop, the arm is held, the cause is shown, and the arm does not move until the host clears the
//! stop.
mod held_stop;

use jtc_wire::{RawPoint, StopCause, StopKind};

use crate::controller::Controller;
use crate::motion::{ControlMode, Found};
use crate::parameters::PidGains;
use crate::{JOINTS, TrajectoryState, joint_error};

/// Joint errors that show a violated limit of the path.
const PATH: u16 =
    joint_error::POSITION | joint_error::VELOCITY | joint_error::ACCELERATION | joint_error::FRICTION_TABLE;

/// Reaction of the controller to the findings about a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reaction {
    /// The torque of all joints becomes zero.
    Release,
    /// The joint yields.
    Yield,
    /// The joint lowers its load.
    Lower,
    /// The arm stops if it executes a commanded motion.
    Stop,
}

/// Returns the reaction to the findings of a joint, the cause of the reaction, and the joint errors of this cause. `again` is `true` if the
/// joint was already unstable shortly before.
fn reaction(
    found: &Found,
    mode: ControlMode,
    releases: bool,
    again: bool,
) -> Option<(Reaction, StopKind, u16)> {
    let Found { errors, overloaded, pushed, strained, settled, unstable } = *found;
    let torque = joint_error::TORQUE;
    if errors & torque != 0 || (overloaded && releases) {
        Some((Reaction::Release, StopKind::Overload, torque))
    } else if mode == ControlMode::Teach {
        None
    } else if unstable && again {
        Some((Reaction::Release, StopKind::Unstable, torque))
    } else if unstable {
        Some((Reaction::Yield, StopKind::Unstable, torque))
    } else if overloaded && !settled {
        Some((Reaction::Lower, StopKind::Overload, torque))
    } else if (pushed && !releases) || (overloaded && strained) {
        // If the push is visible in the feedback torque, the cause is `Push`. If only the speed of the joint shows
        // the push, the cause is `Shove`.
        Some((Reaction::Yield, if strained { StopKind::Push } else { StopKind::Shove }, torque))
    } else if errors & joint_error::POSITION_ERROR != 0 {
        Some((Reaction::Yield, StopKind::PositionError, joint_error::POSITION_ERROR))
    } else if overloaded {
        Some((if mode.moves() { Reaction::Stop } else { Reaction::Lower }, StopKind::Overload, torque))
    } else if errors & PATH != 0 {
        Some((Reaction::Stop, StopKind::of_limit(errors), errors & PATH))
    } else {
        None
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Reacts to the findings of the control law. Returns the joint errors that release the arm.
    pub(crate) fn react(&mut self, mode: ControlMode, found: &[Found; JOINTS]) -> [u16; JOINTS] {
        let (mut release, mut causes, mut first) = ([0; JOINTS], [0; JOINTS], None);
        let (mut yields, mut lowers) = ([false; JOINTS], [false; JOINTS]);
        // Masks of the joints that fail with their gains, on trial or not (J-71), and among these of the joints with
        // an unstable control loop.
        let (mut failed, mut unstable) = (0u8, 0u8);
        // With a loop over the index, the compiler can see that the index is in range.
        for j in 0..JOINTS {
            let again = self.parameters.trial.again(j);
            // A joint that yields has limited torque. An unstable control loop of such a joint therefore counts only
            // if the joint was already unstable shortly before.
            let found =
                Found { unstable: found[j].unstable && (again || !self.motion.law.yields(j)), ..found[j] };
            let Some((reaction, kind, cause)) = reaction(&found, mode, self.config.torque_release, again)
            else {
                continue;
            };
            let fails = reaction == Reaction::Yield || (reaction == Reaction::Lower && !found.settled);
            failed |= u8::from(fails) << j;
            unstable |= u8::from(fails && found.unstable) << j;
            match reaction {
                Reaction::Release => release[j] = cause,
                Reaction::Stop if cause == joint_error::TORQUE && self.hold_back() => {}
                _ => {
                    causes[j] = cause;
                    first = first.or(Some(kind));
                }
            }
            (yields[j], lowers[j]) = (reaction == Reaction::Yield, reaction == Reaction::Lower);
        }
        let Some(kind) = first.filter(|_| release == [0; JOINTS]) else { return release };
        let before = self.braking_ms;
        if let Some((kind, gains)) =
            self.parameters.trial.fails(failed, unstable, &self.parameters.pid, self.config.delay_ticks)
        {
            self.use_other_gains(&gains);
            let joint = failed.trailing_zeros() as usize;
            self.keep_cause(self.cause(kind, joint, 0.0, 0.0));
            self.rest_and_hold(&causes);
        } else {
            self.hold_stop(&causes, kind);
        }
        if yields != lowers {
            // If a stop has begun in this tick, the inertia of the arm is already computed. A tick has no time to
            // compute a second mass matrix.
            if self.braking_ms == before {
                self.motion.ramp.begin(&self.nodes, &self.config, &self.parameters.dynamics);
            }
            self.motion.begin_yields(&yields, &lowers, &self.config);
        }
        release
    }

    /// Replaces the gains by gains that the controller has chosen (J-66, J-71). These are the gains before a failed
    /// trial, or softer gains.
    fn use_other_gains(&mut self, gains: &[PidGains; JOINTS]) {
        self.parameters.pid = *gains;
        self.motion.change_gains(gains);
        self.extensions.forget_hash();
    }

    /// Ends a trial of gains (J-71) when the controller stops holding the arm, and restores the earlier gains. The
    /// gains on trial have not held the arm long enough, so the controller must not enable the arm again with them.
    pub(crate) fn end_trial(&mut self) {
        let Some(gains) = self.parameters.trial.end() else { return };
        self.parameters.pid = gains;
        self.extensions.forget_hash();
        self.keep_cause(StopCause { kind: StopKind::Gains, ..StopCause::default() });
    }

    /// Returns `true` if the controller is still reacting to a finding, so that the host must not clear the cause yet (J-69).
    pub(crate) fn is_reacting(&self) -> bool {
        let moves = self.trajectory == TrajectoryState::Execute || self.motion.set.jogging();
        self.motion.law.is_yielding() || (self.errors.held_stop() && (moves || self.motion.set.is_led()))
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::ControllerState;

    use super::*;
    use crate::Config;
    use crate::nodes::Nodes;

    const HELD: Found = Found {
        errors: 0,
        overloaded: false,
        pushed: false,
        strained: false,
        settled: true,
        unstable: false,
    };

    #[test]
    fn j66_a_loop_that_is_unstable_again_releases_the_arm() {
        let unstable = Found { unstable: true, ..HELD };
        for mode in [ControlMode::Hold, ControlMode::Follow] {
            assert_eq!(
                reaction(&unstable, mode, false, true),
                Some((Reaction::Release, StopKind::Unstable, joint_error::TORQUE))
            );
            assert_eq!(reaction(&HELD, mode, false, true), None, "it has to be so again");
        }
    }

    const NO_JOINT: [bool; JOINTS] = [false; JOINTS];

    /// Returns a controller that holds an arm at rest.
    fn holding() -> Controller<[RawPoint; 4]> {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        controller.state = ControllerState::HoldPos;
        controller
    }

    /// Returns findings in which joint 2 has `found`, and the other joints have no findings.
    const fn second(found: Found) -> [Found; JOINTS] {
        [HELD, found, HELD, HELD, HELD, HELD]
    }

    /// Begins a trial of gains that are half as high as the present gains. Returns the gains before the trial.
    fn try_gains(controller: &mut Controller<[RawPoint; 4]>) -> [PidGains; JOINTS] {
        let before = controller.parameters.pid;
        controller.parameters.pid.iter_mut().for_each(|gains| gains.kp *= 0.5);
        controller.parameters.trial.begin(&before, &controller.parameters.pid);
        before
    }

    /// During a trial of gains (J-71), the new gains are the cause if a joint yields, or if a joint is overloaded
    /// before it has settled. The controller then restores the earlier gains. An overload of a settled joint has
    /// another cause.
    #[test]
    fn j66_j71_a_joint_that_yields_during_a_trial_of_gains_gets_the_gains_before_the_trial() {
        let overloaded = Found { overloaded: true, ..HELD };
        for (found, kind, yields) in [
            (Found { pushed: true, ..HELD }, StopKind::Gains, true),
            (Found { unstable: true, ..HELD }, StopKind::Gains, true),
            (Found { settled: false, ..overloaded }, StopKind::Gains, true),
            (overloaded, StopKind::Overload, true),
            (Found { errors: joint_error::VELOCITY, ..HELD }, StopKind::Velocity, false),
        ] {
            let mut controller = holding();
            let before = try_gains(&mut controller);
            assert_eq!(controller.react(ControlMode::Hold, &second(found)), [0; JOINTS], "{found:?}");
            assert_eq!(controller.last_stop.cause.kind, kind, "{found:?}");
            assert_eq!(controller.last_stop.cause.joint, 2, "{found:?}");
            assert_eq!(controller.parameters.pid == before, kind == StopKind::Gains, "{found:?}");
            let yielding: [bool; JOINTS] = core::array::from_fn(|j| controller.motion.law.yields(j));
            assert_eq!(yielding, [false, yields, false, false, false, false], "{found:?}");
        }
    }

    /// A joint that yields has limited torque, so an unstable control loop alone is not an error. If the loop was
    /// already unstable shortly before, the controller switches the torque off.
    #[test]
    fn j66_a_joint_that_yields_is_unstable_only_again() {
        for (again, released) in [(false, 0), (true, joint_error::TORQUE)] {
            let mut controller = holding();
            let mut yields = NO_JOINT;
            yields[1] = true;
            controller.motion.begin_yields(&yields, &NO_JOINT, &controller.config);
            if again {
                let gains = controller.parameters.pid;
                controller.parameters.trial.fails(0b10, 0b10, &gains, controller.config.delay_ticks);
            }
            let release = controller.react(ControlMode::Hold, &second(Found { unstable: true, ..HELD }));
            assert_eq!(release, [0, released, 0, 0, 0, 0], "{again}");
            assert!(!controller.errors.held_stop(), "{again}");
        }
    }

    /// If a joint is overloaded on the path and the controller cannot slow the path down (J-75), the arm stops.
    #[test]
    fn j66_j75_an_overload_in_motion_stops_the_arm_if_holding_back_does_not_help() {
        let overloaded = second(Found { overloaded: true, ..HELD });
        let mut controller = holding();
        assert!(!controller.hold_back(), "no path is executed");
        controller.react(ControlMode::Follow, &overloaded);
        assert!(controller.errors.held_stop());
        assert_eq!(controller.last_stop.cause.kind, StopKind::Overload);
        assert!(
            !controller.motion.law.any_yields(),
            "the arm stops and the joint keeps its position control"
        );
    }

    /// If the controller ends a trial of gains early, it restores the gains before the trial, and stores the cause
    /// for the host.
    #[test]
    fn j71_a_trial_of_gains_that_ends_early_restores_the_gains_before_it() {
        let mut controller = holding();
        controller.end_trial();
        assert_eq!(controller.last_stop.cause, StopCause::default(), "no gains are on trial");
        let before = try_gains(&mut controller);
        controller.end_trial();
        assert_eq!(controller.parameters.pid, before);
        assert_eq!(controller.last_stop.cause.kind, StopKind::Gains);
        assert!(!controller.parameters.trial.is_on());
    }

    /// The host cannot clear the cause of a held stop while a joint yields, or while the arm still comes to rest.
    #[test]
    fn j69_a_held_stop_is_not_cleared_during_its_reaction() {
        let all = [false, true];
        for yields in all {
            for held_stop in all {
                for executes in all {
                    for jogs in all {
                        let mut controller = holding();
                        if yields {
                            controller.motion.begin_yields(&[true; JOINTS], &NO_JOINT, &controller.config);
                        }
                        if held_stop {
                            controller.errors.hold_joints(&[joint_error::TORQUE; JOINTS], true);
                        }
                        if executes {
                            controller.trajectory = TrajectoryState::Execute;
                        }
                        if jogs {
                            controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &controller.config);
                        }
                        assert_eq!(
                            controller.is_reacting(),
                            yields || (held_stop && (executes || jogs)),
                            "yields {yields}, held stop {held_stop}, executes {executes}, jogs {jogs}"
                        );
                    }
                }
            }
        }
    }

    /// While the arm comes to rest after hand guiding, it still moves. The host therefore cannot clear the cause of
    /// the held stop yet.
    #[test]
    fn j69_a_held_stop_is_not_cleared_while_the_arm_comes_to_rest_after_teaching() {
        for (velocity, reacts) in [(0.0, false), (0.25, true)] {
            let mut controller = holding();
            let nodes = Nodes::enabled_at([0.0; JOINTS], [velocity; JOINTS]);
            controller.motion.set.hold_for_test();
            controller.motion.set.hold_measured(&nodes, 200.0, &controller.config);
            assert!(!controller.is_reacting(), "no held stop");
            controller.errors.hold_joints(&[joint_error::TORQUE; JOINTS], true);
            assert_eq!(controller.is_reacting(), reacts, "{velocity} rad/s");
        }
    }

    /// If a set value exceeds a limit of the path, the gains are not the cause, even before the joint has settled.
    /// The trial of the gains continues.
    #[test]
    fn j71_a_violated_limit_of_the_path_does_not_end_a_trial_of_gains() {
        for settled in [true, false] {
            let mut controller = holding();
            try_gains(&mut controller);
            let on_trial = controller.parameters.pid;
            controller
                .react(ControlMode::Hold, &second(Found { errors: joint_error::VELOCITY, settled, ..HELD }));
            assert_eq!(controller.last_stop.cause.kind, StopKind::Velocity, "settled: {settled}");
            assert!(controller.parameters.trial.is_on(), "settled: {settled}");
            assert_eq!(controller.parameters.pid, on_trial, "settled: {settled}");
        }
    }

    /// For a joint that yields, the controller computes the inertia of the arm at this moment. For a stop without a
    /// joint that yields, it does not need this inertia.
    #[test]
    fn j68_the_inertia_is_computed_for_a_joint_that_yields() {
        for (found, computed) in [
            (Found { pushed: true, ..HELD }, true),
            (Found { overloaded: true, ..HELD }, true),
            (Found { errors: joint_error::VELOCITY, ..HELD }, false),
        ] {
            let mut controller = holding();
            controller.react(ControlMode::Hold, &second(found));
            assert!(controller.errors.held_stop(), "{found:?}");
            assert_eq!(controller.motion.ramp.inertia() != [0.0; JOINTS], computed, "{found:?}");
        }
    }

    #[test]
    fn j66_the_first_row_that_applies_wins() {
        use Reaction::*;
        use StopKind::{Overload, Position, PositionError, Push, Unstable, Velocity};
        let (torque, error, path) = (joint_error::TORQUE, joint_error::POSITION_ERROR, joint_error::VELOCITY);
        let (hold, follow) = (ControlMode::Hold, ControlMode::Follow);
        let overloaded = Found { overloaded: true, ..HELD };
        let rows = [
            (HELD, hold, None),
            (Found { errors: torque, ..HELD }, hold, Some((Release, Overload, torque))),
            (
                Found { errors: torque | error, unstable: true, ..overloaded },
                follow,
                Some((Release, Overload, torque)),
            ),
            (Found { unstable: true, settled: false, ..overloaded }, hold, Some((Yield, Unstable, torque))),
            (Found { settled: false, strained: true, ..overloaded }, hold, Some((Lower, Overload, torque))),
            (Found { pushed: true, strained: true, ..HELD }, follow, Some((Yield, Push, torque))),
            (Found { strained: true, ..overloaded }, follow, Some((Yield, Push, torque))),
            (Found { pushed: true, ..HELD }, hold, Some((Yield, StopKind::Shove, torque))),
            (Found { strained: true, ..HELD }, hold, None),
            (Found { errors: error | path, ..HELD }, follow, Some((Yield, PositionError, error))),
            (Found { errors: error, ..overloaded }, follow, Some((Yield, PositionError, error))),
            (overloaded, follow, Some((Stop, Overload, torque))),
            (overloaded, ControlMode::Approach, Some((Stop, Overload, torque))),
            (overloaded, hold, Some((Lower, Overload, torque))),
            (Found { errors: path, ..HELD }, follow, Some((Stop, Velocity, path))),
            (
                Found { errors: joint_error::POSITION, ..HELD },
                follow,
                Some((Stop, Position, joint_error::POSITION)),
            ),
        ];
        for (found, mode, expected) in rows {
            assert_eq!(reaction(&found, mode, false, false), expected, "{found:?} {mode:?}");
            let taught = reaction(&found, ControlMode::Teach, false, false);
            assert_eq!(taught, expected.filter(|(reaction, ..)| *reaction == Release), "{found:?}");
            assert_eq!(found.is_any(), expected.is_some(), "{found:?}");
            // If the setting `torque_reaction` is 1, every overload releases the arm. A push that does not overload
            // the joint then has no reaction.
            let released = reaction(&found, mode, true, false);
            if found.overloaded {
                assert_eq!(released, Some((Release, Overload, torque)), "{found:?}");
            } else if found.pushed {
                assert_eq!(released, None, "{found:?}");
            } else {
                assert_eq!(released, expected, "{found:?}");
            }
        }
    }
}
