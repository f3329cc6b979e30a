//! Inverse kinematics, and paths on which the flange follows lines and arcs. The inverse kinematics compute joint
//! positions for flange poses.
mod chain;
mod closed_form;
mod error;
mod flange_path;
mod leg;
mod orientation;
mod route;
mod search;
mod singular;
mod subproblems;
mod target;
#[cfg(test)]
#[path = "../tests/robots/mod.rs"]
#[allow(dead_code, reason = "the tests in tests/ use more")]
mod test_arms;
mod trace;
mod turns;

use jtc_dynamics::{ArmModel, JOINTS, JointVec, Pose};
use jtc_wire::Joint;
use nalgebra::Vector6;

use chain::{Chain, Frame};
use closed_form::{EXACT, Geometry, NEAR};
pub use error::PoseError;
pub use flange_path::FlangePath;
pub use leg::{Leg, RADIUS};
pub use orientation::{Orientation, quaternion_of, rpy_of};
pub use route::{LegKind, Route, RoutePoint};
pub use singular::{SINGULAR, SingularKind, Singularity};
pub use target::{Target, resolve};

/// Maximum number of iterations that refine a closed-form solution. Two iterations are sufficient if the arm matches
/// the closed form. Near a singular pose, more iterations are needed.
const REFINE: usize = 25;
/// Maximum number of iterations of a search.
const SEARCH: usize = 60;

/// Kinematics of an arm within its position limits. The kinematics convert joint positions to flange poses and flange
/// poses to joint positions.
///
/// Poses are flange poses in the base frame, with positions in m. Joint positions are in rad. At a solution, the flange
/// is within 1 nm and 1 nrad of the pose.
///
/// All solutions are computed in closed form for arms with a spherical wrist or with three parallel axes. Examples of
/// three parallel axes are the default arm and the arms of Universal Robots. The parameters of the model determine the
/// geometry of the arm. For an arm with any other geometry, the solutions are found by iteration from many fixed
/// starting values. In rare cases, the iteration misses a solution.
#[derive(Clone, Debug)]
pub struct Kinematics {
    chain: Chain,
    limits: [(f64, f64); JOINTS],
    /// Geometry of the arm, if it has a closed form.
    exact: Option<Geometry>,
    /// Closed-form geometry that is close to the geometry of the arm. Its solutions are starting values for the
    /// iteration.
    near: Option<Geometry>,
}

impl Kinematics {
    /// Creates the kinematics of `model`. The model must have passed [`ArmModel::check`]. `position_limits` contains
    /// the lowest and the highest position of each joint, rad.
    pub fn new(model: &ArmModel, position_limits: &[(f64, f64); JOINTS]) -> Self {
        let chain = Chain::new(model);
        let exact = Geometry::of(&chain.zero, EXACT);
        let near = Geometry::of(&chain.zero, NEAR);
        Self { chain, limits: *position_limits, exact, near }
    }

    /// Returns `true` if all solutions are computed in closed form.
    pub fn is_closed_form(&self) -> bool {
        self.exact.is_some()
    }

    /// Returns the lowest and highest position of each joint, rad.
    pub fn limits(&self) -> &[(f64, f64); JOINTS] {
        &self.limits
    }

    /// Returns the pose of the flange at the joint positions `q`.
    pub fn flange(&self, q: &JointVec) -> Pose {
        self.chain.flange(q)
    }

    /// Returns the geometric Jacobian of the flange at the joint positions `q`, row major, with one column per joint.
    /// Rows 0..3 are the velocity of the flange in the base frame (m/rad). Rows 3..6 are the angular velocity of the
    /// flange (rad/rad).
    pub fn jacobian(&self, q: &JointVec) -> [[f64; JOINTS]; 6] {
        let jacobian = self.chain.at(q).jacobian();
        std::array::from_fn(|row| std::array::from_fn(|joint| jacobian[(row, joint)]))
    }

    /// Returns the joint positions within the limits at which the flange is at `target`. If there are several
    /// solutions, returns the solution nearest to `near`. The nearest solution has the smallest sum of squared joint
    /// motions.
    ///
    /// A singular target has infinitely many solutions. For such a target, the function returns a solution near
    /// `near`.
    ///
    /// # Errors
    ///
    /// Returns [`PoseError`] if `target` is not a valid pose or is out of reach. A target can be out of reach in this
    /// orientation, in every orientation, or because of the position limits.
    pub fn solve(&self, target: &Pose, near: &JointVec) -> Result<JointVec, PoseError> {
        let goal = orientation::checked(target)?;
        if let Some(&bad) = near.iter().find(|q| !q.is_finite()) {
            return Err(PoseError::NotFinite { what: "a nearby joint position", value: bad });
        }
        let mut found = self.solutions(&goal, near);
        // In a singular pose, a solution by iteration can be nearer to `near` than the solutions in closed form. Full
        // turns of a joint are handled below.
        found.extend(search::converge(&self.chain, &goal, near, SEARCH));
        let distance = |q: &JointVec| q.iter().zip(near).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let within = found.iter().filter_map(|q| turns::nearest(q, near, &self.limits));
        within.min_by(|a, b| distance(a).total_cmp(&distance(b))).ok_or_else(|| self.reason(&goal, &found))
    }

    /// Returns all joint positions within the limits at which the flange is at `target`, without duplicates. The list
    /// contains each solution with every joint within (−π, π]. If the limits permit, the list also contains each
    /// solution with joints turned by ±2π. Returns an empty list for an invalid pose.
    ///
    /// A singular target has infinitely many solutions. The list contains some of them.
    pub fn all(&self, target: &Pose) -> Vec<JointVec> {
        let Ok(goal) = orientation::checked(target) else { return Vec::new() };
        let found = self.solutions(&goal, &[0.0; JOINTS]);
        found.iter().flat_map(|q| turns::variants(q, &self.limits)).collect()
    }

    /// Returns the singular pose at or near `q`. A smaller value of [`Singularity::smallest`] means that the singular
    /// pose is nearer.
    pub fn singularity(&self, q: &JointVec) -> Singularity {
        let geometry = self.exact.as_ref().or(self.near.as_ref());
        singular::nearest(&self.chain, geometry, &self.chain.at(q))
    }

    /// Returns all solutions with each joint within (−π, π], ignoring the position limits.
    fn solutions(&self, goal: &Frame, hint: &JointVec) -> Vec<JointVec> {
        let mut found = Vec::new();
        if let Some(geometry) = self.exact.as_ref().or(self.near.as_ref()) {
            for q in geometry.solve(&self.chain.zero, goal, hint) {
                if let Some(q) = search::converge(&self.chain, goal, &q, REFINE) {
                    search::add(&mut found, q);
                }
            }
        }
        if self.exact.is_none() {
            search::search(&self.chain, goal, &mut found);
        }
        found
    }

    /// Returns the reason why no solution is within the limits. `found` contains all solutions.
    fn reason(&self, goal: &Frame, found: &[JointVec]) -> PoseError {
        let least = found.iter().map(|q| turns::outside(q, &self.limits));
        match least.min_by(|a, b| a.beyond.total_cmp(&b.beyond)) {
            Some(turns::Outside { joint, value, .. }) => {
                let (low, high) = self.limits[joint.index()];
                PoseError::OutsideLimits { joint, value, low, high }
            }
            None => self.missing(goal),
        }
    }

    /// Returns an error with the distance between the reach of the arm and a pose without a solution.
    fn missing(&self, goal: &Frame) -> PoseError {
        let least = |weights: [f64; 6], from: &JointVec| {
            search::descend(&self.chain, goal, *from, &Vector6::from(weights), 100)
        };
        let best = |weights: [f64; 6]| {
            let all = (1..=24).map(|n| least(weights, &search::seed(n)));
            all.min_by(|a, b| a.squared.total_cmp(&b.squared))
        };
        let distance = goal.position.norm();
        let shift = |r: &Vector6<f64>| r.fixed_rows::<3>(0).norm() * self.chain.length;
        let place = best([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]).map_or(0.0, |reached| shift(&reached.residual));
        if place > 1e-6 {
            return PoseError::OutOfReach { distance, missing: place };
        }
        // The position has a high weight, so that the remaining residual is in the orientation.
        let turn = best([1e3, 1e3, 1e3, 1.0, 1.0, 1.0]).map_or(0.0, |r| r.residual.fixed_rows::<3>(3).norm());
        PoseError::Orientation { distance, missing: turn }
    }
}

/// Returns the error for joint positions outside the limits, with the joint that is farthest outside.
fn outside(q: &JointVec, limits: &[(f64, f64); JOINTS]) -> Option<PoseError> {
    let beyond = |joint: &Joint| {
        let (low, high) = limits[joint.index()];
        (low - q[joint.index()]).max(q[joint.index()] - high)
    };
    let joint = Joint::ALL.into_iter().max_by(|a, b| beyond(a).total_cmp(&beyond(b)))?;
    let (value, (low, high)) = (q[joint.index()], limits[joint.index()]);
    (beyond(&joint) > turns::ROUNDING).then_some(PoseError::OutsideLimits { joint, value, low, high })
}
