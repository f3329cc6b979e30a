//! Errors of reading, giving and keeping an arm as one thing.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, next};
use jtc_core::settings::SettingError;
use jtc_wire::{Code, ControllerState, Joint, StoreState, TrajectoryState};

use super::facts;
use crate::arm::Difference;

/// Why an arm could not be read from a device or kept by it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExtensionError {
    /// What was read is not one arm.
    #[error("the arm of the device changed while it was read")]
    Changed,
    /// What the device has is no arm that this program knows.
    #[error("the arm of the device: {why}")]
    NoArm {
        /// What is wrong with it.
        why: String,
    },
    /// An arm of which parts are missing.
    #[error("{arm}: no {} in the file", missing.join(", no "))]
    Incomplete {
        /// Name of the arm.
        arm: String,
        /// What a controller needs, and the file does not give.
        missing: Vec<&'static str>,
    },
    /// The device has another arm than the file gives (J-55).
    #[error("the controller has another arm than {arm}: {}", listed(differences))]
    Differs {
        /// Name of the arm of the file.
        arm: String,
        /// Every value that differs.
        differences: Vec<Difference>,
    },
    /// Storing changes what the arm is held by; it is for an arm without torque.
    #[error("the arm cannot be stored in {state}; nothing was sent")]
    Powered {
        /// What the device is in.
        state: Code<ControllerState>,
    },
    /// Settings that no controller takes, or not beside those that this one has (J-53).
    #[error("{0}")]
    Setting(#[source] SettingError),
    /// A payload that is no body, or none that a controller takes (J-60).
    #[error("{why}")]
    NoBody {
        /// What is wrong with it.
        why: String,
    },
    /// A payload that a joint cannot hold where the arm stands (J-60).
    #[error(
        "a payload of {mass} kg takes {torque:.1} N·m of {joint} where the arm stands, and its limit is {limit} N·m"
    )]
    TooHeavy {
        /// Mass of the payload, kg.
        mass: f64,
        /// The joint that lacks most.
        joint: Joint,
        /// What it would have to hold, N·m.
        torque: f64,
        /// Its limit, N·m.
        limit: f64,
    },
    /// A payload is not changed while a motion runs (J-60).
    #[error(
        "the payload is not changed while the arm moves by command (state {state}, trajectory {trajectory})"
    )]
    PayloadInMotion {
        /// State of the controller then.
        state: Code<ControllerState>,
        /// Trajectory execution state then.
        trajectory: Code<TrajectoryState>,
    },
    /// The memory of the device does not have it.
    #[error("the arm was not stored: {state}")]
    NotStored {
        /// What the device reports of its memory.
        state: StoreState,
    },
}

/// The first of them; the others are counted.
fn listed(differences: &[Difference]) -> String {
    match differences {
        [] => "it reports no difference".into(),
        [one] => one.to_string(),
        [one, rest @ ..] => format!("{one}, and {} more", rest.len()),
    }
}

impl Diagnose for ExtensionError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Changed => Diagnosis::new(
                ErrorKind::Device,
                "arm-changed",
                "is another host giving it an arm? Try again",
            ),
            Self::NoArm { .. } => Diagnosis::new(
                ErrorKind::Device,
                "no-arm",
                next!("its firmware is of another version: {}; {} gives it an arm", Info, ArmPush),
            ),
            Self::Incomplete { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "incomplete-arm",
                next!("{} names what is missing; nothing was sent", ArmCheck),
            ),
            Self::Differs { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "other-arm",
                next!("{} lists every value; {} gives the controller this arm", ArmDiff, ArmPush),
            ),
            Self::Powered { .. } => Diagnosis::new(
                ErrorKind::Device,
                "powered",
                next!(
                    "an arm is stored while it has no torque: {} (an arm without brakes falls), then push again",
                    Disable
                ),
            ),
            Self::Setting(_) => Diagnosis::new(
                ErrorKind::Usage,
                "setting",
                "docs/settings.md has all settings with their ranges; nothing was changed",
            ),
            Self::NoBody { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "no-body",
                "mass in kg, centre of mass in m from the flange, inertia in kg·m² about that centre; nothing was changed",
            ),
            Self::TooHeavy { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "too-heavy",
                next!(
                    "nothing was changed. Is the mass in kg and the centre of mass in m, along the axes of the flange? Else move the \
                     arm to a pose that takes less ({}), or take less on",
                    Jog
                ),
            ),
            Self::PayloadInMotion { .. } => Diagnosis::new(
                ErrorKind::Device,
                "in-motion",
                next!(
                    "nothing was changed; {} brings a motion to rest, {} shows what goes on",
                    Pause,
                    Status
                ),
            ),
            Self::NotStored { .. } => Diagnosis::new(
                ErrorKind::Device,
                "not-stored",
                next!(
                    "the arm is in use until the device is switched off; {} shows its memory, {} tries again",
                    Info,
                    ArmStore
                ),
            ),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::TooHeavy { joint, torque, limit, .. } => {
                Facts::beyond(*torque, *limit).at_joint(joint.number())
            }
            Self::Setting(error) => facts::of_setting(error),
            _ => Facts::default(),
        }
    }
}
