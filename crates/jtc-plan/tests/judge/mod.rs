//! Random arms and waypoints, and a check of motions that is independent of the planner. The check samples the
//! positions of a motion and computes their differences.

use std::fmt::Write as _;

use jtc_core::{Config, Friction, Parameters, Payload, friction};
use jtc_dynamics::{ArmModel, Dynamics};
use jtc_plan::{ArmDynamics, JOINTS, JointVec, Limits, Motion, Waypoint};

/// Time between samples, s.
const H: f64 = 5e-4;
/// Tolerance for limits that are checked with differences, because positions are rounded.
const ROUNDING: f64 = 1e-6;

/// An arm with limits, and waypoints.
pub(crate) struct Case {
    pub config: Config,
    pub model: ArmModel,
    pub friction: Option<Friction>,
    pub temperature: f64,
    pub limits: Limits,
    pub with_torque: bool,
    pub waypoints: Vec<JointVec>,
    pub blend: f64,
}

fn between(rng: &mut fastrand::Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

impl Case {
    /// Returns the arm of arms/avena.toml with random masses, limits, payload and waypoints.
    pub(crate) fn random(seed: u64) -> Self {
        let rng = &mut fastrand::Rng::with_seed(seed);
        let parameters = Parameters::avena();
        let mut config = Config::avena();
        for joint in &mut config.joints {
            joint.velocity_max *= between(rng, 0.3, 1.1);
            joint.acceleration_max *= between(rng, 0.2, 1.5);
            joint.torque_max *= between(rng, 0.8, 1.3);
        }
        let mass = if rng.bool() { between(rng, 0.0, 3.0) } else { 0.0 };
        config.payload = Payload { mass, com: [0.0, 0.0, between(rng, 0.0, 0.1)], inertia: [0.0; 6] };
        let mut model = parameters.model;
        for link in &mut model.links {
            link.mass *= between(rng, 0.9, 1.1);
        }
        let mut limits = Limits::of(&config);
        match rng.u8(0..4) {
            0 => limits = limits.without_jerk(),
            1 => limits.jerk.iter_mut().for_each(|j| *j *= between(rng, 0.1, 6.0)),
            2 => limits = limits.at_speed(between(rng, 0.05, 1.0)),
            _ => {}
        }
        let friction = match rng.u8(0..3) {
            0 => None,
            1 => Some(parameters.friction),
            _ => Some(Parameters::avena_friction_table()),
        };
        let count = *rng.choice(&[2, 2, 3, 4, 6, 10, 25]).unwrap_or(&2);
        let (waypoints, blend) =
            (waypoints(rng, count, &limits), *rng.choice(&[0.0, 0.01, 0.05, 0.2, 1.0]).unwrap_or(&0.0));
        let temperature = between(rng, 22.0, 42.0);
        let with_torque = rng.u8(0..3) > 0;
        if rng.bool() {
            limits = limits.with_margin(*rng.choice(&[0.15, 0.15, 0.05, 0.3, 0.5]).unwrap_or(&0.15));
        }
        Self { config, model, friction, temperature, limits, with_torque, waypoints, blend }
    }

    pub(crate) fn arm(&self) -> Option<ArmDynamics<'_>> {
        let arm = ArmDynamics::new(&self.config, &self.model, self.friction.as_ref());
        self.with_torque.then(|| arm.at_temperature(self.temperature))
    }

    pub(crate) fn given(&self) -> Vec<Waypoint> {
        self.waypoints.iter().copied().map(Waypoint::from).collect()
    }

    /// Returns the joint torques, including rotor inertia and friction, for these positions, velocities and
    /// accelerations.
    pub(crate) fn torque(&self, dynamics: &Dynamics, q: &JointVec, v: &JointVec, a: &JointVec) -> JointVec {
        let mut torque = dynamics.inverse(q, v, a);
        for j in 0..JOINTS {
            torque[j] += self.config.joints[j].rotor_inertia * a[j];
            torque[j] += self.friction_at(j, v[j]);
        }
        torque
    }

    /// Returns all errors of a motion through the waypoints, and the highest used shares of the velocity, acceleration,
    /// jerk and torque limits. If `on_legs` is set, also checks that the motion stays on the legs.
    pub(crate) fn judge(&self, motion: &Motion, on_legs: bool) -> (String, [f64; 4]) {
        let mut wrong = String::new();
        self.ends(motion, &mut wrong);
        let used = self.differences(motion, &mut wrong);
        if on_legs {
            self.on_the_legs(motion, &mut wrong);
        }
        (wrong, used)
    }

    fn ends(&self, motion: &Motion, wrong: &mut String) {
        let (first, last) = (motion.at(0.0), motion.at(motion.duration()));
        if first.position != self.waypoints[0] || last.position != self.waypoints[self.waypoints.len() - 1] {
            let _ = writeln!(wrong, "it does not begin or end at its waypoints: {first:?} {last:?}");
        }
        if first.velocity != [0.0; JOINTS] || last.velocity != [0.0; JOINTS] {
            let _ = writeln!(wrong, "it does not begin or end at rest: {first:?} {last:?}");
        }
        let times = motion.waypoint_times();
        if times.len() != self.waypoints.len() || times.windows(2).any(|t| t[1] < t[0]) {
            let _ = writeln!(wrong, "waypoint times {times:?}");
        }
        for (time, waypoint) in times.iter().zip(&self.waypoints) {
            let away = distance(&motion.at(*time).position, waypoint);
            if away > self.blend + 1e-7 {
                let _ = writeln!(wrong, "{away} rad from a waypoint at {time} s");
            }
        }
    }

    fn differences(&self, motion: &Motion, wrong: &mut String) -> [f64; 4] {
        let dynamics = Dynamics::with_payload(&self.model, self.config.gravity, &self.config.payload);
        let breakaway = self.breakaway();
        // The samples include the standstill before and after the motion.
        let count = (motion.duration() / H).ceil() as i64 + 4;
        // In a long motion, only some time intervals are sampled, to save computing time.
        let stride = if count > 400_000 { count / 4_000 } else { 0 };
        let mut used = [0.0f64; 4];
        let mut k = -4;
        while k < count {
            if stride > 0 && k % stride == 100 {
                k += stride - 100;
            }
            let p: [JointVec; 4] = std::array::from_fn(|i| motion.at((k + i as i64) as f64 * H).position);
            let v = differences(&p[1], &p[2], H);
            let a: JointVec = std::array::from_fn(|j| (p[2][j] - 2.0 * p[1][j] + p[0][j]) / (H * H));
            let jerk: JointVec =
                std::array::from_fn(|j| (p[3][j] - 3.0 * p[2][j] + 3.0 * p[1][j] - p[0][j]) / (H * H * H));
            let time = (k + 1) as f64 * H;
            let torque = self.with_torque.then(|| self.torque_at(&dynamics, motion, time));
            let usable = torque.map(|_| self.usable(&dynamics, &p[1], &breakaway));
            for j in 0..JOINTS {
                let (low, high) = self.limits.position[j];
                let mut take = |which: usize, name: &str, value: f64, limit: f64, noise: f64| {
                    let share = (value.abs() - noise) / limit;
                    used[which] = used[which].max(share);
                    if (share.is_nan() || share > 1.0 + ROUNDING) && wrong.len() < 2000 {
                        let _ =
                            writeln!(wrong, "joint {}: {name} {value} over {limit} at {time:.4} s", j + 1);
                    }
                };
                take(0, "velocity", v[j], self.limits.velocity[j], 1e-11);
                take(1, "acceleration", a[j], self.limits.acceleration[j], 1e-8);
                // The tolerance covers the rounding of positions and times.
                let rounding = 4e-15 + 4.0 * f64::EPSILON * time * v[j].abs();
                take(2, "jerk", jerk[j], self.limits.jerk[j], rounding / (H * H * H));
                if let (Some(torque), Some(usable)) = (torque, usable) {
                    // The tolerance covers the rounding errors of the positions. The differences divide these errors
                    // by the square of the time between samples.
                    take(3, "torque", torque[j], usable[j], 1e-4);
                }
                if !(low - 1e-9..=high + 1e-9).contains(&p[1][j]) && wrong.len() < 2000 {
                    let _ = writeln!(wrong, "joint {}: position {} at {time} s", j + 1, p[1][j]);
                }
            }
            k += 1;
        }
        used
    }

    /// Returns the largest friction of each joint at low speed. The speed range ends slightly above the speed at
    /// which the smoothed sign function of the friction reaches ±1.
    fn breakaway(&self) -> JointVec {
        std::array::from_fn(|j| {
            let fastest = self.config.friction_sign_width + self.config.joints[j].velocity_max / 128.0;
            let friction = |i: i32| self.friction_at(j, 0.05 * f64::from(i) * fastest).abs();
            (-20..=20).map(friction).fold(0.0, f64::max)
        })
    }

    /// Returns the torque that a motion is allowed to use: the limit minus the margin, but at least the holding
    /// torque plus a small part of the remaining torque.
    fn usable(&self, dynamics: &Dynamics, q: &JointVec, breakaway: &JointVec) -> JointVec {
        let hold = dynamics.inverse(q, &[0.0; JOINTS], &[0.0; JOINTS]);
        std::array::from_fn(|j| {
            let (limit, stands) = (self.limits.torque[j], hold[j].abs() + breakaway[j]);
            let moves = (0.25 * (limit - stands)).max(0.02 * limit);
            ((1.0 - self.limits.margin[j]) * limit).max(stands + moves).min(limit)
        })
    }

    fn friction_at(&self, j: usize, v: f64) -> f64 {
        match &self.friction {
            None => 0.0,
            Some(Friction::Polynomial(c)) => {
                friction::polynomial(&c[j], v, self.temperature, self.config.friction_sign_width)
            }
            Some(Friction::Table(t)) => friction::table(&t[j], v, self.temperature).unwrap_or(f64::NAN),
        }
    }

    /// Returns the torque at `time`. The torque is computed from differences over a very short time, in which
    /// acceleration and friction hardly change.
    fn torque_at(&self, dynamics: &Dynamics, motion: &Motion, time: f64) -> JointVec {
        const H: f64 = 1e-5;
        let [a, b, c] = [time - H, time, time + H].map(|t| motion.at(t).position);
        let velocity = std::array::from_fn(|j| (c[j] - a[j]) / (2.0 * H));
        let acceleration = std::array::from_fn(|j| (c[j] - 2.0 * b[j] + a[j]) / (H * H));
        self.torque(dynamics, &b, &velocity, &acceleration)
    }

    /// Checks that every point is on a leg or in a corner. In a corner, the point must be within the blend and inside
    /// the bounding box of the legs at this corner.
    fn on_the_legs(&self, motion: &Motion, wrong: &mut String) {
        let count = (motion.duration() / 2e-3).ceil().min(50_000.0) as usize;
        for i in 0..=count {
            let time = motion.duration() * i as f64 / count as f64;
            let q = motion.at(time).position;
            let leg =
                motion.waypoint_times().partition_point(|t| *t <= time).clamp(1, self.waypoints.len() - 1)
                    - 1;
            let legs = leg.saturating_sub(1)..=(leg + 1).min(self.waypoints.len() - 2);
            let on_leg = legs.clone().any(|l| self.distance_to_leg(l, &q) < 1e-7);
            let in_corner = legs.clone().skip(1).any(|l| self.is_in_corner(l, &q)) || self.is_in_row(leg, &q);
            if !on_leg && !in_corner && wrong.len() < 2000 {
                let away = legs.map(|l| self.distance_to_leg(l, &q)).fold(f64::INFINITY, f64::min);
                let _ = writeln!(wrong, "off the legs by {away} rad at {time:.4} s, not within a blend");
            }
        }
    }

    fn distance_to_leg(&self, leg: usize, q: &JointVec) -> f64 {
        let (a, b) = (&self.waypoints[leg], &self.waypoints[leg + 1]);
        let way: JointVec = std::array::from_fn(|j| b[j] - a[j]);
        let square: f64 = way.iter().map(|w| w * w).sum();
        let along: f64 = (0..JOINTS).map(|j| way[j] * (q[j] - a[j])).sum();
        let u = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
        distance(q, &std::array::from_fn(|j| a[j] + u * way[j]))
    }

    /// Returns `true` if the point is within the blend of one of several close waypoints around a leg. The point must also be in the
    /// bounding box of these waypoints.
    fn is_in_row(&self, leg: usize, q: &JointVec) -> bool {
        [leg, leg + 1].into_iter().any(|at| {
            let row = &self.waypoints[row(&self.waypoints, at, self.blend)];
            let inside = (0..JOINTS).all(|j| {
                let low = row.iter().map(|w| w[j]).fold(f64::INFINITY, f64::min);
                let high = row.iter().map(|w| w[j]).fold(f64::NEG_INFINITY, f64::max);
                (low - 1e-9..=high + 1e-9).contains(&q[j])
            });
            row.len() > 3 && inside && row.iter().any(|w| distance(q, w) <= self.blend + 1e-9)
        })
    }

    fn is_in_corner(&self, corner: usize, q: &JointVec) -> bool {
        let [a, b, c] = [corner - 1, corner, corner + 1].map(|i| &self.waypoints[i]);
        let inside = (0..JOINTS).all(|j| {
            let low = a[j].min(b[j]).min(c[j]);
            let high = a[j].max(b[j]).max(c[j]);
            (low - 1e-9..=high + 1e-9).contains(&q[j])
        });
        inside && distance(q, b) <= self.blend + 1e-9
    }
}

/// Returns the range of consecutive waypoints that are closer to each other than the blend. The planner is allowed to
/// omit some of these waypoints.
fn row(waypoints: &[JointVec], at: usize, blend: f64) -> std::ops::RangeInclusive<usize> {
    let dense = |i: usize| distance(&waypoints[i], &waypoints[i + 1]) <= blend;
    let (mut from, mut to) = (at, at);
    while from > 0 && dense(from - 1) {
        from -= 1;
    }
    while to + 1 < waypoints.len() && dense(to) {
        to += 1;
    }
    from.saturating_sub(1)..=(to + 1).min(waypoints.len() - 1)
}

/// Returns a random walk inside the position limits. Some waypoints are repeated, continue in a straight line, or
/// return to an earlier position.
fn waypoints(rng: &mut fastrand::Rng, count: usize, limits: &Limits) -> Vec<JointVec> {
    let size = *rng.choice(&[0.002, 0.05, 0.3, 1.0]).unwrap_or(&0.3);
    let inside = |q: JointVec| -> JointVec {
        std::array::from_fn(|j| q[j].clamp(limits.position[j].0 * 0.8, limits.position[j].1 * 0.8))
    };
    let mut all = vec![inside(std::array::from_fn(|_| between(rng, -1.5, 1.5)))];
    while all.len() < count {
        let last = all[all.len() - 1];
        let next = match (rng.u8(0..20), all.len()) {
            (0, _) => last,
            (1, 2..) => all[all.len() - 2],
            (2, 2..) => {
                let before = all[all.len() - 2];
                inside(std::array::from_fn(|j| last[j] + 0.7 * (last[j] - before[j])))
            }
            (3, _) => {
                let mut q = last;
                q[rng.usize(0..JOINTS)] += between(rng, -size, size);
                inside(q)
            }
            _ => inside(std::array::from_fn(|j| last[j] + between(rng, -size, size))),
        };
        all.push(next);
    }
    all
}

fn differences(a: &JointVec, b: &JointVec, h: f64) -> JointVec {
    std::array::from_fn(|j| (b[j] - a[j]) / h)
}

fn distance(a: &JointVec, b: &JointVec) -> f64 {
    (0..JOINTS).map(|j| (a[j] - b[j]).abs()).fold(0.0, f64::max)
}
