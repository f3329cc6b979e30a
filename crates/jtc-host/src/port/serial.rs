//! Serial ports of this computer, pseudo-terminals included: 8N1, no flow control, opened for this program alone.

use std::io::{self, Read, Write};
#[cfg(unix)]
use std::os::unix::fs::FileTypeExt as _;
use std::time::{Duration, Instant};

use super::{Port, PortError};

/// Rates up to 15 MBd that adapters know; any other number may work too.
pub const STANDARD_RATES: [u32; 16] = [
    9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 921_600, 1_000_000, 1_500_000,
    2_000_000, 3_000_000, 4_000_000, 12_000_000, 15_000_000,
];

/// How long one write may find no room.
const STALL: Duration = Duration::from_secs(5);
/// Bytes handed over at once, so that a stalled line is noticed.
const CHUNK: usize = 256;

/// An open serial port.
pub struct SerialPort {
    port: Box<dyn serialport::SerialPort>,
    path: String,
    baud: u32,
    start: Instant,
    timeout: Duration,
}

impl SerialPort {
    /// Opens `path` at `baud`.
    ///
    /// # Errors
    ///
    /// The port is not there, is used by another program, may not be opened by this user, or does not take the rate.
    pub fn open(path: &str, baud: u32) -> Result<Self, PortError> {
        // The builder reports a missing port in several ways; ask the file system first.
        if cfg!(unix) && !std::path::Path::new(path).exists() {
            return Err(PortError::NotFound { path: path.to_owned() });
        }
        // A file would be "not a typewriter".
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
        Ok(Self {
            port,
            path: path.to_owned(),
            baud,
            start: Instant::now(),
            timeout: Duration::from_millis(10),
        })
    }

    fn set_timeout(&mut self, timeout: Duration) -> Result<(), PortError> {
        if timeout != self.timeout {
            self.port.set_timeout(timeout).map_err(|e| PortError::io(&self.path, e.into()))?;
            self.timeout = timeout;
        }
        Ok(())
    }
}

fn opening(path: &str, baud: u32, error: serialport::Error) -> PortError {
    let named = path.to_owned();
    match error.kind() {
        serialport::ErrorKind::NoDevice if error.description.contains("busy") => {
            PortError::Busy { path: named }
        }
        // The lock of another program that was opened shared shows as "try again".
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

fn nothing_yet(e: &io::Error) -> bool {
    matches!(e.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl Port for SerialPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        self.set_timeout(timeout)?;
        match self.port.read(buffer) {
            Ok(n) => Ok(n),
            Err(e) if nothing_yet(&e) => Ok(0),
            Err(e) => Err(PortError::io(&self.path, e)),
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.set_timeout(STALL)?;
        for chunk in bytes.chunks(CHUNK) {
            let mut rest = chunk;
            while !rest.is_empty() {
                match self.port.write(rest) {
                    Ok(0) => return Err(PortError::Gone { path: self.path.clone() }),
                    Ok(n) => rest = &rest[n..],
                    Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                    Err(e) if nothing_yet(&e) => {
                        return Err(PortError::Stalled {
                            path: self.path.clone(),
                            seconds: STALL.as_secs_f64(),
                        });
                    }
                    Err(e) => return Err(PortError::io(&self.path, e)),
                }
            }
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn baud(&self) -> Option<u32> {
        Some(self.baud)
    }

    fn name(&self) -> String {
        self.path.clone()
    }
}
