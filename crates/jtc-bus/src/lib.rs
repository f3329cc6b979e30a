//! Joint bus of the controller: CAN FD frames both ways.
#![no_std]
#![forbid(unsafe_code)]

/// Joints on the bus, nodes 0..5.
pub const JOINTS: usize = 6;
/// Node number of the gripper.
pub const GRIPPER: usize = 6;
/// Joints and gripper.
pub const NODES: usize = 7;

/// A CAN FD frame of this bus: 11-bit id, bit rate switch, at most 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    /// 11-bit identifier.
    pub id: u16,
    len: u8,
    data: [u8; 24],
}

impl Frame {
    /// `None` when `data` is longer than 24 bytes or `id` has more than 11 bits.
    pub fn new(_id: u16, _data: &[u8]) -> Option<Self> {
        unimplemented!()
    }
    /// The payload.
    pub fn data(&self) -> &[u8] {
        unimplemented!()
    }
}

/// Full scales of the drives' numbers (J-11). Position (3.141592) and torque (360) are protocol constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// rad/s at 32767: 2.0, on older drives 6.283185.
    pub velocity: f64,
}

/// What the controller sends; `emit` for the controller, `parse` for nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// 0x000: torque per joint (N·m, saturated when encoded, J-13; NaN is encoded as 0) and the pump.
    Move {
        /// N·m at the joint.
        torque: [f64; JOINTS],
        /// Vacuum pump on.
        pump: bool,
    },
    /// 0x010: target per node; 0 = no change (J-16).
    ChangeFsm {
        /// 0, 1, 2 or 3 per node.
        target: [u8; NODES],
    },
    /// 0x0F0: mode (1 torque) and configuration bits per joint, configuration bits of the gripper.
    ChangeMode {
        /// 0 none, 1 torque, 2 speed.
        mode: [u8; JOINTS],
        /// Configuration bits per joint.
        config: [u8; JOINTS],
        /// Configuration bits of the gripper.
        gripper: u8,
    },
    /// 0x0A0.
    ResetAll,
    /// 0x1A0 + node.
    Reset(u8),
}

impl Request {
    /// The frame on the bus.
    pub fn emit(&self) -> Frame {
        unimplemented!()
    }
    /// Node side (also used by bus monitors).
    pub fn parse(_frame: &Frame) -> Result<Request, FrameError> {
        unimplemented!()
    }
}

/// Why a frame was not understood; it is counted and ignored (J-15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// No frame of this protocol has this id.
    UnknownId(u16),
    /// Fewer bytes than the frame needs.
    TooShort {
        /// Identifier.
        id: u16,
        /// Bytes received.
        len: u8,
        /// Bytes needed.
        need: u8,
    },
}

/// A joint's answer to Move (0x200+n): 16 bytes, new drives 20.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct JointReport {
    /// rad.
    pub position: f64,
    /// rad/s.
    pub velocity: f64,
    /// N·m; its sign is the command's (J-16).
    pub torque: f64,
    /// Bearing temperature, °C.
    pub temperature: u8,
    /// Node FSM byte as sent.
    pub fsm: u8,
    /// Motor-control faults now.
    pub mc_current: u8,
    /// Motor-control faults since acknowledged.
    pub mc_occurred: u8,
    /// Error bits.
    pub errors: u8,
    /// Warning bits.
    pub warnings: u8,
    /// Motor temperature, °C, when the answer has 20 bytes.
    pub motor_temperature: Option<u8>,
}

/// The gripper's answer to Move (0x206).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct GripperReport {
    /// Pump is running (measured).
    pub pump: bool,
    /// First vacuum level reached.
    pub pressure1: bool,
    /// Second vacuum level reached.
    pub pressure2: bool,
    /// Node FSM byte as sent.
    pub fsm: u8,
    /// Error bits.
    pub errors: u8,
    /// Warning bits.
    pub warnings: u8,
}

/// What nodes answer; `parse` for the controller, `emit` for nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// 0x200+n.
    Joint {
        /// 0..5.
        node: u8,
        /// Decoded report.
        report: JointReport,
    },
    /// 0x206.
    Gripper(GripperReport),
    /// 0x210+n.
    Fsm {
        /// 0..6.
        node: u8,
        /// FSM byte at reception of the request.
        fsm: u8,
    },
    /// 0x2F0+n.
    Mode {
        /// 0..6.
        node: u8,
        /// The configuration was accepted.
        accepted: bool,
    },
}

impl Answer {
    /// Controller side.
    pub fn parse(_frame: &Frame, _scale: Scale) -> Result<Answer, FrameError> {
        unimplemented!()
    }
    /// Node side; joint reports with a motor temperature have 20 bytes, else 16; values saturate.
    pub fn emit(&self, _scale: Scale) -> Frame {
        unimplemented!()
    }
}

/// Node FSM bytes.
pub mod fsm {
    /// Start.
    pub const START: u8 = 0;
    /// Init: motor off, waits for configuration.
    pub const INIT: u8 = 1;
    /// Ready to operate: motor off, configured.
    pub const READY: u8 = 2;
    /// Operation enabled: follows its command.
    pub const ENABLED: u8 = 3;
    /// Fault reaction active.
    pub const FAULT_REACTION: u8 = 254;
    /// Fault.
    pub const FAULT: u8 = 255;
}

/// Warning bits of a node.
pub mod warning {
    /// Position not accurate.
    pub const POSITION_NOT_ACCURATE: u8 = 0x01;
    /// Outside its working area.
    pub const OUTSIDE_WORKING_AREA: u8 = 0x02;
    /// Magnetic field of the encoder out of range.
    pub const MAGNETIC_FIELD: u8 = 0x04;
    /// Safety line active.
    pub const SAFETY_LINE: u8 = 0x08;
}
