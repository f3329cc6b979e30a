//! Computation of the set values between two trajectory points (J-32).
//!
//! Position, velocity and acceleration are interpolated separately. The position is the quintic polynomial through the positions,
//! velocities and accelerations of both points. The velocity is the cubic polynomial through the velocities and accelerations of both
//! points. The acceleration is interpolated linearly between both points. Velocity and acceleration are not the derivatives of the
//! position, because derivatives of the int16 grid of the positions (96 µrad) would reach tens of rad/s².
use core::array::from_fn;

use jtc_wire::{ACCELERATION_SCALE, POSITION_SCALE, RAW_FULL_SCALE, RawPoint, VELOCITY_SCALE};

use crate::bit_codec::bit_codec;
use crate::{DT, JOINTS};

/// Position (rad), velocity (rad/s) and acceleration (rad/s²) of every joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
    /// Position, rad.
    pub position: [f64; JOINTS],
    /// Velocity, rad/s.
    pub velocity: [f64; JOINTS],
    /// Acceleration, rad/s².
    pub acceleration: [f64; JOINTS],
}

bit_codec!(SetPoint { position, velocity, acceleration });

impl SetPoint {
    /// Returns the set values of an arm at rest at `position`.
    pub fn still(position: [f64; JOINTS]) -> Self {
        Self { position, ..Self::default() }
    }
}

impl From<&RawPoint> for SetPoint {
    fn from(raw: &RawPoint) -> Self {
        Self {
            position: raw.position_rad(),
            velocity: raw.velocity_rad_s(),
            acceleration: raw.acceleration_rad_s2(),
        }
    }
}

/// Largest increase of a value between two points because of rounding, rad and rad/s. This increase is too small to
/// matter for any limit.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Returns a value that rises smoothly from 0 to 1 for `u` from 0 to 1, with zero slope at both ends.
pub(crate) fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Weights of the samples of the two points for a time between the points (Hermite basis). The interpolated position,
/// velocity and acceleration are weighted sums of these samples. The weights are the same for all joints.
struct Weights {
    /// Weights of the positions, velocities and accelerations of both points in the interpolated position.
    position: [[f64; 2]; 3],
    /// Weights of the velocities and accelerations of both points in the interpolated velocity.
    velocity: [[f64; 2]; 2],
    /// Weights of the accelerations of both points in the interpolated acceleration.
    acceleration: [f64; 2],
}

/// Units of the samples of a trajectory, and the motion that one unit of velocity or acceleration causes in the step
/// between two points. All values are constant for a trajectory.
#[derive(Clone, Copy, Debug)]
struct Units {
    /// Position (rad), velocity (rad/s) and acceleration (rad/s²) that one unit of a sample represents.
    position: f64,
    velocity: f64,
    acceleration: f64,
    /// Distance within a step (rad) that one unit of velocity causes. `half_way` is half of the distance (rad) that
    /// one unit of acceleration causes. `change` is the change of the velocity (rad/s) that one unit of acceleration
    /// causes.
    way: f64,
    half_way: f64,
    change: f64,
}

impl Units {
    /// Creates the units of points that are `h` seconds apart.
    fn new(position: f64, velocity: f64, acceleration: f64, h: f64) -> Self {
        let (way, half_way, change) = (h * velocity, 0.5 * h * h * acceleration, h * acceleration);
        Self { position, velocity, acceleration, way, half_way, change }
    }
}

impl Weights {
    /// Returns the weights at the fraction `u` of a step.
    #[inline(always)]
    fn at(u: f64, units: &Units) -> Self {
        let w = 1.0 - u;
        let (uu, uw) = (u * u, u * w);
        let (uuw, uww) = (uw * u, uw * w);
        let rise = uu * u * (10.0 + u * (6.0 * u - 15.0)) * units.position;
        let change = uu * (3.0 - 2.0 * u) * units.velocity;
        let half_way = uw * uw * units.half_way;
        let line = u * units.acceleration;
        Self {
            position: [
                [units.position - rise, rise],
                [uww * w * (1.0 + 3.0 * u) * units.way, -(uuw * u * (1.0 + 3.0 * w) * units.way)],
                [half_way * w, half_way * u],
            ],
            velocity: [[units.velocity - change, change], [uww * units.change, -(uuw * units.change)]],
            acceleration: [units.acceleration - line, line],
        }
    }

    /// Interpolates position, velocity and acceleration between the samples `a` and `b`.
    #[inline(always)]
    fn between(&self, a: [f64; 3], b: [f64; 3]) -> (f64, f64, f64) {
        let of = |weights: &[f64; 2], channel: usize| weights[0] * a[channel] + weights[1] * b[channel];
        let [positions, velocities, accelerations] = &self.position;
        (
            of(positions, 0) + (of(velocities, 1) + of(accelerations, 2)),
            of(&self.velocity[0], 1) + of(&self.velocity[1], 2),
            of(&self.acceleration, 2),
        )
    }
}

/// Step between two points of a trajectory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Length of the step, ms. `per_ms` is its reciprocal.
    pub ms: u16,
    pub per_ms: f64,
    units: Units,
}

impl Step {
    /// Creates a step of `ms` milliseconds. A length of 0 is replaced by 1.
    pub(crate) fn new(ms: u16) -> Self {
        let ms = ms.max(1);
        let [position, velocity, acceleration] =
            [POSITION_SCALE, VELOCITY_SCALE, ACCELERATION_SCALE].map(|scale| scale / RAW_FULL_SCALE);
        let units = Units::new(position, velocity, acceleration, f64::from(ms) * DT);
        Self { ms, per_ms: 1.0 / f64::from(ms), units }
    }

    /// Writes the set values at the fraction `u` (0..1) between the points `a` and `b` to `out`.
    #[inline(always)]
    pub(crate) fn between(&self, a: &RawPoint, b: &RawPoint, u: f64, out: &mut SetPoint) {
        let weights = Weights::at(u, &self.units);
        for j in 0..JOINTS {
            let samples = |p: &RawPoint| [p.position[j], p.velocity[j], p.acceleration[j]].map(f64::from);
            (out.position[j], out.velocity[j], out.acceleration[j]) = weights.between(samples(a), samples(b));
        }
    }
}

/// Returns the set values at the fraction `u` (0..1) between `a` and `b`, which are `h` seconds apart.
pub fn interpolate(a: &SetPoint, b: &SetPoint, h: f64, u: f64) -> SetPoint {
    let weights = Weights::at(u, &Units::new(1.0, 1.0, 1.0, h));
    let mut out = SetPoint::default();
    for j in 0..JOINTS {
        let samples = |p: &SetPoint| [p.position[j], p.velocity[j], p.acceleration[j]];
        (out.position[j], out.velocity[j], out.acceleration[j]) = weights.between(samples(a), samples(b));
    }
    out
}

/// Returns the derivative of the interpolated position (rad/s) at the same time as [`interpolate`]. The derivative is
/// the velocity of the cubic polynomial plus a correction. The correction is zero if the cubic velocity, integrated
/// from one point to the other, gives exactly the distance between both points.
pub fn position_speed(a: &SetPoint, b: &SetPoint, h: f64, u: f64) -> [f64; JOINTS] {
    let cubic = interpolate(a, b, h, u).velocity;
    from_fn(|j| {
        let explained = 0.5 * h * (a.velocity[j] + b.velocity[j])
            + h * h * (a.acceleration[j] - b.acceleration[j]) / 12.0;
        let unexplained = b.position[j] - a.position[j] - explained;
        cubic[j] + 30.0 * unexplained / h * u * u * (1.0 - u) * (1.0 - u)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = SetPoint> {
        (
            prop::array::uniform6(-3.0..3.0),
            prop::array::uniform6(-1.5..1.5),
            prop::array::uniform6(-12.0..12.0),
        )
            .prop_map(|(position, velocity, acceleration)| SetPoint {
                position,
                velocity,
                acceleration,
            })
    }

    fn raw() -> impl Strategy<Value = RawPoint> {
        let any = || prop::array::uniform6(any::<i16>());
        (any(), any(), any()).prop_map(|(position, velocity, acceleration)| RawPoint {
            position,
            velocity,
            acceleration,
        })
    }

    proptest! {
        #[test]
        fn j32_both_ends_are_met_in_every_channel(a in point(), b in point(), h in 0.001..0.1f64) {
            let (start, end) = (interpolate(&a, &b, h, 0.0), interpolate(&a, &b, h, 1.0));
            prop_assert_eq!(start, a);
            for j in 0..JOINTS {
                prop_assert!((end.position[j] - b.position[j]).abs() < 1e-12);
                prop_assert!((end.velocity[j] - b.velocity[j]).abs() < 1e-12);
                prop_assert!((end.acceleration[j] - b.acceleration[j]).abs() < 1e-12);
            }
        }

        /// If the position of a motion is a quintic polynomial, the interpolated position is exact. If its velocity
        /// is a cubic polynomial, the interpolated velocity is also exact.
        #[test]
        fn j32_reproduces_polynomials(c in prop::array::uniform6(-1.0..1.0f64), h in 0.005..0.5f64, u in 0.0..1.0f64) {
            let at = |t: f64| {
                let p = c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * (c[4] + t * c[5]))));
                let v = c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * (4.0 * c[4] + t * 5.0 * c[5])));
                let a = 2.0 * c[2] + t * (6.0 * c[3] + t * (12.0 * c[4] + t * 20.0 * c[5]));
                (p, v, a)
            };
            let knot = |t: f64| { let (p, v, a) = at(t); SetPoint { position: [p; 6], velocity: [v; 6], acceleration: [a; 6] } };
            let got = interpolate(&knot(0.0), &knot(h), h, u);
            prop_assert!((got.position[3] - at(u * h).0).abs() < 1e-12);
            // The velocity of this motion is a cubic polynomial.
            let cubic = |t: f64| (c[1] + t * (c[2] + t * (c[3] + t * c[4])), c[2] + t * (2.0 * c[3] + t * 3.0 * c[4]));
            let knot = |t: f64| SetPoint { position: [0.0; 6], velocity: [cubic(t).0; 6], acceleration: [cubic(t).1; 6] };
            let got = interpolate(&knot(0.0), &knot(h), h, u);
            prop_assert!((got.velocity[0] - cubic(u * h).0).abs() < 1e-12);
            prop_assert!((got.acceleration[0] - (cubic(0.0).1 + u * (cubic(h).1 - cubic(0.0).1))).abs() < 1e-12);
        }

        /// Points in the wire format and points with real numbers give the same result. Only a rounding error
        /// remains, which is far below the tolerance of the limits.
        #[test]
        fn j32_points_of_the_wire_are_interpolated_alike(
            (a, b) in (raw(), raw()), ms in prop::sample::select(&[1, 2, 7, 10, 100, u16::MAX][..]), u in 0.0..1.0f64,
        ) {
            let wanted = interpolate(&SetPoint::from(&a), &SetPoint::from(&b), f64::from(ms) * 1e-3, u);
            let mut got = SetPoint::default();
            Step::new(ms).between(&a, &b, u, &mut got);
            // A step of one minute amplifies rounding errors, because the values between its points are much larger
            // than the values at the points.
            let rounding = 0.01 * ROUNDING * (1.0 + f64::from(ms) * 1e-3).powi(2);
            for j in 0..JOINTS {
                prop_assert!((got.position[j] - wanted.position[j]).abs() < rounding);
                prop_assert!((got.velocity[j] - wanted.velocity[j]).abs() < rounding);
                prop_assert!((got.acceleration[j] - wanted.acceleration[j]).abs() < rounding);
            }
        }

        /// At a trajectory point, the interpolated set values are equal to the point in every bit. At a point at rest, the set velocity and
        /// the set acceleration are zero.
        #[test]
        fn j32_points_of_the_wire_are_met(a in raw(), b in raw(), ms in 1..=u16::MAX) {
            let (step, mut at) = (Step::new(ms), SetPoint::default());
            step.between(&a, &b, 0.0, &mut at);
            prop_assert_eq!(at, SetPoint::from(&a));
            step.between(&a, &b, 1.0, &mut at);
            prop_assert_eq!(at, SetPoint::from(&b));
        }

        /// The result of `position_speed` is equal to the derivative of the position.
        #[test]
        fn j32_the_speed_of_the_position_is_its_slope(a in point(), b in point(), h in 0.01..0.5f64, u in 0.01..0.99f64) {
            let at = |u| interpolate(&a, &b, h, u).position[2];
            let slope = (at(u + 1e-5) - at(u - 1e-5)) / (2e-5 * h);
            let speed = position_speed(&a, &b, h, u)[2];
            prop_assert!((slope - speed).abs() < 1e-5 * (1.0 + speed.abs()), "{slope} {speed}");
        }

        /// Rounding the positions to the int16 grid must not change velocity and acceleration.
        #[test]
        fn j32_position_grid_leaves_the_other_channels_alone(a in point(), b in point(), u in 0.0..1.0f64) {
            let mut rounded = b;
            rounded.position[0] += 96e-6;
            let (x, y) = (interpolate(&a, &b, 0.01, u), interpolate(&a, &rounded, 0.01, u));
            prop_assert_eq!(x.velocity, y.velocity);
            prop_assert_eq!(x.acceleration, y.acceleration);
        }
    }
}
