//! Joint bus of the controller: the CAN FD frames between it and its drives, both ways, without any I/O.
//!
//! Each millisecond the controller sends at most one [`Request`]; the nodes (joints 0..5, gripper 6) reply
//! with an [`Answer`] each. Both are made from and into a [`Frame`], so either end can be
//! simulated or replaced.
//!
//! ```
//! use jtc_bus::{Answer, JointReport, Request, Scale};
//!
//! let request = Request::Move { torque: [1.0, -2.0, 0.0, 0.0, 0.0, 1e9], pump: false };
//! let frame = request.emit();
//! assert_eq!((frame.id, frame.data().len()), (0x000, 16));
//! // Values saturate: 1e9 N·m is the full scale on the wire, never something of another sign.
//! assert_eq!(frame.data()[10..12], [0x7F, 0xFF]);
//!
//! let scale = Scale { velocity: 2.0 };
//! let report = JointReport { position: 0.5, ..JointReport::default() };
//! let answer = Answer::Joint { node: 2, report }.emit(scale);
//! assert_eq!(answer.id, 0x202);
//! assert!(matches!(Answer::parse(&answer, scale), Ok(Answer::Joint { node: 2, .. })));
//! ```
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
mod request;
mod scale;
mod state;
pub mod timing;

pub use answer::{Answer, GripperReport, JointReport};
pub use bits::{Bits, config, error, motor_control, warning};
pub use display::Decoded;
pub use duration::duration_ns;
pub use frame::{Format, Frame, FrameError, MAX_LEN};
pub use request::{Request, Target};
pub use scale::{POSITION_FULL_SCALE, Scale, TORQUE_FULL_SCALE};
pub use state::fsm;

/// Joints on the bus, nodes 0..5.
pub const JOINTS: usize = 6;
/// Node number of the gripper.
pub const GRIPPER: usize = 6;
/// Joints and gripper.
pub const NODES: usize = 7;
