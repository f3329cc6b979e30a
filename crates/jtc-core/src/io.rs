//! What goes into a tick and what comes out.
use jtc_bus::Frame;
use jtc_wire::LinkEvent;

/// How the joint bus is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusState {
    /// The frame given out by the last tick was acknowledged on the bus.
    pub acknowledged: bool,
    /// The CAN controller is bus-off.
    pub bus_off: bool,
}

/// Inputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Frames received since the last tick, oldest first (at most 32 are looked at).
    pub bus: &'a [Frame],
    /// State of the bus.
    pub bus_state: BusState,
    /// Level of the safety input: true = no error (J-22).
    pub safety_input: bool,
    /// The oldest event of the host link, offered again each tick until `Outputs::host_done`.
    pub host: Option<LinkEvent<'a>>,
    /// The serial transmitter can take a status now.
    pub status_free: bool,
}

/// Outputs of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    /// The one frame of this tick (J-12); `None` in Start.
    pub bus: Option<Frame>,
    /// Level of the safety output: true = no error (J-22).
    pub safety_output: bool,
    /// A JtcStatus frame is to be sent now: [`Controller::status_frame`](crate::Controller::status_frame) has it. It is not
    /// in here, because these outputs are copied in every tick, and few of them have a status.
    pub status: bool,
    /// The host event was worked off: release it.
    pub host_done: bool,
}
