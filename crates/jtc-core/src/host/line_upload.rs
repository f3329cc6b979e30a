//! State of an upload on a host line.
use jtc_wire::{Command, ExecCommand};

use crate::bit_codec::bit_codec;

/// State of the last upload that a host has begun on a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineUpload {
    /// `true` if segment 0 of the upload came on a plain line, `false` if the host used extensions (J-51). `None`
    /// before the first upload. `None` also after an Execute, unless the upload came on a plain line.
    plain: Option<bool>,
}

bit_codec!(LineUpload { plain });

impl LineUpload {
    /// Returns `true` if the response record of `command` may contain only data statuses up to 6. For a later segment
    /// and for Execute, this depends on whether segment 0 came on a plain line.
    pub(crate) fn in_plain_words(&mut self, command: &Command<'_>, plain: bool) -> bool {
        match command {
            Command::Trajectory(segment) if segment.segment == 0 => *self.plain.insert(plain),
            Command::Trajectory(_) | Command::TrajSetExecStatus(ExecCommand::Execute) => {
                self.plain.unwrap_or(plain)
            }
            _ => plain,
        }
    }

    /// Records that the controller executes the uploaded trajectory. Unless the upload came on a plain line, the
    /// record of the line is cleared: the next Execute may come from another client, which need not use the
    /// extensions.
    pub(crate) fn executed(&mut self) {
        self.plain = self.plain.filter(|plain| *plain);
    }
}
