#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

mod answer;
mod bits;
mod display;
mod duration;
mod frame;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
pub mod id;
mod joint;
mod request;
mod scale;
mod state;
pub mod timing;

pub use answer::{Answer, GripperReport, JointReport};
pub use bits::{Bits, config, error, motor_control, warning};
pub use display::Decoded;
pub use duration::duration_ns;
pub use frame::{Format, Frame, FrameError, MAX_LEN};
pub use joint::Joint;
pub use request::{Request, Target};
pub use scale::{DRIVE_TORQUE_MAX, POSITION_FULL_SCALE, Scale, TORQUE_FULL_SCALE};
pub use state::NodeState;

/// Number of joints on the bus (nodes 0..5).
pub const JOINTS: usize = 6;
/// Node number of the gripper.
pub const GRIPPER: usize = 6;
/// Number of joints plus the gripper.
pub const NODES: usize = 7;
