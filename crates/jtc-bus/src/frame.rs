//! Frames of the bus, and the reasons why a frame cannot be decoded.

use crate::id;

/// Longest payload of this bus, bytes.
pub const MAX_LEN: usize = 24;

/// CAN FD frame of this bus, with an 11-bit identifier, bit rate switch and at most 24 bytes.
///
/// The payload has a length that CAN FD can send: 0..8, 12, 16, 20 or 24 bytes.
///
/// Frames are aligned in memory, so that the processor copies them by words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(align(4))]
pub struct Frame {
    /// 11-bit identifier.
    pub id: u16,
    len: u8,
    data: [u8; MAX_LEN],
}

/// Format of a received frame, for drivers that receive all frames of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// `true` for a 29-bit identifier.
    pub extended: bool,
    /// `true` for a remote frame.
    pub remote: bool,
    /// `true` for CAN FD, `false` for classic CAN.
    pub fd: bool,
}

impl Format {
    /// The only format of this bus: CAN FD with an 11-bit identifier.
    pub const BUS: Self = Self { extended: false, remote: false, fd: true };
}

impl Frame {
    /// Creates a frame. Returns `None` if the length of `data` is not valid on this bus (0..8, 12, 16, 20, 24), or if `id` has more than 11
    /// bits.
    pub const fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > 0x7FF || dlc_of(data.len()).is_none() {
            return None;
        }
        let mut frame = Self { id, len: data.len() as u8, data: [0; MAX_LEN] };
        let mut i = 0;
        while i < data.len() {
            frame.data[i] = data[i];
            i += 1;
        }
        Some(frame)
    }

    /// Creates a frame from the identifier, format and data of a received frame. Other protocols may use the same bus.
    ///
    /// # Errors
    ///
    /// Returns [`FrameError::WrongFormat`] if the format of the frame is not the format of this bus. The caller should count frames with a
    /// wrong format (J-15).
    pub fn received(id: u32, format: Format, data: &[u8]) -> Result<Self, FrameError> {
        let wrong = FrameError::WrongFormat { id, len: data.len().min(255) as u8 };
        if format != Format::BUS {
            return Err(wrong);
        }
        let short = u16::try_from(id).map_err(|_| wrong)?;
        Self::new(short, data).ok_or(wrong)
    }

    /// Creates a frame of zeros, for the encoders of this crate. `LEN` must be a valid payload length of CAN FD.
    pub(crate) fn zeroed<const LEN: usize>(id: u16) -> Self {
        const { assert!(LEN <= MAX_LEN && dlc_of(LEN).is_some()) }
        Self { id: id & 0x7FF, len: LEN as u8, data: [0; MAX_LEN] }
    }

    #[inline]
    pub(crate) fn put<const N: usize>(&mut self, at: usize, bytes: [u8; N]) {
        if let Some(place) = self.data.get_mut(at..at + N) {
            place.copy_from_slice(&bytes);
        }
    }

    /// Returns `N` bytes of the payload from offset `at`. Bytes after the end of the payload are 0, as in the receive buffer of a node.
    #[inline]
    pub(crate) fn get<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        if let Some(place) = self.data.get(at..at + N) {
            bytes.copy_from_slice(place);
        }
        bytes
    }

    #[inline]
    pub(crate) fn byte(&self, at: usize) -> u8 {
        self.get::<1>(at)[0]
    }

    /// Returns the payload.
    #[inline]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Returns the payload as little-endian words, with zeros after the end of the payload.
    #[inline]
    pub fn words(&self) -> [u32; MAX_LEN / 4] {
        let mut words = [0; MAX_LEN / 4];
        for (word, bytes) in words.iter_mut().zip(self.data.as_chunks().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        words
    }

    /// Returns the number of bytes of the payload.
    #[inline]
    #[allow(clippy::len_without_is_empty, reason = "a frame is no collection")]
    pub fn len(&self) -> u8 {
        self.len
    }

    /// Returns the length code (DLC) of the frame, 0..12.
    pub fn dlc(&self) -> u8 {
        dlc_of(usize::from(self.len)).unwrap_or(0)
    }

    /// Returns the node number in the id, 0..15.
    pub fn node(&self) -> u8 {
        id::node(self.id)
    }

    /// Creates a frame from a length code as a CAN controller reports it. Returns `None` if the code represents more than 24 bytes, or more
    /// bytes than `data` contains.
    pub fn from_dlc(id: u16, dlc: u8, data: &[u8]) -> Option<Self> {
        Self::new(id, data.get(..len_of(dlc)?)?)
    }

    #[inline]
    pub(crate) fn need(&self, need: u8) -> Result<(), FrameError> {
        if self.len < need {
            return Err(FrameError::TooShort { id: self.id, len: self.len, need });
        }
        Ok(())
    }
}

/// Returns the length code of a payload, or `None` if the length is not valid on this bus.
const fn dlc_of(len: usize) -> Option<u8> {
    match len {
        0..=8 => Some(len as u8),
        12 => Some(9),
        16 => Some(10),
        20 => Some(11),
        24 => Some(12),
        _ => None,
    }
}

/// Returns the payload length for a length code, or `None` if the length is above 24 bytes.
const fn len_of(dlc: u8) -> Option<usize> {
    match dlc {
        0..=8 => Some(dlc as usize),
        9 => Some(12),
        10 => Some(16),
        11 => Some(20),
        12 => Some(24),
        _ => None,
    }
}

/// Reason why a frame cannot be decoded. The controller counts and ignores frames that it cannot decode (J-15).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The protocol of this bus does not use the identifier.
    UnknownId(u16),
    /// The frame is too short for its identifier.
    TooShort {
        /// Identifier of the frame.
        id: u16,
        /// Length of the received payload, bytes.
        len: u8,
        /// Required length of the payload, bytes.
        need: u8,
    },
    /// A byte has a value that is not valid in its frame.
    BadValue {
        /// Identifier of the frame.
        id: u16,
        /// Offset of the byte in the payload.
        at: u8,
        /// Invalid value of the byte.
        value: u8,
    },
    /// The frame is not a CAN FD data frame with an 11-bit identifier and at most 24 bytes.
    WrongFormat {
        /// Identifier as received, up to 29 bits.
        id: u32,
        /// Length of the received payload, bytes.
        len: u8,
    },
}

impl core::error::Error for FrameError {}

impl core::fmt::Display for FrameError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::UnknownId(id) => write!(f, "no frame of the joint bus has id 0x{id:03X}"),
            Self::TooShort { id, len, need } => {
                write!(f, "frame 0x{id:03X} has {len} bytes and needs {need}")
            }
            Self::BadValue { id, at, value } => {
                write!(f, "frame 0x{id:03X} cannot have the value {value} in byte {at}")
            }
            Self::WrongFormat { id, len } => write!(
                f,
                "frame 0x{id:X} of {len} bytes is not a CAN FD data frame with an 11-bit id and at most \
                 {MAX_LEN} bytes"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j11_lengths_are_those_of_can_fd() {
        let bytes = [0xAA; 64];
        let codes = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24];
        for len in 0..=64 {
            let frame = Frame::new(0x7FF, &bytes[..len]);
            assert_eq!(frame.is_some(), codes.contains(&len), "{len} bytes");
            if let Some(frame) = frame {
                assert_eq!(frame.data(), &bytes[..len]);
                assert_eq!(codes[usize::from(frame.dlc())], len);
                assert_eq!(Frame::from_dlc(0x7FF, frame.dlc(), &bytes), Some(frame));
            }
        }
        for dlc in 13..=255 {
            assert_eq!(Frame::from_dlc(0, dlc, &bytes), None);
        }
        assert_eq!(Frame::from_dlc(0, 9, &bytes[..11]), None);
    }

    #[test]
    fn j11_ids_have_eleven_bits() {
        assert!(Frame::new(0x7FF, &[]).is_some());
        assert!(Frame::new(0x800, &[]).is_none());
    }

    #[test]
    fn j15_frames_of_another_format_are_errors() {
        assert!(Frame::received(0x200, Format::BUS, &[0; 16]).is_ok());
        for format in [
            Format { extended: true, ..Format::BUS },
            Format { remote: true, ..Format::BUS },
            Format { fd: false, ..Format::BUS },
        ] {
            let error = Frame::received(0x200, format, &[0; 8]);
            assert_eq!(error, Err(FrameError::WrongFormat { id: 0x200, len: 8 }));
        }
        let long_id = Frame::received(0x1_0200, Format::BUS, &[0; 16]);
        assert_eq!(long_id, Err(FrameError::WrongFormat { id: 0x1_0200, len: 16 }));
        assert!(Frame::received(0x200, Format::BUS, &[0; 64]).is_err());
    }
}
