//! Range of inertias for which the control loop of an arm is stable with its gains (J-41, J-71).
//!
//! In the control loop of one joint, the controller reads a position and computes a torque. The computed torque takes effect `delay_ticks`
//! later and lasts for one tick. The controller computes the derivative over five ticks. The control loop of one joint is stable between a
//! lower and an upper inertia. Below the lower inertia, the delay of the derivative is too long. Above the upper inertia, the integral gain
//! is too high.
//!
//! For coupled joints, D and U are the diagonal matrices of the lower and upper inertias of the joints. M is the mass matrix with rotors.
//! The arm is stable if M − D and U − M are positive definite. The stability condition is exact if the ratios of Kp, Ki and Kd are the same
//! for all joints.

use std::f64::consts::PI;

use jtc_core::{JOINTS, PidGains};
use jtc_dynamics::{ArmModel, Dynamics, JointVec};

use super::statics::{POSES, Ranges, pose};

/// Duration of one tick of the controller, s.
const DT: f64 = 1e-3;
/// Number of ticks over which the controller computes the derivative (J-41).
const WINDOW: f64 = 5.0;
/// Number of steps of the frequency search, from [`SLOWEST`] to half of the tick rate.
const STEPS: i32 = 400;
/// Lowest frequency of the frequency search, rad per tick.
const SLOWEST: f64 = 1e-6;
/// Range of the ratio of the real rotor inertia to the proposed rotor inertia. Rotor inertias within one family of
/// drives differ by such ratios. Until the rotor inertia is measured, the gains must be stable for the whole range.
pub(super) const PROPOSED_RANGE: RotorMargin = RotorMargin { down: 0.2, up: 3.0 };
/// Smallest and largest factor that the search for the stable range applies to the rotor inertias.
const FACTORS: (f64, f64) = (0.0, 1000.0);

type Matrix = [[f64; JOINTS]; JOINTS];

/// Range of inertias (kg·m²) in which a joint is stable with its gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StableInertia {
    /// Lowest stable inertia. Below this inertia, the delay of the derivative is too long.
    pub least: f64,
    /// Highest stable inertia. Above this inertia, the integral gain is too high. The highest stable inertia is infinite if the integral
    /// gain is 0.
    pub most: f64,
}

/// Range of factors for the rotor inertias in the file. Within this range the arm is stable.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RotorMargin {
    /// Lowest factor for which the arm is stable; 0 if the arm is stable even without a rotor.
    pub down: f64,
    /// Highest factor for which the arm is stable, up to 1000.
    pub up: f64,
}

impl StableInertia {
    /// Returns the range of inertias for which the gains are stable. Returns `None` if the gains are not stable with any inertia, or are
    /// not finite.
    ///
    /// In the formulas, θ is the frequency in rad per tick. The loop transfer function is −T²/4J · cos(θ/2)/sin²(θ/2) · H(θ). H is the
    /// control law with its delay, and with an additional delay of half a tick because each torque stays constant for one tick. At a
    /// stability limit, H is real and the loop transfer function is −1. The condition that the loop transfer function is −1 determines the
    /// inertia J.
    pub(super) fn of(gains: &PidGains, delay_ticks: u8) -> Option<Self> {
        let turned = |theta: f64| {
            let half = 0.5 * gains.ki * DT;
            let d = gains.kd / (WINDOW * DT);
            let real = gains.kp + half + d * (1.0 - (WINDOW * theta).cos());
            let imaginary = d * (WINDOW * theta).sin() - half / (0.5 * theta).tan();
            let (s, c) = (theta * (f64::from(delay_ticks) + 0.5)).sin_cos();
            (real * c + imaginary * s, imaginary * c - real * s)
        };
        let inertia = |theta: f64| {
            let (s, c) = (0.5 * theta).sin_cos();
            0.25 * DT * DT * c / (s * s) * turned(theta).0
        };
        let crossing = |mut low: f64, mut high: f64| {
            let rises = turned(high).1 > 0.0;
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if (turned(middle).1 > 0.0) == rises { high = middle } else { low = middle }
            }
            inertia(0.5 * (low + high))
        };
        let theta = |step: i32| SLOWEST * (PI / SLOWEST).powf(f64::from(step) / f64::from(STEPS));
        let mut found = Self { least: 0.0, most: f64::INFINITY };
        let mut leads = turned(theta(0)).1 > 0.0;
        let mut has_led = leads;
        for step in 1..STEPS {
            let (before, at) = (theta(step - 1), theta(step));
            let now = turned(at).1 > 0.0;
            if now && !leads && !has_led {
                found.most = crossing(before, at);
                has_led = true;
            } else if leads && !now {
                found.least = found.least.max(crossing(before, at));
            }
            leads = now;
        }
        (has_led && found.least > 0.0 && found.least < found.most).then_some(found)
    }
}

/// Returns the stable range of inertias of each joint. Returns `None` if one of the joints has no stable range.
pub(super) fn all_stable(gains: &[PidGains; JOINTS], delay_ticks: u8) -> Option<[StableInertia; JOINTS]> {
    let each: Vec<StableInertia> = gains.iter().filter_map(|g| StableInertia::of(g, delay_ticks)).collect();
    each.try_into().ok()
}

/// Returns the mass matrices, without rotors, for poses distributed over the position ranges.
pub(super) fn mass_matrices(model: &ArmModel, ranges: &Ranges) -> Vec<Matrix> {
    let dynamics = Dynamics::new(model, [0.0; 3]);
    (0..POSES).map(|n| dynamics.mass_matrix(&pose(n, ranges))).collect()
}

/// Returns `true` if a symmetric matrix is positive definite, by Cholesky decomposition.
fn is_positive(mut a: Matrix) -> bool {
    for k in 0..JOINTS {
        if a[k][k].is_nan() || a[k][k] <= 0.0 {
            return false;
        }
        // Copy of the column below the pivot before this column is changed.
        let column: JointVec = std::array::from_fn(|i| a[i][k]);
        for (i, row) in a.iter_mut().enumerate().skip(k + 1) {
            let factor = column[i] / column[k];
            row.iter_mut().zip(&column).take(i + 1).skip(k + 1).for_each(|(v, c)| *v -= factor * c);
        }
    }
    true
}

/// Returns `true` if the arm with the given rotors has enough inertia in this pose to be stable. Condition: the mass
/// matrix minus `reserve` times the lower limits in `stable` is positive definite.
pub(super) fn is_heavy_enough(
    m: &Matrix,
    rotor: &JointVec,
    stable: &[StableInertia; JOINTS],
    reserve: f64,
) -> bool {
    let mut a = *m;
    (0..JOINTS).for_each(|j| a[j][j] += rotor[j] - reserve * stable[j].least);
    is_positive(a)
}

/// Returns `true` if the inertia of the arm with the given rotors is low enough in this pose for the arm to be
/// stable. Condition: the upper limits in `stable` divided by `reserve`, minus the mass matrix, are positive
/// definite.
pub(super) fn is_light_enough(
    m: &Matrix,
    rotor: &JointVec,
    stable: &[StableInertia; JOINTS],
    reserve: f64,
) -> bool {
    let mut a = m.map(|row| row.map(|v| -v));
    (0..JOINTS).for_each(|j| a[j][j] += (stable[j].most / reserve).min(1e15) - rotor[j]);
    is_positive(a)
}

/// Returns the smallest and largest factor for the rotor inertias of the joints `of` that keeps the arm stable. Returns
/// `None` if the arm is not stable with the rotor inertias `rotor`.
pub(super) fn rotor_margin(
    matrices: &[Matrix],
    rotor: &JointVec,
    stable: &[StableInertia; JOINTS],
    of: [bool; JOINTS],
) -> Option<RotorMargin> {
    let scaled = |factor: f64| std::array::from_fn(|j| if of[j] { rotor[j] * factor } else { rotor[j] });
    let mut margin = RotorMargin { down: FACTORS.0, up: FACTORS.1 };
    for m in matrices {
        let light = |factor: f64| is_heavy_enough(m, &scaled(factor), stable, 1.0);
        let heavy = |factor: f64| is_light_enough(m, &scaled(factor), stable, 1.0);
        if !light(1.0) || !heavy(1.0) {
            return None;
        }
        margin.down = end(margin.down, light);
        margin.up = end(margin.up, heavy);
    }
    Some(margin)
}

/// Searches for the limit of a range: the factor between 1 and `far` that is nearest to `far` and for which `holds`
/// returns `true`. `holds(1)` must be `true`.
fn end(far: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(far) {
        return far;
    }
    let (mut good, mut bad) = (1.0, far);
    for _ in 0..30 {
        let middle = 0.5 * (good + bad);
        if holds(middle) { good = middle } else { bad = middle }
    }
    good
}

#[cfg(test)]
#[path = "gains_tests.rs"]
mod tests;
