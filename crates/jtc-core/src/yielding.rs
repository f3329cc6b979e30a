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
use crate::soft_end;
use crate::{DT, JOINTS};

mod swing;

use swing::Swing;

/// Longest stretch of the spring, rad.
const STRETCH: f64 = 0.02;
/// Natural frequency that the spring has with the inertia of the joint at most, 1/s.
pub(crate) const SPRING_RATE: f64 = 30.0;
/// Rate at which the damper of a load that is lowered reduces a speed, 1/s; of several, shared among them. Joints that are held move each
/// other at the frequencies that a late speed leaves unstable, so the inertia that a joint feels is a third of that with the others fixed.
const LOWERING_RATE: f64 = 40.0;
/// Part of the way to its value that the damper and the spring go in a tick.
const SETTLES: f64 = 0.2;
/// The same of the brake.
const BRAKE_SETTLES: f64 = 0.5;
/// Highest rate at which a damper reduces a speed, 1/s. Measured speeds are about 8 ms old, because the drives average them: a damper above
/// 200 1/s would drive a joint to and fro, and joints that move each other lower that bound.
const DAMPING_RATE: f64 = 100.0;
/// Speeds, in velocity limits, from which on a joint is braked where its damper does less, and at which that takes the whole torque limit; the
/// same where it lowers a load. The rate at which the brake reduces a speed is bounded, too, 1/s: positions are about 4 ms old.
const BRAKES: (f64, f64) = (0.2, 0.8);
const BRAKES_LOWERED: (f64, f64) = (0.4, 1.0);
const BRAKE_RATE: f64 = 250.0;
/// Speed below which a joint that yields is calm, rad/s.
const CALM: f64 = 0.05;
/// Speed below which a load that is lowered is at rest, rad/s.
const AT_REST: f64 = 0.02;
/// How long a joint has to be calm until it is held again, and for how long its load may seem to drive it meanwhile, ms.
const CALM_MS: u16 = 200;
const DRIVEN_CALM_MS: u16 = 50;
/// Share of the torque limit by which gravity must load a joint before its motion counts as sinking.
const LOADED: f64 = 0.05;
/// Way (rad) and time (ms) of sinking after which the joint is taken for overloaded.
const SINKS: (f64, u16) = (0.5, 3_000);
/// Time constant with which the load takes over the torque of the damper, s.
const LEARNS_S: f64 = 0.5;
/// What spring and damper have against a joint that its own load drives, as a share of that load; the rest is friction. A load that has driven
/// the joint for so long (ms) is not there: somebody had leaned on the arm. It goes with the first time constant (s), and comes back with the
/// second where the joint sinks without it.
const DRIVEN: (f64, f64) = (0.5, 1.2);
/// The same from this speed on, rad/s.
const CREEPS: f64 = 0.002;
const DRIVEN_MS: u16 = 300;
const GOES_S: f64 = 1.0;
const COMES_BACK_S: f64 = 0.3;
/// Share of the torque limit up to which a lowered load is held by the position controller again: its encoder noise needs the rest.
const HOLDABLE: f64 = 0.95;
/// Missing answers after which the spring does not act.
const MISSING: u8 = 2;
/// Yields of a joint, while one of the arm comes within [`AGAIN_MS`] of the one before, of which the last one goes on until the host clears it.
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
    /// Torque of the load that the model lacks, N·m, and what it was at the begin, or at that of lowering: it is never taken back beyond that.
    load: f64,
    least: f64,
    /// How long the load has driven the joint, ms.
    driven_ms: u16,
    /// N·m·s/rad.
    damping: f64,
    /// Share of the brake that acts, and of the spring.
    braking: f64,
    grip: f64,
    swing: Swing,
    /// The position controller can hold what the joint carries; or the host has decided that it is to.
    holdable: bool,
    cleared: bool,
    calm_ms: u16,
    /// Answers of the joint that are missing now.
    missing: u8,
    /// Way (rad) and time (ms) in the direction in which gravity pulls.
    sunk: f64,
    sinks_ms: u16,
}

remembered!(Yield {
    lowers,
    stays,
    set,
    inertia,
    load,
    least,
    driven_ms,
    damping,
    braking,
    grip,
    swing,
    holdable,
    cleared,
    calm_ms,
    missing,
    sunk,
    sinks_ms,
});

/// What a yielding joint is given in a tick.
pub(crate) struct Joint<'a> {
    /// Measured position, rad.
    pub position: f64,
    /// Measured velocity, rad/s.
    pub velocity: f64,
    /// Velocity of the last 5 ms, rad/s.
    pub young_velocity: f64,
    /// All were measured for this tick.
    pub fresh: bool,
    /// Torque of the model, N·m.
    pub model: f64,
    pub limits: &'a JointConfig,
    /// Lowest and highest position, rad.
    pub range: (f64, f64),
    /// Most that spring and damper add for a slow push, as a share of the torque limit.
    pub share: f64,
    /// Joints that lower their loads, this one among them.
    pub lowering: u8,
}

impl Yield {
    /// The joint yields from now on; `set`: the position that it was commanded to, rad; `load`: torque that the model lacks, N·m.
    pub fn begin(lowers: bool, stays: bool, set: f64, inertia: f64, load: f64) -> Self {
        Self {
            lowers,
            stays,
            set,
            inertia,
            load,
            least: load,
            driven_ms: 0,
            damping: 0.0,
            braking: 0.0,
            grip: 1.0,
            swing: Swing::NONE,
            holdable: true,
            cleared: false,
            calm_ms: 0,
            missing: 0,
            sunk: 0.0,
            sinks_ms: 0,
        }
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
        self.is_calm() && (self.holdable || self.cleared) && !self.stays
    }

    /// The host ends it; it goes on until the joint is calm.
    pub fn clear(&mut self) {
        (self.stays, self.cleared) = (false, true);
    }

    /// The joint lowers a load.
    pub fn lowers(&self) -> bool {
        self.lowers
    }

    /// From now on the joint lowers its load. What the spring had of it, N·m, is part of that.
    pub fn lower(&mut self, spring: f64) {
        (self.lowers, self.calm_ms) = (true, 0);
        self.load += spring;
        self.least = self.load;
    }

    /// The load has turned out to be another one than was found.
    pub fn has_learned(&self) -> bool {
        self.lowers || self.load != self.least
    }

    /// What the position controller has to carry when it takes over, N·m: what the `spring` (N·m) has against the load acts no more,
    /// and what it has of a load that was doubted goes on.
    pub fn left(&self, spring: f64) -> f64 {
        if self.lowers {
            self.load
        } else {
            (self.load + spring).max(self.least.min(0.0)).min(self.least.max(0.0))
        }
    }

    /// What Teaching carries, N·m: of a load that is doubted what the `spring` (N·m) leaves, because the rest may not be there.
    pub fn taught_load(&self, spring: f64) -> f64 {
        if self.load.abs() < 0.5 * self.least.abs() { self.left(spring) } else { self.load }
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

        let soft = self.swing.step(velocity);
        // With the first of them a joint at half of its velocity limit is braked with all of its torque limit.
        let wanted = 2.0 * (limit - most) / joint.limits.velocity_max;
        let damping = if self.lowers {
            LOWERING_RATE / f64::from(joint.lowering.max(1)) * self.inertia
        } else {
            wanted.min(soft * DAMPING_RATE * self.inertia)
        };
        self.damping += SETTLES * (damping - self.damping);
        // From nothing in the first tick: what it begins with would be blended in.
        let brakes = if self.lowers { BRAKES_LOWERED } else { BRAKES };
        let brake = soft * self.braking * self.grip * brake(joint, self.inertia, brakes);
        self.braking += BRAKE_SETTLES * (1.0 - self.braking);
        let damper = (-self.damping * velocity).max(-limit).min(limit);
        let d = if brake.abs() > damper.abs() { brake } else { damper };
        self.grip += SETTLES * (if self.missing > MISSING { 0.0 } else { 1.0 } - self.grip);
        let stiffness = (most / STRETCH).min(soft * SPRING_RATE * SPRING_RATE * self.inertia);
        let end = soft_end::spring(soft_end::depth(joint.position, joint.range), most);
        let pull = stiffness * (self.set - joint.position) + end;
        let spring = self.grip * pull.max(-most).min(most);
        // Only for a shove spring and damper together use more than the share.
        let p = if self.lowers { 0.0 } else { within(spring, d, most) };

        let carried = joint.model + if self.lowers { self.least } else { self.load };
        let loaded = carried.abs() > LOADED * limit;
        let sinks = loaded && velocity * carried < 0.0 && velocity.abs() > AT_REST;
        self.sinks_ms = if sinks { self.sinks_ms.saturating_add(1) } else { 0 };
        self.sunk = (self.sunk - velocity * carried.signum() * DT).max(0.0);
        if !self.lowers && loaded && (self.sunk > SINKS.0 || self.sinks_ms > SINKS.1) {
            self.lower(p);
        }
        if !self.lowers {
            self.doubt(velocity, p + d);
        } else if loaded {
            // Never beyond the limit; and what was there at the begin is not taken back from a joint that is lifted.
            let learned = self.load + damper * DT / LEARNS_S;
            let learned = if carried > 0.0 { learned.max(self.least) } else { learned.min(self.least) };
            self.load = learned.max(-limit - joint.model).min(limit - joint.model);
        }
        let calm = if self.lowers {
            self.holdable = (joint.model + self.load).abs() <= HOLDABLE * limit;
            velocity.abs() < AT_REST
        } else {
            velocity.abs() < CALM && d.abs() <= most && self.driven_ms < DRIVEN_CALM_MS
        };
        self.calm_ms = if calm { self.calm_ms.saturating_add(1) } else { 0 };
        PidTorque { p, i: self.load, d }
    }

    /// A load that drives the joint all by itself, against this `torque` (N·m) of spring and damper, goes; it comes back where it is missed.
    fn doubt(&mut self, velocity: f64, torque: f64) {
        let (along, has) = (velocity * self.least.signum(), self.load.abs());
        let against = -torque * self.least.signum();
        let driven = along > CREEPS && against > DRIVEN.0 * has && against < DRIVEN.1 * has;
        self.driven_ms = if driven {
            (self.driven_ms + 1).min(DRIVEN_MS + DRIVEN_CALM_MS)
        } else {
            self.driven_ms.saturating_sub(1)
        };
        if self.driven_ms > DRIVEN_MS {
            self.load *= 1.0 - DT / GOES_S;
        } else if along < -CALM && self.load != self.least {
            self.load += (self.least - self.load) * (DT / COMES_BACK_S);
        }
    }
}

/// What a brake has against a fast motion of a joint with this `inertia` (kg·m²), N·m: the measured speed is too old for the damper of a light
/// joint to stop a shove.
fn brake(joint: &Joint<'_>, inertia: f64, (from, to): (f64, f64)) -> f64 {
    let JointConfig { torque_max, velocity_max, .. } = *joint.limits;
    let slope = (torque_max / ((to - from) * velocity_max)).min(BRAKE_RATE * inertia);
    let beyond = joint.young_velocity.abs() - from * velocity_max;
    if beyond > 0.0 { -(slope * beyond).min(torque_max) * joint.young_velocity.signum() } else { 0.0 }
}

/// How often each joint has yielded in the last seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Yielded {
    times: [u8; JOINTS],
    /// Ticks since one did.
    since_ms: u16,
}

remembered!(Yielded { times, since_ms });

impl Yielded {
    /// A tick.
    pub fn step(&mut self) {
        self.since_ms = self.since_ms.saturating_add(1).min(AGAIN_MS);
        if self.since_ms == AGAIN_MS {
            self.times = [0; JOINTS];
        }
    }

    /// The joint yields. Returns whether it does so too often: it goes on until the host clears it.
    pub fn count(&mut self, joint: usize) -> bool {
        self.since_ms = 0;
        let Some(times) = self.times.get_mut(joint) else { return false };
        *times = times.saturating_add(1);
        *times >= TIMES
    }
}

#[cfg(test)]
mod tests;
