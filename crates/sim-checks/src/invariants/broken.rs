//! Violations that the checker finds.
use core::fmt;

use jtc_bus::Joint;
use jtc_core::{ControllerState, TrajectoryState};

/// Invariant that was violated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Broken {
    /// The controller sent a torque in a state without torque.
    Torque {
        /// State of the controller.
        state: ControllerState,
        /// Joint with the torque.
        joint: Joint,
        /// Torque that the controller sent, N·m.
        torque: f64,
    },
    /// The torque of a joint is larger than the torque limit of the joint.
    TorqueLimit {
        /// Joint with the torque.
        joint: Joint,
        /// Torque that the controller sent, N·m.
        torque: f64,
        /// Torque limit of the joint, N·m.
        limit: f64,
    },
    /// A value of a joint is NaN or infinite.
    NotFinite {
        /// Name of the kind of value.
        what: &'static str,
        /// Joint with the value.
        joint: Joint,
    },
    /// The controller left the Error state although the host had not cleared the error.
    LeftErrorAlone {
        /// State that the controller entered.
        to: ControllerState,
    },
    /// The controller entered Operate although the host had not sent Execute.
    MovedAlone,
    /// The controller entered Teaching although the host had not sent the command for it.
    TaughtAlone,
    /// The controller entered an execution state that only a host command may cause.
    ExecutionAlone {
        /// State that the controller entered.
        to: TrajectoryState,
    },
    /// The point index decreased within a run.
    IndexFell {
        /// Point index before the decrease.
        from: u32,
        /// Point index after the decrease.
        to: u32,
    },
    /// The controller sent no frame in a tick, although it is not in Start.
    Silent {
        /// State of the controller.
        state: ControllerState,
    },
    /// Too few ticks are between two frames that replace Move.
    NoMove {
        /// Number of ticks since the last such frame.
        ticks: u32,
    },
    /// The first frame after an error is not a Move frame with zero torque.
    ErrorWithoutZero,
    /// The controller requests Enable for a node in a state that does not permit Enable.
    Enabled {
        /// State of the controller.
        state: ControllerState,
        /// Number of the node.
        node: usize,
    },
    /// The controller sent a frame that the protocol does not define.
    UnknownFrame {
        /// Identifier of the frame.
        id: u16,
    },
    /// A Pause or Stop took too long, and no error was reported (J-33).
    NoStop {
        /// Number of ticks since the command.
        ticks: u32,
    },
    /// A joint with torque exceeded its speed limit for too long (J-35).
    Speed {
        /// Joint that is too fast.
        joint: Joint,
        /// Measured velocity of the joint, rad/s.
        velocity: f64,
        /// Number of consecutive measurements above the limit.
        ticks: u16,
    },
    /// A torque was at its limit in too many ticks, although the arm was not braking and was not catching a load (J-43).
    Saturated {
        /// Joint with the torque.
        joint: Joint,
        /// Number of ticks with the torque at the limit, of the last 100 ticks.
        ticks: u32,
    },
    /// The level of the safety output does not match the errors.
    SafetyOutput {
        /// Level of the safety output.
        level: bool,
        /// Error word of the controller.
        errors: u16,
    },
}

/// Violated invariant, and the time of the violation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Time since the start of the simulation, µs.
    pub time_us: u64,
    /// Violated invariant.
    pub broken: Broken,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.3} s: {}", self.time_us as f64 * 1e-6, self.broken)
    }
}

impl std::error::Error for Violation {}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Torque { state, joint, torque } => write!(f, "{joint} has {torque} N·m in {state:?}"),
            Self::TorqueLimit { joint, torque, limit } => {
                write!(f, "{joint} has {torque} N·m; its limit is {limit} N·m")
            }
            Self::NotFinite { what, joint } => write!(f, "a {what} of {joint} is NaN or infinite"),
            Self::LeftErrorAlone { to } => write!(f, "Error was left for {to:?}, though nothing was cleared"),
            Self::MovedAlone => f.write_str("Operate was entered without Execute from the host"),
            Self::TaughtAlone => f.write_str("Teaching was entered without a command from the host"),
            Self::ExecutionAlone { to } => write!(f, "the trajectory became {to:?} without Execute"),
            Self::IndexFell { from, to } => {
                write!(f, "the point index fell from {from} to {to} within a run")
            }
            Self::Silent { state } => write!(f, "no frame went out in {state:?}"),
            Self::NoMove { ticks } => write!(f, "only {ticks} Moves came between two other frames"),
            Self::ErrorWithoutZero => f.write_str("the first frame after an error is no Move without torque"),
            Self::Enabled { state, node } => match Joint::from_index(*node) {
                Some(joint) => write!(f, "{joint} is to be enabled in {state:?}"),
                None => write!(f, "the gripper is to be enabled in {state:?}"),
            },
            Self::UnknownFrame { id } => write!(f, "no frame of the joint bus has id 0x{id:03X}"),
            Self::NoStop { ticks } => write!(f, "{ticks} ms after a Pause or Stop the arm still moves"),
            Self::Speed { joint, velocity, ticks } => {
                write!(f, "{joint} has been too fast for {ticks} ms, at last {velocity} rad/s")
            }
            Self::Saturated { joint, ticks } => {
                write!(f, "the torque of {joint} was at its limit in {ticks} of 100 ms")
            }
            Self::SafetyOutput { level, errors } => {
                write!(f, "the safety output is {} with the error word 0x{errors:04X}", u8::from(*level))
            }
        }
    }
}
