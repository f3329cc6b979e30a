//! Gravity torques and inertias of an arm at rest: the greatest gravity torque of each joint over all positions, and
//! the inertia that each joint moves.

use jtc_core::JOINTS;
use jtc_dynamics::{ArmModel, Dynamics, JointVec};

/// Lowest and highest position of each joint, rad.
pub(super) type Ranges = [(f64, f64); JOINTS];

/// Number of start poses in the search for the greatest gravity torque.
const STARTS: usize = 24;
/// Maximum number of rounds over all joints in one search for the greatest gravity torque. A search usually ends after three rounds.
const ROUNDS: usize = 12;
/// Number of poses for which the inertia is computed.
pub(super) const POSES: usize = 512;
/// Relative increase of the torque below which the search treats two torques as equal.
const GAIN: f64 = 1e-9;

/// Greatest gravity torque of a joint (N·m, magnitude), and a pose (rad) with this torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Worst {
    pub torque: f64,
    pub pose: JointVec,
}

/// Least and greatest inertia (kg·m²) that a joint moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Inertia {
    /// Inertia while the other joints can move freely. The drive must accelerate this inertia at the start of a motion.
    pub least: f64,
    /// Inertia while the other joints are held in position.
    pub most: f64,
}

/// Returns the `n`-th pose of a sequence that fills the ranges evenly (Halton 1960).
pub(super) fn pose(n: usize, ranges: &Ranges) -> JointVec {
    const PRIMES: [usize; JOINTS] = [2, 3, 5, 7, 11, 13];
    std::array::from_fn(|j| {
        let (mut rest, mut share, mut unit) = (n + 1, 0.0, 1.0);
        while rest > 0 {
            unit /= PRIMES[j] as f64;
            share += unit * (rest % PRIMES[j]) as f64;
            rest /= PRIMES[j];
        }
        ranges[j].0 + share * (ranges[j].1 - ranges[j].0)
    })
}

/// Returns the angle x in a range at which the function a + b·cos x + c·sin x is greatest. `values` are the values of this function at the
/// angle `at` and at a third of a turn in each direction.
fn crest(values: [f64; 3], at: f64, (low, high): (f64, f64)) -> f64 {
    let third = std::f64::consts::TAU / 3.0;
    let angles = [at, at + third, at - third];
    let mean = values.iter().sum::<f64>() / 3.0;
    let part = |f: fn(f64) -> f64| values.iter().zip(angles).map(|(v, x)| v * f(x)).sum::<f64>() * 2.0 / 3.0;
    let (b, c) = (part(f64::cos), part(f64::sin));
    let height = |x: f64| mean + b * x.cos() + c * x.sin();
    let top = c.atan2(b);
    let turned = top + std::f64::consts::TAU * ((low - top) / std::f64::consts::TAU).ceil();
    let ends = [low, high].into_iter().chain((turned <= high).then_some(turned));
    ends.max_by(|x, y| height(*x).total_cmp(&height(*y))).unwrap_or(low)
}

/// Returns the greatest gravity torque of each joint over the position ranges.
///
/// If only one joint position changes, each gravity torque is a sine with an offset, so a formula determines its maximum. The search
/// optimises one joint position after the other until no change increases the torque. The search is repeated from many start poses.
pub(super) fn worst_gravity(model: &ArmModel, gravity: [f64; 3], ranges: &Ranges) -> [Worst; JOINTS] {
    let dynamics = Dynamics::new(model, gravity);
    let third = std::f64::consts::TAU / 3.0;
    std::array::from_fn(|joint| {
        let torque = |q: &JointVec| dynamics.gravity_torque(q)[joint];
        let mut best = Worst { torque: 0.0, pose: ranges.map(nearest_zero) };
        for (start, sign) in (0..STARTS).flat_map(|n| [(n, 1.0), (n, -1.0)]) {
            let mut q = pose(start, ranges);
            let mut height = sign * torque(&q);
            for _ in 0..ROUNDS {
                let before = height;
                for j in 0..JOINTS {
                    let along = |x: f64| sign * torque(&with(&q, j, x));
                    let at = q[j];
                    let values = [along(at), along(at + third), along(at - third)];
                    let next = with(&q, j, crest(values, at, ranges[j]));
                    let gained = sign * torque(&next);
                    if gained > height + GAIN * height.abs() {
                        (q, height) = (next, gained);
                    }
                }
                if height <= before + GAIN * before.abs() {
                    break;
                }
            }
            // A torque that is higher only by a rounding error does not replace the best pose.
            if height > best.torque * (1.0 + GAIN) + 1e-9 {
                best = Worst { torque: height, pose: plain(&q, sign, height, ranges, &torque) };
            }
        }
        best
    })
}

/// Returns the pose `q` in a simpler form: each position that does not affect the torque is set to 0, or to the value
/// nearest to 0 in its range.
fn plain(
    q: &JointVec,
    sign: f64,
    height: f64,
    ranges: &Ranges,
    torque: &impl Fn(&JointVec) -> f64,
) -> JointVec {
    let mut q = *q;
    for j in 0..JOINTS {
        let simpler = with(&q, j, nearest_zero(ranges[j]));
        if sign * torque(&simpler) >= height * (1.0 - 1e-6) {
            q = simpler;
        }
    }
    q
}

fn nearest_zero((low, high): (f64, f64)) -> f64 {
    0.0f64.max(low).min(high)
}

fn with(q: &JointVec, joint: usize, position: f64) -> JointVec {
    let mut q = *q;
    q[joint] = position;
    q
}

/// Returns the least and greatest inertia of each joint with its rotor for poses distributed over the position ranges.
pub(super) fn inertia(model: &ArmModel, rotor: &JointVec, ranges: &Ranges) -> [Inertia; JOINTS] {
    let dynamics = Dynamics::new(model, [0.0; 3]);
    let mut all = [Inertia { least: f64::INFINITY, most: 0.0 }; JOINTS];
    for q in (0..POSES).map(|n| pose(n, ranges)) {
        let matrix = dynamics.mass_matrix(&q);
        for (j, inertia) in all.iter_mut().enumerate() {
            let unit: JointVec = std::array::from_fn(|k| if k == j { 1.0 } else { 0.0 });
            let free = 1.0 / dynamics.forward(&q, &[0.0; JOINTS], &unit, rotor)[j];
            inertia.most = inertia.most.max(matrix[j][j] + rotor[j]);
            if free.is_finite() && free > 0.0 {
                inertia.least = inertia.least.min(free);
            }
        }
    }
    for inertia in &mut all {
        inertia.least = inertia.least.min(inertia.most);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::Arm;

    fn ranges(arm: &Arm) -> Ranges {
        arm.joints.map(|j| (j.position_min, j.position_max))
    }

    /// The computed greatest gravity torque is compared with the torques on a grid of all positions that affect the
    /// torque. No torque on the grid may be greater.
    #[test]
    fn the_greatest_gravity_torque_is_no_less_than_any_on_a_grid() {
        let arm = Arm::avena();
        let (gravity, ranges) = ([1.0, -2.0, -9.5], ranges(&arm));
        let worst = worst_gravity(&arm.model, gravity, &ranges);
        let dynamics = Dynamics::new(&arm.model, gravity);
        let mut grid = [0.0f64; JOINTS];
        const STEPS: usize = 7;
        for n in 0..STEPS.pow(6) {
            let q: JointVec = std::array::from_fn(|j| {
                let step = n / STEPS.pow(j as u32) % STEPS;
                ranges[j].0 + (ranges[j].1 - ranges[j].0) * step as f64 / (STEPS - 1) as f64
            });
            for (most, torque) in grid.iter_mut().zip(dynamics.gravity_torque(&q)) {
                *most = most.max(torque.abs());
            }
        }
        for (j, (found, most)) in worst.iter().zip(grid).enumerate() {
            assert!(found.torque >= most * (1.0 - 1e-9), "joint {}: {} < {most}", j + 1, found.torque);
            assert!(
                found.torque <= 1.2 * most + 0.1,
                "joint {}: {} is far above {most}",
                j + 1,
                found.torque
            );
            let there = dynamics.gravity_torque(&found.pose)[j].abs();
            assert!((there - found.torque).abs() <= 1e-5 * found.torque + 1e-9, "{there} {found:?}");
            let inside = |(q, (low, high)): (&f64, &(f64, f64))| (*low..=*high).contains(q);
            assert!(found.pose.iter().zip(&ranges).all(inside), "{:?}", found.pose);
        }
    }

    #[test]
    fn an_upright_arm_asks_nothing_of_its_first_joint() {
        let arm = Arm::avena();
        let worst = worst_gravity(&arm.model, [0.0, 0.0, -9.81], &ranges(&arm));
        assert!(worst[0].torque < 1e-9, "{}", worst[0].torque);
        assert_eq!(worst[1].pose[0], 0.0, "what does not matter is at 0");
    }

    #[test]
    fn a_crest_is_found_in_the_range_or_at_its_end() {
        let third = std::f64::consts::TAU / 3.0;
        let values = |at: f64| [at, at + third, at - third].map(|x: f64| 0.5 + 2.0 * (x - 1.0).cos());
        assert!((crest(values(0.2), 0.2, (-2.0, 2.0)) - 1.0).abs() < 1e-12);
        assert!((crest(values(0.2), 0.2, (5.0, 9.0)) - (1.0 + std::f64::consts::TAU)).abs() < 1e-12);
        assert_eq!(crest(values(0.2), 0.2, (-2.0, 0.5)), 0.5);
        assert_eq!(crest(values(0.2), 0.2, (1.5, 2.0)), 1.5);
    }

    #[test]
    fn a_joint_moves_no_less_than_its_rotor_and_less_when_others_give_way() {
        let arm = Arm::avena();
        let rotor = arm.joints.map(|j| j.rotor_inertia);
        for inertia in inertia(&arm.model, &rotor, &ranges(&arm)) {
            assert!(inertia.least >= 0.7 && inertia.least <= inertia.most, "{inertia:?}");
        }
    }
}
