//! Computation of the torque that remains for a motion from the held position. The remaining torque determines how soon the arm can reach
//! the first point of a path (J-34), and the acceleration and speed of a jog (J-58). The computation includes gravity and the learned load
//! at both ends of the motion. The computation also includes friction at the top speed of the motion.
use jtc_dynamics::sqrt;

use super::Motion;
use super::law::{LawInputs, compensation};
use crate::JOINTS;
use crate::motion::jog;

/// Highest share of a torque limit that an approach uses. The remaining share is for the feedback torque, which needs
/// up to a fifth of the limit in a fast approach.
const APPROACH_TORQUE: f64 = 0.8;
/// Highest share of a torque limit that a jog uses. The rest is a reserve for the feedback torque, and for the return
/// from a position with a higher holding torque.
const JOG_TORQUE: f64 = 0.92;
/// Share of the remaining torque that a jog may use. An approach also uses this share if it results in more torque
/// than [`APPROACH_TORQUE`], which happens at high holding torques.
const SHARE_OF_REST: f64 = 0.5;
/// Longest time that torque limits may add to an approach, ms.
const LONGER_MS: f64 = 2_000.0;
/// Top speed of a minimum-jerk polynomial, as a multiple of distance/duration. `TOP_ACCELERATION` is its highest
/// acceleration, as a multiple of distance/duration².
const TOP_SPEED: f64 = 1.875;
const TOP_ACCELERATION: f64 = 5.774;

/// Time within which a jogged joint can come to rest with its share of the remaining torque, s.
const REST_S: f64 = 0.3;
/// Speed of a slow jog, rad/s. If friction leaves no torque for the requested speed, the controller tries this speed.
const CREEP: f64 = 0.02;
/// Speed from which the full friction of the model acts, rad/s. The friction of a slower jogged joint is computed at
/// this speed.
const SLIDES: f64 = 0.1;
/// Highest speed that counts as zero, rad/s.
const NO_SPEED: f64 = 1e-3;
/// Least share of the torque limit that a joint may use for a motion to a position with a lower holding torque.
const UNLOADING: f64 = 0.01;
/// Least share of the tool speed limit that the accelerating joints get together. A jog can therefore always
/// continue.
const LEAST_ROOM: f64 = 0.005;
/// Lower bound for the acceleration of a jog, as a share of its highest acceleration.
const LEAST_ACCELERATION: f64 = 0.02;

/// Limits of a jog that follow from the remaining torque.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JogRoom {
    /// Velocities of the jog, rad/s: the requested velocities, or a share of these velocities.
    pub velocity: [f64; JOINTS],
    /// Highest accelerations of the jog, rad/s².
    pub acceleration: [f64; JOINTS],
}

impl Motion {
    /// Returns the time for the approach from the held position to `to` (rad), ms. The approach takes the time of a ramp. The approach
    /// takes longer if the velocity, acceleration or torque limits require more time. Returns `None` if the torque limits require over 2 s
    /// more than the other limits. The function uses the inertia of a ramp that begins at the held position.
    pub(crate) fn approach_ms(&self, to: &[f64; JOINTS], inputs: &LawInputs<'_>) -> Option<f64> {
        let config = inputs.config;
        let from = &self.set.point.position;
        let way: [f64; JOINTS] = core::array::from_fn(|j| to[j] - from[j]);
        let mut shortest = f64::from(config.ramp_ms.max(1));
        for (way, limits) in way.iter().zip(&config.joints) {
            shortest = shortest.max(1_000.0 * TOP_SPEED * way.abs() / limits.velocity_max);
            shortest = shortest.max(1_000.0 * sqrt(TOP_ACCELERATION * way.abs() / limits.acceleration_max));
        }
        let standing = [from, to].map(|q| self.standing(q, inputs));
        // Returns the time that an approach needs. The friction is that of an approach of `ms` milliseconds.
        let enough = |ms: f64| {
            let friction = compensation(inputs, &way.map(|way| 1_000.0 * TOP_SPEED * way / ms)).0;
            let times = (0..JOINTS).map(|j| {
                let limit = config.joints[j].torque_max;
                let held = highest(&standing, j);
                let most = (APPROACH_TORQUE * limit).max(held + SHARE_OF_REST * (limit - held));
                let slides = if way[j] == 0.0 { 0.0 } else { friction[j] };
                let demand = standing.iter().fold(held, |most, torque| most.max((torque[j] + slides).abs()));
                let left = most - demand;
                let push: f64 = (0..JOINTS).map(|k| self.ramp.coupling(j, k) * way[k]).sum();
                if push == 0.0 {
                    0.0
                } else if left > 0.0 {
                    1_000.0 * sqrt(TOP_ACCELERATION * push.abs() / left)
                } else {
                    f64::INFINITY
                }
            });
            times.fold(shortest, f64::max)
        };
        let longest = shortest + LONGER_MS;
        // The friction is computed at the top speed of the fastest approach. If this friction leaves too little
        // torque, the computation is repeated with the slowest permitted approach.
        let time = enough(shortest);
        if time <= longest { Some(time) } else { (enough(longest) <= longest).then_some(longest) }
    }

    /// Returns the velocities and accelerations that the limits of torque and tool speed allow for a jog at the `wanted` velocities
    /// (rad/s). Returns `None` if a torque limit allows no motion. The function uses the inertia of a ramp that begins at the held
    /// position.
    pub(crate) fn jog_room(&self, wanted: &[f64; JOINTS], inputs: &LawInputs<'_>) -> Option<JogRoom> {
        let config = inputs.config;
        let wanted = &if config.tool_speed_max > 0.0 { self.slowed(wanted, inputs) } else { *wanted };
        let fastest = wanted.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let share = self.jog_speed(wanted, inputs);
        let creeping = if share * fastest < CREEP && fastest > CREEP {
            let slow = CREEP / fastest;
            slow * self.jog_speed(&wanted.map(|v| slow * v), inputs)
        } else {
            0.0
        };
        let share = share.max(creeping);
        if share < 1.0 && share * fastest <= NO_SPEED {
            return None;
        }
        let velocity = wanted.map(|v| share * v);
        let hardest = |j: usize| jog::hardest(&config.joints[j]);
        // A joint that already moves may need torque to slow down, even if its requested velocity is zero.
        let moves = |j: usize| wanted[j] != 0.0 || self.set.point.velocity[j] != 0.0;
        let needed = |j: usize| {
            (0..JOINTS).filter(|&k| moves(k)).map(|k| self.ramp.coupling(j, k).abs() * hardest(k)).sum()
        };
        let share = self.least_share(&velocity, needed, inputs).max(LEAST_ACCELERATION);
        Some(JogRoom { velocity, acceleration: core::array::from_fn(|j| share * hardest(j)) })
    }

    /// Returns the `wanted` velocities (rad/s), reduced to the tool speed limit. The speed of the flange is at most
    /// the sum of the contributions of all joints. Each contribution counts with its magnitude, because the joints
    /// can accelerate differently.
    ///
    /// A joint that must not become faster slows down or keeps its speed. The other joints share the flange speed
    /// that remains.
    fn slowed(&self, wanted: &[f64; JOINTS], inputs: &LawInputs<'_>) -> [f64; JOINTS] {
        let (most, set) = (inputs.config.tool_speed_max, &self.set.point);
        // Distance of the flange from the axis of each joint, m.
        let mut reach = [0.0; JOINTS];
        for j in 0..JOINTS {
            let mut turned = [0.0; JOINTS];
            turned[j] = 1.0;
            reach[j] = inputs.parameters.dynamics.flange_speed(&set.position, &turned);
        }
        let speed: f64 = (0..JOINTS).map(|j| reach[j] * wanted[j].abs()).sum();
        let share = if speed > most { most / speed } else { 1.0 };
        // An accelerating joint still changes its speed until its acceleration is zero, and it can reverse meanwhile.
        // `peak` is its highest speed in this time.
        let peak: [f64; JOINTS] = core::array::from_fn(|j| {
            let (v, a) = (set.velocity[j], set.acceleration[j]);
            let after = v + 0.5 * a * a.abs() / jog::jerk(&inputs.config.joints[j]);
            v.abs().max(after.abs())
        });
        // Some joints must not become faster. Their speed is subtracted from the limit first, which reduces the share
        // of the other joints. With this lower share, further joints can already be too fast, so the computation is
        // repeated.
        let mut rising = share;
        for _ in 0..JOINTS {
            let (mut slower, mut faster) = (0.0, 0.0);
            for j in 0..JOINTS {
                if peak[j] > rising * wanted[j].abs() {
                    slower += reach[j] * peak[j];
                } else {
                    faster += reach[j] * wanted[j].abs();
                }
            }
            let room = (most - slower).max(LEAST_ROOM * most);
            rising = if rising * faster > room { room / faster } else { rising };
        }
        core::array::from_fn(|j| {
            let most = if peak[j] > rising * wanted[j].abs() { peak[j] } else { rising * wanted[j].abs() };
            (share * wanted[j]).max(-most).min(most)
        })
    }

    /// Returns the highest share of the `wanted` velocities (rad/s) at which the joints can still be stopped with the
    /// torque that is available to a jog.
    fn jog_speed(&self, wanted: &[f64; JOINTS], inputs: &LawInputs<'_>) -> f64 {
        let needed = |j: usize| {
            (0..JOINTS).map(|k| self.ramp.coupling(j, k).abs() * wanted[k].abs()).sum::<f64>() / REST_S
        };
        self.least_share(wanted, needed, inputs)
    }

    /// Returns the share (0..1) of the `needed` torques (N·m) that every joint can supply. For a jog at `velocity`
    /// (rad/s), each joint can supply the share [`SHARE_OF_REST`] of its remaining torque.
    fn least_share(
        &self,
        velocity: &[f64; JOINTS],
        needed: impl Fn(usize) -> f64,
        inputs: &LawInputs<'_>,
    ) -> f64 {
        let left = self.jog_leaves(velocity, inputs);
        (0..JOINTS).fold(1.0, |share: f64, j| {
            let needed = if inputs.config.absent[j] { 0.0 } else { needed(j) };
            if needed > 0.0 { share.min((SHARE_OF_REST * left[j] / needed).max(0.0)) } else { share }
        })
    }

    /// Returns the torque of each joint that remains within its limit during a jog at `velocity` (rad/s), N·m. The function considers the
    /// present position and the position at the end of the jog. The function subtracts friction for both directions, because a joint that
    /// was lowered must be raised again.
    fn jog_leaves(&self, velocity: &[f64; JOINTS], inputs: &LawInputs<'_>) -> [f64; JOINTS] {
        let config = inputs.config;
        let here = &self.set.point.position;
        // The joints still move until the last Jog expires, and then while they come to rest.
        let ahead_s = f64::from(jog::LASTS_MS) / 1_000.0 + 0.5 * REST_S;
        let rest = core::array::from_fn(|j| {
            let (low, high) = config.position_range(j);
            (here[j] + velocity[j] * ahead_s).max(low.min(here[j])).min(high.max(here[j]))
        });
        let standing = [here, &rest].map(|q| self.standing(q, inputs));
        let faster = velocity.map(|v| if v == 0.0 { 0.0 } else { v.abs().max(SLIDES).copysign(v) });
        let friction = compensation(inputs, &faster).0;
        core::array::from_fn(|j| {
            let limit = config.joints[j].torque_max;
            let [held, held_there] = standing.map(|torque| torque[j]);
            let (held, held_there) = (held.abs(), held_there.abs());
            let left = JOG_TORQUE * limit - held.max(held_there) - friction[j].abs();
            // A joint may always use a small torque to move to a position with a lower holding torque. This does not
            // apply if the joint needs more than the torque limit to lift its load.
            let push: f64 = (0..JOINTS).map(|k| self.ramp.coupling(j, k) * velocity[k]).sum();
            let lifts = standing[0][j] * push > 0.0;
            let possible = !lifts || held + friction[j].abs() <= limit;
            if held_there < held && possible { left.max(UNLOADING * limit) } else { left }
        })
    }

    /// Returns the torques that hold the arm at `q` (rad): gravity plus the learned load, or gravity plus the
    /// integral if this sum is larger. While the integrals release torque that the model now contains, returns
    /// gravity alone.
    fn standing(&self, q: &[f64; JOINTS], inputs: &LawInputs<'_>) -> [f64; JOINTS] {
        let gravity = inputs.parameters.dynamics.gravity_torque(q);
        if self.law.unwinds_ms > 0 {
            return gravity;
        }
        core::array::from_fn(|j| {
            let found = gravity[j] + self.law.load(j);
            let now = gravity[j] + self.law.torque[j].pid.i;
            if now.abs() > found.abs() { now } else { found }
        })
    }
}

/// Returns the highest of the torques at the two ends of a motion for a joint, N·m.
fn highest(torques: &[[f64; JOINTS]; 2], j: usize) -> f64 {
    torques.iter().fold(0.0, |most: f64, torque| most.max(torque[j].abs()))
}

#[cfg(test)]
mod tests;
