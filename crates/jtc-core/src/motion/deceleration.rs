//! Deceleration of a joint that still moves when position hold begins (J-16, J-25). The joint moves because a hand was guiding it, or
//! because it sagged or fell while it was enabled.
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::smooth;

/// Highest speed at which a joint is considered at rest, rad/s.
const STANDING: f64 = 0.02;
/// Highest deceleration of a joint that falls while it is enabled, rad/s². Gravity requires most of the torque of a falling joint.
const CATCH_DECELERATION: f64 = 3.0;
/// Peak deceleration of a falling joint, as a multiple of the mean deceleration. The peak is in the middle of the
/// motion.
const STEEPEST: f64 = 1.5;
/// Peak deceleration of a joint that a hand has guided, as a multiple of the mean deceleration. The peak is at the
/// beginning, when the damping of Teaching already decelerates the joint.
pub(crate) const STEEPEST_LED: f64 = 2.0;

/// Returns `true` if a joint with this velocity (rad/s) moves.
pub(crate) fn moves(velocity: f64) -> bool {
    velocity.abs() > STANDING
}

/// Deceleration of a joint along a smooth ramp of the velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Deceleration {
    from: f64,
    velocity: f64,
    /// Elapsed time, ms. The first tick (0 ms) commands the measured position and velocity, so the position error and
    /// its derivative begin at 0.
    elapsed_ms: f64,
    length_ms: f64,
    /// `true` if the joint falls. The deceleration of a falling joint begins at zero.
    falls: bool,
}

bit_codec!(Deceleration { from, velocity, elapsed_ms, length_ms, falls });

impl Deceleration {
    /// Creates the deceleration of a joint that a hand has guided. The deceleration starts at a measured position (rad)
    /// and velocity (rad/s) and takes `length_ms`. The start velocity is clipped to the velocity limit.
    pub(crate) fn led(from: f64, velocity: f64, length_ms: f64, limits: &JointConfig) -> Self {
        let velocity = velocity.max(-limits.velocity_max).min(limits.velocity_max);
        Self { from, velocity, elapsed_ms: -1.0, length_ms: length_ms.max(1.0), falls: false }
    }

    /// Creates the deceleration of a joint that falls. The faster the joint falls, the longer its deceleration takes.
    pub(crate) fn falling(from: f64, velocity: f64, config: &Config, limits: &JointConfig) -> Self {
        let led = Self::led(from, velocity, f64::from(config.ramp_ms), limits);
        let length_ms = led.length_ms.max(STEEPEST * led.velocity.abs() / (CATCH_DECELERATION * DT));
        Self { length_ms, falls: true, ..led }
    }

    /// Returns the start position, rad, and the start velocity, rad/s, of the deceleration.
    pub(crate) fn start(&self) -> (f64, f64) {
        (self.from, self.velocity)
    }

    /// Shifts all positions of the deceleration by `way` (rad).
    pub(crate) fn shift(&mut self, way: f64) {
        self.from += way;
    }

    /// Returns the position, velocity and acceleration of the next tick, and `true` if the joint is at rest after that tick.
    pub(crate) fn step(&mut self, limits: &JointConfig) -> ([f64; 3], bool) {
        self.elapsed_ms += 1.0;
        let u = (self.elapsed_ms / self.length_ms).min(1.0);
        let (seconds, left) = (self.length_ms * DT, 1.0 - u);
        // v is the start velocity and T is the duration. `velocity` is a share of v. `way` is the integral of
        // `velocity`, as a share of v·T. `slope` is its derivative, as a multiple of v/T.
        let (velocity, way, slope) = if self.falls {
            (1.0 - smooth(u), u - u * u * u + 0.5 * u * u * u * u, -6.0 * u * left)
        } else {
            (left * left, (1.0 - left * left * left) * (1.0 / 3.0), -2.0 * left)
        };
        // The set position never leaves the position limits. A joint that is already outside its limits does not move further out.
        let position = (self.from + self.velocity * way * seconds)
            .max(limits.position_min.min(self.from))
            .min(limits.position_max.max(self.from));
        ([position, self.velocity * velocity, self.velocity * slope / seconds], u >= 1.0)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const RAMP_MS: f64 = 200.0;

    /// Returns limits that are wide enough for every motion in these tests.
    fn limits() -> JointConfig {
        JointConfig { position_min: -9.0, position_max: 9.0, ..Config::avena().joints[0] }
    }

    /// Returns the set positions and velocities until the joint is at rest.
    fn ways(mut deceleration: Deceleration, limits: &JointConfig) -> Vec<(f64, f64)> {
        let mut ways = Vec::new();
        for _ in 0..5_000 {
            let ([position, velocity, _], rests) = deceleration.step(limits);
            ways.push((position, velocity));
            if rests {
                return ways;
            }
        }
        panic!("it never rests");
    }

    #[test]
    fn j33_fifty_seconds_a_radian_is_standing() {
        for sign in [1.0, -1.0] {
            assert!(!moves(0.0) && !moves(sign * 0.0199) && !moves(sign / 50.0) && moves(sign * 0.0201));
        }
    }

    #[test]
    fn j16_j25_a_joint_comes_to_rest_from_what_was_measured_and_its_velocity_is_the_slope() {
        let config = Config::avena();
        for velocity in [-1.4, -0.3, 0.05, 1.0] {
            let (led, falling) = (
                Deceleration::led(0.7, velocity, RAMP_MS, &limits()),
                Deceleration::falling(0.7, velocity, &config, &limits()),
            );
            for way in [ways(led, &limits()), ways(falling, &limits())] {
                assert_eq!(way[0], (0.7, velocity), "no step of the error at the beginning");
                assert_eq!(way[way.len() - 1].1, 0.0);
                for pair in way.windows(2) {
                    let [(p, v), (q, w)] = [pair[0], pair[1]];
                    assert!(((q - p) / DT - 0.5 * (v + w)).abs() < 1e-4, "{pair:?}");
                    assert!(w.abs() <= v.abs() && w * velocity >= 0.0, "it only gets slower: {pair:?}");
                }
            }
            assert_eq!(ways(led, &limits()).len(), usize::from(config.ramp_ms) + 1, "{velocity}");
        }
    }

    #[test]
    fn j16_a_falling_joint_is_slowed_down_no_faster_than_its_torque_allows_and_no_slower() {
        let config = Config::avena();
        let decelerations = |velocity: f64| {
            let way = ways(Deceleration::falling(0.0, velocity, &config, &limits()), &limits());
            way.windows(2).map(|pair| (pair[0].1 - pair[1].1).abs() / DT).fold(0.0, f64::max)
        };
        for velocity in [-1.4, -0.5, 0.45, 1.5] {
            let most = decelerations(velocity);
            assert!((0.99 * CATCH_DECELERATION..1.001 * CATCH_DECELERATION).contains(&most), "{most}");
        }
        // The deceleration of a slow joint takes `ramp_ms`.
        assert_eq!(
            ways(Deceleration::falling(0.0, 0.1, &config, &limits()), &limits()).len(),
            usize::from(config.ramp_ms) + 1
        );
    }

    #[test]
    fn j43_coming_to_rest_keeps_the_velocity_limit_and_the_position_limits() {
        let limits = Config::avena().joints[0];
        for velocity in [-7.0, 7.0] {
            let way = ways(Deceleration::led(0.0, velocity, RAMP_MS, &limits), &limits);
            assert_eq!(way[0].1, limits.velocity_max.copysign(velocity));
            for (end, outside) in [(limits.position_min, -0.1), (limits.position_max, 0.1)] {
                let inside =
                    ways(Deceleration::led(end - 0.1 * outside, velocity, RAMP_MS, &limits), &limits);
                let inward = velocity * outside < 0.0;
                assert!(inside.iter().all(|(q, _)| (limits.position_min..=limits.position_max).contains(q)));
                // A joint that is outside its limits at the start of the deceleration does not move further out.
                let found = end + outside;
                let beyond = ways(Deceleration::led(found, velocity, RAMP_MS, &limits), &limits);
                let last = beyond[beyond.len() - 1].0;
                assert!(if inward { (last - end).abs() < (found - end).abs() } else { last == found });
            }
        }
    }

    #[test]
    fn j43_a_load_that_is_caught_moves_the_whole_way() {
        let plain = Deceleration::led(0.4, 0.3, RAMP_MS, &limits());
        let mut moved = plain;
        moved.shift(-0.02);
        for ((p, v), (q, w)) in ways(plain, &limits()).into_iter().zip(ways(moved, &limits())) {
            assert!((q - (p - 0.02)).abs() < 1e-12 && v == w);
        }
    }

    /// In the formulas below, v is the start velocity, T is the duration and u is the elapsed share of T. A guided
    /// joint takes 0.2 s, with the velocity v · (1 − u)² and the acceleration −2 · v / T · (1 − u). A joint that falls
    /// at 1 rad/s takes 1.5 · 1 rad/s / 3 rad/s² = 0.5 s, with the velocity v · (1 − 3 · u² + 2 · u³) and the
    /// acceleration −6 · v / T · u · (1 − u).
    #[test]
    fn j16_j25_the_acceleration_is_the_derivative_of_the_velocity() {
        let (config, limits) = (Config::avena(), JointConfig { velocity_max: 2.0, ..limits() });
        for v in [1.0, -1.0] {
            let led = Deceleration::led(0.7, v, RAMP_MS, &limits);
            let falling = Deceleration::falling(0.7, v, &config, &limits);
            for (mut deceleration, ms, velocity, acceleration) in [
                // u = 0.25: v · 0.75² = 0.5625 and −2 / 0.2 · 0.75 = −7.5.
                (led, 50, 0.5625, -7.5),
                // u = 0.5: v · 0.5² = 0.25 and −2 / 0.2 · 0.5 = −5.
                (led, 100, 0.25, -5.0),
                (led, 0, 1.0, -10.0),
                (led, 200, 0.0, 0.0),
                // u = 0.25: 1 − 0.1875 + 0.03125 = 0.84375 and −6 / 0.5 · 0.25 · 0.75 = −2.25.
                (falling, 125, 0.84375, -2.25),
                // At u = 0.5, the velocity is 1 − 0.75 + 0.25 = 0.5 rad/s. The acceleration is −6 / 0.5 · 0.25 = −3
                // rad/s², the highest deceleration of a falling joint.
                (falling, 250, 0.5, -3.0),
                (falling, 0, 1.0, 0.0),
                (falling, 500, 0.0, 0.0),
            ] {
                let (found, _) = (0..=ms).fold(([0.0; 3], false), |_, _| deceleration.step(&limits));
                assert!((found[1] - v * velocity).abs() < 1e-9, "{ms} ms: {found:?}");
                assert!((found[2] - v * acceleration).abs() < 1e-9, "{ms} ms: {found:?}");
            }
        }
    }
}
