//! A frame of the CAN bus.

use core::fmt;
use core::str::FromStr;

use crate::foreign::Foreign;
use crate::function::{Function, Sequence};

/// Payload of a frame, with up to 8 data bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Payload {
    len: u8,
    data: [u8; 8],
}

impl Payload {
    /// Payload without data; its DLC is 0.
    pub const EMPTY: Self = Self { len: 0, data: [0; 8] };

    /// Creates a payload from data bytes. Returns `None` if `data` is longer than 8 bytes.
    pub const fn new(data: &[u8]) -> Option<Self> {
        if data.len() > 8 {
            return None;
        }
        let mut payload = Self { len: data.len() as u8, data: [0; 8] };
        let mut i = 0;
        while i < data.len() {
            payload.data[i] = data[i];
            i += 1;
        }
        Some(payload)
    }

    /// Returns the first `len` bytes of `data` as a payload (`len` ≤ 8). Encoders of messages use this function.
    pub(crate) const fn of(data: [u8; 8], len: usize) -> Self {
        let len = if len > 8 { 8 } else { len };
        let mut payload = Self { len: len as u8, data: [0; 8] };
        let mut i = 0;
        while i < len {
            payload.data[i] = data[i];
            i += 1;
        }
        payload
    }

    /// Returns the data bytes of the payload.
    pub fn bytes(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Returns all 8 bytes of the payload. The bytes after the data bytes are 0 (D-12).
    pub const fn padded(&self) -> [u8; 8] {
        self.data
    }

    /// Returns the number of data bytes (0..8), which equals the DLC.
    pub const fn len(&self) -> u8 {
        self.len
    }

    /// Returns `true` if the payload has no data bytes (DLC 0).
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl From<[u8; 8]> for Payload {
    fn from(data: [u8; 8]) -> Self {
        Self { len: 8, data }
    }
}

/// A classic CAN data frame with an 11-bit identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: u16,
    payload: Payload,
}

/// Format of a received frame, for drivers that receive all frames of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// `true` if the identifier has 29 bits.
    pub extended: bool,
    /// `true` if the frame is a remote frame.
    pub remote: bool,
    /// `true` for a CAN FD frame, `false` for a classic frame.
    pub fd: bool,
}

impl Format {
    /// The only valid frame format of the UCoM protocol: a classic data frame with an 11-bit identifier (D-02).
    pub const BUS: Self = Self { extended: false, remote: false, fd: false };
}

impl Frame {
    /// Creates a frame from an identifier and data bytes. Returns `None` if `id` has more than 11 bits or `data` more than 8 bytes. The
    /// function number in the identifier may be undefined; [`Frame::address`] checks the function number.
    pub const fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > 0x7FF {
            return None;
        }
        match Payload::new(data) {
            Some(payload) => Some(Self { id, payload }),
            None => None,
        }
    }

    /// Creates a frame of the UCoM protocol. This function cannot fail, because a [`Sequence`] is always valid.
    pub const fn of(function: Function, sequence: Sequence, payload: Payload) -> Self {
        Self { id: function.id(sequence), payload }
    }

    /// Creates a frame of the UCoM protocol from a received frame. The bus may also carry frames of other protocols (D-02).
    pub fn received(id: u32, format: Format, data: &[u8]) -> Result<Self, Foreign> {
        match format {
            Format { extended: true, .. } => return Err(Foreign::Extended),
            Format { remote: true, .. } => return Err(Foreign::Remote),
            Format { fd: true, .. } => return Err(Foreign::Fd),
            _ => {}
        }
        let id = u16::try_from(id).map_err(|_| Foreign::Malformed)?;
        let frame = Self::new(id, data).ok_or(Foreign::Malformed)?;
        frame.address().map(|_| frame)
    }

    /// Returns the 11-bit identifier of the frame.
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Returns the function and the sequence number that the identifier contains (D-01).
    pub const fn address(&self) -> Result<(Function, Sequence), Foreign> {
        Function::split(self.id)
    }

    /// Returns the data bytes of the frame.
    pub fn data(&self) -> &[u8] {
        self.payload.bytes()
    }

    /// Returns the data bytes of the frame as a [`Payload`].
    pub const fn payload(&self) -> Payload {
        self.payload
    }

    /// Returns the data length code (DLC) of the frame, 0..8.
    pub const fn dlc(&self) -> u8 {
        self.payload.len
    }
}

/// Prints a frame in the format of candump, for example `1C1#0202`.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:03X}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Error: the text is not a frame in the form `1C1#0202`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotAFrame;

impl fmt::Display for NotAFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a frame is written as three hex digits, #, and up to 8 bytes in hex: 1C1#0202")
    }
}

impl core::error::Error for NotAFrame {}

/// Parses a frame in the form that candump prints. Blanks and dots between the data bytes are allowed.
impl FromStr for Frame {
    type Err = NotAFrame;

    fn from_str(text: &str) -> Result<Self, NotAFrame> {
        let (id, data) = text.trim().split_once('#').ok_or(NotAFrame)?;
        if id.len() != 3 || !id.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(NotAFrame);
        }
        let id = u16::from_str_radix(id, 16).map_err(|_| NotAFrame)?;
        let mut bytes = [0; 8];
        let mut digits = 0;
        for character in data.chars().filter(|c| !matches!(c, ' ' | '.' | '_')) {
            let digit = character.to_digit(16).ok_or(NotAFrame)? as u8;
            let byte = bytes.get_mut(digits / 2).ok_or(NotAFrame)?;
            *byte = *byte << 4 | digit;
            digits += 1;
        }
        if digits % 2 != 0 {
            return Err(NotAFrame);
        }
        let data = bytes.get(..digits / 2).ok_or(NotAFrame)?;
        Self::new(id, data).ok_or(NotAFrame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn d02_c2_foreign_frames_are_distinguished() {
        let bus = Format::BUS;
        assert_eq!(Frame::received(0x281, Format { extended: true, ..bus }, &[]), Err(Foreign::Extended));
        assert_eq!(Frame::received(0x281, Format { remote: true, ..bus }, &[]), Err(Foreign::Remote));
        assert_eq!(Frame::received(0x281, Format { fd: true, ..bus }, &[]), Err(Foreign::Fd));
        assert_eq!(Frame::received(0x2A1, bus, &[]), Err(Foreign::Bit5));
        for function in 28..32u8 {
            let id = u32::from(function) << 6 | 3;
            assert_eq!(Frame::received(id, bus, &[]), Err(Foreign::NoFunction(function)));
        }
        assert_eq!(Frame::received(0x800, bus, &[]), Err(Foreign::Malformed));
        assert_eq!(Frame::received(0x1_0281, bus, &[]), Err(Foreign::Malformed));
        assert_eq!(Frame::received(0x281, bus, &[0; 9]), Err(Foreign::Malformed));
        assert!(Frame::received(0x281, bus, &[0; 8]).is_ok());
    }

    #[test]
    fn d04_c3_the_frame_000_is_a_frame() {
        let frame = Frame::received(0, Format::BUS, &[]).unwrap();
        assert_eq!(frame.address(), Ok((Function::Reset, Sequence::ZERO)));
        assert_eq!(frame.to_string(), "000#");
        assert_eq!("000#".parse(), Ok(frame));
    }

    #[test]
    fn errors_in_words() {
        for (error, text) in [
            (Foreign::Extended, "29-bit identifier"),
            (Foreign::Fd, "CAN FD frame"),
            (Foreign::Bit5, "bit 5 of the identifier is set"),
            (Foreign::NoFunction(28), "unknown function 28"),
            (Foreign::Malformed, "identifier or data too long for classic CAN"),
        ] {
            assert_eq!(error.to_string(), text);
        }
        assert!(NotAFrame.to_string().ends_with("1C1#0202"));
    }

    #[test]
    fn eight_bytes_are_a_payload() {
        let payload = Payload::from([1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(payload.bytes(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }

    #[test]
    fn text_form_is_exact() {
        for bad in ["", "281", "28#", "0281#", "800#", "281#1", "281#gg", "281#112233445566778899", "+81#"] {
            assert_eq!(bad.parse::<Frame>(), Err(NotAFrame), "{bad}");
        }
        let frame: Frame = "141#55 43 6F4D.32206865".parse().unwrap();
        assert_eq!(frame.data(), b"UCoM2 he");
        assert_eq!(frame.to_string(), "141#55436F4D32206865");
    }
}
