//! Errors in the communication with the controller.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};
use jtc_wire::{Code, ControllerState, DataStatus, FrameStatus, FrameType, Response, TrajectoryState};

use crate::labels;
use crate::port::PortError;

/// Reason why a request was not sent, not answered or not accepted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The port to the controller cannot be used.
    #[error(transparent)]
    Port(#[from] PortError),
    /// No status was received from the controller.
    #[error("{port}: no status within {waited_s:.1} s ({})", received(*bytes))]
    NoLink {
        /// Name of the port.
        port: String,
        /// Bit rate of the serial line, Bd.
        baud: Option<u32>,
        /// Time for which the program waited for a status, s.
        waited_s: f64,
        /// Number of bytes received while the program waited for a status.
        bytes: u64,
    },
    /// The controller did not confirm a request, but the program receives status frames.
    #[error("{}: not confirmed in {tries} tries", labels::request(*request))]
    NotConfirmed {
        /// Type of the request.
        request: FrameType,
        /// Number of times that the request was sent.
        tries: u32,
        /// Last negative response to the request; `None` if no negative response was received.
        last: Option<Response>,
    },
    /// The controller does not have the extensions that the request needs.
    #[error("{}: this device has no extensions", labels::request(*request))]
    NoExtension {
        /// Type of the request.
        request: FrameType,
    },
    /// The agent that shares the line to the controller rejected the request, so the request did not reach the controller.
    #[error("{}: not sent: {reason}", labels::request(*request))]
    Denied {
        /// Type of the request.
        request: FrameType,
        /// Reason for the refusal.
        reason: String,
    },
    /// The controller refused a request.
    #[error("{}: {} (state {}, trajectory {})", labels::request(*request), labels::data_status(*code), state, trajectory)]
    Refused {
        /// Type of the request.
        request: FrameType,
        /// Reason for the refusal.
        code: DataStatus,
        /// State of the controller when it refused the request.
        state: Code<ControllerState>,
        /// Trajectory execution state when the controller refused the request.
        trajectory: Code<TrajectoryState>,
    },
}

fn received(bytes: u64) -> String {
    match bytes {
        0 => "no byte received".into(),
        n => format!("{n} bytes received, but they contain no frame"),
    }
}

impl Diagnose for LinkError {
    fn diagnosis(&self) -> Diagnosis {
        let no_link = |code, next: Next| Diagnosis::new(ErrorKind::NoLink, code, next);
        match self {
            Self::Port(e) => e.diagnosis(),
            Self::NoLink { bytes: 0, .. } => no_link(
                "no-link",
                next!(
                    "check cable and power of the controller, then run {}; `jtc ports` lists all ports",
                    Doctor
                ),
            ),
            Self::NoLink { baud, .. } => {
                let baud = baud.map_or("none".into(), |b| b.to_string());
                no_link(
                    "no-link",
                    Next::from(format!("the rate is probably wrong ({baud} Bd here): try ")).then(next!(
                        "{}; {} tries all rates",
                        Baud,
                        Doctor
                    )),
                )
            }
            Self::NotConfirmed { .. } => {
                no_link("not-confirmed", next!("the line to the controller loses bytes: {}", Doctor))
            }
            Self::NoExtension { .. } => Diagnosis::new(
                ErrorKind::Device,
                "no-extension",
                next!(
                    "the firmware of this device supports only the protocol of existing devices; {} shows the details that are known",
                    Info
                ),
            ),
            Self::Denied { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "not-sent",
                next!(
                    "{} shows the state, and the agent shows the lease holder; the agent accepts Stop and Pause from every client",
                    Status
                ),
            ),
            Self::Refused { request, code, state, trajectory } => {
                let next = match request {
                    FrameType::TrajSetExecStatus => after_refused_execution(*code, *state, *trajectory),
                    FrameType::ArmModel | FrameType::ArmModelUseDefault
                        if *code == DataStatus::IncorrectValue =>
                    {
                        Some(next!(
                            "a number is beyond its bounds, or a joint of this arm is too light for the gains in the controller (check with {}). Or \
                             a joint cannot hold this arm with its payload in the present pose: {}, {}",
                            ArmCheck,
                            PayloadShow,
                            PayloadClear
                        ))
                    }
                    FrameType::PidParam | FrameType::PidParamUseDefault
                        if *code == DataStatus::IncorrectValue =>
                    {
                        Some(next!(
                            "a gain is beyond its bounds, or a joint is too light for it (check with {}). While the arm is held, the controller \
                             also refuses a Kp that hardly holds the arm, and an integral that holds less than now",
                            ArmCheck
                        ))
                    }
                    FrameType::ClearCurrentErrors | FrameType::ClearOccurredErrors
                        if *code == DataStatus::NotAllowed =>
                    {
                        Some(Next::from(
                            "the cause is still present, a joint still yields, or the arm still moves: free the arm, wait until it is at rest, then \
                             try again",
                        ))
                    }
                    FrameType::SetSettings | FrameType::SetName if *code == DataStatus::NotAllowed => {
                        Some(next!(
                            "settings can change only while the torque is off: {}, then try again. An arm without brakes falls. Nothing was changed",
                            Disable
                        ))
                    }
                    FrameType::Jog
                        if *code == DataStatus::NotAllowed && *state == ControllerState::HoldPos =>
                    {
                        Some(next!(
                            "{} ends a paused trajectory, {} ends a held stop. Otherwise gravity needs the whole torque limit of a joint in this \
                             direction: jog the other way, or remove payload",
                            Stop,
                            Clear
                        ))
                    }
                    _ => None,
                };
                Diagnosis::new(
                    ErrorKind::Device,
                    "refused",
                    next.unwrap_or_else(|| after_refusal(*code, *state)),
                )
            }
        }
    }
}

impl LinkError {
    /// Returns `true` if the line or the port failed, so it is unknown if the controller received the request.
    pub(crate) fn is_loss(&self) -> bool {
        !matches!(
            self,
            Self::Refused { .. }
                | Self::Denied { .. }
                | Self::NoExtension { .. }
                | Self::Port(PortError::Halted { .. })
        )
    }
}

/// Returns special advice for some refused Execute, Pause and Stop commands; `None` if the general advice applies.
fn after_refused_execution(
    code: DataStatus,
    state: Code<ControllerState>,
    trajectory: Code<TrajectoryState>,
) -> Option<Next> {
    use TrajectoryState::*;
    if trajectory == Pause && is_place(code) {
        return Some(next!(
            "the arm was moved after the Pause: Resume requires each joint within 0.02 rad of its paused position. {}, then {}",
            Stop,
            TrajRunWithApproach
        ));
    }
    let loaded = state == ControllerState::HoldPos && trajectory.is_in(&[Stop, Finish]);
    if loaded && code == DataStatus::IncorrectValue {
        return Some(next!(
            "the trajectory in the controller exceeds a limit, or a bearing temperature is outside the friction table: {} shows the joint and its \
             errors. Check the file: {}",
            Status,
            TrajCheck
        ));
    }
    // In HoldPos without a motion, the controller refuses Execute with another code, and the session does not send
    // Resume. Therefore the code NotAllowed can only be the answer to Pause or Stop.
    let idle = state == ControllerState::HoldPos && trajectory.is_in(&[Null, Stop, Finish]);
    (idle && code == DataStatus::NotAllowed).then(|| {
        next!(
            "no trajectory is running, so the controller cannot pause or stop it; after a held stop, {} first. {} shows the state",
            Clear,
            Status
        )
    })
}

/// Returns `true` if the code can mean that the arm is not in the required position. If extended codes are not
/// enabled on the serial line, the controller sends the general code 6 instead of the codes 7 and 8 (J-51).
fn is_place(code: DataStatus) -> bool {
    matches!(code, DataStatus::StartPositionMismatch | DataStatus::IncorrectValue)
}

/// Returns the next step after the controller refused a request with this code in this state.
pub(super) fn after_refusal(code: DataStatus, state: Code<ControllerState>) -> Next {
    match (code, state.known()) {
        (DataStatus::NotAllowed, Some(ControllerState::Start | ControllerState::Init)) => {
            next!("the controller is not ready yet: {} names the cause", Doctor)
        }
        (DataStatus::NotAllowed, Some(ControllerState::Error)) => {
            next!("the controller is in Error: {}", Recover)
        }
        (DataStatus::NotAllowed, Some(ControllerState::Teaching)) => next!("{} first", TeachOff),
        (DataStatus::NotAllowed, _) => {
            next!(
                "{} shows the state; {} ends a trajectory, {} ends a held stop. If a joint is marked as absent, the controller refuses motions and \
                 teaching",
                Status,
                Stop,
                Clear
            )
        }
        (DataStatus::StartPositionMismatch, _) => {
            next!(
                "the arm is not at the first point: {} moves it there first. If it is already there, a torque limit leaves too little for the \
                 remaining distance: begin in another pose, or remove payload",
                TrajRunWithApproach
            )
        }
        _ => next!("{} explains each code", Explain),
    }
}

/// Returns `true` if the response confirms the frame to which it belongs.
pub(crate) fn accepted(r: &Response) -> bool {
    r.status == FrameStatus::NoError && r.data == DataStatus::NoError
}
