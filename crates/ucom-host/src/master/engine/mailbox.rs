//! Mailbox of a procedure: a filter and the received frames.
use std::collections::VecDeque;

use ucom::{Frame, FromBoard, Function};

/// Limit of the frames that wait in a mailbox.
pub(crate) const MAX_RECEIVED: usize = 16_384;

/// A frame of a board that a procedure receives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Received {
    /// Time of reception in µs. The clock counts only the time that has certainly passed between received frames
    /// (`Core::passed`).
    pub at: u64,
    pub from: u8,
    pub message: FromBoard,
}

/// Selection of boards and functions whose frames a procedure receives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Filter {
    /// Boards whose frames are received; bit n is board n.
    pub boards: u32,
    /// Functions that are received; bit n is function n.
    pub functions: u32,
}

impl Filter {
    pub(crate) fn new(boards: u32, functions: &[Function]) -> Self {
        let functions = functions.iter().fold(0, |bits, f| bits | 1 << f.number());
        // The filter always includes error frames, because a board can answer any request with an error.
        Self { boards, functions: functions | 1 << Function::Error.number() }
    }

    pub(crate) fn takes(&self, from: u8, function: Function) -> bool {
        let report = (16..20).contains(&function.number());
        self.functions >> function.number() & 1 == 1 && (report || self.boards >> from & 1 == 1)
    }
}

/// Frames that a procedure has received, and the events that it waits for.
#[derive(Debug, Default)]
pub(crate) struct Mailbox {
    pub name: &'static str,
    pub claims: u32,
    pub filter: Filter,
    pub received: VecDeque<Received>,
    /// All received frames in unparsed form, for a procedure that evaluates frames itself.
    pub raw: Option<VecDeque<(u64, Frame)>>,
    pub wake: Option<u64>,
    pub cancel: bool,
    /// `true` if two boards with the same number do not end the procedure. The value is `true` for three kinds of work: a stop, a step that
    /// undoes changes, and a procedure that checks numbers itself.
    pub bears_shared_numbers: bool,
    /// Reason why the procedure can no longer send or receive frames.
    pub bus_gone: Option<String>,
}

/// Received frames that a procedure discards when a frame that it sends leaves the queue, because they cannot be
/// answers to that frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Forget {
    Nothing,
    /// All frames except error frames.
    Answers,
    All,
}
