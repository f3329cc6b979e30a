#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod catch;
pub mod check;
mod config;
mod controller;
mod deceleration;
mod defaults;
mod errors;
mod execution;
pub mod friction;
mod host;
mod interpolation;
mod io;
mod late;
mod limits;
mod motion;
mod nodes;
mod overspeed;
mod parameters;
mod path;
mod pid;
mod reaction;
mod report;
mod response_queue;
mod store;
mod teach;
mod telemetry;

pub use check::{TrajectoryCheck, Violation};
pub use config::{Config, ConfigError, Friction, JointConfig, Parameters, PidGains, TableOf, WORKING_AREA};
pub use controller::Controller;
pub use interpolation::{SetPoint, interpolate, position_speed};
pub use io::{BusState, HostEvent, Inputs, Outputs};
pub use jtc_wire::{ControllerState, TrajectoryState};
pub use parameters::{OutOfBounds, ParameterBounds};
pub use response_queue::{HOST_LINES, RECORDS_MAX};
pub use telemetry::{JointTelemetry, Telemetry};

/// Joints of the arm.
pub const JOINTS: usize = 6;
/// Joints and gripper.
pub const NODES: usize = 7;
/// Points that the trajectory store holds (J-30).
pub const POINTS_MAX: usize = 12_000;
/// Segments of a trajectory (J-30).
pub const SEGMENTS_MAX: usize = 100;
/// Points of a segment (J-30).
pub const SEGMENT_POINTS_MAX: usize = 1_500;

/// Bits of the controller's error words.
pub mod error {
    /// Safety input low.
    pub const EMERGENCY_INPUT: u16 = 1 << 0;
    /// Safety output held at 0 by an internal error.
    pub const EMERGENCY_OUTPUT: u16 = 1 << 1;
    /// Any internal error.
    pub const INTERNAL: u16 = 1 << 2;
    /// Any external error.
    pub const EXTERNAL: u16 = 1 << 3;
    /// A joint's internal error.
    pub const INTERNAL_JOINTS: u16 = 1 << 4;
    /// CAN timeout or bus-off.
    pub const INTERNAL_CAN: u16 = 1 << 5;
    /// Host link (not used by this controller: a silent host is no error).
    pub const INTERNAL_COM: u16 = 1 << 6;
    /// A node reports an error or misbehaves.
    pub const EXTERNAL_JOINTS: u16 = 1 << 7;
}

/// Bits of a joint's internal error word.
pub mod joint_error {
    /// Set position over limit.
    pub const POSITION: u16 = 1 << 0;
    /// Set velocity over limit, or measured speed over its own (J-35).
    pub const VELOCITY: u16 = 1 << 1;
    /// Set acceleration over limit.
    pub const ACCELERATION: u16 = 1 << 2;
    /// Computed torque over limit.
    pub const TORQUE: u16 = 1 << 3;
    /// Position error over limit.
    pub const POSITION_ERROR: u16 = 1 << 4;
    /// No friction table value.
    pub const FRICTION_TABLE: u16 = 1 << 5;
}
