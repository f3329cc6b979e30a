//! Motion of the command `jtc demo`.
use crate::trajectory::{Point, Trajectory};

/// Duration of the demo motion, s.
const TIME: f64 = 10.0;
/// Time between two points of the demo motion, ms.
const STEP_MS: u16 = 10;
/// For each joint: deflection (rad), amplitude of the oscillation (rad) and number of oscillations.
const MOTION: [(f64, f64, f64); 6] =
    [(0.0, 1.5, 1.0), (0.45, 0.4, 2.0), (-1.5, 0.35, 2.0), (0.5, 0.6, 2.0), (0.9, 0.7, 1.0), (0.0, 0.5, 3.0)];

/// Returns the motion of `jtc demo`: a smooth motion of all joints from the zero pose and back. The position of each
/// joint is the sum of a deflection and an oscillation that begins and ends with amplitude 0. The motion begins and
/// ends at rest. Position, velocity and acceleration change without steps.
pub fn demo_motion() -> Trajectory {
    let count = (TIME * 1e3) as usize / usize::from(STEP_MS) + 1;
    let omega = std::f64::consts::TAU / TIME;
    let point = |i: usize| {
        let t = i as f64 * f64::from(STEP_MS) * 1e-3;
        let mut p = Point::default();
        for (j, (bend, swing, n)) in MOTION.into_iter().enumerate() {
            p.position[j] = bend * 0.375;
            // With s from 0 to 1 over the duration, the position is B·sin⁴(πs) + A·sin²(πs)·sin(2πns). The formula is
            // written as a sum of sines and cosines, because these have simple derivatives.
            for (a, b, n) in [
                (0.0, -0.5 * bend, 1.0),
                (0.0, 0.125 * bend, 2.0),
                (0.5 * swing, 0.0, n),
                (-0.25 * swing, 0.0, n + 1.0),
                (-0.25 * swing, 0.0, n - 1.0),
            ] {
                let w = omega * n;
                let (sin, cos) = (w * t).sin_cos();
                p.position[j] += a * sin + b * cos;
                p.velocity[j] += w * (a * cos - b * sin);
                p.acceleration[j] -= w * w * (a * sin + b * cos);
            }
        }
        p
    };
    Trajectory { step_ms: STEP_MS, points: (0..count).map(point).collect() }
}

#[cfg(test)]
mod tests {
    use crate::Arm;
    use jtc_wire::Joint;

    use super::*;

    #[test]
    fn the_motion_begins_and_ends_at_rest_and_keeps_the_limits() {
        let arm = Arm::avena();
        let t = demo_motion();
        assert_eq!(t.duration_s(), TIME);
        for p in [t.points.first().unwrap(), t.points.last().unwrap()] {
            for j in 0..6 {
                assert!(
                    p.position[j].abs() < 1e-9
                        && p.velocity[j].abs() < 1e-9
                        && p.acceleration[j].abs() < 1e-9
                );
            }
        }
        for p in &t.points {
            for (joint, limit) in Joint::ALL.into_iter().zip(&arm.joints) {
                let j = joint.index();
                assert!(p.position[j].abs() < 0.95 * limit.position_max, "{joint}: {} rad", p.position[j]);
                assert!(p.velocity[j].abs() < 0.8 * limit.velocity_max, "{joint}: {} rad/s", p.velocity[j]);
                assert!(p.acceleration[j].abs() < 0.5 * limit.acceleration_max);
            }
        }
    }
}
