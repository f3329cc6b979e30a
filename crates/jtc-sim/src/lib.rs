//! The physical world around the controller, in virtual time: a six-axis arm with friction, drives, gripper,
//! joint bus, serial line, and everything that can go wrong with them. The controller inside is the very code
//! of the board.
//!
//! One [`World::step`] is one millisecond of everything, always in the same order: host bytes reach the
//! parser, the controller ticks, its frame goes over the bus and is answered, drives do their millisecond,
//! the arm moves. The same seed gives the same bytes.
//!
//! What is kinder than reality: by default each joint has a holding brake that is open only while its drive is
//! enabled ([`Support`]), so that the arm can be used again after an error; the drives' motor alignment moves
//! nothing; frames take their usual time on the bus, not their exact one.
//!
//! ```no_run
//! use jtc_sim::{SimConfig, World};
//!
//! let mut world = World::new(SimConfig::default());
//! world.host_write(&[0x9B, 0x02, 0x00, 0x06, 0xD6, 0x26]);
//! for _ in 0..1000 {
//!     world.step();
//! }
//! println!("{:?} after {} µs", world.telemetry().state, world.now_us());
//! ```
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
pub mod invariants;
pub mod lowering;
pub mod matrix;
mod operator;
mod plant;
mod request;
mod serial;
pub mod soak;
mod tap;
mod typed;
mod world;

pub use arm::{Arm, SimArm};
pub use board::Worked;
pub use bus::{BusFault, BusStatistics, TimedFrame, frame_us};
pub use config::{ModelError, SimConfig, Support};
pub use drive::{Drive, DriveConfig, DriveFault};
pub use event::{Event, Log, LogEntry};
pub use fault_file::{FAULT_FILE_HELP, FaultFileError};
pub use faults::{Fault, FaultKind, FaultPlan, Trigger};
pub use friction::{FrictionModel, LuGre, SimFriction};
pub use gripper::Gripper;
pub use hand::HandPath;
pub use operator::{Operator, OperatorError};
pub use plant::{Plant, ReadyAnswer};
pub use request::NodeRequest;
pub use serial::{Line, LineFault};
pub use tap::BusTap;
pub use typed::{TYPED_EVENTS_HELP, TypedEvent, TypedEventError};
pub use world::{Statistics, Truth, World};
