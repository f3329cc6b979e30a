//! Priority of Stop and Pause, which take effect before the frames that arrived earlier (J-04).
use jtc_wire::{DataStatus, ExecCommand, UrgentCommand};

use crate::TrajectoryState;
use crate::bit_codec::bit_codec;

/// State of the urgent commands of a line until the controller processes their frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Priority {
    /// Number of accepted Stops that have no response record yet. `pauses` is the same number for Pauses.
    pub(super) stops: u8,
    pub(super) pauses: u8,
    /// `true` if these Stops and Pauses have cancelled an Execute.
    pub(super) cancelled: bool,
    /// `true` after a Stop has arrived on any line, even if this Stop was refused. The controller drops an upload
    /// that began before the Stop (J-30). The first event that arrived after the Stop clears the flag.
    pub(super) stopped: bool,
}

bit_codec!(Priority { stops, pauses, cancelled, stopped });

impl Priority {
    /// Adds `count` to the number of urgent commands of this kind that were accepted.
    pub(crate) fn accept(&mut self, command: UrgentCommand, count: u8) {
        let accepted = self.accepted(command);
        *accepted = accepted.saturating_add(count);
    }

    /// Returns the data status of an execution command that arrived before an urgent Stop or Pause took effect. An
    /// Execute is refused. A Stop or Pause succeeds if it was accepted as an urgent command. This command also succeeds
    /// if an Execute was cancelled and the `trajectory` is in the state that the command requests.
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
