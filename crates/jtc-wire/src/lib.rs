//! Host link of the controller: frames both ways, CRC, stream parser. No I/O.
//!
//! A *frame* is `9B type length body crc`, described in `frame.rs` and, for the two long bodies, in `segment.rs` and
//! `status.rs`; [`field`] names every byte once. Both ends are here:
//!
//! | | device | host |
//! |---|---|---|
//! | bytes → frames | [`Receiver`], ahead of it [`UrgentWatch`], behind it [`EventBatch`] | [`StatusReceiver`] |
//! | frames → meaning | [`Command::parse`] | [`Status::parse`] |
//! | meaning → frames | [`Status::emit`] | [`Command::emit`], [`trajectory`], [`pid_param`], …, constants in [`fixed`] |
//! | in words | | `Display` of all of these, [`Described`], [`words`] |
//!
//! Time comes in as a number of µs, memory from the caller; nothing here allocates or panics on input.
//!
//! ```
//! use jtc_wire::{Command, LinkEvent, RawPoint, Receiver, trajectory};
//!
//! // The host says something,
//! let point = RawPoint::from_si(&[0.5; 6], &[0.0; 6], &[0.0; 6])?;
//! let mut frame = [0; 100];
//! let n = trajectory(&mut frame, (0, 0, 1), 10, [point])?;
//!
//! // the device understands it.
//! let mut receiver = Receiver::new([0; jtc_wire::FRAME_MAX], 5000);
//! assert_eq!(receiver.push(0, &frame[..n]), n);
//! assert!(receiver.poll(0));
//! if let Some(LinkEvent::Frame(frame)) = receiver.event() {
//!     let Ok(Command::Trajectory(segment)) = Command::parse(frame) else { panic!() };
//!     assert_eq!(segment.point(0), Some(point));
//! }
//! receiver.release();
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "fuzzing"))]
extern crate std;

#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;

mod batch;
mod code;
mod command;
mod crc;
mod describe;
mod encode;
pub mod fixed;
mod frame;
mod receive;
mod response;
mod segment;
mod state;
mod status;
mod stream;
mod urgent;
pub mod words;

pub use batch::{EVENTS_MAX, EventBatch, ReceivedEvent};
pub use code::{Code, Known};
pub use command::{ALL_NODES, Command, ExecCommand, Floats};
pub use crc::{crc16, crc16_update};
pub use describe::{Described, Piece, Pieces, pieces};
pub use encode::{
    Channel, EncodeError, FloatName, FrictionTable, OutOfScale, arm_model, floats, friction_polynomial,
    friction_table, pid_param, trajectory,
};
pub use frame::{
    FRAME_MAX, FRAME_MIN, FRAME_POINTS_MAX, FrameRef, FrameType, HEADER, JOINTS, Lengths, POINT_LEN,
    TRAJECTORY_OVERHEAD,
};
pub use receive::{StatusCounters, StatusReceiver};
pub use response::{DataStatus, FrameStatus, Response};
pub use segment::{ACCELERATION_SCALE, POSITION_SCALE, RAW_FULL_SCALE, RawPoint, Segment, VELOCITY_SCALE};
pub use state::{ControllerState, TrajectoryState};
pub use status::{
    GripperStatus, JointStatus, STATUS_LEN, STATUS_LEN_NO_GRIPPER, STATUS_LEN_SHORT_INDEX, Status,
};
pub use stream::{LinkEvent, Receiver};
pub use urgent::{UrgentCommand, UrgentCommands, UrgentWatch};

/// Where each part of a frame is: byte ranges, named once.
pub mod field {
    pub use crate::command::field as command;
    pub use crate::frame::field as frame;
    pub use crate::segment::field as segment;
    pub use crate::status::field as status;
}
