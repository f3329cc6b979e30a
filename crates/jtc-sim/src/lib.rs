#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod arm;
mod board;
mod bus;
mod config;
mod drive;
mod event;
mod fault_file;
mod faults;
mod friction;
mod gripper;
mod hand;
pub mod host;
mod inbox;
mod jitter;
mod operator;
mod plant;
mod request;
mod serial;
mod tap;
mod typed;
mod world;

pub use arm::{Arm, Gear, Side, SimArm, Wall};
pub use board::{Board, Pins, RECORDER_BLOCKS, SimRecorder, Worked};
pub use bus::{Bus, BusFault, BusStatistics, TimedFrame, frame_us};
pub use config::{ModelError, SimConfig, Support};
pub use drive::{Drive, DriveConfig, DriveFault, EncoderPlace};
pub use event::{Event, Log, LogEntry};
pub use fault_file::{FAULT_FILE_HELP, FaultFileError};
pub use faults::{Fault, FaultKind, FaultPlan, Trigger};
pub use friction::{FrictionModel, LuGre, SimFriction};
pub use gripper::Gripper;
pub use hand::HandPath;
pub use jitter::Jitter;
pub use operator::{Operator, OperatorError};
pub use plant::{Plant, ReadyAnswer, Truth};
pub use request::NodeRequest;
pub use serial::{Line, LineFault};
pub use tap::BusTap;
pub use typed::{PUSH_MAX, TYPED_EVENTS_HELP, TypedEvent, TypedEventError};
pub use world::{Exchange, Moment, Statistics, World};
