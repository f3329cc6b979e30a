//! Frames that the controller sends. See [`Request`].

use crate::frame::{Frame, FrameError};
use crate::scale::{TORQUE_FULL_SCALE, to_i16};
use crate::{GRIPPER, JOINTS, NODES, NodeState, id};

/// Byte offsets in the payloads of requests.
mod field {
    /// Start of the torques in Move, two bytes per joint.
    pub(super) const TORQUE: usize = 0;
    /// Offset of the pump byte in Move.
    pub(super) const PUMP: usize = 12;
    /// Start of the mode and configuration bytes of the joints in ChangeMode.
    pub(super) const MODE: usize = 0;
    /// Offset of the configuration bits of the gripper in ChangeMode.
    pub(super) const GRIPPER_CONFIG: usize = 13;
    pub(super) const MOVE_LEN: usize = 16;
    pub(super) const FSM_LEN: usize = 7;
    pub(super) const MODE_LEN: usize = 16;
}

/// State that the controller can request from a node. The controller sends no other state values (J-16). Some drives interpret any other
/// value, such as their own state, as a command to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum Target {
    /// The node keeps its present state.
    #[default]
    NoChange = 0,
    /// State Init. In Fault, this request also acknowledges the faults.
    Init = NodeState::INIT.code(),
    /// Ready to operate, with the motor off.
    Ready = NodeState::READY.code(),
    /// Operation enabled.
    Enable = NodeState::ENABLED.code(),
}

impl Target {
    /// Returns the target for a byte in the wire format.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match NodeState::new(byte) {
            // The controller cannot request the state Start. In a request, the byte of Start means that no change is requested.
            NodeState::START => Some(Self::NoChange),
            NodeState::INIT => Some(Self::Init),
            NodeState::READY => Some(Self::Ready),
            NodeState::ENABLED => Some(Self::Enable),
            _ => None,
        }
    }
}

/// Request of the controller. The controller uses `emit`, and nodes use `parse`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// Torque of each joint and state of the pump (identifier 0x000). Encoding limits each torque to its range (J-13) and converts NaN to
    /// 0.
    Move {
        /// Torque of each joint, N·m.
        torque: [f64; JOINTS],
        /// `true` switches the vacuum pump on, `false` switches it off.
        pump: bool,
    },
    /// Requested state of each node (identifier 0x010, J-16).
    ChangeFsm {
        /// Requested state of each node.
        target: [Target; NODES],
    },
    /// Mode and configuration bits of each joint, and configuration bits of the gripper (identifier 0x0F0).
    ChangeMode {
        /// Mode of each joint: 0 for none, 1 for torque, 2 for speed.
        mode: [u8; JOINTS],
        /// Configuration bits of each joint, see [`config`](crate::config).
        config: [u8; JOINTS],
        /// Configuration bits of the gripper.
        gripper: u8,
    },
    /// Reset of every node (identifier 0x0A0).
    ResetAll,
    /// Reset of one node (0..6), with the identifier 0x1A0 + node. An invalid node number is sent as 15, which no node has.
    Reset(u8),
}

impl Request {
    /// Returns a Move with zero torques and this state of the pump. The controller sends this frame first after an error (J-12).
    pub const fn zero_torque(pump: bool) -> Self {
        Self::Move { torque: [0.0; JOINTS], pump }
    }

    /// Returns the frame of the request.
    pub fn emit(&self) -> Frame {
        match self {
            Self::Move { torque, pump } => {
                let mut frame = Frame::zeroed::<{ field::MOVE_LEN }>(id::MOVE);
                for (joint, torque) in torque.iter().enumerate() {
                    frame.put(field::TORQUE + 2 * joint, to_i16(*torque, TORQUE_FULL_SCALE));
                }
                frame.put(field::PUMP, [u8::from(*pump)]);
                frame
            }
            Self::ChangeFsm { target } => {
                let mut frame = Frame::zeroed::<{ field::FSM_LEN }>(id::CHANGE_FSM);
                frame.put(0, target.map(|target| target as u8));
                frame
            }
            Self::ChangeMode { mode, config, gripper } => {
                let mut frame = Frame::zeroed::<{ field::MODE_LEN }>(id::CHANGE_MODE);
                for (joint, (mode, config)) in mode.iter().zip(config).enumerate() {
                    frame.put(field::MODE + 2 * joint, [*mode, *config]);
                }
                frame.put(field::GRIPPER_CONFIG, [*gripper]);
                frame
            }
            Self::ResetAll => Frame::zeroed::<0>(id::RESET_ALL),
            Self::Reset(node) => Frame::zeroed::<0>(id::RESET | id::on_wire(*node)),
        }
    }

    /// Decodes the frame of a request. Nodes and bus monitors use this function.
    pub fn parse(frame: &Frame) -> Result<Request, FrameError> {
        match frame.id {
            id::MOVE => {
                frame.need(field::MOVE_LEN as u8)?;
                let torque = core::array::from_fn(|joint| {
                    // The drives compute the torque with the same operations in the same order, so both results are
                    // equal in every bit. The division is slow, but the control tick does not parse requests.
                    let raw = i16::from_be_bytes(frame.get(field::TORQUE + 2 * joint));
                    f64::from(raw) * TORQUE_FULL_SCALE / f64::from(i16::MAX)
                });
                Ok(Self::Move { torque, pump: frame.byte(field::PUMP) != 0 })
            }
            id::CHANGE_FSM => {
                frame.need(field::FSM_LEN as u8)?;
                let mut target = [Target::NoChange; NODES];
                for (at, target) in target.iter_mut().enumerate() {
                    let value = frame.byte(at);
                    let bad = FrameError::BadValue { id: frame.id, at: at as u8, value };
                    *target = Target::from_byte(value).ok_or(bad)?;
                }
                Ok(Self::ChangeFsm { target })
            }
            id::CHANGE_MODE => {
                frame.need(field::MODE_LEN as u8)?;
                Ok(Self::ChangeMode {
                    mode: core::array::from_fn(|joint| frame.byte(field::MODE + 2 * joint)),
                    config: core::array::from_fn(|joint| frame.byte(field::MODE + 2 * joint + 1)),
                    gripper: frame.byte(field::GRIPPER_CONFIG),
                })
            }
            id::RESET_ALL => Ok(Self::ResetAll),
            other if id::command(other) == id::RESET && usize::from(id::node(other)) <= GRIPPER => {
                Ok(Self::Reset(id::node(other)))
            }
            other => Err(FrameError::UnknownId(other)),
        }
    }

    /// Returns `true` if nodes answer this request. Nodes do not answer resets.
    pub const fn is_answered(&self) -> bool {
        !matches!(self, Self::ResetAll | Self::Reset(_))
    }
}
