//! State of an upload on a host line.
use jtc_wire::{Command, ExecCommand};

use crate::bit_codec::bit_codec;

/// State of the last upload that a host has begun on a line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineUpload {
    /// `true` if segment 0 of the upload came on a plain line, `false` if the host used extensions (J-51). `None`
    /// before the first upload, and after the Execute of an upload that did not come on a plain line.
    plain: Option<bool>,
}

bit_codec!(LineUpload { plain });

impl LineUpload {
    /// Returns `true` if the response record of `command` may contain only data statuses up to 6. For a later segment
    /// and for Execute, the property of the line at segment 0 decides.
    pub(crate) fn in_plain_words(&mut self, command: &Command<'_>, plain: bool) -> bool {
        match command {
            Command::Trajectory(segment) if segment.segment == 0 => *self.plain.insert(plain),
            Command::Trajectory(_) | Command::TrajSetExecStatus(ExecCommand::Execute) => {
                self.plain.unwrap_or(plain)
            }
            _ => plain,
        }
    }

    /// Records that the controller executes the uploaded trajectory. If another client executes the trajectory again, the controller does
    /// not know yet whether that client uses the extensions.
    pub(crate) fn executed(&mut self) {
        self.plain = self.plain.filter(|plain| *plain);
    }
}
