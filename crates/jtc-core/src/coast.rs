//! Coming to rest: a joint that moves when it begins to be held, because a hand still led it, or because it sagged or fell
//! while it was enabled (J-16, J-25).
use crate::config::{Config, JointConfig};
use crate::motion::smooth;

/// Speed below which a joint counts as standing, rad/s.
pub(crate) const STANDING: f64 = 0.02;
/// Highest deceleration of a joint that falls while it is enabled, rad/s²: most of its torque is gravity's.
const CATCH_DECELERATION: f64 = 3.0;
/// Length of a tick, s.
const DT: f64 = 0.001;

/// A joint that decelerates from where it was, along a smooth ramp of the velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coast {
    from: f64,
    velocity: f64,
    /// 0 in the first tick, which commands what was measured: the error begins at 0, and so does its derivative.
    elapsed_ms: f64,
    length_ms: f64,
}

impl Coast {
    /// A joint that a hand leads: from a measured position (rad) and velocity (rad/s), of which the velocity limit is used at
    /// most.
    pub fn led(from: f64, velocity: f64, config: &Config, limits: &JointConfig) -> Self {
        let velocity = velocity.max(-limits.velocity_max).min(limits.velocity_max);
        Self { from, velocity, elapsed_ms: -1.0, length_ms: f64::from(config.ramp_ms.max(1)) }
    }

    /// A joint that falls: the faster it is, the longer it takes.
    pub fn falling(from: f64, velocity: f64, config: &Config, limits: &JointConfig) -> Self {
        let led = Self::led(from, velocity, config, limits);
        // The velocity falls steepest in the middle: by 3/2 of its mean.
        let length_ms = led.length_ms.max(1.5 * led.velocity.abs() / (CATCH_DECELERATION * DT));
        Self { length_ms, ..led }
    }

    /// The whole way moves by `way` (rad).
    pub fn shift(&mut self, way: f64) {
        self.from += way;
    }

    /// Position and velocity of the next tick, and whether the joint rests then.
    pub fn step(&mut self, limits: &JointConfig) -> (f64, f64, bool) {
        self.elapsed_ms += 1.0;
        let u = (self.elapsed_ms / self.length_ms).min(1.0);
        // Integral of the falling velocity v·(1 − smooth(u)).
        let way = (u - u * u * u + 0.5 * u * u * u * u) * self.length_ms * DT;
        // Never out of the limits; where the arm already is outside, it stays.
        let position = (self.from + self.velocity * way)
            .max(limits.position_min.min(self.from))
            .min(limits.position_max.max(self.from));
        (position, self.velocity * (1.0 - smooth(u)), u >= 1.0)
    }
}
