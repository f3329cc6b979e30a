//! Inputs and outputs of one control tick.
use jtc_bus::Frame;
use jtc_wire::{LinkEvent, UrgentCommands};

use crate::HOST_LINES;

/// State of the joint bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusState {
    /// `true` if the bus acknowledged the frame that the last tick returned.
    pub acknowledged: bool,
    /// `true` if the CAN controller is bus-off.
    pub bus_off: bool,
}

/// Event on a host line. The events of a line have the order of their arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostEvent<'a> {
    /// Index of the host line that gets the response record.
    pub line: usize,
    /// `true` if the event was received before an urgent command that was an input of this tick or of an earlier tick. The controller does
    /// not execute an overtaken Execute, and an overtaken Stop or Pause has already taken effect (J-04).
    pub overtaken: bool,
    /// `true` if the frame came on a plain line: no extension request was received in the 2 s before the first byte of the frame (J-51).
    /// The response record of such a frame does not contain a data status above 6, and segment 0 acts as a Stop in Operate (J-30).
    pub plain: bool,
    /// Event on the line.
    pub event: LinkEvent<'a>,
}

/// Inputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Frames received since the last tick, oldest first. The controller reads at most 32 of these frames per tick.
    pub bus: &'a [Frame],
    /// State of the joint bus.
    pub bus_state: BusState,
    /// Level of the safety input: `true` means no error (J-22). A board that latches pulses shorter than a tick reports `false` in the tick
    /// after such a pulse.
    pub safety_input: bool,
    /// Number of ticks that were missed since the last tick, or were at least half a tick late (J-12).
    pub missed_ticks: u16,
    /// Stop and Pause commands that have arrived on each line since the last tick. Stop and Pause commands take effect in this tick, before
    /// all waiting events (J-04). The frames of these commands also appear as events in the order of arrival.
    pub urgent: [UrgentCommands; HOST_LINES],
    /// Oldest events of the host link that the controller has not completed yet. The controller reads at most
    /// [`jtc_wire::EVENTS_MAX`] of these events per tick. If an event is not completed in this tick, the caller must
    /// pass it again in the next tick.
    pub host: &'a [HostEvent<'a>],
    /// `true` if the serial transmitters can accept a status now.
    pub status_free: bool,
}

impl Inputs<'_> {
    /// Inputs of a tick without any frame, event or fault.
    pub const QUIET: Self = Inputs {
        bus: &[],
        bus_state: BusState { acknowledged: true, bus_off: false },
        safety_input: true,
        missed_ticks: 0,
        urgent: [UrgentCommands::NONE; HOST_LINES],
        host: &[],
        status_free: true,
    };
}

/// Outputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    /// Frame that the board must send on the joint bus in this tick (J-12). `None` in Start.
    pub bus: Option<Frame>,
    /// Level of the safety output: `true` means no error (J-22).
    pub safety_output: bool,
    /// `true` if the board must send a JtcStatus frame now. [`Controller::status_frame`](crate::Controller::status_frame) returns this
    /// frame. The outputs do not contain this frame, because the outputs are copied in every tick and only a few ticks have a status.
    pub status: bool,
    /// Index of the line that gets the status with the response record. The other host line gets the status without the response record.
    /// `None` if the status does not contain a record.
    pub record_line: Option<usize>,
    /// Index of the only line on which the board must send [`Controller::answer_frame`](crate::Controller::answer_frame) now (J-50).
    /// `answer_line` and `status` are never set in the same tick.
    pub answer_line: Option<usize>,
    /// `true` if the board must write [`Controller::stored_arm`](crate::Controller::stored_arm) to non-volatile memory (J-54).
    pub store: bool,
    /// Number of completed host events, counted from the oldest event. The caller must remove these events from its queue.
    pub host_done: usize,
}
