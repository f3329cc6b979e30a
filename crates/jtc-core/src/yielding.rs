//! A joint that yields to a push (J-68), or lowers a load that its torque limit does not hold (J-70).
//!
//! The position controller answers a push with the whole torque limit within a few milliradians: the joint clamps whatever it met, and
//! the limit is all it has. A joint that yields has a weak spring instead, whose other end is dragged along, and a damper. So it follows
//! a hand with a share of its torque limit, and stops a shove with all of it. The model and the load that the integral had found go on
//! carrying the arm meanwhile.
//!
//! A joint that lowers a load has no spring: the damper alone lets the load sink slowly, at any torque within the limit. What the damper
//! needs for that becomes part of the load, so a load that the limit does hold comes to rest.
use crate::limits::{JointConfig, within};
use crate::pid::PidTorque;
use crate::remembered::remembered;
use crate::{DT, JOINTS};

/// Longest stretch of the spring, rad.
const STRETCH: f64 = 0.02;
/// Highest rate at which a damper reduces a speed, 1/s. Measured speeds are about 8 ms old, because the drives average them: a damper above
/// 200 1/s would drive a joint to and fro, and joints that move each other lower that bound.
pub(crate) const DAMPING_RATE: f64 = 100.0;
/// Distance from a position limit, rad, from which on a spring pushes the joint back into its range.
const SOFT_END: f64 = 0.1;
/// Speed below which a joint that yields is calm, rad/s.
const CALM: f64 = 0.05;
/// Speed below which a load that is lowered is at rest, rad/s.
const AT_REST: f64 = 0.02;
/// How long a joint has to be calm until it is held again, ms.
const CALM_MS: u16 = 200;
/// Share of the torque limit by which gravity must load a joint before its motion counts as sinking.
const LOADED: f64 = 0.05;
/// Way (rad) and time (ms) of sinking after which the joint is taken for overloaded.
const SINKS: (f64, u16) = (0.5, 3_000);
/// Time constant with which the load takes over the torque of the damper, s.
const LEARNS_S: f64 = 0.5;
/// Share of the torque limit up to which a lowered load is held by the position controller again: its encoder noise needs the rest.
const HOLDABLE: f64 = 0.95;
/// Missing answers after which the spring does not act.
const MISSING: u8 = 2;
/// Yields in a row, each within [`AGAIN_MS`] of the last one, of which the last one goes on until the host clears it.
const TIMES: u8 = 3;
/// See [`TIMES`].
const AGAIN_MS: u16 = 10_000;

/// A joint that yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Yield {
    /// It lowers a load: there is no spring (J-70).
    lowers: bool,
    /// It goes on until the host clears it.
    stays: bool,
    /// Position that the spring pulls to, rad.
    set: f64,
    /// Inertia that the joint moves, kg·m²: a lower bound.
    inertia: f64,
    /// Torque of the load that the model lacks, N·m.
    load: f64,
    calm_ms: u16,
    /// Answers of the joint that are missing now.
    missing: u8,
    /// Way (rad) and time (ms) in the direction in which gravity pulls.
    sunk: f64,
    sinks_ms: u16,
}

remembered!(Yield { lowers, stays, set, inertia, load, calm_ms, missing, sunk, sinks_ms });

/// What a yielding joint is given in a tick.
pub(crate) struct Joint<'a> {
    /// Measured position, rad.
    pub position: f64,
    /// Measured velocity, rad/s.
    pub velocity: f64,
    /// Both were measured for this tick.
    pub fresh: bool,
    /// Torque of the model, N·m.
    pub model: f64,
    pub limits: &'a JointConfig,
    /// Lowest and highest position, rad.
    pub range: (f64, f64),
    /// Most that spring and damper add for a slow push, as a share of the torque limit.
    pub share: f64,
}

impl Yield {
    /// The joint yields from now on; `set`: the position that it was commanded to, rad; `load`: torque that the model lacks, N·m.
    pub fn begin(lowers: bool, stays: bool, set: f64, inertia: f64, load: f64) -> Self {
        Self { lowers, stays, set, inertia, load, calm_ms: 0, missing: 0, sunk: 0.0, sinks_ms: 0 }
    }

    /// Drags the end of the spring along with a joint at `position` (rad). Returns where it is then.
    pub fn drag(&mut self, position: f64) -> f64 {
        self.set = self.set.max(position - STRETCH).min(position + STRETCH);
        self.set
    }

    /// The joint has been calm for long enough, but the host has to end this.
    pub fn is_calm(&self) -> bool {
        self.calm_ms >= CALM_MS
    }

    /// The position controller holds the joint again.
    pub fn is_over(&self) -> bool {
        self.is_calm() && !self.stays
    }

    /// The host ends it; it goes on until the joint is calm.
    pub fn clear(&mut self) {
        self.stays = false;
    }

    /// The joint lowers a load.
    pub fn lowers(&self) -> bool {
        self.lowers
    }

    /// From now on the joint lowers its load.
    pub fn lower(&mut self) {
        (self.lowers, self.calm_ms) = (true, 0);
    }

    /// Torque of the load that the model lacks, N·m.
    pub fn load(&self) -> f64 {
        self.load
    }

    /// A tick: spring, load and damper as the parts of a PID controller, N·m.
    pub fn step(&mut self, joint: &Joint<'_>) -> PidTorque {
        let limit = joint.limits.torque_max;
        let most = joint.share * limit;
        let velocity = joint.velocity;
        self.missing = if joint.fresh { 0 } else { self.missing.saturating_add(1) };

        let highest = DAMPING_RATE * self.inertia;
        // With this one a joint at half of its velocity limit is braked with all of its torque limit.
        let wanted = 2.0 * (limit - most) / joint.limits.velocity_max;
        let damping = if self.lowers { highest } else { wanted.min(highest) };
        let d = (-damping * velocity).max(-limit).min(limit);
        let pull = if self.lowers || self.missing > MISSING {
            0.0
        } else {
            most / STRETCH * (self.set - joint.position) + soft_end(joint, most)
        };
        // Only for a shove spring and damper together use more than the share.
        let p = within(pull, d, most);

        let carried = joint.model + self.load;
        let loaded = carried.abs() > LOADED * limit;
        if loaded && velocity * carried < 0.0 && velocity.abs() > AT_REST {
            self.sunk += velocity.abs() * DT;
            self.sinks_ms = self.sinks_ms.saturating_add(1);
        }
        if !self.lowers && (self.sunk > SINKS.0 || self.sinks_ms > SINKS.1) {
            self.lower();
        }
        if self.lowers && loaded {
            // Never beyond the limit, and never a torque that lifts the load: one that lifts it is taken back.
            let learned = self.load + d * DT / LEARNS_S;
            self.load = learned.max(-limit - joint.model).min(limit - joint.model);
        }
        let calm = if self.lowers {
            velocity.abs() < AT_REST && (joint.model + self.load).abs() <= HOLDABLE * limit
        } else {
            velocity.abs() < CALM && d.abs() <= most
        };
        self.calm_ms = if calm { self.calm_ms.saturating_add(1) } else { 0 };
        PidTorque { p, i: self.load, d }
    }
}

/// Torque of a spring that acts from [`SOFT_END`] before a position limit on, N·m: `most` at the limit.
fn soft_end(joint: &Joint<'_>, most: f64) -> f64 {
    let (low, high) = joint.range;
    let above = (joint.position - (high - SOFT_END)).max(0.0);
    let below = ((low + SOFT_END) - joint.position).max(0.0);
    most * (below - above) / SOFT_END
}

/// How often each joint has yielded of late.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Yielded {
    times: [u8; JOINTS],
    since_ms: [u16; JOINTS],
}

remembered!(Yielded { times, since_ms });

impl Yielded {
    /// A tick.
    pub fn step(&mut self) {
        for (times, since_ms) in self.times.iter_mut().zip(&mut self.since_ms) {
            *since_ms = since_ms.saturating_add(1);
            if *since_ms >= AGAIN_MS {
                *times = 0;
            }
        }
    }

    /// The joint yields. Returns whether it does so too often: it is to go on until the host clears it.
    pub fn count(&mut self, joint: usize) -> bool {
        let (Some(times), Some(since_ms)) = (self.times.get_mut(joint), self.since_ms.get_mut(joint)) else {
            return false;
        };
        (*times, *since_ms) = (times.saturating_add(1), 0);
        *times >= TIMES
    }
}
