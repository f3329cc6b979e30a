//! Errors of waiting for a state.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, next};
use jtc_wire::{Code, ControllerState, Joint, Status, StopCause};

use super::facts;
use crate::{held_stop, words};

/// Why the controller did not come to the state that was waited for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The controller reports errors.
    #[error("the controller reports an error: {}", words::errors_line(status))]
    Device {
        /// The status with the errors.
        status: Box<Status>,
    },
    /// The arm is in a held stop (J-69): it is held, and nothing moves until the cause is cleared.
    #[error("the arm is in a held stop: {}", words::why_held(status, cause.as_ref()))]
    HeldStop {
        /// The status with the causes.
        status: Box<Status>,
        /// What was found first, with its value and limit, where the device tells it.
        cause: Option<StopCause>,
    },
    /// A state was not reached.
    #[error("{what} not reached within {waited_s:.1} s: {}", words::waiting_for(status))]
    Timeout {
        /// What was waited for.
        what: &'static str,
        /// How long, s.
        waited_s: f64,
        /// The last status.
        status: Box<Status>,
    },
    /// The arm is not held, and nothing on the way to that is going on.
    #[error("{}", words::waiting_for(status))]
    NotReady {
        /// The status of then.
        status: Box<Status>,
    },
    /// The two encoders of joints do not fit (J-35): one has jumped, or the speed has another scale. No trajectory is executed until the
    /// drives have been configured again.
    #[error(
        "{}: the position is not to be trusted, because the encoder has jumped or its speed does not fit; no trajectory is executed until its drive was reset",
        words::joints(joints)
    )]
    EncoderJumped {
        /// Which.
        joints: Vec<Joint>,
    },
    /// The arm moves, and a pose is where it stands.
    #[error("{what}, and a pose is where the arm stands; nothing was saved")]
    Moving {
        /// What moves.
        what: String,
    },
    /// It is not known where a joint is.
    #[error("{joint}: its position is not known; nothing was saved")]
    NotMeasured {
        /// Which.
        joint: Joint,
    },
    /// The arm moves, and would fall without the torque of these nodes.
    #[error("{nodes} cannot be reset in {state}: the arm would fall")]
    WouldFall {
        /// Which, in words.
        nodes: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The arm has torque, which a reset of these nodes can take away.
    #[error(
        "the arm has torque ({state}), and a reset of {nodes} can take it away: the arm may fall; nothing was sent"
    )]
    MayFall {
        /// Which, in words.
        nodes: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// Joints are set absent, and the controller executes no motion.
    #[error("{}: set absent; no motion is executed, and nothing was sent", words::joints(joints))]
    Absent {
        /// Which.
        joints: Vec<Joint>,
    },
}

impl Diagnose for StateError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Device { .. } => Diagnosis::new(
                ErrorKind::Device,
                "device-error",
                next!("{} leads back to HoldPos, {} explains each error", Recover, ExplainCode),
            ),
            Self::HeldStop { status, cause } => {
                Diagnosis::new(ErrorKind::Fault, "held-stop", held_stop::next_step(status, cause.as_ref()))
            }
            Self::EncoderJumped { .. } => {
                Diagnosis::new(ErrorKind::Fault, "encoder-jumped", held_stop::after_encoder_jump())
            }
            Self::Timeout { status, .. } => {
                Diagnosis::new(ErrorKind::Device, "state-timeout", words::next_step(status))
            }
            Self::NotReady { status } => {
                Diagnosis::new(ErrorKind::Device, "not-ready", words::next_step(status))
            }
            Self::Moving { .. } => {
                Diagnosis::new(ErrorKind::Refused, "moving", next!("wait until it stands, or {}", Pause))
            }
            Self::NotMeasured { .. } => Diagnosis::new(
                ErrorKind::Device,
                "not-measured",
                next!("{} shows the joints, {} brings them up", Status, Recover),
            ),
            Self::WouldFall { state, .. } => {
                let next = if *state == ControllerState::Operate {
                    next!("{} first", Stop)
                } else {
                    next!("{} first", TeachOff)
                };
                Diagnosis::new(ErrorKind::Refused, "powered", next)
            }
            Self::MayFall { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "powered",
                "support the arm, then `jtc reset` with --yes, or by HTTP with arm_may_fall: true",
            ),
            Self::Absent { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "absent-joints",
                next!(
                    "{} shows them; {} moves the joints that are there; {}, then {} ends it",
                    BenchShow,
                    Jog,
                    Disable,
                    BenchPresent
                ),
            ),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Device { status } | Self::Timeout { status, .. } | Self::NotReady { status } => {
                facts::of_status(status)
            }
            Self::HeldStop { status, cause } => facts::of_held_stop(status, cause.as_ref()),
            Self::Absent { joints } | Self::EncoderJumped { joints } => {
                joints.first().map_or_else(Facts::default, |joint| facts::of_joint(*joint))
            }
            Self::NotMeasured { joint } => facts::of_joint(*joint),
            Self::Moving { .. } | Self::WouldFall { .. } | Self::MayFall { .. } => Facts::default(),
        }
    }
}
