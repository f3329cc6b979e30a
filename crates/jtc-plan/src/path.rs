//! Paths through joint space, without time.
use crate::JointVec;

/// A point on a path, with derivatives with respect to the path's parameter.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct PathPoint {
    /// Position, rad.
    pub position: JointVec,
    /// First derivative, rad per unit of the parameter.
    pub first: JointVec,
    /// Second derivative, rad per squared unit of the parameter.
    pub second: JointVec,
}

/// A path through joint space. The positions and two derivatives are functions of a parameter from 0 to
/// [`end`](Path::end).
///
/// The first derivative is continuous except at [`stops`](Path::stops), and between two [`breaks`](Path::breaks) the
/// position is three times differentiable. Any parameter is permitted. Time laws are best if the parameter is
/// proportional to the joint movements.
pub trait Path {
    /// Returns the last value of the parameter, which is greater than 0.
    fn end(&self) -> f64;

    /// Returns position and derivatives at `s`, with `s` between 0 and the end. At a break, the derivatives of either
    /// side are permitted.
    fn at(&self, s: f64) -> PathPoint;

    /// Returns the number (from 1) of the last waypoint at or before `s`. Errors contain this number.
    fn waypoint(&self, _s: f64) -> Option<usize> {
        None
    }

    /// Returns the breaks in ascending order. A break is a parameter between 0 and the end at which a derivative jumps
    /// or the path changes its form. Between two breaks, the path should be one simple curve, because the planner
    /// samples it at a fixed number of points.
    fn breaks(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Returns the stops in ascending order. A stop is a parameter between 0 and the end at which a motion must come to
    /// rest. Each stop is also a break.
    fn stops(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Returns the parameter at which the path is nearest to each waypoint, in ascending order, including both ends.
    fn waypoints(&self) -> Vec<f64> {
        vec![0.0, self.end()]
    }
}

/// Path with access to its waypoints, for motions with specified waypoint times.
pub(crate) trait Waypointed: Path {
    /// Returns `true` if the path does not move between the waypoints with these indices.
    fn is_one_place(&self, from: usize, to: usize) -> bool;

    /// Returns `true` if the path stops at the waypoint with this index.
    fn stops_at(&self, waypoint: usize) -> bool;
}
