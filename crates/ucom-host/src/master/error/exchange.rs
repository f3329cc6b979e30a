//! Errors of an exchange of frames with a board.
use core::fmt;

use crate::master::error::words::MEASURE_ORDER;
use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};
use ucom::{ErrorCode, Function};

/// Reasons why an exchange with a board failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExchangeError {
    /// No board can have this number.
    #[error("board number {number} is out of range ({first} to 31)")]
    NoBoard {
        /// Requested board number.
        number: u8,
        /// Lowest board number, `addr.first` of the profile.
        first: u32,
    },
    /// A board did not answer.
    #[error("board {board} does not answer {} ({tries} tries, {waited_ms} ms; {})", asked.name(), Received(*last))]
    NoAnswer {
        /// Board number.
        board: u8,
        /// Function of the request.
        asked: Function,
        /// Number of times that the request was sent.
        tries: u32,
        /// Time from the first request to the end of the last wait, ms.
        waited_ms: u64,
        /// Last frame that was received from the board.
        last: Option<LastReceived>,
    },
    /// The PC received parts of answers, but no complete answer.
    #[error("board {board}: the answer to {} was not received completely ({tries} tries): {problem}", asked.name())]
    Incomplete {
        /// Board number.
        board: u8,
        /// Function of the request.
        asked: Function,
        /// Number of times that the request was sent.
        tries: u32,
        /// Error in the last answer.
        problem: Incomplete,
    },
    /// Answers of a board contradict each other.
    #[error(
        "board {board}: its answers to PC_INFO contradict each other in {tries} tries; two boards may have \
         this number"
    )]
    Contradiction {
        /// Board number.
        board: u8,
        /// Number of times that the request was sent.
        tries: u32,
    },
    /// The board reported an error.
    #[error("board {board} reports {code} during {during}: {}", code.meaning())]
    Device {
        /// Board number.
        board: u8,
        /// Reported error code.
        code: ErrorCode,
        /// Step that the procedure performed when the board reported the error.
        during: &'static str,
    },
}

impl Diagnose for ExchangeError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::NoBoard { .. } => {
                Diagnosis::new(ErrorKind::Usage, "no-board", next!("{} lists the boards", ChainScan))
            }
            Self::NoAnswer { board, last: None, .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "no-answer",
                Next::from(format!("no frame of board {board} was received: ")).then(next!(
                    "{} lists the boards that answer, {} shows the cause",
                    ChainScan,
                    ChainDoctor
                )),
            ),
            // The board sent nothing during the whole exchange, so it may have no power any more.
            Self::NoAnswer { board, waited_ms, last: Some(last), .. } if last.ago_ms > *waited_ms => {
                Diagnosis::new(
                    ErrorKind::NoLink,
                    "no-answer",
                    Next::from(format!("board {board} has sent nothing for {} ms: ", last.ago_ms)).then(next!(
                        "check its power and its cable; {} shows the cause, {} lists the boards that answer",
                        ChainDoctor,
                        ChainScan
                    )),
                )
            }
            Self::NoAnswer { board, .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "no-answer",
                Next::from(format!("board {board} sends frames but does not answer this request: "))
                    .then(next!("{}, then {}", BoardInfo, ChainDoctor).of_board(*board)),
            ),
            Self::Incomplete { problem: Incomplete::ByteOrder { .. }, .. } => {
                Diagnosis::new(ErrorKind::NoLink, "incomplete-answer", MEASURE_ORDER)
            }
            Self::Incomplete { problem: Incomplete::TooMany { .. } | Incomplete::Start { .. }, .. } => {
                Diagnosis::new(
                    ErrorKind::NoLink,
                    "incomplete-answer",
                    "the board may interpret the protocol differently: `ucom probe` measures this",
                )
            }
            Self::Incomplete { .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "incomplete-answer",
                next!("frames are lost: {} checks bus load, error counters and termination", ChainDoctor),
            ),
            Self::Contradiction { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "contradiction",
                next!("number the boards again: {}", ChainInit),
            ),
            Self::Device { code, .. } => Diagnosis::new(ErrorKind::Device, "device-error", code.reaction()),
        }
    }
}

/// The last frame that was received from a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastReceived {
    /// Function of the frame.
    pub function: Function,
    /// Time between the last frame and the error, ms.
    pub ago_ms: u64,
}

/// Prints the last frame as `last received: MCA_ALIVE 120 ms ago`, or prints that no frame was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received(pub Option<LastReceived>);

impl fmt::Display for Received {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(LastReceived { function, ago_ms }) => {
                write!(f, "last received: {} {ago_ms} ms ago", function.name())
            }
            None => f.write_str("no frame was received from this board"),
        }
    }
}

/// Errors in an answer of several frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Incomplete {
    /// The first frame of the answer is not valid.
    #[error("its first frame has {len} bytes, expected {need}")]
    Start {
        /// Number of bytes in the received first frame.
        len: u8,
        /// Number of bytes that the first frame must have.
        need: u8,
    },
    /// The board stopped sending in the middle of its answer.
    #[error("{complete} of {of} strings were received, then no more frames")]
    Silence {
        /// Number of complete strings in the answer.
        complete: u32,
        /// Number of strings that the board announced.
        of: u32,
    },
    /// A frame in the answer cannot belong to a string.
    #[error("a frame of string {string} does not match the frames before it")]
    Misfit {
        /// Number of the string, from 0.
        string: u32,
    },
    /// The answer contains more frames than the board announced.
    #[error("the board sent more frames than it had announced")]
    Surplus,
    /// The answer announces more strings than possible.
    #[error("the board announces {strings} strings, which is too many; check the byte order")]
    TooMany {
        /// Number of strings that the board announced.
        strings: u32,
    },
    /// The counts that the board announced are multiples of 256. In the other byte order, these counts would be small numbers.
    #[error(
        "the board announces {strings} strings, and each count is a multiple of 256: the byte order is \
         probably wrong"
    )]
    ByteOrder {
        /// Number of strings that the board announced.
        strings: u32,
    },
    /// Packages of a buffer are missing in the answer.
    #[error("{missing} of {of} packages are missing")]
    Packages {
        /// Number of missing packages.
        missing: u32,
        /// Number of expected packages.
        of: u32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A board that has lost its power sends nothing during the exchange. The next step then names the power.
    #[test]
    fn the_age_of_the_last_frame_selects_the_next_step() {
        let next = |ago_ms| {
            let last = Some(LastReceived { function: Function::Alive, ago_ms });
            let error =
                ExchangeError::NoAnswer { board: 3, asked: Function::Info, tries: 3, waited_ms: 300, last };
            error.diagnosis().next.to_string()
        };
        assert!(next(120).starts_with("board 3 sends frames but does not answer"), "{}", next(120));
        assert!(
            next(1400).starts_with("board 3 has sent nothing for 1400 ms: check its power"),
            "{}",
            next(1400)
        );
    }
}
