//! The arm in the form that the recursions use: modified Denavit-Hartenberg frames and base inertial parameters.
//!
//! With these frames and parameters, the joint torques stay the same, but each call needs fewer multiplications:
//!
//! * **Frames** (modified Denavit-Hartenberg: Craig, Introduction to Robotics). Each constant rotation between joints is Rz(a)·Rx(α)·Rz(b).
//!   Rz(b) is added to the position of the joint, and Rz(a) becomes part of the previous frame. The remaining transform Rx(α)·Rz(q +
//!   offset) needs only two plane rotations. The origin of a frame is the point of its joint axis from which the vector to the next origin
//!   is perpendicular to the axis.
//! * **Base (minimal) inertial parameters** (Gautier and Khalil, Direct calculation of minimum set of inertial parameters of serial robots,
//!   1990). A part of a link's inertia is symmetric about the joint axis: the mass, and the first and second moment along the axis. The
//!   motion of this part does not depend on the rotation of the link. The symmetric part is therefore added to the previous link, one link
//!   after the other from the wrist to the base. Each link keeps seven parameters, which do not include a mass.

use crate::model::{ArmModel, JOINTS, Link, Origin, symmetric};
use crate::payload::Payload;
use crate::rotation::{
    Mat3, about_x, about_z, apply, congruent, from_rpy, from_sines_cosines, product, unit,
};
use crate::trig::{angle, sin_cos};

/// If an angle of a joint origin is within this distance (rad) of a multiple of π/2, it is replaced by this multiple.
/// Many arm models write π/2 with six digits, and the wire format uses f32.
const RIGHT_ANGLE_TOLERANCE: f64 = 2e-6;
/// Limit below which the sine or cosine of the angle between two axes is treated as 0. Products of rotations by right angles contain such
/// small values because of rounding.
const ALIGNED: f64 = 1e-12;

/// Direction of a joint's axis relative to the axis of the previous joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axes {
    /// The axes are parallel, with the same or the opposite direction: sin α = 0.
    Parallel,
    /// The axes are at a right angle: α = π/2. The parameters are chosen so that α is never negative.
    Perpendicular,
    /// The axes have any other direction; the recursion then saves no multiplications.
    Any,
}

/// Directions of the joint axes of an arm. For the shapes of most arms, the recursion is compiled separately, without
/// multiplications by 0 and 1. All other arms use the general shape.
pub(crate) trait Shape {
    /// Directions of the axes. The first direction is not used, because the base acceleration already contains the
    /// rotation Rx(α) of the first joint.
    const AXES: [Axes; JOINTS];
}

/// An arm of any shape.
pub(crate) struct AnyShape;
/// Three parallel axes, followed by two axes at right angles: an arm whose wrist axes do not meet in one point.
pub(crate) struct ThreeParallel;
/// Two parallel axes, followed by three axes at right angles: an arm with a spherical wrist.
pub(crate) struct TwoParallel;

impl Shape for AnyShape {
    const AXES: [Axes; JOINTS] = [Axes::Any; JOINTS];
}

impl Shape for ThreeParallel {
    const AXES: [Axes; JOINTS] = [
        Axes::Any,
        Axes::Perpendicular,
        Axes::Parallel,
        Axes::Parallel,
        Axes::Perpendicular,
        Axes::Perpendicular,
    ];
}

impl Shape for TwoParallel {
    const AXES: [Axes; JOINTS] = [
        Axes::Any,
        Axes::Perpendicular,
        Axes::Parallel,
        Axes::Perpendicular,
        Axes::Perpendicular,
        Axes::Perpendicular,
    ];
}

/// Shapes for which the recursion is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KnownShape {
    /// [`AnyShape`].
    Any,
    /// [`ThreeParallel`].
    ThreeParallel,
    /// [`TwoParallel`].
    TwoParallel,
}

impl KnownShape {
    fn of(axes: &[Axes; JOINTS]) -> Self {
        let is = |shape: &[Axes; JOINTS]| axes[1..] == shape[1..];
        if is(&ThreeParallel::AXES) {
            Self::ThreeParallel
        } else if is(&TwoParallel::AXES) {
            Self::TwoParallel
        } else {
            Self::Any
        }
    }
}

/// The modified Denavit-Hartenberg transform of a joint; it gives frame k in frame k−1 as a shift by `p`, followed by Rx(α) and Rz(q +
/// offset).
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointTransform {
    /// sin α, which is not negative, and cos α of this joint.
    pub sin: f64,
    pub cos: f64,
    /// Direction of the joint axis, from the shape of the arm.
    pub axes: Axes,
    /// Angle added to the joint's position, rad.
    pub offset: f64,
    /// Origin of frame k in frame k−1, m. The z coordinate is 0, because the origin of frame k−1 is chosen
    /// accordingly. If the axes are parallel, the y coordinate is also 0, because the x axis of frame k−1 is chosen
    /// accordingly.
    pub p: [f64; 2],
}

/// The base inertial parameters of a link in its own frame. Mass, first moment along z and the integral of z² are zero, because the
/// previous link includes them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BaseInertialParameters {
    /// First moment of mass: integrals of x and y over the mass, kg·m.
    pub hx: f64,
    pub hy: f64,
    /// Second moments of mass: integrals of x² and y² and of the products, kg·m². Unlike a moment of inertia, the
    /// integral of x² contributes to the torque only through the acceleration of the points on the x axis. The
    /// integral of y² does so only through the points on the y axis.
    pub xx: f64,
    pub yy: f64,
    pub xy: f64,
    pub xz: f64,
    pub yz: f64,
}

/// A joint frame of the model, relative to the previous frame, for kinematics.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Placement {
    pub rotation: Mat3,
    pub xyz: [f64; 3],
}

/// Mass, first moment and inertia of a rigid body about the origin of a frame.
#[derive(Clone, Copy)]
struct Inertia {
    mass: f64,
    h: [f64; 3],
    j: Mat3,
}

impl Inertia {
    const NONE: Self = Self { mass: 0.0, h: [0.0; 3], j: [[0.0; 3]; 3] };

    /// Returns the inertia of a link, in the link's frame.
    fn of_link(link: &Link) -> Self {
        let about_com = Self { mass: link.mass, h: [0.0; 3], j: symmetric(&link.inertia) };
        let Origin { xyz, rpy } = &link.origin;
        about_com.placed(&from_rpy(rpy), xyz)
    }

    /// Returns the inertia of a payload in the frame of the last link. `flange` is the placement of the flange in the frame of the last
    /// link.
    fn of_payload(payload: &Payload, flange: &Placement) -> Self {
        let about_com = Self { mass: payload.mass, h: [0.0; 3], j: symmetric(&payload.inertia) };
        about_com.placed(&about_z(0.0, 1.0), &payload.com).placed(&flange.rotation, &flange.xyz)
    }

    /// Returns the inertia in the frame in which the current frame has the origin `p` (m) and the rotation `r`.
    fn placed(&self, r: &Mat3, p: &[f64; 3]) -> Self {
        let h = apply(r, &self.h);
        let mut j = congruent(r, &self.j);
        for (a, row) in j.iter_mut().enumerate() {
            for (b, cell) in row.iter_mut().enumerate() {
                *cell -= p[a] * h[b] + h[a] * p[b] + self.mass * p[a] * p[b];
                if a == b {
                    *cell += 2.0 * dot(p, &h) + self.mass * dot(p, p);
                }
            }
        }
        let m = self.mass;
        Self { mass: m, h: [h[0] + m * p[0], h[1] + m * p[1], h[2] + m * p[2]], j }
    }

    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        for a in 0..3 {
            self.h[a] += other.h[a];
            for b in 0..3 {
                self.j[a][b] += other.j[a][b];
            }
        }
    }

    /// Splits the inertia into the base inertial parameters and the part that is symmetric about z.
    fn split(&self) -> (BaseInertialParameters, Self) {
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = self.j;
        // Integral of z², which is contained in both x² + z² and y² + z².
        let z2 = 0.5 * (xx + yy - zz);
        let [hx, hy, hz] = self.h;
        let rest = BaseInertialParameters { hx, hy, xx: yy - z2, yy: xx - z2, xy: -xy, xz: -xz, yz: -yz };
        let j = [[z2, 0.0, 0.0], [0.0, z2, 0.0], [0.0; 3]];
        (rest, Self { mass: self.mass, h: [0.0, 0.0, hz], j })
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The chain of the six moving links.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub transforms: [JointTransform; JOINTS],
    pub base_parameters: [BaseInertialParameters; JOINTS],
    /// Negative gravity in the frame after the Rx(α) of the first joint, m/s². Gravity has the same effect as an
    /// upward acceleration of the base.
    pub base_acceleration: [f64; 3],
    pub placements: [Placement; 7],
    /// First moments (`hx`, `hy`) of the chain with 1 kg at the flange and without any other mass, kg·m.
    pub flange: [[f64; 2]; JOINTS],
    pub shape: KnownShape,
}

impl Chain {
    /// Returns the transform of a joint. The direction of the joint axis is a constant of the shape.
    #[inline(always)]
    pub(crate) fn transform<S: Shape>(&self, k: usize) -> JointTransform {
        JointTransform { axes: S::AXES[k], ..self.transforms[k] }
    }

    pub(crate) fn new(model: &ArmModel, gravity: [f64; 3], payload: &Payload) -> Self {
        let placements = model.joints.map(|o| Placement { rotation: joint_rotation(&o.rpy), xyz: o.xyz });
        let none = JointTransform { sin: 0.0, cos: 1.0, axes: Axes::Any, offset: 0.0, p: [0.0; 2] };
        let mut transforms = [none; JOINTS];
        // Rotation about z (sine and cosine) and shift along z from the model's frame k to frame k of the chain.
        let mut z_rotations = [(0.0, 1.0); JOINTS];
        let mut z_shifts = [0.0; JOINTS];
        let mut base_acceleration = gravity.map(|g| -g);
        let mut origins = [[0.0; 3]; JOINTS];
        for k in 0..JOINTS {
            let c = &placements[k].rotation;
            // The third column of Rz(a)·Rx(α) is (sin α sin a, −sin α cos a, cos α), which gives a. If the axes are
            // parallel, any a is valid, and the code uses the direction from one axis to the other.
            let parallel = c[0][2].abs().max(c[1][2].abs()) < ALIGNED;
            let [x, y, _] = placements[k].xyz;
            let (cos_a, sin_a) = if parallel { unit(x, y) } else { unit(-c[1][2], c[0][2]) };
            let back = about_z(-sin_a, cos_a);
            let rest = product(&back, c);
            let (cos, sin) = unit(rest[2][2], -rest[1][2]);
            let (axes, sin, cos) = match (parallel, cos.abs() < ALIGNED) {
                (true, _) => (Axes::Parallel, 0.0, 1f64.copysign(cos)),
                (false, true) => (Axes::Perpendicular, 1.0, 0.0),
                (false, false) => (Axes::Any, sin, cos),
            };
            let (cos_b, sin_b) = unit(rest[0][0], -rest[0][1]);
            origins[k] = apply(&back, &placements[k].xyz);
            if k == 0 {
                base_acceleration = apply(&about_x(-sin, cos), &apply(&back, &base_acceleration));
            } else {
                z_rotations[k - 1] = (sin_a, cos_a);
                transforms[k - 1].offset += angle(sin_a, cos_a);
            }
            (transforms[k].sin, transforms[k].cos, transforms[k].axes) = (sin, cos, axes);
            transforms[k].offset += angle(sin_b, cos_b);
        }
        for k in (1..JOINTS).rev() {
            let [x, y, z] = origins[k];
            z_shifts[k - 1] = z + z_shifts[k] * transforms[k].cos;
            let parallel = transforms[k].axes == Axes::Parallel;
            transforms[k].p = [x, if parallel { 0.0 } else { y - z_shifts[k] * transforms[k].sin }];
        }
        let mut bodies: [Inertia; JOINTS] = core::array::from_fn(|k| Inertia::of_link(&model.links[k + 1]));
        if payload.is_there() {
            bodies[JOINTS - 1].add(&Inertia::of_payload(payload, &placements[JOINTS]));
        }
        let base_parameters = regroup(&bodies, &transforms, &z_rotations, &z_shifts);
        bodies = [Inertia::NONE; JOINTS];
        bodies[JOINTS - 1] =
            Inertia::of_payload(&Payload { mass: 1.0, ..Payload::default() }, &placements[JOINTS]);
        let flange = regroup(&bodies, &transforms, &z_rotations, &z_shifts).map(|b| [b.hx, b.hy]);
        let shape = KnownShape::of(&transforms.map(|t| t.axes));
        Self { transforms, base_parameters, base_acceleration, placements, flange, shape }
    }
}

/// Returns the rotation of a joint origin, with exact right angles.
fn joint_rotation(rpy: &[f64; 3]) -> Mat3 {
    from_sines_cosines(&rpy.map(|angle| {
        let (sin, cos) = sin_cos(angle);
        if sin.abs() <= RIGHT_ANGLE_TOLERANCE {
            (0.0, 1f64.copysign(cos))
        } else if cos.abs() <= RIGHT_ANGLE_TOLERANCE {
            (1f64.copysign(sin), 0.0)
        } else {
            (sin, cos)
        }
    }))
}

/// Returns the base inertial parameters of links with these inertias in the frames of the chain. The part of the inertia that is symmetric
/// about a joint axis is added to the previous link (Gautier and Khalil 1990).
fn regroup(
    bodies: &[Inertia; JOINTS],
    transforms: &[JointTransform; JOINTS],
    z_rotations: &[(f64, f64); JOINTS],
    z_shifts: &[f64; JOINTS],
) -> [BaseInertialParameters; JOINTS] {
    let mut parameters = [Inertia::NONE.split().0; JOINTS];
    let mut moved = Inertia::NONE;
    for k in (0..JOINTS).rev() {
        let (s, c) = z_rotations[k];
        let mut total = bodies[k].placed(&about_z(-s, c), &[0.0, 0.0, -z_shifts[k]]);
        total.add(&moved);
        let (rest, symmetric) = total.split();
        parameters[k] = rest;
        let [x, y] = transforms[k].p;
        moved = symmetric.placed(&about_x(transforms[k].sin, transforms[k].cos), &[x, y, 0.0]);
    }
    parameters
}
