//! The limits of the control law, each tick, for each joint (J-43).
use super::law::{ControlMode, LawInputs};
use super::set_values::SetValues;
use super::torque::JointTorque;
use crate::limits::{self, Saturation};
use crate::remembered::remembered;
use crate::{JOINTS, joint_error};

/// Speed above which torque at its limit that drives the joint on catches nothing, rad/s.
pub(super) const DRIVEN: f64 = 0.05;

/// How often each joint's torque has been at its limit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Limiter {
    saturation: [Saturation; JOINTS],
}

remembered!(Limiter { saturation });

/// What is left of a torque within the limits, per joint.
pub(crate) struct Limited {
    /// To command, N·m.
    pub torque: [f64; JOINTS],
    /// Joint errors found.
    pub errors: [u16; JOINTS],
    /// By how much the set positions of joints have sagged whose loads are being caught, rad; `None` where none is.
    pub sag: Option<[f64; JOINTS]>,
}

impl Limiter {
    /// The last torque of the joint was beyond the limit: its integral is held (J-41).
    pub fn saturated(&self) -> [bool; JOINTS] {
        core::array::from_fn(|j| self.saturation[j].saturated)
    }

    /// One tick: the computed `torque` within its limits, and the errors of torque and set values. What braking with all the
    /// torque there is does to the torque, and while a motion is commanded to position error and acceleration, is none (J-33).
    pub fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        torque: &[JointTorque; JOINTS],
        set: &mut SetValues,
    ) -> Limited {
        let LawInputs { mode, braking, nodes, config, ref parameters } = *inputs;
        let mut sags = None;
        // Only while set values move: an arm that stands gives way to a push (J-66).
        let excused =
            if braking && mode.moves() { joint_error::POSITION_ERROR | joint_error::ACCELERATION } else { 0 };
        let (q, v) = (nodes.positions(), nodes.velocities());
        let due = *set.due(config);
        let joints: [(f64, u16); JOINTS] = core::array::from_fn(|j| {
            let limits = &config.joints[j];
            let error = due[j] - q[j];
            let computed = torque[j].sum();
            let catching = set.catch[j].step(v[j]) && mode == ControlMode::Hold;
            // Torque that drives a joint on, rather than stop it, is neither a catch nor a way to rest.
            let driven = || computed.signum() * v[j] > DRIVEN;
            let stopping = (catching || set.deceleration[j].is_some()) && !driven();
            let (within, torque_error) =
                self.saturation[j].limit(computed, limits, config.torque_over_ms, braking || stopping);
            let point = (set.point.position[j], set.point.velocity[j], set.point.acceleration[j]);
            let set_error = limits::check_set(point, error, limits, mode == ControlMode::Follow);
            if catching && self.saturation[j].saturated {
                let sag = set.sag(j, computed - within, parameters.pid[j].kp, error, limits);
                sags.get_or_insert([0.0; JOINTS])[j] = sag;
            }
            let set_error =
                if mode != ControlMode::Teach && set.holding[j] { set_error & !excused } else { 0 };
            (within, torque_error | set_error)
        });
        Limited {
            torque: joints.map(|(torque, _)| torque),
            errors: joints.map(|(_, error)| error),
            sag: sags,
        }
    }
}
