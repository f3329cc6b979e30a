//! Application of the limits of the control law to each joint in each tick (J-43).
use super::law::{ControlLaw, ControlMode, LawInputs};
use super::set_values::SetValues;
use crate::bit_codec::bit_codec;
use crate::config::limits::{self, Recent, Saturation, Turns};
use crate::{JOINTS, joint_error};

/// Speed, rad/s. If the torque drives a joint faster than this speed, a torque at the limit does not count as part of
/// a catch.
pub(super) const DRIVEN: f64 = 0.05;
/// Lowest speed of a joint that comes to rest after Teaching, as a share of its set velocity. If a joint is slower,
/// the controller assumes that an obstacle stops it.
const LAGS: f64 = 0.7;
/// Commanded speed from which a joint may use twice its permitted feedback torque, as a share of the velocity limit.
/// In fast motions, errors of the modelled friction and inertia need more feedback torque. If a fast joint hits an
/// obstacle, its feedback torque exceeds even the double value a few milliseconds later.
const FAST: f64 = 0.2;
/// Highest number of ticks, among the last 100, in which the feedback torque of a joint may exceed its permitted share. After more ticks,
/// the joint counts as pushed (J-66).
const PUSHED_MS: u16 = 20;
/// Excess of a joint's speed over the commanded speed, as a share of its velocity limit. `RUSH_WAY` is the distance
/// from the set position to a joint ahead of it, rad. A joint above both values counts as pushed. With weak gains, a
/// pushed joint with little inertia exceeds its speed limit before its feedback torque shows the push.
pub(crate) const RUSH: f64 = 0.2;
const RUSH_WAY: f64 = 1e-3;

/// State of the limiter. For each joint, it records the ticks with a torque at the limit, the ticks with too much
/// feedback torque, and the jumps of the torque between its limits.
#[derive(Clone, Debug, Default)]
pub(crate) struct Limiter {
    saturation: [Saturation; JOINTS],
    pushed: [Recent; JOINTS],
    turns: [Turns; JOINTS],
    /// Number of ticks that the limiter has executed. The number starts again at 0 when the controller switches the torque off.
    tick: u32,
}

bit_codec!(Limiter { saturation, pushed, turns, tick });

/// Findings of the limiter in a tick for one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Found {
    /// Joint errors for the set values that exceed their limits. The torque bit is set if the computed torque is NaN.
    pub errors: u16,
    /// `true` if the computed torque was above its limit for too long (J-43).
    pub overloaded: bool,
    /// `true` if the feedback torque was above its permitted share for too long, and the joint had settled before.
    pub pushed: bool,
    /// `true` if the feedback torque is above its permitted share.
    pub strained: bool,
    /// `true` if the joint has settled since it was enabled.
    pub settled: bool,
    /// `true` if the control loop is unstable: the torque jumps between its limits, or an oscillation of the joint
    /// grows.
    pub unstable: bool,
}

impl Found {
    /// Returns `true` if the controller must react to the findings.
    pub(crate) fn is_any(&self) -> bool {
        (self.errors != 0) | self.overloaded | self.pushed | self.unstable
    }
}

/// Result of the limiter for all joints.
#[derive(Default)]
pub(crate) struct Limited {
    /// Torque to command, N·m.
    pub torque: [f64; JOINTS],
    /// Findings of this tick for each joint. `None` if no joint needs a reaction.
    pub found: Option<[Found; JOINTS]>,
    /// Sag of the set position of each joint whose load is being caught, rad. `None` if no set position sags in this
    /// tick.
    pub sag: Option<[f64; JOINTS]>,
}

impl Limiter {
    /// Returns `true` if the last computed torque of the joint was above its limit. The integral of such a joint does not change (J-41).
    #[inline(always)]
    pub(super) fn is_saturated(&self, j: usize) -> bool {
        self.saturation[j].saturated
    }

    /// Clears the counters of a joint in the limiter.
    #[inline(always)]
    pub(super) fn forget(&mut self, joint: usize) {
        self.saturation[joint].forget();
        self.pushed[joint].forget();
        self.turns[joint] = Turns::default();
    }

    /// Clears the record of the changes of each torque from one limit to the other.
    pub(super) fn forget_turns(&mut self) {
        self.turns = Default::default();
    }

    /// Executes one tick of the limiter, which limits the torque of the `law` and checks the torque and the set
    /// values. While the arm brakes with all available torque, the limiter does not report an overload. If the arm
    /// brakes during a commanded motion, it does not report position error and acceleration either (J-33). For a
    /// yielding joint, it reports only a torque of NaN or a torque that jumps between its limits, because this torque
    /// is already bounded.
    pub(super) fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        law: &ControlLaw,
        set: &mut SetValues,
        held_back: bool,
        limited: &mut Limited,
    ) {
        let LawInputs { mode, braking, nodes, config, ref parameters } = *inputs;
        // Braking excuses these errors only while the set values move. An arm at rest must still yield to a push
        // (J-66).
        let excused = if braking && mode.moves() {
            joint_error::POSITION_ERROR | joint_error::ACCELERATION
        } else if held_back || mode == ControlMode::Rest {
            // A change of the rate of path time adds an acceleration to the set values. An arm that a hand has moved
            // may come to rest with any acceleration. In both cases, a high set acceleration is not an error.
            joint_error::ACCELERATION
        } else {
            0
        };
        let (q, v) = (nodes.positions(), nodes.velocities());
        let due = *set.due(config);
        let (holds, taught) = (mode.holds(), mode == ControlMode::Teach);
        let any_yields = law.any_yields();
        self.tick = self.tick.wrapping_add(1);
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            let error = due[j] - q[j];
            let computed = law.torque[j].sum();
            let yields = any_yields && law.yields(j);
            let holds = holds && !yields;
            let catching = set.catch[j].step(v[j]) && holds;
            let stands = holds && mode == ControlMode::Hold;
            let mut unstable = stands && set.catch[j].swing_grows();
            if parameters.on_trial && stands {
                unstable |= set.catch[j].watch(v[j]);
            }
            // A torque that accelerates the joint, instead of stopping it, is not part of a catch or a deceleration.
            let driven = || computed.signum() * v[j] > DRIVEN;
            let stopping = (catching || set.deceleration[j].is_some()) && !driven();
            let excuses = braking || stopping || yields;
            let (within, overloaded) =
                self.saturation[j].limit(computed, limits, config.torque_over_ms, excuses);
            if self.saturation[j].saturated && !taught {
                unstable |= self.turns[j].hits(computed > 0.0, self.tick);
            }
            let settled = set.catch[j].settled();
            let (feedback, share) = (law.feedback(j), config.yield_torque_share * limits.torque_max);
            // The permitted feedback torque increases with the commanded speed.
            let speed = || (set.point.velocity[j].abs() / (FAST * limits.velocity_max)).min(1.0);
            let strained = feedback.abs() > share && feedback.abs() > (1.0 + speed()) * share;
            // Feedback torque that brakes a moving joint does not count as a push. Feedback torque on a joint at rest counts as a push.
            let brakes = || stopping || (braking && feedback.signum() * v[j] < -DRIVEN);
            // After hand guiding, the arm can hit a person before it is at rest. The joint that has hit the person is
            // then slower than its set velocity.
            let lags = || {
                let set = set.point.velocity[j];
                mode == ControlMode::Rest && feedback * set > 0.0 && v[j] * set.signum() < LAGS * set.abs()
            };
            let counts = strained && !yields && !taught && ((settled && !brakes()) || lags());
            let rushes = || {
                let due = set.point.velocity[j];
                let velocity = nodes.node(j).young_velocity(due);
                let faster = velocity - due;
                faster.abs() > RUSH * limits.velocity_max && faster * velocity > 0.0 && error * velocity < 0.0
            };
            // The distance is checked first. The distance is rarely above its limit, so the other conditions are rarely
            // evaluated.
            let rushes = error.abs() > RUSH_WAY && rushes() && settled && !yields && !taught && !brakes();
            let pushed = self.pushed[j].exceeds(counts, PUSHED_MS) | rushes;
            if catching && self.saturation[j].saturated {
                let sag = set.sag(j, computed - within, parameters.pid[j].kp, error, limits);
                limited.sag.get_or_insert([0.0; JOINTS])[j] = sag;
            }
            let looked_at = !taught && !yields && set.holding[j];
            let set_errors = || {
                let point = (set.point.position[j], set.point.velocity[j], set.point.acceleration[j]);
                limits::check_set(point, error, limits, mode == ControlMode::Follow)
            };
            let errors = if looked_at { set_errors() & !excused } else { 0 }
                | if computed.is_nan() { joint_error::TORQUE } else { 0 };
            limited.torque[j] = within;
            let found = Found { errors, overloaded, pushed, strained, settled, unstable };
            if found.is_any() {
                limited.found.get_or_insert_default()[j] = found;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use jtc_dynamics::Dynamics;

    use super::super::law::ControlParameters;
    use super::*;
    use crate::config::Config;
    use crate::motion::catch::Catch;
    use crate::motion::deceleration::Deceleration;
    use crate::nodes::Nodes;
    use crate::{Parameters, PidGains};

    const GAINS: PidGains = PidGains { kp: 100.0, ki: 0.0, kd: 10.0, int_min: -1.0, int_max: 1.0 };

    /// Limiter and an arm at position 0. The test sets the same torque of the control law for all joints.
    struct Bench {
        config: Config,
        law: ControlLaw,
        set: SetValues,
        limiter: Limiter,
        on_trial: bool,
    }

    impl Bench {
        /// Creates a limiter for joints that have settled at position 0, and do not answer late.
        fn settled() -> Self {
            let mut set = SetValues::default();
            set.begin_at(&[0.0; JOINTS]);
            set.hold_for_test();
            set.catch.iter_mut().for_each(|catch| catch.calm_down());
            let config = Config { delay_ticks: 0, ..Config::avena() };
            Self { config, law: ControlLaw::default(), set, limiter: Limiter::default(), on_trial: false }
        }

        /// Makes joint 2 yield.
        fn yielding(mut self) -> Self {
            self.law.begin_yield(1, (false, false), 0.0, 5.0, &self.config.joints[1]);
            self
        }

        /// Begins the catch of every joint, so that no joint has settled.
        fn catching(mut self) -> Self {
            self.set.catch = [Catch::begin(&self.config); JOINTS];
            self
        }

        /// Sets the feedback torque of joint 2 to `shares` times the permitted value.
        fn with_feedback(mut self, shares: f64) -> Self {
            self.law.torque[1].pid.p =
                shares * self.config.yield_torque_share * self.config.joints[1].torque_max;
            self
        }

        /// Commands joint 2 to move at a share of its velocity limit. Returns this set velocity, rad/s.
        fn set_velocity(&mut self, share: f64) -> f64 {
            self.set.point.velocity[1] = share * self.config.joints[1].velocity_max;
            self.set.point.velocity[1]
        }

        /// Executes ticks while joint 2 is at `position` (rad) and moves at `velocity` (rad/s). Returns the torque and the findings of
        /// joint 2 in the last tick.
        fn run(
            &mut self,
            ticks: u16,
            (mode, braking, held_back): (ControlMode, bool, bool),
            (position, velocity): (f64, f64),
        ) -> (f64, Found) {
            let (mut q, mut v) = ([0.0; JOINTS], [0.0; JOINTS]);
            (q[1], v[1]) = (position, velocity);
            let mut nodes = Nodes::enabled_at(q, v);
            nodes.move_at(1, velocity);
            let dynamics = Dynamics::new(&Parameters::avena().model, self.config.gravity);
            let mut limited = Limited::default();
            for _ in 0..ticks {
                self.set.commanded.put(&self.set.point);
                let parameters = ControlParameters {
                    dynamics: &dynamics,
                    pid: &[GAINS; JOINTS],
                    polynomial: &[[0.0; 6]; JOINTS],
                    table: None,
                    on_trial: self.on_trial,
                };
                let inputs = LawInputs { mode, braking, nodes: &nodes, config: &self.config, parameters };
                limited = Limited::default();
                self.limiter.step(&inputs, &self.law, &mut self.set, held_back, &mut limited);
            }
            (limited.torque[1], limited.found.map_or_else(Found::default, |found| found[1]))
        }
    }

    const HOLD: (ControlMode, bool, bool) = (ControlMode::Hold, false, false);
    const FOLLOW: (ControlMode, bool, bool) = (ControlMode::Follow, false, false);
    const REST: (ControlMode, bool, bool) = (ControlMode::Rest, false, false);
    const STILL: (f64, f64) = (0.0, 0.0);

    #[test]
    fn j66_a_torque_that_is_not_a_number_is_an_error_and_is_not_commanded() {
        let mut bench = Bench::settled();
        bench.law.torque[1].model = f64::NAN;
        let (torque, found) = bench.run(1, HOLD, STILL);
        assert_eq!((torque, found.errors), (0.0, joint_error::TORQUE));
        assert_eq!(Bench::settled().run(1, HOLD, STILL), (0.0, Found::default()));
    }

    /// A settled joint counts as pushed if its feedback torque is above the permitted value in more than 20 ticks.
    #[test]
    fn j66_a_settled_joint_with_too_much_feedback_torque_is_pushed() {
        for (shares, ticks, pushed) in
            [(1.01, 21, true), (-1.01, 21, true), (1.01, 20, false), (0.99, 60, false)]
        {
            let (_, found) = Bench::settled().with_feedback(shares).run(ticks, HOLD, STILL);
            assert_eq!(found.pushed, pushed, "{shares} {ticks}");
        }
        // A joint that has not settled needs feedback torque to catch a load, so it does not count as pushed. In
        // Teaching, a joint does not count as pushed either.
        let mut bench = Bench::settled().with_feedback(1.5);
        bench.set.catch = [crate::motion::catch::Catch::begin(&bench.config); JOINTS];
        assert!(!bench.run(60, HOLD, STILL).1.pushed);
        assert!(
            !Bench::settled().with_feedback(1.5).run(60, (ControlMode::Teach, false, false), STILL).1.pushed
        );
    }

    /// The permitted feedback torque rises with the commanded speed to twice its value at 20 % of the velocity limit.
    #[test]
    fn j66_a_fast_joint_may_use_more_feedback_torque() {
        for (speed, shares, pushed) in [
            (0.0, 1.01, true),
            (0.1, 1.45, false),
            (0.1, 1.55, true),
            (0.2, 1.95, false),
            (0.2, 2.05, true),
            (-0.2, 1.95, false),
            (0.8, 2.05, true),
        ] {
            let mut bench = Bench::settled().with_feedback(shares);
            let velocity = bench.set_velocity(speed);
            assert_eq!(bench.run(21, FOLLOW, (0.0, velocity)).1.pushed, pushed, "{speed} {shares}");
        }
    }

    /// While the arm brakes, a feedback torque against the motion does not count as a push. On a joint at rest, the same torque is a push.
    #[test]
    fn j33_j66_feedback_torque_that_brakes_a_joint_is_no_push() {
        for (braking, velocity, pushed) in
            [(true, -0.06, false), (true, -0.04, true), (true, 0.06, true), (false, -0.06, true)]
        {
            let mut bench = Bench::settled().with_feedback(1.5);
            let (_, found) = bench.run(21, (ControlMode::Hold, braking, false), (0.0, velocity));
            assert_eq!(found.pushed, pushed, "{braking} {velocity}");
        }
    }

    /// A joint that comes to rest after Teaching may meet a person. Such a joint counts as pushed if it is slower than
    /// 0.7 times its set velocity while its feedback torque acts along the motion. The joint need not have settled.
    #[test]
    fn j25_j66_a_joint_that_lags_on_the_way_to_rest_is_pushed() {
        for (mode, shares, share, pushed) in [
            (REST, 3.0, 0.65, true),
            (REST, 3.0, 0.75, false),
            (REST, -3.0, 0.65, false),
            (HOLD, 3.0, 0.65, false),
        ] {
            for sign in [1.0, -1.0] {
                let mut bench = Bench::settled().with_feedback(sign * shares);
                bench.set.catch = [crate::motion::catch::Catch::begin(&bench.config); JOINTS];
                let set = bench.set_velocity(sign * 0.3);
                assert_eq!(
                    bench.run(21, mode, (0.0, share * set)).1.pushed,
                    pushed,
                    "{mode:?} {shares} {share} {sign}"
                );
            }
        }
    }

    /// With weak gains, a push is visible only in the speed. A joint counts as pushed if it is faster than commanded
    /// by 20 % of its velocity limit, and is more than 1 mrad ahead of its set position.
    #[test]
    fn j66_a_joint_that_runs_ahead_of_its_set_values_is_shoved_at_once() {
        let most = Config::avena().joints[1].velocity_max;
        for (mode, position, velocity, pushed) in [
            (HOLD, 1.1e-3, 0.21 * most, true),
            (HOLD, -1.1e-3, -0.21 * most, true),
            (HOLD, 0.9e-3, 0.21 * most, false),
            (HOLD, 1.1e-3, 0.19 * most, false),
            // A joint that returns to its set position is not pushed.
            (HOLD, -1.1e-3, 0.21 * most, false),
            ((ControlMode::Teach, false, false), 1.1e-3, 0.21 * most, false),
        ] {
            let (_, found) = Bench::settled().run(1, mode, (position, velocity));
            assert_eq!(found.pushed, pushed, "{mode:?} {position} {velocity}");
            assert!(!found.strained);
        }
    }

    /// A set acceleration above its limit is not an error while the path is held back, or while an arm comes to rest
    /// after hand guiding. While a commanded motion brakes, a position error is not an error either.
    #[test]
    fn j33_j66_errors_of_the_set_values_are_excused_where_the_controller_causes_them() {
        let (position, acceleration) = (joint_error::POSITION_ERROR, joint_error::ACCELERATION);
        for (mode, errors) in [
            (FOLLOW, position | acceleration),
            ((ControlMode::Follow, false, true), position),
            ((ControlMode::Follow, true, false), 0),
            ((ControlMode::Approach, true, false), 0),
            (REST, position),
            ((ControlMode::Hold, true, false), position | acceleration),
        ] {
            let mut bench = Bench::settled();
            let limits = &bench.config.joints[1];
            bench.set.point.acceleration[1] = 1.01 * limits.acceleration_max;
            let ahead = 1.01 * limits.position_error_max;
            let found = bench.run(1, mode, (ahead, 0.0)).1;
            assert_eq!(found.errors & (position | acceleration), errors, "{mode:?}");
        }
    }

    /// A yielding joint has no position controller, and its torque is bounded by construction.
    #[test]
    fn j68_a_yielding_joint_is_neither_overloaded_nor_pushed_and_does_not_sag() {
        for yields in [false, true] {
            let bench = || if yields { Bench::settled().yielding() } else { Bench::settled() };
            let mut overloaded = bench();
            overloaded.law.torque[1].model = 300.0;
            assert_eq!(overloaded.run(60, HOLD, STILL).1.overloaded, !yields);
            assert_eq!(bench().with_feedback(1.5).run(21, HOLD, STILL).1.pushed, !yields);
            let most = Config::avena().joints[1].velocity_max;
            assert_eq!(bench().run(1, HOLD, (1.1e-3, 0.21 * most)).1.pushed, !yields);
            let ahead = 1.01 * Config::avena().joints[1].position_error_max;
            let errors = if yields { 0 } else { joint_error::POSITION_ERROR };
            assert_eq!(bench().run(1, HOLD, (ahead, 0.0)).1.errors, errors);
            // The torque exceeds its limit of 180 N·m by 120 N·m. With a position gain of 100 N·m/rad, the set position sags to the measured
            // position.
            let mut sags = bench().catching();
            sags.law.torque[1].model = 300.0;
            sags.run(1, HOLD, (-0.05, 0.0));
            assert_eq!(sags.set.point.position[1], if yields { 0.0 } else { -0.05 });
        }
    }

    /// A swing grows from 0.2 rad/s in one direction to 0.25 rad/s in the other. The loop counts as unstable only if
    /// the joint is held. On a path, or while the arm comes to rest, the growing speed belongs to the motion.
    #[test]
    fn j43_j66_a_swing_that_grows_is_unstable_only_while_the_joint_is_held() {
        for (mode, yields, unstable) in [
            (HOLD, false, true),
            (HOLD, true, false),
            (REST, false, false),
            (FOLLOW, false, false),
            ((ControlMode::Approach, false, false), false, false),
        ] {
            let mut bench = if yields { Bench::settled().yielding() } else { Bench::settled() }.catching();
            [0.2, -0.25].iter().for_each(|&velocity| {
                bench.set.catch[1].step(velocity);
            });
            assert_eq!(bench.run(1, mode, STILL).1.unstable, unstable, "{mode:?} {yields}");
        }
    }

    /// While gains are on trial, a settled joint is unstable after three half swings, each faster than the half swing
    /// before it.
    #[test]
    fn j71_a_swing_of_a_settled_joint_counts_while_gains_are_on_trial() {
        for (on_trial, mode, unstable) in [(true, HOLD, true), (false, HOLD, false), (true, FOLLOW, false)] {
            let mut bench = Bench { on_trial, ..Bench::settled() };
            let found = [0.05, -0.08, 0.11].map(|velocity| bench.run(1, mode, (0.0, velocity)).1.unstable);
            assert_eq!(found, [false, false, unstable], "{on_trial} {mode:?}");
        }
    }

    /// The torque reaches each limit twice, so the loop is unstable. In Teaching, a hand can cause such a torque, so
    /// this is not an instability.
    #[test]
    fn j66_a_torque_that_jumps_between_its_limits_is_unstable_except_in_teaching() {
        for (mode, unstable) in [(HOLD, true), (FOLLOW, true), ((ControlMode::Teach, false, false), false)] {
            let mut bench = Bench::settled();
            let found = [300.0, -300.0, 300.0, -300.0].map(|torque| {
                bench.law.torque[1].model = torque;
                bench.run(1, mode, STILL).1.unstable
            });
            assert_eq!(found, [false, false, false, unstable], "{mode:?}");
        }
    }

    /// A joint has 10 ticks at the limit, 20 ticks with too much feedback torque, and three jumps between the limits.
    /// These numbers are still permitted. After the counters are cleared, the same numbers are permitted again.
    #[test]
    fn j66_a_joint_that_begins_to_yield_starts_with_cleared_counters() {
        let mut pushed = Bench::settled().with_feedback(1.5);
        assert!(!pushed.run(20, HOLD, STILL).1.pushed);
        pushed.limiter.forget(1);
        assert!(!pushed.run(20, HOLD, STILL).1.pushed && pushed.run(1, HOLD, STILL).1.pushed);
        let mut overloaded = Bench::settled();
        overloaded.law.torque[1].model = 300.0;
        assert!(!overloaded.run(10, HOLD, STILL).1.overloaded);
        overloaded.limiter.forget(1);
        assert!(!overloaded.run(10, HOLD, STILL).1.overloaded && overloaded.run(1, HOLD, STILL).1.overloaded);
        let mut jumps = Bench::settled();
        for unstable in [false, true] {
            for (n, torque) in [300.0, -300.0, 300.0, -300.0].into_iter().enumerate() {
                jumps.law.torque[1].model = torque;
                // The counters are cleared after the torque has reached a limit three times.
                if n == 3 && !unstable {
                    jumps.limiter.forget(1);
                }
                assert_eq!(jumps.run(1, HOLD, STILL).1.unstable, unstable && n == 3, "{n}");
            }
            jumps.limiter.forget(1);
        }
    }

    /// If a value is exactly at its limit, the joint does not count as pushed. The tested values are the feedback
    /// torque, and the speed and distance of a sudden push.
    #[test]
    fn j66_the_limits_of_a_push_themselves_are_permitted() {
        for shares in [1.0, -1.0] {
            assert!(!Bench::settled().with_feedback(shares).run(60, HOLD, STILL).1.pushed, "{shares}");
        }
        // A fast joint may use exactly twice the permitted feedback torque.
        for shares in [2.0, -2.0] {
            let mut bench = Bench::settled().with_feedback(shares);
            let velocity = bench.set_velocity(0.8);
            assert!(!bench.run(60, FOLLOW, (0.0, velocity)).1.pushed, "{shares}");
        }
        // A speed of exactly 0.05 rad/s is too low for the feedback torque to count as braking, so the joint counts
        // as pushed.
        let braking = (ControlMode::Hold, true, false);
        assert!(Bench::settled().with_feedback(1.5).run(21, braking, (0.0, -0.05)).1.pushed);
        let most = Config::avena().joints[1].velocity_max;
        for sign in [1.0, -1.0] {
            let at_speed = (sign * 1.1e-3, sign * 0.2 * most);
            assert!(!Bench::settled().run(1, HOLD, at_speed).1.pushed, "{sign}");
            let at_distance = (sign * 1e-3, sign * 0.21 * most);
            assert!(!Bench::settled().run(1, HOLD, at_distance).1.pushed, "{sign}");
        }
    }

    /// A decelerating joint needs its feedback torque to stop. A joint in a catch needs it to hold its load. In both
    /// cases, the joint does not count as pushed.
    #[test]
    fn j43_j66_a_joint_that_decelerates_or_is_caught_is_not_pushed() {
        for (decelerates, pushed) in [(false, true), (true, false)] {
            let mut bench = Bench::settled().with_feedback(1.5);
            if decelerates {
                let limits = &bench.config.joints[1];
                bench.set.deceleration[1] = Some(Deceleration::led(0.0, 0.3, 200.0, limits));
            }
            assert_eq!(bench.run(21, HOLD, STILL).1.pushed, pushed, "{decelerates}");
        }
        let most = Config::avena().joints[1].velocity_max;
        assert!(!Bench::settled().catching().run(1, HOLD, (1.1e-3, 0.21 * most)).1.pushed);
    }

    /// The set velocity is 1 rad/s, and the velocity limit is 1.5 rad/s. A joint at 0.5 rad/s is too slow to count as
    /// pushed, even if it is ahead of its set position. A joint at 1.4 rad/s is faster than its set velocity by more
    /// than a fifth of the limit, so it is pushed.
    #[test]
    fn j66_only_a_joint_that_is_faster_than_its_set_velocity_is_pushed_by_its_speed() {
        for (velocity, pushed) in [(0.5, false), (1.2, false), (1.4, true)] {
            let mut bench = Bench::settled();
            bench.set.point.velocity[1] = 1.0;
            assert_eq!(bench.run(1, FOLLOW, (1.1e-3, velocity)).1.pushed, pushed, "{velocity} rad/s");
        }
    }

    /// A joint at exactly 0.7 times its set velocity does not lag. A joint with a set velocity of zero has come to
    /// rest, so it cannot lag.
    #[test]
    fn j25_j66_a_joint_lags_below_its_share_of_a_set_velocity_only() {
        for sign in [1.0, -1.0] {
            let mut bench = Bench::settled().with_feedback(sign * 3.0).catching();
            let set = bench.set_velocity(sign * 0.3);
            assert!(!bench.run(21, REST, (0.0, LAGS * set)).1.pushed, "{sign}");
            let mut rests = Bench::settled().with_feedback(sign * 3.0).catching();
            assert!(!rests.run(21, REST, (0.0, sign * -0.06)).1.pushed, "{sign}");
        }
    }
}
