//! Reasons why a file is not a valid image.

use super::{AddressUnit, Format};
use std::path::PathBuf;

/// Reasons why a file cannot be used as an image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// System error.
        source: std::io::Error,
    },
    /// No data byte.
    #[error("the image holds no data")]
    Empty,
    /// An executable instead of an image.
    #[error("this is an ELF file, not an image; `objcopy -O srec` or `-O binary` makes one")]
    Elf,
    /// A text, and no record in it.
    #[error(
        "line 1, column 1: a text and no image, no line is a record of Intel HEX or S-record: \"{starts}…\""
    )]
    Text {
        /// Beginning of the text.
        starts: String,
    },
    /// An editor has put a mark before the first record.
    #[error("byte 1: a {mark} byte order mark stands before the text; save it as plain ASCII")]
    ByteOrderMark {
        /// Encoding of the mark.
        mark: &'static str,
    },
    /// Bytes without a known format.
    #[error("{name}: no record of Intel HEX or S-record, and no `.bin`")]
    NotBin {
        /// The file.
        name: String,
    },
    /// The file would be read as raw bytes, but holds records, whole or damaged.
    #[error(
        "{place}: a record of Intel HEX or S-record, or what is left of one; its characters are no program"
    )]
    WasRecords {
        /// Place of the first record.
        place: String,
    },
    /// Raw bytes were requested, but the file is a text.
    #[error("a text is no program, raw bytes were asked for: \"{starts}…\"")]
    RawText {
        /// Beginning of the text.
        starts: String,
    },
    /// Raw bytes were requested, but the name is that of a file of records.
    #[error("{name}: raw bytes were asked for, but the name is that of a file of records")]
    RawName {
        /// The file.
        name: String,
    },
    /// The addresses do not fit in the usual unit, but they do in the other unit.
    #[error("{error}")]
    OtherUnit {
        /// Error in the usual unit.
        error: Box<Self>,
        /// Other unit.
        unit: AddressUnit,
    },
    /// The format does not exist.
    #[error("unknown image format `{name}`: one of bin, hex, srec")]
    UnknownFormat {
        /// Requested name.
        name: String,
    },
    /// Image or file larger than the limit.
    #[error("the image has {bytes} bytes, the limit is {limit}")]
    TooLarge {
        /// Size of the image or of the file.
        bytes: u64,
        /// The limit.
        limit: usize,
    },
    /// A line is not a valid record.
    #[error("line {line}, column {column}: {problem}")]
    Line {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// Error in the line.
        problem: LineProblem,
    },
    /// The file ends before its end record.
    #[error("no end record after line {lines}: the {format} file was cut off")]
    NoEnd {
        /// Form of the file.
        format: Format,
        /// Lines read.
        lines: usize,
    },
    /// Records leave addresses out.
    #[error("{bytes} bytes at word address 0x{address_words:X} are in no record")]
    Gap {
        /// First address without data, words.
        address_words: u32,
        /// Length of the gap, bytes.
        bytes: usize,
    },
    /// The image does not fit into 32-bit word addresses.
    #[error("{words} words from word address 0x{address_words:X} end beyond 32 bits")]
    AddressRange {
        /// Load address, words.
        address_words: u32,
        /// Length, words.
        words: u32,
    },
}

/// Errors in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineProblem {
    /// Not the mark of a record.
    #[error("a record starts with `{expected}`")]
    Start {
        /// The mark.
        expected: char,
    },
    /// A character is not a hexadecimal digit.
    #[error("not a hexadecimal digit")]
    Digit,
    /// The record has another length than it declares.
    #[error("the record declares {declared} bytes and has {has}")]
    Length {
        /// Number that the length byte declares.
        declared: usize,
        /// Number in the line.
        has: usize,
    },
    /// Wrong checksum.
    #[error("checksum is {has:02X}, should be {should:02X}")]
    Checksum {
        /// Checksum in the line.
        has: u8,
        /// Checksum of the bytes.
        should: u8,
    },
    /// The record type does not exist.
    #[error("record type {kind} is unknown")]
    Type {
        /// The number.
        kind: u8,
    },
    /// Data that begin or end in the middle of a word.
    #[error("address 0x{address:X} and length {bytes} do not make whole words")]
    HalfWord {
        /// Address in the record's unit.
        address: u64,
        /// Data bytes.
        bytes: usize,
    },
    /// An address that already has another value.
    #[error("byte address 0x{address:X} is given twice with different values")]
    Overlap {
        /// First such address, bytes.
        address: u64,
    },
    /// Data that would make the image larger than the limit.
    #[error("the image gets larger than {limit} bytes: 0x{from:X} to 0x{to:X} (byte addresses)")]
    TooLarge {
        /// The limit, bytes.
        limit: usize,
        /// Lowest address, bytes.
        from: u64,
        /// End of the highest address, bytes.
        to: u64,
    },
    /// Data after the end record.
    #[error("data after the end record")]
    AfterEnd,
    /// The count record disagrees.
    #[error("the count record declares {declared} data records, there are {has}")]
    Count {
        /// Number in the count record.
        declared: u32,
        /// Number in the file.
        has: u32,
    },
}

/// Remedy for an [`ImageError`]. No remedy bypasses a check of the file's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageAdvice {
    /// The error itself says everything.
    None,
    /// The file is damaged or not an image: create it again.
    MakeAgain,
    /// Bytes that are not text: `.bin` is the name of raw bytes, or an option takes them as raw.
    NameRaw,
    /// The file has the name of a file of records and holds none: rename it after its content.
    Rename,
    /// Gaps between records can be filled.
    FillGaps,
    /// The records follow one another if addresses count this unit.
    OtherUnit(AddressUnit),
    /// Addresses overlap, do not start at whole words, or are too high.
    Addresses,
}

impl ImageError {
    /// Returns the remedy.
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

    /// Returns `true` if the records are valid, but their addresses leave gaps, overlap or are too high: they may count another unit.
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
