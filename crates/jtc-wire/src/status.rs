//! JtcStatus: the report that the controller sends to the hosts 25 times per second.
use jtc_bus::NodeState;

use crate::code::Code;
use crate::crc16;
use crate::frame::{FrameType, HEADER, JOINTS, field as frame_field};
use crate::response::{DataStatus, FrameStatus, Response};
use crate::state::{ControllerState, TrajectoryState};

/// Length of JtcStatus, bytes.
pub const STATUS_LEN: usize = 175;
/// Length of JtcStatus in the layout with a u16 point index, bytes (J-08).
pub const STATUS_LEN_SHORT_INDEX: usize = 173;
/// Length of JtcStatus in the layout without a gripper, bytes (J-08).
pub const STATUS_LEN_NO_GRIPPER: usize = 165;

/// Positions of the parts of the 175-byte JtcStatus frame.
///
/// The 165-byte layout ends after the joints. In the 173-byte layout the point index has two bytes, so all later parts are two bytes
/// nearer to the start.
pub mod field {
    use core::ops::Range;

    /// Response record: type of the frame to which the record belongs.
    pub const RESPONSE_TYPE: usize = 4;
    /// Response record: status code.
    pub const RESPONSE_STATUS: usize = 5;
    /// Response record: data status code.
    pub const RESPONSE_DATA: usize = 6;
    /// Response record: number of received bytes, as a u16.
    pub const RESPONSE_LENGTH: Range<usize> = 7..9;
    /// State of the controller.
    pub const FSM: usize = 9;
    /// Current errors, u16.
    pub const ERRORS: Range<usize> = 10..12;
    /// Occurred errors, u16.
    pub const OCCURRED: Range<usize> = 12..14;
    /// Bits of the parameters that the controller has not received yet.
    pub const JTC_INIT: usize = 14;
    /// Bits of the nodes that are not ready yet.
    pub const NODE_INIT: usize = 15;
    /// Trajectory execution state.
    pub const TES: usize = 16;
    /// Index of the current point, counted as if the points were 1 ms apart, as a u32.
    pub const POINT: Range<usize> = 17..21;
    /// Friction type.
    pub const FRICTION_TYPE: usize = 21;
    /// CAN error: 0 no error, 1 error.
    pub const CAN_ERROR: usize = 22;
    /// Current CAN flags, as a u32.
    pub const CAN_CURRENT: Range<usize> = 23..27;
    /// Occurred CAN flags, as a u32.
    pub const CAN_OCCURRED: Range<usize> = 27..31;
    /// First byte of joint 0. Each joint has [`JOINT_LEN`] bytes.
    pub const JOINTS: usize = 31;
    /// Length of the part for one joint, bytes.
    pub const JOINT_LEN: usize = 22;
    /// Gripper: state, pump, pressure 1, pressure 2, errors, warnings, four zeros.
    pub const GRIPPER: Range<usize> = 163..173;
    /// CRC of the frame.
    pub const CRC: Range<usize> = 173..175;

    /// Positions of the parts of a joint, counted from the first byte of the joint.
    pub mod joint {
        use super::Range;

        /// State of the drive.
        pub const FSM: usize = 0;
        /// Current motor-control faults of the drive.
        pub const MC_CURRENT: usize = 1;
        /// Occurred motor-control faults of the drive.
        pub const MC_OCCURRED: usize = 2;
        /// Errors of the drive.
        pub const ERRORS: usize = 3;
        /// Warnings of the drive.
        pub const WARNINGS: usize = 4;
        /// Joint errors found by the controller, a u16.
        pub const INTERNAL: Range<usize> = 5..7;
        /// Occurred joint errors found by the controller, a u16.
        pub const INTERNAL_OCCURRED: Range<usize> = 7..9;
        /// Measured position of the joint, rad, f32.
        pub const POSITION: Range<usize> = 9..13;
        /// Measured velocity of the joint, rad/s, f32.
        pub const VELOCITY: Range<usize> = 13..17;
        /// Torque that the drive reports, N·m, f32.
        pub const TORQUE: Range<usize> = 17..21;
        /// Bearing temperature, °C.
        pub const TEMPERATURE: usize = 21;
    }
}

/// JtcStatus (section 2). The device uses `emit`, and the host uses `parse` (165, 173 and 175 bytes, J-08).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Status {
    /// Response record of a received frame, or an empty record.
    pub response: Response,
    /// State of the controller.
    pub state: Code<ControllerState>,
    /// Current errors: bits of [`crate::error`].
    pub errors: u16,
    /// Occurred errors: bits of [`crate::error`].
    pub occurred: u16,
    /// Missing parameters: bits of [`crate::missing_parameter`].
    pub jtc_init: u8,
    /// Nodes that are not ready: bits of [`crate::words::NODES`].
    pub node_init: u8,
    /// State of the trajectory.
    pub trajectory: Code<TrajectoryState>,
    /// Index of the current point, counted as if the points were 1 ms apart.
    pub point: u32,
    /// Kind of friction: 0 polynomial, 1 table.
    pub friction_type: u8,
    /// CAN error: 0 no error, 1 error.
    pub can_error: u8,
    /// Current CAN flags: bits of [`crate::can_flag`].
    pub can_current: u32,
    /// Occurred CAN flags: bits of [`crate::can_flag`].
    pub can_occurred: u32,
    /// Statuses of the joints 0..5.
    pub joints: [JointStatus; JOINTS],
    /// State of the gripper; `None` in the 165-byte layout.
    pub gripper: Option<GripperStatus>,
}

/// State and errors of a joint in JtcStatus.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct JointStatus {
    /// State of the drive.
    pub state: NodeState,
    /// Current motor-control faults: bits of [`jtc_bus::motor_control`].
    pub mc_current: u8,
    /// Occurred motor-control faults: bits of [`jtc_bus::motor_control`].
    pub mc_occurred: u8,
    /// Errors of the drive: bits of [`jtc_bus::error`].
    pub errors: u8,
    /// Warnings of the drive: bits of [`jtc_bus::warning`].
    pub warnings: u8,
    /// Joint errors found by the controller: bits of [`crate::joint_error`].
    pub internal: u16,
    /// Occurred joint errors found by the controller: bits of [`crate::joint_error`].
    pub internal_occurred: u16,
    /// Measured position of the joint, rad.
    pub position: f32,
    /// Measured velocity of the joint, rad/s.
    pub velocity: f32,
    /// Torque that the drive reports, N·m.
    pub torque: f32,
    /// Bearing temperature, °C.
    pub temperature: u8,
}

/// State and errors of the gripper in JtcStatus.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct GripperStatus {
    /// State of the gripper.
    pub state: NodeState,
    /// State of the pump: 0 off, 1 on.
    pub pump: u8,
    /// Flag for the first pressure level: 1 if this level is reached.
    pub pressure1: u8,
    /// Flag for the second pressure level: 1 if this level is reached.
    pub pressure2: u8,
    /// Errors of the gripper: bits of [`jtc_bus::error`].
    pub errors: u8,
    /// Warnings of the gripper: bits of [`jtc_bus::warning`].
    pub warnings: u8,
}

/// Returns `N` bytes of `bytes` from position `at` on; bytes after the end are zero. Callers never read after the end.
fn get<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes.get(at..).and_then(|rest| rest.first_chunk::<N>()).copied().unwrap_or([0; N])
}

impl JointStatus {
    fn emit(&self, b: &mut [u8; field::JOINT_LEN]) {
        use field::joint::*;
        b[FSM] = self.state.code();
        b[MC_CURRENT] = self.mc_current;
        b[MC_OCCURRED] = self.mc_occurred;
        b[ERRORS] = self.errors;
        b[WARNINGS] = self.warnings;
        b[INTERNAL].copy_from_slice(&self.internal.to_be_bytes());
        b[INTERNAL_OCCURRED].copy_from_slice(&self.internal_occurred.to_be_bytes());
        b[POSITION].copy_from_slice(&self.position.to_be_bytes());
        b[VELOCITY].copy_from_slice(&self.velocity.to_be_bytes());
        b[TORQUE].copy_from_slice(&self.torque.to_be_bytes());
        b[TEMPERATURE] = self.temperature;
    }

    fn parse(b: &[u8; field::JOINT_LEN]) -> Self {
        use field::joint::*;
        Self {
            state: NodeState::new(b[FSM]),
            mc_current: b[MC_CURRENT],
            mc_occurred: b[MC_OCCURRED],
            errors: b[ERRORS],
            warnings: b[WARNINGS],
            internal: u16::from_be_bytes(get(b, INTERNAL.start)),
            internal_occurred: u16::from_be_bytes(get(b, INTERNAL_OCCURRED.start)),
            position: f32::from_be_bytes(get(b, POSITION.start)),
            velocity: f32::from_be_bytes(get(b, VELOCITY.start)),
            torque: f32::from_be_bytes(get(b, TORQUE.start)),
            temperature: b[TEMPERATURE],
        }
    }
}

impl Status {
    /// Returns the 175-byte frame, including the CRC. Without a gripper, the bytes of the gripper are zero.
    pub fn emit(&self) -> [u8; STATUS_LEN] {
        let mut frame = [0; STATUS_LEN];
        self.emit_to(&mut frame);
        frame
    }

    /// Like [`emit`](Self::emit), but writes the frame into the array `b`.
    pub fn emit_to(&self, b: &mut [u8; STATUS_LEN]) {
        use field::*;
        b[frame_field::HEADER] = HEADER;
        b[frame_field::TYPE] = FrameType::JtcStatus as u8;
        b[frame_field::LENGTH].copy_from_slice(&(STATUS_LEN as u16).to_be_bytes());
        b[RESPONSE_TYPE] = self.response.frame_type;
        b[RESPONSE_STATUS] = self.response.status as u8;
        b[RESPONSE_DATA] = self.response.data as u8;
        b[RESPONSE_LENGTH].copy_from_slice(&self.response.length.to_be_bytes());
        b[FSM] = self.state.byte();
        b[ERRORS].copy_from_slice(&self.errors.to_be_bytes());
        b[OCCURRED].copy_from_slice(&self.occurred.to_be_bytes());
        b[JTC_INIT] = self.jtc_init;
        b[NODE_INIT] = self.node_init;
        b[TES] = self.trajectory.byte();
        b[POINT].copy_from_slice(&self.point.to_be_bytes());
        b[FRICTION_TYPE] = self.friction_type;
        b[CAN_ERROR] = self.can_error;
        b[CAN_CURRENT].copy_from_slice(&self.can_current.to_be_bytes());
        b[CAN_OCCURRED].copy_from_slice(&self.can_occurred.to_be_bytes());
        for (to, joint) in b[JOINTS..GRIPPER.start].as_chunks_mut().0.iter_mut().zip(&self.joints) {
            joint.emit(to);
        }
        let g = self.gripper.unwrap_or_default();
        b[GRIPPER][..6].copy_from_slice(&[
            g.state.code(),
            g.pump,
            g.pressure1,
            g.pressure2,
            g.errors,
            g.warnings,
        ]);
        b[GRIPPER][6..].fill(0);
        let crc = crc16(&b[..CRC.start]);
        b[CRC].copy_from_slice(&crc.to_be_bytes());
    }

    /// Parses a complete frame of 165, 173 or 175 bytes. Returns `None` if the type, length or CRC is wrong.
    ///
    /// If this version does not know a code in the response record, the record gets the status Idle and does not
    /// confirm a frame.
    pub fn parse(bytes: &[u8]) -> Option<Status> {
        let frame = crate::FrameRef::new_checked(bytes)?;
        if frame.frame_type != FrameType::JtcStatus {
            return None;
        }
        let short_index = bytes.len() == STATUS_LEN_SHORT_INDEX;
        // Returns the position of a byte that follows the point index.
        let late = |at: usize| if short_index { at - 2 } else { at };
        let byte = |at: usize| get::<1>(bytes, at)[0];
        let response = match (
            FrameStatus::from_byte(byte(field::RESPONSE_STATUS)),
            DataStatus::from_byte(byte(field::RESPONSE_DATA)),
        ) {
            (Some(status), Some(data)) => Response {
                frame_type: byte(field::RESPONSE_TYPE),
                status,
                data,
                length: u16::from_be_bytes(get(bytes, field::RESPONSE_LENGTH.start)),
            },
            _ => Response::default(),
        };
        let point = field::POINT.start;
        let gripper = (bytes.len() != STATUS_LEN_NO_GRIPPER).then(|| {
            let [state, pump, pressure1, pressure2, errors, warnings] =
                get(bytes, late(field::GRIPPER.start));
            GripperStatus { state: NodeState::new(state), pump, pressure1, pressure2, errors, warnings }
        });
        Some(Status {
            response,
            state: Code::new(byte(field::FSM)),
            errors: u16::from_be_bytes(get(bytes, field::ERRORS.start)),
            occurred: u16::from_be_bytes(get(bytes, field::OCCURRED.start)),
            jtc_init: byte(field::JTC_INIT),
            node_init: byte(field::NODE_INIT),
            trajectory: Code::new(byte(field::TES)),
            point: if short_index {
                u16::from_be_bytes(get(bytes, point)).into()
            } else {
                u32::from_be_bytes(get(bytes, point))
            },
            friction_type: byte(late(field::FRICTION_TYPE)),
            can_error: byte(late(field::CAN_ERROR)),
            can_current: u32::from_be_bytes(get(bytes, late(field::CAN_CURRENT.start))),
            can_occurred: u32::from_be_bytes(get(bytes, late(field::CAN_OCCURRED.start))),
            joints: core::array::from_fn(|j| {
                JointStatus::parse(&get(bytes, late(field::JOINTS + j * field::JOINT_LEN)))
            }),
            gripper,
        })
    }

    /// Replaces the response record in the bytes of a valid status of any layout. A program that forwards a status to several hosts calls
    /// this function. Returns false and changes nothing if the bytes are not a valid status.
    pub fn replace_response(bytes: &mut [u8], response: &Response) -> bool {
        use field::*;
        let status = |frame: crate::FrameRef<'_>| frame.frame_type == FrameType::JtcStatus;
        if !crate::FrameRef::new_checked(bytes).is_some_and(status) {
            return false;
        }
        bytes[RESPONSE_TYPE] = response.frame_type;
        bytes[RESPONSE_STATUS] = response.status as u8;
        bytes[RESPONSE_DATA] = response.data as u8;
        bytes[RESPONSE_LENGTH].copy_from_slice(&response.length.to_be_bytes());
        let crc = crc16(&bytes[..bytes.len() - frame_field::CRC_LEN]);
        let end = bytes.len() - frame_field::CRC_LEN;
        bytes[end..].copy_from_slice(&crc.to_be_bytes());
        true
    }

    /// Returns true in Start and Init. In these states the controller does not hold the arm yet.
    pub fn is_coming_up(&self) -> bool {
        self.state.is_in(&[ControllerState::Start, ControllerState::Init])
    }

    /// Returns true in a held stop (J-69). The controller holds the arm under torque or brings it to rest. The arm does not move again
    /// until the host has cleared the cause that the joints report.
    pub fn is_held_stop(&self) -> bool {
        self.errors == crate::error::INTERNAL_JOINTS && self.state != ControllerState::Error
    }

    /// Returns true if the controller is in Error, or reports an error that is not the cause of a held stop.
    pub fn is_faulty(&self) -> bool {
        (self.errors != 0 || self.state == ControllerState::Error) && !self.is_held_stop()
    }

    /// Returns true while the arm follows its trajectory or decelerates on it.
    pub fn is_executing(&self) -> bool {
        self.trajectory == TrajectoryState::Execute
    }

    /// Returns the measured positions of the joints in the frame, rad. For an unknown position, the function returns 0.
    pub fn positions(&self) -> [f64; JOINTS] {
        self.joints.map(|joint| f64::from(joint.position))
    }

    /// Returns the response record of the status, or `None` if the status contains no response.
    pub fn response(&self) -> Option<Response> {
        (!self.response.is_idle()).then_some(self.response)
    }
}
