//! Limits of a robot description's joints, and what the drives can do of them.

use jtc_core::{Config, JOINTS, JointConfig, WORKING_AREA};
use jtc_wire::Joint as Number;
use urdf_rs::{Joint, JointType};

use super::Chain;
use super::choice::about;
use crate::arm::{Arm, Change};
use crate::file::FileError;

/// As many digits as a person reads.
pub(super) fn short(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn is_limit(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

impl Chain<'_> {
    /// The limits of all six. What is not given is as for the default arm, or as far as the drives go, and known as such.
    pub(super) fn limits(&mut self) -> Result<[JointConfig; JOINTS], FileError> {
        let mut all = Arm::avena().joints;
        for (number, joint) in Number::ALL.into_iter().zip(self.rotary) {
            let to = &mut all[number.index()];
            to.rotor_inertia = 0.0;
            self.position(number, joint, to)?;
            self.dynamic_limits(number, joint, to);
            for key in ["position_error_max_rad", "torque_gain"] {
                self.sources.fill_in((Some(number), key));
            }
            let place = format!("joint {}", joint.name);
            if joint.safety_controller.is_some() {
                self.warn(Change::NotCarried, place, "safety_controller");
            }
        }
        self.narrow_to_drives(&mut all)?;
        Ok(all)
    }

    fn position(&mut self, number: Number, joint: &Joint, to: &mut JointConfig) -> Result<(), FileError> {
        let (lower, upper) = (joint.limit.lower, joint.limit.upper);
        let endless = joint.joint_type == JointType::Continuous;
        if endless || lower == 0.0 && upper == 0.0 || !lower.is_finite() || !upper.is_finite() {
            // As far as the drives go; whether the mechanism has a stop is not given.
            (to.position_min, to.position_max) = (-WORKING_AREA, WORKING_AREA);
            for key in ["position_min_rad", "position_max_rad"] {
                self.sources.fill_in((Some(number), key));
            }
            let why = if endless { "turns without end" } else { "has" };
            let problem =
                format!("{why}, no position limits: {}..{} rad are used", -WORKING_AREA, WORKING_AREA);
            let problem = problem.replace("has, no", "no");
            self.warn(Change::LimitAssumed, format!("joint {}", joint.name), problem);
        } else if lower >= upper {
            return Err(about(joint, format!("lower limit {lower} is not below upper {upper}")));
        } else {
            (to.position_min, to.position_max) = (lower, upper);
        }
        Ok(())
    }

    fn dynamic_limits(&mut self, number: Number, joint: &Joint, to: &mut JointConfig) {
        let (place, limit) = (format!("joint {}", joint.name), &joint.limit);
        if is_limit(limit.velocity) {
            to.velocity_max = limit.velocity;
        } else {
            self.sources.fill_in((Some(number), "velocity_max_rad_s"));
            let problem = format!("velocity limit {}: {} rad/s is used", limit.velocity, to.velocity_max);
            self.warn(Change::LimitAssumed, &place, problem);
        }
        if is_limit(limit.effort) {
            to.torque_max = limit.effort;
        } else {
            self.sources.fill_in((Some(number), "torque_max_nm"));
            let problem = format!("effort limit {}: {} N·m is used", limit.effort, to.torque_max);
            self.warn(Change::LimitAssumed, &place, problem);
        }
        if is_limit(limit.acceleration) {
            to.acceleration_max = limit.acceleration;
        } else {
            self.sources.fill_in((Some(number), "acceleration_max_rad_s2"));
        }
    }

    /// A description gives the limits of the mechanism. Its drives may do less, and the controller refuses limits beyond that
    /// (J-35, J-43).
    fn narrow_to_drives(&mut self, joints: &mut [JointConfig; JOINTS]) -> Result<(), FileError> {
        let drives = Config::avena();
        let fastest = drives.drive_speed_trip.min(drives.velocity_full_scale) / drives.overspeed_factor;
        let strongest = jtc_bus::TORQUE_FULL_SCALE;
        for (rotary, to) in self.rotary.into_iter().zip(joints) {
            let place = format!("joint {}", rotary.name);
            self.narrow_position(rotary, to)?;
            if to.velocity_max > fastest {
                let problem = format!(
                    "velocity limit {}: {fastest} rad/s is used, above {} rad/s the drives trip",
                    short(to.velocity_max),
                    drives.drive_speed_trip
                );
                to.velocity_max = fastest;
                self.warn(Change::LimitCut, &place, problem);
            }
            if to.torque_max > strongest {
                let problem = format!(
                    "effort limit {}: {strongest} N·m is used, the joint bus carries no more",
                    to.torque_max
                );
                to.torque_max = strongest;
                self.warn(Change::LimitCut, &place, problem);
            }
        }
        Ok(())
    }

    fn narrow_position(&mut self, joint: &Joint, to: &mut JointConfig) -> Result<(), FileError> {
        let (min, max) = (to.position_min, to.position_max);
        if min >= -WORKING_AREA && max <= WORKING_AREA {
            return Ok(());
        }
        (to.position_min, to.position_max) =
            (min.clamp(-WORKING_AREA, WORKING_AREA), max.clamp(-WORKING_AREA, WORKING_AREA));
        let limits = format!("position limits {}..{}", short(min), short(max));
        let shift = short(0.5 * (min + max));
        if to.position_min >= to.position_max {
            let problem = format!(
                "{limits} rad are outside the drives' working area, ±{WORKING_AREA} rad: put the joint's zero into the middle of \
                 its range, {shift} rad from where it is (its origin turned about its axis, and both limits less that)"
            );
            return Err(about(joint, problem));
        }
        let kept = to.position_max - to.position_min;
        let could = (max - min).min(2.0 * WORKING_AREA);
        let mut problem = format!(
            "{limits} leave the drives' working area: {}..{} rad are used",
            short(to.position_min),
            short(to.position_max)
        );
        if kept < 0.9 * could {
            problem +=
                &format!("; {} rad of it would be within with the joint's zero at {shift} rad", short(could));
        }
        self.warn(Change::LimitCut, format!("joint {}", joint.name), problem);
        Ok(())
    }
}
