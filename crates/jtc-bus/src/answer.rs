//! Frames that nodes send. See [`Answer`].

use crate::frame::{Frame, FrameError};
use crate::scale::{POSITION_FULL_SCALE, Scale, TORQUE_FULL_SCALE, from_i16, from_i32, to_i16, to_i32};
use crate::{GRIPPER, NODES, NodeState, id};

/// Byte offsets in the payloads of answers to Move.
mod field {
    /// Position, i32.
    pub(super) const POSITION: usize = 0;
    /// Velocity, i16.
    pub(super) const VELOCITY: usize = 4;
    /// Torque, i16.
    pub(super) const TORQUE: usize = 6;
    pub(super) const BEARING_TEMPERATURE: usize = 8;
    pub(super) const FSM: usize = 9;
    pub(super) const MC_CURRENT: usize = 10;
    pub(super) const MC_OCCURRED: usize = 11;
    pub(super) const ERRORS: usize = 12;
    pub(super) const WARNINGS: usize = 13;
    /// Motor temperature, which is present only in payloads of 20 bytes.
    pub(super) const MOTOR_TEMPERATURE: usize = 16;
    pub(super) const PUMP: usize = 0;
    pub(super) const PRESSURE1: usize = 1;
    pub(super) const PRESSURE2: usize = 2;
    pub(super) const SHORT_LEN: usize = 16;
    pub(super) const LONG_LEN: usize = 20;
}

/// Answer of a joint to Move (0x200+n), with 16 bytes, or 20 bytes from new drives.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct JointReport {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
    /// Torque, N·m, with the sign convention of the commanded torque (J-16).
    pub torque: f64,
    /// Bearing temperature, °C.
    pub temperature: u8,
    /// State byte of the node.
    pub state: NodeState,
    /// Present motor-control faults.
    pub mc_current: u8,
    /// Motor-control faults that have occurred since the last acknowledgement.
    pub mc_occurred: u8,
    /// Error bits.
    pub errors: u8,
    /// Warning bits.
    pub warnings: u8,
    /// Motor temperature, °C, if the answer has 20 bytes.
    pub motor_temperature: Option<u8>,
}

/// Answer of the gripper to Move (0x206).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct GripperReport {
    /// Measured state of the pump; `true` if the pump is running.
    pub pump: bool,
    /// `true` if the first vacuum level is reached.
    pub pressure1: bool,
    /// `true` if the second vacuum level is reached.
    pub pressure2: bool,
    /// State byte of the node.
    pub state: NodeState,
    /// Error bits of the gripper.
    pub errors: u8,
    /// Warning bits of the gripper.
    pub warnings: u8,
}

/// Answer of a node. The controller uses `parse`, and nodes use `emit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// Answer of a joint to Move, 0x200+n.
    Joint {
        /// Node number, 0..5.
        node: u8,
        /// Decoded report of the joint.
        report: JointReport,
    },
    /// Answer of the gripper to Move, 0x206.
    Gripper(GripperReport),
    /// Answer to ChangeFsm, 0x210+n.
    State {
        /// Node number, 0..6.
        node: u8,
        /// State byte at the time when the request was received.
        state: NodeState,
    },
    /// Answer to ChangeMode, 0x2F0+n.
    Mode {
        /// Node number, 0..6.
        node: u8,
        /// `true` if the node has accepted the configuration.
        accepted: bool,
    },
}

impl Answer {
    /// Returns the number of the node that answered, 0..6.
    pub const fn node(&self) -> u8 {
        match self {
            Self::Joint { node, .. } | Self::State { node, .. } | Self::Mode { node, .. } => *node,
            Self::Gripper(_) => GRIPPER as u8,
        }
    }

    /// Decodes the frame of an answer. The controller uses this function. The function is inlined, because otherwise
    /// a PC writes the report byte by byte and copies it in larger words, which stalls its processor.
    #[inline]
    pub fn parse(frame: &Frame, scale: Scale) -> Result<Answer, FrameError> {
        let node = id::node(frame.id);
        if usize::from(node) >= NODES {
            return Err(FrameError::UnknownId(frame.id));
        }
        match id::command(frame.id) {
            id::MOVE_ANSWER => {
                frame.need(field::SHORT_LEN as u8)?;
                if usize::from(node) == GRIPPER {
                    return Ok(Self::Gripper(gripper(frame)));
                }
                Ok(Self::Joint { node, report: joint(frame, scale) })
            }
            id::FSM_ANSWER => {
                frame.need(1)?;
                Ok(Self::State { node, state: NodeState::new(frame.byte(0)) })
            }
            id::MODE_ANSWER => {
                frame.need(1)?;
                Ok(Self::Mode { node, accepted: frame.byte(0) == 1 })
            }
            _ => Err(FrameError::UnknownId(frame.id)),
        }
    }

    /// Returns the frame of the answer. Nodes use this function. A joint report has 20 bytes if it contains a motor
    /// temperature, and 16 bytes otherwise. Values outside the range of their integer are limited to this range.
    ///
    /// If the node number is invalid, the frame contains the node number 15. The controller ignores frames from node
    /// 15.
    pub fn emit(&self, scale: Scale) -> Frame {
        match self {
            Self::Joint { node, report } => emit_joint(*node, report, scale),
            Self::Gripper(report) => emit_gripper(report),
            Self::State { node, state } => {
                let mut frame = Frame::zeroed::<1>(id::answer(id::CHANGE_FSM, *node));
                frame.put(0, [state.code()]);
                frame
            }
            Self::Mode { node, accepted } => {
                let mut frame = Frame::zeroed::<1>(id::answer(id::CHANGE_MODE, *node));
                frame.put(0, [u8::from(*accepted)]);
                frame
            }
        }
    }
}

#[inline]
fn joint(frame: &Frame, scale: Scale) -> JointReport {
    let long = frame.data().len() >= field::LONG_LEN;
    JointReport {
        position: from_i32(frame.get(field::POSITION), POSITION_FULL_SCALE),
        velocity: from_i16(frame.get(field::VELOCITY), scale.velocity),
        torque: from_i16(frame.get(field::TORQUE), TORQUE_FULL_SCALE),
        temperature: frame.byte(field::BEARING_TEMPERATURE),
        state: NodeState::new(frame.byte(field::FSM)),
        mc_current: frame.byte(field::MC_CURRENT),
        mc_occurred: frame.byte(field::MC_OCCURRED),
        errors: frame.byte(field::ERRORS),
        warnings: frame.byte(field::WARNINGS),
        motor_temperature: long.then(|| frame.byte(field::MOTOR_TEMPERATURE)),
    }
}

fn emit_joint(node: u8, report: &JointReport, scale: Scale) -> Frame {
    // Node 6 is the gripper. The controller must not mistake a joint with the number 6 for the gripper.
    let node = if usize::from(node) == GRIPPER { u8::MAX } else { node };
    let id = id::answer(id::MOVE, node);
    let mut frame = match report.motor_temperature {
        None => Frame::zeroed::<{ field::SHORT_LEN }>(id),
        Some(temperature) => {
            let mut frame = Frame::zeroed::<{ field::LONG_LEN }>(id);
            frame.put(field::MOTOR_TEMPERATURE, [temperature]);
            frame
        }
    };
    frame.put(field::POSITION, to_i32(report.position, POSITION_FULL_SCALE));
    frame.put(field::VELOCITY, to_i16(report.velocity, scale.velocity));
    frame.put(field::TORQUE, to_i16(report.torque, TORQUE_FULL_SCALE));
    frame.put(field::BEARING_TEMPERATURE, [report.temperature]);
    frame.put(field::FSM, [report.state.code()]);
    frame.put(field::MC_CURRENT, [report.mc_current]);
    frame.put(field::MC_OCCURRED, [report.mc_occurred]);
    frame.put(field::ERRORS, [report.errors]);
    frame.put(field::WARNINGS, [report.warnings]);
    frame
}

fn gripper(frame: &Frame) -> GripperReport {
    GripperReport {
        pump: frame.byte(field::PUMP) != 0,
        pressure1: frame.byte(field::PRESSURE1) != 0,
        pressure2: frame.byte(field::PRESSURE2) != 0,
        state: NodeState::new(frame.byte(field::FSM)),
        errors: frame.byte(field::ERRORS),
        warnings: frame.byte(field::WARNINGS),
    }
}

fn emit_gripper(report: &GripperReport) -> Frame {
    let mut frame = Frame::zeroed::<{ field::SHORT_LEN }>(id::answer(id::MOVE, GRIPPER as u8));
    frame.put(field::PUMP, [u8::from(report.pump)]);
    frame.put(field::PRESSURE1, [u8::from(report.pressure1)]);
    frame.put(field::PRESSURE2, [u8::from(report.pressure2)]);
    frame.put(field::FSM, [report.state.code()]);
    frame.put(field::ERRORS, [report.errors]);
    frame.put(field::WARNINGS, [report.warnings]);
    frame
}
