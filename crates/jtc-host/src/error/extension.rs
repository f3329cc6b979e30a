//! Errors when a program reads all values of an arm from a controller, sends them to the controller, or stores them there.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, next};
use jtc_core::settings::SettingError;
use jtc_wire::{Code, ControllerState, Joint, StoreState, TrajectoryState};

use super::facts;
use crate::arm::Difference;

/// Reason why an arm could not be read from a device or stored in it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExtensionError {
    /// The arm in the device changed while the program read it, so the received values do not belong to one arm.
    #[error("the arm of the device changed while it was read")]
    Changed,
    /// The device does not have an arm that this program can read.
    #[error("the arm of the device cannot be read: {why}")]
    NoArm {
        /// Reason why the program cannot read the arm in the device.
        why: String,
    },
    /// The arm file does not contain all parameters that a controller needs.
    #[error("{arm}: no {} in the file", missing.join(", no "))]
    Incomplete {
        /// Name of the arm.
        arm: String,
        /// Names of the parameters that a controller needs but the file does not contain.
        missing: Vec<&'static str>,
    },
    /// The arm in the device differs from the arm in the file (J-55).
    #[error("the controller has another arm than {arm}: {}", listed(differences))]
    Differs {
        /// Name of the arm in the file.
        arm: String,
        /// All values that differ between the file and the device.
        differences: Vec<Difference>,
    },
    /// An arm can be stored only while the torque is off, because the transfer changes the parameters that the
    /// controller uses to hold the arm.
    #[error("the arm cannot be stored in the state {state}; nothing was sent")]
    Powered {
        /// State of the controller at the time of the request.
        state: Code<ControllerState>,
    },
    /// The settings are invalid for every controller, or invalid in combination with the settings of this controller (J-53).
    #[error("{0}")]
    Setting(#[source] SettingError),
    /// The payload is not a physically possible body, or is outside the range of the controller (J-60).
    #[error("{why}")]
    NoBody {
        /// Reason why the payload is not valid.
        why: String,
    },
    /// A joint cannot hold the payload in the current pose (J-60).
    #[error("a payload of {mass} kg needs {torque:.1} N·m at {joint} in the present pose, limit {limit} N·m")]
    TooHeavy {
        /// Mass of the payload, kg.
        mass: f64,
        /// Joint whose torque exceeds its limit the most.
        joint: Joint,
        /// Torque that is necessary to hold the payload, N·m.
        torque: f64,
        /// Torque limit of the joint, N·m.
        limit: f64,
    },
    /// The payload cannot be changed during a motion (J-60).
    #[error("the payload cannot change during a motion (state {state}, trajectory {trajectory})")]
    PayloadInMotion {
        /// State of the controller when it refused the payload.
        state: Code<ControllerState>,
        /// Trajectory execution state when the controller refused the payload.
        trajectory: Code<TrajectoryState>,
    },
    /// The non-volatile memory of the device does not contain the arm.
    #[error("the arm was not stored: {state}")]
    NotStored {
        /// State of the non-volatile memory that the device reports.
        state: StoreState,
    },
}

/// Formats the first difference and the number of further differences.
fn listed(differences: &[Difference]) -> String {
    match differences {
        [] => "no difference was reported".into(),
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
                "another host may have sent an arm; try again",
            ),
            Self::NoArm { .. } => Diagnosis::new(
                ErrorKind::Device,
                "no-arm",
                next!("the firmware of the device has another version: {}; {} sends an arm", Info, ArmPush),
            ),
            Self::Incomplete { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "incomplete-arm",
                next!("{} lists the missing parts; nothing was sent", ArmCheck),
            ),
            Self::Differs { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "other-arm",
                next!("{} lists every difference; {} sends this arm to the controller", ArmDiff, ArmPush),
            ),
            Self::Powered { .. } => Diagnosis::new(
                ErrorKind::Device,
                "powered",
                next!(
                    "the controller can store arm parameters only while the torque is off. {} (an arm without brakes falls then), then push the file again",
                    Disable
                ),
            ),
            Self::Setting(_) => Diagnosis::new(
                ErrorKind::Usage,
                "setting",
                "docs/settings.md lists all settings with their ranges; nothing was changed",
            ),
            Self::NoBody { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "no-body",
                "give the mass in kg, the centre of mass in m from the flange, and the inertia in kg·m² about that centre; nothing was changed",
            ),
            Self::TooHeavy { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "too-heavy",
                next!(
                    "nothing was changed. Check that the mass is in kg and the centre of mass in m, along the axes of the flange. Otherwise move \
                     the arm with {} to a pose that needs less torque, or reduce the payload",
                    Jog
                ),
            ),
            Self::PayloadInMotion { .. } => Diagnosis::new(
                ErrorKind::Device,
                "in-motion",
                next!("nothing was changed; {} brings the arm to rest, {} shows the state", Pause, Status),
            ),
            Self::NotStored { .. } => Diagnosis::new(
                ErrorKind::Device,
                "not-stored",
                next!(
                    "the arm is in use until the device is switched off; {} shows the state of the memory, {} tries again",
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
