//! Inverse dynamics: recursive Newton-Euler (Luh, Walker and Paul, On-line computational scheme for mechanical
//! manipulators, 1980) in the frames and with the base inertial parameters of [`crate::chain`].

// The variables have the same indices as in the formulas.
#![allow(clippy::needless_range_loop)]

use core::array::from_fn;

use crate::chain::{
    AnyShape, Axes, BaseInertialParameters, Chain, JointTransform, KnownShape, Shape, ThreeParallel,
    TwoParallel,
};
use crate::model::{JOINTS, JointVec};
use crate::trig::sin_cos;
use crate::unroll::unroll;

type Vec3 = [f64; 3];

/// Sines and cosines of the joint angles of the chain (position plus offset).
#[derive(Clone, Copy)]
pub(crate) struct JointSinesCosines {
    pub sin: JointVec,
    pub cos: JointVec,
}

impl JointSinesCosines {
    #[inline(always)]
    pub(crate) fn new(chain: &Chain, q: &JointVec) -> Self {
        let mut angle = *q;
        for k in 0..JOINTS {
            angle[k] += chain.transforms[k].offset;
        }
        // A compiler for a processor with SIMD can vectorise this loop over the six joints.
        let (mut sin, mut cos) = (angle, angle);
        for k in 0..JOINTS {
            (sin[k], cos[k]) = sin_cos(angle[k]);
        }
        Self { sin, cos }
    }
}

/// Returns Rx(α)·v.
#[inline(always)]
pub(crate) fn rx(t: &JointTransform, v: Vec3) -> Vec3 {
    [v[0], t.cos * v[1] - t.sin * v[2], t.sin * v[1] + t.cos * v[2]]
}

/// Returns Rx(α)ᵀ·v.
#[inline(always)]
fn rx_back(t: &JointTransform, v: Vec3) -> Vec3 {
    match t.axes {
        Axes::Parallel => [v[0], t.cos * v[1], t.cos * v[2]],
        Axes::Perpendicular => [v[0], v[2], -v[1]],
        Axes::Any => [v[0], t.cos * v[1] + t.sin * v[2], t.cos * v[2] - t.sin * v[1]],
    }
}

/// Returns the y and z components of Rx(α)ᵀ·(0, 0, `z`).
#[inline(always)]
fn axis_back(t: &JointTransform, z: f64) -> (f64, f64) {
    match t.axes {
        Axes::Parallel => (0.0, t.cos * z),
        Axes::Perpendicular => (z, 0.0),
        Axes::Any => (t.sin * z, t.cos * z),
    }
}

/// Returns Rz·v.
#[inline(always)]
pub(crate) fn rz(s: f64, c: f64, v: Vec3) -> Vec3 {
    [c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]]
}

/// Returns Rzᵀ·v.
#[inline(always)]
fn rz_back(s: f64, c: f64, v: Vec3) -> Vec3 {
    [c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]]
}

/// Two vectors that are rotated together.
pub(crate) type Pair3 = [[f64; 2]; 3];

/// Component of both vectors of a pair.
type Pair = [f64; 2];

#[inline(always)]
fn scaled(k: f64, v: Pair) -> Pair {
    v.map(|x| k * x)
}

/// Applies Rx(α) to both vectors.
#[inline(always)]
fn rx_pair(t: &JointTransform, &[x, y, z]: &Pair3) -> Pair3 {
    match t.axes {
        Axes::Parallel => [x, scaled(t.cos, y), scaled(t.cos, z)],
        Axes::Perpendicular => [x, z.map(|z| -z), y],
        Axes::Any => [x, from_fn(|i| t.cos * y[i] - t.sin * z[i]), from_fn(|i| t.sin * y[i] + t.cos * z[i])],
    }
}

/// Applies Rx(α)ᵀ to both vectors.
#[inline(always)]
fn rx_pair_back(t: &JointTransform, &[x, y, z]: &Pair3) -> Pair3 {
    match t.axes {
        Axes::Parallel => [x, scaled(t.cos, y), scaled(t.cos, z)],
        Axes::Perpendicular => [x, z, y.map(|y| -y)],
        Axes::Any => [x, from_fn(|i| t.cos * y[i] + t.sin * z[i]), from_fn(|i| t.cos * z[i] - t.sin * y[i])],
    }
}

/// Applies Rz to both vectors.
#[inline(always)]
fn rz_pair(s: f64, c: f64, v: &Pair3) -> Pair3 {
    let mut out = *v;
    for i in 0..2 {
        out[0][i] = c * v[0][i] - s * v[1][i];
        out[1][i] = s * v[0][i] + c * v[1][i];
    }
    out
}

/// Applies Rzᵀ to both vectors.
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
    /// Angular velocity (rad/s) and angular acceleration (rad/s²).
    angular: Pair3,
    /// Acceleration of the origin, m/s².
    acc: Vec3,
}

/// Force (N) and moment (N·m) that a link needs, in its own frame and about its origin.
pub(crate) type Wrench = Pair3;

/// U = [dw]× + [w]×[w]× (Khalil and Dombre, Modeling, Identification and Control of Robots). U maps the position of a point to its
/// acceleration relative to the origin.
type AccelerationMatrix = [Vec3; 3];

impl Motion {
    #[inline(always)]
    fn acceleration_matrix(&self) -> AccelerationMatrix {
        let [[x, ax], [y, ay], [z, az]] = self.angular;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (yz, zx, xy) = (y * z, z * x, x * y);
        [[-(yy + zz), xy - az, zx + ay], [xy + az, -(zz + xx), yz - ax], [zx - ay, yz + ax, -(xx + yy)]]
    }

    /// Returns the motion of the link after joint `t`.
    #[inline(always)]
    fn next(
        &self,
        u: &AccelerationMatrix,
        t: &JointTransform,
        (s, c): (f64, f64),
        qd: f64,
        qdd: f64,
    ) -> Self {
        let [x, y] = t.p;
        let reach = |k: usize| {
            // If the axes are parallel, the y coordinate of the shift is 0.
            let way = if t.axes == Axes::Parallel { u[k][0] * x } else { u[k][0] * x + u[k][1] * y };
            self.acc[k] + way
        };
        let acc = rz_back(s, c, rx_back(t, [reach(0), reach(1), reach(2)]));
        let mut angular = rz_pair_back(s, c, &rx_pair_back(t, &self.angular));
        let (wx, wy) = (angular[0][0], angular[1][0]);
        angular[0][1] += wy * qd;
        angular[1][1] -= wx * qd;
        angular[2][0] += qd;
        angular[2][1] += qdd;
        Self { angular, acc }
    }
}

impl BaseInertialParameters {
    #[inline(always)]
    fn wrench(&self, m: &Motion, [ux, uy, uz]: &AccelerationMatrix) -> Wrench {
        let b = self;
        let force = |u: &Vec3| u[0] * b.hx + u[1] * b.hy;
        // Integral of r × (acc + U·r) over the mass.
        let nx = (uz[0] * b.xy + uz[1] * b.yy + m.acc[2] * b.hy) + ((uz[2] - uy[1]) * b.yz - uy[0] * b.xz);
        let ny = ((ux[0] - uz[2]) * b.xz + ux[1] * b.yz) - (uz[0] * b.xx + uz[1] * b.xy + m.acc[2] * b.hx);
        let nz = (uy[0] * b.xx - ux[1] * b.yy) + (uy[1] - ux[0]) * b.xy + (uy[2] * b.xz - ux[2] * b.yz);
        let nz = nz + (m.acc[1] * b.hx - m.acc[0] * b.hy);
        [[force(ux), nx], [force(uy), ny], [force(uz), nz]]
    }
}

/// Transforms a wrench on frame k into frame k−1.
#[inline(always)]
pub(crate) fn inwards(t: &JointTransform, (s, c): (f64, f64), wrench: &Wrench) -> Wrench {
    let mut v = rx_pair(t, &rz_pair(s, c, wrench));
    let [x, y] = t.p;
    v[1][1] -= x * v[2][0];
    if t.axes == Axes::Parallel {
        v[2][1] += x * v[1][0];
    } else {
        v[0][1] += y * v[2][0];
        v[2][1] += x * v[1][0] - y * v[0][0];
    }
    v
}

/// Returns the wrench that each link alone needs for the velocities `qd` and accelerations `qdd`. For the first link only the moment about
/// its axis is computed, because the base supports all other components.
#[inline(always)]
fn wrenches<S: Shape>(
    chain: &Chain,
    trig: &JointSinesCosines,
    qd: &JointVec,
    qdd: &JointVec,
) -> [Wrench; JOINTS] {
    let mut out = [[[0.0; 2]; 3]; JOINTS];
    let acc = rz_back(trig.sin[0], trig.cos[0], chain.base_acceleration);
    let first = &chain.base_parameters[0];
    out[0][2][1] = qdd[0] * (first.xx + first.yy) + (acc[1] * first.hx - acc[0] * first.hy);
    // The first link only rotates about its axis, so most elements of U for this link and of the motion of the second
    // link are zero.
    let t = &chain.transform::<S>(1);
    let (s, c) = (trig.sin[1], trig.cos[1]);
    let square = qd[0] * qd[0];
    let reach =
        [acc[0] - (square * t.p[0] + qdd[0] * t.p[1]), acc[1] + (qdd[0] * t.p[0] - square * t.p[1]), acc[2]];
    let ((wy, wz), (ay, az)) = (axis_back(t, qd[0]), axis_back(t, qdd[0]));
    let (wx, wy) = (s * wy, c * wy);
    let mut motion = Motion {
        angular: [[wx, s * ay + wy * qd[1]], [wy, c * ay - wx * qd[1]], [wz + qd[1], az + qdd[1]]],
        acc: rz_back(s, c, rx_back(t, reach)),
    };
    let mut u = motion.acceleration_matrix();
    out[1] = chain.base_parameters[1].wrench(&motion, &u);
    unroll!(K in [2, 3, 4, 5] {
        motion = motion.next(&u, &chain.transform::<S>(K), (trig.sin[K], trig.cos[K]), qd[K], qdd[K]);
        u = motion.acceleration_matrix();
        out[K] = chain.base_parameters[K].wrench(&motion, &u);
    });
    out
}

#[inline(always)]
fn sum(a: &Wrench, b: &Wrench) -> Wrench {
    from_fn(|i| [a[i][0] + b[i][0], a[i][1] + b[i][1]])
}

/// Returns the joint torques, N·m, by the recursion that was compiled for the shape of the arm.
#[inline(always)]
pub(crate) fn inverse(chain: &Chain, q: &JointVec, qd: &JointVec, qdd: &JointVec) -> JointVec {
    match chain.shape {
        KnownShape::ThreeParallel => inverse_of::<ThreeParallel>(chain, q, qd, qdd),
        KnownShape::TwoParallel => inverse_of::<TwoParallel>(chain, q, qd, qdd),
        KnownShape::Any => inverse_of::<AnyShape>(chain, q, qd, qdd),
    }
}

/// Like [`inverse`], compiled for one arm shape. Each shape has its own function, so that developers can inspect the machine code.
#[inline(never)]
fn inverse_of<S: Shape>(chain: &Chain, q: &JointVec, qd: &JointVec, qdd: &JointVec) -> JointVec {
    recursion::<S>(chain, &JointSinesCosines::new(chain, q), qd, qdd)
}

/// Runs the recursion outwards and inwards along the chain.
#[inline(always)]
pub(crate) fn recursion<S: Shape>(
    chain: &Chain,
    trig: &JointSinesCosines,
    qd: &JointVec,
    qdd: &JointVec,
) -> JointVec {
    let links = wrenches::<S>(chain, trig, qd, qdd);
    let mut torque = [0.0; JOINTS];
    let mut total = links[5];
    torque[5] = total[2][1];
    unroll!(K in [4, 3, 2, 1, 0] {
        let v = inwards(&chain.transform::<S>(K + 1), (trig.sin[K + 1], trig.cos[K + 1]), &total);
        total = sum(&links[K], &v);
        torque[K] = total[2][1];
    });
    torque
}

/// Returns the joint torques at rest, N·m. The base inertial parameters do not include a mass, so the recursion needs only moments and no
/// forces.
#[inline(always)]
pub(crate) fn gravity_torque(chain: &Chain, trig: &JointSinesCosines) -> JointVec {
    static_torque(chain, trig, |k| [chain.base_parameters[k].hx, chain.base_parameters[k].hy])
}

/// Returns the joint torques that hold 1 kg at the flange, N·m.
#[inline(always)]
pub(crate) fn flange_torque(chain: &Chain, trig: &JointSinesCosines) -> JointVec {
    static_torque(chain, trig, |k| chain.flange[k])
}

/// Returns the joint torques at rest for links with the given first moments (kg·m).
#[inline(always)]
fn static_torque(
    chain: &Chain,
    trig: &JointSinesCosines,
    first_moment: impl Fn(usize) -> [f64; 2],
) -> JointVec {
    let mut acc = chain.base_acceleration;
    let mut moments = [[0.0; 3]; JOINTS];
    unroll!(K in [0, 1, 2, 3, 4, 5] {
        let along = if K == 0 { acc } else { rx_back(&chain.transform::<AnyShape>(K), acc) };
        acc = rz_back(trig.sin[K], trig.cos[K], along);
        let [hx, hy] = first_moment(K);
        moments[K] = [hy * acc[2], -hx * acc[2], hx * acc[1] - hy * acc[0]];
    });
    let mut torque = [0.0; JOINTS];
    let mut n = moments[5];
    torque[5] = n[2];
    unroll!(K in [4, 3, 2, 1, 0] {
        let inner = rx(&chain.transforms[K + 1], rz(trig.sin[K + 1], trig.cos[K + 1], n));
        n = [moments[K][0] + inner[0], moments[K][1] + inner[1], moments[K][2] + inner[2]];
        torque[K] = n[2];
    });
    torque
}

#[cfg(test)]
mod tests;
