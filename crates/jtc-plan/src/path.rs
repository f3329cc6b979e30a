//! Ways through joint space, without time.
use crate::JointVec;

/// A place on a path, with derivatives by the path's parameter.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct PathPoint {
    /// rad.
    pub position: JointVec,
    /// First derivative, rad per unit of the parameter.
    pub first: JointVec,
    /// Second derivative, rad per squared unit of the parameter.
    pub second: JointVec,
}

/// A way through joint space: positions over a parameter from 0 to [`end`](Path::end), with two derivatives by it.
///
/// The first derivative is continuous but at [`stops`](Path::stops), and the position is three times differentiable between two
/// [`breaks`](Path::breaks). The parameter may be any; one that grows like the joints move makes the best time laws.
pub trait Path {
    /// The parameter's last value, above 0.
    fn end(&self) -> f64;

    /// Place and derivatives at `s`, which is within 0 and the end. At a break they may be those of either side.
    fn at(&self, s: f64) -> PathPoint;

    /// Which waypoint `s` belongs to, for errors: the last one that was passed, counted from 1.
    fn waypoint(&self, _s: f64) -> Option<usize> {
        None
    }

    /// Parameters, rising, between 0 and the end, where a derivative jumps or the path changes its form. Between two neighbours
    /// the path should look like one simple curve: it is sampled by a fixed number of places between them.
    fn breaks(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Parameters, rising, between 0 and the end, where a motion has to come to rest. They count as breaks.
    fn stops(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Parameters, rising, nearest to each waypoint, the ends included.
    fn waypoints(&self) -> Vec<f64> {
        vec![0.0, self.end()]
    }
}

/// A path of which the waypoints can be looked up, for motions with given times.
pub(crate) trait Waypointed: Path {
    /// Whether the path does not move between the waypoints with these indices.
    fn is_one_place(&self, from: usize, to: usize) -> bool;

    /// Whether the path rests at the waypoint with this index.
    fn stops_at(&self, waypoint: usize) -> bool;
}
