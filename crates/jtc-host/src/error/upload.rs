//! Errors of the upload of a trajectory.

use host_kit::{Diagnose, Diagnosis, ErrorKind, next};
use jtc_wire::{Code, ControllerState, DataStatus, TrajectoryState};

use super::link::after_refusal;
use crate::labels;

/// Reason why the controller has not stored the whole trajectory.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UploadError {
    /// The controller refused a segment permanently: another attempt would not help.
    #[error("segment {segment} of {segments} was refused: {}", labels::data_status(*code))]
    SegmentRefused {
        /// Index of the refused segment, from 0.
        segment: usize,
        /// Number of segments of the trajectory.
        segments: usize,
        /// Reason for the refusal.
        code: DataStatus,
    },
    /// The upload ended, but the controller does not have the complete trajectory.
    #[error(
        "upload failed after {restarts} restarts: {confirmed} of {segments} segments confirmed, trajectory {}",
        trajectory
    )]
    Incomplete {
        /// Number of segments that the controller has confirmed.
        confirmed: usize,
        /// Number of segments of the trajectory.
        segments: usize,
        /// Number of times that the upload was restarted.
        restarts: u32,
        /// Trajectory execution state at the end of the upload.
        trajectory: Code<TrajectoryState>,
    },
}

impl Diagnose for UploadError {
    fn diagnosis(&self) -> Diagnosis {
        let (code, next) = match self {
            Self::SegmentRefused { code, .. } => {
                ("segment-refused", after_refusal(*code, ControllerState::HoldPos.into()))
            }
            Self::Incomplete { .. } => {
                ("upload-failed", next!("{} checks the line; then run the trajectory again", Doctor))
            }
        };
        Diagnosis::new(ErrorKind::Device, code, next)
    }
}
