//! States, error bits and codes in words: the same everywhere they are printed.
use core::fmt;

/// Bits of the controller's error words.
pub const JTC_ERRORS: [&str; 8] = [
    "emergency input",
    "emergency output",
    "internal error",
    "external error",
    "internal joints error",
    "internal CAN error",
    "internal COM error",
    "external joints error",
];
/// Bits of what the host has not given yet.
pub const JTC_INIT: [&str; 3] = ["friction", "PID", "arm model"];
/// Nodes of the joint bus: nodes count from 0 on the wire, joints from 1.
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
pub const JOINT_INTERNAL: [&str; 6] = [
    "position over limit",
    "velocity over limit",
    "acceleration over limit",
    "torque over limit",
    "position error over limit",
    "friction table value missing",
];
/// Bits of a drive's motor-control faults.
pub const MC_FAULTS: [&str; 8] = [
    "current loop took too long",
    "over-voltage",
    "under-voltage",
    "over-temperature",
    "start-up failed",
    "speed feedback lost",
    "over-current",
    "software error",
];
/// Bits of a node's errors.
pub const NODE_ERRORS: [&str; 4] =
    ["position encoder", "motor-control fault", "over-speed", "hardware fault of the gate driver"];
/// Bits of a node's warnings.
pub const NODE_WARNINGS: [&str; 4] = [
    "position not accurate",
    "outside working area",
    "magnetic field of the encoder out of range",
    "safety line active",
];
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

/// Friction type.
pub fn friction_type(code: u8) -> &'static str {
    match code {
        0 => "polynomial",
        1 => "table",
        _ => "unknown",
    }
}

/// Set bits in words, separated by commas; `-` when there is none.
///
/// ```
/// use jtc_wire::words::{Bits, JTC_ERRORS};
/// assert_eq!(Bits(0x0009, &JTC_ERRORS).to_string(), "emergency input, external error");
/// assert_eq!(Bits(0x0100, &JTC_ERRORS).to_string(), "bit 8");
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Bits<'a>(pub u32, pub &'a [&'a str]);

impl<'a> Bits<'a> {
    /// Number and name of each set bit; the name is empty when the list has none.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &'a str)> + use<'a> {
        let (word, names) = (self.0, self.1);
        (0..u32::BITS)
            .filter(move |bit| word >> bit & 1 == 1)
            .map(move |bit| (bit, names.get(bit as usize).copied().unwrap_or("")))
    }
}

impl fmt::Display for Bits<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 == 0 {
            return f.write_str("-");
        }
        for (i, (bit, name)) in self.iter().enumerate() {
            if i > 0 {
                f.write_str(", ")?;
            }
            match name {
                "" => write!(f, "bit {bit}")?,
                name => f.write_str(name)?,
            }
        }
        Ok(())
    }
}
