//! Errors that occur because control loops run or cannot run.
use crate::master::error::words::Boards;
use crate::master::load::LoadForecast;
use host_kit::{Diagnose, Diagnosis, ErrorKind, next};

/// Reasons why control loops prevent an action or cannot run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunningError {
    /// The control loops of boards are running.
    #[error("{} running: program data would have priority over their process data", Boards(boards))]
    Running {
        /// Numbers of the boards.
        boards: Vec<u8>,
    },
    /// Control loops are running, so the PC refuses the request. The request could stop the axes of the boards in any
    /// position, or could have a worse effect.
    #[error("{} running its control loop", Boards(boards))]
    LoopRuns {
        /// Numbers of the boards.
        boards: Vec<u8>,
    },
    /// The forecast bus load is too high.
    #[error("{0}")]
    Load(LoadForecast),
    /// A board was lost while boards were started, and `on_lost` required a stop of all boards (D-51).
    #[error("board {board} was lost while boards were started: all boards were stopped")]
    Lost {
        /// Number of the lost board.
        board: u8,
    },
}

impl Diagnose for RunningError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Running { .. } | Self::LoopRuns { .. } => {
                Diagnosis::new(ErrorKind::Refused, "running", next!("{} first", ChainStop))
            }
            Self::Load(_) => Diagnosis::new(
                ErrorKind::Refused,
                "load",
                "start fewer boards, increase `so.period` or `ci.period`, or force the start",
            ),
            Self::Lost { board } => Diagnosis::new(
                ErrorKind::Fault,
                "lost",
                next!(
                    "check if the board rebooted or lost power: {}; {} checks bus and boards",
                    BoardInfo,
                    ChainDoctor
                )
                .of_board(*board),
            ),
        }
    }
}
