//! State of an upload on a line of the host.
use jtc_wire::{Command, ExecCommand};

use crate::bit_codec::bit_codec;

/// State of the last upload that was begun on a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineUpload {
    /// Segment 0 of the upload came on a plain line (J-51). `None` before the first upload, and after the Execute of an upload from a line
    /// that was not plain.
    plain: Option<bool>,
}

bit_codec!(LineUpload { plain });

impl LineUpload {
    /// Returns `true` if the record of `command` may contain only data statuses up to 6. For commands of an upload, its segment 0 decides.
    pub(crate) fn in_plain_words(&mut self, command: &Command<'_>, plain: bool) -> bool {
        match command {
            Command::Trajectory(segment) if segment.segment == 0 => *self.plain.insert(plain),
            Command::Trajectory(_) | Command::TrajSetExecStatus(ExecCommand::Execute) => {
                self.plain.unwrap_or(plain)
            }
            _ => plain,
        }
    }

    /// Records that a trajectory is executed. If another client executes it again, it is not known yet whether that client uses the
    /// extensions.
    pub(crate) fn executed(&mut self) {
        self.plain = self.plain.filter(|plain| *plain);
    }
}
