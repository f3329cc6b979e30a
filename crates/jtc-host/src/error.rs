//! What can go wrong, with the facts in it, the kind of failure and the command that helps.

use jtc_wire::{
    Code, ControllerState, DataStatus, FrameStatus, FrameType, Response, Status, TrajectoryState,
};

use crate::arm::{Difference, NOT_CARRIED};
use crate::check::Verdict;
use crate::port::PortError;
use crate::words;
use host_kit::ErrorKind;

/// Any failure of this library.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A number or a count that no frame carries.
    #[error(transparent)]
    Frame(#[from] jtc_wire::EncodeError),
    /// The port cannot be used.
    #[error(transparent)]
    Port(#[from] PortError),
    /// No status came.
    #[error("{port}: no status within {waited_s:.1} s ({})", heard(*bytes))]
    NoLink {
        /// Name of the port.
        port: String,
        /// Rate of the line, Bd.
        baud: Option<u32>,
        /// How long was waited, s.
        waited_s: f64,
        /// Bytes that came meanwhile.
        bytes: u64,
    },
    /// A request was not confirmed, although statuses come.
    #[error("{}: not confirmed in {tries} tries", words::request(*request))]
    NotConfirmed {
        /// The request.
        request: FrameType,
        /// How often it was sent.
        tries: u32,
        /// The last bad record for it, if one came.
        last: Option<Response>,
    },
    /// The controller refused a request.
    #[error("{}: {} (state {}, trajectory {})", words::request(*request), words::data_status(*code), state, trajectory)]
    Refused {
        /// The request.
        request: FrameType,
        /// Why.
        code: DataStatus,
        /// State of the controller then.
        state: Code<ControllerState>,
        /// Trajectory execution state then.
        trajectory: Code<TrajectoryState>,
    },
    /// The controller refused a parameter, and this is beyond the bounds of known controllers.
    #[error("{}: {}: {beyond}", words::request(*request), words::data_status(DataStatus::IncorrectValue))]
    BeyondBounds {
        /// The request.
        request: FrameType,
        /// Joint, value and bounds.
        beyond: crate::arm::Beyond,
    },
    /// The controller refused a segment for good.
    #[error("segment {segment} of {segments}: {}", words::data_status(*code))]
    SegmentRefused {
        /// Number from 0.
        segment: usize,
        /// How many there are.
        segments: usize,
        /// Why.
        code: DataStatus,
    },
    /// The upload did not end with a complete trajectory.
    #[error(
        "upload given up after {restarts} restarts; segments confirmed: {confirmed} of {segments}, trajectory {}",
        trajectory
    )]
    UploadFailed {
        /// Segments known to have arrived.
        confirmed: usize,
        /// How many there are.
        segments: usize,
        /// Times the whole was begun again.
        restarts: u32,
        /// Trajectory execution state at the end.
        trajectory: Code<TrajectoryState>,
    },
    /// The controller reports errors.
    #[error("the controller reports an error: {}", words::errors_line(status))]
    Device {
        /// The status that says so.
        status: Box<Status>,
    },
    /// A state was not reached.
    #[error("{what} not reached within {waited_s:.1} s: {}", words::waiting_for(status))]
    StateTimeout {
        /// What was waited for.
        what: &'static str,
        /// How long, s.
        waited_s: f64,
        /// The last status.
        status: Box<Status>,
    },
    /// A file cannot be read or understood.
    #[error(transparent)]
    File(#[from] crate::file::FileError),
    /// A value does not fit into its frame or is not physical.
    #[error(transparent)]
    Parameter(#[from] crate::arm::ParameterError),
    /// The check found problems; nothing was sent.
    #[error("{0}")]
    Check(Box<Verdict>),
    /// The arm has values that no frame carries and that the controller uses otherwise (J-55); nothing was sent.
    #[error("{arm}: {} of this arm cannot be given to the controller, which uses its own; nothing was sent ({})", values(differences.len()), listed(differences))]
    DeviceLimits {
        /// Name of the arm.
        arm: String,
        /// What differs.
        differences: Vec<Difference>,
    },
    /// Execution was asked for of a trajectory that this session did not upload, or that the controller lost since; nothing was
    /// sent.
    #[error(
        "the controller does not hold this trajectory: it was not uploaded, another one was since, or an error made the controller forget it; nothing was sent"
    )]
    NotUploaded,
    /// The motion did not end as asked for.
    #[error("the run was ended at point {point} ({:.3} s): {}", f64::from(*point) * 1e-3, words::errors_line(status))]
    RunFault {
        /// Index of the 1 ms point where it ended.
        point: u32,
        /// The status that says so.
        status: Box<Status>,
    },
    /// The controller paused the motion because of an error that it could still act upon (J-66).
    #[error("the controller paused the motion at point {point} ({:.3} s): {}", f64::from(*point) * 1e-3, words::occurred_since(before, status))]
    PausedByController {
        /// Index of the 1 ms point where it is paused.
        point: u32,
        /// Errors of each joint that had occurred before the motion.
        before: [u16; 6],
        /// The status that says so.
        status: Box<Status>,
    },
    /// Resume was asked for, and nothing is paused.
    #[error("{} (state {}, trajectory {})", not_paused(*trajectory), state, trajectory)]
    NotPaused {
        /// State of the controller.
        state: Code<ControllerState>,
        /// Trajectory execution state.
        trajectory: Code<TrajectoryState>,
    },
    /// The controller needs parameters, and nobody said whose.
    #[error("the controller has not been given: {}; nothing was sent", missing.join(", "))]
    NoParameters {
        /// What it misses.
        missing: Vec<&'static str>,
    },
    /// An arm file does not hold all that a controller needs.
    #[error("{arm}: {} missing; parts of another arm are not filled in, nothing was sent", missing.join(", "))]
    IncompleteArm {
        /// Name of the arm.
        arm: String,
        /// What it lacks.
        missing: Vec<&'static str>,
    },
    /// The link was lost while the arm moves, or may move.
    #[error("{source}. {}", where_the_arm_is(last.as_deref(), *stop_sent))]
    LinkLost {
        /// The last status that came.
        last: Option<Box<Status>>,
        /// A stop was written to the port afterwards.
        stop_sent: bool,
        /// What happened to the link.
        source: Box<Error>,
    },
    /// The caller's callback asked to end.
    #[error("cancelled")]
    Cancelled,
}

/// What is known about the motion when the link is gone.
fn where_the_arm_is(last: Option<&Status>, stop_sent: bool) -> String {
    match last {
        Some(s) if s.trajectory == TrajectoryState::Pause => format!(
            "The trajectory was paused at point {}: the arm should stand there, but nothing confirms it any more",
            s.point
        ),
        Some(s) if s.is_executing() => format!(
            "THE ARM MAY BE MOVING: at the last status it was at point {} ({:.3} s) of its trajectory, and {}",
            s.point,
            f64::from(s.point) * 1e-3,
            if stop_sent {
                "a stop was sent; whether it arrived is not known"
            } else {
                "the controller goes on without this program"
            }
        ),
        _ if stop_sent => "THE ARM MAY BE MOVING: a stop was sent; whether it arrived is not known".into(),
        _ => "THE ARM MAY BE MOVING: whether the command arrived is not known".into(),
    }
}

/// Right after a pause the trajectory state is still Execute, until the arm stands.
fn not_paused(trajectory: Code<TrajectoryState>) -> &'static str {
    if trajectory == TrajectoryState::Execute {
        "nothing is paused yet: the motion is still slowing down after a pause, or nobody paused it"
    } else {
        "nothing is paused: resume would start a motion, not go on with one"
    }
}

fn values(n: usize) -> String {
    if n == 1 { "1 value".into() } else { format!("{n} values") }
}

fn listed(differences: &[Difference]) -> String {
    differences.iter().map(Difference::to_string).collect::<Vec<_>>().join("; ")
}

fn heard(bytes: u64) -> String {
    match bytes {
        0 => "no byte came".into(),
        n => format!("{n} bytes came, but no frame in them"),
    }
}

impl Error {
    /// What kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Error::Port(_) | Error::NoLink { .. } | Error::NotConfirmed { .. } | Error::LinkLost { .. } => {
                ErrorKind::NoLink
            }
            Error::Refused { .. }
            | Error::BeyondBounds { .. }
            | Error::SegmentRefused { .. }
            | Error::UploadFailed { .. }
            | Error::Device { .. }
            | Error::StateTimeout { .. } => ErrorKind::Device,
            Error::File(_) | Error::Parameter(_) | Error::Frame(_) => ErrorKind::Usage,
            Error::Check(_)
            | Error::DeviceLimits { .. }
            | Error::NotUploaded
            | Error::NotPaused { .. }
            | Error::NoParameters { .. }
            | Error::IncompleteArm { .. } => ErrorKind::Refused,
            Error::RunFault { .. } | Error::PausedByController { .. } | Error::Cancelled => ErrorKind::Fault,
        }
    }

    /// A short name for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Error::Port(_) => "port",
            Error::Frame(_) => "frame",
            Error::NoLink { .. } => "no-link",
            Error::NotConfirmed { .. } => "not-confirmed",
            Error::Refused { .. } => "refused",
            Error::BeyondBounds { .. } => "beyond-bounds",
            Error::SegmentRefused { .. } => "segment-refused",
            Error::UploadFailed { .. } => "upload-failed",
            Error::Device { .. } => "device-error",
            Error::StateTimeout { .. } => "state-timeout",
            Error::File(_) => "file",
            Error::Parameter(_) => "parameter",
            Error::Check(_) => "check",
            Error::DeviceLimits { .. } => "device-limits",
            Error::NotUploaded => "not-uploaded",
            Error::RunFault { .. } => "run-fault",
            Error::PausedByController { .. } => "paused-by-controller",
            Error::NotPaused { .. } => "not-paused",
            Error::NoParameters { .. } => "no-parameters",
            Error::IncompleteArm { .. } => "incomplete-arm",
            Error::LinkLost { .. } => "link-lost",
            Error::Cancelled => "cancelled",
        }
    }

    /// The next command or act that helps.
    pub fn hint(&self) -> String {
        match self {
            Error::Port(e) => e.hint(),
            Error::Frame(_) => "`jtc traj check` and `jtc params show` tell what the file holds".into(),
            Error::NoLink { bytes: 0, .. } => {
                "check cable and power of the controller, then `jtc doctor`; is it the right one of `jtc ports`?".into()
            }
            Error::NoLink { baud, .. } => format!(
                "the rate is probably wrong ({} Bd here): try `--baud`, `jtc doctor` tries them all",
                baud.map_or("none".into(), |b| b.to_string())
            ),
            Error::NotConfirmed { .. } => "the line towards the controller loses bytes: `jtc doctor`".into(),
            Error::Refused { request: FrameType::TrajSetExecStatus, code, trajectory, .. }
                if *trajectory == TrajectoryState::Pause && is_place(*code) => {
                "the arm was moved since it was paused: resume needs each joint where it paused, to 0.02 rad. `jtc traj stop`, then \
                 `jtc traj run FILE --approach`"
                    .into()
            }
            // Execution from there is refused for another reason, and resume is not sent.
            Error::Refused { request: FrameType::TrajSetExecStatus, code: DataStatus::NotAllowed, state, trajectory }
                if *state == ControllerState::HoldPos
                    && trajectory.is_in(&[TrajectoryState::Null, TrajectoryState::Stop, TrajectoryState::Finish]) =>
            {
                "nothing is being executed, so there is nothing to pause or stop; `jtc status` shows the state".into()
            }
            Error::Refused { code, state, .. } => refused(*code, *state).into(),
            Error::BeyondBounds { .. } => {
                "such a number would throw or drop the arm: correct the file (`jtc params show FILE`); what the controller had before \
                 is unchanged".into()
            }
            Error::SegmentRefused { code, .. } => refused(*code, ControllerState::HoldPos.into()).into(),
            Error::UploadFailed { .. } => "`jtc doctor` looks at the line; then run it again".into(),
            Error::Device { .. } => "`jtc recover` leads back to HoldPos, `jtc explain CODE` tells about each error".into(),
            Error::StateTimeout { status, .. } => words::next_step(status).into(),
            Error::File(e) => e.hint(),
            Error::Parameter(e) => e.hint(),
            Error::Check(v) => v.hint(),
            Error::DeviceLimits { .. } => format!(
                "no frame carries {NOT_CARRIED}. Build the firmware for this arm, or, where the controller's values are safe for it, \
                 accept them (`--accept-device-limits`)"
            ),
            Error::NotUploaded => "check it again from the pose of the arm, upload it, then execute it (`jtc traj run FILE`)".into(),
            Error::RunFault { .. } => "`jtc status` shows what is wrong, `jtc recover` leads back to HoldPos".into(),
            Error::PausedByController { .. } => {
                "look what keeps the arm from its path: it is held where it gave way, with little torque. `jtc traj resume` goes on \
                 once each joint is back within 0.02 rad of the path, `jtc traj stop` gives it up"
                    .into()
            }
            Error::NotPaused { trajectory, .. } if *trajectory == TrajectoryState::Execute => {
                "a pause takes up to half a second: `jtc traj resume` again once `jtc status` shows Pause".into()
            }
            Error::NotPaused { .. } => "`jtc traj run FILE` checks a trajectory and starts it".into(),
            Error::NoParameters { .. } => {
                "`jtc recover --arm FILE` gives the numbers of your arm; `jtc recover --defaults` those of the arm that is built into \
                 the controller, when it is that one"
                    .into()
            }
            Error::IncompleteArm { .. } => {
                "a URDF holds neither friction nor gains: copy arms/avena.toml and put in all numbers of this arm, or name all files \
                 with `jtc params push`"
                    .into()
            }
            Error::LinkLost { .. } => {
                "press the emergency stop if it must stand; or restore the link, then `jtc traj stop` and `jtc status`".into()
            }
            Error::Cancelled => "`jtc status` shows where the arm is".into(),
        }
    }
}

/// The arm is not where the command needs it. On a line that did not ask for more, code 6 stands for 7 and 8 (J-51).
fn is_place(code: DataStatus) -> bool {
    matches!(code, DataStatus::StartPositionMismatch | DataStatus::IncorrectValue)
}

fn refused(code: DataStatus, state: Code<ControllerState>) -> &'static str {
    match (code, state.known()) {
        (DataStatus::NotAllowed, Some(ControllerState::Start | ControllerState::Init)) => {
            "the controller is not ready yet: `jtc doctor` names what is missing"
        }
        (DataStatus::NotAllowed, Some(ControllerState::Error)) => "the controller is in Error: `jtc recover`",
        (DataStatus::NotAllowed, Some(ControllerState::Teaching)) => "`jtc teach off` first",
        (DataStatus::NotAllowed, _) => "`jtc status` shows the state; `jtc traj stop` ends a trajectory",
        (DataStatus::StartPositionMismatch, _) => {
            "the arm is not at the first point: `jtc traj run FILE --approach` moves it there first"
        }
        _ => "`jtc explain` tells about each code",
    }
}

/// A record says that its frame was taken.
pub(crate) fn accepted(r: &Response) -> bool {
    r.status == FrameStatus::NoError && r.data == DataStatus::NoError
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J-34: resume right after pause finds Execute until the arm stands.
    #[test]
    fn a_resume_too_early_is_told_from_one_without_a_pause() {
        let early = Error::NotPaused {
            state: ControllerState::Operate.into(),
            trajectory: TrajectoryState::Execute.into(),
        };
        assert!(early.to_string().contains("still slowing down"), "{early}");
        assert!(early.hint().contains("resume` again"), "{}", early.hint());
        let never = Error::NotPaused {
            state: ControllerState::HoldPos.into(),
            trajectory: TrajectoryState::Finish.into(),
        };
        assert!(never.to_string().contains("would start a motion"), "{never}");
        assert_eq!([early.kind(), never.kind()], [ErrorKind::Refused; 2]);
    }
}
