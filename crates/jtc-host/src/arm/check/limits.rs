//! Detection of invalid joint limits.

use jtc_core::settings::{self, Setting};
use jtc_wire::Joint;

use crate::arm::Arm;

/// Reason why a joint limit is invalid.
pub(in crate::arm) struct LimitFault {
    pub key: &'static str,
    pub value: f64,
    pub problem: String,
}

impl Arm {
    /// Returns the invalid limits of all joints.
    pub(in crate::arm) fn limit_faults(&self) -> Vec<(Joint, LimitFault)> {
        let mut all: Vec<(Joint, LimitFault)> = Vec::new();
        for (joint, limits) in Joint::ALL.into_iter().zip(&self.joints) {
            let mut fault = |key, value, problem| all.push((joint, LimitFault { key, value, problem }));
            for (key, v) in [
                ("velocity_max_rad_s", limits.velocity_max),
                ("acceleration_max_rad_s2", limits.acceleration_max),
                ("torque_max_nm", limits.torque_max),
                ("position_error_max_rad", limits.position_error_max),
                ("drive_torque_max_nm", self.drive_torque_max[joint.index()]),
            ] {
                if !(v > 0.0 && v.is_finite()) {
                    fault(key, v, format!("{v} is not a positive number"));
                }
            }
            let (min, max) = (limits.position_min, limits.position_max);
            if !min.is_finite() || !max.is_finite() {
                fault("position_min_rad", min, format!("{min}..{max} is not finite"));
            } else if min >= max {
                fault("position_min_rad", min, format!("{min} is not below position_max_rad {max}"));
            }
            let rotor = limits.rotor_inertia;
            if !(rotor >= 0.0 && rotor.is_finite()) {
                fault("rotor_inertia_kg_m2", rotor, format!("{rotor} is negative or not finite"));
            }
            for (key, value) in
                [("torque_gain", limits.torque_gain), ("teach_damping_nm_s_rad", limits.teach_damping)]
            {
                if let Some(Setting { low, high, .. }) = settings::named(key)
                    && !(*low..=*high).contains(&value)
                {
                    fault(key, value, format!("{value} is outside {low}..{high}"));
                }
            }
        }
        all.retain(|(joint, fault)| !self.lacks(*joint, fault.key));
        all
    }

    /// Returns the torque limits that the drives do not reach. A drive limits a larger torque without a report: the controller would then
    /// plan with a torque that the arm does not have.
    pub(in crate::arm) fn drive_faults(&self) -> Vec<(Joint, LimitFault)> {
        let excess = |joint: Joint| {
            let (limits, most) = (&self.joints[joint.index()], self.drive_torque_max[joint.index()]);
            let torque = limits.torque_max * limits.torque_gain;
            (torque > most).then(|| {
                let problem = format!(
                    "{torque} N·m exceed the {most} N·m that the drive supplies: lower torque_max_nm, or write the number of the data sheet \
                     as drive_torque_max_nm"
                );
                (joint, LimitFault { key: "torque_max_nm", value: torque, problem })
            })
        };
        Joint::ALL.into_iter().filter_map(excess).collect()
    }
}
