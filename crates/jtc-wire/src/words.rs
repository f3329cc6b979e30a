//! Texts of states, error bits and codes. All outputs use the same texts.
pub use jtc_bus::Bits;

use crate::bits::{error, joint_error, missing_parameter};

/// Texts of the bits in the error words of the controller.
pub const JTC_ERRORS: [&str; 8] = error::NAMES;
/// Texts of the bits for parameters that the controller has not received.
pub const JTC_INIT: [&str; 3] = missing_parameter::NAMES;
/// Texts of the bits for the nodes of the joint bus. The bits count nodes from 0; the texts count joints from 1.
pub const NODES: [&str; 7] = [
    "node 0 (joint 1)",
    "node 1 (joint 2)",
    "node 2 (joint 3)",
    "node 3 (joint 4)",
    "node 4 (joint 5)",
    "node 5 (joint 6)",
    "gripper",
];
/// Texts of the bits for joint errors found by the controller.
pub const JOINT_INTERNAL: [&str; 6] = joint_error::NAMES;
/// Texts of the bits for motor-control faults of a drive.
pub const MC_FAULTS: [&str; 8] = jtc_bus::motor_control::NAMES;
/// Texts of the bits for errors of a node.
pub const NODE_ERRORS: [&str; 4] = jtc_bus::error::NAMES;
/// Texts of the bits for warnings of a node.
pub const NODE_WARNINGS: [&str; 4] = jtc_bus::warning::NAMES;
/// Texts of the bits of the CAN flags.
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
