//! Errors before and during the execution of a motion.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, Next, next};
use jtc_wire::{Code, ControllerState, Status, StopCause, StopKind, TrajectoryState};

use super::{LinkError, facts};
use crate::plan::PlanError;
use crate::{held_stop, labels};

/// Reason why a motion did not begin, or did not end as requested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// The controller does not have the trajectory that the caller wanted to execute. The session did not upload the requested trajectory,
    /// or this trajectory was replaced or deleted. No frame was sent.
    #[error(
        "the controller does not have this trajectory: it was not uploaded, another upload replaced it, or an error deleted it; nothing was sent"
    )]
    NotUploaded,
    /// The caller requested Resume, but no motion is paused.
    #[error("{} (state {}, trajectory {})", not_paused(*trajectory), state, trajectory)]
    NotPaused {
        /// State of the controller at the time of the request.
        state: Code<ControllerState>,
        /// Trajectory execution state at the time of the request.
        trajectory: Code<TrajectoryState>,
    },
    /// The check refuses the remainder of a paused motion. No frame was sent.
    #[error("the remainder of the motion from {:.3} s fails the check with the present settings and payload: {why}; nothing was sent", f64::from(*point) * 1e-3)]
    RestRefused {
        /// Index of the 1 ms point at which the motion is paused.
        point: u32,
        /// Error from the check of the remainder of the motion.
        why: Box<PlanError>,
    },
    /// The motion ended early: the controller reports an error, the trajectory was deleted, or nodes are no longer in operation.
    #[error("the run ended early at point {point} ({:.3} s): {}", f64::from(*point) * 1e-3, labels::errors_line(status))]
    RunFault {
        /// Index of the 1 ms point at which the motion ended.
        point: u32,
        /// Status that contains the errors.
        status: Box<Status>,
    },
    /// The controller stopped the motion, and holds the arm in position (J-69).
    #[error("the controller stopped the motion at point {point} ({:.3} s) and holds the arm: {}", f64::from(*point) * 1e-3, why_held(before, status, cause.as_ref()))]
    HeldStop {
        /// Index of the 1 ms point at which the motion is paused.
        point: u32,
        /// Error bits of each joint that had already occurred before the motion.
        before: [u16; 6],
        /// Status that contains the errors.
        status: Box<Status>,
        /// First cause of the held stop, with its value and limit; `None` if the device does not report the cause.
        cause: Option<StopCause>,
    },
    /// The connection was lost during a motion, so the arm may still move.
    #[error("{source}. {}", where_the_arm_is(last.as_deref(), *stop_sent))]
    LinkLost {
        /// Last status that was received.
        last: Option<Box<Status>>,
        /// `true` if the program wrote a Stop to the port. The controller has not confirmed this Stop.
        stop_sent: bool,
        /// Failure of the connection.
        source: Box<LinkError>,
    },
}

/// Returns the cause of the held stop in one line. If the held stop has already ended and its cause is unknown,
/// returns the joint errors that have occurred since the start of the motion.
fn why_held(before: &[u16; 6], status: &Status, cause: Option<&StopCause>) -> String {
    if status.is_held_stop() || cause.is_some() {
        labels::why_held(status, cause)
    } else {
        labels::occurred_since(before, status)
    }
}

/// Returns the next step after a held stop during a motion.
fn after_held_stop(cause: Option<&StopCause>) -> Next {
    let remedy = match cause.map(|cause| cause.kind) {
        None => "remove the obstacle, or set the payload".to_owned(),
        // After an encoder jump, the controller executes no trajectory until the drive is reset.
        Some(StopKind::EncoderJump) => return held_stop::after_encoder_jump(),
        Some(kind) => held_stop::remedy(kind),
    };
    let then = next!(
        "; then {}. {} continues the motion if each joint is still within 0.02 rad of the path; otherwise {}, then {}",
        Clear,
        Resume,
        Stop,
        TrajRunWithApproach
    );
    Next::from(remedy).then(then)
}

/// Returns a text that describes the last known state of the motion after the connection was lost.
fn where_the_arm_is(last: Option<&Status>, stop_sent: bool) -> String {
    match last {
        Some(s) if s.trajectory == TrajectoryState::Pause => format!(
            "The trajectory was paused at point {}: the arm should be at rest there, but no status confirms this",
            s.point
        ),
        Some(s) if s.is_executing() => format!(
            "THE ARM MAY BE MOVING: in the last status it was at point {} ({:.3} s) of its trajectory, and {}",
            s.point,
            f64::from(s.point) * 1e-3,
            if stop_sent {
                "a Stop was sent, but not confirmed"
            } else {
                "the controller continues without this program"
            }
        ),
        _ if stop_sent => "THE ARM MAY BE MOVING: a Stop was sent, but not confirmed".into(),
        _ => "THE ARM MAY BE MOVING: the command was sent, but not confirmed".into(),
    }
}

/// Returns the reason why no motion is paused. Immediately after a Pause request, the trajectory state is still Execute, until the arm is
/// at rest.
fn not_paused(trajectory: Code<TrajectoryState>) -> &'static str {
    if trajectory == TrajectoryState::Execute {
        "no motion is paused yet: the motion is still slowing down after a Pause, or no client paused it"
    } else {
        "no motion is paused: Resume would start a motion instead of continuing one"
    }
}

impl Diagnose for MotionError {
    fn diagnosis(&self) -> Diagnosis {
        let (kind, code, next) = match self {
            Self::HeldStop { cause, .. } => {
                return Diagnosis::new(ErrorKind::Fault, "held-stop", after_held_stop(cause.as_ref()));
            }
            Self::NotUploaded => (
                ErrorKind::Refused,
                "not-uploaded",
                next!(
                    "check the trajectory again from the present pose, upload it, then execute it: {}",
                    TrajRun
                ),
            ),
            Self::NotPaused { trajectory, .. } => (
                ErrorKind::Refused,
                "not-paused",
                if *trajectory == TrajectoryState::Execute {
                    next!("a Pause takes up to half a second: {} again when {} shows Pause", Resume, Status)
                } else {
                    next!("{} checks a trajectory and starts it", TrajRun)
                },
            ),
            Self::RestRefused { .. } => (
                ErrorKind::Refused,
                "rest-refused",
                next!(
                    "{} shows the payload that the controller uses, {} corrects it; {} ends the motion",
                    PayloadShow,
                    PayloadSet,
                    Stop
                ),
            ),
            Self::RunFault { .. } => (
                ErrorKind::Fault,
                "run-fault",
                next!("{} shows the error, {} returns the controller to HoldPos", Status, Recover),
            ),
            Self::LinkLost { .. } => (
                ErrorKind::NoLink,
                "link-lost",
                next!(
                    "press the emergency stop if the arm must stop; or restore the link, then {} and {}",
                    Stop,
                    Status
                ),
            ),
        };
        Diagnosis::new(kind, code, next)
    }

    fn facts(&self) -> Facts {
        match self {
            Self::HeldStop { point, status, cause, .. } => {
                Facts { point: Some(*point), ..facts::of_held_stop(status, cause.as_ref()) }
            }
            Self::RunFault { point, status } => Facts { point: Some(*point), ..facts::of_status(status) },
            Self::LinkLost { last: Some(last), .. } if last.is_executing() => {
                Facts { point: Some(last.point), ..Facts::default() }
            }
            Self::RestRefused { point, why } => Facts { point: Some(*point), ..why.facts() },
            Self::LinkLost { .. } | Self::NotUploaded | Self::NotPaused { .. } => Facts::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J-34: after a Pause request, the trajectory state stays Execute until the arm has stopped. If Resume is
    /// requested before that, the error message differs from the message for a Resume without a Pause.
    #[test]
    fn a_resume_too_early_is_told_from_one_without_a_pause() {
        let early = MotionError::NotPaused {
            state: ControllerState::Operate.into(),
            trajectory: TrajectoryState::Execute.into(),
        };
        assert!(early.to_string().contains("still slowing down"), "{early}");
        assert!(early.diagnosis().next.to_string().contains("resume` again"), "{}", early.diagnosis().next);
        let never = MotionError::NotPaused {
            state: ControllerState::HoldPos.into(),
            trajectory: TrajectoryState::Finish.into(),
        };
        assert!(never.to_string().contains("would start a motion"), "{never}");
        assert_eq!([early.diagnosis().kind, never.diagnosis().kind], [ErrorKind::Refused; 2]);
    }
}
