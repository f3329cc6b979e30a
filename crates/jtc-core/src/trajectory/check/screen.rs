//! Quick part of the trajectory check. The quick part computes bounds of the control points around a point, in single precision and in
//! steps of the wire format.
//!
//! Nearly every control point of an interval (J-32) depends on the velocity and acceleration at one end of the interval only. The exception
//! is the control point in the middle of the derivative of the quintic. The quick part therefore needs only a few dozen operations per
//! joint, and nearly every interval of a real path passes it. For an interval that does not pass the quick part, the exact check decides.
use jtc_wire::{ACCELERATION_SCALE, POSITION_SCALE, RawPoint, VELOCITY_SCALE};

use super::{JointBounds, POSITION_STEP, VELOCITY_STEP};
use crate::JOINTS;
use crate::bit_codec::bit_codec;

/// Margin for rounding in single precision, in position steps. `SLACK_SHARE` is an additional margin, as a share of
/// the speed limit.
const SLACK: f64 = 0.1;
const SLACK_SHARE: f64 = 2e-6;
/// Largest difference between the quartic and the cubic polynomial, divided by the unexplained distance. The
/// unexplained distance is the distance between two points, minus the integral of the cubic.
const BUMP: f32 = 1.875;

/// Point of a trajectory in single precision, in steps of the wire format.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steps {
    position: [f32; JOINTS],
    velocity: [f32; JOINTS],
    acceleration: [f32; JOINTS],
}

impl From<&RawPoint> for Steps {
    fn from(raw: &RawPoint) -> Self {
        Self {
            position: raw.position.map(f32::from),
            velocity: raw.velocity.map(f32::from),
            acceleration: raw.acceleration.map(f32::from),
        }
    }
}

/// Limits of the joints in steps of the wire format.
#[derive(Clone, Debug)]
pub(super) struct Screen {
    position_low: [f32; JOINTS],
    position_high: [f32; JOINTS],
    /// Speed limits, in position steps per interval.
    speed: [f32; JOINTS],
    acceleration: [f32; JOINTS],
    /// Position steps per interval that correspond to one velocity step, and to one acceleration step.
    per_velocity: f32,
    per_acceleration: f32,
    /// Velocity steps that one acceleration step adds to a control point of the velocity.
    rise: f32,
}

impl Screen {
    pub(super) fn new(bounds: &[JointBounds; JOINTS], step: f64) -> Self {
        let each = |value: fn(&JointBounds, f64) -> f64| {
            core::array::from_fn(|j| bounds.get(j).map_or(f32::NAN, |b| value(b, step) as f32))
        };
        Self {
            position_low: each(|b, _| b.position.tolerated().0 / POSITION_STEP + SLACK),
            position_high: each(|b, _| b.position.tolerated().1 / POSITION_STEP - SLACK),
            speed: each(|b, step| {
                let slowest = b.speed.min(b.friction.1).min(-b.friction.0);
                slowest * step / POSITION_STEP * (1.0 - SLACK_SHARE) - SLACK
            }),
            acceleration: each(|b, _| b.acceleration / (ACCELERATION_SCALE / 32767.0)),
            per_velocity: (VELOCITY_SCALE / POSITION_SCALE * step) as f32,
            per_acceleration: (ACCELERATION_SCALE / POSITION_SCALE * step * step) as f32,
            rise: (ACCELERATION_SCALE / VELOCITY_SCALE * step / 3.0) as f32,
        }
    }

    /// Returns `true` if point `b` and the interval from `a` to `b` are within every bound. Returns `false` if only the exact check can
    /// decide this.
    pub(super) fn passes(&self, a: &Steps, b: &Steps) -> bool {
        let (kv, ka) = (self.per_velocity, self.per_acceleration);
        let mut good = true;
        for j in 0..JOINTS {
            let (speed_a, speed_b) = (a.velocity[j].abs() * kv, b.velocity[j].abs() * kv);
            let (bend_a, bend_b) = (a.acceleration[j].abs() * ka, b.acceleration[j].abs() * ka);
            // `around` is the largest distance between the position of a trajectory point and the control points
            // around it.
            let around = (0.4 * speed_a + 0.05 * bend_a).max(0.4 * speed_b + 0.05 * bend_b);
            let low = a.position[j].min(b.position[j]) - around;
            let high = a.position[j].max(b.position[j]) + around;
            // `speed` is the largest magnitude of the control points of the velocity.
            let speed = (speed_a + bend_a * (1.0 / 3.0)).max(speed_b + bend_b * (1.0 / 3.0));
            // The unexplained distance is `way - explained`. Its magnitude is reduced by one step, because the
            // positions are rounded.
            let way = b.position[j] - a.position[j];
            let explained = 0.5 * kv * (a.velocity[j] + b.velocity[j])
                + (1.0 / 12.0) * ka * (a.acceleration[j] - b.acceleration[j]);
            let bump = BUMP * ((way - explained).abs() - 1.0).max(0.0);
            good &= (low >= self.position_low[j])
                & (high <= self.position_high[j])
                & (speed + bump <= self.speed[j])
                & (b.acceleration[j].abs() <= self.acceleration[j]);
        }
        good
    }

    /// Returns the lowest and highest velocity of the control points around `point` for each joint, in velocity steps of the wire format.
    pub(super) fn velocities(&self, point: &Steps) -> [(f32, f32); JOINTS] {
        core::array::from_fn(|j| {
            let rise = point.acceleration[j].abs() * self.rise;
            (point.velocity[j] - rise, point.velocity[j] + rise)
        })
    }
}

/// Velocities that a trajectory commands in one joint, including the velocities of its control points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SpeedRange {
    low: (f32, u32),
    high: (f32, u32),
}

bit_codec!(SpeedRange { low, high });

impl SpeedRange {
    /// Adds the velocities (in steps) around a point to the range.
    pub(super) fn add(&mut self, (low, high): (f32, f32), point: u32) {
        if low < self.low.0 {
            self.low = (low, point);
        }
        if high > self.high.0 {
            self.high = (high, point);
        }
    }

    /// Returns the lowest and the highest velocity, rad/s, each with the index of its point. The range of velocities always includes
    /// standstill.
    pub(super) fn ends(&self) -> [(f64, u32); 2] {
        [self.low, self.high].map(|(steps, point)| (f64::from(steps) * VELOCITY_STEP, point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::trajectory::check::PathRange;

    /// The quick part keeps a margin to each limit. Without the margin, rounding could let an interval pass the quick
    /// part although the exact check refuses it.
    #[test]
    fn j36_the_screen_keeps_a_distance_to_each_limit_that_is_more_than_its_rounding() {
        let mut config = Config::avena();
        (config.joints[3].position_min, config.joints[3].position_max) = (-2.5, 2.0);
        for (speed, friction) in
            [(1.5, (-9.0, 9.0)), (3.0, (-0.7, 9.0)), (3.0, (-9.0, 0.7)), (0.01, (-9.0, 9.0))]
        {
            for step in [0.001, 0.01, 0.1, 1.0, 10.0] {
                let position = PathRange::of(&config, 3, 0);
                let bounds = JointBounds { position, speed, acceleration: 8.0, friction };
                let screen = Screen::new(&[bounds; JOINTS], step);
                let slowest = if speed > 1.5 { 0.7 } else { speed };
                // The margin covers eight rounding errors, and a tenth of a step for their effect on positions.
                let share = 1.0 - 8.0 * f64::from(f32::EPSILON);
                let [low, high] = [screen.position_low[0], screen.position_high[0]].map(f64::from);
                // The position limits of the quick part may exceed the configured limits by the tolerance of one
                // step, minus the margin.
                assert!(low >= -2.5 / POSITION_STEP - 0.91 && high <= 2.0 / POSITION_STEP + 0.91);
                let way = f64::from(screen.speed[5]) * POSITION_STEP;
                assert!(way <= slowest * step * share - 0.09 * POSITION_STEP, "{speed} {friction:?} {step}");
                // The rounding margin does not reduce the limit significantly.
                assert!(
                    way >= slowest * step * 0.999_99 - 0.2 * POSITION_STEP,
                    "{speed} {friction:?} {step}"
                );
            }
        }
    }
}
