#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod bit_codec;
mod commanded;
mod config;
mod controller;
#[cfg(test)]
mod docs_check;
mod errors;
mod execution;
mod extension;
pub mod friction;
mod gains;
mod host;
mod host_parameters;
mod interpolation;
mod io;
mod last_stop;
mod motion;
mod nodes;
mod parameters;
mod reaction;
pub mod recorder;
mod report;
mod response_queue;
mod safety_input;
pub mod settings;
pub mod slots;
mod states;
mod telemetry;
mod tick;
mod tick_overruns;
mod trajectory;

pub use config::bounds::{OutOfBounds, ParameterBounds};
pub use config::limits::JointConfig;
pub use config::{Config, ConfigError, WORKING_AREA};
pub use controller::Controller;
pub use extension::{Identity, firmware_hash};
pub use gains::{inertia_needed, least_felt_inertia};
pub use interpolation::{SetPoint, interpolate, position_speed};
pub use io::{BusState, HostEvent, Inputs, Outputs};
pub use jtc_dynamics::Payload;
pub use jtc_wire::{ControllerState, TrajectoryState, error, joint_error};
pub use parameters::{Friction, Parameters, PidGains, TableOf};
pub use response_queue::{HOST_LINES, RECORDS_MAX};
pub use telemetry::{JointTelemetry, Telemetry};
pub use trajectory::check::{self, PathRange, TrajectoryCheck, Violation};

/// Number of joints of the arm.
pub const JOINTS: usize = 6;
/// Number of nodes: the joints and the gripper.
pub const NODES: usize = 7;
/// Highest number of points in the trajectory store (J-30).
pub const POINTS_MAX: usize = 12_000;
/// Highest number of segments of a trajectory (J-30).
pub const SEGMENTS_MAX: usize = 100;
/// Highest number of points of a segment (J-30).
pub const SEGMENT_POINTS_MAX: usize = 1_500;

/// Length of a tick, s.
pub(crate) const DT: f64 = 0.001;
