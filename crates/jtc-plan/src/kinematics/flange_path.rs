//! Paths in joint space on which the flange follows straight lines and arcs.
use jtc_dynamics::{JOINTS, JointVec, Pose};
use jtc_wire::Joint;
use nalgebra::{Vector3, Vector6};

use super::chain::{Axes, Chain, Frame};
use super::leg::{Leg, Place};
use super::search::{TOLERANCE, is_reachable};
use super::singular::{SINGULAR, nearest, weakest};
use super::trace::Trace;
use super::{Kinematics, PoseError, outside};
use crate::{Path, PathPoint};

/// Largest rotation of a joint between two samples, rad. With steps of this size, the iteration stays with one
/// solution and detects singular poses.
const TURN: f64 = 0.02;
/// Largest and smallest distance between two samples, m.
const STEP: (f64, f64) = (0.01, 1e-7);
/// Largest rotation of a joint between two breaks, rad. With this rotation, the curve between two breaks is simple
/// enough for the planner.
const SIMPLE: f64 = 0.25;
/// Number of points on the remainder of the leg that are tested. The test detects whether the leg leaves the reach of
/// the arm.
const LOOK_AHEAD: usize = 40;

/// A path through joint space on which the flange moves on straight lines and arcs, with corners blended within a radius.
///
/// The path parameter is the length of the legs, m. A rotation of 1 rad counts as [`RADIUS`](super::RADIUS). With a
/// blend radius of 0 the path stops at each corner. The path computes each position by inverse kinematics. Therefore
/// the flange is on the line, except for rounding. The derivatives are computed from the Jacobian and its rate.
///
/// The arm keeps its initial configuration (elbow, wrist, shoulder).
#[derive(Clone, Debug)]
pub struct FlangePath {
    chain: Chain,
    trace: Trace,
    /// Joint positions along the path, in the order of the path parameter. The iteration starts from these positions.
    samples: Vec<(f64, JointVec)>,
    breaks: Vec<f64>,
}

impl FlangePath {
    /// Creates the path from the joint positions `start` (rad) along `legs`. Corners are blended within `blend` m,
    /// which is limited to half of each leg. If `blend` is 0, the path stops at the corners. The first waypoint is
    /// the start, so waypoint 2 is the end of leg 1. Legs without motion are skipped.
    ///
    /// # Errors
    ///
    /// Returns [`PoseError::Waypoint`] for an invalid pose or a pose without a solution within the limits. Returns
    /// [`PoseError::Leg`] for an error along a leg: a joint at its limit, a singular pose, or the end of the arm's
    /// reach. If several errors occur, the first error along the path is returned. All waypoints are checked before the
    /// legs.
    pub fn new(
        kinematics: &Kinematics,
        start: &JointVec,
        legs: &[Leg],
        blend: f64,
    ) -> Result<Self, PoseError> {
        if let Some(&value) = start.iter().find(|q| !q.is_finite()) {
            return Err(PoseError::NotFinite { what: "a joint position", value }.at_waypoint(1));
        }
        if let Some(error) = outside(start, &kinematics.limits) {
            return Err(error.at_waypoint(1));
        }
        let chain = &kinematics.chain;
        let trace = Trace::new(&chain.at(start).flange, legs, blend)?;
        for (n, Leg::Line { to } | Leg::Arc { to, .. }) in legs.iter().enumerate() {
            kinematics.solve(to, start).map_err(|error| error.at_waypoint(n + 2))?;
        }
        let samples = Follower::new(kinematics, &trace, start)?.follow()?;
        let breaks = breaks(&trace, &samples);
        Ok(Self { chain: chain.clone(), trace, samples, breaks })
    }

    /// Returns the parameter at which the arc with leg number `number` (from 1) passes its `via` point. Returns
    /// `None` if the rounding of a corner removes this point from the path.
    pub(crate) fn via(&self, number: usize) -> Option<f64> {
        self.trace.via(number)
    }

    /// Returns the pose of the flange at `s`.
    pub fn flange(&self, s: f64) -> Pose {
        (&self.trace.at(s).frame).into()
    }
}

impl Path for FlangePath {
    fn end(&self) -> f64 {
        self.trace.end()
    }

    fn at(&self, s: f64) -> PathPoint {
        let place = self.trace.at(s);
        let behind = self.samples.partition_point(|sample| sample.0 <= s).clamp(1, self.samples.len() - 1);
        let ((before, a), (after, b)) = (self.samples[behind - 1], self.samples[behind]);
        let share = ((s - before) / (after - before)).clamp(0.0, 1.0);
        let guess = std::array::from_fn(|j| a[j] + share * (b[j] - a[j]));
        let (position, axes) = newton(&self.chain, &place.frame, guess);
        let (first, second) = derivatives(&axes, &place).unwrap_or_default();
        PathPoint { position, first: first.into(), second: second.into() }
    }

    fn waypoint(&self, s: f64) -> Option<usize> {
        Some(self.trace.waypoints().partition_point(|&at| at <= s).max(1))
    }

    fn breaks(&self) -> Vec<f64> {
        self.breaks.clone()
    }

    fn stops(&self) -> Vec<f64> {
        self.trace.stops()
    }

    fn waypoints(&self) -> Vec<f64> {
        self.trace.waypoints()
    }
}

/// Runs Newton's iteration from joint positions near a solution. Returns the solution and the axes of the arm at this
/// solution.
fn newton(chain: &Chain, goal: &Frame, mut q: JointVec) -> (JointVec, Axes) {
    let mut axes = chain.at(&q);
    let mut residual = chain.residual(goal, &axes);
    for _ in 0..8 {
        let Some(step) = chain.scaled_jacobian(&axes).lu().solve(&residual) else { break };
        let tried: JointVec = std::array::from_fn(|j| q[j] + step[j]);
        let there = chain.at(&tried);
        let left = chain.residual(goal, &there);
        if left.norm() < residual.norm() {
            (q, axes, residual) = (tried, there, left);
        } else {
            // The iteration has converged except for rounding, or the joint positions are not finite.
            break;
        }
    }
    (q, axes)
}

/// Returns the first and second derivative of the joint positions with respect to the path parameter.
fn derivatives(axes: &Axes, place: &Place) -> Option<(Vector6<f64>, Vector6<f64>)> {
    let stack = |a: &Vector3<f64>, b: &Vector3<f64>| Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z);
    let factors = axes.jacobian().lu();
    let first = factors.solve(&stack(&place.velocity, &place.spin))?;
    let rest = stack(&place.acceleration, &place.spin_rate) - axes.jacobian_rate(&first) * first;
    Some((first, factors.solve(&rest)?))
}

/// Returns the points at which the path changes its form. Also returns points between them, so that no joint turns far
/// between two points.
fn breaks(trace: &Trace, samples: &[(f64, JointVec)]) -> Vec<f64> {
    let mut all = trace.breaks();
    let mut turned = [0.0; JOINTS];
    for pair in samples.windows(2) {
        for (j, sum) in turned.iter_mut().enumerate() {
            *sum += (pair[1].1[j] - pair[0].1[j]).abs();
        }
        if turned.iter().any(|&sum| sum > SIMPLE) {
            all.push(pair[1].0);
            turned = [0.0; JOINTS];
        }
    }
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| *a - *b < 1e-6);
    all.retain(|&s| s > 0.0 && s < trace.end() - 1e-6);
    all
}

/// Iteration that follows a path in small steps and stays with one solution of the inverse kinematics.
struct Follower<'a> {
    kinematics: &'a Kinematics,
    trace: &'a Trace,
    s: f64,
    q: JointVec,
    axes: Axes,
    /// Sign of the determinant of the Jacobian. The sign of the determinant changes only in a singular pose.
    sign: f64,
}

impl<'a> Follower<'a> {
    fn new(kinematics: &'a Kinematics, trace: &'a Trace, start: &JointVec) -> Result<Self, PoseError> {
        let axes = kinematics.chain.at(start);
        let sign = kinematics.chain.scaled_jacobian(&axes).determinant().signum();
        let follower = Self { kinematics, trace, s: 0.0, q: *start, axes, sign };
        follower.check(0.0, start, &follower.axes)?;
        Ok(follower)
    }

    fn follow(mut self) -> Result<Vec<(f64, JointVec)>, PoseError> {
        let mut samples = vec![(0.0, self.q)];
        let corners: Vec<f64> = self.trace.breaks().into_iter().chain([self.trace.end()]).collect();
        let mut step = STEP.0;
        for corner in corners {
            while self.s < corner {
                let left = corner - self.s;
                // A step covers at most half of the remaining length, so that the last step is not tiny.
                let wanted = if step >= left { corner } else { self.s + step.min(0.5 * left) };
                match self.try_step(wanted)? {
                    Some(()) => {
                        samples.push((self.s, self.q));
                        step = (1.5 * step).min(STEP.0);
                    }
                    None => step = 0.5 * (wanted - self.s),
                }
            }
        }
        Ok(samples)
    }

    /// Advances to `s`. Returns `None` if the step must be shorter. Returns an error if the arm cannot follow the path
    /// beyond this point.
    fn try_step(&mut self, s: f64) -> Result<Option<()>, PoseError> {
        let chain = &self.kinematics.chain;
        let place = self.trace.at(s);
        let (q, axes) = newton(chain, &place.frame, self.q);
        let (joint, turn) = largest_turn(&self.q, &q);
        let left = chain.residual(&place.frame, &axes);
        // This form of the condition is also false for NaN, so NaN is not considered a solution.
        let arrived = left.norm() <= TOLERANCE;
        if arrived && turn <= TURN {
            self.check(s, &q, &axes)?;
            self.check_between(s, &q, &axes)?;
            (self.s, self.q, self.axes) = (s, q, axes);
            return Ok(Some(()));
        }
        let distance = s - self.s;
        if distance > STEP.1 {
            return Ok(None);
        }
        if !arrived {
            return Err(self.singular(s, &self.axes));
        }
        Err(self.on_leg(s, PoseError::JointStep { joint, step: turn, distance }))
    }

    /// Checks limits and singular poses at a point of the path.
    fn check(&self, s: f64, q: &JointVec, axes: &Axes) -> Result<(), PoseError> {
        let chain = &self.kinematics.chain;
        self.check_limits(s, q)?;
        let same_side = chain.scaled_jacobian(axes).determinant() * self.sign > 0.0;
        let away = weakest(chain, axes).0 >= SINGULAR;
        if !(same_side && away) {
            return Err(self.singular(s, axes));
        }
        Ok(())
    }

    fn check_limits(&self, s: f64, q: &JointVec) -> Result<(), PoseError> {
        outside(q, &self.kinematics.limits).map_or(Ok(()), |error| Err(self.on_leg(s, error)))
    }

    /// Checks the limits at every turning point of a joint between the current point and `s`.
    fn check_between(&self, s: f64, q: &JointVec, axes: &Axes) -> Result<(), PoseError> {
        // The point is slightly inside the interval, because the derivatives at a corner would otherwise be those of
        // the next interval.
        let inset = 1e-3 * (s - self.s);
        let rate = |at: f64, axes: &Axes| derivatives(axes, &self.trace.at(at)).unwrap_or_default().0;
        let (before, after) = (rate(self.s + inset, &self.axes), rate(s - inset, axes));
        for j in 0..JOINTS {
            let (low, high) = self.kinematics.limits[j];
            let near = [self.q[j], q[j]].iter().any(|&q| q - low < TURN || high - q < TURN);
            if near && before[j] * after[j] < 0.0 {
                let turn = self.s + (s - self.s) * before[j] / (before[j] - after[j]);
                let guess = newton(&self.kinematics.chain, &self.trace.at(turn).frame, self.q).0;
                self.check_limits(turn, &guess)?;
            }
        }
        Ok(())
    }

    /// Returns the error for a singular pose at `s`. If the remainder of the leg has no solution, returns the error
    /// for the end of the arm's reach.
    fn singular(&self, s: f64, axes: &Axes) -> PoseError {
        let (_, along, length) = self.trace.whereabouts(s);
        for k in 0..=LOOK_AHEAD {
            let ahead = s + (length - along) * k as f64 / LOOK_AHEAD as f64;
            let goal = self.trace.at(ahead.min(self.trace.end())).frame;
            if !is_reachable(&self.kinematics.chain, &goal, &self.q) {
                return self.on_leg(ahead, self.kinematics.missing(&goal));
            }
        }
        let geometry = self.kinematics.exact.as_ref().or(self.kinematics.near.as_ref());
        self.on_leg(s, PoseError::Singular(nearest(&self.kinematics.chain, geometry, axes)))
    }

    fn on_leg(&self, s: f64, error: PoseError) -> PoseError {
        let (leg, distance, length) = self.trace.whereabouts(s);
        PoseError::Leg { leg, distance, length, source: Box::new(error) }
    }
}

/// Returns the joint with the largest rotation, and this rotation, rad.
fn largest_turn(from: &JointVec, to: &JointVec) -> (Joint, f64) {
    let turns = Joint::ALL.map(|joint| (joint, (to[joint.index()] - from[joint.index()]).abs()));
    turns.into_iter().fold(turns[0], |worst, turn| if turn.1 > worst.1 { turn } else { worst })
}
