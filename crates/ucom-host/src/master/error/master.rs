//! Errors for procedures that this PC refused to begin, or ended early.
use crate::master::error::words::Boards;
use host_kit::{Diagnose, Diagnosis, ErrorKind, next};
use ucom::Function;

/// Reasons why this PC did not begin a procedure, or why it ended the procedure early.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MasterError {
    /// A competing master: another PC is on the bus (D-08).
    #[error("another PC is on the bus: {} to {to} was received {ago_ms} ms ago", function.name())]
    CompetingMaster {
        /// Function of the last frame from the other PC.
        function: Function,
        /// Board number that the frame was sent to; it can be the broadcast number.
        to: u8,
        /// Time since the last frame of the other PC, ms.
        ago_ms: u64,
    },
    /// Another procedure works with a board that this procedure needs.
    #[error("{} busy with {with}", Boards(boards))]
    Busy {
        /// Numbers of the boards that both procedures need.
        boards: Vec<u8>,
        /// Name of the other procedure.
        with: &'static str,
    },
    /// The caller reports that the bus is lost, see [`Master::abandon`](crate::master::Master::abandon).
    #[error("the bus failed: {reason}")]
    Bus {
        /// Error that the CAN driver reported.
        reason: String,
    },
    /// The caller cancelled the procedure.
    #[error("cancelled")]
    Cancelled,
}

impl Diagnose for MasterError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::CompetingMaster { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "foreign-master",
                "end the other program, then repeat the command",
            ),
            Self::Busy { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "busy",
                "wait until the other procedure ends, or cancel it",
            ),
            Self::Bus { .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "bus",
                next!("check the bus and the plug of the adapter: {}", ChainDoctor),
            ),
            Self::Cancelled => Diagnosis::new(
                ErrorKind::Fault,
                "cancelled",
                next!("{} shows the state of the boards", ChainScan),
            ),
        }
    }
}
