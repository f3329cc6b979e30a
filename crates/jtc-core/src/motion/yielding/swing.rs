//! Detection of oscillation in a joint that has less inertia than the arm file contains. Measured speeds are delayed,
//! so the brake is too strong for such a joint and makes it swing.
use crate::bit_codec::bit_codec;

/// Longest duration of half a swing, ms. `HALF_SPEED` is the lowest peak speed of half a swing, rad/s.
const HALF_MS: u8 = 80;
const HALF_SPEED: f32 = 0.15;
/// Lowest speed of the second half of a swing, as a share of the speed of the first half. When a spring moves a joint
/// back after a sudden push, the second half is slower and does not count as a swing.
const LASTS: f32 = 0.5;
/// Each swing multiplies `soft` by this factor. `SOFTEST` is the lowest value of `soft`.
const SOFTER: f32 = 0.5;
const SOFTEST: f32 = 0.2;
/// Time without a swing after which `soft` increases by its first step, ms, and time between two further steps, ms.
const HARDENS_MS: (u16, u16) = (300, 100);

/// State of the swing of a joint, and the factor that makes its spring, damper and brake softer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Swing {
    /// Highest speed in the present direction, with its sign, rad/s. `half_ms` is the time in this direction, ms.
    peak: f32,
    half_ms: u8,
    /// Highest speed of the previous half swing, rad/s. The speed is 0 if the previous motion was not half a swing.
    before: f32,
    /// Factor that makes spring, damper and brake softer. `soft_ms` is the time since the last change of this factor,
    /// ms.
    soft: f32,
    soft_ms: u16,
}

bit_codec!(Swing { peak, half_ms, before, soft, soft_ms });

impl Swing {
    pub(super) const NONE: Self = Self { peak: 0.0, half_ms: u8::MAX, before: 0.0, soft: 1.0, soft_ms: 0 };

    /// Executes one tick at this `velocity` of the joint, rad/s. Returns the factor that makes spring, damper and brake softer.
    pub(super) fn step(&mut self, velocity: f64) -> f64 {
        let velocity = velocity as f32;
        if velocity * self.peak < 0.0 {
            let speed = self.peak.abs();
            let swings = self.half_ms <= HALF_MS && speed > HALF_SPEED;
            if swings && self.before > 0.0 && speed >= LASTS * self.before {
                (self.soft, self.soft_ms) = ((SOFTER * self.soft).max(SOFTEST), 0);
            }
            self.before = if swings { speed } else { 0.0 };
            (self.peak, self.half_ms) = (velocity, 0);
        } else if velocity.abs() > self.peak.abs() {
            self.peak = velocity;
        }
        self.half_ms = self.half_ms.saturating_add(1);
        if self.soft < 1.0 {
            self.soft_ms += 1;
            if self.soft_ms >= HARDENS_MS.0 {
                (self.soft, self.soft_ms) = ((self.soft / SOFTER).min(1.0), HARDENS_MS.0 - HARDENS_MS.1);
            }
        }
        self.soft.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint that swings several times becomes softer with each swing, and becomes stiffer again when the swing has
    /// ended. A joint that returns slowly after a push does not become softer.
    #[test]
    fn j68_what_swings_becomes_softer_for_a_while() {
        let swing = |half_ms: usize, speeds: [f64; 2]| {
            let mut swing = Swing::NONE;
            for ms in 0..6 * half_ms {
                swing.step(speeds[ms / half_ms % 2]);
            }
            swing
        };
        let mut swings = swing(20, [0.3, -0.3]);
        assert_eq!(
            swings.soft, SOFTEST,
            "of five turns the first ends no swing, and the second has none before it"
        );
        for (ms, harder) in [(300, 2.0 * SOFTEST), (100, 4.0 * SOFTEST), (100, 1.0)] {
            assert_eq!((0..ms).fold(0.0, |_, _| swings.step(0.01)), f64::from(harder));
        }
        assert_eq!(swing(20, [0.3, -0.1]).soft, 1.0, "shoves, and the spring");
        assert_eq!(swing(20, [0.1, -0.1]).soft, 1.0, "too slow to matter");
        assert_eq!(swing(100, [0.3, -0.3]).soft, 1.0, "no swing of a loop");
    }

    /// Executes half swings with these durations (ms) and velocities (rad/s), and one tick after the last reversal. Returns `soft`.
    fn after(halves: &[(usize, f64)]) -> f32 {
        let mut swing = Swing::NONE;
        for &(ms, velocity) in halves {
            (0..ms).for_each(|_| {
                swing.step(velocity);
            });
        }
        let (_, last) = halves[halves.len() - 1];
        swing.step(-last);
        swing.soft
    }

    /// The motion before the first reversal may have begun long before the yield, so it does not count as half a
    /// swing. At the third reversal, two half swings are complete. The joint then becomes softer.
    #[test]
    fn j68_a_joint_becomes_softer_at_the_third_reversal() {
        for v in [0.3, -0.3] {
            assert_eq!(after(&[(20, v)]), 1.0);
            assert_eq!(after(&[(20, v), (20, -v)]), 1.0);
            assert_eq!(after(&[(20, v), (20, -v), (20, v)]), 0.5);
            assert_eq!(after(&[(20, v), (20, -v), (20, v), (20, -v)]), 0.25);
        }
    }

    /// Each half of a swing is faster than 0.15 rad/s and takes at most 80 ms. The second half has at least half of the speed of the first
    /// half.
    #[test]
    fn j68_both_halves_of_a_swing_are_fast_short_and_alike() {
        for sign in [1.0, -1.0] {
            for (first, second, soft) in [
                ((20, 0.5), (20, 0.5), 0.5),
                ((80, 0.5), (80, 0.5), 0.5),
                ((81, 0.5), (20, 0.5), 1.0),
                ((20, 0.5), (81, 0.5), 1.0),
                ((20, 0.15), (20, 0.5), 1.0),
                ((20, 0.2), (20, 0.15), 1.0),
                ((20, 0.2), (20, 0.14), 1.0),
                ((20, 0.16), (20, 0.16), 0.5),
                ((20, 0.5), (20, 0.2), 1.0),
                ((20, 0.5), (20, 0.24), 1.0),
                ((20, 0.5), (20, 0.25), 0.5),
                ((20, 0.5), (20, 0.26), 0.5),
                ((20, 0.2), (20, 0.5), 0.5),
            ] {
                let halves = [(20, sign * 0.3), (first.0, -sign * first.1), (second.0, sign * second.1)];
                assert_eq!(after(&halves), soft, "{first:?}, {second:?}");
            }
        }
    }

    /// Only the highest speed within a half swing matters. The joint can be slow before and after it.
    #[test]
    fn j68_the_highest_speed_of_a_half_swing_counts() {
        let mut swing = Swing::NONE;
        for half in [1.0, -1.0, 1.0, -1.0] {
            for velocity in [0.02, 0.1, 0.3, 0.1, 0.02] {
                swing.step(half * velocity);
            }
        }
        assert_eq!(swing.soft, 0.5, "three reversals");
    }
}
