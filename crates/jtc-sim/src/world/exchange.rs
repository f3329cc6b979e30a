//! Inputs and outputs of the controller's board in one millisecond, for programs that run another board or another
//! controller in parallel.
use jtc_bus::Frame;
use jtc_core::{BusState, Outputs};

use crate::board::{Board, Pins};

/// Inputs and outputs of the controller's board in one millisecond.
#[derive(Clone, Debug, PartialEq)]
pub struct Exchange {
    /// Bytes from the host that arrived before the tick.
    pub host: Vec<u8>,
    /// `true` if the board executed a tick. Otherwise the board only received the bytes from the host and produced no
    /// output.
    pub ticked: bool,
    /// Joint bus frames that the tick received.
    pub bus: Vec<Frame>,
    /// State of the joint bus.
    pub bus_state: BusState,
    /// Level of the safety input; `true` means no error.
    pub safety_input: bool,
    /// `true` if the serial transmitter was idle.
    pub status_free: bool,
    /// Frame that the board sent on the joint bus.
    pub sent: Option<Frame>,
    /// Bytes that the board sent to the host.
    pub to_host: Vec<u8>,
    /// Level of the safety output; `true` means no error.
    pub safety_output: bool,
}

impl Default for Exchange {
    fn default() -> Self {
        Self {
            host: Vec::new(),
            ticked: false,
            bus: Vec::new(),
            bus_state: BusState { acknowledged: true, bus_off: false },
            safety_input: true,
            status_free: true,
            sent: None,
            to_host: Vec::new(),
            safety_output: false,
        }
    }
}

impl Exchange {
    /// Stores the inputs and outputs of the tick in the exchange.
    pub(super) fn note(&mut self, pins: &Pins<'_>, outputs: &Outputs, board: &Board) {
        self.ticked = true;
        self.bus = pins.bus.to_vec();
        (self.bus_state, self.safety_input) = (pins.bus_state, pins.safety_input);
        self.status_free = pins.status_free;
        self.sent = outputs.bus;
        self.safety_output = outputs.safety_output;
        self.to_host = board.bytes_to_host(outputs);
    }
}

impl Board {
    /// Returns the bytes that the board sends to the host after the tick with these outputs. The bytes are a status, an
    /// answer to an extension request, or no bytes.
    pub fn bytes_to_host(&self, outputs: &Outputs) -> Vec<u8> {
        let status: &[u8] = if outputs.status { self.status_frame() } else { &[] };
        let answer = if outputs.answer_line.is_some() { self.answer_frame() } else { &[] };
        [status, answer].concat()
    }
}
