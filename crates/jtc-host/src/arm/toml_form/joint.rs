//! Table of one joint in the TOML format of an arm file.

use jtc_core::{JointConfig, PidGains};
use jtc_wire::Joint;
use serde::{Deserialize, Serialize};

use super::exactly;
use crate::arm::{Change, Lacking, Sources, Warning};
use crate::file::{FileError, Place};

/// Velocity limit that is used if a file does not contain one, rad/s. The next two constants are the default acceleration limit, rad/s²,
/// and the default position error limit, rad.
pub(in crate::arm) const VELOCITY_DEFAULT: f64 = 1.5;
pub(in crate::arm) const ACCELERATION_DEFAULT: f64 = 12.56637;
pub(in crate::arm) const POSITION_ERROR_DEFAULT: f64 = 0.09;
/// Default damping in Teaching, N·m·s/rad for each N·m of the torque limit. At 0.6 rad/s, the damping torque is 30 %
/// of the torque limit. This is the largest torque that the controller accepts as the weight of a load (J-66).
pub(in crate::arm) const TEACH_DAMPING_DEFAULT: f64 = 0.5;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointForm {
    pub(super) name: String,
    #[serde(deserialize_with = "exactly")]
    pub(super) origin_xyz_m: [f64; 3],
    #[serde(deserialize_with = "exactly")]
    pub(super) origin_rpy_rad: [f64; 3],
    pub(super) position_min_rad: Option<f64>,
    pub(super) position_max_rad: Option<f64>,
    pub(super) velocity_max_rad_s: Option<f64>,
    pub(super) acceleration_max_rad_s2: Option<f64>,
    pub(super) torque_max_nm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) drive_torque_max_nm: Option<f64>,
    pub(super) position_error_max_rad: Option<f64>,
    pub(super) rotor_inertia_kg_m2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) torque_gain: Option<f64>,
    pub(super) teach_damping_nm_s_rad: Option<f64>,
    pub(super) pid: Option<PidForm>,
    pub(super) friction_polynomial: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) proposed: Vec<String>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PidForm {
    pub(super) kp: f64,
    pub(super) ki: f64,
    pub(super) kd: f64,
    pub(super) int_min_rad_s: f64,
    pub(super) int_max_rad_s: f64,
}

impl JointForm {
    /// Returns `true` if the file contains the value of `key` for the joint, or if this key has a default.
    pub(super) fn has(&self, key: &str) -> bool {
        match key {
            "rotor_inertia_kg_m2" => self.rotor_inertia_kg_m2.is_some(),
            "pid" => self.pid.is_some(),
            "friction_polynomial" => self.friction_polynomial.is_some(),
            _ => true,
        }
    }

    pub(super) fn limits(
        &self,
        number: Joint,
        warnings: &mut Vec<Warning>,
        sources: &mut Sources,
        lacking: &mut Vec<Lacking>,
    ) -> JointConfig {
        let mut need = |key: &'static str, v: Option<f64>| {
            v.unwrap_or_else(|| {
                lacking.push(Lacking::OfJoint(number, key));
                0.0
            })
        };
        let position_min = need("position_min_rad", self.position_min_rad);
        let position_max = need("position_max_rad", self.position_max_rad);
        for (key, given) in [
            ("torque_gain", self.torque_gain.is_some()),
            ("drive_torque_max_nm", self.drive_torque_max_nm.is_some()),
            ("teach_damping_nm_s_rad", self.teach_damping_nm_s_rad.is_some()),
        ] {
            if !given {
                sources.fill_in((Some(number), key));
            }
        }
        let torque_max = need("torque_max_nm", self.torque_max_nm);
        let mut or = |key: &'static str, v: Option<f64>, default: f64| {
            v.unwrap_or_else(|| {
                let problem = format!("{key} not given: {default} is used");
                warnings.push(Warning::new(Change::LimitAssumed, format!("joint {}", self.name), problem));
                sources.fill_in((Some(number), key));
                default
            })
        };
        JointConfig {
            position_min,
            position_max,
            velocity_max: or("velocity_max_rad_s", self.velocity_max_rad_s, VELOCITY_DEFAULT),
            acceleration_max: or(
                "acceleration_max_rad_s2",
                self.acceleration_max_rad_s2,
                ACCELERATION_DEFAULT,
            ),
            torque_max,
            position_error_max: or(
                "position_error_max_rad",
                self.position_error_max_rad,
                POSITION_ERROR_DEFAULT,
            ),
            rotor_inertia: self.rotor_inertia_kg_m2.unwrap_or(0.0),
            torque_gain: self.torque_gain.unwrap_or(1.0),
            teach_damping: self.teach_damping_nm_s_rad.unwrap_or(TEACH_DAMPING_DEFAULT * torque_max),
        }
    }

    pub(super) fn polynomial(&self) -> Result<Option<[f64; 6]>, FileError> {
        let Some(c) = &self.friction_polynomial else { return Ok(None) };
        match c.len() {
            4 => Ok(Some([c[0], c[1], c[2], c[3], 0.0, 0.0])),
            6 => Ok(Some([c[0], c[1], c[2], c[3], c[4], c[5]])),
            n => Err(FileError::at(
                Place::name(format!("joint {}, friction_polynomial", self.name)),
                format!("{n} coefficients, expected 4 or 6"),
            )),
        }
    }
}

impl PidForm {
    pub(super) fn gains(self) -> PidGains {
        PidGains {
            kp: self.kp,
            ki: self.ki,
            kd: self.kd,
            int_min: self.int_min_rad_s,
            int_max: self.int_max_rad_s,
        }
    }
}
