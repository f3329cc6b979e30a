//! The limits of the control law, each tick, for each joint (J-43).
use super::law::{ControlLaw, ControlMode, LawInputs};
use super::set_values::SetValues;
use crate::limits::{self, Recent, Saturation, Turns};
use crate::remembered::remembered;
use crate::{JOINTS, joint_error};

/// Speed above which torque at its limit that drives the joint on catches nothing, rad/s.
pub(super) const DRIVEN: f64 = 0.05;
/// Share of its set velocity below which a joint that comes to rest out of Teaching is held up by something.
const LAGS: f64 = 0.7;
/// Share of the velocity limit from which on the feedback torque may be twice as high: friction and inertia that the model has wrong are no
/// push, and what stands in the way of a fast motion exceeds that some milliseconds later.
const FAST: f64 = 0.2;
/// Of the last 100 ticks, more than which a feedback torque beyond its share makes a pushed joint (J-66).
const PUSHED_MS: u16 = 20;
/// Share of its velocity limit by which a joint is faster than it was commanded to be, and way that it has come by that, rad: it is pushed,
/// however weak its gains are. A light joint is at its over-speed before their torque says so.
pub(crate) const RUSH: f64 = 0.2;
const RUSH_WAY: f64 = 1e-3;

/// How often each joint's torque has been at its limit, and its feedback torque beyond its share.
#[derive(Clone, Debug, Default)]
pub(crate) struct Limiter {
    saturation: [Saturation; JOINTS],
    pushed: [Recent; JOINTS],
    turns: [Turns; JOINTS],
    /// Ticks of this limiter.
    tick: u32,
}

remembered!(Limiter { saturation, pushed, turns, tick });

/// What a tick has found about a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Found {
    /// Limits of the set values that it is beyond, as joint errors; the bit of torque stands for a torque that is no number.
    pub errors: u16,
    /// Its computed torque was beyond the limit for too long (J-43).
    pub overloaded: bool,
    /// Its feedback torque was beyond its share for too long, and it had settled before.
    pub pushed: bool,
    /// The feedback torque is beyond its share.
    pub strained: bool,
    /// It has settled since it was enabled.
    pub settled: bool,
    /// Its torque goes from limit to limit, or its swing grows: its position controller is unstable.
    pub unstable: bool,
}

impl Found {
    /// There is something to react to.
    pub fn is_any(&self) -> bool {
        (self.errors != 0) | self.overloaded | self.pushed | self.unstable
    }
}

/// What is left of a torque within the limits, per joint.
#[derive(Default)]
pub(crate) struct Limited {
    /// To command, N·m.
    pub torque: [f64; JOINTS],
    /// What was found on the way; `None` where there is nothing to react to.
    pub found: Option<[Found; JOINTS]>,
    /// By how much the set positions of joints have sagged whose loads are being caught, rad; `None` where none is.
    pub sag: Option<[f64; JOINTS]>,
}

impl Limiter {
    /// The last torque of the joint was beyond the limit: its integral is held (J-41).
    pub fn saturated(&self) -> [bool; JOINTS] {
        core::array::from_fn(|j| self.saturation[j].saturated)
    }

    /// What was counted of a joint is forgotten.
    #[inline(always)]
    pub fn forget(&mut self, joint: usize) {
        self.saturation[joint].forget();
        self.pushed[joint].forget();
        self.turns[joint] = Turns::default();
    }

    /// Torques from limit to limit count from now on, and not those before.
    pub fn forget_turns(&mut self) {
        self.turns = Default::default();
    }

    /// One tick: the torque that the `law` has computed within its limits, and what is found of torque and set values. What braking with
    /// all the torque there is does to the torque, and while a motion is commanded to position error and acceleration, is excused
    /// (J-33). So is all but a torque that is no number of a joint that yields: its torque is bounded by construction.
    pub fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        law: &ControlLaw,
        set: &mut SetValues,
        held_back: bool,
        limited: &mut Limited,
    ) {
        let LawInputs { mode, braking, nodes, config, ref parameters } = *inputs;
        // Only while set values move: an arm that stands yields to a push (J-66).
        let excused = if braking && mode.moves() {
            joint_error::POSITION_ERROR | joint_error::ACCELERATION
        } else if held_back || mode == ControlMode::Rest {
            // Path time that slows down has its own acceleration, and what a hand has led any.
            joint_error::ACCELERATION
        } else {
            0
        };
        let (q, v) = (nodes.positions(), nodes.velocities());
        let due = *set.due(config);
        let (holds, taught) = (mode.holds(), mode == ControlMode::Teach);
        let any_yields = law.any_yields();
        self.tick = self.tick.wrapping_add(1);
        for j in 0..JOINTS {
            let limits = &config.joints[j];
            let error = due[j] - q[j];
            let computed = law.torque[j].sum();
            let yields = any_yields && law.yields(j);
            let holds = holds && !yields;
            let catching = set.catch[j].step(v[j]) && holds;
            let stands = holds && mode == ControlMode::Hold;
            let mut unstable = stands && set.catch[j].swing_grows();
            if parameters.on_trial && stands {
                unstable |= set.catch[j].watch(v[j]);
            }
            // Torque that drives a joint on, rather than stop it, is neither a catch nor a way to rest.
            let driven = || computed.signum() * v[j] > DRIVEN;
            let stopping = (catching || set.deceleration[j].is_some()) && !driven();
            let excuses = braking || stopping || yields;
            let (within, overloaded) =
                self.saturation[j].limit(computed, limits, config.torque_over_ms, excuses);
            if self.saturation[j].saturated && !taught {
                unstable |= self.turns[j].hits(computed > 0.0, self.tick);
            }
            let settled = set.catch[j].settled();
            let (feedback, share) = (law.feedback(j), config.yield_torque_share * limits.torque_max);
            // More for a fast motion.
            let speed = || (set.point.velocity[j].abs() / (FAST * limits.velocity_max)).min(1.0);
            let strained = feedback.abs() > share && feedback.abs() > (1.0 + speed()) * share;
            // What brakes a joint is no push against it; what presses one that stands is.
            let brakes = || stopping || (braking && feedback.signum() * v[j] < -DRIVEN);
            // An arm that a hand has led meets somebody before it is at rest: the joint falls behind its set values.
            let lags = || {
                let set = set.point.velocity[j];
                mode == ControlMode::Rest && feedback * set > 0.0 && v[j] * set.signum() < LAGS * set.abs()
            };
            let counts = strained && !yields && !taught && ((settled && !brakes()) || lags());
            let rushes = || {
                let due = set.point.velocity[j];
                let velocity = nodes.node(j).young_velocity(due);
                let faster = velocity - due;
                faster.abs() > RUSH * limits.velocity_max && faster * velocity > 0.0 && error * velocity < 0.0
            };
            // The way first: hardly ever is there any.
            let rushes = error.abs() > RUSH_WAY && rushes() && settled && !yields && !taught && !brakes();
            let pushed = self.pushed[j].exceeds(counts, PUSHED_MS) | rushes;
            let point = (set.point.position[j], set.point.velocity[j], set.point.acceleration[j]);
            let set_errors = limits::check_set(point, error, limits, mode == ControlMode::Follow);
            if catching && self.saturation[j].saturated {
                let sag = set.sag(j, computed - within, parameters.pid[j].kp, error, limits);
                limited.sag.get_or_insert([0.0; JOINTS])[j] = sag;
            }
            let looked_at = !taught && !yields && set.holding[j];
            let errors = if looked_at { set_errors & !excused } else { 0 }
                | if computed.is_nan() { joint_error::TORQUE } else { 0 };
            limited.torque[j] = within;
            let found = Found { errors, overloaded, pushed, strained, settled, unstable };
            if found.is_any() {
                limited.found.get_or_insert_default()[j] = found;
            }
        }
    }
}
