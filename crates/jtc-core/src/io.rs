//! Inputs and outputs of one control tick.
use jtc_bus::Frame;
use jtc_wire::{LinkEvent, UrgentCommands};

use crate::HOST_LINES;

/// State of the joint bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusState {
    /// The frame that the last tick returned was acknowledged.
    pub acknowledged: bool,
    /// The CAN controller is bus-off.
    pub bus_off: bool,
}

/// Event on a host line. The events of a line are in the order of their arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HostEvent<'a> {
    /// Number of the host line that gets the response record.
    pub line: usize,
    /// The event was received before an urgent command that was an input of this tick or of an earlier tick. An overtaken Execute is not
    /// executed any more, and an overtaken Stop or Pause has already taken effect (J-04).
    pub overtaken: bool,
    /// The frame came on a plain line: no extension request was received in the 2 s before the first byte of the frame (J-51). The record
    /// of such a frame does not contain a data status above 6, and segment 0 acts as a Stop in Operate (J-30).
    pub plain: bool,
    /// The event.
    pub event: LinkEvent<'a>,
}

/// Inputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Frames received since the last tick, oldest first. The controller reads at most 32.
    pub bus: &'a [Frame],
    /// State of the bus.
    pub bus_state: BusState,
    /// Level of the safety input: `true` means no error (J-22). A board that latches pulses shorter than a tick reports `false` in the tick
    /// after such a pulse.
    pub safety_input: bool,
    /// Number of ticks that were missed since the last tick, or were at least half a tick late (J-12).
    pub missed_ticks: u16,
    /// Stop and Pause commands that have arrived on each line since the last tick. These commands take effect in this tick, before all
    /// waiting events (J-04). The frames of these commands also appear as events in the order of arrival.
    pub urgent: [UrgentCommands; HOST_LINES],
    /// The oldest events of the host link. The controller reads at most [`jtc_wire::EVENTS_MAX`]. In the next tick, the caller must offer
    /// the uncompleted events again.
    pub host: &'a [HostEvent<'a>],
    /// The serial transmitters can accept a status now.
    pub status_free: bool,
}

impl Inputs<'_> {
    /// Inputs of a tick without any frames, events and faults.
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
    /// Frame of this tick (J-12). `None` in Start.
    pub bus: Option<Frame>,
    /// Level of the safety output: `true` means no error (J-22).
    pub safety_output: bool,
    /// A JtcStatus frame must be sent now. [`Controller::status_frame`](crate::Controller::status_frame) returns it. The outputs do not
    /// contain the frame, because the outputs are copied in every tick and only a few ticks have a status.
    pub status: bool,
    /// Line that gets the status with the response record. The other line gets the status without the record. `None` if the status does not
    /// contain a record.
    pub record_line: Option<usize>,
    /// [`Controller::answer_frame`](crate::Controller::answer_frame) must be sent now, on this line only (J-50). This output and `status`
    /// are never set in the same tick.
    pub answer_line: Option<usize>,
    /// [`Controller::stored_arm`](crate::Controller::stored_arm) must be written to non-volatile memory (J-54).
    pub store: bool,
    /// Number of completed host events, counted from the oldest event. Release them.
    pub host_done: usize,
}
