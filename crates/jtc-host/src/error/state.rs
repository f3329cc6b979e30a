//! Errors while the library waits for a state of the controller.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, next};
use jtc_wire::{Code, ControllerState, Joint, Status, StopCause};

use super::facts;
use crate::{held_stop, labels};

/// Reason why the controller did not reach the expected state.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The controller reports errors in its status.
    #[error("the controller reports an error: {}", labels::errors_line(status))]
    Device {
        /// Status that contains the errors.
        status: Box<Status>,
    },
    /// The arm is in a held stop (J-69): the drives hold the arm, and no motion is possible until the cause is cleared.
    #[error("the arm is in a held stop: {}", labels::why_held(status, cause.as_ref()))]
    HeldStop {
        /// Status that contains the errors of the joints.
        status: Box<Status>,
        /// First cause of the held stop, with its value and limit; `None` if the device does not report the cause.
        cause: Option<StopCause>,
    },
    /// The controller did not reach the expected state in time.
    #[error("{what} not reached within {waited_s:.1} s: {}", labels::waiting_for(status))]
    Timeout {
        /// Name of the expected state.
        what: &'static str,
        /// Time for which the library waited, s.
        waited_s: f64,
        /// Last status that was received.
        status: Box<Status>,
    },
    /// The controller is not in HoldPos and does not change to HoldPos.
    #[error("{}", labels::waiting_for(status))]
    NotReady {
        /// Status that shows that the controller is not ready.
        status: Box<Status>,
    },
    /// The two encoders of a joint disagree (J-35): one encoder has jumped, or the drive reports the speed in another
    /// scale than the controller expects. The controller executes no trajectory until the drives are configured
    /// again.
    #[error(
        "{}: the position is not reliable, because the encoder has jumped or the speed of the drive does not match; the controller executes no \
         trajectory until the drive is reset",
        labels::joints(joints)
    )]
    EncoderJumped {
        /// Joints whose encoders disagree.
        joints: Vec<Joint>,
    },
    /// The controller reports errors while a guided motion is recorded.
    #[error("{}", labels::errors_line(status))]
    TeachingFault {
        /// Status with the errors.
        status: Box<Status>,
    },
    /// Teaching ended while a guided motion was recorded.
    #[error("teaching has ended: the controller is in {state}; the recording ends at this point")]
    TeachingEnded {
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The arm moves, but a pose can be saved only at rest.
    #[error("{what}, but a pose can be saved only at rest; nothing was saved")]
    Moving {
        /// Text that names the moving joint or the motion.
        what: String,
    },
    /// The position of a joint is unknown.
    #[error("{joint}: the position is unknown; nothing was saved")]
    NotMeasured {
        /// Joint with the unknown position.
        joint: Joint,
    },
    /// The arm moves, so it would fall if the reset of these nodes switched off their torque.
    #[error("{nodes} cannot be reset in {state}: the arm would fall")]
    WouldFall {
        /// Names of the nodes that the caller wanted to reset.
        nodes: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The arm is under torque, and a reset of these nodes can switch off the torque.
    #[error(
        "the arm has torque ({state}), and a reset of {nodes} can remove it: the arm may fall; nothing was sent"
    )]
    MayFall {
        /// Names of the nodes that the caller wanted to reset.
        nodes: String,
        /// State of the controller.
        state: Code<ControllerState>,
    },
    /// The user has marked joints as absent, so the controller executes no motion.
    #[error(
        "{}: marked as absent, so the controller executes no motion; nothing was sent",
        labels::joints(joints)
    )]
    Absent {
        /// Joints that the user has marked as absent.
        joints: Vec<Joint>,
    },
}

impl Diagnose for StateError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Device { .. } => Diagnosis::new(
                ErrorKind::Device,
                "device-error",
                next!("{} returns the controller to HoldPos, {} explains each error", Recover, ExplainCode),
            ),
            Self::HeldStop { status, cause } => {
                Diagnosis::new(ErrorKind::Fault, "held-stop", held_stop::next_step(status, cause.as_ref()))
            }
            Self::EncoderJumped { .. } => {
                Diagnosis::new(ErrorKind::Fault, "encoder-jumped", held_stop::after_encoder_jump())
            }
            Self::Timeout { status, .. } => {
                Diagnosis::new(ErrorKind::Device, "state-timeout", labels::next_step(status))
            }
            Self::NotReady { status } => {
                Diagnosis::new(ErrorKind::Device, "not-ready", labels::next_step(status))
            }
            Self::TeachingFault { status } => {
                Diagnosis::new(ErrorKind::Fault, "run-fault", labels::next_step(status))
            }
            Self::TeachingEnded { .. } => Diagnosis::new(
                ErrorKind::Fault,
                "not-teaching",
                next!("{} starts a new recording", TeachRecord),
            ),
            Self::Moving { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "moving",
                next!("wait until the arm is at rest, or {}", Pause),
            ),
            Self::NotMeasured { .. } => Diagnosis::new(
                ErrorKind::Device,
                "not-measured",
                next!("{} shows the state of the joints, {} makes them ready", Status, Recover),
            ),
            Self::WouldFall { state, .. } => {
                let next = if *state == ControllerState::Operate {
                    next!("{} first", Stop)
                } else {
                    next!("{} first", TeachOff)
                };
                Diagnosis::new(ErrorKind::Refused, "powered", next)
            }
            Self::MayFall { .. } => {
                Diagnosis::new(ErrorKind::Refused, "powered", next!("support the arm, then {}", ResetMayFall))
            }
            Self::Absent { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "absent-joints",
                next!(
                    "{} lists the absent joints; {} moves the other joints. To end the work on a bench: {}, then {}; an arm without brakes falls",
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
            Self::Device { status }
            | Self::Timeout { status, .. }
            | Self::NotReady { status }
            | Self::TeachingFault { status } => facts::of_status(status),
            Self::HeldStop { status, cause } => facts::of_held_stop(status, cause.as_ref()),
            Self::Absent { joints } | Self::EncoderJumped { joints } => {
                joints.first().map_or_else(Facts::default, |joint| facts::of_joint(*joint))
            }
            Self::NotMeasured { joint } => facts::of_joint(*joint),
            Self::Moving { .. }
            | Self::TeachingEnded { .. }
            | Self::WouldFall { .. }
            | Self::MayFall { .. } => Facts::default(),
        }
    }
}
