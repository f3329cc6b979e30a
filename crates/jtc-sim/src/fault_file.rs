#![doc = include_str!("fault_file.md")]
use core::fmt;

use jtc_core::State;
use serde::Deserialize;

use crate::faults::{Fault, FaultKind, FaultPlan, Trigger};

/// Why a fault file cannot be used.
#[derive(Clone, Debug, PartialEq)]
pub enum FaultFileError {
    /// It is not TOML of this form; the text says where and why.
    Syntax(String),
    /// There is no fault of this kind.
    UnknownKind {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// As written.
        kind: String,
    },
    /// A key that this kind needs is missing.
    Missing {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind.
        kind: String,
        /// The key.
        key: &'static str,
    },
    /// A key that means nothing here.
    Superfluous {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind.
        kind: String,
        /// The key.
        key: &'static str,
    },
    /// A value outside its range.
    Range {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// The key.
        key: &'static str,
        /// As written.
        value: f64,
        /// Smallest and largest.
        allowed: (f64, f64),
    },
    /// A whole number is needed.
    NotWhole {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// The key.
        key: &'static str,
        /// As written.
        value: f64,
    },
    /// There is no such state.
    UnknownState {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// As written.
        state: String,
    },
    /// Not exactly one of `at_s`, `in_state`, `at_point`.
    Trigger {
        /// Number of the fault in the file, from 1.
        fault: usize,
    },
}

impl fmt::Display for FaultFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Syntax(text) => f.write_str(text),
            Self::UnknownKind { fault, kind } => {
                write!(f, "fault {fault}: there is no kind `{kind}`; kinds are {}", KINDS.join(", "))
            }
            Self::Missing { fault, kind, key } => write!(f, "fault {fault}: `{kind}` needs the key `{key}`"),
            Self::Superfluous { fault, kind, key } => {
                write!(f, "fault {fault}: the key `{key}` means nothing for `{kind}`; remove it")
            }
            Self::Range { fault, key, value, allowed: (low, high) } => {
                write!(f, "fault {fault}: {key} = {value} is outside {low}..{high}")
            }
            Self::NotWhole { fault, key, value } => {
                write!(f, "fault {fault}: {key} = {value} is not a whole number")
            }
            Self::UnknownState { fault, state } => {
                let names: Vec<_> = STATES.iter().map(|(name, _)| *name).collect();
                write!(f, "fault {fault}: there is no state `{state}`; states are {}", names.join(", "))
            }
            Self::Trigger { fault } => {
                write!(f, "fault {fault}: say when with exactly one of at_s, in_state, at_point")
            }
        }
    }
}

impl std::error::Error for FaultFileError {}

const KINDS: [&str; 21] = [
    "node-silent",
    "node-reboot",
    "motor-fault",
    "hardware-fault",
    "fault-state",
    "ignores-state",
    "encoder-jump",
    "not-accurate",
    "friction",
    "temperature",
    "frames-lost",
    "frames-corrupted",
    "frames-garbled",
    "bus-off",
    "no-acknowledge",
    "safety-input",
    "safety-line",
    "serial-lost",
    "serial-flipped",
    "serial-delayed",
    "tick-overrun",
];

const STATES: [(&str, State); 6] = [
    ("start", State::Start),
    ("init", State::Init),
    ("hold", State::HoldPos),
    ("operate", State::Operate),
    ("teaching", State::Teaching),
    ("error", State::Error),
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    fault: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: String,
    node: Option<f64>,
    joint: Option<f64>,
    bits: Option<f64>,
    rad: Option<f64>,
    factor: Option<f64>,
    celsius: Option<f64>,
    probability: Option<f64>,
    at_s: Option<f64>,
    in_state: Option<String>,
    after_s: Option<f64>,
    at_point: Option<f64>,
    for_s: Option<f64>,
}

/// What fault files look like, for people (Markdown).
pub const FAULT_FILE_HELP: &str = include_str!("fault_file.md");

/// Longest time in a file, s.
const YEAR_S: f64 = 3.2e7;

impl FaultPlan {
    /// Read a fault file; [`FAULT_FILE_HELP`] describes them.
    pub fn from_toml(text: &str) -> Result<Self, FaultFileError> {
        let file: File = toml::from_str(text).map_err(|e| FaultFileError::Syntax(e.to_string()))?;
        let faults = (1..).zip(file.fault).map(|(number, entry)| Reader { number, entry }.read());
        Ok(Self { faults: faults.collect::<Result<_, _>>()? })
    }
}

struct Reader {
    number: usize,
    entry: Entry,
}

impl Reader {
    fn read(mut self) -> Result<Fault, FaultFileError> {
        let kind = self.kind()?;
        let trigger = self.trigger()?;
        let duration_ms = match self.entry.for_s.take() {
            Some(s) => Some(ms(self.in_range("for_s", s, 0.0, YEAR_S)?)),
            None => None,
        };
        self.nothing_left()?;
        Ok(Fault { kind, trigger, duration_ms })
    }

    fn kind(&mut self) -> Result<FaultKind, FaultFileError> {
        Ok(match self.entry.kind.as_str() {
            "node-silent" => FaultKind::NodeSilent { node: self.node()? },
            "node-reboot" => FaultKind::NodeReboot { node: self.node()? },
            "motor-fault" => FaultKind::MotorFault { joint: self.joint()?, bits: self.bits()? },
            "hardware-fault" => FaultKind::HardwareFault { joint: self.joint()? },
            "fault-state" => FaultKind::FaultState { joint: self.joint()? },
            "ignores-state" => FaultKind::IgnoresState { joint: self.joint()? },
            "encoder-jump" => FaultKind::EncoderJump {
                joint: self.joint()?,
                rad: self.take("rad", |e| &mut e.rad, -6.3, 6.3)?,
            },
            "not-accurate" => FaultKind::NotAccurate { joint: self.joint()? },
            "friction" => FaultKind::Friction {
                joint: self.joint()?,
                factor: self.take("factor", |e| &mut e.factor, 0.0, 10.0)?,
            },
            "temperature" => FaultKind::Temperature {
                joint: self.joint()?,
                celsius: self.take("celsius", |e| &mut e.celsius, -40.0, 255.0)?,
            },
            "frames-lost" => FaultKind::FramesLost { probability: self.probability()? },
            "frames-corrupted" => FaultKind::FramesCorrupted { probability: self.probability()? },
            "frames-garbled" => FaultKind::FramesGarbled { probability: self.probability()? },
            "bus-off" => FaultKind::BusOff,
            "no-acknowledge" => FaultKind::NoAcknowledge,
            "safety-input" => FaultKind::SafetyInput,
            "safety-line" => FaultKind::SafetyLine { node: self.node()? },
            "serial-lost" => FaultKind::SerialLost { probability: self.probability()? },
            "serial-flipped" => FaultKind::SerialFlipped { probability: self.probability()? },
            "serial-delayed" => FaultKind::SerialDelayed,
            "tick-overrun" => FaultKind::TickOverrun,
            kind => return Err(FaultFileError::UnknownKind { fault: self.number, kind: kind.into() }),
        })
    }

    fn trigger(&mut self) -> Result<Trigger, FaultFileError> {
        let after = self.entry.after_s.take();
        let trigger = match (self.entry.at_s.take(), self.entry.in_state.take(), self.entry.at_point.take()) {
            (Some(s), None, None) => Trigger::At(ms(self.in_range("at_s", s, 0.0, YEAR_S)?)),
            (None, Some(name), None) => {
                let Some((_, state)) = STATES.iter().find(|(known, _)| *known == name) else {
                    return Err(FaultFileError::UnknownState { fault: self.number, state: name });
                };
                let after = self.in_range("after_s", after.unwrap_or(0.0), 0.0, YEAR_S)?;
                return Ok(Trigger::InState(*state, ms(after)));
            }
            (None, None, Some(k)) => Trigger::AtPoint(self.in_range("at_point", k, 0.0, 1e9)? as u32),
            _ => return Err(FaultFileError::Trigger { fault: self.number }),
        };
        match after {
            Some(_) => Err(self.superfluous("after_s")),
            None => Ok(trigger),
        }
    }

    fn node(&mut self) -> Result<u8, FaultFileError> {
        self.whole("node", |e| &mut e.node, 0.0, 6.0)
    }

    fn joint(&mut self) -> Result<u8, FaultFileError> {
        self.whole("joint", |e| &mut e.joint, 0.0, 5.0)
    }

    fn bits(&mut self) -> Result<u8, FaultFileError> {
        self.whole("bits", |e| &mut e.bits, 1.0, 255.0)
    }

    fn probability(&mut self) -> Result<f64, FaultFileError> {
        self.take("probability", |e| &mut e.probability, 0.0, 1.0)
    }

    fn whole(
        &mut self,
        key: &'static str,
        field: impl Fn(&mut Entry) -> &mut Option<f64>,
        low: f64,
        high: f64,
    ) -> Result<u8, FaultFileError> {
        let value = self.take(key, field, low, high)?;
        if value.fract() != 0.0 {
            return Err(FaultFileError::NotWhole { fault: self.number, key, value });
        }
        Ok(value as u8)
    }

    fn take(
        &mut self,
        key: &'static str,
        field: impl Fn(&mut Entry) -> &mut Option<f64>,
        low: f64,
        high: f64,
    ) -> Result<f64, FaultFileError> {
        let Some(value) = field(&mut self.entry).take() else {
            return Err(FaultFileError::Missing { fault: self.number, kind: self.entry.kind.clone(), key });
        };
        self.in_range(key, value, low, high)
    }

    fn in_range(&self, key: &'static str, value: f64, low: f64, high: f64) -> Result<f64, FaultFileError> {
        // Also refuses NaN.
        if value >= low && value <= high {
            Ok(value)
        } else {
            Err(FaultFileError::Range { fault: self.number, key, value, allowed: (low, high) })
        }
    }

    /// Keys that nobody asked for are mistakes of the writer.
    fn nothing_left(&self) -> Result<(), FaultFileError> {
        let e = &self.entry;
        let keys = [
            ("node", e.node),
            ("joint", e.joint),
            ("bits", e.bits),
            ("rad", e.rad),
            ("factor", e.factor),
            ("celsius", e.celsius),
            ("probability", e.probability),
        ];
        match keys.iter().find(|(_, value)| value.is_some()) {
            Some((key, _)) => Err(self.superfluous(key)),
            None => Ok(()),
        }
    }

    fn superfluous(&self, key: &'static str) -> FaultFileError {
        FaultFileError::Superfluous { fault: self.number, kind: self.entry.kind.clone(), key }
    }
}

fn ms(seconds: f64) -> u64 {
    (seconds * 1000.0).round() as u64
}

#[cfg(test)]
#[path = "fault_file_tests.rs"]
mod tests;
