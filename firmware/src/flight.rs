//! The flight record: everything that went into the last tick, and what came out of it.
//!
//! It lies in memory that keeps its contents over a reset, under the symbol `FLIGHT`, and is written in every tick: its
//! inputs before the controller runs, its outputs after. Whoever records it after every tick can run the same ticks
//! on a PC and must get the same bits. Host frames are named by type, length and CRC; their bytes are the host's.
//!
//! All numbers are little-endian, as in the processor's memory. The layout is that of the structures below, which have
//! no hidden padding; [`Flight::LAYOUT`] changes with it.
use jtc_bus::{Frame, MAX_LEN};
use jtc_core::{BusState, Inputs, JOINTS, Telemetry};
use jtc_wire::LinkEvent;

use crate::message_ram::RX;

/// A frame of the joint bus; `id` is [`NO_FRAME`] where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct FlightFrame {
    /// Identifier.
    pub id: u16,
    /// Bytes of payload.
    pub len: u16,
    /// Payload, zeros behind it.
    pub data: [u8; MAX_LEN],
}

/// Identifier of a frame that is none.
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

    /// The frame; `None` for [`NO_FRAME`].
    pub fn frame(&self) -> Option<Frame> {
        Frame::new(self.id, self.data.get(..self.len.into())?)
    }
}

/// What came from the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct FlightEvent {
    /// 0 nothing, 1 a good frame, 2 a bad one or bytes that are none.
    pub kind: u8,
    /// Its line: 0 RS422, 1 USB.
    pub line: u8,
    /// Type byte, 0 where unknown.
    pub frame_type: u8,
    /// Frame status as it will be reported.
    pub status: u8,
    /// Bytes, 0 where unknown.
    pub len: u16,
    /// CRC of a good frame, else 0.
    pub crc: u16,
}

/// The record.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Flight {
    /// [`Flight::MAGIC`].
    pub magic: u32,
    /// [`Flight::LAYOUT`].
    pub layout: u16,
    /// Bytes of this record.
    pub size: u16,
    /// How far the tick is: one of the `PHASE_` constants.
    pub phase: u32,
    /// [`crate::reset::Cause`] of the start of this program.
    pub cause: u32,
    /// Number of the tick, from 1.
    pub tick: u64,

    // Inputs.
    /// Bit 0: the last tick's frame was acknowledged; bit 1: bus-off.
    pub bus_state: u8,
    /// Level of the safety input.
    pub safety_input: u8,
    /// Both lines could take a status.
    pub status_free: u8,
    /// Frames in `heard`.
    pub heard_count: u8,
    /// Frames of the wrong format that were received instead (J-15), since the start.
    pub wrong_format: u32,
    /// The host event that was offered.
    pub event: FlightEvent,
    /// Frames received since the last tick.
    pub heard: [FlightFrame; RX],

    // Outputs.
    /// State of the controller.
    pub state: u8,
    /// Trajectory execution state.
    pub tes: u8,
    /// Level of the safety output.
    pub safety_output: u8,
    /// Bit 0: the event was worked off; bit 1: a status was sent.
    pub done: u8,
    /// The frame sent.
    pub sent: FlightFrame,
    /// Index of the current 1 ms point.
    pub point: u32,
    /// Current error word.
    pub errors: u16,
    reserved: [u8; 6],
    /// Torques commanded, N·m.
    pub torque: [f64; JOINTS],
}

const _: () = assert!(size_of::<Flight>() == 720 && core::mem::offset_of!(Flight, torque) == 672);

impl Flight {
    /// First word of a record: "JTCF".
    pub const MAGIC: u32 = u32::from_le_bytes(*b"JTCF");
    /// Version of the layout.
    pub const LAYOUT: u16 = 1;
    /// No tick yet.
    pub const PHASE_NONE: u32 = 0;
    /// The inputs are those of tick `tick`, the outputs those of the one before.
    pub const PHASE_INPUTS: u32 = 1;
    /// The outputs belong to tick `tick`, too.
    pub const PHASE_COMPLETE: u32 = 2;

    /// The record before the first tick.
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
            heard_count: 0,
            wrong_format: 0,
            event: FlightEvent { kind: 0, line: 0, frame_type: 0, status: 0, len: 0, crc: 0 },
            heard: [FlightFrame::NONE; RX],
            state: 0,
            tes: 0,
            safety_output: 0,
            done: 0,
            sent: FlightFrame::NONE,
            point: 0,
            errors: 0,
            reserved: [0; 6],
            torque: [0.0; JOINTS],
        }
    }

    /// It was written by this version of the program.
    pub fn valid(&self) -> bool {
        self.magic == Self::MAGIC
            && self.layout == Self::LAYOUT
            && usize::from(self.size) == size_of::<Self>()
    }

    /// Records what goes into the next tick; `line` is where `inputs.host` came from.
    pub fn begin(&mut self, inputs: &Inputs<'_>, line: usize, wrong_format: u32) {
        self.phase = Self::PHASE_INPUTS;
        self.tick += 1;
        let BusState { acknowledged, bus_off } = inputs.bus_state;
        self.bus_state = u8::from(acknowledged) | u8::from(bus_off) << 1;
        self.safety_input = inputs.safety_input.into();
        self.status_free = inputs.status_free.into();
        self.wrong_format = wrong_format;
        self.event = event(inputs.host, line);
        self.heard_count = inputs.bus.len().min(RX) as u8;
        for (slot, frame) in self.heard.iter_mut().zip(inputs.bus) {
            *slot = FlightFrame::of(frame);
        }
    }

    /// Records what came out of it.
    pub fn complete(&mut self, outputs: &jtc_core::Outputs, telemetry: &Telemetry) {
        self.state = telemetry.state as u8;
        self.tes = telemetry.tes as u8;
        self.safety_output = outputs.safety_output.into();
        self.done = u8::from(outputs.host_done) | u8::from(outputs.status) << 1;
        self.sent = outputs.bus.as_ref().map_or(FlightFrame::NONE, FlightFrame::of);
        self.errors = telemetry.errors;
        self.point = telemetry.point;
        for (slot, joint) in self.torque.iter_mut().zip(&telemetry.joints) {
            *slot = joint.torque;
        }
        self.phase = Self::PHASE_COMPLETE;
    }

    /// The state of the bus that went in.
    pub fn bus_state(&self) -> BusState {
        BusState { acknowledged: self.bus_state & 1 != 0, bus_off: self.bus_state & 2 != 0 }
    }

    /// The frames that went in.
    pub fn heard(&self) -> impl Iterator<Item = Frame> {
        self.heard.iter().take(self.heard_count.into()).filter_map(FlightFrame::frame)
    }
}

fn event(event: Option<LinkEvent<'_>>, line: usize) -> FlightEvent {
    match event {
        None => FlightEvent::default(),
        Some(LinkEvent::Frame(frame)) => FlightEvent {
            kind: 1,
            line: line as u8,
            frame_type: frame.frame_type as u8,
            status: 1,
            len: frame.bytes.len() as u16,
            crc: frame.bytes.last_chunk().map_or(0, |crc| u16::from_be_bytes(*crc)),
        },
        Some(LinkEvent::Bad(response)) => FlightEvent {
            kind: 2,
            line: line as u8,
            frame_type: response.frame_type,
            status: response.status as u8,
            len: response.length,
            crc: 0,
        },
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
            let host = LinkEvent::Frame(FrameRef {
                frame_type: FrameType::PidParamUseDefault,
                bytes: &fixed::PID_PARAM_USE_DEFAULT,
            });
            let inputs = Inputs {
                bus: &[answer; 3][..tick % 4],
                bus_state: BusState { acknowledged: tick % 5 != 0, bus_off: tick == 77 },
                safety_input: tick != 150,
                host: (tick % 7 == 0).then_some(host),
                status_free: tick % 3 == 0,
            };
            flight.begin(&inputs, 1, 0);
            let outputs = board.tick(&inputs);
            flight.complete(&outputs, board.telemetry());
            assert!(flight.valid() && flight.phase == Flight::PHASE_COMPLETE && flight.tick == tick as u64);

            let bus: Vec<Frame> = flight.heard().collect();
            let again = pc.tick(&Inputs {
                bus: &bus,
                bus_state: flight.bus_state(),
                safety_input: flight.safety_input != 0,
                host: (flight.event.kind == 1).then_some(host),
                status_free: flight.status_free != 0,
            });
            assert_eq!(again.bus, flight.sent.frame());
            let torque = pc.telemetry().joints.map(|joint| joint.torque.to_bits());
            assert_eq!(torque, flight.torque.map(f64::to_bits));
            assert_eq!(u8::from(again.host_done) | u8::from(again.status) << 1, flight.done);
        }
    }
}
