//! Checks that a controller accepts the gains (J-71), and that the gains give each joint enough damping.

use host_kit::Severity;
use jtc_core::{JOINTS, PidGains, inertia_needed, least_felt_inertia};
use jtc_dynamics::{Dynamics, JointVec, Payload};
use jtc_wire::Joint;

use super::ArmFinding;
use crate::arm::Arm;
use crate::arm::statics::{POSES, pose};

/// Heaviest payload in the check of the damping, kg.
const PAYLOAD_MAX: f64 = 5.0;
/// Mean delay of a torque command, s, because each torque stays constant for one tick. The check adds this delay to
/// the delay in the controller's settings. `TICK` is the duration of one tick, s.
const HALF_A_TICK: f64 = 0.5e-3;
const TICK: f64 = 1e-3;

impl Arm {
    /// Finds joints whose inertia is too small for their gains, and joints whose gains give too little damping. A
    /// controller refuses the gains of a joint whose inertia is too small.
    pub(super) fn find_borne(&self, findings: &mut Vec<ArmFinding>) {
        let Some(pid) = &self.pid else { return };
        let (config, delay) = (self.config(), self.config().delay_ticks);
        let felt = least_felt_inertia(&self.model, &config);
        let (payload, moved) = self.heaviest_moved();
        for (joint, gains) in Joint::ALL.into_iter().zip(pid) {
            let j = joint.index();
            // If the joint already has a finding about its stability, no second finding is added, because the first
            // finding is more precise.
            if findings.iter().any(|found| found.code == "gains" && found.joint == Some(joint)) {
                continue;
            }
            let needed = inertia_needed(gains, delay);
            if felt[j] < needed {
                findings.push(self.too_light(joint, gains, felt[j], needed));
            } else if gains.kp > 0.0 {
                let delayed = gains.kp * (TICK * f64::from(delay) + HALF_A_TICK);
                let damped = delayed + gains.ki * moved[j] / gains.kp;
                if gains.kd < damped {
                    findings.push(self.undamped(joint, gains, damped, delayed, payload));
                }
            }
        }
    }

    fn too_light(&self, joint: Joint, gains: &PidGains, felt: f64, needed: f64) -> ArmFinding {
        let PidGains { kp, kd, .. } = gains;
        let what = format!(
            "{}: Kp {kp} and Kd {kd} need an inertia of {needed:.3} kg·m², but the joint has only {felt:.3} kg·m² in its lightest pose",
            self.titled(joint)
        );
        ArmFinding::new(Severity::Problem, "too-light", what)
            .because("their torque is some milliseconds late, so a joint that is too light oscillates")
            .next(format!(
                "multiply Kp and Kd by {:.2} at most, or add the rotor inertia if it is missing",
                felt / needed
            ))
            .of(joint, "pid")
            .measured(felt, needed, "kg·m²")
    }

    fn undamped(
        &self,
        joint: Joint,
        gains: &PidGains,
        needed: f64,
        delayed: f64,
        payload: f64,
    ) -> ArmFinding {
        let PidGains { kd, ki, .. } = gains;
        let with = if payload > 0.0 { format!(" with {payload:.1} kg at the flange") } else { String::new() };
        let what = format!(
            "{}: Kd {kd} N·m·s/rad does not damp the joint{with}, expected at least {needed:.1}",
            self.titled(joint)
        );
        // The part `delayed` of Kd only compensates the delay of Kp. The advised Ki is low enough that the remaining
        // part of Kd damps the joint.
        let ki = ki * ((kd - delayed) / (needed - delayed)).max(0.0);
        ArmFinding::new(Severity::Warning, "damping", what)
            .because(
                "the delay of Kp and the integral use up the damping: without friction the joint oscillates",
            )
            .next(if ki > 0.0 {
                format!("raise Kd to {needed:.1} or more, or lower Ki to {ki:.0} or less")
            } else {
                format!("raise Kd to {needed:.1} or more, or lower Kp")
            })
            .of(joint, "pid")
            .measured(*kd, needed, "N·m·s/rad")
    }

    /// Returns the heaviest payload (kg, up to [`PAYLOAD_MAX`]) that the torque limits can hold in every pose. Also
    /// returns the greatest inertia (kg·m²) that each joint moves with this payload, if the other joints are held in
    /// position.
    fn heaviest_moved(&self) -> (f64, JointVec) {
        let ranges = self.ranges();
        let bare = Dynamics::new(&self.model, self.config().gravity);
        let mut mass = PAYLOAD_MAX;
        for q in (0..POSES).map(|n| pose(n, &ranges)) {
            let (own, more) = (bare.gravity_torque(&q), bare.flange_torque(&q));
            for j in 0..JOINTS {
                let left = (self.joints[j].torque_max - own[j].abs()).max(0.0);
                mass = mass.min(left / more[j].abs().max(1e-9));
            }
        }
        let payload = Payload { mass, ..Payload::default() };
        let loaded = Dynamics::with_payload(&self.model, [0.0; 3], &payload);
        let mut moved = [0.0f64; JOINTS];
        for matrix in (0..POSES).map(|n| loaded.mass_matrix(&pose(n, &ranges))) {
            (0..JOINTS).for_each(|j| moved[j] = moved[j].max(matrix[j][j]));
        }
        (mass, std::array::from_fn(|j| moved[j] + self.joints[j].counted_rotor()))
    }
}
