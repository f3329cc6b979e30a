//! Mailbox of a procedure: its filter and its received frames.
use std::collections::VecDeque;

use ucom::{Frame, FromBoard, Function};

/// Limit of frames that wait for a procedure.
pub(crate) const MAX_RECEIVED: usize = 16_384;

/// A frame of a board for a procedure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Received {
    /// Time that has certainly passed between frames, µs.
    pub at: u64,
    pub from: u8,
    pub message: FromBoard,
}

/// Frames that a procedure receives.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Filter {
    /// Boards by bit.
    pub boards: u32,
    /// Functions by bit.
    pub functions: u32,
}

impl Filter {
    pub(crate) fn new(boards: u32, functions: &[Function]) -> Self {
        let functions = functions.iter().fold(0, |bits, f| bits | 1 << f.number());
        // An error of a board may answer any request.
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
    /// Every unparsed frame, for a procedure that evaluates the frames themselves.
    pub raw: Option<VecDeque<(u64, Frame)>>,
    pub wake: Option<u64>,
    pub cancel: bool,
    /// `true` if two boards with one number do not end the procedure: a stop, a step that undoes changes, or a procedure that checks
    /// numbers itself.
    pub bears_shared_numbers: bool,
    /// Reason why no frame can be sent or received any more.
    pub bus_gone: Option<String>,
}

/// Frames that a procedure discards when one of its frames leaves, because they cannot be answers to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Forget {
    Nothing,
    /// All frames except errors.
    Answers,
    All,
}
