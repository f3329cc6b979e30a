//! Limits (J-43) and other settings of a joint.
use crate::bit_codec::bit_codec;
use crate::interpolation::ROUNDING;
use crate::joint_error;

/// Settings of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointConfig {
    /// Lowest position of the joint, rad.
    pub position_min: f64,
    /// Highest position of the joint, rad.
    pub position_max: f64,
    /// Highest speed of the joint, rad/s.
    pub velocity_max: f64,
    /// Highest acceleration of the joint, rad/s².
    pub acceleration_max: f64,
    /// Highest torque at the joint, N·m.
    pub torque_max: f64,
    /// Largest difference between the commanded and the measured position, rad.
    pub position_error_max: f64,
    /// Reflected inertia of the drive's rotor, kg·m² at the joint (J-40).
    pub rotor_inertia: f64,
    /// Torque that is requested from the drive, as a multiple of the commanded torque at the joint (J-61). Drives that deliver less torque
    /// than requested need a value above 1.
    pub torque_gain: f64,
    /// Damping in Teaching, N·m·s/rad (J-25). The damping is reduced if the inertia of the joint is too low for this damping.
    pub teach_damping: f64,
}

/// Rotor inertia for a drive without a configured value, kg·m². The known drives have this rotor inertia.
const UNKNOWN_ROTOR: f64 = 0.7;

impl JointConfig {
    /// Returns the rotor inertia that the controller uses, kg·m². If the settings contain no rotor inertia, the controller uses the rotor
    /// inertia of the known drives.
    pub fn counted_rotor(&self) -> f64 {
        if self.rotor_inertia > 0.0 { self.rotor_inertia } else { UNKNOWN_ROTOR }
    }
}

/// Length of the observed window, ticks.
const WINDOW: u16 = 100;

/// Record of the ticks with a certain property among the last [`WINDOW`] ticks.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Recent {
    /// Mask of the ticks that have the observed property. Bit 0 stands for the last tick.
    history: u128,
    count: u16,
}

bit_codec!(Recent { history, count });

impl Recent {
    /// Adds a tick to the window. `has` is `true` if the tick has the counted property, for example a torque at the
    /// limit. Returns `true` if this tick and more than `most` of the last 100 ticks have the property.
    #[inline]
    pub(crate) fn exceeds(&mut self, has: bool, most: u16) -> bool {
        if has | (self.count > 0) {
            let oldest = (self.history >> (WINDOW - 1)) as u16 & 1;
            self.history = self.history << 1 | u128::from(has);
            self.count = self.count + u16::from(has) - oldest;
        }
        has & (self.count > most)
    }

    /// Clears the record of all ticks.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}

/// State of the torque limit of one joint, with the recent ticks in which the torque was at the limit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Saturation {
    /// `true` if the last torque was above the limit, so that the integral does not change (J-41).
    pub saturated: bool,
    over: Recent,
}

bit_codec!(Saturation { saturated, over });

impl Saturation {
    /// Returns the torque to command within the torque limit, and `true` if the joint is overloaded. A joint is overloaded if its computed
    /// torque was above the limit, with either sign, in more than `over_ms_max` of the last 100 ticks. If the computed torque is NaN, the
    /// commanded torque is zero. While the arm is `braking` with all available torque (J-33), the function does not count ticks above the
    /// limit.
    pub(crate) fn limit(
        &mut self,
        torque: f64,
        limits: &JointConfig,
        over_ms_max: u16,
        braking: bool,
    ) -> (f64, bool) {
        let limit = limits.torque_max;
        // With this comparison, a torque of NaN counts as above the limit.
        let within = torque.abs() <= limit;
        self.saturated = !within;
        let overloaded = self.over.exceeds(self.saturated & !braking, over_ms_max);
        let limited = torque.max(-limit).min(limit);
        (if torque.is_nan() { 0.0 } else { limited }, overloaded)
    }

    /// Clears the record of the ticks above the limit.
    pub(crate) fn forget(&mut self) {
        self.over.forget();
    }
}

/// If a torque reaches each of its two limits twice within this time, its control loop is unstable, ticks.
const TURNS_MS: u32 = 200;

/// Record of the changes of a joint's torque from one limit to the other.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Turns {
    /// Last three ticks in which the torque reached one limit after the other, oldest first.
    at: [u32; 3],
    /// Number of entries in `at`, at most three.
    count: u8,
    /// `true` if the torque was at the upper limit in the last of the ticks in `at`.
    upper: bool,
}

bit_codec!(Turns { at, count, upper });

impl Turns {
    /// Records a tick in which the torque is at a limit. Returns `true` if the torque has reached each limit twice within [`TURNS_MS`].
    pub(crate) fn hits(&mut self, upper: bool, tick: u32) -> bool {
        if self.count > 0 && self.upper == upper {
            return false;
        }
        let [first, a, b] = self.at;
        let unstable = self.count == 3 && tick.wrapping_sub(first) <= TURNS_MS;
        self.at = [a, b, tick];
        (self.count, self.upper) = ((self.count + 1).min(3), upper);
        unstable
    }
}

/// Returns the joint errors: one for each set value (position, velocity, acceleration) outside its limits, and one
/// for a position `error` (rad, J-62) above its limit. The position limit applies only to `commanded` positions,
/// because an arm that is already outside this limit must be held until the host moves it back. A value that exceeds
/// its limit only by the rounding of the interpolation (J-36) is not an error.
pub(crate) fn check_set(set: (f64, f64, f64), error: f64, limits: &JointConfig, commanded: bool) -> u16 {
    let (position, velocity, acceleration) = set;
    // With these comparisons, a value of NaN counts as outside the limits.
    let (low, high) = (limits.position_min - ROUNDING, limits.position_max + ROUNDING);
    let inside = (position >= low) & (position <= high);
    bit(inside | !commanded, joint_error::POSITION)
        | bit(velocity.abs() <= limits.velocity_max + ROUNDING, joint_error::VELOCITY)
        | bit(acceleration.abs() <= limits.acceleration_max, joint_error::ACCELERATION)
        | bit(error.abs() <= limits.position_error_max, joint_error::POSITION_ERROR)
}

/// Returns the amount of the `wanted` torque (N·m) that can be added to the present `torque` without exceeding the torque limit.
pub(crate) fn within(wanted: f64, torque: f64, torque_max: f64) -> f64 {
    let (low, high) = ((-torque_max - torque).min(0.0), (torque_max - torque).max(0.0));
    wanted.max(low).min(high)
}

fn bit(good: bool, bit: u16) -> u16 {
    if good { 0 } else { bit }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;
    use proptest::prelude::*;

    const INF: f64 = f64::INFINITY;

    fn limits() -> JointConfig {
        Config::avena().joints[0]
    }

    #[test]
    fn j43_nan_is_outside_every_limit() {
        let nan = f64::NAN;
        let all = joint_error::POSITION
            | joint_error::VELOCITY
            | joint_error::ACCELERATION
            | joint_error::POSITION_ERROR;
        assert_eq!(check_set((nan, nan, nan), nan, &limits(), true), all);
        assert_eq!(check_set((0.0, 0.0, 0.0), nan, &limits(), true), joint_error::POSITION_ERROR);
        assert_eq!(Saturation::default().limit(nan, &limits(), 10, false), (0.0, false));
    }

    #[test]
    fn j43_limits_themselves_are_allowed() {
        let l = limits();
        for s in [-1.0, 1.0] {
            let position = if s < 0.0 { l.position_min } else { l.position_max };
            let set = (position, s * l.velocity_max, s * l.acceleration_max);
            assert_eq!(check_set(set, s * l.position_error_max, &l, true), 0);
            let beyond = |x: f64| x * (1.0 + 1e-8);
            let set = (beyond(position), beyond(set.1), beyond(set.2));
            let three = joint_error::POSITION | joint_error::VELOCITY | joint_error::ACCELERATION;
            assert_eq!(check_set(set, 0.0, &l, true), three);
            assert_eq!(check_set(set, 0.0, &l, false), three & !joint_error::POSITION);
            let error = beyond(s * l.position_error_max);
            assert_eq!(check_set((0.0, 0.0, 0.0), error, &l, true), joint_error::POSITION_ERROR);
            assert_eq!(
                Saturation::default().limit(s * l.torque_max, &l, 0, false),
                (s * l.torque_max, false)
            );
        }
    }

    #[test]
    fn j43_a_joint_is_overloaded_after_its_time() {
        let (l, mut saturation) = (limits(), Saturation::default());
        for _ in 0..3 {
            assert_eq!(saturation.limit(-INF, &l, 3, false), (-l.torque_max, false));
            assert!(saturation.saturated);
        }
        // A tick within the torque limit does not count, but it does not restart the observed window either.
        assert_eq!(saturation.limit(1.0, &l, 3, false), (1.0, false));
        assert!(!saturation.saturated);
        assert_eq!(saturation.limit(-INF, &l, 3, false), (-l.torque_max, true));
        assert_eq!(Saturation::default().limit(INF, &l, 0, false), (l.torque_max, true));
        saturation.forget();
        assert_eq!(saturation.limit(-INF, &l, 3, false), (-l.torque_max, false));
    }

    #[test]
    fn j43_torque_at_its_limit_counts_within_any_100_ms_whichever_sign() {
        // If every tenth tick is above the limit, this is ten ticks in 100 ms, which is allowed. If every ninth tick is
        // above the limit, this is more than ten ticks in 100 ms, which is an overload.
        for (period, allowed) in [(10, true), (9, false)] {
            let (l, mut saturation) = (limits(), Saturation::default());
            let mut good = true;
            for k in 0..1_000 {
                let torque = if k % period == 0 { if k % 2 == 0 { INF } else { -INF } } else { 0.0 };
                good &= !saturation.limit(torque, &l, 10, false).1;
            }
            assert_eq!(good, allowed, "one tick of {period}");
        }
        // Ten consecutive ticks above the limit, followed by a pause of 90 ms, are also allowed.
        let (l, mut saturation) = (limits(), Saturation::default());
        for k in 0..1_000 {
            let torque = if k % 100 < 10 { INF } else { 0.0 };
            assert!(!saturation.limit(torque, &l, 10, false).1, "tick {k}");
        }
    }

    #[test]
    fn j33_torque_at_its_limit_is_no_overload_while_braking() {
        let (l, mut saturation) = (limits(), Saturation::default());
        for _ in 0..1_000 {
            assert_eq!(saturation.limit(INF, &l, 10, true), (l.torque_max, false));
            assert!(saturation.saturated);
        }
        assert_eq!(saturation.limit(f64::NAN, &l, 10, true), (0.0, false));
        // Ticks above the limit during braking are also not counted later.
        for _ in 0..10 {
            assert_eq!(saturation.limit(INF, &l, 10, false), (l.torque_max, false));
        }
        assert_eq!(saturation.limit(INF, &l, 10, false), (l.torque_max, true));
    }

    /// The control loop is unstable if the torque reaches the upper limit twice and the lower limit twice within 200
    /// ms. Each pair in a list is a tick and its limit (`true` for the upper limit). The expected result is the index
    /// of the pair at which the instability is detected.
    #[test]
    fn j66_a_torque_that_was_at_both_limits_twice_each_within_200_ms_is_unstable() {
        let seen = |hits: &[(u32, bool)]| {
            let mut turns = Turns::default();
            hits.iter().position(|&(tick, upper)| turns.hits(upper, tick))
        };
        assert_eq!(seen(&[(0, true), (50, false), (100, true), (200, false)]), Some(3));
        assert_eq!(seen(&[(0, true), (50, false), (100, true), (201, false), (240, true)]), Some(4));
        assert_eq!(seen(&[(0, true), (100, false), (200, true), (300, false), (400, true)]), None);
        assert_eq!(seen(&[(0, true), (50, true), (60, false), (70, false), (80, true)]), None);
        assert_eq!(seen(&[(u32::MAX - 9, false), (u32::MAX, true), (5, false), (9, true)]), Some(3));
    }

    proptest! {
        #[test]
        fn j43_no_torque_beyond_the_limit_is_commanded(torques in prop::collection::vec(prop::num::f64::ANY, 1..50)) {
            let (l, mut saturation) = (limits(), Saturation::default());
            for torque in torques {
                let commanded = saturation.limit(torque, &l, 10, false).0;
                prop_assert!(commanded.abs() <= l.torque_max);
                prop_assert!(commanded == torque || commanded == 0.0 || commanded.abs() == l.torque_max);
                // The commanded torque never has the opposite sign of the computed torque. The test compares the signs, because the product
                // 0·∞ is NaN.
                prop_assert!(torque.is_nan() || commanded == 0.0 || (commanded > 0.0) == (torque > 0.0));
            }
        }
    }

    /// A set value that has passed the check of J-36 is not an error during the motion, even if rounding increases it
    /// by the largest possible amount.
    #[test]
    fn j36_j43_what_rounding_may_add_is_no_error() {
        let l = limits();
        for (position, sign) in [(l.position_min - ROUNDING, -1.0), (l.position_max + ROUNDING, 1.0)] {
            assert_eq!(check_set((position, sign * (l.velocity_max + ROUNDING), 0.0), 0.0, &l, true), 0);
        }
    }
}
