//! Frames of a recording, including frames of other protocols.

use std::fmt;
/// Kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// Classic data frame.
    Data,
    /// Remote frame: it has no data and requests `length` bytes.
    Remote {
        /// Requested length, 0..8 bytes.
        length: u8,
    },
    /// CAN FD frame.
    Fd {
        /// Flags in the format of candump: bit 0 is the bit rate switch, and bit 1 is the error state.
        flags: u8,
    },
    /// Error report of the CAN adapter, which is not a frame on the bus.
    Error,
}

/// A frame in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordedFrame {
    /// Identifier of the frame, or the error class of an error report.
    pub id: u32,
    /// `true` if the identifier has 29 bits.
    pub extended: bool,
    /// Kind of the frame.
    pub kind: FrameKind,
    /// Payload of the frame.
    pub data: Vec<u8>,
    /// Raw DLC 9..15 of a classic frame with eight bytes, if candump recorded it.
    pub dlc: Option<u8>,
}

impl RecordedFrame {
    /// Creates a classic data frame with an 11-bit identifier.
    pub fn classic(id: u16, data: &[u8]) -> Self {
        Self { id: id.into(), extended: false, kind: FrameKind::Data, data: data.to_vec(), dlc: None }
    }

    /// Returns identifier and payload of a classic data frame with an 11-bit identifier (D-02); returns `None` for other frames.
    pub fn as_classic(&self) -> Option<(u16, &[u8])> {
        let id = u16::try_from(self.id).ok().filter(|id| *id <= 0x7FF)?;
        (self.kind == FrameKind::Data && !self.extended && self.data.len() <= 8)
            .then_some((id, &self.data[..]))
    }
}

/// Prints a frame in the format of candump.
/// Error classes in the identifier of an error frame (linux/can/error.h).
const ERROR_CLASSES: [(u32, &str); 10] = [
    (0x001, "transmit timeout"),
    (0x002, "lost arbitration"),
    (0x004, "controller"),
    (0x008, "protocol violation"),
    (0x010, "transceiver"),
    (0x020, "no acknowledge"),
    (0x040, "bus-off"),
    (0x080, "bus error"),
    (0x100, "controller restarted"),
    (0x200, "error counters"),
];
/// Problems of a controller in byte 1 of an error frame.
const CONTROLLER_PROBLEMS: [(u8, &str); 7] = [
    (0x01, "receive overflow"),
    (0x02, "transmit overflow"),
    (0x04, "receive warning"),
    (0x08, "transmit warning"),
    (0x10, "receive passive"),
    (0x20, "transmit passive"),
    (0x40, "active again"),
];

impl RecordedFrame {
    /// Returns the errors that an error frame reports, as text. Returns `None` for all other frames.
    pub fn error_text(&self) -> Option<String> {
        if self.kind != FrameKind::Error {
            return None;
        }
        let problems = self.data.get(1).copied().unwrap_or(0);
        let problems =
            CONTROLLER_PROBLEMS.iter().filter(|(bit, _)| self.id & 0x4 != 0 && problems & bit != 0);
        let classes = ERROR_CLASSES.iter().filter(|(bit, name)| self.id & bit != 0 && *name != "controller");
        let all: Vec<&str> = classes.map(|(_, name)| *name).chain(problems.map(|(_, name)| *name)).collect();
        Some(if all.is_empty() { "unknown error".into() } else { all.join(", ") })
    }
}

impl fmt::Display for RecordedFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.kind == FrameKind::Error {
            write!(f, "{:08X}#", 0x2000_0000 | self.id)?;
        } else if self.extended {
            write!(f, "{:08X}#", self.id)?;
        } else {
            write!(f, "{:03X}#", self.id)?;
        }
        match self.kind {
            FrameKind::Remote { length: 0 } => write!(f, "R")?,
            FrameKind::Remote { length } => write!(f, "R{length}")?,
            FrameKind::Fd { flags } => write!(f, "#{:X}", flags & 0xF)?,
            FrameKind::Data | FrameKind::Error => {}
        }
        self.data.iter().try_for_each(|byte| write!(f, "{byte:02X}"))?;
        if let Some(dlc) = self.dlc {
            write!(f, "_{dlc:X}")?;
        }
        Ok(())
    }
}

/// Direction of a frame, if the recording contains it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The recorder received the frame (`R`).
    Received,
    /// The recorder itself sent the frame (`T`).
    Sent,
}

/// Record of one frame in a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Time since the recorder's epoch, ns.
    pub time_ns: u64,
    /// Name of the CAN interface.
    pub channel: String,
    /// Direction of the frame.
    pub direction: Option<Direction>,
    /// Frame of this record.
    pub frame: RecordedFrame,
}
