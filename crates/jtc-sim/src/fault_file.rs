#![doc = include_str!("fault_file.md")]
use jtc_bus::{GRIPPER, Joint};
use jtc_core::{ControllerState, JOINTS};
use serde::Deserialize;

use crate::arm::Side;
use crate::faults::{Fault, FaultKind, FaultPlan, Trigger};
use crate::hand::HandPath;
use crate::typed::PUSH_MAX;

mod error;

pub use error::FaultFileError;

const SIDES: [(&str, Side); 2] = [("above", Side::Above), ("below", Side::Below)];

const STATES: [(&str, ControllerState); 6] = [
    ("start", ControllerState::Start),
    ("init", ControllerState::Init),
    ("hold", ControllerState::HoldPos),
    ("operate", ControllerState::Operate),
    ("teaching", ControllerState::Teaching),
    ("error", ControllerState::Error),
];

/// The key `format`, which every version of the file format contains.
#[derive(Deserialize)]
struct Head {
    format: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "format")]
    _format: Option<f64>,
    #[serde(default)]
    fault: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: String,
    node: Option<f64>,
    joint: Option<f64>,
    gripper: Option<bool>,
    torque_nm: Option<f64>,
    file: Option<String>,
    bits: Option<f64>,
    rad: Option<f64>,
    factor: Option<f64>,
    celsius: Option<f64>,
    probability: Option<f64>,
    position_m: Option<Vec<f64>>,
    normal: Option<Vec<f64>>,
    stiffness_n_m: Option<f64>,
    damping_ns_m: Option<f64>,
    side: Option<String>,
    stiffness_nm_rad: Option<f64>,
    damping_nms_rad: Option<f64>,
    mass_kg: Option<f64>,
    com_m: Option<Vec<f64>>,
    at_s: Option<f64>,
    in_state: Option<String>,
    after_s: Option<f64>,
    at_point: Option<f64>,
    for_s: Option<f64>,
}

/// Description of fault files for users (Markdown).
pub const FAULT_FILE_HELP: &str = include_str!("fault_file.md");

/// Format number of the accepted files. Since format 2, joints are counted from 1.
const FORMAT: f64 = 2.0;
/// Longest time in a file, s.
const YEAR_S: f64 = 3.2e7;
/// Largest coordinate of a position in the base frame, m. The limit also applies to the centre of mass of a load in the flange
/// frame.
const PLACE_MAX: f64 = 10.0;
const COM_MAX: f64 = 2.0;
/// Largest mass of a load, kg.
const MASS_MAX: f64 = 100.0;
/// Range of the stiffness of a wall at the flange, N/m. The next three constants are the largest damping at the
/// flange (N·s/m), and the range of the stiffness (N·m/rad) and the largest damping (N·m·s/rad) at a joint.
const STIFFNESS: (f64, f64) = (1.0, 1e6);
const DAMPING_MAX: f64 = 1e4;
const JOINT_STIFFNESS: (f64, f64) = (1.0, 1e5);
const JOINT_DAMPING_MAX: f64 = 1e3;

impl FaultPlan {
    /// Reads a fault file that does not use trajectory files for simulated hands. [`FAULT_FILE_HELP`] describes the
    /// format.
    pub fn from_toml(text: &str) -> Result<Self, FaultFileError> {
        Self::from_toml_with(text, |file| Err(format!("{file}: files cannot be read here")))
    }

    /// Reads a fault file. `load` reads the trajectory files of simulated hands, and returns the reason if it cannot
    /// read a file.
    pub fn from_toml_with(
        text: &str,
        mut load: impl FnMut(&str) -> Result<HandPath, String>,
    ) -> Result<Self, FaultFileError> {
        let syntax = |e: toml::de::Error| FaultFileError::Syntax(e.to_string());
        // The format is checked first, because other formats can have other keys.
        let Head { format } = toml::from_str(text).map_err(syntax)?;
        if format != Some(FORMAT) {
            return Err(FaultFileError::Format { found: format });
        }
        let file: File = toml::from_str(text).map_err(syntax)?;
        let mut plan = Self::default();
        for (number, entry) in (1..).zip(file.fault) {
            let fault = Reader { number, entry, hands: &mut plan.hands, load: &mut load }.read()?;
            plan.faults.push(fault);
        }
        Ok(plan)
    }
}

struct Reader<'a> {
    number: usize,
    entry: Entry,
    hands: &'a mut Vec<HandPath>,
    load: &'a mut dyn FnMut(&str) -> Result<HandPath, String>,
}

impl Reader<'_> {
    fn read(mut self) -> Result<Fault, FaultFileError> {
        if let Some(node) = self.entry.node {
            return Err(FaultFileError::Node { fault: self.number, node });
        }
        let kind = self.kind()?;
        let trigger = self.trigger()?;
        let duration_ms = match self.entry.for_s.take() {
            Some(s) => Some(ms(self.in_range("for_s", s, 0.0, YEAR_S)?)),
            // A push without a duration is an error.
            None if matches!(kind, FaultKind::Push { .. }) => return Err(self.missing("for_s")),
            None => None,
        };
        self.nothing_left()?;
        Ok(Fault { kind, trigger, duration_ms })
    }

    fn hand(&mut self) -> Result<FaultKind, FaultFileError> {
        let file = self.entry.file.take().ok_or_else(|| self.missing("file"))?;
        let path = (self.load)(&file).map_err(|text| FaultFileError::Hand { fault: self.number, text })?;
        self.hands.push(path);
        Ok(FaultKind::Hand { path: self.hands.len() - 1 })
    }

    fn wall(&mut self) -> Result<FaultKind, FaultFileError> {
        let position = self.entry.position_m.take().ok_or_else(|| self.missing("position_m"))?;
        let position = self.vector("position_m", position, PLACE_MAX)?;
        let normal = self.entry.normal.take().ok_or_else(|| self.missing("normal"))?;
        let normal = self.vector("normal", normal, 1e3)?;
        if normal.iter().all(|x| x.abs() < 1e-6) {
            return Err(FaultFileError::NoDirection { fault: self.number, normal });
        }
        let (low, high) = STIFFNESS;
        let stiffness = self.take("stiffness_n_m", |e| &mut e.stiffness_n_m, low, high)?;
        let damping = self.entry.damping_ns_m.take().unwrap_or(0.0);
        let damping = self.in_range("damping_ns_m", damping, 0.0, DAMPING_MAX)?;
        Ok(FaultKind::Wall { position, normal, stiffness, damping })
    }

    fn joint_wall(&mut self) -> Result<FaultKind, FaultFileError> {
        let joint = self.joint()?;
        let rad = self.take("rad", |e| &mut e.rad, -6.3, 6.3)?;
        let name = self.entry.side.take().ok_or_else(|| self.missing("side"))?;
        let Some(&(_, side)) = SIDES.iter().find(|(known, _)| *known == name) else {
            return Err(FaultFileError::UnknownSide { fault: self.number, side: name });
        };
        let (low, high) = JOINT_STIFFNESS;
        let stiffness = self.take("stiffness_nm_rad", |e| &mut e.stiffness_nm_rad, low, high)?;
        let damping = self.entry.damping_nms_rad.take().unwrap_or(0.0);
        let damping = self.in_range("damping_nms_rad", damping, 0.0, JOINT_DAMPING_MAX)?;
        Ok(FaultKind::JointWall { joint, rad, side, stiffness, damping })
    }

    /// Checks that there are three numbers, each between −`most` and `most`.
    fn vector(&self, key: &'static str, numbers: Vec<f64>, most: f64) -> Result<[f64; 3], FaultFileError> {
        for &number in &numbers {
            self.in_range(key, number, -most, most)?;
        }
        let count = numbers.len();
        numbers.try_into().map_err(|_| FaultFileError::NotThree { fault: self.number, key, count })
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
            "push" => FaultKind::Push {
                joint: self.joint()?,
                torque: self.take("torque_nm", |e| &mut e.torque_nm, -PUSH_MAX, PUSH_MAX)?,
            },
            "wall" => self.wall()?,
            "joint-wall" => self.joint_wall()?,
            "payload" => FaultKind::Payload {
                mass: self.take("mass_kg", |e| &mut e.mass_kg, 0.001, MASS_MAX)?,
                com: match self.entry.com_m.take() {
                    Some(com) => self.vector("com_m", com, COM_MAX)?,
                    None => [0.0; 3],
                },
            },
            "brake-closed" => FaultKind::BrakeClosed { joint: self.joint()? },
            "hand" => self.hand()?,
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

    /// Returns the node of a joint or of the gripper.
    fn node(&mut self) -> Result<u8, FaultFileError> {
        match (self.entry.joint, self.entry.gripper.take()) {
            (Some(_), None | Some(false)) => Ok(self.joint()?.index() as u8),
            (None, Some(true)) => Ok(GRIPPER as u8),
            _ => Err(FaultFileError::Device { fault: self.number, kind: self.entry.kind.clone() }),
        }
    }

    fn joint(&mut self) -> Result<Joint, FaultFileError> {
        let number = self.whole("joint", |e| &mut e.joint, 1.0, JOINTS as f64)?;
        Joint::from_number(number.into()).ok_or_else(|| self.missing("joint"))
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
            return Err(self.missing(key));
        };
        self.in_range(key, value, low, high)
    }

    fn in_range(&self, key: &'static str, value: f64, low: f64, high: f64) -> Result<f64, FaultFileError> {
        // The comparison is false for NaN, so NaN is reported as out of range.
        if value >= low && value <= high {
            Ok(value)
        } else {
            Err(FaultFileError::Range { fault: self.number, key, value, allowed: (low, high) })
        }
    }

    /// Reports keys that were not used. Unused keys are mistakes in the fault file.
    fn nothing_left(&self) -> Result<(), FaultFileError> {
        let e = &self.entry;
        let keys = [
            ("joint", e.joint),
            ("gripper", e.gripper.map(f64::from)),
            ("torque_nm", e.torque_nm),
            ("file", e.file.as_ref().map(|_| 0.0)),
            ("bits", e.bits),
            ("rad", e.rad),
            ("factor", e.factor),
            ("celsius", e.celsius),
            ("probability", e.probability),
            ("position_m", e.position_m.as_ref().map(|_| 0.0)),
            ("normal", e.normal.as_ref().map(|_| 0.0)),
            ("stiffness_n_m", e.stiffness_n_m),
            ("damping_ns_m", e.damping_ns_m),
            ("side", e.side.as_ref().map(|_| 0.0)),
            ("stiffness_nm_rad", e.stiffness_nm_rad),
            ("damping_nms_rad", e.damping_nms_rad),
            ("mass_kg", e.mass_kg),
            ("com_m", e.com_m.as_ref().map(|_| 0.0)),
        ];
        match keys.iter().find(|(_, value)| value.is_some()) {
            Some((key, _)) => Err(self.superfluous(key)),
            None => Ok(()),
        }
    }

    fn missing(&self, key: &'static str) -> FaultFileError {
        FaultFileError::Missing { fault: self.number, kind: self.entry.kind.clone(), key }
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
