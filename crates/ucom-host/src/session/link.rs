//! Open CAN bus, and the conversion between its frames and the frames of the protocol.

use std::time::{Duration, Instant};

use can_link::{CanBus, CanFrame, ControllerState, Id};
use ucom::{Foreign, Format, Frame};

use super::bus_off::BusOff;
use super::error::SessionError;
use super::pump::Line;
use crate::files::recording::{FrameKind, RecordedFrame};

/// Longest wait that is timed precisely. The first part of a longer wait uses the timeout of the bus, which is less
/// precise.
const COARSE: Duration = Duration::from_millis(12);
/// Interval at which the bus is polled during a wait that is timed precisely.
const LOOK: Duration = Duration::from_micros(100);
/// Largest delay after the planned end of a sleep of the thread. For the last part of a wait, which has this length,
/// the thread polls the bus instead of sleeping.
const OVERSLEPT: Duration = Duration::from_micros(150);

/// Open CAN bus with its clock.
pub struct Link {
    bus: Box<dyn CanBus + Send>,
    url: String,
    start: Instant,
    bus_off: BusOff,
}

impl Link {
    /// Opens a CAN bus.
    ///
    /// # Errors
    /// Returns an error if the URL is not valid or if the bus cannot be opened.
    pub fn open(url: &str) -> Result<Self, SessionError> {
        let bus = can_link::open(url).map_err(|e| SessionError::Open(Box::new(e)))?;
        Ok(Self::on(bus, url))
    }

    /// Creates a link on an open bus. `url` is only used for display.
    pub fn on(bus: Box<dyn CanBus + Send>, url: &str) -> Self {
        Self { bus, url: url.into(), start: Instant::now(), bus_off: BusOff::default() }
    }

    /// Returns the URL of the bus.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Returns the time since the bus was opened, µs.
    pub fn now_us(&self) -> u64 {
        self.start.elapsed().as_micros() as u64
    }

    /// Returns an error if the bus can never carry the frame. The check sends nothing.
    pub fn carries(&self, frame: &CanFrame) -> Result<(), SessionError> {
        self.bus.carries(frame).map_err(SessionError::Bus)
    }

    /// Sends a frame of any protocol.
    pub fn send_wire(&mut self, frame: &CanFrame) -> Result<(), SessionError> {
        self.bus.send(frame).map_err(SessionError::Bus)
    }

    /// Returns the next frame of any protocol. The function waits at most `timeout`.
    pub fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, SessionError> {
        if timeout > COARSE {
            return self.bus.receive(timeout - COARSE).map_err(SessionError::Bus);
        }
        // Sockets round their timeouts up to the system's tick of up to 10 ms, but gaps between frames are shorter.
        let end = Instant::now() + timeout;
        loop {
            if let Some(frame) = self.bus.receive(Duration::ZERO).map_err(SessionError::Bus)? {
                return Ok(Some(frame));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            match left.checked_sub(OVERSLEPT) {
                Some(left) => std::thread::sleep(left.min(LOOK)),
                // The thread does not yield at this point, because on a busy machine a yield would cost some milliseconds.
                None => std::hint::spin_loop(),
            }
        }
    }

    /// Returns the state of the CAN adapter.
    pub fn state(&mut self) -> ControllerState {
        self.bus.state()
    }

    /// Returns the number of times that the controller of this computer has been bus-off.
    pub fn times_bus_off(&self) -> u64 {
        self.bus.times_bus_off()
    }

    /// Returns the message for a new bus-off of this computer's controller, which includes the next command.
    pub fn news(&mut self) -> Option<String> {
        let (times, now_us) = (self.bus.times_bus_off(), self.now_us());
        self.bus_off.look(times, now_us, &self.url)
    }
}

impl Line for Link {
    fn now_us(&self) -> u64 {
        Link::now_us(self)
    }

    fn send(&mut self, frame: &Frame) -> Result<(), SessionError> {
        self.send_wire(&to_wire(frame)?)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<Result<Frame, Foreign>>, SessionError> {
        Ok(Link::receive(self, timeout)?.map(|frame| from_wire(&frame)))
    }
}

/// Converts a frame of the protocol to a frame of the bus.
pub fn to_wire(frame: &Frame) -> Result<CanFrame, SessionError> {
    let id = Id::standard(frame.id().into());
    let made = id.and_then(|id| CanFrame::classic(id, frame.data()));
    made.map_err(SessionError::Frame)
}

/// Converts a frame of the bus to a frame of the protocol. If the frame is foreign, the function returns the reason (D-02).
pub fn from_wire(frame: &CanFrame) -> Result<Frame, Foreign> {
    let format = Format { extended: frame.is_extended(), remote: frame.is_remote(), fd: frame.is_fd() };
    Frame::received(frame.id().value(), format, frame.data())
}

/// Converts a frame of the bus to a frame of a recording.
pub fn recorded(frame: &CanFrame) -> RecordedFrame {
    let kind = if frame.is_remote() {
        FrameKind::Remote { length: frame.len() as u8 }
    } else if frame.is_fd() {
        FrameKind::Fd { flags: frame.is_brs().into() }
    } else {
        FrameKind::Data
    };
    let (id, extended) = (frame.id().value(), frame.is_extended());
    RecordedFrame { id, extended, kind, data: frame.data().to_vec(), dlc: None }
}

/// Converts a frame of a recording to a frame of the bus; returns `None` for error frames and invalid frames.
pub fn replayed(frame: &RecordedFrame) -> Option<CanFrame> {
    let id = if frame.extended { Id::extended(frame.id) } else { Id::standard(frame.id) }.ok()?;
    match frame.kind {
        FrameKind::Data => CanFrame::classic(id, &frame.data).ok(),
        FrameKind::Remote { length } => CanFrame::remote(id, length.into()).ok(),
        FrameKind::Fd { flags } => CanFrame::fd(id, &frame.data).ok().map(|f| f.with_brs(flags & 1 != 0)),
        FrameKind::Error => None,
    }
}

/// Converts a frame of a recording to a frame of the protocol. If the frame is foreign, the function returns the reason.
pub fn protocol_frame(frame: &RecordedFrame) -> Result<Frame, Foreign> {
    let format = Format {
        extended: frame.extended,
        remote: matches!(frame.kind, FrameKind::Remote { .. }),
        fd: matches!(frame.kind, FrameKind::Fd { .. }),
    };
    if frame.kind == FrameKind::Error {
        return Err(Foreign::Malformed);
    }
    Frame::received(frame.id, format, &frame.data)
}
