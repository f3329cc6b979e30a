//! CAN frames of all kinds. A frame always has a length that is valid for its kind.

use std::fmt;

/// An 11-bit or 29-bit identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Id {
    value: u32,
    extended: bool,
}

impl Id {
    /// Creates an 11-bit identifier.
    pub const fn standard(value: u32) -> Result<Self, InvalidFrame> {
        if value > 0x7FF {
            return Err(InvalidFrame::StandardId { value });
        }
        Ok(Self { value, extended: false })
    }

    /// Creates a 29-bit identifier.
    pub const fn extended(value: u32) -> Result<Self, InvalidFrame> {
        if value > 0x1FFF_FFFF {
            return Err(InvalidFrame::ExtendedId { value });
        }
        Ok(Self { value, extended: true })
    }

    /// Returns the numeric value.
    pub const fn value(self) -> u32 {
        self.value
    }

    /// Returns `true` if the identifier has 29 bits.
    pub const fn is_extended(self) -> bool {
        self.extended
    }
}

impl fmt::Display for Id {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.extended { write!(f, "{:08X}", self.value) } else { write!(f, "{:03X}", self.value) }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Kind {
    Classic,
    Remote,
    Fd { brs: bool },
}

/// A classic, remote or CAN FD frame. The length of a frame is always valid for its kind, so every frame can be sent
/// on a bus.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct CanFrame {
    id: Id,
    kind: Kind,
    len: u8,
    /// Bytes beyond `len` are zero, so that equal frames have equal bytes.
    data: [u8; Self::MAX_LEN],
}

impl CanFrame {
    /// Largest number of bytes in a CAN FD frame.
    pub const MAX_LEN: usize = 64;

    /// Creates a classic frame of at most 8 bytes.
    pub fn classic(id: Id, data: &[u8]) -> Result<Self, InvalidFrame> {
        if data.len() > 8 {
            return Err(InvalidFrame::ClassicLength { id, len: data.len() });
        }
        Ok(Self::made(id, Kind::Classic, data))
    }

    /// Creates a CAN FD frame with bit rate switch and 0..8, 12, 16, 20, 24, 32, 48 or 64 bytes.
    pub fn fd(id: Id, data: &[u8]) -> Result<Self, InvalidFrame> {
        if Self::fd_len(data.len()) != Some(data.len()) {
            return Err(InvalidFrame::FdLength { id, len: data.len() });
        }
        Ok(Self::made(id, Kind::Fd { brs: true }, data))
    }

    /// Creates a CAN FD frame with bit rate switch. Pads the payload with zeros up to the next valid length.
    pub fn fd_padded(id: Id, data: &[u8]) -> Result<Self, InvalidFrame> {
        let len = Self::fd_len(data.len()).ok_or(InvalidFrame::FdLength { id, len: data.len() })?;
        Ok(Self { len: len as u8, ..Self::made(id, Kind::Fd { brs: true }, data) })
    }

    /// Creates a remote frame that requests `len` bytes, 0..8.
    pub fn remote(id: Id, len: usize) -> Result<Self, InvalidFrame> {
        if len > 8 {
            return Err(InvalidFrame::ClassicLength { id, len });
        }
        Ok(Self { len: len as u8, ..Self::made(id, Kind::Remote, &[]) })
    }

    /// Sets or clears the bit rate switch of a CAN FD frame; other frames stay unchanged.
    pub fn with_brs(mut self, brs: bool) -> Self {
        if let Kind::Fd { .. } = self.kind {
            self.kind = Kind::Fd { brs };
        }
        self
    }

    /// Returns the shortest CAN FD payload length of at least `len` bytes, or `None` if `len` is above 64.
    pub const fn fd_len(len: usize) -> Option<usize> {
        match len {
            0..=8 => Some(len),
            9..=24 => Some(len.div_ceil(4) * 4),
            25..=32 => Some(32),
            33..=48 => Some(48),
            49..=64 => Some(64),
            _ => None,
        }
    }

    fn made(id: Id, kind: Kind, bytes: &[u8]) -> Self {
        let mut data = [0; Self::MAX_LEN];
        data[..bytes.len()].copy_from_slice(bytes);
        Self { id, kind, len: bytes.len() as u8, data }
    }

    /// Returns the identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Returns `true` if the identifier has 29 bits.
    pub const fn is_extended(&self) -> bool {
        self.id.extended
    }

    /// Returns `true` for a CAN FD frame.
    pub const fn is_fd(&self) -> bool {
        matches!(self.kind, Kind::Fd { .. })
    }

    /// Returns `true` if the frame has the bit rate switch set.
    pub const fn is_brs(&self) -> bool {
        matches!(self.kind, Kind::Fd { brs: true })
    }

    /// Returns `true` for a remote frame. A remote frame has no payload.
    pub const fn is_remote(&self) -> bool {
        matches!(self.kind, Kind::Remote)
    }

    /// Returns the number of payload bytes; for a remote frame, the number of bytes that the frame requests.
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// Returns `true` if the length of the frame is 0.
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the payload; empty for a remote frame.
    pub fn data(&self) -> &[u8] {
        if self.is_remote() { &[] } else { &self.data[..self.len()] }
    }

    pub(crate) fn data_mut(&mut self) -> &mut [u8] {
        let len = if self.is_remote() { 0 } else { self.len() };
        &mut self.data[..len]
    }
}

/// Prints a frame in the format of `candump`: `123 # 11 22`, CAN FD with `##`, remote frames with `# R2`.
impl fmt::Display for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.id, if self.is_fd() { "##" } else { "#" })?;
        if self.is_remote() {
            return write!(f, " R{}", self.len);
        }
        self.data().iter().try_for_each(|byte| write!(f, " {byte:02X}"))
    }
}

impl fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanFrame({self}{})", if self.is_brs() { ", brs" } else { "" })
    }
}

/// Reasons why a frame is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidFrame {
    /// The identifier is too large for 11 bits.
    #[error("identifier 0x{value:X} has more than 11 bits (0x7FF); it may be an extended identifier")]
    StandardId {
        /// Rejected identifier.
        value: u32,
    },
    /// The identifier is too large for 29 bits.
    #[error("identifier 0x{value:X} has more than 29 bits (0x1FFFFFFF)")]
    ExtendedId {
        /// Rejected identifier.
        value: u32,
    },
    /// A classic frame with more than 8 bytes.
    #[error("frame {id}: {len} bytes, but a classic frame has at most 8; use CAN FD")]
    ClassicLength {
        /// Identifier of the frame.
        id: Id,
        /// Number of bytes.
        len: usize,
    },
    /// The payload length is not a valid CAN FD length.
    #[error("frame {id}: {len} bytes, but a CAN FD frame has 0..8, 12, 16, 20, 24, 32, 48 or 64")]
    FdLength {
        /// Identifier of the frame.
        id: Id,
        /// Number of bytes.
        len: usize,
    },
}

/// Strategy for arbitrary frames in tests.
#[cfg(test)]
pub(crate) fn any_frame() -> impl proptest::strategy::Strategy<Value = CanFrame> {
    use proptest::prelude::*;
    let id = prop_oneof![
        (0..0x800_u32).prop_map(|id| Id::standard(id).unwrap()),
        (0..0x2000_0000_u32).prop_map(|id| Id::extended(id).unwrap()),
    ];
    (id, prop::collection::vec(any::<u8>(), 0..=64), 0..4).prop_map(|(id, data, kind)| {
        let short = data.len().min(8);
        match kind {
            0 => CanFrame::classic(id, &data[..short]).unwrap(),
            1 => CanFrame::remote(id, short).unwrap(),
            2 => CanFrame::fd_padded(id, &data).unwrap(),
            _ => CanFrame::fd_padded(id, &data).unwrap().with_brs(false),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_those_of_the_kind() {
        let id = Id::standard(1).unwrap();
        let bytes = [7; 100];
        let fd = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
        for len in 0..100 {
            assert_eq!(CanFrame::classic(id, &bytes[..len]).is_ok(), len <= 8);
            assert_eq!(CanFrame::remote(id, len).is_ok(), len <= 8);
            assert_eq!(CanFrame::fd(id, &bytes[..len]).is_ok(), fd.contains(&len));
            let padded = CanFrame::fd_padded(id, &bytes[..len]).ok();
            let next = fd.into_iter().find(|next| *next >= len);
            assert_eq!(padded.map(|frame| frame.len()), next);
            if let Some(frame) = padded {
                assert_eq!(&frame.data()[..len], &bytes[..len]);
                assert!(frame.data()[len..].iter().all(|byte| *byte == 0));
            }
        }
    }

    #[test]
    fn ids_have_11_or_29_bits() {
        assert!(Id::standard(0x7FF).is_ok() && Id::standard(0x800).is_err());
        assert!(Id::extended(0x1FFF_FFFF).is_ok() && Id::extended(0x2000_0000).is_err());
        assert_ne!(Id::standard(5), Id::extended(5));
    }

    #[test]
    fn frames_read_like_candump() {
        let id = Id::extended(0x123).unwrap();
        assert_eq!(CanFrame::remote(id, 2).unwrap().to_string(), "00000123 # R2");
        let frame = CanFrame::classic(Id::standard(0x7).unwrap(), &[0xAB, 1]).unwrap();
        assert_eq!(frame.to_string(), "007 # AB 01");
        assert!(!frame.with_brs(true).is_brs());
    }
}
