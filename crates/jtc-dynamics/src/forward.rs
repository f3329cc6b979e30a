//! Mass matrix by composite rigid bodies, and forward dynamics by its LDLᵀ factors.

// Matrix elements are named by their indices, as in the formulas.
#![allow(clippy::needless_range_loop)]

use crate::chain::{Body, Chain, Twist};
use crate::inverse::{Turns, Wrench, inverse, inwards, rx, rz};
use crate::model::{JOINTS, JointVec};

/// A square matrix over the joints.
pub(crate) type JointMat = [[f64; JOINTS]; JOINTS];

/// A link and all that it carries, about the link's origin. There is no mass: see [`crate::chain`].
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

/// The plane part of a symmetric matrix turned by (s, c): its two diagonal entries and the product between them.
#[inline(always)]
fn turn(s: f64, c: f64, a: f64, b: f64, ab: f64) -> (f64, f64, f64) {
    let w = s * (a - b) + (c + c) * ab;
    let d = s * w;
    (a - d, b + d, c * w - ab)
}

impl Composite {
    fn of(b: &Body) -> Self {
        Self { h: [b.hx, b.hy, 0.0], xx: b.xx, yy: 0.0, zz: b.zz, xy: b.xy, xz: b.xz, yz: b.yz }
    }

    /// What frame k carries, as frame k−1 sees it.
    #[inline(always)]
    fn inwards(&self, t: &Twist, (s, c): (f64, f64)) -> Self {
        let (xx, yy, xy) = turn(s, c, self.xx, self.yy, self.xy);
        let [xz, yz, zz] = rz(s, c, [self.xz, self.yz, self.zz]);
        let h = rz(s, c, self.h);
        let [a, b] = t.mid;
        let (ah, bh) = (a * h[0], b * h[1]);
        let (ah, bh) = (ah + ah, bh + bh);
        let (xx, yy, zz) = (xx + bh, yy + ah, zz + (ah + bh));
        let (xy, xz, yz) = (xy - (a * h[1] + b * h[0]), xz - a * h[2], yz - b * h[2]);
        let (yy, zz, yz) = turn(t.sin, t.cos, yy, zz, yz);
        let [_, xy, xz] = rx(t, [0.0, xy, xz]);
        Self { h: rx(t, h), xx, yy, zz, xy, xz, yz }
    }

    #[inline(always)]
    fn add(&mut self, b: &Body) {
        self.h[0] += b.hx;
        self.h[1] += b.hy;
        self.xx += b.xx;
        self.xy += b.xy;
        self.xz += b.xz;
        self.yz += b.yz;
        self.zz += b.zz;
    }

    /// The wrench of a unit acceleration about the frame's z axis.
    #[inline(always)]
    fn column(&self) -> Wrench {
        Wrench { f: [-self.h[1], self.h[0], 0.0], n: [self.xz, self.yz, self.zz] }
    }
}

/// Lower triangle of the mass matrix; the upper one stays zero.
#[inline(always)]
fn lower(chain: &Chain, turns: &Turns) -> JointMat {
    let mut m = [[0.0; JOINTS]; JOINTS];
    let mut columns = [Wrench { f: [0.0; 3], n: [0.0; 3] }; JOINTS];
    let mut composite = Composite::of(&chain.bodies[5]);
    for k in (0..JOINTS).rev() {
        columns[k] = composite.column();
        for i in k..JOINTS {
            m[i][k] = columns[i].n[2];
        }
        if k > 0 {
            let t = &chain.twists[k];
            let turn = (turns.sin[k], turns.cos[k]);
            for column in &mut columns[k..] {
                *column = inwards(t, turn, column);
            }
            composite = composite.inwards(t, turn);
            composite.add(&chain.bodies[k - 1]);
        }
    }
    m
}

/// Joint-space mass matrix, kg·m².
#[inline(always)]
pub(crate) fn mass_matrix(chain: &Chain, q: &JointVec) -> JointMat {
    let mut m = lower(chain, &Turns::new(chain, q));
    for i in 0..JOINTS {
        for k in 0..i {
            m[k][i] = m[i][k];
        }
    }
    m
}

/// Smallest pivot, relative to its diagonal entry, that is not taken for rounding.
const PIVOT_MIN: f64 = 1.0e-14;

/// Solves M·x = b for a symmetric positive definite M given by its lower triangle. A joint whose pivot is zero or
/// lost in rounding gets 0.
#[inline(always)]
fn solve(mut m: JointMat, mut x: JointVec) -> JointVec {
    let mut inverse = [0.0; JOINTS];
    for k in 0..JOINTS {
        let pivot = m[k][k];
        for i in 0..k {
            // Row k holds L·D so far; make it L and take its part off the diagonal.
            let ld = m[k][i];
            let l = ld * inverse[i];
            m[k][k] -= l * ld;
            for j in k + 1..JOINTS {
                m[j][k] -= m[j][i] * l;
            }
            m[k][i] = l;
        }
        let reciprocal = 1.0 / m[k][k];
        inverse[k] = if m[k][k] > pivot * PIVOT_MIN { reciprocal } else { 0.0 };
    }
    for k in 1..JOINTS {
        for i in 0..k {
            x[k] -= m[k][i] * x[i];
        }
    }
    for k in 0..JOINTS {
        x[k] *= inverse[k];
    }
    for k in (0..JOINTS).rev() {
        for i in 0..k {
            x[i] -= m[k][i] * x[k];
        }
    }
    x
}

/// Joint accelerations, rad/s².
#[inline(always)]
pub(crate) fn forward(
    chain: &Chain,
    q: &JointVec,
    qd: &JointVec,
    tau: &JointVec,
    rotor: &JointVec,
) -> JointVec {
    let mut m = lower(chain, &Turns::new(chain, q));
    let mut rest = inverse(chain, q, qd, &[0.0; JOINTS]);
    for k in 0..JOINTS {
        m[k][k] += rotor[k];
        rest[k] = tau[k] - rest[k];
    }
    solve(m, rest)
}
