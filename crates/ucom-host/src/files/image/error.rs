//! Reasons why a file is not a valid image.

use super::{AddressUnit, Format};
use crate::master::counted;
use std::path::PathBuf;

/// Reasons why a file cannot be used as an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The image file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the image file.
        path: PathBuf,
        /// Error that the system reported.
        source: std::io::Error,
    },
    /// The image has no data bytes.
    #[error("the image holds no data")]
    Empty,
    /// The file is an executable (ELF) instead of an image.
    #[error("this is an ELF file, not an image; `objcopy -O srec` or `-O binary` makes one")]
    Elf,
    /// The file is a text that contains no record.
    #[error(
        "line 1, column 1: a text and no image, no line is a record of Intel HEX or S-record: \"{starts}…\""
    )]
    Text {
        /// Beginning of the text.
        starts: String,
    },
    /// An editor has written a byte order mark before the first record.
    #[error("byte 1: the text begins with a {mark} byte order mark; save the file as plain ASCII")]
    ByteOrderMark {
        /// Text encoding that the mark shows.
        mark: &'static str,
    },
    /// The format of the bytes in the file is not known.
    #[error("{name}: the file has no record of Intel HEX or S-record, and its name does not end in `.bin`")]
    NotBin {
        /// Name of the image file.
        name: String,
    },
    /// The file would be read as raw bytes, but it contains records, complete or damaged.
    #[error(
        "{place}: a complete or damaged record of Intel HEX or S-record; these characters are not a program"
    )]
    WasRecords {
        /// Position of the first record in the file.
        place: String,
    },
    /// The user requested raw bytes, but the file is a text.
    #[error("raw bytes were requested, but this is a text, not a program: \"{starts}…\"")]
    RawText {
        /// Beginning of the text.
        starts: String,
    },
    /// The user requested raw bytes, but the file name is the name of an Intel HEX or S-record file.
    #[error("{name}: raw bytes were requested, but its name is that of an Intel HEX or S-record file")]
    RawName {
        /// Name of the image file.
        name: String,
    },
    /// The addresses of the records are consistent only in the other unit, not in the usual unit of the format.
    #[error("{error}")]
    OtherUnit {
        /// Error that occurs in the usual unit.
        error: Box<Self>,
        /// Unit in which the addresses are consistent.
        unit: AddressUnit,
    },
    /// No image format has the requested name.
    #[error("unknown image format `{name}`, expected bin, hex or srec")]
    UnknownFormat {
        /// Requested name of the format.
        name: String,
    },
    /// The image or the file is larger than the limit.
    #[error("the image has {bytes} bytes, the limit is {limit}")]
    TooLarge {
        /// Size of the image or of the file.
        bytes: u64,
        /// Size limit of the image in bytes.
        limit: usize,
    },
    /// A line is not a valid record.
    #[error("line {line}, column {column}: {problem}")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Number of the column, from 1.
        column: usize,
        /// Error in this line.
        problem: LineProblem,
    },
    /// The file ends before its end record.
    #[error("no end record after line {lines}: the {format} file was cut off")]
    NoEnd {
        /// Format of the file.
        format: Format,
        /// Number of lines that were read.
        lines: usize,
    },
    /// The records leave a gap in the addresses.
    #[error("no record contains the {} at word address 0x{address_words:X}", counted(*bytes, "byte"))]
    Gap {
        /// First address without data, in words.
        address_words: u32,
        /// Length of the gap in bytes.
        bytes: usize,
    },
    /// The image does not fit into 32-bit word addresses.
    #[error("{words} words from word address 0x{address_words:X} end above the 32-bit address range")]
    AddressRange {
        /// Load address of the image in words.
        address_words: u32,
        /// Length of the image in words.
        words: u32,
    },
}

/// Errors in a line of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineProblem {
    /// The line does not start with the mark of a record.
    #[error("the record does not start with `{expected}`")]
    Start {
        /// Mark at the start of a record.
        expected: char,
    },
    /// A character is not a hexadecimal digit.
    #[error("not a hexadecimal digit")]
    Digit,
    /// The length of the record differs from the length that the record declares.
    #[error("the record has {has} bytes, expected {declared}")]
    Length {
        /// Number of bytes that the length byte declares.
        declared: usize,
        /// Number of bytes that the line contains.
        has: usize,
    },
    /// The checksum of the record is wrong.
    #[error("the checksum is {has:02X}, expected {should:02X}")]
    Checksum {
        /// Checksum in the line.
        has: u8,
        /// Checksum computed from the bytes.
        should: u8,
    },
    /// The format has no record of this type.
    #[error("record type {kind} is unknown")]
    Type {
        /// Type of the record.
        kind: u8,
    },
    /// The data of a record begin or end in the middle of a word.
    #[error("address 0x{address:X} or length {bytes} does not match whole words")]
    HalfWord {
        /// Address of the record, in the unit of the file.
        address: u64,
        /// Number of data bytes in the record.
        bytes: usize,
    },
    /// Two records contain different values for the same address.
    #[error("byte address 0x{address:X} has two different values")]
    Overlap {
        /// First byte address for which the records contain different values.
        address: u64,
    },
    /// The data of the records would make the image larger than the limit.
    #[error("the image from 0x{from:X} to 0x{to:X} (byte addresses) is larger than {limit} bytes")]
    TooLarge {
        /// Size limit of the image in bytes.
        limit: usize,
        /// Lowest byte address of the data.
        from: u64,
        /// Byte address after the highest byte of the data.
        to: u64,
    },
    /// The file contains data after the end record.
    #[error("data after the end record; the file may contain more than one image")]
    AfterEnd,
    /// The number in the count record is wrong.
    #[error("the file has {has} data records, but its count record says {declared}")]
    Count {
        /// Number of data records in the count record.
        declared: u32,
        /// Number of data records in the file.
        has: u32,
    },
}

/// Remedy for an [`ImageError`]. No remedy bypasses a check of the file's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageAdvice {
    /// The advice adds no remedy to the error text.
    None,
    /// The file is damaged or is not an image, so the user must create the file again.
    MakeAgain,
    /// The bytes in the file are not text. Raw bytes need a file name with the extension `.bin`, or the option for raw bytes.
    NameRaw,
    /// The file has the name of an Intel HEX or S-record file, but contains no records. The user must rename the file to match its content.
    Rename,
    /// The user can choose to fill the gaps between records.
    FillGaps,
    /// The records follow one another without gaps if their addresses have this unit.
    OtherUnit(AddressUnit),
    /// The addresses of the records overlap, do not start at whole words, or are too high.
    Addresses,
}

impl ImageError {
    /// Returns the remedy for the error.
    pub fn advice(&self) -> ImageAdvice {
        match self {
            Self::OtherUnit { unit, .. } => ImageAdvice::OtherUnit(*unit),
            Self::Gap { .. } => ImageAdvice::FillGaps,
            Self::NotBin { .. } => ImageAdvice::NameRaw,
            Self::RawName { .. } => ImageAdvice::Rename,
            Self::Io { .. } | Self::Elf | Self::UnknownFormat { .. } | Self::TooLarge { .. } => {
                ImageAdvice::None
            }
            error if error.is_of_addresses() => ImageAdvice::Addresses,
            Self::Empty
            | Self::Text { .. }
            | Self::ByteOrderMark { .. }
            | Self::WasRecords { .. }
            | Self::RawText { .. }
            | Self::Line { .. }
            | Self::NoEnd { .. }
            | Self::AddressRange { .. } => ImageAdvice::MakeAgain,
        }
    }

    /// Returns `true` if the records are valid, but their addresses leave gaps, overlap or are too high. A possible
    /// cause is that the addresses have another unit.
    pub fn is_of_addresses(&self) -> bool {
        use LineProblem::{HalfWord, Overlap, TooLarge};
        matches!(
            self,
            Self::Gap { .. }
                | Self::AddressRange { .. }
                | Self::OtherUnit { .. }
                | Self::Line { problem: HalfWord { .. } | Overlap { .. } | TooLarge { .. }, .. }
        )
    }

    pub(super) fn line(line: usize, column: usize, problem: LineProblem) -> Self {
        Self::Line { line, column, problem }
    }
}
