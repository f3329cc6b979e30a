//! The controller's board: the controller itself, the host link's receive buffer and the watchdog, glued as
//! the firmware does it.
use jtc_bus::Frame;
use jtc_core::{BusState, Config, Controller, Inputs, Outputs, POINTS_MAX, Telemetry};
use jtc_wire::{FRAME_MAX, FrameStatus, LinkEvent, RawPoint, Receiver, STATUS_LEN};

/// Room for frames: the longest one and as much again, as a host that pipelines fills it.
const RECEIVE_BUFFER: usize = FRAME_MAX;
/// Bytes given to the parser at once.
const CHUNK: usize = 4096;

/// Looks at the parser between two ticks: what a processor with time to spare does.
const POLLS: usize = 32;

/// A host frame that the controller worked off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worked {
    /// A good one, by its type byte.
    Frame(u8),
    /// Something that was none.
    Bad(FrameStatus),
}

/// What a tick needs beside the host link.
#[derive(Clone, Copy, Debug)]
pub struct Pins<'a> {
    /// Answers of the nodes.
    pub bus: &'a [Frame],
    /// State of the bus.
    pub bus_state: BusState,
    /// Level of the safety input.
    pub safety_input: bool,
    /// The serial transmitter is idle.
    pub status_free: bool,
}

/// The board.
pub struct Board {
    controller: Controller<Vec<RawPoint>>,
    receiver: Receiver<Vec<u8>>,
    config: Config,
    gap_us: u32,
    watchdog_ms: u32,
    /// Ticks that did not come.
    missed: u32,
    has_event: bool,
    /// What the tick worked off.
    pub worked: Option<Worked>,
    /// Resets by the watchdog.
    pub watchdog_resets: u32,
}

impl Board {
    /// A board with power just switched on.
    pub fn new(config: Config, gap_us: u32, watchdog_ms: u32) -> Self {
        Self {
            controller: Controller::new(config.clone(), vec![RawPoint::default(); POINTS_MAX]),
            receiver: Receiver::new(vec![0; RECEIVE_BUFFER], gap_us),
            config,
            gap_us,
            watchdog_ms,
            missed: 0,
            has_event: false,
            worked: None,
            watchdog_resets: 0,
        }
    }

    /// Forget everything, as a reset does.
    pub fn reset(&mut self) {
        let resets = self.watchdog_resets;
        *self = Self::new(self.config.clone(), self.gap_us, self.watchdog_ms);
        self.watchdog_resets = resets;
    }

    /// The status of the last tick, when its outputs said that one is to be sent.
    pub fn status_frame(&self) -> &[u8; STATUS_LEN] {
        self.controller.status_frame()
    }

    /// What the last tick computed.
    pub fn telemetry(&self) -> &Telemetry {
        self.controller.telemetry()
    }

    /// Between ticks: bytes that arrived by `now_us` go through the parser; those taken are removed from
    /// `bytes`.
    pub fn receive(&mut self, now_us: u64, bytes: &mut Vec<u8>) {
        // Bytes are taken also while a frame is worked off, as an interrupt does: held back, they would make a gap.
        let mut taken = 0;
        for _ in 0..POLLS {
            let rest = &bytes[taken..];
            taken += self.receiver.push(now_us, &rest[..rest.len().min(CHUNK)]);
            if !self.has_event {
                self.has_event = self.receiver.poll(now_us);
            }
            let more = taken < bytes.len() || (!self.has_event && self.receiver.busy());
            if !more {
                break;
            }
        }
        bytes.drain(..taken);
    }

    /// The tick does not come; true when the watchdog resets the board because of it.
    pub fn miss(&mut self) -> bool {
        self.worked = None;
        self.missed += 1;
        if self.missed < self.watchdog_ms {
            return false;
        }
        self.watchdog_resets += 1;
        self.reset();
        // The board starts with the reason for its reset, as an internal error that latches (J-12, J-21).
        self.controller.raise_internal();
        true
    }

    /// One tick of the controller.
    pub fn tick(&mut self, pins: &Pins<'_>) -> Outputs {
        self.missed = 0;
        let host = if self.has_event { self.receiver.event() } else { None };
        let worked = host.map(|event| match event {
            LinkEvent::Frame(frame) => Worked::Frame(frame.frame_type as u8),
            LinkEvent::Bad(response) => Worked::Bad(response.status),
        });
        let outputs = self.controller.tick(&Inputs {
            bus: pins.bus,
            bus_state: pins.bus_state,
            safety_input: pins.safety_input,
            host,
            status_free: pins.status_free,
        });
        self.worked = None;
        if outputs.host_done && self.has_event {
            self.worked = worked;
            self.receiver.release();
            self.has_event = false;
        }
        outputs
    }
}
