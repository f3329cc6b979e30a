//! Default settings and parameters at the start of the device (rules, section 7). The defaults are generated from `arms/avena.toml` at
//! build time.
use jtc_dynamics::{ArmModel, Link, Origin, Payload};

use crate::config::Config;
use crate::config::bounds::ParameterBounds;
use crate::config::limits::JointConfig;
use crate::parameters::{Friction, Parameters, PidGains, TableOf};

/// Constants that the build script has generated.
#[allow(clippy::excessive_precision)]
mod arm {
    use super::*;
    include!(concat!(env!("OUT_DIR"), "/default_arm.rs"));
}

pub(crate) use arm::{MODEL, NAME, PID, POLYNOMIAL};

/// Returns the default friction table of joint `j`.
pub(crate) fn friction_table(j: usize) -> &'static TableOf<f32> {
    // If the arm file contains a single table, this table applies to all joints.
    arm::TABLES.get(j).unwrap_or(&arm::TABLES[0])
}

impl Config {
    /// Returns the settings of the default arm.
    pub const fn avena() -> Self {
        Self {
            joints: arm::JOINT_CONFIG,
            gravity: arm::GRAVITY,
            gripper: true,
            pump_off_on_error: true,
            velocity_full_scale: 2.0,
            drive_speed_trip: 1.8,
            drive_speed_window_ms: 10,
            gear_stiffness: 10_000.0,
            encoder_step: core::f64::consts::TAU / 65_536.0,
            delay_ticks: 2,
            joint_config_bits: 0x17,
            gripper_config_bits: 0x04,
            status_period_ms: 40,
            missed_moves_max: 5,
            node_boot_ms: 2_000,
            enable_timeout_ms: 10_000,
            enable_speed_max: 0.25,
            enable_still_ms: 50,
            enable_rest_ms: 400,
            start_tolerance_rad: 0.02,
            ramp_ms: 200,
            stop_ms: 500,
            braking_ms_max: 1_000,
            overspeed_factor: 1.2,
            overspeed_ms: 5,
            yield_torque_share: 0.3,
            torque_over_ms: 10,
            torque_release: false,
            protective_stop_latches: true,
            catch_ms_max: 1_000,
            blend_ms: 100,
            teach_stiction: 0.03,
            teach_friction: 0.5,
            tool_speed_max: 0.0,
            safety_input_ramp_ms: 0,
            friction_sign_width: 0.02,
            host_timeout_ms: 0,
            speed: 1.0,
            absent: [false; crate::JOINTS],
            absent_position: [0.0; crate::JOINTS],
            payload: Payload::NONE,
            parameter_bounds: ParameterBounds::known_drives(),
        }
    }
}

// The drives of the built-in arm must support its limits.
const _: () = assert!(Config::avena().check().is_ok());

impl Default for Config {
    fn default() -> Self {
        Self::avena()
    }
}

impl Parameters {
    /// Returns the parameters of the default arm, with the friction polynomial.
    pub const fn avena() -> Self {
        Self { model: MODEL, pid: PID, friction: Friction::Polynomial(POLYNOMIAL) }
    }

    /// Returns the default friction tables.
    pub fn avena_friction_table() -> Friction {
        Friction::Table(core::array::from_fn(|j| *friction_table(j)))
    }
}
