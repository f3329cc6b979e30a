//! Faults of the simulation and their triggers.
use core::fmt;

use jtc_bus::Joint;
use jtc_core::ControllerState;

use crate::arm::{Side, Wall};
use crate::hand::HandPath;

/// Declares the kinds of faults. Each kind has a meaning, a variant name, a name in fault files and tables, and fields.
macro_rules! fault_kinds {
    ($($(#[$doc:meta])* $kind:ident $name:literal $({ $($(#[$field_doc:meta])* $field:ident: $type:ty,)+ })?;)+) => {
        /// Kind of fault.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum FaultKind {
            $($(#[$doc])* $kind $({ $($(#[$field_doc])* $field: $type,)+ })?,)+
        }

        impl FaultKind {
            /// Names of all kinds, as written in fault files.
            pub const NAMES: [&str; [$($name),+].len()] = [$($name),+];

            /// Returns the name of the kind in fault files and tables.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind { .. } => $name,)+
                }
            }
        }
    };
}

fault_kinds! {
    /// A node is disconnected from the bus. The motor of a joint continues with its last torque.
    NodeSilent "node-silent" {
        /// Number of the node: 0 to 5 for the joints, 6 for the gripper.
        node: u8,
    };
    /// A node's processor restarts once.
    NodeReboot "node-reboot" {
        /// Number of the node: 0 to 5 for the joints, 6 for the gripper.
        node: u8,
    };
    /// The motor control reports faults.
    MotorFault "motor-fault" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Bits of the fault byte.
        bits: u8,
    };
    /// The gate driver reports a fault.
    HardwareFault "hardware-fault" {
        /// Joint that the fault affects.
        joint: Joint,
    };
    /// A drive enters its fault state once, without an error bit.
    FaultState "fault-state" {
        /// Joint that the fault affects.
        joint: Joint,
    };
    /// A drive answers requests for another state, but stays in its current state.
    IgnoresState "ignores-state" {
        /// Joint that the fault affects.
        joint: Joint,
    };
    /// The encoder reading has an offset.
    EncoderJump "encoder-jump" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Offset of the position, rad.
        rad: f64,
    };
    /// A drive reports its position as inaccurate.
    NotAccurate "not-accurate" {
        /// Joint that the fault affects.
        joint: Joint,
    };
    /// The friction of a joint is multiplied by a factor.
    Friction "friction" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Factor of the true friction.
        factor: f64,
    };
    /// The temperature of a joint's bearing stays at a given value.
    Temperature "temperature" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Temperature, °C.
        celsius: f64,
    };
    /// Receivers on the joint bus miss frames.
    FramesLost "frames-lost" {
        /// Probability that a receiver misses a frame, 0..1.
        probability: f64,
    };
    /// Frames are destroyed on the bus and repeated.
    FramesCorrupted "frames-corrupted" {
        /// Probability that a frame is destroyed, 0..1.
        probability: f64,
    };
    /// Answers reach the controller with changed contents.
    FramesGarbled "frames-garbled" {
        /// Probability that an answer is changed, 0..1.
        probability: f64,
    };
    /// The controller is forced to stay bus-off.
    BusOff "bus-off";
    /// The bus cable of the controller is cut.
    NoAcknowledge "no-acknowledge";
    /// The controller's safety input is low.
    SafetyInput "safety-input";
    /// The safety line of a drive has the level that means danger.
    SafetyLine "safety-line" {
        /// Number of the node: 0 to 5 for the joints, 6 for the gripper.
        node: u8,
    };
    /// Bytes from the host are lost.
    SerialLost "serial-lost" {
        /// Probability that a byte is lost, 0..1.
        probability: f64,
    };
    /// Bits of bytes from the host are flipped.
    SerialFlipped "serial-flipped" {
        /// Probability that one bit of a byte is flipped, 0..1, for each byte.
        probability: f64,
    };
    /// Bytes from the host are delayed until the fault ends.
    SerialDelayed "serial-delayed";
    /// The controller misses its tick.
    TickOverrun "tick-overrun";
    /// A person pushes a joint.
    Push "push" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Torque of the push, N·m.
        torque: f64,
    };
    /// The flange touches a wall; see [`Wall::Plane`].
    Wall "wall" {
        /// Point of the wall's surface in the base frame, m.
        position: [f64; 3],
        /// Direction out of the wall, as a vector in the base frame. The length of this normal vector must not be 0.
        normal: [f64; 3],
        /// Stiffness, N/m.
        stiffness: f64,
        /// Damping, N·s/m.
        damping: f64,
    };
    /// A joint touches a wall; see [`Wall::Joint`].
    JointWall "joint-wall" {
        /// Joint that the fault affects.
        joint: Joint,
        /// Angle at which the wall begins, rad.
        rad: f64,
        /// Side of the angle on which the wall is.
        side: Side,
        /// Stiffness, N·m/rad.
        stiffness: f64,
        /// Damping, N·m·s/rad.
        damping: f64,
    };
    /// The arm has picked up a point mass.
    Payload "payload" {
        /// Mass of the point mass, kg.
        mass: f64,
        /// Centre of mass in the flange frame, m.
        com: [f64; 3],
    };
    /// The brake of a joint stays closed while its drive is enabled.
    BrakeClosed "brake-closed" {
        /// Joint that the fault affects.
        joint: Joint,
    };
    /// A hand guides the arm in Teaching.
    Hand "hand" {
        /// Index in [`FaultPlan::hands`].
        path: usize,
    };
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        match self {
            Self::NodeSilent { node } | Self::NodeReboot { node } | Self::SafetyLine { node } => {
                match Joint::from_index((*node).into()) {
                    Some(joint) => write!(f, " {joint}"),
                    None => f.write_str(" gripper"),
                }
            }
            Self::MotorFault { joint, bits } => write!(f, " {joint} bits 0x{bits:02X}"),
            Self::HardwareFault { joint }
            | Self::FaultState { joint }
            | Self::IgnoresState { joint }
            | Self::BrakeClosed { joint }
            | Self::NotAccurate { joint } => {
                write!(f, " {joint}")
            }
            Self::EncoderJump { joint, rad } => write!(f, " {joint} by {rad} rad"),
            Self::Friction { joint, factor } => write!(f, " {joint} times {factor}"),
            Self::Temperature { joint, celsius } => write!(f, " {joint} at {celsius} °C"),
            Self::Push { joint, torque } => write!(f, " {joint} by {torque} N·m"),
            Self::Wall { position: [x, y, z], stiffness, .. } => {
                write!(f, " at ({x}, {y}, {z}) m of {stiffness} N/m")
            }
            Self::JointWall { joint, rad, side, stiffness, .. } => {
                write!(f, " {joint} {side} {rad} rad of {stiffness} N·m/rad")
            }
            Self::Payload { mass, com: [x, y, z] } => write!(f, " {mass} kg at ({x}, {y}, {z}) m"),
            Self::FramesLost { probability }
            | Self::FramesCorrupted { probability }
            | Self::FramesGarbled { probability }
            | Self::SerialLost { probability }
            | Self::SerialFlipped { probability } => write!(f, " {:.3} %", probability * 100.0),
            Self::BusOff
            | Self::NoAcknowledge
            | Self::SafetyInput
            | Self::SerialDelayed
            | Self::TickOverrun
            | Self::Hand { .. } => Ok(()),
        }
    }
}

impl FaultKind {
    /// Returns the wall of this fault.
    pub(crate) fn wall(&self) -> Option<Wall> {
        match *self {
            Self::Wall { position, normal, stiffness, damping } => {
                Some(Wall::Plane { position, normal, stiffness, damping })
            }
            Self::JointWall { joint, rad, side, stiffness, damping } => {
                Some(Wall::Joint { joint, angle: rad, side, stiffness, damping })
            }
            _ => None,
        }
    }
}

/// Condition that starts a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The fault starts this time after the start of the simulation, ms.
    At(u64),
    /// The fault starts this time after the controller first enters the state, ms.
    InState(ControllerState, u64),
    /// The fault starts when the point index of the trajectory reaches this value in Operate.
    AtPoint(u32),
}

/// A fault with its start condition and duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Condition that starts the fault.
    pub trigger: Trigger,
    /// Duration of the fault, ms. A duration of 0 is treated as 1, because faults begin and end only at whole
    /// milliseconds. With `None`, the fault never ends.
    pub duration_ms: Option<u64>,
}

/// All faults of a simulation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Faults in any order.
    pub faults: Vec<Fault>,
    /// Paths that the hands of [`FaultKind::Hand`] follow.
    pub hands: Vec<HandPath>,
}

/// Phase of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Waiting,
    /// The controller has entered the state, and the fault begins at this time, ms.
    Armed(u64),
    /// The fault is active and ends at this time, ms.
    Active(u64),
    Over,
}

/// Begin or end of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Change {
    Begin(FaultKind),
    End(FaultKind),
}

/// Faults of a running simulation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Running {
    faults: Vec<(Fault, Phase)>,
    /// Number of faults that have not ended yet.
    open: usize,
}

impl Running {
    pub(crate) fn new(plan: &FaultPlan) -> Self {
        let faults: Vec<_> = plan.faults.iter().map(|f| (*f, Phase::Waiting)).collect();
        Self { open: faults.len(), faults }
    }

    /// Adds a fault.
    pub(crate) fn add(&mut self, fault: Fault) {
        // A long test run adds faults continuously, so ended faults are removed.
        self.faults.retain(|(_, phase)| *phase != Phase::Over);
        self.faults.push((fault, Phase::Waiting));
        self.open += 1;
    }

    /// Returns the kinds of the active faults.
    pub(crate) fn active(&self) -> impl Iterator<Item = FaultKind> + '_ {
        self.faults.iter().filter(|(_, phase)| matches!(phase, Phase::Active(_))).map(|(fault, _)| fault.kind)
    }

    /// Begins and ends faults at `now` (ms), depending on the controller's state and point index.
    pub(crate) fn step(
        &mut self,
        now: u64,
        state: ControllerState,
        point: u32,
        mut change: impl FnMut(Change),
    ) {
        if self.open == 0 {
            return;
        }
        for (fault, phase) in &mut self.faults {
            if *phase == Phase::Waiting {
                let start = match fault.trigger {
                    Trigger::At(ms) => Some(ms),
                    Trigger::InState(wanted, after) => (state == wanted).then_some(now + after),
                    Trigger::AtPoint(k) => (state == ControllerState::Operate && point >= k).then_some(now),
                };
                if let Some(start) = start {
                    *phase = Phase::Armed(start);
                }
            }
            if let Phase::Armed(start) = *phase
                && now >= start
            {
                let end = fault.duration_ms.map_or(u64::MAX, |d| now.saturating_add(d.max(1)));
                *phase = Phase::Active(end);
                change(Change::Begin(fault.kind));
            }
            if let Phase::Active(end) = *phase
                && now >= end
            {
                *phase = Phase::Over;
                self.open -= 1;
                change(Change::End(fault.kind));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_lasts_at_least_a_millisecond() {
        for (duration_ms, expected) in [(0, 1), (1, 1), (2, 2)] {
            let fault =
                Fault { kind: FaultKind::BusOff, trigger: Trigger::At(3), duration_ms: Some(duration_ms) };
            let mut running = Running::new(&FaultPlan { faults: vec![fault], ..FaultPlan::default() });
            let mut active = Vec::new();
            for now in 0..10 {
                running.step(now, ControllerState::Init, 0, |_| {});
                active.extend(running.active().map(|_| now));
            }
            let expected: Vec<u64> = (3..3 + expected).collect();
            assert_eq!(active, expected, "{duration_ms} ms");
        }
    }
}
