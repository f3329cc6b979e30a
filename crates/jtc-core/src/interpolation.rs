//! Set values between two trajectory points (J-32).
//!
//! Each channel comes from its own samples: the position from the quintic through both points' position, velocity and
//! acceleration, the velocity from the cubic through their velocity and acceleration, the acceleration from the line. No
//! channel is the derivative of another, because the int16 grid of the positions (96 µrad) would turn into tens of rad/s².
use core::array::from_fn;

use jtc_wire::RawPoint;

use crate::JOINTS;

/// Position (rad), velocity (rad/s) and acceleration (rad/s²) of every joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
    /// rad.
    pub position: [f64; JOINTS],
    /// rad/s.
    pub velocity: [f64; JOINTS],
    /// rad/s².
    pub acceleration: [f64; JOINTS],
}

impl SetPoint {
    /// Standing still at `position`.
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

/// What rounding may add to a value between two points, in rad and rad/s: far below what any limit means.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Rises from 0 to 1 without a corner.
pub(crate) fn smooth(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * (3.0 - 2.0 * u)
}

/// Hermite's basis at one place between two points: what each sample contributes to a channel. It is the same for all joints.
struct Basis {
    /// Of the way between the positions.
    way: f64,
    /// Of both velocities to the position, s.
    velocity: [f64; 2],
    /// Of both accelerations to the position, s².
    acceleration: [f64; 2],
    /// Of the change between the velocities to the velocity.
    change: f64,
    /// Of both accelerations to the velocity, s.
    slope: [f64; 2],
}

impl Basis {
    /// At the fraction `u` of a step of `h` seconds.
    fn at(u: f64, h: f64) -> Self {
        let (u2, h2) = (u * u, h * h);
        let u3 = u2 * u;
        Self {
            way: u3 * (10.0 - 15.0 * u + 6.0 * u2),
            velocity: [h * (u + u3 * (-6.0 + 8.0 * u - 3.0 * u2)), h * (u3 * (-4.0 + 7.0 * u - 3.0 * u2))],
            acceleration: [
                h2 * (0.5 * u2 + u3 * (-1.5 + 1.5 * u - 0.5 * u2)),
                h2 * (u3 * (0.5 - u + 0.5 * u2)),
            ],
            change: u2 * (3.0 - 2.0 * u),
            slope: [h * (u - 2.0 * u2 + u3), h * (u3 - u2)],
        }
    }
}

/// Set values at the fraction `u` (0..1) of the way from `a` to `b`, which are `h` seconds apart.
#[inline]
pub fn interpolate(a: &SetPoint, b: &SetPoint, h: f64, u: f64) -> SetPoint {
    let basis = Basis::at(u, h);
    let position = |j: usize| {
        let way = basis.way * (b.position[j] - a.position[j]);
        let velocities = basis.velocity[0] * a.velocity[j] + basis.velocity[1] * b.velocity[j];
        let accelerations =
            basis.acceleration[0] * a.acceleration[j] + basis.acceleration[1] * b.acceleration[j];
        a.position[j] + (way + velocities + accelerations)
    };
    let velocity = |j: usize| {
        let change = basis.change * (b.velocity[j] - a.velocity[j]);
        let slopes = basis.slope[0] * a.acceleration[j] + basis.slope[1] * b.acceleration[j];
        a.velocity[j] + (change + slopes)
    };
    let acceleration = |j: usize| a.acceleration[j] + u * (b.acceleration[j] - a.acceleration[j]);
    SetPoint { position: from_fn(position), velocity: from_fn(velocity), acceleration: from_fn(acceleration) }
}

/// Speed of the position itself (rad/s) where [`interpolate`] takes it: that of the cubic, and what is due to the way that the
/// velocities of both points do not explain.
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

        /// A motion that is itself a quintic in position is reproduced in position; one that is a cubic in velocity, in velocity.
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
            // Velocity: compare with the cubic of a motion whose velocity is one.
            let cubic = |t: f64| (c[1] + t * (c[2] + t * (c[3] + t * c[4])), c[2] + t * (2.0 * c[3] + t * 3.0 * c[4]));
            let knot = |t: f64| SetPoint { position: [0.0; 6], velocity: [cubic(t).0; 6], acceleration: [cubic(t).1; 6] };
            let got = interpolate(&knot(0.0), &knot(h), h, u);
            prop_assert!((got.velocity[0] - cubic(u * h).0).abs() < 1e-12);
            prop_assert!((got.acceleration[0] - (cubic(0.0).1 + u * (cubic(h).1 - cubic(0.0).1))).abs() < 1e-12);
        }

        /// The speed of the position is its derivative.
        #[test]
        fn j32_the_speed_of_the_position_is_its_slope(a in point(), b in point(), h in 0.01..0.5f64, u in 0.01..0.99f64) {
            let at = |u| interpolate(&a, &b, h, u).position[2];
            let slope = (at(u + 1e-5) - at(u - 1e-5)) / (2e-5 * h);
            let speed = position_speed(&a, &b, h, u)[2];
            prop_assert!((slope - speed).abs() < 1e-5 * (1.0 + speed.abs()), "{slope} {speed}");
        }

        /// Rounding the positions to the int16 grid must not leak into velocity and acceleration.
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
