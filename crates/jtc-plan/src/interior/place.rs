//! Limits at a point of a path as functions of the spline coefficients.
use crate::along::Plan;
use crate::{JOINTS, JointVec};

/// Weights of three neighbouring spline coefficients. Their weighted sum is one value of the spline.
pub(super) type Three = [f64; 3];

/// A point at which the limits must be kept, such as the end of a cell.
pub(super) struct Place {
    /// Index of the first of the three coefficients.
    pub at: usize,
    /// Weights of the spline coefficients for the squared speed. The next two fields are the weights for its slope
    /// and its second derivative (bend).
    pub b: Three,
    pub slope: Three,
    pub bend: Three,
    /// Coefficients of the joint jerks, as shares of the jerk limits: for bend (second derivative of the squared
    /// speed), slope and squared speed. The sum must be multiplied by the speed. The next field contains the
    /// coefficients of the joint accelerations, as shares of the acceleration limits: for slope and squared speed.
    pub jerk: [JointVec; 3],
    pub acceleration: [JointVec; 2],
    /// Highest squared speed, if speed, acceleration and torque are limited at this point.
    pub cap: f64,
    /// Weight of this point in the numerical integration of 1/speed, which gives the duration. The next field
    /// contains the spline weights and the integration weight of the middle of the cell.
    pub weight: f64,
    pub middle: (Three, f64),
    pub torque: Option<Torque>,
}

pub(super) struct Torque {
    /// First derivative of the path.
    pub first: JointVec,
    /// Factor of the slope of the squared speed in the torque.
    pub mass: JointVec,
    /// Factor of the squared speed in the torque.
    pub speed: JointVec,
    /// Available torque without friction, in the positive and negative direction, N·m.
    pub high: JointVec,
    pub low: JointVec,
}

fn dot(three: &Three, c: &[f64]) -> f64 {
    three[0] * c[0] + three[1] * c[1] + three[2] * c[2]
}

impl Place {
    /// Returns the joint jerks as shares of their limits, divided by the path speed.
    fn jerks(&self, b: f64, slope: f64, bend: f64) -> JointVec {
        let [by_bend, by_slope, by_b] = &self.jerk;
        std::array::from_fn(|j| by_bend[j] * bend + by_slope[j] * slope + by_b[j] * b)
    }

    /// Returns the accelerations as shares of their limits.
    fn accelerations(&self, b: f64, slope: f64) -> JointVec {
        let [by_slope, by_b] = &self.acceleration;
        std::array::from_fn(|j| by_slope[j] * slope + by_b[j] * b)
    }

    /// Sets the coefficients for a point at which the arm is at rest. At rest, only the jerk in the direction of the
    /// path remains.
    pub(super) fn at_rest(&mut self) {
        (self.jerk[1], self.jerk[2]) = ([0.0; JOINTS], [0.0; JOINTS]);
    }

    /// Returns the contribution of this point to the duration, and to the sum of the logarithms of the distances from
    /// the limits. Returns `None` if a limit is exceeded.
    pub(super) fn value(&self, plan: &Plan, c: &[f64]) -> Option<(f64, f64)> {
        let c = &c[self.at..self.at + 3];
        let b = dot(&self.b, c);
        if b.is_nan() || b <= 0.0 {
            return None;
        }
        let speed = b.sqrt();
        let (slope, bend) = (dot(&self.slope, c), dot(&self.bend, c));
        let (mut time, mut product, mut least) = (0.0, 1.0, f64::INFINITY);
        let mut take = |left: f64| {
            least = left.min(least);
            product *= left;
        };
        for jerk in self.jerks(b, slope, bend) {
            take(1.0 - b * jerk * jerk);
        }
        if self.weight > 0.0 {
            time = self.weight / speed;
            if self.middle.1 > 0.0 {
                time += self.middle.1 / dot(&self.middle.0, c).sqrt();
            }
            take(1.0 - b / self.cap);
            for a in self.accelerations(b, slope) {
                take(1.0 - a * a);
            }
            if let (Some(torque), Some(arm)) = (&self.torque, plan.arm) {
                for j in 0..JOINTS {
                    let (low, high, ..) = arm.friction_line(j, torque.first[j] * speed);
                    let moving = torque.mass[j] * slope + torque.speed[j] * b;
                    let limit = plan.limits.torque[j];
                    take((torque.high[j] - high - moving) / limit);
                    take((torque.low[j] + low + moving) / limit);
                }
            }
        }
        let is_inside = least > 0.0 && product > 0.0;
        is_inside.then(|| (time, product.ln()))
    }

    /// Adds the contribution of this point to the derivatives of the minimised function (the duration plus `barrier`
    /// times the barriers) with respect to the spline coefficients.
    pub(super) fn add_to(
        &self,
        gradient: &mut [f64],
        hessian: &mut [[f64; 3]],
        plan: &Plan,
        c: &[f64],
        barrier: f64,
    ) {
        let at = self.at;
        let c = &c[at..at + 3];
        let b = dot(&self.b, c);
        let (mut g, mut h) = self.barriers(plan, b, dot(&self.slope, c), dot(&self.bend, c));
        g.iter_mut().for_each(|x| *x *= barrier);
        h.iter_mut().for_each(|x| *x *= barrier);
        if self.weight > 0.0 {
            let time = self.weight / b.sqrt();
            g[0] -= 0.5 * time / b;
            h[0] += 0.75 * time / (b * b);
            if self.middle.1 > 0.0 {
                let w = &self.middle.0;
                let b = dot(w, c);
                let time = self.middle.1 / b.sqrt();
                for p in 0..3 {
                    gradient[at + p] -= 0.5 * time / b * w[p];
                    for q in p..3 {
                        hessian[at + p][q - p] += 0.75 * time / (b * b) * w[p] * w[q];
                    }
                }
            }
        }
        let v = [&self.b, &self.slope, &self.bend];
        for p in 0..3 {
            gradient[at + p] += g[0] * v[0][p] + g[1] * v[1][p] + g[2] * v[2][p];
            let w = [
                h[0] * v[0][p] + h[3] * v[1][p] + h[4] * v[2][p],
                h[3] * v[0][p] + h[1] * v[1][p] + h[5] * v[2][p],
                h[4] * v[0][p] + h[5] * v[1][p] + h[2] * v[2][p],
            ];
            for q in p..3 {
                hessian[at + p][q - p] += w[0] * v[0][q] + w[1] * v[1][q] + w[2] * v[2][q];
            }
        }
    }

    /// Returns the first and second derivatives of the barriers with respect to squared speed, slope and bend. The
    /// second derivatives are in the order 00, 11, 22, 01, 02, 12.
    fn barriers(&self, plan: &Plan, b: f64, slope: f64, bend: f64) -> ([f64; 3], [f64; 6]) {
        let speed = b.sqrt();
        let (mut g, mut h) = ([0.0f64; 3], [0.0f64; 6]);
        let inner = self.jerks(b, slope, bend);
        let [by_bend, by_slope, by_b] = &self.jerk;
        for j in 0..JOINTS {
            let jerk = speed * inner[j];
            let d = [speed * by_b[j] + 0.5 * inner[j] / speed, speed * by_slope[j], speed * by_bend[j]];
            let left = (1.0 - jerk * jerk).recip();
            add(&mut g, &mut h, &d, 2.0 * jerk * left, 2.0 * (1.0 + jerk * jerk) * left * left);
        }
        if self.weight <= 0.0 {
            return (g, h);
        }
        let cap = (self.cap - b).recip();
        g[0] += cap;
        h[0] += cap * cap;
        let accelerations = self.accelerations(b, slope);
        let [by_slope, by_b] = &self.acceleration;
        for j in 0..JOINTS {
            let a = accelerations[j];
            let left = (1.0 - a * a).recip();
            let d = [by_b[j], by_slope[j]];
            add_two(&mut g, &mut h, &d, 2.0 * a * left, 2.0 * (1.0 + a * a) * left * left);
        }
        let (Some(torque), Some(arm)) = (&self.torque, plan.arm) else { return (g, h) };
        for j in 0..JOINTS {
            let (low, high, low_by, high_by) = arm.friction_line(j, torque.first[j] * speed);
            let by_b = 0.5 * torque.first[j] / speed;
            let moving = torque.mass[j] * slope + torque.speed[j] * b;
            let up = (torque.high[j] - high - moving).recip();
            let down = (torque.low[j] + low + moving).recip();
            add_two(&mut g, &mut h, &[torque.speed[j] + high_by * by_b, torque.mass[j]], up, up * up);
            add_two(&mut g, &mut h, &[torque.speed[j] + low_by * by_b, torque.mass[j]], -down, down * down);
        }
        (g, h)
    }
}

/// Adds a barrier to the gradient and to the second derivatives (in the order 00, 11, 22, 01, 02, 12). `one` and
/// `two` are the first and second derivative of the barrier.
fn add(g: &mut [f64; 3], h: &mut [f64; 6], d: &[f64; 3], one: f64, two: f64) {
    for i in 0..3 {
        g[i] += one * d[i];
        h[i] += two * d[i] * d[i];
    }
    h[3] += two * d[0] * d[1];
    h[4] += two * d[0] * d[2];
    h[5] += two * d[1] * d[2];
}

/// Adds the derivatives of a term that does not depend on the bend.
fn add_two(g: &mut [f64; 3], h: &mut [f64; 6], d: &[f64; 2], one: f64, two: f64) {
    g[0] += one * d[0];
    g[1] += one * d[1];
    h[0] += two * d[0] * d[0];
    h[1] += two * d[1] * d[1];
    h[3] += two * d[0] * d[1];
}
