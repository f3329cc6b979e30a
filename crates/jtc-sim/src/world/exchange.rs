//! What goes into the controller's board in a millisecond, and what comes out of it: for somebody who runs another board, or the
//! controller in another program, beside the one of the world.
use jtc_bus::Frame;
use jtc_core::{BusState, Outputs};

use crate::board::{Board, Pins};

/// A millisecond of the controller's board.
#[derive(Clone, Debug, PartialEq)]
pub struct Exchange {
    /// Bytes from the host that arrived before the tick.
    pub host: Vec<u8>,
    /// The tick came. Without it nothing was looked at but the bytes from the host, and nothing came out.
    pub ticked: bool,
    /// Frames of the joint bus that the tick was given.
    pub bus: Vec<Frame>,
    /// How the bus was.
    pub bus_state: BusState,
    /// Level of the safety input: true = no error.
    pub safety_input: bool,
    /// The serial transmitter was idle.
    pub status_free: bool,
    /// The frame that came out for the joint bus.
    pub sent: Option<Frame>,
    /// Bytes that came out for the host.
    pub to_host: Vec<u8>,
    /// Level of the safety output: true = no error.
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
    /// The tick's own part.
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
    /// What a tick with these outputs, the last one, sends to the host: a status, an answer to an extension request, or nothing.
    pub fn bytes_to_host(&self, outputs: &Outputs) -> Vec<u8> {
        let status: &[u8] = if outputs.status { self.status_frame() } else { &[] };
        let answer = if outputs.answer_line.is_some() { self.answer_frame() } else { &[] };
        [status, answer].concat()
    }
}
