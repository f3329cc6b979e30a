//! Ports to the controller: serial ports, the simulator in this process, and wrappers that add functions to ports.

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

/// Number of Stops and Pauses that other programs have sent. These programs send them through the port of this program,
/// or through the agent that holds the port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Halts {
    /// Number of Stops and Pauses.
    pub all: u64,
    /// Number of Stops.
    pub stops: u64,
}

/// Byte stream to a controller, polled by one thread.
///
/// The port also provides the clock. In the simulator, time is virtual and advances while `read` waits. Therefore simulations are
/// deterministic.
pub trait Port {
    /// Waits until at least one byte is available or `timeout` has passed. Returns the number of bytes read, which is 0
    /// after a timeout.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError>;
    /// Writes all bytes to the serial line. The function may block while the transmit buffer is full.
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError>;
    /// Returns the time since a fixed reference time.
    fn now(&self) -> Duration;
    /// Returns the bit rate of the line (bits per second), if the line has a bit rate.
    fn baud(&self) -> Option<u32>;
    /// Returns the name of this port as shown to the user.
    fn name(&self) -> String {
        "port".to_owned()
    }
    /// Returns the reason why the last rejected frame did not reach the device. Returns `None` if the frame reached
    /// the device and the device rejected it. Only a line that is shared by several clients can return a reason.
    fn take_denial(&mut self) -> Option<String> {
        None
    }
    /// Marks the start of a motion request. Frames that are written after this call belong to the request. A shared
    /// line rejects a request that was made before another client's Stop. On a line that is not shared, this call has
    /// no effect.
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        Ok(())
    }
    /// Returns the number of times that other programs have stopped or paused the arm. The number includes only the Stops and Pauses that
    /// this port has detected.
    fn halts(&self) -> Halts {
        Halts::default()
    }
    /// Like [`ask_to_move`](Self::ask_to_move), for a motion request that was not executed at once, for example
    /// because it was in a queue. `halts` is the value of [`halts`](Self::halts) at the time of the request. If
    /// another program has stopped or paused the arm since then, the line rejects the motion.
    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        let _ = halts;
        self.ask_to_move()
    }
    /// Like [`ask_to_move`](Self::ask_to_move), for resuming a paused motion. A motion cannot be resumed after a Stop.
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

/// Returns the transmission time of `bytes` on a line with 8N1 at `baud`. Returns zero for a line without a bit rate.
pub fn line_time(bytes: usize, baud: Option<u32>) -> Duration {
    match baud {
        Some(baud) if baud > 0 => Duration::from_secs_f64(bytes as f64 * 10.0 / f64::from(baud)),
        _ => Duration::ZERO,
    }
}
