//! Behaviour of a joint that yields to a push (J-68), or lowers a load that its torque limit cannot hold (J-70).
//!
//! The position controller reaches the whole torque limit against a push within a few milliradians. With the position controller alone, the
//! joint would clamp an obstacle, and only the torque limit would bound the force. A yielding joint has a damper and a weak spring in place
//! of the position controller. The free end of the spring is dragged along with the joint. The joint therefore follows a hand with a share
//! of its torque limit, and stops a shove with the whole torque limit. During the yield, the model torque and the learned load continue to
//! hold the arm.
//!
//! A joint that lowers a load has no spring. With the damper alone, the load sinks slowly, at any torque within the limit. The torque that
//! the damper needs becomes part of the learned load. A load within the torque limit therefore comes to rest.
use crate::bit_codec::bit_codec;
use crate::config::limits::{JointConfig, within};
use crate::motion::pid::PidTorque;
use crate::motion::soft_end;
use crate::{DT, JOINTS};

mod swing;

use swing::Swing;

/// Longest extension of the spring of a yielding joint, rad.
const STRETCH: f64 = 0.02;
/// Highest natural frequency of the spring together with the inertia of the joint, 1/s.
pub(crate) const SPRING_RATE: f64 = 30.0;
/// Highest rate at which the damper of a lowered load reduces a speed, 1/s. Several joints that lower loads share
/// this rate.
///
/// The rate is low, because held joints affect each other, and a delayed speed measurement makes the loop unstable at
/// the frequencies of this effect. At these frequencies, a joint has only a third of the inertia that it has while
/// all other joints are fixed.
const LOWERING_RATE: f64 = 40.0;
/// Share of the remaining change that the damping and the stiffness make in each tick, until they reach their final
/// values.
const SETTLES: f64 = 0.2;
/// Share of the remaining change that the brake makes in each tick, like [`SETTLES`].
const BRAKE_SETTLES: f64 = 0.5;
/// Highest rate at which a damper reduces the speed of a joint, 1/s. Measured speeds are about 8 ms old, because the
/// drives average them. A single joint would oscillate above 200 1/s, and joints that affect each other oscillate at
/// lower rates.
const DAMPING_RATE: f64 = 100.0;
/// Speeds, as multiples of the velocity limit. At the first speed, the brake of a joint begins to act. At the second
/// speed, it uses the whole torque limit. The brake replaces the damper if its torque is higher. `BRAKES_LOWERED`
/// applies to a joint that lowers a load. `BRAKE_RATE` bounds the rate at which the brake reduces a speed, 1/s,
/// because positions are about 4 ms old.
const BRAKES: (f64, f64) = (0.2, 0.8);
const BRAKES_LOWERED: (f64, f64) = (0.4, 1.0);
const BRAKE_RATE: f64 = 250.0;
/// Speed below which a joint that yields is calm, rad/s.
const CALM: f64 = 0.05;
/// Speed below which a lowered load is at rest, rad/s.
const AT_REST: f64 = 0.02;
/// Time for which a joint must be calm before the controller holds it again, ms. A joint is not calm if its load has
/// seemed to drive it for `DRIVEN_CALM_MS`.
const CALM_MS: u16 = 200;
const DRIVEN_CALM_MS: u16 = 50;
/// Least torque of gravity and load at which a motion counts as sinking, as a share of the torque limit.
const LOADED: f64 = 0.05;
/// Distance (rad) and time (ms) of sinking after which the joint counts as overloaded.
const SINKS: (f64, u16) = (0.5, 3_000);
/// Time constant for the torque of the damper to become part of the load, s.
const LEARNS_S: f64 = 0.5;
/// Range of the torque of spring and damper, as a share of the load, in which the load seems to drive its joint.
/// Friction takes the rest.
///
/// If the load seems to drive its joint for [`DRIVEN_MS`], the controller assumes that a person leaned on the arm
/// while the load was learned. The load then fades with the time constant [`GOES_S`] (s). If the joint sinks without
/// the load, the load returns with [`COMES_BACK_S`] (s).
const DRIVEN: (f64, f64) = (0.5, 1.2);
/// Speed above which a load seems to drive its joint, rad/s.
const CREEPS: f64 = 0.002;
const DRIVEN_MS: u16 = 300;
const GOES_S: f64 = 1.0;
const COMES_BACK_S: f64 = 0.3;
/// Share of the torque limit up to which the position controller holds a lowered load again. The remaining share is for encoder noise.
const HOLDABLE: f64 = 0.95;
/// Number of missing answers after which the spring of a yielding joint does not act.
const MISSING: u8 = 2;
/// Number of the first yield in a series of yields of a joint that lasts until the host clears it. A series continues
/// while each yield of the arm begins within [`AGAIN_MS`] after the beginning of the previous one.
const TIMES: u8 = 3;
/// Time without the beginning of a yield after which a series of yields ends (see [`TIMES`]), ticks.
const AGAIN_MS: u16 = 10_000;

/// State of a joint that yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Yield {
    /// `true` if the joint lowers a load, without a spring (J-70).
    lowers: bool,
    /// `true` if the yield continues until the host clears the yield.
    stays: bool,
    /// Position to which the spring of the joint pulls, rad.
    set: f64,
    /// Lower bound of the inertia that the joint moves, kg·m².
    inertia: f64,
    /// Torque of the unmodelled load of the joint, N·m. `least` is the value of this torque at the beginning of the yield or of the
    /// lowering. A lowered load never falls below `least`.
    load: f64,
    least: f64,
    /// Time for which the load has driven the joint, ms.
    driven_ms: u16,
    /// Damping of the joint, N·m·s/rad.
    damping: f64,
    /// Acting share of the brake. `grip` is the acting share of the spring.
    braking: f64,
    grip: f64,
    swing: Swing,
    /// `true` if the position controller can hold the load of the joint. `cleared` is `true` if the host has cleared
    /// the yield, so that the position controller may hold the joint again in any case.
    holdable: bool,
    cleared: bool,
    calm_ms: u16,
    /// Number of consecutive missing answers of the joint.
    missing: u8,
    /// Distance that the joint has sunk in the direction of gravity, rad. `sinks_ms` is the time of this motion, ms.
    sunk: f64,
    sinks_ms: u16,
}

bit_codec!(Yield {
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

/// Inputs of a yielding joint in one tick.
pub(crate) struct Joint<'a> {
    /// Measured position of the joint, rad.
    pub position: f64,
    /// Measured velocity of the joint, rad/s.
    pub velocity: f64,
    /// Velocity of the joint over the last 5 ms, rad/s.
    pub young_velocity: f64,
    /// `true` if all values of the joint were measured for this tick.
    pub fresh: bool,
    /// Torque of the model on the joint, N·m.
    pub model: f64,
    pub limits: &'a JointConfig,
    /// Lowest and highest position of the joint, rad.
    pub range: (f64, f64),
    /// Highest torque of spring and damper against a slow push, as a share of the torque limit.
    pub share: f64,
    /// Number of joints that lower their loads, including this joint.
    pub lowering: u8,
}

impl Yield {
    /// Begins the yield of a joint. `set` is the commanded position of the joint, rad. `load` is the torque of the unmodelled load of the
    /// joint, N·m.
    pub(crate) fn begin(lowers: bool, stays: bool, set: f64, inertia: f64, load: f64) -> Self {
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

    /// Drags the free end of the spring along with a joint at `position` (rad). Returns the new position of this end of the spring, rad.
    pub(crate) fn drag(&mut self, position: f64) -> f64 {
        self.set = self.set.max(position - STRETCH).min(position + STRETCH);
        self.set
    }

    /// Returns `true` if the joint has been calm for [`CALM_MS`]. If the yield stays until the host clears it, it
    /// does not end yet.
    pub(crate) fn is_calm(&self) -> bool {
        self.calm_ms >= CALM_MS
    }

    /// Returns `true` if the position controller may hold the joint again.
    pub(crate) fn is_over(&self) -> bool {
        self.is_calm() && (self.holdable || self.cleared) && !self.stays
    }

    /// Ends the yield at the host's request, as soon as the joint is calm.
    pub(crate) fn clear(&mut self) {
        (self.stays, self.cleared) = (false, true);
    }

    /// Returns `true` if the joint lowers a load.
    pub(crate) fn lowers(&self) -> bool {
        self.lowers
    }

    /// Makes a yielding joint lower its load from now on. The torque of the `spring`, N·m, becomes part of the load.
    pub(crate) fn lower(&mut self, spring: f64) {
        (self.lowers, self.calm_ms) = (true, 0);
        self.load += spring;
        self.least = self.load;
    }

    /// Returns `true` if the load may differ from the load that was learned before the yield.
    pub(crate) fn has_learned(&self) -> bool {
        self.lowers || self.load != self.least
    }

    /// Returns the torque that the position controller must produce after the yield, N·m. This torque is the load plus
    /// the torque of the `spring` (N·m): a spring that opposes the load reduces it, and a spring that helps to hold the
    /// joint increases it. The result is never larger than the load at the beginning of the yield.
    pub(crate) fn left(&self, spring: f64) -> f64 {
        if self.lowers {
            self.load
        } else {
            (self.load + spring).max(self.least.min(0.0)).min(self.least.max(0.0))
        }
    }

    /// Returns the load torque for Teaching, N·m. If the controller has reduced the load to less than half, it is
    /// doubtful whether this load exists. Teaching then uses only the part that the `spring` (N·m) has not opposed.
    pub(crate) fn taught_load(&self, spring: f64) -> f64 {
        if self.load.abs() < 0.5 * self.least.abs() { self.left(spring) } else { self.load }
    }

    /// Returns the torque of the unmodelled load of the joint, N·m.
    pub(crate) fn load(&self) -> f64 {
        self.load
    }

    /// Executes one tick of the yield. Returns the torques of spring, load and damper as the parts of a PID torque, N·m.
    pub(crate) fn step(&mut self, joint: &Joint<'_>) -> PidTorque {
        let limit = joint.limits.torque_max;
        let most = joint.share * limit;
        let velocity = joint.velocity;
        self.missing = if joint.fresh { 0 } else { self.missing.saturating_add(1) };

        let soft = self.swing.step(velocity);
        // `wanted` is the damping at which the damper and the full spring together reach the torque limit at half of
        // the velocity limit.
        let wanted = 2.0 * (limit - most) / joint.limits.velocity_max;
        let damping = if self.lowers {
            LOWERING_RATE / f64::from(joint.lowering.max(1)) * self.inertia
        } else {
            wanted.min(soft * DAMPING_RATE * self.inertia)
        };
        self.damping += SETTLES * (damping - self.damping);
        // The brake has no effect in the first tick of a yield. The transfer compares the torque of this tick with the
        // last torque. The transfer would treat a brake torque as a part of the step and would let it act only
        // gradually.
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
        // The sum of spring and damper exceeds its permitted share of the torque limit only during a fast push,
        // because of the damper.
        let p = if self.lowers { 0.0 } else { within(spring, d, most) };

        let carried = joint.model + if self.lowers { self.least } else { self.load };
        let loaded = carried.abs() > LOADED * limit;
        let sinks = loaded && velocity * carried < 0.0 && velocity.abs() > AT_REST;
        self.sinks_ms = if sinks { self.sinks_ms.saturating_add(1) } else { 0 };
        if loaded {
            self.sunk = (self.sunk - velocity * carried.signum() * DT).max(0.0);
            if !self.lowers && (self.sunk > SINKS.0 || self.sinks_ms > SINKS.1) {
                self.lower(p);
            }
        }
        if !self.lowers {
            self.doubt(velocity, p + d);
        } else if loaded {
            // The sum of model torque and load never exceeds the torque limit. If a hand lifts the joint, the load
            // does not fall below its value at the beginning.
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

    /// Reduces a load that seems to drive the joint against the `torque` (N·m) of spring and damper. The load returns
    /// if the joint sinks without it.
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

/// Returns the torque of the brake against a fast motion of a joint with this `inertia` (kg·m²), N·m. The brake is
/// necessary for a joint with little inertia: its damper cannot stop a fast push, because the measured speed is too
/// old.
fn brake(joint: &Joint<'_>, inertia: f64, (from, to): (f64, f64)) -> f64 {
    let JointConfig { torque_max, velocity_max, .. } = *joint.limits;
    let slope = (torque_max / ((to - from) * velocity_max)).min(BRAKE_RATE * inertia);
    let beyond = joint.young_velocity.abs() - from * velocity_max;
    if beyond > 0.0 { -(slope * beyond).min(torque_max) * joint.young_velocity.signum() } else { 0.0 }
}

/// Number of yields of each joint in the present series (see [`TIMES`]).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Yielded {
    times: [u8; JOINTS],
    /// Number of ticks since the beginning of the last yield of any joint.
    since_ms: u16,
}

bit_codec!(Yielded { times, since_ms });

impl Yielded {
    /// Executes one tick of the count.
    pub(crate) fn step(&mut self) {
        self.since_ms = self.since_ms.saturating_add(1).min(AGAIN_MS);
        if self.since_ms == AGAIN_MS {
            self.times = [0; JOINTS];
        }
    }

    /// Counts a yield of the joint. Returns `true` if the joint yields too often. The yield of such a joint then continues until the host
    /// clears the yield.
    pub(crate) fn count(&mut self, joint: usize) -> bool {
        self.since_ms = 0;
        let Some(times) = self.times.get_mut(joint) else { return false };
        *times = times.saturating_add(1);
        *times >= TIMES
    }
}

#[cfg(test)]
mod tests;
