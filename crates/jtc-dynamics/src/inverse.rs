//! Inverse dynamics: recursive Newton-Euler in the frames and with the parameters of [`crate::chain`].

// The indices are those of the formulas.
#![allow(clippy::needless_range_loop)]

use crate::chain::{Body, Chain, Twist};
use crate::model::{JOINTS, JointVec};
use crate::trig::sin_cos;
use crate::unroll::unroll;

type Vec3 = [f64; 3];

/// Sine and cosine of every joint angle of the chain.
#[derive(Clone, Copy)]
pub(crate) struct Turns {
    pub sin: JointVec,
    pub cos: JointVec,
}

impl Turns {
    #[inline(always)]
    pub fn new(chain: &Chain, q: &JointVec) -> Self {
        let mut angle = *q;
        for k in 0..JOINTS {
            angle[k] += chain.twists[k].offset;
        }
        // One loop over all six: it becomes SIMD code where there is SIMD.
        let (mut sin, mut cos) = (angle, angle);
        for k in 0..JOINTS {
            (sin[k], cos[k]) = sin_cos(angle[k]);
        }
        Self { sin, cos }
    }
}

/// Rx(α)·v.
#[inline(always)]
pub(crate) fn rx(t: &Twist, v: Vec3) -> Vec3 {
    [v[0], t.cos * v[1] - t.sin * v[2], t.sin * v[1] + t.cos * v[2]]
}

/// Rx(α)ᵀ·v.
#[inline(always)]
fn rx_back(t: &Twist, v: Vec3) -> Vec3 {
    [v[0], t.cos * v[1] + t.sin * v[2], t.cos * v[2] - t.sin * v[1]]
}

/// Rz·v.
#[inline(always)]
pub(crate) fn rz(s: f64, c: f64, v: Vec3) -> Vec3 {
    [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]]
}

/// Rzᵀ·v.
#[inline(always)]
fn rz_back(s: f64, c: f64, v: Vec3) -> Vec3 {
    [c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]]
}

/// Two vectors side by side: they are turned together.
pub(crate) type Pair3 = [[f64; 2]; 3];

/// Rx(α) of both vectors.
#[inline(always)]
fn rx_pair(t: &Twist, v: &Pair3) -> Pair3 {
    let mut out = *v;
    for i in 0..2 {
        out[1][i] = t.cos * v[1][i] - t.sin * v[2][i];
        out[2][i] = t.sin * v[1][i] + t.cos * v[2][i];
    }
    out
}

/// Rx(α)ᵀ of both vectors.
#[inline(always)]
fn rx_pair_back(t: &Twist, v: &Pair3) -> Pair3 {
    let mut out = *v;
    for i in 0..2 {
        out[1][i] = t.cos * v[1][i] + t.sin * v[2][i];
        out[2][i] = t.cos * v[2][i] - t.sin * v[1][i];
    }
    out
}

/// Rz of both vectors.
#[inline(always)]
fn rz_pair(s: f64, c: f64, v: &Pair3) -> Pair3 {
    let mut out = *v;
    for i in 0..2 {
        out[0][i] = c * v[0][i] - s * v[1][i];
        out[1][i] = s * v[0][i] + c * v[1][i];
    }
    out
}

/// Rzᵀ of both vectors.
#[inline(always)]
fn rz_pair_back(s: f64, c: f64, v: &Pair3) -> Pair3 {
    let mut out = *v;
    for i in 0..2 {
        out[0][i] = c * v[0][i] + s * v[1][i];
        out[1][i] = c * v[1][i] - s * v[0][i];
    }
    out
}

/// Motion of a link in its own frame.
#[derive(Clone, Copy)]
struct Motion {
    /// Angular velocity and angular acceleration.
    turn: Pair3,
    /// Acceleration of the origin.
    acc: Vec3,
}

/// Force and moment that a link asks for, in its own frame and about its origin.
pub(crate) type Wrench = Pair3;

/// U = [dw]× + [w]×[w]×, which takes a point to its acceleration relative to the origin.
type Swing = [Vec3; 3];

impl Motion {
    #[inline(always)]
    fn swing(&self) -> Swing {
        let [[x, ax], [y, ay], [z, az]] = self.turn;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (yz, zx, xy) = (y * z, z * x, x * y);
        [[-(yy + zz), xy - az, zx + ay], [xy + az, -(zz + xx), yz - ax], [zx - ay, yz + ax, -(xx + yy)]]
    }

    /// Motion of the link after joint `t`.
    #[inline(always)]
    fn next(&self, u: &Swing, t: &Twist, (s, c): (f64, f64), qd: f64, qdd: f64) -> Self {
        let p = &t.p;
        let reach = |k: usize| self.acc[k] + (u[k][0] * p[0] + u[k][1] * p[1]);
        let acc = rz_back(s, c, rx_back(t, [reach(0), reach(1), reach(2)]));
        let mut turn = rz_pair_back(s, c, &rx_pair_back(t, &self.turn));
        let (wx, wy) = (turn[0][0], turn[1][0]);
        turn[0][1] += wy * qd;
        turn[1][1] -= wx * qd;
        turn[2][0] += qd;
        turn[2][1] += qdd;
        Self { turn, acc }
    }
}

impl Body {
    #[inline(always)]
    fn wrench(&self, m: &Motion, [ux, uy, uz]: &Swing) -> Wrench {
        let b = self;
        let force = |u: &Vec3| u[0] * b.hx + u[1] * b.hy;
        // The integral of r × (acc + U·r) over the mass.
        let nx = (uz[0] * b.xy + uz[1] * b.yy + m.acc[2] * b.hy) + ((uz[2] - uy[1]) * b.yz - uy[0] * b.xz);
        let ny = ((ux[0] - uz[2]) * b.xz + ux[1] * b.yz) - (uz[0] * b.xx + uz[1] * b.xy + m.acc[2] * b.hx);
        let nz = (uy[0] * b.xx - ux[1] * b.yy) + (uy[1] - ux[0]) * b.xy + (uy[2] * b.xz - ux[2] * b.yz);
        let nz = nz + (m.acc[1] * b.hx - m.acc[0] * b.hy);
        [[force(ux), nx], [force(uy), ny], [force(uz), nz]]
    }
}

/// A wrench on frame k as the frame k−1 sees it.
#[inline(always)]
pub(crate) fn inwards(t: &Twist, (s, c): (f64, f64), wrench: &Wrench) -> Wrench {
    let mut v = rx_pair(t, &rz_pair(s, c, wrench));
    let [x, y] = t.p;
    v[0][1] += y * v[2][0];
    v[1][1] -= x * v[2][0];
    v[2][1] += x * v[1][0] - y * v[0][0];
    v
}

/// The wrench of each link alone, under the motion `qd`, `qdd`. Of the first only the moment about its axis
/// is filled in: the rest goes into the base.
#[inline(always)]
fn wrenches(chain: &Chain, turns: &Turns, qd: &JointVec, qdd: &JointVec) -> [Wrench; JOINTS] {
    let mut out = [[[0.0; 2]; 3]; JOINTS];
    let acc = rz_back(turns.sin[0], turns.cos[0], chain.lift);
    let first = &chain.bodies[0];
    out[0][2][1] = qdd[0] * (first.xx + first.yy) + (acc[1] * first.hx - acc[0] * first.hy);
    // The first link only turns about its axis, so most of U and of the motion of the second is zero.
    let t = &chain.twists[1];
    let (s, c) = (turns.sin[1], turns.cos[1]);
    let square = qd[0] * qd[0];
    let reach =
        [acc[0] - (square * t.p[0] + qdd[0] * t.p[1]), acc[1] + (qdd[0] * t.p[0] - square * t.p[1]), acc[2]];
    let (y, z) = ([t.sin * qd[0], t.sin * qdd[0]], [t.cos * qd[0], t.cos * qdd[0]]);
    let (wx, wy) = (s * y[0], c * y[0]);
    let mut motion = Motion {
        turn: [[wx, s * y[1] + wy * qd[1]], [wy, c * y[1] - wx * qd[1]], [z[0] + qd[1], z[1] + qdd[1]]],
        acc: rz_back(s, c, rx_back(t, reach)),
    };
    let mut swing = motion.swing();
    out[1] = chain.bodies[1].wrench(&motion, &swing);
    unroll!(K in [2, 3, 4, 5] {
        motion = motion.next(&swing, &chain.twists[K], (turns.sin[K], turns.cos[K]), qd[K], qdd[K]);
        swing = motion.swing();
        out[K] = chain.bodies[K].wrench(&motion, &swing);
    });
    out
}

#[inline(always)]
fn sum(a: &Wrench, b: &Wrench) -> Wrench {
    core::array::from_fn(|i| [a[i][0] + b[i][0], a[i][1] + b[i][1]])
}

/// Joint torques, N·m.
#[inline(always)]
pub(crate) fn inverse(chain: &Chain, turns: &Turns, qd: &JointVec, qdd: &JointVec) -> JointVec {
    let links = wrenches(chain, turns, qd, qdd);
    let mut torque = [0.0; JOINTS];
    let mut total = links[5];
    torque[5] = total[2][1];
    unroll!(K in [4, 3, 2, 1, 0] {
        let v = inwards(&chain.twists[K + 1], (turns.sin[K + 1], turns.cos[K + 1]), &total);
        total = sum(&links[K], &v);
        torque[K] = total[2][1];
    });
    torque
}

/// Joint torques at rest, N·m: with no mass left in the links there are no forces, only moments.
#[inline(always)]
pub(crate) fn gravity_torque(chain: &Chain, turns: &Turns) -> JointVec {
    static_torque(chain, turns, |k| [chain.bodies[k].hx, chain.bodies[k].hy])
}

/// Joint torques that hold 1 kg at the flange, N·m.
#[inline(always)]
pub(crate) fn flange_torque(chain: &Chain, turns: &Turns) -> JointVec {
    static_torque(chain, turns, |k| chain.flange[k])
}

/// Joint torques at rest of bodies with these first moments (kg·m).
#[inline(always)]
fn static_torque(chain: &Chain, turns: &Turns, first_moment: impl Fn(usize) -> [f64; 2]) -> JointVec {
    let mut acc = chain.lift;
    let mut moments = [[0.0; 3]; JOINTS];
    unroll!(K in [0, 1, 2, 3, 4, 5] {
        let along = if K == 0 { acc } else { rx_back(&chain.twists[K], acc) };
        acc = rz_back(turns.sin[K], turns.cos[K], along);
        let [hx, hy] = first_moment(K);
        moments[K] = [hy * acc[2], -hx * acc[2], hx * acc[1] - hy * acc[0]];
    });
    let mut torque = [0.0; JOINTS];
    let mut n = moments[5];
    torque[5] = n[2];
    unroll!(K in [4, 3, 2, 1, 0] {
        let inner = rx(&chain.twists[K + 1], rz(turns.sin[K + 1], turns.cos[K + 1], n));
        n = [moments[K][0] + inner[0], moments[K][1] + inner[1], moments[K][2] + inner[2]];
        torque[K] = n[2];
    });
    torque
}
