//! Time laws with limited jerk, by an interior-point method (Boyd and Vandenberghe 2004).
//!
//! The squared speed of the path parameter is a quadratic spline of the parameter, with a knot at the end of each cell.
//! The acceleration of the parameter is half the slope of the spline. The jerk of the parameter is half the second
//! derivative of the spline times the speed. Therefore squared velocity, acceleration and torque are linear in the
//! coefficients of the spline. The jerk is linear except for the root of the squared speed. Newton's method minimises
//! the sum of the time and the barriers of all limits, without the second derivatives of the limits. Only neighbouring
//! coefficients are coupled, so the computing time of a step is proportional to the number of cells. In the first and
//! the last cell the jerk is constant. Near rest the squared speed rises with the power 4/3, which a spline cannot
//! represent.
mod place;
mod problem;
mod spline;

use place::Place;
use spline::knot;

use crate::along::Plan;
use crate::law::Law;

/// Share of the total time that the barriers can add, one value for each round.
const GAPS: [f64; 3] = [0.2, 0.04, 0.008];
/// Maximum number of steps in each round.
const STEPS: usize = 12;
/// Smallest predicted gain of a Newton step, as a share of the time that the barriers can add in the round. Newton's
/// method ends if the gain is smaller.
const WORTH: f64 = 0.25;
/// Smallest fraction of a Newton step that the line search tries.
const SHORTEST: f64 = 1e-3;
/// Factor that reduces squared speeds outside the limits in the first search. The next two constants are the factor
/// in later searches, and the maximum number of reductions.
const LOWER: f64 = 0.85;
const LOWER_AGAIN: f64 = 0.97;
const LOWER_MAX: usize = 100;

/// Optimisation problem: minimises the duration plus the barriers of all limits.
struct Problem<'a> {
    plan: &'a Plan<'a>,
    places: Vec<Place>,
    /// Knots of the spline, between the first and the last cell.
    knots: Vec<f64>,
    /// Ratio of the first coefficient to its neighbour, and of the last coefficient to its neighbour. These ratios
    /// are fixed.
    ties: (f64, f64),
    /// Number of limits.
    limits: f64,
    end: f64,
}

impl<'a> Problem<'a> {
    fn tied(&self, c: &mut [f64]) {
        let n = c.len();
        (c[0], c[n - 1]) = (self.ties.0 * c[1], self.ties.1 * c[n - 2]);
    }

    /// Returns the time plus `barrier` times the barriers. The result is infinite if a limit is exceeded.
    fn value(&self, c: &[f64], barrier: f64) -> f64 {
        let mut sum = 0.0;
        for place in &self.places {
            let Some((time, logs)) = place.value(self.plan, c) else { return f64::INFINITY };
            sum += time - barrier * logs;
        }
        sum
    }

    /// Returns the step of Newton's method, and the predicted gain of this step.
    fn step(&self, c: &[f64], barrier: f64) -> Option<(Vec<f64>, f64)> {
        let n = c.len();
        let (mut gradient, mut hessian) = (vec![0.0; n], vec![[0.0f64; 3]; n]);
        for place in &self.places {
            place.add_to(&mut gradient, &mut hessian, self.plan, c, barrier);
        }
        // The first and the last coefficient are determined by their neighbours.
        let (first, last) = self.ties;
        gradient[1] += first * gradient[0];
        hessian[1][0] += first * (2.0 * hessian[0][1] + first * hessian[0][0]);
        hessian[1][1] += first * hessian[0][2];
        gradient[n - 2] += last * gradient[n - 1];
        hessian[n - 2][0] += last * (2.0 * hessian[n - 2][1] + last * hessian[n - 1][0]);
        hessian[n - 3][1] += last * hessian[n - 3][2];
        let mut step = solved(&mut hessian[1..n - 1], &gradient[1..n - 1])?;
        step.insert(0, first * step[0]);
        step.push(last * step[n - 2]);
        let promise: f64 = gradient[1..n - 1].iter().zip(&step[1..n - 1]).map(|(g, d)| -g * d).sum();
        Some((step, promise))
    }

    /// Returns the coefficients of a spline that is close to a time law.
    fn near(&self, law: &Law) -> Vec<f64> {
        let n = self.knots.len() as isize + 1;
        let place = |i: isize| 0.5 * (knot(&self.knots, i - 1) + knot(&self.knots, i));
        let mut c: Vec<f64> = (0..n).map(|i| law.at(law.time_of(place(i))).1.powi(2)).collect();
        self.tied(&mut c);
        c
    }

    /// Reduces the speeds until all limits are kept.
    fn within(&self, c: &mut [f64], by: f64) -> Option<()> {
        self.tied(c);
        let lower = |c: &mut [f64], by: f64| c.iter_mut().for_each(|c| *c *= by);
        for _ in 0..LOWER_MAX {
            let inside = self.value(c, 0.0).is_finite();
            lower(c, by);
            if inside {
                return Some(());
            }
        }
        None
    }

    /// Shortens the duration. `gaps` contains, for each round, the share of the duration that the barriers can add.
    fn improve(&self, c: &mut Vec<f64>, gaps: &[f64]) {
        for gap in gaps {
            let time = self.value(c, 0.0);
            let barrier = gap * time / self.limits;
            let mut before = self.value(c, barrier);
            let mut length = 1.0f64;
            for _ in 0..STEPS {
                let Some((step, promise)) = self.step(c, barrier) else { return };
                length = (4.0 * length).min(1.0);
                let found = loop {
                    let next: Vec<f64> = c.iter().zip(&step).map(|(c, d)| c + length * d).collect();
                    let value = self.value(&next, barrier);
                    if value < before - 0.1 * length * promise {
                        break Some((next, value));
                    }
                    length *= 0.5;
                    if length < SHORTEST {
                        break None;
                    }
                };
                let Some((next, value)) = found else { break };
                (*c, before) = (next, value);
                if promise < WORTH * gap * time {
                    break;
                }
            }
        }
    }
}

/// Solves a symmetric positive definite system of equations with the right-hand side `-right`. `bands` contains the
/// diagonal of the matrix and the two bands next to it.
fn solved(bands: &mut [[f64; 3]], right: &[f64]) -> Option<Vec<f64>> {
    let n = bands.len();
    let mut x: Vec<f64> = right.iter().map(|r| -r).collect();
    for i in 0..n {
        let [d, e, f] = bands[i];
        if !(d > 0.0 && d.is_finite()) {
            return None;
        }
        let (e_d, f_d) = (e / d, f / d);
        if i + 1 < n {
            bands[i + 1][0] -= e * e_d;
            bands[i + 1][1] -= f * e_d;
            x[i + 1] -= e_d * x[i];
        }
        if i + 2 < n {
            bands[i + 2][0] -= f * f_d;
            x[i + 2] -= f_d * x[i];
        }
    }
    for i in (0..n).rev() {
        let [d, e, f] = bands[i];
        let mut value = x[i];
        if i + 1 < n {
            value -= e * x[i + 1];
        }
        if i + 2 < n {
            value -= f * x[i + 2];
        }
        x[i] = value / d;
    }
    Some(x)
}

/// Search for the fastest time law along the cells of a plan.
pub(crate) struct Search<'a> {
    plan: &'a Plan<'a>,
    /// Coefficients of the last spline found.
    c: Vec<f64>,
    found: bool,
}

impl<'a> Search<'a> {
    /// Creates a search that starts near a given time law.
    pub(crate) fn new(plan: &'a Plan<'a>, near: &Law) -> Option<Self> {
        let c = Problem::new(plan, &vec![1.0; plan.cells.len()])?.near(near);
        Some(Self { plan, c, found: false })
    }

    /// Returns the fastest time law in which each cell is slowed down by its time factor in `slower`.
    pub(crate) fn fastest(&mut self, slower: &[f64]) -> Option<Law> {
        let problem = Problem::new(self.plan, slower)?;
        if self.found {
            // The previous solution is scaled down in the cells that `slower` slows down.
            for (i, c) in self.c.iter_mut().enumerate() {
                let near = slower[i.saturating_sub(2)..slower.len().min(i + 3)].iter();
                let most = near.fold(1.0f64, |most, s| most.max(*s));
                *c /= most * most;
            }
        }
        problem.within(&mut self.c, if self.found { LOWER_AGAIN } else { LOWER })?;
        problem.improve(&mut self.c, if self.found { &GAPS[GAPS.len() - 1..] } else { &GAPS });
        self.found = true;
        Some(problem.law(&self.c))
    }
}
