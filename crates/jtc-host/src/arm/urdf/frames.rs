//! Frames and rigid bodies, used to merge several links into one link.

use jtc_dynamics::{Link, Origin};

type Matrix = [[f64; 3]; 3];

const UNIT: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Frame relative to its parent frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    rotation: Matrix,
    position: [f64; 3],
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn applied(a: &Matrix, v: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|k| a[i][k] * v[k]).sum())
}

impl Frame {
    pub(super) const IDENTITY: Self = Self { rotation: UNIT, position: [0.0; 3] };

    /// Creates the frame Rz(yaw)·Ry(pitch)·Rx(roll). This is the convention of URDF.
    pub(super) fn of(origin: &Origin) -> Self {
        let [(sr, cr), (sp, cp), (sy, cy)] = origin.rpy.map(f64::sin_cos);
        Self {
            rotation: [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ],
            position: origin.xyz,
        }
    }

    /// Returns the frame as translation `xyz` and rotation `rpy`. If roll and yaw rotate about the same axis, only
    /// their sum is determined, and yaw is set to 0.
    pub(super) fn origin(&self) -> Origin {
        let r = &self.rotation;
        let cos_pitch = r[0][0].hypot(r[1][0]);
        let pitch = (-r[2][0]).atan2(cos_pitch);
        let rpy = if cos_pitch > 1e-9 {
            [r[2][1].atan2(r[2][2]), pitch, r[1][0].atan2(r[0][0])]
        } else {
            [(-r[1][2]).atan2(r[1][1]), pitch, 0.0]
        };
        Origin { xyz: self.position, rpy }
    }

    /// Returns `origin` if it describes this frame, which keeps its numbers exact, and otherwise the origin of this
    /// frame.
    pub(super) fn plain_origin(&self, origin: Origin) -> Origin {
        if *self == Self::of(&origin) { origin } else { self.origin() }
    }

    pub(super) fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }

    /// Returns the frame `next` relative to the parent of this frame. `next` must be relative to this frame.
    pub(super) fn then(&self, next: &Self) -> Self {
        let moved = applied(&self.rotation, &next.position);
        Self {
            rotation: product(&self.rotation, &next.rotation),
            position: std::array::from_fn(|i| self.position[i] + moved[i]),
        }
    }

    pub(super) fn inverse(&self) -> Self {
        let rotation = transposed(&self.rotation);
        let position = applied(&rotation, &self.position).map(|v| -v);
        Self { rotation, position }
    }

    /// Transforms a direction from this frame into the parent frame.
    pub(super) fn direction(&self, direction: &[f64; 3]) -> [f64; 3] {
        applied(&self.rotation, direction)
    }

    /// Returns a rotation that maps the z axis to `axis`. Returns `None` if `axis` is a zero vector.
    pub(super) fn turning_z_to(axis: [f64; 3]) -> Option<Self> {
        let norm = axis.iter().map(|v| v * v).sum::<f64>().sqrt();
        if !(norm > 1e-9 && norm.is_finite()) {
            return None;
        }
        let [x, y, z] = axis.map(|v| v / norm);
        let rotation = if z > 1.0 - 1e-12 {
            UNIT
        } else if z < -1.0 + 1e-12 {
            [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
        } else {
            // Rotation about the vector z × axis, by Rodrigues' formula.
            let k = 1.0 / (1.0 + z);
            [[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]]
        };
        Some(Self { rotation, position: [0.0; 3] })
    }
}

/// Rigid body: mass, centre of mass, and inertia about the centre of mass, relative to a frame.
#[derive(Clone, Debug)]
pub(super) struct Body {
    mass: f64,
    centre: [f64; 3],
    inertia: Matrix,
}

impl Body {
    pub(super) const NONE: Self = Self { mass: 0.0, centre: [0.0; 3], inertia: [[0.0; 3]; 3] };

    /// Creates the body of a link in the link's frame.
    pub(super) fn of(link: &Link) -> Self {
        let [xx, xy, xz, yy, yz, zz] = link.inertia;
        let own = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let frame = Frame::of(&link.origin);
        let inertia = product(&product(&frame.rotation, &own), &transposed(&frame.rotation));
        Self { mass: link.mass, centre: link.origin.xyz, inertia }
    }

    /// Transforms the body from `frame` into the parent of `frame`.
    pub(super) fn seen_from(&self, frame: &Frame) -> Self {
        let turned = applied(&frame.rotation, &self.centre);
        Self {
            mass: self.mass,
            centre: std::array::from_fn(|i| turned[i] + frame.position[i]),
            inertia: product(&product(&frame.rotation, &self.inertia), &transposed(&frame.rotation)),
        }
    }

    /// Returns the inertia of the body about `point`, by the parallel-axis theorem.
    fn about(&self, point: &[f64; 3]) -> Matrix {
        let d: [f64; 3] = std::array::from_fn(|i| self.centre[i] - point[i]);
        let square: f64 = d.iter().map(|v| v * v).sum();
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let unit = if i == j { square } else { 0.0 };
                self.inertia[i][j] + self.mass * (unit - d[i] * d[j])
            })
        })
    }

    /// Adds the mass and inertia of `other` to this body.
    pub(super) fn add(&mut self, other: &Self) {
        let mass = self.mass + other.mass;
        let centre = if mass == 0.0 {
            other.centre
        } else {
            std::array::from_fn(|i| (self.mass * self.centre[i] + other.mass * other.centre[i]) / mass)
        };
        let (a, b) = (self.about(&centre), other.about(&centre));
        *self = Self {
            mass,
            centre,
            inertia: std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j])),
        };
    }

    /// Returns the body as a link. The inertia frame of this link has the same orientation as the frame of the link.
    pub(super) fn link(&self) -> Link {
        let i = &self.inertia;
        Link {
            origin: Origin { xyz: self.centre, rpy: [0.0; 3] },
            inertia: [i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]],
            mass: self.mass,
        }
    }
}
