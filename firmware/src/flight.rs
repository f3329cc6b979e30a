//! The flight record, which contains all inputs and outputs of the last tick.
//!
//! The record is in memory that survives a reset, under the symbol `FLIGHT`. Every tick writes its inputs before the
//! controller runs, and its outputs afterwards. A tool that reads the record after every tick can repeat these ticks on
//! a PC, and must compute bit-identical outputs. For host frames, the record contains only type, length and CRC. Only
//! the host knows the bytes of these frames.
//!
//! All numbers in the record are little-endian, as in the memory of the processor. The structures in this module define
//! the layout and have no hidden padding. If the layout changes, [`Flight::LAYOUT`] must change.
use jtc_bus::{Frame, MAX_LEN};
use jtc_core::{BusState, HOST_LINES, HostEvent, Inputs, JOINTS, Telemetry};
use jtc_wire::{EVENTS_MAX, LinkEvent, UrgentCommand, UrgentCommands};

use crate::message_ram::RX;

/// Frame of the joint bus; `id` is [`NO_FRAME`] for an empty entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct FlightFrame {
    /// Identifier of the frame.
    pub id: u16,
    /// Number of payload bytes.
    pub len: u16,
    /// Payload, padded with zeros.
    pub data: [u8; MAX_LEN],
}

/// Identifier that means "no frame".
pub const NO_FRAME: u16 = 0xFFFF;

impl FlightFrame {
    const NONE: Self = Self { id: NO_FRAME, len: 0, data: [0; MAX_LEN] };

    fn of(frame: &Frame) -> Self {
        let mut data = [0; MAX_LEN];
        let payload = frame.data();
        for (to, from) in data.iter_mut().zip(payload) {
            *to = *from;
        }
        Self { id: frame.id, len: payload.len() as u16, data }
    }

    /// Returns the frame. Returns `None` if `id` is [`NO_FRAME`].
    pub fn frame(&self) -> Option<Frame> {
        Frame::new(self.id, self.data.get(..self.len.into())?)
    }
}

/// Event that a host has caused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct FlightEvent {
    /// Kind of the event: 0 for none, 1 a valid frame, 2 an invalid frame, 3 noise. Bit 6 is set if the event
    /// arrived on a plain line, whose host does not use the extensions (J-51). Bit 7 is set if the controller
    /// received Stop or Pause after the event.
    pub kind: u8,
    /// Serial line on which the event arrived: 0 is RS422, 1 is USB.
    pub line: u8,
    /// Type byte of the frame, 0 if unknown.
    pub frame_type: u8,
    /// Frame status that the controller will report.
    pub status: u8,
    /// Length of the frame in bytes; 0 if unknown.
    pub len: u16,
    /// CRC of the frame; 0 if the frame is invalid.
    pub crc: u16,
}

/// Urgent commands that arrived on a line: pairs of kind (1 is Stop, 2 is Pause) and count. The kind that was received
/// last is the last pair.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct FlightUrgent(pub [[u8; 2]; 2]);

impl FlightUrgent {
    fn of(commands: &UrgentCommands) -> Self {
        let mut all = [[0; 2]; 2];
        for (place, (command, count)) in all.iter_mut().zip(commands.iter()) {
            *place = [if command == UrgentCommand::Stop { 1 } else { 2 }, count];
        }
        Self(all)
    }

    /// Returns the urgent commands.
    pub fn commands(&self) -> UrgentCommands {
        let mut commands = UrgentCommands::NONE;
        for [command, count] in self.0 {
            let command = if command == 1 { UrgentCommand::Stop } else { UrgentCommand::Pause };
            commands.add(command, count);
        }
        commands
    }
}

/// The flight record.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Flight {
    /// Identification of the record, which is [`Flight::MAGIC`].
    pub magic: u32,
    /// Layout version of the record, which is [`Flight::LAYOUT`].
    pub layout: u16,
    /// Size of the record, bytes.
    pub size: u16,
    /// Progress of the tick, as one of the `PHASE_` constants.
    pub phase: u32,
    /// Cause of the start of this program, as the code of a [`crate::reset::Cause`].
    pub cause: u32,
    /// Number of the tick; the first tick is 1.
    pub tick: u64,

    // Inputs:
    /// State of the joint bus. Bit 0 is set if the last tick's frame was acknowledged, and bit 1 in bus-off.
    pub bus_state: u8,
    /// Level of the safety input.
    pub safety_input: u8,
    /// 1 if both serial lines could accept a status, otherwise 0.
    pub status_free: u8,
    /// Number of frames in `received`.
    pub received_count: u8,
    /// Number of frames with a wrong format that arrived since program start (J-15). These frames are not in
    /// `received`.
    pub wrong_format: u32,
    /// Stop and Pause commands that arrived on each serial line.
    pub urgent: [FlightUrgent; HOST_LINES],
    /// Number of host events that were passed to the controller.
    pub event_count: u8,
    reserved: u8,
    /// Number of ticks directly before this tick that were missed or late.
    pub missed_ticks: u16,
    /// The host events, oldest first.
    pub events: [FlightEvent; EVENTS_MAX],
    /// Frames that the joint bus received since the last tick.
    pub received: [FlightFrame; RX],

    // Outputs:
    /// State of the controller.
    pub state: u8,
    /// Trajectory execution state.
    pub trajectory: u8,
    /// Level of the safety output.
    pub safety_output: u8,
    /// 1 if the controller sent a status, otherwise 0.
    pub status: u8,
    /// Frame that was sent on the joint bus.
    pub sent: FlightFrame,
    /// Index of the current trajectory point; points are 1 ms apart.
    pub point: u32,
    /// Current error word.
    pub errors: u16,
    /// Number of host events whose processing the controller has finished.
    pub host_done: u8,
    /// Index of the serial line whose status contains a response record; 0xFF if no status contains a record.
    pub record_line: u8,
    /// Commanded torques, N·m.
    pub torque: [f64; JOINTS],
}

const _: () = assert!(size_of::<Flight>() == 848 && core::mem::offset_of!(Flight, torque) == 800);

impl Flight {
    /// First word of a record, which contains the letters "JTCF".
    pub const MAGIC: u32 = u32::from_le_bytes(*b"JTCF");
    /// Version of the layout of the record.
    pub const LAYOUT: u16 = 3;
    /// Value of `record_line` for a status without a response record.
    pub const NO_LINE: u8 = 0xFF;
    /// Progress: no tick has begun yet.
    pub const PHASE_NONE: u32 = 0;
    /// Progress: the inputs belong to tick number `tick`, the outputs to the previous tick.
    pub const PHASE_INPUTS: u32 = 1;
    /// Progress: inputs and outputs belong to tick number `tick`.
    pub const PHASE_COMPLETE: u32 = 2;

    /// Creates the record before the first tick.
    pub const fn new(cause: u32) -> Self {
        Self {
            magic: Self::MAGIC,
            layout: Self::LAYOUT,
            size: size_of::<Self>() as u16,
            phase: Self::PHASE_NONE,
            cause,
            tick: 0,
            bus_state: 0,
            safety_input: 0,
            status_free: 0,
            received_count: 0,
            wrong_format: 0,
            urgent: [FlightUrgent([[0; 2]; 2]); HOST_LINES],
            event_count: 0,
            reserved: 0,
            missed_ticks: 0,
            events: [FlightEvent { kind: 0, line: 0, frame_type: 0, status: 0, len: 0, crc: 0 }; EVENTS_MAX],
            received: [FlightFrame::NONE; RX],
            state: 0,
            trajectory: 0,
            safety_output: 0,
            status: 0,
            sent: FlightFrame::NONE,
            point: 0,
            errors: 0,
            host_done: 0,
            record_line: Self::NO_LINE,
            torque: [0.0; JOINTS],
        }
    }

    /// Returns `true` if a program with this layout wrote the record.
    pub fn valid(&self) -> bool {
        self.magic == Self::MAGIC
            && self.layout == Self::LAYOUT
            && usize::from(self.size) == size_of::<Self>()
    }

    /// Records the inputs of the tick that begins.
    pub fn begin(&mut self, inputs: &Inputs<'_>, wrong_format: u32) {
        self.phase = Self::PHASE_INPUTS;
        self.tick += 1;
        let BusState { acknowledged, bus_off } = inputs.bus_state;
        self.bus_state = u8::from(acknowledged) | u8::from(bus_off) << 1;
        self.safety_input = inputs.safety_input.into();
        self.status_free = inputs.status_free.into();
        self.missed_ticks = inputs.missed_ticks;
        self.wrong_format = wrong_format;
        for (slot, commands) in self.urgent.iter_mut().zip(&inputs.urgent) {
            *slot = FlightUrgent::of(commands);
        }
        self.event_count = inputs.host.len().min(EVENTS_MAX) as u8;
        for (slot, received) in self.events.iter_mut().zip(inputs.host) {
            *slot = event(received);
        }
        self.received_count = inputs.bus.len().min(RX) as u8;
        for (slot, frame) in self.received.iter_mut().zip(inputs.bus) {
            *slot = FlightFrame::of(frame);
        }
    }

    /// Records the outputs of the tick.
    pub fn complete(&mut self, outputs: &jtc_core::Outputs, telemetry: &Telemetry) {
        self.state = telemetry.state as u8;
        self.trajectory = telemetry.trajectory as u8;
        self.safety_output = outputs.safety_output.into();
        self.status = outputs.status.into();
        self.host_done = outputs.host_done as u8;
        self.record_line = outputs.record_line.map_or(Self::NO_LINE, |line| line as u8);
        self.sent = outputs.bus.as_ref().map_or(FlightFrame::NONE, FlightFrame::of);
        self.errors = telemetry.errors;
        self.point = telemetry.point;
        for (slot, joint) in self.torque.iter_mut().zip(&telemetry.joints) {
            *slot = joint.torque;
        }
        self.phase = Self::PHASE_COMPLETE;
    }

    /// Returns the bus state in the inputs of the tick.
    pub fn bus_state(&self) -> BusState {
        BusState { acknowledged: self.bus_state & 1 != 0, bus_off: self.bus_state & 2 != 0 }
    }

    /// Returns the received frames in the inputs of the tick.
    pub fn received(&self) -> impl Iterator<Item = Frame> {
        self.received.iter().take(self.received_count.into()).filter_map(FlightFrame::frame)
    }
}

fn event(received: &HostEvent<'_>) -> FlightEvent {
    let (kind, frame_type, len, crc) = match received.event {
        LinkEvent::Frame(frame) => {
            let crc = frame.bytes.last_chunk().map_or(0, |crc| u16::from_be_bytes(*crc));
            (1, frame.frame_type as u8, frame.bytes.len() as u16, crc)
        }
        LinkEvent::Bad(response) => (2, response.frame_type, response.length, 0),
        LinkEvent::Noise(response) => (3, response.frame_type, response.length, 0),
    };
    FlightEvent {
        kind: kind | u8::from(received.plain) << 6 | u8::from(received.overtaken) << 7,
        line: received.line as u8,
        frame_type,
        status: received.event.status() as u8,
        len,
        crc,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jtc_core::{Config, Controller, POINTS_MAX};
    use jtc_wire::{FrameRef, FrameType, RawPoint, fixed};

    #[test]
    fn a_tick_can_be_run_again_from_its_record() {
        let new = || Controller::new(Config::default(), vec![RawPoint::default(); POINTS_MAX]);
        let (mut board, mut pc) = (new(), new());
        let mut flight = Flight::new(1);
        let answer = Frame::new(0x203, &[7; 16]).expect("16 bytes are allowed");
        for tick in 1..200 {
            let event = LinkEvent::Frame(FrameRef {
                frame_type: FrameType::PidParamUseDefault,
                bytes: &fixed::PID_PARAM_USE_DEFAULT,
            });
            let host = [HostEvent { line: 1, overtaken: tick % 2 == 0, plain: tick % 3 == 0, event }; 2];
            let mut urgent = [UrgentCommands::NONE; HOST_LINES];
            urgent[tick % 2].add(UrgentCommand::Pause, (tick % 3) as u8);
            urgent[tick % 2].push(UrgentCommand::Stop);
            let inputs = Inputs {
                bus: &[answer; 3][..tick % 4],
                bus_state: BusState { acknowledged: tick % 5 != 0, bus_off: tick == 77 },
                safety_input: tick != 150,
                missed_ticks: u16::from(tick % 30 == 0),
                urgent,
                host: &host[..tick % 3],
                status_free: tick % 3 == 0,
            };
            flight.begin(&inputs, 0);
            let outputs = board.tick(&inputs);
            flight.complete(&outputs, &board.telemetry());
            assert!(flight.valid() && flight.phase == Flight::PHASE_COMPLETE && flight.tick == tick as u64);

            let bus: Vec<Frame> = flight.received().collect();
            let again = pc.tick(&Inputs {
                bus: &bus,
                bus_state: flight.bus_state(),
                safety_input: flight.safety_input != 0,
                missed_ticks: flight.missed_ticks,
                urgent: flight.urgent.map(|urgent| urgent.commands()),
                host: &host[..flight.event_count.into()],
                status_free: flight.status_free != 0,
            });
            assert_eq!(again.bus, flight.sent.frame());
            let torque = pc.telemetry().joints.map(|joint| joint.torque.to_bits());
            assert_eq!(torque, flight.torque.map(f64::to_bits));
            assert_eq!((again.host_done as u8, u8::from(again.status)), (flight.host_done, flight.status));
            assert_eq!(flight.urgent.map(|urgent| urgent.commands()), urgent);
        }
    }
}
