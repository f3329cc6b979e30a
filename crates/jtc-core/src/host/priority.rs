//! Priority of Stop and Pause, which take effect before the frames that arrived earlier (J-04).
use jtc_wire::{DataStatus, ExecCommand, UrgentCommand};

use crate::TrajectoryState;
use crate::bit_codec::bit_codec;

/// State of the urgent commands of a line until the controller processes their frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Priority {
    /// Numbers of Stops and Pauses that were accepted and have no response record yet.
    pub(super) stops: u8,
    pub(super) pauses: u8,
    /// `true` if these Stops and Pauses have cancelled an Execute.
    pub(super) cancelled: bool,
    /// `true` if a Stop has arrived on any line. The controller then drops an upload that began before this Stop
    /// (J-30), even if the Stop was refused. The first event that arrived after this Stop clears the flag. The
    /// response record of an earlier Stop does not clear it.
    pub(super) stopped: bool,
}

bit_codec!(Priority { stops, pauses, cancelled, stopped });

impl Priority {
    /// Adds `count` to the number of urgent commands of this kind that were accepted.
    pub(crate) fn accept(&mut self, command: UrgentCommand, count: u8) {
        let accepted = self.accepted(command);
        *accepted = accepted.saturating_add(count);
    }

    /// Returns the data status of an execution command that was received before an urgent Stop or Pause took effect.
    /// An Execute is refused. A Stop or Pause is successful if it was accepted as an urgent command. It is also
    /// successful if it cancelled an Execute and the `trajectory` has the commanded state.
    pub(crate) fn overtaken(
        &mut self,
        exec: ExecCommand,
        trajectory: TrajectoryState,
    ) -> Result<(), DataStatus> {
        let Some(command) = UrgentCommand::from_exec(exec) else {
            self.cancelled = true;
            return Err(DataStatus::NotAllowed);
        };
        let rests = match command {
            UrgentCommand::Stop => TrajectoryState::Stop,
            UrgentCommand::Pause => TrajectoryState::Pause,
        };
        let cancelled = core::mem::take(&mut self.cancelled) && trajectory == rests;
        let accepted = self.accepted(command);
        let acted = *accepted > 0;
        *accepted = accepted.saturating_sub(1);
        if acted || cancelled { Ok(()) } else { Err(DataStatus::NotAllowed) }
    }

    fn accepted(&mut self, command: UrgentCommand) -> &mut u8 {
        match command {
            UrgentCommand::Stop => &mut self.stops,
            UrgentCommand::Pause => &mut self.pauses,
        }
    }
}
