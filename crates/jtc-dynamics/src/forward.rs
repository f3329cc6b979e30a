//! Mass matrix, computed by the composite-rigid-body algorithm, and forward dynamics, computed from the LDLᵀ factors of the mass matrix
//! (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 6). The bias torques are computed by recursive Newton-Euler.

// Matrix elements are named by their indices, as in the formulas. An unrolled loop over a triangle of a matrix also
// has iterations outside the triangle, which compute nothing.
#![allow(clippy::needless_range_loop, clippy::absurd_extreme_comparisons)]

use crate::chain::{AnyShape, BaseInertialParameters, Chain, JointTransform};
use crate::inverse::{JointSinesCosines, Wrench, inwards, recursion, rx, rz};
use crate::model::{JOINTS, JointVec};
use crate::unroll::unroll;

/// A square matrix over the joints.
pub(crate) type JointMat = [[f64; JOINTS]; JOINTS];

/// A composite rigid body: a link and all links after it. The parameters are the first and second moments of mass about the link's origin.
/// Base inertial parameters do not include a mass: see [`crate::chain`].
#[derive(Clone, Copy)]
struct Composite {
    h: [f64; 3],
    xx: f64,
    yy: f64,
    zz: f64,
    xy: f64,
    xz: f64,
    yz: f64,
}

/// Rotates the 2×2 part (`a`, `b`, `ab`) of a symmetric matrix by the angle with sine `s` and cosine `c`. Returns the
/// two diagonal entries and the off-diagonal entry.
#[inline(always)]
fn rotate_plane(s: f64, c: f64, a: f64, b: f64, ab: f64) -> (f64, f64, f64) {
    let w = s * (a - b) + (c + c) * ab;
    let d = s * w;
    (a - d, b + d, c * w - ab)
}

impl Composite {
    #[inline(always)]
    fn of(b: &BaseInertialParameters) -> Self {
        Self { h: [b.hx, b.hy, 0.0], xx: b.xx, yy: b.yy, zz: 0.0, xy: b.xy, xz: b.xz, yz: b.yz }
    }

    /// Returns this composite body of frame k, expressed in frame k−1.
    #[inline(always)]
    fn inwards(&self, t: &JointTransform, (s, c): (f64, f64)) -> Self {
        let (xx, yy, xy) = rotate_plane(s, c, self.xx, self.yy, self.xy);
        let [xz, yz, _] = rz(s, c, [self.xz, self.yz, 0.0]);
        let h = rz(s, c, self.h);
        let (yy, zz, yz) = rotate_plane(t.sin, t.cos, yy, self.zz, yz);
        let [_, xy, xz] = rx(t, [0.0, xy, xz]);
        let h = rx(t, h);
        let [x, y] = t.p;
        let (xh, yh) = (x * h[0], y * h[1]);
        let (xx, yy) = (xx + (xh + xh), yy + (yh + yh));
        Self { h, xx, yy, zz, xy: xy + (x * h[1] + y * h[0]), xz: xz + x * h[2], yz: yz + y * h[2] }
    }

    #[inline(always)]
    fn add(&mut self, b: &BaseInertialParameters) {
        self.h[0] += b.hx;
        self.h[1] += b.hy;
        self.xx += b.xx;
        self.yy += b.yy;
        self.xy += b.xy;
        self.xz += b.xz;
        self.yz += b.yz;
    }

    /// Returns the wrench for a unit acceleration about the z axis of the frame.
    #[inline(always)]
    fn column(&self) -> Wrench {
        [[-self.h[1], -self.xz], [self.h[0], -self.yz], [0.0, self.xx + self.yy]]
    }
}

/// Returns the lower triangle of the mass matrix. The upper triangle of the returned matrix is zero.
#[inline(always)]
fn lower(chain: &Chain, trig: &JointSinesCosines) -> JointMat {
    let mut m = [[0.0; JOINTS]; JOINTS];
    let mut columns = [[[0.0; 2]; 3]; JOINTS];
    let mut composite = Composite::of(&chain.base_parameters[5]);
    unroll!(K in [5, 4, 3, 2, 1] {
        columns[K] = composite.column();
        let t = &chain.transform::<AnyShape>(K);
        let rotation = (trig.sin[K], trig.cos[K]);
        unroll!(I in [1, 2, 3, 4, 5] {
            if I >= K {
                m[I][K] = columns[I][2][1];
                columns[I] = inwards(t, rotation, &columns[I]);
            }
        });
        composite = composite.inwards(t, rotation);
        composite.add(&chain.base_parameters[K - 1]);
    });
    m[0][0] = composite.column()[2][1];
    unroll!(I in [1, 2, 3, 4, 5] {
        m[I][0] = columns[I][2][1];
    });
    m
}

/// Returns the joint-space mass matrix, kg·m².
#[inline(always)]
pub(crate) fn mass_matrix(chain: &Chain, q: &JointVec) -> JointMat {
    let mut m = lower(chain, &JointSinesCosines::new(chain, q));
    for i in 0..JOINTS {
        for k in 0..i {
            m[k][i] = m[i][k];
        }
    }
    m
}

/// Smallest ratio of a pivot to its diagonal entry. A pivot below it is treated as a rounding error.
const PIVOT_MIN: f64 = 1.0e-14;

/// Solves M·x = b for a symmetric positive definite M, given by its lower triangle. The solution x is 0 for a joint whose pivot is zero or
/// a rounding error.
#[inline(always)]
fn solve(mut m: JointMat, mut x: JointVec) -> JointVec {
    let mut inverse = [0.0; JOINTS];
    unroll!(K in [0, 1, 2, 3, 4, 5] {
        let floor = m[K][K] * PIVOT_MIN;
        // The rows above row K are complete. m[K][I] contains L·D and is replaced by L.
        unroll!(I in [0, 1, 2, 3, 4] {
            if I < K {
                let scaled = m[K][I];
                let l = scaled * inverse[I];
                m[K][K] -= l * scaled;
                unroll!(J in [1, 2, 3, 4, 5] {
                    if J > K {
                        m[J][K] -= m[J][I] * l;
                    }
                });
                m[K][I] = l;
                x[K] -= l * x[I];
            }
        });
        let reciprocal = 1.0 / m[K][K];
        // The mask avoids a branch: it is all ones if the pivot is valid, and zero otherwise.
        let mask = u64::from(m[K][K] > floor).wrapping_neg();
        inverse[K] = f64::from_bits(reciprocal.to_bits() & mask);
    });
    unroll!(K in [5, 4, 3, 2, 1, 0] {
        x[K] *= inverse[K];
        unroll!(I in [1, 2, 3, 4, 5] {
            if I > K {
                x[K] -= m[I][K] * x[I];
            }
        });
    });
    x
}

/// Returns the effective inertia of each joint while the other joints are free, kg·m²: the reciprocal of the diagonal
/// of the inverse mass matrix with rotors.
pub(crate) fn felt_inertia(chain: &Chain, q: &JointVec, rotor: &JointVec) -> JointVec {
    let m = with_rotors(chain, q, rotor);
    core::array::from_fn(|k| felt(m, k))
}

/// Like [`felt_inertia`], but returns the inertia of one joint only.
pub(crate) fn felt_inertia_of(chain: &Chain, q: &JointVec, rotor: &JointVec, joint: usize) -> f64 {
    felt(with_rotors(chain, q, rotor), joint)
}

fn with_rotors(chain: &Chain, q: &JointVec, rotor: &JointVec) -> JointMat {
    let mut m = lower(chain, &JointSinesCosines::new(chain, q));
    for k in 0..JOINTS {
        m[k][k] += rotor[k];
    }
    m
}

fn felt(m: JointMat, joint: usize) -> f64 {
    let unit: JointVec = core::array::from_fn(|k| if k == joint { 1.0 } else { 0.0 });
    let acceleration = solve(m, unit);
    1.0 / unit.iter().zip(&acceleration).map(|(u, a)| u * a).sum::<f64>()
}

/// Returns the joint accelerations, rad/s²: the solution of M·qdd = tau − bias torques.
#[inline(always)]
pub(crate) fn forward(
    chain: &Chain,
    q: &JointVec,
    qd: &JointVec,
    tau: &JointVec,
    rotor: &JointVec,
) -> JointVec {
    let trig = JointSinesCosines::new(chain, q);
    let mut m = lower(chain, &trig);
    let mut rest = recursion::<AnyShape>(chain, &trig, qd, &[0.0; JOINTS]);
    for k in 0..JOINTS {
        m[k][k] += rotor[k];
        rest[k] = tau[k] - rest[k];
    }
    solve(m, rest)
}
