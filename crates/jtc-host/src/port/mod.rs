//! Ways to the controller: serial ports, the simulator in this process, and what can be wrapped around them.

mod capture;
#[cfg(unix)]
mod door;
mod error;
#[cfg_attr(not(unix), allow(dead_code))]
pub mod halt;
#[cfg_attr(not(unix), allow(dead_code))]
mod line;
mod list;
pub mod runtime;
mod serial;
#[cfg(feature = "sim")]
pub mod sim;
mod standstill;
pub mod test;

use std::time::Duration;

pub use capture::{Capture, Captured, Direction, read_capture};
pub use error::PortError;
pub use list::{PortInfo, PortKind, list, only_one, usb_names};
pub use serial::{STANDARD_RATES, SerialPort};
pub use standstill::{Standstill, is_moving, is_paused};

/// Number of times that other programs stopped or paused the arm: through a port of this program, or through the agent that has the port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Halts {
    /// Stops and Pauses.
    pub all: u64,
    /// Stops.
    pub stops: u64,
}

/// A byte stream to a controller, polled by one thread.
///
/// Time belongs to the port: in the simulator it is virtual and passes while `read` waits, so that the same code is
/// deterministic there.
pub trait Port {
    /// Waits until at least one byte is there or `timeout` is over; returns how many were read (0: none in that time).
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError>;
    /// Hands all bytes to the line; may block while the line's buffer is full.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError>;
    /// Time since some fixed moment.
    fn now(&self) -> Duration;
    /// Bits per second on the line, where the line has a speed.
    fn baud(&self) -> Option<u32>;
    /// What a person calls this port.
    fn name(&self) -> String {
        "port".to_owned()
    }
    /// Why the frame that was refused last did not get to the device, in words; `None` where it was the device that refused it. Only
    /// a line that is shared with others has something to say here.
    fn take_denial(&mut self) -> Option<String> {
        None
    }
    /// What is written from now on was asked for now. A line that is shared with others passes on nothing that was asked for before
    /// somebody stopped the arm; on others this has nothing to do.
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        Ok(())
    }
    /// Number of Stops and Pauses of other programs that are known so far.
    fn halts(&self) -> Halts {
        Halts::default()
    }
    /// Like [`ask_to_move`](Self::ask_to_move) for a motion that was requested after so many [`halts`](Self::halts): one that has waited since,
    /// as in a queue, does not pass if the arm was stopped meanwhile.
    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        let _ = halts;
        self.ask_to_move()
    }
    /// Like [`ask_to_move`](Self::ask_to_move), to resume a paused motion: after a Stop no motion goes on.
    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        self.ask_to_move()
    }
}

impl<P: Port + ?Sized> Port for Box<P> {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        (**self).read(buffer, timeout)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (**self).write_all(bytes)
    }
    fn now(&self) -> Duration {
        (**self).now()
    }
    fn baud(&self) -> Option<u32> {
        (**self).baud()
    }
    fn name(&self) -> String {
        (**self).name()
    }
    fn take_denial(&mut self) -> Option<String> {
        (**self).take_denial()
    }
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        (**self).ask_to_move()
    }
    fn halts(&self) -> Halts {
        (**self).halts()
    }
    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        (**self).ask_to_move_after(halts)
    }
    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        (**self).ask_to_resume()
    }
}

/// Time that `bytes` take on a line of 8N1 at `baud`; none on a line without a speed.
pub fn line_time(bytes: usize, baud: Option<u32>) -> Duration {
    match baud {
        Some(baud) if baud > 0 => Duration::from_secs_f64(bytes as f64 * 10.0 / f64::from(baud)),
        _ => Duration::ZERO,
    }
}
