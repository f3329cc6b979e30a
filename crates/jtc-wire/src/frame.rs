//! Structure of a frame (header, type, length, body and CRC), and the permitted lengths of each frame type.
use core::ops::Range;

use crate::code::codes;
use crate::crc16;
use crate::layout::{ANSWER_MAX, INFO_LEN, LOG_HEAD_LEN, PAGE_HEAD_LEN, SET_VALUES_MAX, VALUE_LEN};

/// First byte of every frame.
pub const HEADER: u8 = 0x9B;
/// Length of the shortest frame, which has no body (J-02).
pub const FRAME_MIN: usize = 6;
/// Maximum length of a frame (J-02).
pub const FRAME_MAX: usize = 60_000;
/// Number of joints of the arm.
pub const JOINTS: usize = 6;

/// Positions of the parts of a frame.
pub mod field {
    use super::Range;

    /// Position of the header byte.
    pub const HEADER: usize = 0;
    /// Position of the type byte.
    pub const TYPE: usize = 1;
    /// Position of the length of the complete frame, a u16.
    pub const LENGTH: Range<usize> = 2..4;
    /// Position of the first byte of the body.
    pub const BODY: usize = 4;
    /// Length of the CRC at the end of the frame.
    pub const CRC_LEN: usize = 2;
    /// Returns the positions of the body of a frame of `n` bytes.
    pub const fn body(n: usize) -> Range<usize> {
        BODY..n - CRC_LEN
    }
}

codes! {
    /// Frame types, with the names of the table of J-06.
    #[derive(PartialOrd, Ord)]
    #[allow(missing_docs)]
    FrameType {
        ClearCurrentErrors = 0x01;
        ClearOccurredErrors = 0x02;
        JtcStatus = 0x03;
        Trajectory = 0x04;
        FrictionTable = 0x05;
        FrictionTableUseDefault = 0x06;
        PidParam = 0x07;
        PidParamUseDefault = 0x08;
        ArmModel = 0x09;
        ArmModelUseDefault = 0x0A;
        TrajSetExecStatus = 0x0B;
        TeachingModeEnable = 0x0C;
        TeachingModeDisable = 0x0D;
        FrictionPolynomial = 0x0E;
        FrictionPolynomialUseDefault = 0x0F;
        ResetCanDevices = 0x10;
        GripperControl = 0x11;
        // Extensions (J-50): requests use the types from 0x40 on, and their answers use the types from 0x50 on.
        GetInfo = 0x40;
        GetSettings = 0x41;
        SetSettings = 0x42;
        SetName = 0x43;
        GetArm = 0x44;
        StoreArm = 0x45;
        Disable = 0x46;
        Jog = 0x47;
        GetLog = 0x4C;
        ClearLog = 0x4D;
        GetPoints = 0x4E;
        Info = 0x50;
        Settings = 0x51;
        Arm = 0x52;
        Log = 0x5C;
        Points = 0x5D;
    }
}

/// Permitted lengths of the frames of one type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lengths {
    /// Frames may have only the lengths in the list.
    OneOf(&'static [u16]),
    /// The lengths from `first` to `last` in steps of `step` bytes are permitted.
    Steps {
        /// Shortest length.
        first: u16,
        /// Difference between two consecutive lengths.
        step: u16,
        /// Maximum length.
        last: u16,
    },
}

/// Length of a Trajectory frame without points, bytes.
pub const TRAJECTORY_OVERHEAD: usize = 14;
/// Length of a point in a Trajectory frame, in bytes.
pub const POINT_LEN: usize = 36;
/// Maximum number of points that fit into a Trajectory frame. (The controller accepts 1,500 points.)
pub const FRAME_POINTS_MAX: usize = (FRAME_MAX - TRAJECTORY_OVERHEAD) / POINT_LEN;

impl FrameType {
    /// Returns the permitted lengths of complete frames of this type. Some hosts send ClearCurrentErrors and FrictionPolynomial with 6
    /// bytes (J-06). JtcStatus has the three lengths of J-08.
    pub const fn lengths(self) -> Lengths {
        use FrameType::*;
        match self {
            ClearCurrentErrors => Lengths::OneOf(&[6, 10]),
            JtcStatus => Lengths::OneOf(&[165, 173, 175]),
            Trajectory => steps(TRAJECTORY_OVERHEAD, POINT_LEN, FRAME_MAX),
            FrictionTable => Lengths::OneOf(&[10_566]),
            PidParam => Lengths::OneOf(&[126]),
            ArmModel => Lengths::OneOf(&[538]),
            TrajSetExecStatus => Lengths::OneOf(&[7]),
            FrictionPolynomial => Lengths::OneOf(&[6, 102, 150]),
            ResetCanDevices | GripperControl => Lengths::OneOf(&[10]),
            GetSettings | GetArm | GetPoints => Lengths::OneOf(&[8]),
            GetLog => Lengths::OneOf(&[12]),
            SetSettings => steps(FRAME_MIN + VALUE_LEN, VALUE_LEN, FRAME_MIN + VALUE_LEN * SET_VALUES_MAX),
            SetName => Lengths::OneOf(&[38]),
            Jog => Lengths::OneOf(&[30]),
            Info => steps(FRAME_MIN + INFO_LEN, 1, ANSWER_MAX),
            Settings => steps(FRAME_MIN + PAGE_HEAD_LEN, VALUE_LEN, ANSWER_MAX),
            Arm => steps(FRAME_MIN + PAGE_HEAD_LEN, 1, ANSWER_MAX),
            Log => steps(FRAME_MIN + LOG_HEAD_LEN, 1, ANSWER_MAX),
            Points => steps(FRAME_MIN + PAGE_HEAD_LEN, POINT_LEN, ANSWER_MAX),
            ClearOccurredErrors
            | FrictionTableUseDefault
            | PidParamUseDefault
            | ArmModelUseDefault
            | TeachingModeEnable
            | TeachingModeDisable
            | FrictionPolynomialUseDefault
            | GetInfo
            | StoreArm
            | Disable
            | ClearLog => Lengths::OneOf(&[6]),
        }
    }

    /// Returns true if a complete frame of this type can have a length of `n` bytes.
    pub const fn can_have(self, n: usize) -> bool {
        match self.lengths() {
            Lengths::OneOf(list) => {
                let mut i = 0;
                while i < list.len() {
                    if list[i] as usize == n {
                        return true;
                    }
                    i += 1;
                }
                false
            }
            Lengths::Steps { first, step, last } => {
                let (first, step, last) = (first as usize, step as usize, last as usize);
                n >= first && n <= last && (n - first).is_multiple_of(step)
            }
        }
    }

    /// Returns the permitted numbers of floats in a body of this type. The slice is empty if the body is not a list of floats.
    pub(crate) const fn float_counts(self) -> &'static [usize] {
        match self {
            FrameType::FrictionTable => &[2640],
            FrameType::PidParam => &[30],
            FrameType::ArmModel => &[133],
            FrameType::FrictionPolynomial => &[24, 36],
            FrameType::Jog => &[6],
            _ => &[],
        }
    }

    /// Returns true if the host sends frames of this type. The device sends frames of all other types.
    pub const fn from_host(self) -> bool {
        !matches!(self, FrameType::JtcStatus) && !self.is_answer()
    }

    /// Returns true for a UseDefault frame, which selects parameters that are already stored in the controller.
    pub const fn is_default(self) -> bool {
        use FrameType::*;
        matches!(
            self,
            FrictionTableUseDefault | PidParamUseDefault | ArmModelUseDefault | FrictionPolynomialUseDefault
        )
    }

    /// Returns true for an answer to an extension request, which the device sends in addition to the response record (J-50).
    pub const fn is_answer(self) -> bool {
        self as u8 >= 0x50
    }

    /// Returns true for an extension request. Existing devices do not know extension requests, and existing hosts do not send them (J-50).
    pub const fn is_extension(self) -> bool {
        matches!(self as u8, 0x40..0x50)
    }
}

const fn steps(first: usize, step: usize, last: usize) -> Lengths {
    Lengths::Steps { first: first as u16, step: step as u16, last: last as u16 }
}

/// Complete frame with a correct CRC and a length that is permitted for its type. The content of the body is not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRef<'a> {
    /// Type of the frame.
    pub frame_type: FrameType,
    /// All bytes of the frame, including header and CRC.
    pub bytes: &'a [u8],
}

impl<'a> FrameRef<'a> {
    /// Checks a complete frame: header, type, length and CRC. The length field must equal the length of `bytes` and be
    /// permitted for the type.
    pub fn new_checked(bytes: &'a [u8]) -> Option<Self> {
        let (head, _) = bytes.split_first_chunk::<4>()?;
        let frame_type = FrameType::from_byte(head[field::TYPE])?;
        let n = usize::from(u16::from_be_bytes([head[2], head[3]]));
        let good = head[field::HEADER] == HEADER
            && n == bytes.len()
            && frame_type.can_have(n)
            // The CRC over a message and its own CRC is zero.
            && crc16(bytes) == 0;
        good.then_some(Self { frame_type, bytes })
    }

    /// Returns the body of the frame: the bytes between the length field and the CRC.
    pub fn body(&self) -> &'a [u8] {
        let end = self.bytes.len().saturating_sub(field::CRC_LEN);
        self.bytes.get(field::BODY..end).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j06_numbers_and_names() {
        for byte in 0..=255u8 {
            match FrameType::from_byte(byte) {
                Some(t) => assert_eq!(t as u8, byte),
                None => {
                    assert!(byte == 0 || matches!(byte, 0x12..0x40 | 0x48..0x4C | 0x4F | 0x53..0x5C | 0x5E..))
                }
            }
        }
    }

    #[test]
    fn j05_lengths_of_each_type() {
        let allowed = |t: FrameType| (0..=65_535).filter(|n| t.can_have(*n)).count();
        for t in FrameType::ALL {
            let expected = match t {
                FrameType::ClearCurrentErrors => 2,
                FrameType::JtcStatus | FrameType::FrictionPolynomial => 3,
                FrameType::Trajectory => FRAME_POINTS_MAX + 1,
                FrameType::SetSettings => SET_VALUES_MAX,
                FrameType::Info => 256 - 142 + 1,
                FrameType::Settings => 25,
                FrameType::Arm => 247,
                FrameType::Log => 256 - 23 + 1,
                FrameType::Points => 7,
                _ => 1,
            };
            assert_eq!(allowed(t), expected, "{t}");
        }
        assert_eq!(FRAME_POINTS_MAX, 1666);
        assert!(FrameType::Trajectory.can_have(54_014) && !FrameType::Trajectory.can_have(54_015));
        assert!(FrameType::FrictionTable.can_have(10_566));
    }

    #[test]
    fn j07_a_short_slice_has_no_body() {
        let frame = FrameRef { frame_type: FrameType::ArmModel, bytes: &[HEADER, 9, 0] };
        assert!(frame.body().is_empty());
        assert_eq!(FrameRef::new_checked(&[]), None);
    }
}
