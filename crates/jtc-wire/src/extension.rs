//! Extensions of the protocol (J-50) for identity, settings and the arm image. Requests have the types 0x40 to 0x4F. A device can answer a
//! request with a frame of type 0x50 to 0x5F, in addition to the response record. The device sends such an answer only after a request,
//! and only on the serial line of the request.
use core::fmt;

use crate::crc16;
use crate::encode_error::EncodeError;
use crate::frame::{FRAME_MIN, FrameRef, FrameType, HEADER, POINT_LEN};
use crate::layout::{ANSWER_MAX, PAGE_HEAD_LEN, VALUE_LEN};
use crate::segment::RawPoint;

mod image;
mod info;
mod log;
mod reactions;

pub use image::{ArmImage, FrictionImage, Hash, IMAGE_MAX, field as image_field};
pub use log::{LOG_NO_BLOCK, LOG_PAGE, LogPage, LogState};
pub use reactions::{Reactions, StopCause, StopKind};

pub use info::{BootCause, INFO_WRITTEN, Info, Program, SIMULATOR, StoreState, capability};

/// Version of the extensions that this crate implements. Later versions only add functions.
pub const EXTENSION_VERSION: u8 = 1;
/// Highest number of values in a Settings frame.
pub const PAGE_VALUES: usize = (ANSWER_MAX - FRAME_MIN - PAGE_HEAD_LEN) / VALUE_LEN;
/// Maximum number of bytes of the arm image in an Arm frame.
pub const PAGE_BYTES: usize = ANSWER_MAX - FRAME_MIN - PAGE_HEAD_LEN;
/// Maximum number of points in a Points frame.
pub const PAGE_POINTS: usize = (ANSWER_MAX - FRAME_MIN - PAGE_HEAD_LEN) / POINT_LEN;
/// Number of bytes of a [`Name`].
pub const NAME_LEN: usize = 32;

/// Name of an arm, as UTF-8 text without control characters, padded with zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
pub struct Name([u8; NAME_LEN]);

impl Name {
    /// Creates a name. Returns `None` if `text` is longer than [`NAME_LEN`] bytes or contains control characters.
    pub fn new(text: &str) -> Option<Self> {
        let mut bytes = [0; NAME_LEN];
        bytes.get_mut(..text.len())?.copy_from_slice(text.as_bytes());
        (!text.chars().any(char::is_control)).then_some(Self(bytes))
    }

    /// Returns a name with as many whole characters of `text` as fit into [`NAME_LEN`] bytes, without control
    /// characters.
    pub fn cut(text: &str) -> Self {
        let (mut bytes, mut len) = ([0; NAME_LEN], 0);
        for c in text.chars().filter(|c| !c.is_control()) {
            let Some(place) = bytes.get_mut(len..len + c.len_utf8()) else { break };
            c.encode_utf8(place);
            len += c.len_utf8();
        }
        Self(bytes)
    }

    /// Parses a name from the wire format. Returns `None` if the bytes are not valid text, or if a byte after the end of the text is not
    /// zero.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let bytes: [u8; NAME_LEN] = bytes.try_into().ok()?;
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(NAME_LEN);
        if bytes.get(end..)?.iter().any(|byte| *byte != 0) {
            return None;
        }
        Self::new(core::str::from_utf8(bytes.get(..end)?).ok()?)
    }

    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        let end = self.0.iter().position(|byte| *byte == 0).unwrap_or(NAME_LEN);
        self.0.get(..end).and_then(|text| core::str::from_utf8(text).ok()).unwrap_or_default()
    }

    /// Returns the bytes of the name in the wire format.
    pub const fn as_bytes(&self) -> &[u8; NAME_LEN] {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// Value of a setting (J-53). The table of the controller contains the name, unit and range of each setting number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettingValue {
    /// Number of the setting.
    pub setting: u8,
    /// Number of the joint, from 1 at the base; 0 if the setting does not belong to a joint.
    pub joint: u8,
    /// Value in the unit of the setting. For a switch, the value is 0 or 1.
    pub value: f64,
}

impl SettingValue {
    /// Returns the setting value in the wire format, in the order setting, joint, value.
    pub fn emit(&self) -> [u8; VALUE_LEN] {
        let [a, b, c, d, e, f, g, h] = self.value.to_be_bytes();
        [self.setting, self.joint, a, b, c, d, e, f, g, h]
    }

    /// Parses a value from the wire format.
    pub fn parse(bytes: &[u8; VALUE_LEN]) -> Self {
        let [setting, joint, value @ ..] = *bytes;
        Self { setting, joint, value: f64::from_be_bytes(value) }
    }
}

/// A list of [`SettingValue`]s in the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Values<'a>(&'a [u8]);

impl<'a> Values<'a> {
    /// Parses a list of values. Returns `None` if the bytes are not a whole number of values.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        bytes.len().is_multiple_of(VALUE_LEN).then_some(Self(bytes))
    }

    /// Returns all values in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = SettingValue> + use<'a> {
        self.0.as_chunks::<VALUE_LEN>().0.iter().map(SettingValue::parse)
    }

    /// Returns the number of values in the list.
    pub fn len(&self) -> usize {
        self.0.len() / VALUE_LEN
    }

    /// Returns `true` if the list is empty.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl fmt::Display for Values<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} values", self.len())?;
        if f.alternate() {
            for SettingValue { setting, joint, value } in self.iter() {
                write!(f, "\n  setting {setting}")?;
                if joint > 0 {
                    write!(f, ", joint {joint}")?;
                }
                write!(f, " = {value}")?;
            }
        }
        Ok(())
    }
}

/// Answer of a device to an extension request, in addition to the response record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer<'a> {
    /// Answer to GetInfo.
    Info(Info),
    /// Answer to GetSettings.
    Settings {
        /// Number of values that precede the first value of this frame.
        first: u16,
        /// Total number of values in the device.
        total: u16,
        /// Values in this frame.
        values: Values<'a>,
    },
    /// Answer to GetArm, with bytes of the arm image.
    Arm {
        /// Position of the first byte of this frame in the arm image.
        offset: u16,
        /// Length of the arm image in bytes.
        total: u16,
        /// Bytes of the arm image in this frame.
        bytes: &'a [u8],
    },
    /// Answer to GetLog, with bytes of the flight recorder's log.
    Log(LogPage<'a>),
    /// Answer to GetPoints, with points of the trajectory in memory.
    Points {
        /// Number of points that precede the first point of this frame.
        first: u16,
        /// Total number of points in the trajectory.
        total: u16,
        /// Points in this frame.
        points: Points<'a>,
    },
}

/// Points of a trajectory in the wire format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Points<'a>(&'a [u8]);

impl<'a> Points<'a> {
    /// Parses a list of points. Returns `None` if the bytes are not a whole number of points.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        bytes.len().is_multiple_of(POINT_LEN).then_some(Self(bytes))
    }

    /// Returns all points in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = RawPoint> + use<'a> {
        self.0.as_chunks::<POINT_LEN>().0.iter().map(RawPoint::parse)
    }
}

impl<'a> Answer<'a> {
    /// Parses an answer. Returns `None` if the frame has a different type or an invalid body.
    pub fn parse(frame: FrameRef<'a>) -> Option<Self> {
        let body = frame.body();
        let page = || {
            let ([a, b, c, d], rest) = body.split_first_chunk::<PAGE_HEAD_LEN>()?;
            Some((u16::from_be_bytes([*a, *b]), u16::from_be_bytes([*c, *d]), rest))
        };
        match frame.frame_type {
            FrameType::Info => Info::parse(body).map(Self::Info),
            FrameType::Settings => {
                let (first, total, rest) = page()?;
                Some(Self::Settings { first, total, values: Values::parse(rest)? })
            }
            FrameType::Arm => {
                let (offset, total, bytes) = page()?;
                Some(Self::Arm { offset, total, bytes })
            }
            FrameType::Log => LogPage::parse(body).map(Self::Log),
            FrameType::Points => {
                let (first, total, rest) = page()?;
                Some(Self::Points { first, total, points: Points::parse(rest)? })
            }
            _ => None,
        }
    }

    /// Returns the type of the frame that carries the answer.
    pub const fn frame_type(&self) -> FrameType {
        match self {
            Self::Info(_) => FrameType::Info,
            Self::Settings { .. } => FrameType::Settings,
            Self::Arm { .. } => FrameType::Arm,
            Self::Log(_) => FrameType::Log,
            Self::Points { .. } => FrameType::Points,
        }
    }

    /// Writes the frame of the answer and returns the length of the frame.
    ///
    /// # Errors
    /// Returns [`EncodeError::BufferTooShort`] if `out` is too short, or if the content does not fit into a frame of [`ANSWER_MAX`] bytes.
    pub fn emit(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        let page = |from: u16, total: u16| {
            let ([a, b], [c, d]) = (from.to_be_bytes(), total.to_be_bytes());
            [a, b, c, d]
        };
        match *self {
            Self::Info(info) => sealed(out, FrameType::Info, &info.emit(), &[]),
            Self::Settings { first, total, values } => {
                sealed(out, FrameType::Settings, &page(first, total), values.0)
            }
            Self::Arm { offset, total, bytes } => sealed(out, FrameType::Arm, &page(offset, total), bytes),
            Self::Log(log) => sealed(out, FrameType::Log, &log.head(), log.bytes),
            Self::Points { first, total, points } => {
                sealed(out, FrameType::Points, &page(first, total), points.0)
            }
        }
    }
}

/// Writes a frame whose body has two parts, and returns the length of the frame. The board runs this function, so it must not contain a
/// slice operation that could panic.
fn sealed(out: &mut [u8], frame_type: FrameType, first: &[u8], second: &[u8]) -> Result<usize, EncodeError> {
    let (n, given) = (FRAME_MIN + first.len() + second.len(), out.len().min(ANSWER_MAX));
    let short = EncodeError::BufferTooShort { needed: n, given };
    let out = out.get_mut(..n).filter(|_| n <= ANSWER_MAX).ok_or(short)?;
    let (covered, crc) = out.split_last_chunk_mut().ok_or(short)?;
    let [high, low] = (n as u16).to_be_bytes();
    let head = [HEADER, frame_type as u8, high, low];
    for (to, byte) in covered.iter_mut().zip(head.iter().chain(first).chain(second)) {
        *to = *byte;
    }
    *crc = crc16(covered).to_be_bytes();
    Ok(n)
}

impl fmt::Display for Answer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Info(info) => info.fmt(f),
            Self::Settings { first, total, values } => {
                write!(f, "Settings: from {first} on of {total}, ")?;
                values.fmt(f)
            }
            Self::Arm { offset, total, bytes } => {
                write!(f, "Arm: {} bytes from {offset} on of {total}", bytes.len())
            }
            Self::Log(log) => log.fmt(f),
            Self::Points { first, total, points } => {
                write!(f, "Points: {} from {first} on of {total}", points.iter().len())
            }
        }
    }
}

#[cfg(test)]
mod tests;
