//! Straight legs between waypoints, with rounded corners.
use jtc_wire::Joint;

use crate::distance::distance;
use crate::path::{Path, PathPoint, Waypointed};
use crate::{JOINTS, JointVec, PlanError, thin};

/// Maximum distance between waypoints that are considered equal, rad.
const SAME: f64 = 1e-9;
/// Smallest difference of directions that is treated as a corner.
const STRAIGHT: f64 = 1e-9;
/// If every component of the sum of the directions of two consecutive legs is below this value, the path turns back
/// (within about 3°). At such a corner the path stops instead of rounding the corner.
const BACK: f64 = 0.05;

/// Straight legs in joint space between waypoints, with rounded corners. The path leaves a leg and reaches the next leg within `blend` rad
/// of the waypoint between the two legs. The joint that moves most determines this distance.
///
/// In a corner, the direction changes from one leg to the next as a smooth step. The slope of this step rises, stays
/// constant and falls. Therefore the curvature is continuous, the path stays in the triangle of the corner, and no
/// joint overshoots. A rounded corner uses at most half of each adjacent leg. Two collinear legs have no corner. The
/// path stops at a waypoint if it turns back at this waypoint, or if the waypoint is repeated. If the blend is 0, the
/// path stops at every waypoint.
///
/// The path parameter is the distance in rad that the joint with the largest movement covers along the straight legs.
#[derive(Clone, Debug)]
pub struct BlendedPath {
    /// Corners, without consecutive equal positions.
    corners: Vec<Corner>,
    /// Location on the path of each waypoint of the request.
    given: Vec<Given>,
}

/// Location of a waypoint on the path.
#[derive(Clone, Copy, Debug)]
struct Given {
    /// Index of the last corner that is at or before the waypoint.
    corner: usize,
    /// Path parameter of the waypoint. For a waypoint that is not a corner, this is a point on the straight line
    /// between two corners.
    parameter: f64,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    position: JointVec,
    parameter: f64,
    /// Direction of the leg that begins at this corner.
    direction: JointVec,
    /// Half of the parameter range of the rounding; 0 if the corner is not rounded.
    half: f64,
    stop: bool,
    /// `true` if the path turns back at this corner, and stops for no other reason.
    leads_back: bool,
}

impl BlendedPath {
    /// Creates the path through `waypoints` (rad).
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::TooFew`] for fewer than two waypoints. Returns [`PlanError::NotFinite`] for a position that is not a finite
    /// number. Returns [`PlanError::Blend`] for a negative or invalid blend. Returns [`PlanError::Path`] if all waypoints are equal.
    pub fn new(waypoints: &[JointVec], blend: f64) -> Result<Self, PlanError> {
        if waypoints.len() < 2 {
            return Err(PlanError::TooFew { count: waypoints.len() });
        }
        if !(blend >= 0.0 && blend.is_finite()) {
            return Err(PlanError::Blend { value: blend });
        }
        let (corners, given) = distinct(waypoints)?;
        if corners.len() < 2 {
            return Err(PlanError::Path { leg: 1, parameter: 0.0 });
        }
        let given = given.into_iter().map(|corner| Given { corner, parameter: 0.0 }).collect();
        let mut path = Self { corners, given };
        path.round(blend);
        Ok(path)
    }

    /// Computes directions, parameters and rounded corners from the waypoint positions.
    fn round(&mut self, blend: f64) {
        let corners = &mut self.corners;
        let mut length_before = 0.0;
        for i in 0..corners.len() - 1 {
            let (from, to) = (corners[i], corners[i + 1].position);
            let length = distance(&from.position, &to);
            corners[i].direction = std::array::from_fn(|j| (to[j] - from.position[j]) / length);
            corners[i + 1].parameter = from.parameter + length;
            if i > 0 {
                let half = blend.min(0.5 * length_before).min(0.5 * length);
                let before = corners[i - 1].direction;
                corners[i].round(&before, half);
            }
            length_before = length;
        }
        for given in &mut self.given {
            given.parameter = corners[given.corner].parameter;
        }
    }

    /// Returns the path without the corners that are close to the straight line between the remaining corners. A
    /// removed corner is at most `share` of the blend from this line, and the removed corners are in order along the
    /// line. The removed waypoints are so dense that the whole line stays within their blends. Waypoints for which
    /// `keep` returns `true` are not removed. Returns `None` if no corner can be removed.
    pub(crate) fn thinned(&self, blend: f64, share: f64, keep: &dyn Fn(usize) -> bool) -> Option<Self> {
        let mut stays: Vec<bool> = self.corners.iter().map(|c| c.stop && !c.leads_back).collect();
        for (i, given) in self.given.iter().enumerate() {
            stays[given.corner] |= keep(i);
        }
        let positions: Vec<JointVec> = self.corners.iter().map(|c| c.position).collect();
        let kept = thin::kept(&positions, &stays, blend, share);
        if kept.len() == self.corners.len() {
            return None;
        }
        let fresh =
            |&i: &usize| Corner { half: 0.0, stop: stays[i] && self.corners[i].stop, ..self.corners[i] };
        let corners: Vec<Corner> = kept.iter().map(fresh).collect();
        let index = |old: usize| kept.partition_point(|k| *k <= old) - 1;
        let given = self.given.iter().map(|g| Given { corner: index(g.corner), parameter: 0.0 });
        let mut path = Self { given: given.collect(), corners };
        path.round(blend);
        for (new, old) in path.given.iter_mut().zip(&self.given) {
            if kept[new.corner] != old.corner {
                let (from, to) = (&path.corners[new.corner], &path.corners[new.corner + 1]);
                let along = thin::along(&from.position, &to.position, &self.corners[old.corner].position);
                new.parameter = from.parameter + along * (to.parameter - from.parameter);
            }
        }
        Some(path)
    }

    /// Returns the number of corners, including both ends.
    pub(crate) fn corners(&self) -> usize {
        self.corners.len()
    }

    /// Returns `true` if the corner with this index is rounded.
    pub(crate) fn is_rounded(&self, corner: usize) -> bool {
        self.corners[corner].half > 0.0
    }

    /// Returns `true` if the path stops at each corner.
    pub(crate) fn stops_everywhere(&self) -> bool {
        self.corners[1..self.corners.len() - 1].iter().all(|corner| corner.stop)
    }

    /// Returns the start and end position of each leg.
    pub(crate) fn legs(&self) -> impl Iterator<Item = (JointVec, JointVec)> {
        self.corners.windows(2).map(|pair| (pair[0].position, pair[1].position))
    }

    /// Returns the parameter in the middle of each leg.
    pub(crate) fn middles(&self) -> Vec<f64> {
        self.corners.windows(2).map(|pair| 0.5 * (pair[0].parameter + pair[1].parameter)).collect()
    }

    /// Returns the path with stops at the corners with these indices.
    pub(crate) fn stopping_at(&self, corners: &[usize]) -> Self {
        let mut path = self.clone();
        for &i in corners {
            (path.corners[i].half, path.corners[i].stop) = (0.0, true);
        }
        path
    }

    /// Returns `true` if two waypoints are so close that no leg exists between them.
    pub(crate) fn are_one(a: &JointVec, b: &JointVec) -> bool {
        distance(a, b) <= SAME
    }

    /// Returns the index of the leg at `s`. At a corner, the result is the next leg.
    fn leg(&self, s: f64) -> usize {
        let after = self.corners.partition_point(|c| c.parameter <= s);
        after.saturating_sub(1).min(self.corners.len() - 2)
    }

    /// Returns the point of the straight leg at `s`.
    fn on_leg(&self, leg: usize, s: f64) -> PathPoint {
        let (from, to) = (&self.corners[leg], &self.corners[leg + 1]);
        let (gone, left) = (s - from.parameter, to.parameter - s);
        // The point is computed from the nearer end of the leg, so that both ends are exact.
        let position = std::array::from_fn(|j| {
            if gone <= left {
                from.position[j] + gone * from.direction[j]
            } else {
                to.position[j] - left * from.direction[j]
            }
        });
        PathPoint { position, first: from.direction, second: [0.0; JOINTS] }
    }

    /// Returns the point in the rounding of corner `i`.
    fn in_corner(&self, i: usize, s: f64) -> PathPoint {
        let (corner, before) = (&self.corners[i], &self.corners[i - 1].direction);
        let whole = 2.0 * corner.half;
        let (integral, step, slope) = step((s - corner.parameter + corner.half) / whole);
        let mut point = PathPoint::default();
        for j in 0..JOINTS {
            let turn = corner.direction[j] - before[j];
            point.position[j] =
                corner.position[j] + (s - corner.parameter) * before[j] + turn * whole * integral;
            point.first[j] = before[j] + turn * step;
            point.second[j] = turn * slope / whole;
        }
        point
    }
}

/// Evaluates a step function from 0 (at 0) to 1 (at 1). The slope of the step rises, stays constant and falls, each for
/// a third of the interval. Among all steps with a slope of at most 3/2, this step has the smallest second derivative.
/// Returns the integral, the value and the slope of the step at `u`.
fn step(u: f64) -> (f64, f64, f64) {
    const THIRD: f64 = 1.0 / 3.0;
    if u < THIRD {
        (0.75 * u * u * u, 2.25 * u * u, 4.5 * u)
    } else if u <= 2.0 * THIRD {
        let v = u - THIRD;
        (1.0 / 36.0 + v * (0.25 + 0.75 * v), 0.25 + 1.5 * v, 1.5)
    } else {
        let w = 1.0 - u;
        (u - 0.5 + 0.75 * w * w * w, 1.0 - 2.25 * w * w, 4.5 * w)
    }
}

impl Corner {
    /// Determines how the path passes the corner. `before` is the direction of the leg that ends at the corner.
    fn round(&mut self, before: &JointVec, half: f64) {
        let size = |sign: f64| {
            let parts = before.iter().zip(&self.direction).map(|(a, b)| (b + sign * a).abs());
            parts.fold(0.0, f64::max)
        };
        let (turn, sum) = (size(-1.0), size(1.0));
        self.leads_back = !self.stop && half > 0.0 && sum < BACK;
        self.stop |= half <= 0.0 || sum < BACK;
        if !self.stop && turn > STRAIGHT {
            self.half = half;
        }
    }
}

impl Path for BlendedPath {
    fn end(&self) -> f64 {
        self.corners[self.corners.len() - 1].parameter
    }

    fn at(&self, s: f64) -> PathPoint {
        let leg = self.leg(s);
        let (from, to) = (&self.corners[leg], &self.corners[leg + 1]);
        if from.half > 0.0 && s < from.parameter + from.half {
            self.in_corner(leg, s)
        } else if to.half > 0.0 && s > to.parameter - to.half {
            self.in_corner(leg + 1, s)
        } else {
            self.on_leg(leg, s)
        }
    }

    fn waypoint(&self, s: f64) -> Option<usize> {
        Some(self.given.partition_point(|g| g.parameter <= s).max(1))
    }

    fn breaks(&self) -> Vec<f64> {
        let inner = &self.corners[1..self.corners.len() - 1];
        let mut breaks = Vec::with_capacity(4 * inner.len());
        for corner in inner {
            if corner.half > 0.0 {
                // If two adjacent rounded corners touch, the end of the first and the beginning of the second are one
                // break.
                let begin = corner.parameter - corner.half;
                if breaks.last().is_none_or(|last| begin > last + 0.01 * corner.half) {
                    breaks.push(begin);
                }
                // The step of a corner changes its form at each third.
                let third = corner.half / 3.0;
                breaks.extend([-third, third, corner.half].map(|d| corner.parameter + d));
            } else {
                breaks.push(corner.parameter);
            }
        }
        // A rounded corner that touches a stop or an end needs no additional break at that point.
        breaks.retain(|b| *b > 0.0 && *b < self.end());
        breaks
    }

    fn stops(&self) -> Vec<f64> {
        let inner = &self.corners[1..self.corners.len() - 1];
        inner.iter().filter(|c| c.stop).map(|c| c.parameter).collect()
    }

    fn waypoints(&self) -> Vec<f64> {
        self.given.iter().map(|g| g.parameter).collect()
    }
}

impl Waypointed for BlendedPath {
    fn is_one_place(&self, from: usize, to: usize) -> bool {
        self.given[from].parameter == self.given[to].parameter
    }

    fn stops_at(&self, waypoint: usize) -> bool {
        let Given { corner, parameter } = self.given[waypoint];
        let is_end = corner == 0 || corner + 1 == self.corners.len();
        self.corners[corner].parameter == parameter && (is_end || self.corners[corner].stop)
    }
}

/// Returns the waypoints without consecutive duplicates, and the index of each waypoint of the request in this shorter
/// list.
fn distinct(waypoints: &[JointVec]) -> Result<(Vec<Corner>, Vec<usize>), PlanError> {
    let mut corners: Vec<Corner> = Vec::with_capacity(waypoints.len());
    let mut given = Vec::with_capacity(waypoints.len());
    for (i, position) in waypoints.iter().enumerate() {
        for joint in Joint::ALL {
            let value = position[joint.index()];
            if !value.is_finite() {
                return Err(PlanError::NotFinite { waypoint: i + 1, joint, value });
            }
        }
        match corners.last_mut() {
            Some(last) if distance(&last.position, position) <= SAME => last.stop = true,
            _ => corners.push(Corner {
                position: *position,
                parameter: 0.0,
                direction: [0.0; JOINTS],
                half: 0.0,
                stop: false,
                leads_back: false,
            }),
        }
        given.push(corners.len() - 1);
    }
    Ok((corners, given))
}
