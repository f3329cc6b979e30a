//! Inverse kinematics by iteration: Levenberg-Marquardt on the geometric Jacobian, from one or from many starting values.
use std::f64::consts::{PI, TAU};

use jtc_dynamics::{JOINTS, JointVec};
use nalgebra::{Cholesky, Matrix6, Vector6};

use super::chain::{Chain, Frame};

/// Maximum residual of a solution, m and rad.
pub(crate) const TOLERANCE: f64 = 1e-9;
/// Squared residual below which the residual consists only of rounding errors. The residual consists of the
/// translation divided by the arm's length, and of the rotation in rad.
const ROUNDING: f64 = 1e-29;
/// Largest step of a joint in an iteration, rad. For larger steps, the linearisation is not accurate enough.
const STEP: f64 = 0.7;
/// Maximum joint difference between two solutions that are treated as one, rad. Such solutions occur near a
/// singularity, because this joint difference moves the flange by only nanometres.
pub(crate) const SAME: f64 = 1e-4;
/// Largest number of solutions of an arm with six revolute joints, except in singular poses (Primrose 1986).
const SOLUTIONS: usize = 16;
/// Smallest and largest number of starting values.
const SEEDS: (usize, usize) = (200, 1_500);

/// Result of an iteration: joint positions, and their squared residual.
pub(crate) struct Reached {
    pub q: JointVec,
    pub squared: f64,
    pub residual: Vector6<f64>,
}

/// Moves `q` to the minimum of the residual with the weights `weights`, in at most `iterations` steps. Uses
/// Levenberg-Marquardt with damping proportional to the squared residual (Sugihara 2011), which converges
/// quadratically and is stable in singular poses.
pub(crate) fn descend(
    chain: &Chain,
    goal: &Frame,
    mut q: JointVec,
    weights: &Vector6<f64>,
    iterations: usize,
) -> Reached {
    let weights2 = weights.component_mul(weights);
    let cost = |residual: &Vector6<f64>| residual.component_mul(residual).dot(&weights2);
    let mut axes = chain.at(&q);
    let mut residual = chain.residual(goal, &axes);
    let mut squared = cost(&residual);
    let mut share = 0.1;
    for _ in 0..iterations {
        if squared < ROUNDING || share > 1e9 {
            break;
        }
        let jacobian = chain.scaled_jacobian(&axes);
        let weighted = Matrix6::from_fn(|row, column| weights2[row] * jacobian[(row, column)]);
        let normal = weighted.tr_mul(&jacobian) + Matrix6::identity() * (share * squared + 1e-15);
        let Some(factors) = Cholesky::new(normal) else {
            share *= 10.0;
            continue;
        };
        let mut step = factors.solve(&weighted.tr_mul(&residual));
        let largest = step.amax();
        if largest > STEP {
            step *= STEP / largest;
        }
        let tried: JointVec = std::array::from_fn(|j| q[j] + step[j]);
        let there = chain.at(&tried);
        let left = chain.residual(goal, &there);
        let cost_there = cost(&left);
        if cost_there < squared {
            (q, axes, residual, squared) = (tried, there, left, cost_there);
            share = (0.2 * share).max(1e-4);
        } else if squared < 1e-24 {
            break;
        } else {
            share *= 10.0;
        }
    }
    Reached { q, squared, residual }
}

/// Returns the solution to which the iteration from `q` converges. Returns `None` if the iteration does not converge.
/// The joint positions of the solution are within (−π, π].
pub(crate) fn converge(chain: &Chain, goal: &Frame, q: &JointVec, iterations: usize) -> Option<JointVec> {
    let reached = descend(chain, goal, *q, &Vector6::repeat(1.0), iterations);
    fits(chain, &reached).then(|| reached.q.map(principal))
}

/// Returns `true` if the flange is at the goal.
fn fits(chain: &Chain, reached: &Reached) -> bool {
    let r = &reached.residual;
    let shift = r.fixed_rows::<3>(0).norm() * chain.length;
    shift <= TOLERANCE && r.fixed_rows::<3>(3).norm() <= TOLERANCE
}

/// Returns the equivalent angle within (−π, π].
pub(crate) fn principal(angle: f64) -> f64 {
    let turned = angle - TAU * (angle / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}

/// Adds a solution that is not yet in the list. Returns `true` if the solution was added.
pub(crate) fn add(solutions: &mut Vec<JointVec>, q: JointVec) -> bool {
    let same = |other: &JointVec| q.iter().zip(other).all(|(a, b)| principal(a - b).abs() < SAME);
    let new = !solutions.iter().any(same);
    if new {
        solutions.push(q);
    }
    new
}

/// Adds the solutions that the iteration finds from many fixed starting values. The search ends when many consecutive
/// starting values give no new solution. If the number of solutions is odd, the search continues, because the solutions
/// are roots of a polynomial of even degree.
pub(crate) fn search(chain: &Chain, goal: &Frame, solutions: &mut Vec<JointVec>) {
    let mut last = 0;
    for n in 1..=SEEDS.1 {
        let complete = solutions.len().is_multiple_of(2) && n > SEEDS.0.max(4 * last);
        if solutions.len() >= SOLUTIONS || complete {
            break;
        }
        if let Some(q) = converge(chain, goal, &seed(n), 40)
            && add(solutions, q)
        {
            last = n;
            // A new solution is accurate only to the tolerance. Therefore the solution is refined until only rounding
            // errors remain.
            if let (Some(newest), Some(refined)) = (solutions.last_mut(), converge(chain, goal, &q, 40)) {
                *newest = refined;
            }
        }
    }
}

/// Returns `true` if the search finds a solution, near `near` or elsewhere.
pub(crate) fn is_reachable(chain: &Chain, goal: &Frame, near: &JointVec) -> bool {
    let reached = |q: &JointVec| converge(chain, goal, q, 40).is_some();
    reached(near) || (1..=SEEDS.0).any(|n| reached(&seed(n)))
}

/// Returns the n-th starting value of Halton's sequence, which fills the space of all joint positions evenly.
pub(crate) fn seed(n: usize) -> JointVec {
    const BASES: [usize; JOINTS] = [2, 3, 5, 7, 11, 13];
    BASES.map(|base| {
        let (mut rest, mut place, mut value) = (n, 1.0, 0.0);
        while rest > 0 {
            place /= base as f64;
            value += place * (rest % base) as f64;
            rest /= base;
        }
        TAU * value - PI
    })
}
