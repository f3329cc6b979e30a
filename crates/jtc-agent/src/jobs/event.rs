//! Events of an arm and its jobs.
use agent_kit::api::Problem;
use utoipa::ToSchema;

/// Event of an arm or a job.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ArmEvent {
    /// Change of the lease holder.
    Lease {
        /// Name of the holder; missing: no client holds the lease.
        #[serde(skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
    /// Stop or Pause of the arm.
    Halt {
        /// `stop` or `pause`.
        command: String,
        /// Name of the client that requested it.
        by: String,
    },
    /// Change of the controller's state or errors.
    State {
        /// State, as named in the protocol.
        state: String,
        /// State of the trajectory.
        trajectory: String,
        /// Current errors.
        errors: Vec<String>,
    },
    /// Loss of the port.
    Lost {
        /// Reason of the loss.
        why: String,
    },
    /// Start of a job.
    Begun {
        /// Number of the job.
        job: u64,
        /// Description of the job.
        what: String,
        /// Name of the client that requested it.
        client: String,
    },
    /// Note about a job.
    Note {
        /// Number of the job.
        job: u64,
        /// Text of the note.
        text: String,
    },
    /// Motion that passed the check.
    Checked {
        /// Number of the job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Duration, s.
        duration_s: f64,
        /// Number of points.
        points: usize,
        /// Warnings, which do not prevent a run.
        warnings: Vec<String>,
    },
    /// Progress of the upload of a motion.
    Uploading {
        /// Number of the job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Number of segments that the controller has confirmed.
        segments_done: usize,
        /// Number of segments of the motion.
        segments: usize,
    },
    /// End of the upload.
    Uploaded {
        /// Number of the job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Duration of the upload, s.
        time_s: f64,
        /// Number of bytes of all segments.
        bytes: usize,
        /// Number of repeated segments.
        retries: u32,
    },
    /// Arm parameter that the controller has confirmed.
    Given {
        /// Number of the job.
        job: u64,
        /// Name of the parameter.
        parameter: String,
        /// Length of its frame, bytes.
        bytes: usize,
        /// Duration, s.
        time_s: f64,
    },
    /// Start of a motion.
    Executing {
        /// Number of the job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Duration at full speed, s.
        duration_s: f64,
    },
    /// Progress of a motion, once a second.
    Moving {
        /// Number of the job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Current 1 ms point of the trajectory.
        point: u32,
    },
    /// Completed motion of a job.
    Finished {
        /// Number of the job.
        job: u64,
        /// Number of finished motions of this job, without approaches.
        runs: u32,
    },
    /// End of a job.
    Ended {
        /// Number of the job.
        job: u64,
        /// `finished`, `stopped` or `failed`.
        outcome: String,
        /// Reason of a failure.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<Problem>,
    },
}

impl agent_kit::journal::JournalEvent for ArmEvent {
    fn job(&self) -> Option<u64> {
        match self {
            Self::Lease { .. } | Self::Halt { .. } | Self::State { .. } | Self::Lost { .. } => None,
            Self::Begun { job, .. }
            | Self::Note { job, .. }
            | Self::Checked { job, .. }
            | Self::Uploading { job, .. }
            | Self::Uploaded { job, .. }
            | Self::Given { job, .. }
            | Self::Executing { job, .. }
            | Self::Moving { job, .. }
            | Self::Finished { job, .. }
            | Self::Ended { job, .. } => Some(*job),
        }
    }
}

/// Numbered events of an arm and its jobs.
pub type Journal = agent_kit::journal::Journal<ArmEvent>;
