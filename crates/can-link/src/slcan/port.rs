//! Transport for the lines of the protocol: a serial port or a TCP connection.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Longest time for establishing a TCP connection.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Shortest timeout of a read; with a shorter timeout, a read would not wait.
const SHORTEST: Duration = Duration::from_millis(1);

pub(super) enum Port {
    Serial(Box<dyn serialport::SerialPort>),
    Tcp(TcpStream),
}

impl Port {
    /// Opens `/dev/ttyACM0`, `COM7`, or `tcp:HOST:PORT`. `baud` is the rate of the serial line.
    pub(super) fn open(device: &str, baud: u32) -> io::Result<Self> {
        let Some(address) = device.strip_prefix("tcp:") else {
            let port = serialport::new(device, baud).timeout(SHORTEST).open().map_err(io::Error::from)?;
            return Ok(Self::Serial(port));
        };
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, TIMEOUT) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    return Ok(Self::Tcp(stream));
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    /// Reads bytes that arrive within `timeout`; returns `None` if no byte arrived. At the end of the stream, the
    /// function returns an error.
    pub(super) fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Option<usize>> {
        let timeout = timeout.max(SHORTEST);
        let read = match self {
            Self::Serial(port) => {
                port.set_timeout(timeout).map_err(io::Error::from)?;
                port.read(buffer)
            }
            Self::Tcp(stream) => {
                stream.set_read_timeout(Some(timeout))?;
                stream.read(buffer)
            }
        };
        match read {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(Some(count)),
            Err(error) if is_no_data(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Writes bytes; returns the number of bytes accepted within `timeout`.
    pub(super) fn write(&mut self, bytes: &[u8], timeout: Duration) -> io::Result<usize> {
        let written = match self {
            Self::Serial(port) => {
                port.set_timeout(timeout.max(SHORTEST)).map_err(io::Error::from)?;
                port.write(bytes)
            }
            Self::Tcp(stream) => {
                stream.set_write_timeout(Some(timeout.max(SHORTEST)))?;
                stream.write(bytes)
            }
        };
        match written {
            Err(error) if is_no_data(&error) => Ok(0),
            other => other,
        }
    }
}

fn is_no_data(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}
