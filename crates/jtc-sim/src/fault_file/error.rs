//! Errors of fault files and their texts.
use core::fmt;

use jtc_dynamics::JOINTS;

use super::{SIDES, STATES};
use crate::faults::FaultKind;

/// Reasons why a fault file cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultFileError {
    /// The fault file is not valid TOML, or does not have the format of fault files. The TOML reader creates the
    /// text, which contains the position in the file.
    Syntax(String),
    /// The fault file does not contain `format = 2`.
    Format {
        /// Version of the file format, if the file states it.
        found: Option<f64>,
    },
    /// The fault file uses the key `node`, which only formats before 2 contain.
    Node {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Value of the key `node`.
        node: f64,
    },
    /// A fault contains both `joint` and `gripper`, or neither of the two keys.
    Device {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault.
        kind: String,
    },
    /// The trajectory file of a simulated hand cannot be used.
    Hand {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Reason why the trajectory file cannot be used.
        text: String,
    },
    /// The kind of the fault is unknown.
    UnknownKind {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault in the file.
        kind: String,
    },
    /// A key is missing that this kind of fault needs.
    Missing {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault.
        kind: String,
        /// Missing key.
        key: &'static str,
    },
    /// The fault contains a key that has no meaning for its kind.
    Superfluous {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault.
        kind: String,
        /// Key that has no meaning for the kind.
        key: &'static str,
    },
    /// The value of a key is outside its range.
    Range {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Key with the value.
        key: &'static str,
        /// Value in the file.
        value: f64,
        /// Smallest and largest permitted value of the key.
        allowed: (f64, f64),
    },
    /// The value of the key must be a whole number.
    NotWhole {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Key with the value.
        key: &'static str,
        /// Value in the file.
        value: f64,
    },
    /// The value of the key is not a list of three numbers.
    NotThree {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Key with the value.
        key: &'static str,
        /// Number of numbers in the list.
        count: usize,
    },
    /// The normal of a wall has the length 0.
    NoDirection {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Normal of the wall in the file.
        normal: [f64; 3],
    },
    /// The name of the side of an angle is unknown.
    UnknownSide {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Name of the side in the file.
        side: String,
    },
    /// The name of a controller state in the file is unknown.
    UnknownState {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Name of the state in the file.
        state: String,
    },
    /// The fault does not contain exactly one of the keys `at_s`, `in_state` and `at_point`.
    Trigger {
        /// Number of the fault in the file, from 1.
        fault: usize,
    },
}

impl fmt::Display for FaultFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Syntax(text) => f.write_str(text),
            Self::Format { found: None } => f.write_str(
                "the file has no `format = 2`, so its joints count from 0. To convert the file: add 1 to every `joint`, write `joint = N + 1` for \
                 every `node = N` of 0..5 and `gripper = true` for `node = 6`, then put `format = 2` in the first line",
            ),
            Self::Format { found: Some(found) } => {
                write!(f, "format = {found} is not supported, expected `format = 2`")
            }
            Self::Node { fault, node } => {
                write!(f, "fault {fault}: format 2 has no key `node`: instead of node = {node} write ")?;
                if *node == JOINTS as f64 {
                    f.write_str("gripper = true")
                } else {
                    write!(f, "joint = {} if it is a node number on the bus; joints count from 1", node + 1.0)
                }
            }
            Self::Device { fault, kind } => write!(
                f,
                "fault {fault}: `{kind}` needs exactly one of `joint = 1..6` and `gripper = true`"
            ),
            Self::Hand { fault, text } => write!(f, "fault {fault}: {text}"),
            Self::UnknownKind { fault, kind } => {
                write!(f, "fault {fault}: unknown kind `{kind}`; the kinds are {}", FaultKind::NAMES.join(", "))
            }
            Self::Missing { fault, kind, key } => write!(f, "fault {fault}: `{kind}` needs the key `{key}`"),
            Self::Superfluous { fault, kind, key } => {
                write!(f, "fault {fault}: the key `{key}` has no meaning for `{kind}`; remove the key")
            }
            Self::Range { fault, key, value, allowed: (low, high) } => {
                write!(f, "fault {fault}: {key} = {value} is out of range, expected {low}..{high}")
            }
            Self::NotWhole { fault, key, value } => {
                write!(f, "fault {fault}: {key} = {value} is not a whole number")
            }
            Self::NotThree { fault, key, count } => {
                write!(f, "fault {fault}: {key} has {count} numbers, expected 3: `{key} = [x, y, z]`")
            }
            Self::NoDirection { fault, normal: [x, y, z] } => write!(
                f,
                "fault {fault}: normal = [{x}, {y}, {z}] has no direction; write the direction out of the wall, as \
                 `normal = [0, 0, 1]` for a table"
            ),
            Self::UnknownSide { fault, side } => {
                let names: Vec<_> = SIDES.iter().map(|(name, _)| *name).collect();
                write!(f, "fault {fault}: unknown side `{side}`; the sides are {}", names.join(", "))
            }
            Self::UnknownState { fault, state } => {
                let names: Vec<_> = STATES.iter().map(|(name, _)| *name).collect();
                write!(f, "fault {fault}: unknown state `{state}`; the states are {}", names.join(", "))
            }
            Self::Trigger { fault } => {
                write!(f, "fault {fault}: needs exactly one of at_s, in_state, at_point")
            }
        }
    }
}

impl std::error::Error for FaultFileError {}
