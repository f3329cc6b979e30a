//! Decoder of the flight record. The decoder works from the bytes of the record, like an external tool.
use jtc_bus::Frame;
use jtc_core::{BusState, HOST_LINES};
use jtc_wire::{UrgentCommand, UrgentCommands};

/// Size of the flight record, bytes.
pub const FLIGHT_SIZE: usize = 848;
/// Layout version that this module decodes.
const LAYOUT: u16 = 3;

/// Inputs and outputs of a tick that the board has recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flight {
    pub phase: u32,
    pub cause: u32,
    pub tick: u64,
    pub bus_state: u8,
    pub safety_input: bool,
    pub missed_ticks: u16,
    pub status_free: bool,
    pub wrong_format: u32,
    pub urgent: [UrgentCommands; HOST_LINES],
    /// Host events that were passed to the controller, oldest first.
    pub events: Vec<Event>,
    pub received: Vec<Frame>,
    pub state: u8,
    pub trajectory: u8,
    pub safety_output: bool,
    /// Number of host events whose processing the controller has finished.
    pub host_done: usize,
    /// Index of the serial line whose status contains a response record, if any.
    pub record_line: Option<usize>,
    /// `true` if the board sent a status in this tick.
    pub status: bool,
    pub sent: Option<Frame>,
    pub point: u32,
    pub errors: u16,
    pub torque: [f64; 6],
}

/// An event from a host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// Kind of the event: 1 is a frame, 2 an invalid frame, 3 noise.
    pub kind: u8,
    /// `true` if the board received an urgent command (Stop or Pause) after the event.
    pub overtaken: bool,
    /// `true` if the event arrived on a plain line, whose host does not use the extensions (J-51).
    pub plain: bool,
    pub line: u8,
    pub frame_type: u8,
    pub status: u8,
    pub len: u16,
    pub crc: u16,
}

struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (first, rest) = self.0.split_first_chunk().expect("the record is long enough");
        self.0 = rest;
        *first
    }
    fn u8(&mut self) -> u8 {
        self.take::<1>()[0]
    }
    fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.take())
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }
    fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.take())
    }
    fn frame(&mut self) -> Option<Frame> {
        let (id, len, data) = (self.u16(), self.u16(), self.take::<24>());
        Frame::new(id, data.get(..len.into())?)
    }
}

impl Flight {
    /// Phase of the record: it contains the inputs of this tick, but still the outputs of the previous tick.
    pub const PHASE_INPUTS: u32 = 1;
    /// Phase of the record: it contains the inputs and the outputs of this tick.
    pub const PHASE_COMPLETE: u32 = 2;

    /// Decodes a flight record. Returns `None` if the bytes are not a flight record, for example after power-on.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        assert_eq!(bytes.len(), FLIGHT_SIZE);
        let mut b = Bytes(bytes);
        let head = (b.take::<4>(), b.u16(), b.u16());
        if head != (*b"JTCF", LAYOUT, FLIGHT_SIZE as u16) {
            return None;
        }
        let (phase, cause, tick) = (b.u32(), b.u32(), b.u64());
        let [bus_state, safety_input, status_free, received_count] = b.take();
        let wrong_format = b.u32();
        let urgent = [(); HOST_LINES].map(|()| {
            let mut commands = UrgentCommands::NONE;
            for [command, count] in [b.take::<2>(), b.take::<2>()] {
                let command = if command == 1 { UrgentCommand::Stop } else { UrgentCommand::Pause };
                commands.add(command, count);
            }
            commands
        });
        let [event_count, _] = b.take();
        let missed_ticks = b.u16();
        let mut events: Vec<_> = (0..16)
            .map(|_| {
                let [kind, line, frame_type, status] = b.take();
                let (kind, plain, overtaken) = (kind & 0x3F, kind & 0x40 != 0, kind & 0x80 != 0);
                Event { kind, overtaken, plain, line, frame_type, status, len: b.u16(), crc: b.u16() }
            })
            .collect();
        events.truncate(event_count.into());
        let mut received: Vec<_> = (0..21).map(|_| b.frame()).collect();
        received.truncate(received_count.into());
        let [state, trajectory, safety_output, status] = b.take();
        let sent = b.frame();
        let (point, errors) = (b.u32(), b.u16());
        let [host_done, record_line] = b.take();
        let torque = [(); 6].map(|()| f64::from_bits(b.u64()));
        assert!(b.0.is_empty());
        Some(Self {
            phase,
            cause,
            tick,
            bus_state,
            safety_input: safety_input != 0,
            missed_ticks,
            status_free: status_free != 0,
            wrong_format,
            urgent,
            events,
            received: received.into_iter().map(|f| f.expect("what was received is a frame")).collect(),
            state,
            trajectory,
            safety_output: safety_output != 0,
            host_done: host_done.into(),
            record_line: (record_line != 0xFF).then_some(record_line.into()),
            status: status != 0,
            sent,
            point,
            errors,
            torque,
        })
    }

    /// Returns the bus state in the inputs of the tick.
    pub fn bus(&self) -> BusState {
        BusState { acknowledged: self.bus_state & 1 != 0, bus_off: self.bus_state & 2 != 0 }
    }
}
