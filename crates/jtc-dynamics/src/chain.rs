//! The arm made ready to compute with: link frames and inertial parameters chosen so that little work is left
//! per call.
//!
//! Two choices of ours, neither of which changes a joint torque:
//!
//! * **Frames.** Each constant rotation between joints is Rz(a)·Rx(α)·Rz(b). Rz(b) is added to the joint's
//!   position and Rz(a) is given to the frame before, so Rx(α)·Rz(q + offset) is left: two plane rotations. A
//!   frame's origin may sit anywhere on its joint axis; it sits where the vector to the next origin is
//!   perpendicular to the axis.
//! * **Inertia.** What of a link is symmetric about its joint axis (its mass, the first and second moment along the
//!   axis) moves in the same way whether it turns with the link or not, so it is carried by the link before. Going from the wrist to the base, every link keeps seven numbers and no mass at all.

use crate::model::{ArmModel, JOINTS, Link, symmetric};
use crate::rotation::{Mat3, about_x, about_z, apply, congruent, from_rpy, product, unit};
use crate::trig::angle;

/// A joint: frame k in frame k−1 is a shift by `p`, Rx(α), Rz(q + offset).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twist {
    pub sin: f64,
    pub cos: f64,
    pub offset: f64,
    /// Origin of frame k in frame k−1, m; its z is 0 by choice of the origin of frame k−1.
    pub p: [f64; 2],
}

/// A link: what is left of its inertia in its own frame (mass, first moment along z and the integral of z²
/// are zero).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    /// First moment of mass: integrals of x and y over the mass, kg·m.
    pub hx: f64,
    pub hy: f64,
    /// Second moments of mass: integrals of x², y² and of the products, kg·m². Unlike moments of inertia
    /// these enter the torque with the acceleration of each axis alone.
    pub xx: f64,
    pub yy: f64,
    pub xy: f64,
    pub xz: f64,
    pub yz: f64,
}

/// A joint frame as the model has it: for kinematics.
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
    /// Seen from a frame in which the present one stands at `p`, turned by `r`.
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

    /// Splits off what is symmetric about z.
    fn split(&self) -> (Body, Self) {
        let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = self.j;
        // Integral of z²: what x² + z² and y² + z² share.
        let z2 = 0.5 * (xx + yy - zz);
        let [hx, hy, hz] = self.h;
        let rest = Body { hx, hy, xx: yy - z2, yy: xx - z2, xy: -xy, xz: -xz, yz: -yz };
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
    pub twists: [Twist; JOINTS],
    pub bodies: [Body; JOINTS],
    /// Minus gravity, seen after the first joint's Rx(α), m/s²: the base is taken to accelerate upwards.
    pub lift: [f64; 3],
    pub placements: [Placement; 7],
    /// First moments (`hx`, `hy`) of the bodies of an arm that is nothing but 1 kg at the flange, kg·m.
    pub flange: [[f64; 2]; JOINTS],
}

impl Chain {
    pub fn new(model: &ArmModel, gravity: [f64; 3]) -> Self {
        let placements = model.joints.map(|o| Placement { rotation: from_rpy(&o.rpy), xyz: o.xyz });
        let mut twists = [Twist { sin: 0.0, cos: 1.0, offset: 0.0, p: [0.0; 2] }; JOINTS];
        // Sine and cosine of the turn about z, and the shift along it, of our frame k from the model's.
        let mut turns = [(0.0, 1.0); JOINTS];
        let mut shifts = [0.0; JOINTS];
        let mut lift = gravity.map(|g| -g);
        let mut origins = [[0.0; 3]; JOINTS];
        for k in 0..JOINTS {
            let c = &placements[k].rotation;
            // The third column of Rz(a)·Rx(α) is (sin α sin a, −sin α cos a, cos α).
            let (cos_a, sin_a) = unit(-c[1][2], c[0][2]);
            let back = about_z(-sin_a, cos_a);
            let rest = product(&back, c);
            let (cos, sin) = unit(rest[2][2], -rest[1][2]);
            let (cos_b, sin_b) = unit(rest[0][0], -rest[0][1]);
            origins[k] = apply(&back, &placements[k].xyz);
            if k == 0 {
                lift = apply(&about_x(-sin, cos), &apply(&back, &lift));
            } else {
                turns[k - 1] = (sin_a, cos_a);
                twists[k - 1].offset += angle(sin_a, cos_a);
            }
            (twists[k].sin, twists[k].cos) = (sin, cos);
            twists[k].offset += angle(sin_b, cos_b);
        }
        for k in (1..JOINTS).rev() {
            let [x, y, z] = origins[k];
            shifts[k - 1] = z + shifts[k] * twists[k].cos;
            twists[k].p = [x, y - shifts[k] * twists[k].sin];
        }
        let bodies = regroup(&model.links, &twists, &turns, &shifts);
        let flange = regroup(&flange_mass(model), &twists, &turns, &shifts).map(|b| [b.hx, b.hy]);
        Self { twists, bodies, lift, placements, flange }
    }
}

/// Links without mass, but with 1 kg at the flange.
fn flange_mass(model: &ArmModel) -> [Link; 7] {
    let mut links = [Link::default(); 7];
    (links[JOINTS].mass, links[JOINTS].origin.xyz) = (1.0, model.joints[JOINTS].xyz);
    links
}

/// Inertia of the links in our frames, with the part symmetric about each joint axis handed inwards.
fn regroup(
    links: &[Link; 7],
    twists: &[Twist; JOINTS],
    turns: &[(f64, f64); JOINTS],
    shifts: &[f64; JOINTS],
) -> [Body; JOINTS] {
    let none = Inertia { mass: 0.0, h: [0.0; 3], j: [[0.0; 3]; 3] };
    let mut bodies = [none.split().0; JOINTS];
    let mut handed = none;
    for k in (0..JOINTS).rev() {
        let link = &links[k + 1];
        let about_com = Inertia { mass: link.mass, h: [0.0; 3], j: symmetric(&link.inertia) };
        let (s, c) = turns[k];
        let in_link = about_com.placed(&from_rpy(&link.origin.rpy), &link.origin.xyz);
        let mut total = in_link.placed(&about_z(-s, c), &[0.0, 0.0, -shifts[k]]);
        total.add(&handed);
        let (rest, symmetric) = total.split();
        bodies[k] = rest;
        let [x, y] = twists[k].p;
        handed = symmetric.placed(&about_x(twists[k].sin, twists[k].cos), &[x, y, 0.0]);
    }
    bodies
}
