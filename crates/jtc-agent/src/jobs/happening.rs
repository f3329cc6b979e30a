//! What can happen to an arm and its jobs.
use agent_kit::api::Problem;
use utoipa::ToSchema;

/// What has happened.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Happening {
    /// Another client commands, or nobody does.
    Lease {
        /// Its name; missing: nobody commands.
        #[serde(skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
    /// Somebody stopped or paused the arm.
    Halt {
        /// `stop` or `pause`.
        command: String,
        /// Who it was.
        by: String,
    },
    /// The controller reports another state, or other errors.
    State {
        /// State, in the words of the protocol.
        state: String,
        /// What becomes of the trajectory.
        trajectory: String,
        /// Errors now.
        errors: Vec<String>,
    },
    /// The port is gone.
    Lost {
        /// Why.
        why: String,
    },
    /// A job began.
    Begun {
        /// Its number.
        job: u64,
        /// What it does.
        what: String,
        /// Who asked for it.
        client: String,
    },
    /// Something to know about a job.
    Note {
        /// Its number.
        job: u64,
        /// In words.
        text: String,
    },
    /// A motion passed the check.
    Checked {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// s.
        duration_s: f64,
        /// Points.
        points: usize,
        /// What does not forbid to run it.
        warnings: Vec<String>,
    },
    /// A motion is being uploaded.
    Uploading {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Segments that the controller has.
        segments_done: usize,
        /// Of so many.
        segments: usize,
    },
    /// The controller has it.
    Uploaded {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// How long that took, s.
        time_s: f64,
        /// Bytes on the line.
        bytes: usize,
        /// Segments that were sent again.
        retries: u32,
    },
    /// The controller was given a part of an arm, and has confirmed it.
    Given {
        /// The job.
        job: u64,
        /// Which part.
        parameter: String,
        /// Bytes of its frame.
        bytes: usize,
        /// How long that took, s.
        time_s: f64,
    },
    /// The arm begins to move.
    Executing {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// s, at full speed.
        duration_s: f64,
    },
    /// The arm moves, reported once a second.
    Moving {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// The 1 ms point that the controller is at.
        point: u32,
    },
    /// A motion of a job came to its end.
    Finished {
        /// The job.
        job: u64,
        /// How many motions of this job were finished, approaches not counted.
        runs: u32,
    },
    /// A job is over.
    Ended {
        /// Its number.
        job: u64,
        /// `finished`, `stopped` or `failed`.
        outcome: String,
        /// Why it failed.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<Problem>,
    },
}

impl agent_kit::journal::Happening for Happening {
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

/// Events of an arm by number.
pub type Journal = agent_kit::journal::Journal<Happening>;
