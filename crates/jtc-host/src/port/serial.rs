//! Serial ports of this computer, including pseudo-terminals. A port is opened exclusively, with 8N1 and without flow control. Other
//! programs of the same user can stop the arm through the port's [door](super::halt).

use std::io;
#[cfg(unix)]
use std::os::unix::fs::FileTypeExt as _;
use std::sync::Arc;
use std::time::Duration;

#[cfg(unix)]
use super::door::Door;
use super::line::Line;
use super::{Halts, Port, PortError};

/// Bit rates up to 15 MBd that adapters support. Other bit rates may also work.
pub const STANDARD_RATES: [u32; 16] = [
    9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000, 1_500_000,
    2_000_000, 3_000_000, 4_000_000, 12_000_000, 15_000_000,
];

/// Open serial port.
pub struct SerialPort {
    /// Door (control socket) of the port. The door must be dropped before the line.
    #[cfg(unix)]
    _door: Option<Door>,
    line: Arc<Line>,
}

impl SerialPort {
    /// Opens `path` at `baud`. Also opens a door (control socket), through which other programs of this user can stop
    /// the arm while this program uses the port.
    ///
    /// # Errors
    ///
    /// Returns an error if the port does not exist, is used by another program, is not accessible for this user, or
    /// does not support the bit rate.
    pub fn open(path: &str, baud: u32) -> Result<Self, PortError> {
        let port = Self::open_without_door(path, baud)?;
        #[cfg(unix)]
        let port = Self { _door: Door::open(&port.line), ..port };
        Ok(port)
    }

    /// Like `open`, but without a door (control socket). The function is for programs that other programs can stop by
    /// another method, for example the agent.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`SerialPort::open`].
    pub fn open_without_door(path: &str, baud: u32) -> Result<Self, PortError> {
        // For a missing port, the library `serialport` returns several different errors. Therefore the file system is
        // checked first.
        if cfg!(unix) && !std::path::Path::new(path).exists() {
            return Err(PortError::NotFound { path: path.to_owned() });
        }
        // If the path is a regular file, the operating system would only report "not a typewriter".
        #[cfg(unix)]
        if std::fs::metadata(path).is_ok_and(|m| !m.file_type().is_char_device()) {
            return Err(PortError::NoPort { path: path.to_owned() });
        }
        let port = serialport::new(path, baud)
            .data_bits(serialport::DataBits::Eight)
            .parity(serialport::Parity::None)
            .stop_bits(serialport::StopBits::One)
            .flow_control(serialport::FlowControl::None)
            .timeout(Duration::from_millis(10))
            .open()
            .map_err(|e| opening(path, baud, e))?;
        let line = Arc::new(Line::new(path, baud, port)?);
        Ok(Self {
            #[cfg(unix)]
            _door: None,
            line,
        })
    }
}

fn opening(path: &str, baud: u32, error: serialport::Error) -> PortError {
    let named = path.to_owned();
    match error.kind() {
        serialport::ErrorKind::NoDevice if error.description.contains("busy") => {
            PortError::Busy { path: named }
        }
        // If another program has opened the port in shared mode, its lock causes the error "try again" here.
        serialport::ErrorKind::Io(io::ErrorKind::WouldBlock) => PortError::Busy { path: named },
        serialport::ErrorKind::NoDevice if cfg!(unix) => PortError::Busy { path: named },
        serialport::ErrorKind::NoDevice => PortError::NotFound { path: named },
        serialport::ErrorKind::InvalidInput => PortError::Baud { path: named, baud },
        _ => match PortError::io(path, error.into()) {
            PortError::Io { source, .. } if source.kind() == io::ErrorKind::InvalidInput => {
                PortError::Baud { path: named, baud }
            }
            other => other,
        },
    }
}

impl Port for SerialPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        self.line.read(buffer, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.line.write_all(bytes)
    }

    fn now(&self) -> Duration {
        self.line.start.elapsed()
    }

    fn baud(&self) -> Option<u32> {
        Some(self.line.baud)
    }

    fn name(&self) -> String {
        self.line.path.clone()
    }

    fn ask_to_move(&mut self) -> Result<(), PortError> {
        self.ask_to_move_after(self.line.halts().all)
    }

    fn halts(&self) -> Halts {
        self.line.halts()
    }

    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        self.line.ask_to_move(halts);
        Ok(())
    }

    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        self.line.ask_to_resume(self.line.halts().all);
        Ok(())
    }
}
