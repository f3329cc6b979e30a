//! Events of a chain of boards and of its jobs.
use agent_kit::api::Problem;
use utoipa::ToSchema;

/// Policy for running boards when the client that commanded them falls silent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// The boards continue with their present inputs.
    Continue,
    /// The boards are stopped, because no client sends new inputs.
    #[default]
    Stop,
}

/// Event of the chain or a job.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ChainEvent {
    /// Change of the lease holder.
    Lease {
        /// Name of the holder; missing: no client holds the lease.
        #[serde(skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
    /// Request of a client to stop all boards. The frames of this Stop are sent before all other frames.
    Halt {
        /// Name of the client that requested it.
        by: String,
        /// Number of Stops that this event reports together, because they followed within 0.1 s; missing: a single
        /// Stop.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<u64>,
    },
    /// Answers of the boards after a Stop.
    Stopped {
        /// Numbers of the boards that have confirmed the Stop.
        boards: Vec<u8>,
        /// Boards that possibly still run, each with the reason. These include boards that ran before and do not
        /// answer now.
        not_stopped: Vec<String>,
    },
    /// Change of a board's heartbeats.
    Heartbeat {
        /// Number of the board; missing: the agent does not know the board.
        #[serde(skip_serializing_if = "Option::is_none")]
        board: Option<u8>,
        /// Change: `late`, `lost`, `back`, or `rebooted`, after which the board has no number.
        change: String,
    },
    /// Change of a board's control loop.
    Loop {
        /// Number of the board.
        board: u8,
        /// Change: `left-loop`, `stopped-by-policy` or `in-loop`.
        change: String,
    },
    /// Change of a board's state.
    State {
        /// Number of the board.
        board: u8,
        /// State: `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`.
        state: String,
    },
    /// Error that a board reports.
    BoardError {
        /// Number of the board; 0: a board without a number.
        board: u8,
        /// Number of the error.
        code: u8,
        /// Name of the error.
        name: String,
        /// Meaning of the error.
        meaning: String,
    },
    /// Text that a board sends.
    Text {
        /// Number of the board.
        board: u8,
        /// Text of the message.
        text: String,
    },
    /// Note about the bus.
    Note {
        /// Text of the note.
        text: String,
    },
    /// Loss of the bus.
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
    JobNote {
        /// Number of the job.
        job: u64,
        /// Text of the note.
        text: String,
    },
    /// Progress of an update; at most five times a second within a cycle.
    Progress {
        /// Number of the job.
        job: u64,
        /// Numbers of boards that receive the image now.
        boards: Vec<u8>,
        /// Number of the attempt.
        attempt: u32,
        /// Cycle of the update. In cycle 1 the boards check the image; in cycle 2 they write it.
        cycle: u32,
        /// Number of bytes, of both cycles, that the boards have confirmed in this attempt.
        bytes: u64,
        /// Number of bytes that the agent sends in both cycles.
        total: u64,
    },
    /// End of a job.
    Ended {
        /// Number of the job.
        job: u64,
        /// Outcome: `finished`, `cancelled` or `failed`.
        outcome: String,
        /// Reason of a failure.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<Problem>,
    },
}

impl ChainEvent {
    /// Returns the name of the event in the command log. The command log contains lease changes, Stops and their
    /// results.
    pub(crate) fn logged(&self) -> Option<&'static str> {
        match self {
            Self::Lease { .. } => Some("lease"),
            Self::Halt { .. } => Some("stop"),
            Self::Stopped { .. } => Some("stopped"),
            Self::Ended { .. } => Some("ended"),
            Self::Lost { .. } => Some("lost"),
            _ => None,
        }
    }
}

impl agent_kit::journal::JournalEvent for ChainEvent {
    fn job(&self) -> Option<u64> {
        match self {
            Self::Begun { job, .. }
            | Self::JobNote { job, .. }
            | Self::Progress { job, .. }
            | Self::Ended { job, .. } => Some(*job),
            _ => None,
        }
    }
}

/// Numbered events of a chain of boards.
pub(crate) type Journal = agent_kit::journal::Journal<ChainEvent>;
