//! Rows of the tables with their faults. Also contains the reasons for cells without a reaction.
use jtc_bus::{GRIPPER, Joint};
use jtc_core::ControllerState;
use jtc_wire::{FrameType, fixed};

use jtc_sim::{Fault, FaultKind, Operator, Trigger, host};

/// Number of ticks after which a lasting fault is removed.
pub(super) const LASTING_MS: u64 = 300;
/// Number of short frames that the host sends before a Stop.
const FLOOD: usize = 4_000;

/// Action on the simulated world.
#[derive(Clone, Copy)]
pub(super) enum Act {
    /// Fault, with its duration in ms.
    Fault(FaultKind, u64),
    /// Fault, its duration in ms, and the tick in which the controller executes the command to clear all
    /// errors.
    Cleared(FaultKind, u64, u64),
    /// Two faults at the same time, with their duration in ms.
    Both(FaultKind, FaultKind, u64),
    /// Every second tick is missed.
    EverySecondTick,
    /// The host resets the gripper.
    ResetGripper,
    /// Frame that the host sends.
    Frame(&'static [u8]),
    /// Frame directly after one byte of noise. Further noise follows every 6 ms.
    InNoise(&'static [u8]),
    /// Frame that follows thousands of short frames in the same millisecond.
    Behind(&'static [u8]),
}

impl Act {
    /// Performs the action before the step of tick `tick`, counted from 1.
    pub(super) fn before(self, operator: &mut Operator, tick: u64) {
        let world = &mut operator.world;
        let trigger = Trigger::At(world.now_us() / 1000);
        let mut inject = |kind, ms| world.inject(Fault { kind, trigger, duration_ms: Some(ms) });
        match self {
            Self::Fault(kind, ms) | Self::Cleared(kind, ms, _) if tick == 1 => inject(kind, ms),
            Self::Both(one, other, ms) if tick == 1 => {
                inject(one, ms);
                inject(other, ms);
            }
            Self::EverySecondTick if tick % 2 == 1 && tick < LASTING_MS => {
                inject(FaultKind::TickOverrun, 1);
            }
            _ => {}
        }
        match self {
            Self::Cleared(.., clear) if tick == clear => world.host_write(&host::clear_all()),
            Self::ResetGripper if tick == 1 => {
                world.host_write(&host::frame(FrameType::ResetCanDevices, &[1 << GRIPPER, 0, 0, 0]));
            }
            Self::Frame(frame) if tick == 1 => world.host_write(frame),
            Self::InNoise(frame) if tick == 1 => world.host_write(&[&[NOISE], frame].concat()),
            Self::InNoise(_) if tick % 6 == 1 => world.host_write(&[NOISE]),
            Self::Behind(frame) if tick == 1 => {
                world.host_write(&fixed::CLEAR_OCCURRED_ERRORS.repeat(FLOOD));
                world.host_write(frame);
            }
            _ => {}
        }
    }
}

/// Byte of noise. The header byte has the worst effect, because it begins a frame.
const NOISE: u8 = jtc_wire::HEADER;

/// Row of the fault matrix.
pub(super) struct Row {
    pub name: &'static str,
    pub act: Act,
    /// Time of silence of the host after which the controller reacts, ms (J-59). 0 disables the reaction.
    pub host_timeout_ms: u16,
    /// Reason why the controller does not react while it holds or moves the arm.
    held: Option<&'static str>,
    /// Reason why the controller does not react in Init and Error.
    parked: Option<&'static str>,
}

impl Row {
    /// Returns the text for a cell without a reaction; `None` if the controller must react.
    pub(super) fn quiet(&self, state: ControllerState) -> Option<String> {
        match state {
            ControllerState::HoldPos | ControllerState::Operate | ControllerState::Teaching => {
                self.held.map(|why| format!("continues: {why}"))
            }
            _ => self.parked.map(|why| format!("no effect: {why}")),
        }
    }
}

/// Returns a row for a fault that causes a reaction in every state.
const fn seen(name: &'static str, act: Act) -> Row {
    Row { name, act, host_timeout_ms: 0, held: None, parked: None }
}

/// Returns a row for a fault that causes no new reaction in Error, because the safety input has already caused this
/// state.
const fn latched(name: &'static str, act: Act) -> Row {
    Row { name, act, host_timeout_ms: 0, held: None, parked: Some("latched") }
}

/// Returns a row for a fault that causes a reaction only while the arm has torque.
const fn powered(name: &'static str, act: Act) -> Row {
    Row { name, act, host_timeout_ms: 0, held: None, parked: Some("no torque") }
}

/// Returns a row for a fault that the controller tolerates in every state. `why` is the reason.
const fn borne(name: &'static str, act: Act, why: &'static str) -> Row {
    Row { name, act, host_timeout_ms: 0, held: Some(why), parked: Some(why) }
}

const fn fault(kind: FaultKind) -> Act {
    Act::Fault(kind, LASTING_MS)
}

/// Joint on which the matrix injects the faults that affect a single joint.
const MEANT: Joint = Joint::ALL[1];
const SILENT: FaultKind = FaultKind::NodeSilent { node: MEANT.index() as u8 };
const GLITCH: FaultKind = FaultKind::EncoderJump { joint: MEANT, rad: 0.3 };
const IGNORES: FaultKind = FaultKind::IgnoresState { joint: MEANT };
const ALL_LOST: FaultKind = FaultKind::FramesLost { probability: 1.0 };

pub(super) const ROWS: [Row; 40] = [
    latched("safety input low", fault(FaultKind::SafetyInput)),
    latched("safety input low for 1 ms", Act::Fault(FaultKind::SafetyInput, 1)),
    latched("safety input low for 1 ms, cleared in its tick", Act::Cleared(FaultKind::SafetyInput, 1, 1)),
    latched("safety input low, joint ignores its state command", {
        Act::Both(FaultKind::SafetyInput, IGNORES, LASTING_MS)
    }),
    borne("joint ignores its state command", fault(IGNORES), "not asked"),
    seen("joint silent", fault(SILENT)),
    borne("joint silent for 4 ms", Act::Fault(SILENT, 4), "bridged"),
    seen("joint reboots", Act::Fault(FaultKind::NodeReboot { node: 1 }, 1)),
    seen("joint: motor-control fault", fault(FaultKind::MotorFault { joint: MEANT, bits: 0x04 })),
    seen("joint: gate driver fault", fault(FaultKind::HardwareFault { joint: MEANT })),
    seen("joint in fault state, no error bit", Act::Fault(FaultKind::FaultState { joint: MEANT }, 1)),
    seen(
        "joint in fault state, cleared in the tick that finds it",
        Act::Cleared(FaultKind::FaultState { joint: MEANT }, 1, 2),
    ),
    seen("joint: safety line", fault(FaultKind::SafetyLine { node: 1 })),
    seen("joint: encoder jumps by 0.3 rad", fault(GLITCH)),
    borne("joint: encoder jumps by 0.3 rad for 1 ms", Act::Fault(GLITCH, 1), "bridged"),
    borne("joint: encoder jumps by 0.3 rad for 3 ms", Act::Fault(GLITCH, 3), "bridged"),
    seen("joint: encoder jumps by 0.3 rad for 10 ms", Act::Fault(GLITCH, 10)),
    seen("joint: encoder jumps by 0.05 rad", fault(FaultKind::EncoderJump { joint: MEANT, rad: 0.05 })),
    powered("joint: position not accurate", fault(FaultKind::NotAccurate { joint: MEANT })),
    borne("joint: friction times 3", fault(FaultKind::Friction { joint: MEANT, factor: 3.0 }), "controlled"),
    borne(
        "joint: bearing at 60 °C",
        fault(FaultKind::Temperature { joint: MEANT, celsius: 60.0 }),
        "controlled",
    ),
    borne("gripper silent", fault(FaultKind::NodeSilent { node: 6 }), "shown"),
    borne("gripper reboots", Act::Fault(FaultKind::NodeReboot { node: 6 }, 1), "shown"),
    borne("gripper reset by the host", Act::ResetGripper, "shown"),
    borne("gripper: safety line", fault(FaultKind::SafetyLine { node: 6 }), "shown"),
    borne("1 % of bus receptions lost", fault(FaultKind::FramesLost { probability: 0.01 }), "bridged"),
    borne("every bus reception lost for 4 ms", Act::Fault(ALL_LOST, 4), "bridged"),
    borne(
        "10 % of bus frames destroyed and repeated",
        fault(FaultKind::FramesCorrupted { probability: 0.1 }),
        "repeated",
    ),
    seen("bus cut at the controller", fault(FaultKind::NoAcknowledge)),
    seen("controller bus-off", fault(FaultKind::BusOff)),
    seen("controller bus-off for 1 ms", Act::Fault(FaultKind::BusOff, 1)),
    seen("controller bus-off, cleared in the tick that finds it", Act::Cleared(FaultKind::BusOff, 1, 2)),
    borne(
        "every byte from the host lost",
        fault(FaultKind::SerialLost { probability: 1.0 }),
        "no supervision",
    ),
    Row {
        host_timeout_ms: 250,
        ..borne(
            "every byte from the host lost, `host_timeout_ms` = 250",
            fault(FaultKind::SerialLost { probability: 1.0 }),
            "at rest",
        )
    },
    borne(
        "5 % of bytes from the host flipped",
        fault(FaultKind::SerialFlipped { probability: 0.05 }),
        "refused",
    ),
    borne("bytes from the host delayed", fault(FaultKind::SerialDelayed), "no supervision"),
    borne("tick late by 5 ms", Act::Fault(FaultKind::TickOverrun, 5), "late ticks"),
    seen("every second tick missing", Act::EverySecondTick),
    seen("tick stops", fault(FaultKind::TickOverrun)),
    borne("4,000 frames ClearOccurredErrors at once", Act::Behind(&[]), "bounded"),
];

/// Stop commands, which apply only to a motion.
pub(super) const STOPS: [(&str, Act); 6] = [
    ("Pause", Act::Frame(&fixed::PAUSE)),
    ("Stop", Act::Frame(&fixed::STOP)),
    ("Pause directly after a byte of noise, with one more every 6 ms", Act::InNoise(&fixed::PAUSE)),
    ("Stop directly after a byte of noise, with one more every 6 ms", Act::InNoise(&fixed::STOP)),
    ("Pause after 4,000 short frames", Act::Behind(&fixed::PAUSE)),
    ("Stop after 4,000 short frames", Act::Behind(&fixed::STOP)),
];
