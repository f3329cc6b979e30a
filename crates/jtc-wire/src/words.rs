//! Texts of states, error bits and codes, which are the same in all outputs.
pub use jtc_bus::Bits;

use crate::bits::{error, joint_error, missing_parameter};

/// Bits of the controller's error words.
pub const JTC_ERRORS: [&str; 8] = error::NAMES;
/// Bits of the parameters that the controller has not received.
pub const JTC_INIT: [&str; 3] = missing_parameter::NAMES;
/// Nodes of the joint bus. Nodes are counted from 0 on the wire, joints from 1.
pub const NODES: [&str; 7] = [
    "node 0 (joint 1)",
    "node 1 (joint 2)",
    "node 2 (joint 3)",
    "node 3 (joint 4)",
    "node 4 (joint 5)",
    "node 5 (joint 6)",
    "gripper",
];
/// Bits of a joint's errors found by the controller.
pub const JOINT_INTERNAL: [&str; 6] = joint_error::NAMES;
/// Bits of a drive's motor-control faults.
pub const MC_FAULTS: [&str; 8] = jtc_bus::motor_control::NAMES;
/// Bits of a node's errors.
pub const NODE_ERRORS: [&str; 4] = jtc_bus::error::NAMES;
/// Bits of a node's warnings.
pub const NODE_WARNINGS: [&str; 4] = jtc_bus::warning::NAMES;
/// Bits of the CAN flags.
pub const CAN_FLAGS: [&str; 15] = [
    "transmit timeout",
    "",
    "",
    "",
    "",
    "",
    "",
    "",
    "no answer from node 0 (joint 1)",
    "no answer from node 1 (joint 2)",
    "no answer from node 2 (joint 3)",
    "no answer from node 3 (joint 4)",
    "no answer from node 4 (joint 5)",
    "no answer from node 5 (joint 6)",
    "no answer from the gripper",
];

/// Returns the text of the friction type.
pub fn friction_type(code: u8) -> &'static str {
    match code {
        0 => "polynomial",
        1 => "table",
        _ => "unknown",
    }
}
