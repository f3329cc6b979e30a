//! Legs of a path of the flange, which are straight lines and arcs.
use jtc_dynamics::Pose;
use nalgebra::Vector3;

use super::PoseError;
use super::chain::{Frame, exponential, logarithm};
use super::orientation::checked;
use super::subproblems::turned;

/// Length that corresponds to a rotation of the flange by 1 rad, m. The length of a leg is the larger of its
/// translation and its rotation in this measure.
pub const RADIUS: f64 = 0.25;

/// Length below which a leg is considered to have no movement, m.
pub(crate) const SHORTEST: f64 = 1e-9;
/// Maximum distance of the second of three points from the line through the other two points for which the three
/// points are considered collinear, m.
const IN_LINE: f64 = 1e-6;
/// If a rotation differs from half a turn by less than this angle, the direction of the rotation is ambiguous, rad.
const HALF_TURN: f64 = 1e-6;

/// Leg of a flange path, which starts at the end of the previous leg. Along a leg, the orientation turns at a constant
/// rate about one axis, in the shorter direction (spherical linear interpolation).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leg {
    /// A straight line to a pose.
    Line {
        /// Pose at the end of the leg, in the base frame.
        to: Pose,
    },
    /// An arc of a circle to a pose.
    Arc {
        /// A point on the arc, m in the base frame, without an orientation.
        via: [f64; 3],
        /// Pose at the end of the leg, in the base frame.
        to: Pose,
    },
}

/// A point of the flange on its path, with derivatives with respect to the path's parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub frame: Frame,
    /// Velocity, m per unit of the parameter.
    pub velocity: Vector3<f64>,
    /// Angular velocity as a rotation vector in the base frame, rad per unit of the parameter.
    pub spin: Vector3<f64>,
    /// Acceleration, m per squared unit of the parameter.
    pub acceleration: Vector3<f64>,
    /// Rate of change of the angular velocity, rad per squared unit of the parameter.
    pub spin_rate: Vector3<f64>,
}

/// A leg that can be evaluated at each parameter from 0 to its length.
#[derive(Clone, Debug)]
pub(crate) struct Drawn {
    /// Number of the leg in the request, counted from 1.
    pub number: usize,
    /// Length of the leg, m.
    pub length: f64,
    from: Frame,
    pub to: Frame,
    /// Rotation vector, rad per metre of the leg's length.
    spin: Vector3<f64>,
    way: Way,
}

#[derive(Clone, Debug)]
enum Way {
    /// Straight line, with its translation per metre of the leg's length.
    Line(Vector3<f64>),
    /// Arc, with its angle per metre of the leg's length, rad/m.
    Arc(Circle, f64),
}

/// Arc of a circle.
#[derive(Clone, Debug)]
struct Circle {
    centre: Vector3<f64>,
    /// Vector from the centre to the beginning of the arc.
    arm: Vector3<f64>,
    /// Unit vector of the rotation axis of the arc.
    normal: Vector3<f64>,
    /// Angle of the arc, rad.
    angle: f64,
    /// Angle from the beginning of the arc to its `via` point, rad.
    via: f64,
}

impl Drawn {
    pub(super) fn new(number: usize, from: &Frame, leg: &Leg) -> Result<Self, PoseError> {
        let (Leg::Line { to } | Leg::Arc { to, .. }) = leg;
        let to = checked(to)?;
        let turn = logarithm(&(to.rotation * from.rotation.transpose()));
        if turn.norm() > std::f64::consts::PI - HALF_TURN {
            return Err(PoseError::HalfTurn);
        }
        let chord = to.position - from.position;
        let circle = match leg {
            Leg::Line { .. } => None,
            Leg::Arc { via, .. } => Some(circle(from, via, &to)?),
        };
        let way = circle.as_ref().map_or(chord.norm(), |circle| circle.arm.norm() * circle.angle);
        let length = way.max(turn.norm() * RADIUS);
        let unit = if length > SHORTEST { length } else { 1.0 };
        let way = match circle {
            None => Way::Line(chord / unit),
            Some(circle) => {
                let rate = circle.angle / unit;
                Way::Arc(circle, rate)
            }
        };
        Ok(Self { number, length, from: *from, to, spin: turn / unit, way })
    }

    /// Returns the distance from the beginning of an arc to its `via` point, m. Returns `None` for a line.
    pub(super) fn via(&self) -> Option<f64> {
        match &self.way {
            Way::Line(_) => None,
            Way::Arc(circle, rate) => Some((circle.via / rate).min(self.length)),
        }
    }

    /// Returns the point at the distance `u` (m) from the beginning of the leg.
    pub(super) fn at(&self, u: f64) -> Place {
        let rotation = exponential(&(self.spin * u)) * self.from.rotation;
        let (position, velocity, acceleration) = match &self.way {
            Way::Line(direction) => (self.from.position + direction * u, *direction, Vector3::zeros()),
            Way::Arc(Circle { centre, arm, normal, .. }, rate) => {
                let arm = turned(normal, rate * u, arm);
                (centre + arm, normal.cross(&arm) * *rate, arm * -(rate * rate))
            }
        };
        let frame = Frame { rotation, position };
        Place { frame, velocity, spin: self.spin, acceleration, spin_rate: Vector3::zeros() }
    }
}

/// Returns the arc that begins at a pose, passes a point and ends at another pose.
fn circle(from: &Frame, via: &[f64; 3], to: &Frame) -> Result<Circle, PoseError> {
    if let Some(&value) = via.iter().find(|v| !v.is_finite()) {
        return Err(PoseError::NotFinite { what: "the `via` point of an arc", value });
    }
    let (u, v) = (Vector3::from(*via) - from.position, to.position - from.position);
    let normal = u.cross(&v);
    let distance = if v.norm() > SHORTEST { normal.norm() / v.norm() } else { 0.0 };
    if distance < IN_LINE || u.norm() < IN_LINE || (u - v).norm() < IN_LINE {
        return Err(PoseError::Arc { distance });
    }
    let towards = normal.cross(&u) * v.norm_squared() + v.cross(&normal) * u.norm_squared();
    let centre = from.position + towards / (2.0 * normal.norm_squared());
    let (arm, normal) = (from.position - centre, normal.normalize());
    let angle = |place: Vector3<f64>| {
        let to = place - centre;
        normal.dot(&arm.cross(&to)).atan2(arm.dot(&to)).rem_euclid(std::f64::consts::TAU)
    };
    let (via, angle) = (angle(Vector3::from(*via)), angle(to.position));
    Ok(Circle { centre, arm, normal, angle, via })
}
