//! Inverse dynamics: recursive Newton-Euler in the frames and with the parameters of [`crate::chain`].

use crate::chain::{Body, Chain, Twist};
use crate::model::{JOINTS, JointVec};
use crate::trig::sin_cos;

pub(crate) type Vec3 = [f64; 3];

/// Sine and cosine of every joint angle of the chain.
#[derive(Clone, Copy)]
pub(crate) struct Turns {
    pub sin: JointVec,
    pub cos: JointVec,
}

impl Turns {
    #[inline(always)]
    pub fn new(chain: &Chain, q: &JointVec) -> Self {
        let mut turns = Self { sin: [0.0; JOINTS], cos: [0.0; JOINTS] };
        for (k, (q, twist)) in q.iter().zip(&chain.twists).enumerate() {
            (turns.sin[k], turns.cos[k]) = sin_cos(q + twist.offset);
        }
        turns
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

/// Motion of a link in its own frame: angular velocity and acceleration, acceleration of the origin.
#[derive(Clone, Copy)]
struct Motion {
    w: Vec3,
    dw: Vec3,
    acc: Vec3,
}

/// Force and moment that a link asks for, in its own frame and about its origin.
#[derive(Clone, Copy)]
pub(crate) struct Wrench {
    pub f: Vec3,
    pub n: Vec3,
}

const ZERO: Wrench = Wrench { f: [0.0; 3], n: [0.0; 3] };

/// The products of the angular velocity, and U = [dw]× + [w]×[w]×, which takes a point to its acceleration.
struct Swing {
    u: [Vec3; 3],
    /// wx², wy², wz².
    square: Vec3,
    /// wy·wz, wz·wx, wx·wy.
    cross: Vec3,
}

impl Motion {
    #[inline(always)]
    fn swing(&self) -> Swing {
        let [x, y, z] = self.w;
        let [ax, ay, az] = self.dw;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (yz, zx, xy) = (y * z, z * x, x * y);
        Swing {
            u: [
                [-(yy + zz), xy - az, zx + ay],
                [xy + az, -(zz + xx), yz - ax],
                [zx - ay, yz + ax, -(xx + yy)],
            ],
            square: [xx, yy, zz],
            cross: [yz, zx, xy],
        }
    }

    /// Motion of the link after joint `t`.
    #[inline(always)]
    fn next(&self, swing: &Swing, t: &Twist, (s, c): (f64, f64), qd: f64, qdd: f64) -> Self {
        let p = &t.p;
        let reach = |k: usize| {
            let u = &swing.u[k];
            self.acc[k] + (u[0] * p[0] + u[1] * p[1] + u[2] * p[2])
        };
        let acc = rz_back(s, c, rx_back(t, [reach(0), reach(1), reach(2)]));
        let w = rz_back(s, c, rx_back(t, self.w));
        let dw = rz_back(s, c, rx_back(t, self.dw));
        Self { w: [w[0], w[1], w[2] + qd], dw: [dw[0] + w[1] * qd, dw[1] - w[0] * qd, dw[2] + qdd], acc }
    }
}

impl Body {
    #[inline(always)]
    fn wrench(&self, m: &Motion, swing: &Swing) -> Wrench {
        let Swing { u, square: [xx, yy, zz], cross: [yz, zx, xy] } = swing;
        let [ax, _, az] = m.dw;
        let b = self;
        let force = |k: usize| u[k][0] * b.hx + u[k][1] * b.hy;
        // Euler's equations written with the entries of U; Iyy is zero.
        let nx = (b.xx * ax + b.zz * yz) + (b.xz * u[1][0] - b.xy * u[2][0]) + b.yz * (yy - zz);
        let ny = (b.xx - b.zz) * zx + (b.xy * u[2][1] - b.yz * u[0][1]) + b.xz * (zz - xx);
        let nz = (b.zz * az - b.xx * xy) + (b.yz * u[0][2] - b.xz * u[1][2]) + b.xy * (xx - yy);
        // The first moment times the acceleration of the origin (with gravity in it).
        let n = [nx + b.hy * m.acc[2], ny - b.hx * m.acc[2], nz + (b.hx * m.acc[1] - b.hy * m.acc[0])];
        Wrench { f: [force(0), force(1), force(2)], n }
    }
}

/// A wrench on frame k as the frame k−1 sees it.
#[inline(always)]
pub(crate) fn inwards(t: &Twist, (s, c): (f64, f64), wrench: &Wrench) -> Wrench {
    let f = rz(s, c, wrench.f);
    let n = rz(s, c, wrench.n);
    let [a, b] = t.mid;
    let n = [n[0] + b * f[2], n[1] - a * f[2], n[2] + (a * f[1] - b * f[0])];
    Wrench { f: rx(t, f), n: rx(t, n) }
}

/// The wrench of each link alone, under the motion `qd`, `qdd`.
#[inline(always)]
pub(crate) fn wrenches(chain: &Chain, turns: &Turns, qd: &JointVec, qdd: &JointVec) -> [Wrench; JOINTS] {
    let mut out = [ZERO; JOINTS];
    let mut motion = Motion {
        w: [0.0, 0.0, qd[0]],
        dw: [0.0, 0.0, qdd[0]],
        acc: rz_back(turns.sin[0], turns.cos[0], chain.lift),
    };
    let mut swing = motion.swing();
    out[0] = chain.bodies[0].wrench(&motion, &swing);
    for k in 1..JOINTS {
        motion = motion.next(&swing, &chain.twists[k], (turns.sin[k], turns.cos[k]), qd[k], qdd[k]);
        swing = motion.swing();
        out[k] = chain.bodies[k].wrench(&motion, &swing);
    }
    out
}

/// Joint torques, N·m.
#[inline(always)]
pub(crate) fn inverse(chain: &Chain, q: &JointVec, qd: &JointVec, qdd: &JointVec) -> JointVec {
    let turns = Turns::new(chain, q);
    let links = wrenches(chain, &turns, qd, qdd);
    let mut torque = [0.0; JOINTS];
    let mut total = links[5];
    torque[5] = total.n[2];
    for k in (0..JOINTS - 1).rev() {
        let Wrench { f, n } = inwards(&chain.twists[k + 1], (turns.sin[k + 1], turns.cos[k + 1]), &total);
        let own = &links[k];
        total.f = [own.f[0] + f[0], own.f[1] + f[1], own.f[2] + f[2]];
        total.n = [own.n[0] + n[0], own.n[1] + n[1], own.n[2] + n[2]];
        torque[k] = total.n[2];
    }
    torque
}

/// Joint torques at rest, N·m: with no mass left in the links there are no forces, only moments.
#[inline(always)]
pub(crate) fn gravity_torque(chain: &Chain, q: &JointVec) -> JointVec {
    let turns = Turns::new(chain, q);
    let mut acc = chain.lift;
    let mut moments = [[0.0; 3]; JOINTS];
    for (k, moment) in moments.iter_mut().enumerate() {
        let t = &chain.twists[k];
        let along = if k == 0 { acc } else { rx_back(t, acc) };
        acc = rz_back(turns.sin[k], turns.cos[k], along);
        let b = &chain.bodies[k];
        *moment = [b.hy * acc[2], -b.hx * acc[2], b.hx * acc[1] - b.hy * acc[0]];
    }
    let mut torque = [0.0; JOINTS];
    let mut n = moments[5];
    torque[5] = n[2];
    for k in (0..JOINTS - 1).rev() {
        let t = &chain.twists[k + 1];
        let inner = rx(t, rz(turns.sin[k + 1], turns.cos[k + 1], n));
        n = [moments[k][0] + inner[0], moments[k][1] + inner[1], moments[k][2] + inner[2]];
        torque[k] = n[2];
    }
    torque
}
