//! What can happen to a chain and its jobs.
use agent_kit::api::Problem;
use utoipa::ToSchema;

/// What becomes of running boards when the client that commanded them shows no more that it is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Policy {
    /// They go on with the inputs that they have.
    Continue,
    /// They are stopped: nobody gives them new inputs.
    #[default]
    Stop,
}

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
    /// Somebody stopped all boards: the frames are on the bus.
    Halt {
        /// Who it was.
        by: String,
        /// So many Stops, within a tenth of a second, of which this was the last; missing: one.
        #[serde(skip_serializing_if = "Option::is_none")]
        times: Option<u64>,
    },
    /// After a Stop each board was asked.
    Stopped {
        /// Boards that have confirmed it.
        boards: Vec<u8>,
        /// Boards that may still run, each with the reason: also those that ran and from which nothing is received any more.
        not_stopped: Vec<String>,
    },
    /// Heartbeats of a board have changed.
    Heartbeat {
        /// Its number; missing: a board that is not known.
        #[serde(skip_serializing_if = "Option::is_none")]
        board: Option<u8>,
        /// `late`, `lost`, `back`, or `rebooted`: it has no number any more.
        change: String,
    },
    /// A board has left its control loop, or is in it again.
    Loop {
        /// Its number.
        board: u8,
        /// `left-loop`, `stopped-by-policy` or `in-loop`.
        change: String,
    },
    /// What is known of a board has changed.
    State {
        /// Its number.
        board: u8,
        /// `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`.
        state: String,
    },
    /// A board reports an error.
    BoardError {
        /// Its number; 0: one without a number.
        board: u8,
        /// Number of the error.
        code: u8,
        /// Its name.
        name: String,
        /// What it means.
        meaning: String,
    },
    /// A board sends a text.
    Text {
        /// Its number.
        board: u8,
        /// The text.
        text: String,
    },
    /// Something to know about the bus.
    Note {
        /// In words.
        text: String,
    },
    /// The bus is gone.
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
    JobNote {
        /// Its number.
        job: u64,
        /// In words.
        text: String,
    },
    /// An update goes on; at most five times a second within a cycle.
    Progress {
        /// The job.
        job: u64,
        /// Boards that get the image now.
        boards: Vec<u8>,
        /// Which attempt.
        attempt: u32,
        /// 1: checked, 2: written.
        cycle: u32,
        /// Bytes of both cycles that were taken.
        bytes: u64,
        /// Of so many.
        total: u64,
    },
    /// A job is over.
    Ended {
        /// Its number.
        job: u64,
        /// `finished`, `cancelled` or `failed`.
        outcome: String,
        /// Why it failed.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<Problem>,
    },
}

impl Happening {
    /// What it is called in the log of commands: who commanded and stopped, and what came of that.
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

impl agent_kit::journal::Happening for Happening {
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

/// Events of a chain by number.
pub type Journal = agent_kit::journal::Journal<Happening>;
