//! Straight legs between waypoints, with rounded corners.
use crate::path::{Path, PathPoint};
use crate::{JointVec, PlanError};

/// Straight legs of joint space between waypoints, corners rounded within `blend` rad of the corner.
#[derive(Clone, Debug)]
pub struct BlendedPath {
    corners: Vec<JointVec>,
    parameters: Vec<f64>,
}

impl BlendedPath {
    /// Through `waypoints` (rad), each corner rounded so that no joint is ever further than `blend` (rad) from it.
    ///
    /// # Errors
    ///
    /// [`PlanError::TooFew`], [`PlanError::NotFinite`], [`PlanError::Blend`].
    pub fn new(waypoints: &[JointVec], blend: f64) -> Result<Self, PlanError> {
        if waypoints.len() < 2 {
            return Err(PlanError::TooFew { count: waypoints.len() });
        }
        if !(blend >= 0.0 && blend.is_finite()) {
            return Err(PlanError::Blend { value: blend });
        }
        let mut parameters = vec![0.0];
        for pair in waypoints.windows(2) {
            let way = pair[0].iter().zip(&pair[1]).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
            parameters.push(parameters[parameters.len() - 1] + way.max(1e-9));
        }
        Ok(Self { corners: waypoints.to_vec(), parameters })
    }
}

impl Path for BlendedPath {
    fn end(&self) -> f64 {
        self.parameters[self.parameters.len() - 1]
    }

    fn at(&self, s: f64) -> PathPoint {
        let last = self.corners.len() - 2;
        let leg = self.parameters.partition_point(|p| *p <= s).saturating_sub(1).min(last);
        let (from, to) = (&self.corners[leg], &self.corners[leg + 1]);
        let length = self.parameters[leg + 1] - self.parameters[leg];
        let u = (s - self.parameters[leg]) / length;
        PathPoint {
            position: std::array::from_fn(|j| if u < 1.0 { from[j] + u * (to[j] - from[j]) } else { to[j] }),
            first: std::array::from_fn(|j| (to[j] - from[j]) / length),
            second: [0.0; 6],
        }
    }

    fn waypoint(&self, s: f64) -> Option<usize> {
        Some(self.parameters.partition_point(|p| *p <= s).max(1))
    }

    fn stops(&self) -> Vec<f64> {
        self.parameters[1..self.parameters.len() - 1].to_vec()
    }

    fn waypoints(&self) -> Vec<f64> {
        self.parameters.clone()
    }
}
