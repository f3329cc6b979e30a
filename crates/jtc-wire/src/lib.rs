#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "fuzzing"))]
extern crate std;

#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;

mod batch;
mod bits;
mod code;
mod command;
mod crc;
mod describe;
mod encode;
mod encode_error;
mod event;
mod extension;
pub mod fixed;
mod floats;
mod frame;
mod layout;
mod receive;
mod response;
mod segment;
mod state;
mod status;
mod stream;
mod urgent;
pub mod words;

pub use batch::{EVENTS_MAX, EventBatch};
pub use bits::{can_flag, error, joint_error, missing_parameter};
pub use code::{Code, Known};
pub use command::{ALL_NODES, Command, ExecCommand};
pub use crc::{crc16, crc16_update};
pub use describe::{Described, Piece, Pieces, pieces};
pub use encode::{
    FrictionTable, arm_model, floats, friction_polynomial, friction_table, pid_param, set_settings,
    trajectory,
};
pub use encode_error::{Channel, EncodeError, FloatName, OutOfScale};
pub use event::{LinkEvent, ReceivedEvent};
/// The states of the drives and the gripper in a status are the states that the joint bus defines.
pub use jtc_bus::{Joint, NodeState};

pub use extension::{
    Answer, ArmImage, BootCause, EXTENSION_VERSION, FrictionImage, Hash, IMAGE_MAX, INFO_WRITTEN, Info,
    LOG_NO_BLOCK, LOG_PAGE, LogPage, LogState, NAME_LEN, Name, PAGE_BYTES, PAGE_POINTS, PAGE_VALUES, Points,
    Program, Reactions, SIMULATOR, SettingValue, StopCause, StopKind, StoreState, Values, capability,
};
pub use floats::Floats;
pub use frame::{
    FRAME_MAX, FRAME_MIN, FRAME_POINTS_MAX, FrameRef, FrameType, HEADER, JOINTS, Lengths, POINT_LEN,
    TRAJECTORY_OVERHEAD,
};
pub use layout::{ANSWER_MAX, SET_VALUES_MAX, VALUE_LEN};
pub use receive::{FromDevice, StatusCounters, StatusReceiver};
pub use response::{DataStatus, FrameStatus, Response};
pub use segment::{ACCELERATION_SCALE, POSITION_SCALE, RAW_FULL_SCALE, RawPoint, Segment, VELOCITY_SCALE};
pub use state::{ControllerState, TrajectoryState};
pub use status::{
    GripperStatus, JointStatus, STATUS_LEN, STATUS_LEN_NO_GRIPPER, STATUS_LEN_SHORT_INDEX, Status,
};
pub use stream::{KNOWN_US, Receiver};
pub use urgent::{UrgentCommand, UrgentCommands, UrgentWatch};

/// Byte ranges of the parts of each frame. Each range is defined once.
pub mod field {
    pub use crate::command::field as command;
    pub use crate::extension::image_field as image;
    pub use crate::frame::field as frame;
    pub use crate::segment::field as segment;
    pub use crate::status::field as status;
}
