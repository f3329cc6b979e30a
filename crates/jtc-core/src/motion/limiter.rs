//! Application of the limits of the control law to each joint in each tick (J-43).
use super::law::{ControlLaw, ControlMode, LawInputs};
use super::set_values::SetValues;
use crate::bit_codec::bit_codec;
use crate::config::limits::{self, Recent, Saturation, Turns};
use crate::{JOINTS, joint_error};

/// Speed, rad/s, above which a torque at the limit in the direction of the motion is not considered part of a catch.
pub(super) const DRIVEN: f64 = 0.05;
/// Lowest speed of a joint that comes to rest after Teaching, as a share of its set velocity. If a joint is slower, the controller assumes
/// that an obstacle stops it.
const LAGS: f64 = 0.7;
/// Share of the velocity limit at and above which the feedback torque may be twice as high, because the model may have wrong friction and
/// inertia. If a fast joint hits an obstacle, its feedback torque exceeds the doubled share a few milliseconds later.
const FAST: f64 = 0.2;
/// Highest number of ticks, among the last 100, in which the feedback torque of a joint may exceed its permitted share. After more ticks,
/// the joint counts as pushed (J-66).
const PUSHED_MS: u16 = 20;
/// Excess of a joint's speed over the commanded speed, as a share of its velocity limit. The second constant is the distance that this
/// excess has added, rad. A joint that exceeds both limits counts as pushed, even with weak gains. With weak gains, a joint with little
/// inertia exceeds its speed limit before the feedback torque shows the push.
pub(crate) const RUSH: f64 = 0.2;
const RUSH_WAY: f64 = 1e-3;

/// State of the limiter: for each joint, the ticks with a torque at the limit, the ticks with too much feedback torque, and the changes of
/// the torque from limit to limit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Limiter {
    saturation: [Saturation; JOINTS],
    pushed: [Recent; JOINTS],
    turns: [Turns; JOINTS],
    /// Number of ticks that the limiter has executed. The number starts again at 0 when the controller switches the torque off.
    tick: u32,
}

bit_codec!(Limiter { saturation, pushed, turns, tick });

/// Findings of the limiter in a tick for one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Found {
    /// Joint errors for the set values that exceed their limits. The torque bit is set if the computed torque is NaN.
    pub errors: u16,
    /// `true` if the computed torque was above its limit for too long (J-43).
    pub overloaded: bool,
    /// `true` if the feedback torque was above its permitted share for too long, and the joint had settled before.
    pub pushed: bool,
    /// `true` if the feedback torque is above its permitted share.
    pub strained: bool,
    /// `true` if the joint has settled since it was enabled.
    pub settled: bool,
    /// `true` if the position controller is unstable: the torque jumps from limit to limit, or a swing grows.
    pub unstable: bool,
}

impl Found {
    /// Returns `true` if the controller must react to the findings.
    pub(crate) fn is_any(&self) -> bool {
        (self.errors != 0) | self.overloaded | self.pushed | self.unstable
    }
}

/// Result of the limiter for all joints.
#[derive(Default)]
pub(crate) struct Limited {
    /// Torque to command, N·m.
    pub torque: [f64; JOINTS],
    /// Findings of this tick for each joint. `None` if no joint needs a reaction.
    pub found: Option<[Found; JOINTS]>,
    /// Sag of the set positions of joints whose loads are being caught, rad. `None` if no set position has sagged.
    pub sag: Option<[f64; JOINTS]>,
}

impl Limiter {
    /// Returns `true` for each joint whose last computed torque was above its limit. The integral of such a joint does not change (J-41).
    pub(super) fn saturated(&self) -> [bool; JOINTS] {
        core::array::from_fn(|j| self.saturation[j].saturated)
    }

    /// Clears the counters of a joint in the limiter.
    #[inline(always)]
    pub(super) fn forget(&mut self, joint: usize) {
        self.saturation[joint].forget();
        self.pushed[joint].forget();
        self.turns[joint] = Turns::default();
    }

    /// Clears the record of the changes of each torque from one limit to the other.
    pub(super) fn forget_turns(&mut self) {
        self.turns = Default::default();
    }

    /// Executes one tick of the limiter, which limits the torque of the `law` and checks the torque and the set values. While the arm
    /// brakes with all available torque, the limiter does not report an overload. If a motion is also commanded, the limiter does not
    /// report position error and acceleration either (J-33). For a joint that yields, the limiter reports only a torque of NaN, or a torque
    /// that jumps from limit to limit. No other report is needed, because the torque of such a joint is bounded by construction.
    pub(super) fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        law: &ControlLaw,
        set: &mut SetValues,
        held_back: bool,
        limited: &mut Limited,
    ) {
        let LawInputs { mode, braking, nodes, config, ref parameters } = *inputs;
        // The exceptions for braking apply only while the set values move, because an arm at rest yields to a push (J-66).
        let excused = if braking && mode.moves() {
            joint_error::POSITION_ERROR | joint_error::ACCELERATION
        } else if held_back || mode == ControlMode::Rest {
            // A change of the rate of path time adds an acceleration to the set values. An arm that a hand has moved may have any
            // acceleration.
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
            // A torque that accelerates a joint instead of stopping the joint does not belong to a catch or a deceleration.
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
            // A fast joint may use more feedback torque.
            let speed = || (set.point.velocity[j].abs() / (FAST * limits.velocity_max)).min(1.0);
            let strained = feedback.abs() > share && feedback.abs() > (1.0 + speed()) * share;
            // Feedback torque that brakes a moving joint does not count as a push. Feedback torque on a joint at rest counts as a push.
            let brakes = || stopping || (braking && feedback.signum() * v[j] < -DRIVEN);
            // After hand guiding, the arm may hit a person before it is at rest. The joint that has hit the person then lags its set
            // values.
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
            // The distance is checked first, because the distance exceeds its limit only rarely.
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
