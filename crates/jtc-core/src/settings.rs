//! Settings that a host can read and change (J-53). This module contains the table of settings, and functions that apply a list of values
//! completely or not at all.
use jtc_dynamics::{Payload, PayloadError};
use jtc_wire::SettingValue;

use crate::JOINTS;
use crate::config::bounds::OutOfBounds;
use crate::config::{Config, ConfigError};

mod table;

pub use table::TABLE;

/// Number of the speed override (J-57).
pub const SPEED: u8 = 128;

/// Number of the tool speed limit (J-25).
pub const TOOL_SPEED: u8 = 79;

/// Number of the setting that marks a joint as absent (J-53).
pub const ABSENT: u8 = 16;
/// Number of the setting for the position of an absent joint in the model (J-53).
pub const ABSENT_POSITION: u8 = 17;

/// Numbers of the payload settings (J-60): the mass, the centre of mass (x, y, z), and the inertias Ixx, Ixy, Ixz, Iyy, Iyz and Izz.
pub const PAYLOAD: core::ops::RangeInclusive<u8> = 144..=153;

/// States in which a setting may be changed, in addition to Init and Error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Live {
    /// The setting can change only in Init and Error. A setting with `No` is part of the arm, so it is stored with the arm and included in
    /// the hash of the arm.
    No,
    /// The setting can change only in Init and Error, like a setting with `No`. A setting with `Unpowered` is not part of the arm.
    Unpowered,
    /// The setting can also change in HoldPos, Teaching and Pause, but not during a motion. A setting with `Standing` is not part of the
    /// arm.
    Standing,
    /// The setting can change in every state, even while the arm moves. A setting with `Always` is not part of the arm.
    Always,
}

/// Kind of a setting, which determines the storage of its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Number for each joint, stored in the joint limits.
    Joint,
    /// Number for each joint, stored outside the joint limits.
    Each,
    /// Switch for each joint, with the value 0 or 1.
    EachSwitch,
    /// Number for the whole arm.
    Number,
    /// Whole number for the whole arm.
    Whole,
    /// Switch for the whole arm, with the value 0 or 1.
    Switch,
}

/// Setting, as a row of the table of settings.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Number of the setting in the wire format.
    pub number: u8,
    /// Name of the setting in arm files, including the unit.
    pub name: &'static str,
    /// Unit of the setting. The text is empty if the setting has no unit.
    pub unit: &'static str,
    /// Lowest allowed value of the setting.
    pub low: f64,
    /// Highest allowed value of the setting.
    pub high: f64,
    /// `true` if the setting allows only whole numbers.
    pub whole: bool,
    /// States in which the setting may be changed.
    pub live: Live,
    /// Meaning of the setting.
    pub meaning: &'static str,
    pub(crate) kind: Kind,
}

/// Reason why the controller refuses the value of a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingError {
    /// The setting does not exist, or does not exist for this joint.
    Unknown {
        /// Number of the refused setting.
        setting: u8,
        /// Number of the joint, from 1. The joint number is 0 for a setting of the arm.
        joint: u8,
    },
    /// The value is out of range, NaN, or not a whole number.
    Value {
        /// Name of the setting.
        name: &'static str,
        /// Number of the joint, from 1. The joint number is 0 for a setting of the arm.
        joint: u8,
        /// The value that was refused.
        value: f64,
        /// Lowest allowed value.
        low: f64,
        /// Highest allowed value.
        high: f64,
    },
    /// The combination of settings is not valid.
    Config(ConfigError),
    /// The payload is not a valid body (J-60).
    Payload(PayloadError),
    /// The payload exceeds the bounds of masses and inertias (J-06).
    Bounds(OutOfBounds),
}

impl core::fmt::Display for SettingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Unknown { setting, joint: 0 } => write!(f, "setting {setting} of the arm does not exist"),
            Self::Unknown { setting, joint } => {
                write!(f, "setting {setting} of joint {joint} does not exist")
            }
            Self::Value { name, joint, value, low, high } => {
                if joint > 0 {
                    write!(f, "joint {joint}, ")?;
                }
                write!(f, "{name}: {value} is not a valid value, expected {low} to {high}")
            }
            Self::Config(error) => error.fmt(f),
            Self::Payload(error) => error.fmt(f),
            Self::Bounds(OutOfBounds { what, value, low, high, .. }) => {
                write!(f, "{what} is {value}, expected {low} to {high}")
            }
        }
    }
}

impl core::error::Error for SettingError {}

impl Setting {
    /// Returns `true` if the setting has a separate value for each joint.
    pub const fn of_joint(&self) -> bool {
        matches!(self.kind, Kind::Joint | Kind::Each | Kind::EachSwitch)
    }

    /// Returns `true` if the setting is part of the arm, so that it is stored with the arm and included in the hash of the arm.
    pub const fn of_arm(&self) -> bool {
        matches!(self.live, Live::No)
    }

    /// Returns the number of values of the setting, which is 1 or the number of joints.
    const fn count(&self) -> usize {
        if self.of_joint() { JOINTS } else { 1 }
    }

    /// Returns the value of the setting in `config`. `joint` is the number of the joint, from 1, or 0 for a setting of the arm. Returns
    /// `None` if the setting has no value for this joint.
    pub fn get(&self, config: &Config, joint: u8) -> Option<f64> {
        table::get(config, self.number, self.index(joint)?)
    }

    /// Returns the index of the value for `joint`, which is the number of a joint, from 1, or 0 for a setting of the arm. Returns `None` if
    /// the setting has no value for this joint.
    fn index(&self, joint: u8) -> Option<usize> {
        if self.of_joint() { usize::from(joint).checked_sub(1) } else { (joint == 0).then_some(0) }
    }

    /// Returns the values of the setting in `config`, beginning with index `first`.
    fn values_from(&self, config: &Config, first: usize) -> impl Iterator<Item = SettingValue> + use<'_> {
        let (start, end) = if self.of_joint() { (1, JOINTS as u8) } else { (0, 0) };
        let values = core::array::from_fn::<f64, JOINTS, _>(|j| {
            self.get(config, if self.of_joint() { j as u8 + 1 } else { 0 }).unwrap_or(0.0)
        });
        (start..=end).zip(values).skip(first).map(|(joint, value)| SettingValue {
            setting: self.number,
            joint,
            value,
        })
    }

    /// Changes the value of the setting in `config`.
    fn set(&self, config: &mut Config, joint: u8, value: f64) -> Result<(), SettingError> {
        // The comparison also rejects NaN. The conversion to `i32` is exact for every whole number in a range.
        let taken = value >= self.low && value <= self.high && (!self.whole || value == value as i32 as f64);
        if !taken {
            let Self { name, low, high, .. } = *self;
            return Err(SettingError::Value { name, joint, value, low, high });
        }
        let written = self.index(joint).is_some_and(|index| table::set(config, self.number, index, value));
        written.then_some(()).ok_or(SettingError::Unknown { setting: self.number, joint })
    }
}

/// Returns the row of the setting with this number.
pub fn setting(number: u8) -> Option<&'static Setting> {
    TABLE.iter().find(|setting| setting.number == number)
}

/// Returns the row of the setting with this name.
pub fn named(name: &str) -> Option<&'static Setting> {
    TABLE.iter().find(|setting| setting.name == name)
}

/// Returns the number of values in the table. If `arm_only` is `true`, the function counts only the values that are part of the arm.
pub fn count(arm_only: bool) -> usize {
    TABLE.iter().filter(|setting| !arm_only || setting.of_arm()).map(Setting::count).sum()
}

/// Returns the values of a configuration in the order of the table, beginning with index `first`. If `arm_only` is `true`, the function
/// returns only the values that are part of the arm.
pub fn values(config: &Config, first: usize, arm_only: bool) -> impl Iterator<Item = SettingValue> {
    let mut skip = first;
    TABLE.iter().filter(move |setting| !arm_only || setting.of_arm()).flat_map(move |setting| {
        let here = skip.min(setting.count());
        skip -= here;
        setting.values_from(config, here)
    })
}

/// Sets one value in a configuration, without a check of the whole configuration.
///
/// # Errors
/// Returns an error if this value is refused.
pub fn apply(config: &mut Config, value: SettingValue) -> Result<(), SettingError> {
    let SettingValue { setting: number, joint, value } = value;
    setting(number).ok_or(SettingError::Unknown { setting: number, joint })?.set(config, joint, value)
}

/// Returns the values of a payload, which must be set together (J-60).
pub fn payload_values(payload: &Payload) -> impl Iterator<Item = SettingValue> {
    let Payload { mass, com: [x, y, z], inertia: [xx, xy, xz, yy, yz, zz] } = *payload;
    PAYLOAD.zip([mass, x, y, z, xx, xy, xz, yy, yz, zz]).map(|(setting, value)| SettingValue {
        setting,
        joint: 0,
        value,
    })
}

/// Returns a copy of the configuration in which these values are changed.
///
/// # Errors
/// Returns an error for the first value that is refused, or if the resulting configuration is not valid.
pub fn with_values(
    config: &Config,
    values: impl Iterator<Item = SettingValue>,
) -> Result<Config, SettingError> {
    let mut next = config.clone();
    for value in values {
        apply(&mut next, value)?;
    }
    next.check().map_err(SettingError::Config)?;
    // The payload is checked only if it changes. The principal moments of a payload take too long to compute if only
    // the speed override changes during a motion.
    if next.payload != config.payload {
        next.payload.check().map_err(SettingError::Payload)?;
    }
    next.parameter_bounds.check_payload(&next.payload).map_err(SettingError::Bounds)?;
    Ok(next)
}

#[cfg(test)]
mod tests;
