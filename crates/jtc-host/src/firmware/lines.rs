//! Serial lines on which the program queries the controller of a board before it flashes the board.
//!
//! The drive and the serial port of an ST-LINK belong to the same USB device. Therefore this serial port is connected to the board that is
//! flashed, and the program always queries this port. The caller can add one more port, because another program may use the controller over
//! its RS422 line.

use std::fs;
use std::path::PathBuf;

use super::preflight::{Asked, Preflight, look};
use super::{Drive, FirmwareError, Places};
use crate::port::{Port, PortError};
use crate::session::Session;

/// Function that opens a serial port for exclusive use by this program.
pub type OpenLine<'a> = dyn FnMut(&str) -> Result<Box<dyn Port>, PortError> + 'a;

/// Serial lines on which the program queries controllers. While these lines are open, other programs and agents cannot use them.
pub struct Lines(Vec<Line>);

struct Line {
    port: String,
    same_device: Option<bool>,
    session: Session<Box<dyn Port>>,
}

impl Lines {
    /// Opens the serial ports of the drive's USB device. Also opens the port `named` if the caller selected a port.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NotAsked`] if a port of the drive's USB device cannot be opened, or if the port `named` is in use. Returns
    /// [`FirmwareError::Port`] if the port `named` cannot be opened for another reason.
    pub fn open(
        places: &Places,
        drive: &Drive,
        named: Option<&str>,
        open: &mut OpenLine<'_>,
    ) -> Result<Self, FirmwareError> {
        let own = places.ports_of(drive);
        let mut lines = Vec::new();
        for port in &own {
            let session = open(port).map(Session::new).map_err(|source| not_asked(port, source))?;
            lines.push(Line { port: port.clone(), same_device: Some(true), session });
        }
        if let Some(port) = named.filter(|named| !own.iter().any(|own| real(own) == real(named))) {
            let session = open(port).map(Session::new).map_err(|source| match source {
                PortError::Busy { .. } => not_asked(port, source),
                source => FirmwareError::Port(source),
            })?;
            let same_device = places.same_usb_device(port, drive);
            lines.push(Line { port: port.to_owned(), same_device, session });
        }
        Ok(Self(lines))
    }

    /// Returns the current report of the controller on each line.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NotAsked`] if a port is lost.
    pub fn look(&mut self) -> Result<Preflight, FirmwareError> {
        let ask = |line: &mut Line| {
            let answers = look(&mut line.session).map_err(|error| match error {
                FirmwareError::Port(source) => not_asked(&line.port, source),
                error => error,
            })?;
            Ok(Asked { port: line.port.clone(), same_device: line.same_device, answers })
        };
        Ok(Preflight { lines: self.0.iter_mut().map(ask).collect::<Result<_, FirmwareError>>()? })
    }

    /// Returns the serial line on which the new program is verified: the line of the board's ST-LINK, or else the
    /// line that the user selected. The second value is `true` if the line belongs to the drive's USB device, and
    /// `None` if this is unknown.
    pub fn proving(&self) -> Option<(&str, Option<bool>)> {
        self.0.first().map(|line| (line.port.as_str(), line.same_device))
    }
}

fn not_asked(port: &str, source: PortError) -> FirmwareError {
    FirmwareError::NotAsked { port: port.to_owned(), source }
}

/// Returns the device node to which a port name refers. Symbolic links are resolved.
fn real(port: &str) -> PathBuf {
    fs::canonicalize(port).unwrap_or_else(|_| port.into())
}
