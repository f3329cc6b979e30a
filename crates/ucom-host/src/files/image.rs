//! Reads firmware images. The reader converts raw bytes, Intel HEX and Motorola S-records to the bytes that an update
//! sends. An update never sends the characters of an Intel HEX or S-record file.
//!
//! The addresses of the loader count 16-bit words, so every image starts at a word and consists of complete words.
//! Addresses in S-records of the boards' toolchain also count words; addresses in Intel HEX and all other formats
//! count bytes. Some files use the other unit, and the reader detects this from the records. In the right unit, each
//! record follows the previous record without a gap; in the wrong unit, the records leave gaps or overlap. If the
//! file has only one or two records, the reader does not guess the unit. The user can always set the unit by an
//! option.
mod detect;
mod error;
mod hex;
mod segments;
mod srec;
#[cfg(test)]
mod tests;

use core::fmt;
use core::str::FromStr;

use crate::master::counted;

pub use error::{ImageAdvice, ImageError, LineProblem};
use segments::{Segments, without_padding};

/// Largest size of an image, in bytes, unless [`ImageOptions::max_bytes`] sets another limit: 1 MiB.
pub const MAX_BYTES: usize = 1 << 20;

/// Minimum number of consecutive records that show the unit of the addresses. Fewer records can follow one another by
/// coincidence: in the wrong unit, an intended gap that is as long as a record is not visible. A table of interrupt
/// vectors can have such a gap after every entry, but its records are short (see `EVIDENCE_BYTES`).
const EVIDENCE: usize = 3;
/// Minimum average length, in bytes, of the records that show the unit of the addresses. Linkers write records of 16 bytes and more.
const EVIDENCE_BYTES: usize = 12;

/// Format of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Raw bytes in the order in which the update sends them.
    Bin,
    /// Intel HEX (records `:LLAAAATT…`).
    IntelHex,
    /// Motorola S-record (records `S1…`, `S2…`, `S3…`).
    SRecord,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bin => "bin",
            Self::IntelHex => "hex",
            Self::SRecord => "srec",
        })
    }
}

impl FromStr for Format {
    type Err = ImageError;

    /// Reads a format from one of the texts `bin`, `hex` and `srec`.
    fn from_str(text: &str) -> Result<Self, ImageError> {
        match text {
            "bin" => Ok(Self::Bin),
            "hex" | "ihex" => Ok(Self::IntelHex),
            "srec" | "s19" | "s28" | "s37" => Ok(Self::SRecord),
            _ => Err(ImageError::UnknownFormat { name: text.into() }),
        }
    }
}

/// Unit of record addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AddressUnit {
    /// Addresses count bytes.
    Byte,
    /// Addresses count words of 16 bits: each word is two bytes of the record.
    Word,
}

impl fmt::Display for AddressUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Byte => "byte",
            Self::Word => "word",
        })
    }
}

/// Treatment of gaps between records. A gap consists of addresses, between the first and the last byte, for which no record has data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gaps {
    /// The reader refuses a file with a gap.
    #[default]
    Refuse,
    /// The reader fills the gap with this byte, and lists the gap in [`Image::notes`]. 0xFF is the erased state of flash.
    Fill(u8),
}

/// Options for reading an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageOptions {
    /// Format of the image file. If `None`, the reader detects the format from the content and the name of the file.
    /// With [`Format::Bin`], the reader still refuses records, and accepts a text only in a `.bin` file.
    pub format: Option<Format>,
    /// Unit of the record addresses. If `None`, addresses in S-records count words, and addresses in Intel HEX count
    /// bytes. If at least three records follow one another only in the other unit, the reader uses that unit.
    pub address_unit: Option<AddressUnit>,
    /// Treatment of gaps between records.
    pub gaps: Gaps,
    /// `true` to swap the two bytes of each word, for a toolchain that writes the bytes in another order than the
    /// update sends them.
    pub swap_bytes: bool,
    /// Load address in words, which replaces the address in the image file. If `None`, the reader uses the address in the file, or 0 for
    /// raw bytes.
    pub load_address_words: Option<u32>,
    /// Largest length of the image in bytes, including gaps.
    pub max_bytes: usize,
}

impl Default for ImageOptions {
    fn default() -> Self {
        Self {
            format: None,
            address_unit: None,
            gaps: Gaps::Refuse,
            swap_bytes: false,
            load_address_words: None,
            max_bytes: MAX_BYTES,
        }
    }
}

/// A property of an image that the user should know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageNote {
    /// The reader filled a gap.
    GapFilled {
        /// First address without data, in words.
        address_words: u32,
        /// Length of the gap in bytes.
        bytes: usize,
        /// Byte that fills the gap.
        with: u8,
    },
    /// The last word had only one byte, so the reader added a byte: 0xFF, or the byte that fills gaps.
    LastWordPadded {
        /// Byte that was added.
        with: u8,
    },
    /// The file has no end record. Its last record is a count record, and the number in this count record is correct.
    EndedByCount {
        /// Number of data records in the file.
        records: u32,
    },
    /// The records follow one another without gaps only if their addresses have this unit. This unit differs from the usual unit of the
    /// file format.
    AddressesCount(AddressUnit),
}

impl fmt::Display for ImageNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::GapFilled { address_words, bytes, with } => {
                let bytes = counted(*bytes, "byte");
                write!(f, "gap of {bytes} at word address 0x{address_words:X} filled with {with:02X}")
            }
            Self::EndedByCount { records } => {
                write!(f, "no end record; the count record confirms all {records} data records")
            }
            Self::LastWordPadded { with } => {
                write!(f, "odd number of bytes: {with:02X} added to fill the last word")
            }
            Self::AddressesCount(unit) => {
                write!(f, "addresses are read in {unit}s, because only then the records are contiguous")
            }
        }
    }
}

/// An image in the form that the loader accepts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    bytes: Vec<u8>,
    address_words: u32,
    format: Format,
    notes: Vec<ImageNote>,
}

impl Image {
    /// Reads the content of an image file. The content is read as raw bytes unless the options or the content determine another format.
    pub fn parse(content: &[u8], options: &ImageOptions) -> Result<Self, ImageError> {
        Self::parse_named(None, content, options)
    }

    fn parse_named(
        name: Option<&std::path::Path>,
        content: &[u8],
        options: &ImageOptions,
    ) -> Result<Self, ImageError> {
        if content.is_empty() {
            return Err(ImageError::Empty);
        }
        let format = match options.format {
            None => Format::of(name, content)?,
            Some(Format::Bin) => Format::raw(name, content)?,
            Some(format) => format,
        };
        let mut image = match format {
            Format::Bin => Self::raw(content, options)?,
            Format::IntelHex | Format::SRecord => Self::records(content, format, options)?,
        };
        if image.bytes.len() % 2 == 1 {
            let with = if let Gaps::Fill(with) = options.gaps { with } else { 0xFF };
            image.bytes.push(with);
            image.notes.push(ImageNote::LastWordPadded { with });
        }
        if options.swap_bytes {
            image.bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|word| word.swap(0, 1));
        }
        if let Some(address) = options.load_address_words {
            image.address_words = address;
        }
        let words = u32::try_from(image.bytes.len() / 2).unwrap_or(u32::MAX);
        if image.address_words.checked_add(words).is_none() {
            return Err(ImageError::AddressRange { address_words: image.address_words, words });
        }
        Ok(image)
    }

    /// Reads an image from a file.
    pub fn read(path: &std::path::Path, options: &ImageOptions) -> Result<Self, ImageError> {
        let io = |source: std::io::Error| ImageError::Io { path: path.into(), source };
        // The file needs at most 16 characters per byte of the image, if its records have at least two data bytes.
        // For example, an S-record with a 32-bit address and two data bytes has at most 20 characters, including the
        // line end.
        let most = (options.max_bytes as u64).saturating_mul(16).saturating_add(4096);
        let length = std::fs::metadata(path).map_err(io)?.len();
        if length > most {
            return Err(ImageError::TooLarge { bytes: length, limit: options.max_bytes });
        }
        Self::parse_named(Some(path), &std::fs::read(path).map_err(io)?, options)
    }

    fn raw(content: &[u8], options: &ImageOptions) -> Result<Self, ImageError> {
        if content.len() > options.max_bytes {
            return Err(ImageError::TooLarge { bytes: content.len() as u64, limit: options.max_bytes });
        }
        Ok(Self { bytes: content.to_vec(), address_words: 0, format: Format::Bin, notes: Vec::new() })
    }

    /// Reads records in the usual unit of their format. If the records follow one another only in the other unit, the function uses that
    /// unit.
    fn records(content: &[u8], format: Format, options: &ImageOptions) -> Result<Self, ImageError> {
        let (usual, other) = match format {
            Format::SRecord => (AddressUnit::Word, AddressUnit::Byte),
            _ => (AddressUnit::Byte, AddressUnit::Word),
        };
        let content = without_padding(content);
        let read = |unit, gaps| {
            let (mut segments, mut notes) = (Segments::new(unit, options.max_bytes), Vec::new());
            match format {
                Format::SRecord => srec::read(content, &mut segments, &mut notes)?,
                _ => hex::read(content, &mut segments)?,
            }
            let records = segments.records();
            let (address_words, bytes) = segments.join(gaps, &mut notes)?;
            Ok((Self { bytes, address_words, format, notes }, records))
        };
        if let Some(unit) = options.address_unit {
            return read(unit, options.gaps).map(|(image, _)| image);
        }
        match read(usual, Gaps::Refuse) {
            Ok((image, _)) => Ok(image),
            Err(e) => match read(other, Gaps::Refuse) {
                Ok((mut image, records))
                    if e.is_of_addresses()
                        && records >= EVIDENCE
                        && image.bytes.len() >= records * EVIDENCE_BYTES =>
                {
                    image.notes.push(ImageNote::AddressesCount(other));
                    Ok(image)
                }
                _ if options.gaps != Gaps::Refuse => {
                    let (image, _) = read(usual, options.gaps)?;
                    // If more records follow each other in the other unit, the tool chain may count in that unit. A single gap
                    // shows nothing, because a single record at an odd byte address is whole in words.
                    let gaps = |image: &Self| {
                        image.notes.iter().filter(|note| matches!(note, ImageNote::GapFilled { .. })).count()
                    };
                    match read(other, options.gaps) {
                        Ok((closer, _)) if gaps(&closer) + 1 < gaps(&image) => {
                            Err(ImageError::OtherUnit { error: Box::new(e), unit: other })
                        }
                        _ => Ok(image),
                    }
                }
                // The records are too few or too short to show the unit, so the user must decide.
                Ok(_) if e.is_of_addresses() => {
                    Err(ImageError::OtherUnit { error: Box::new(e), unit: other })
                }
                _ => Err(e),
            },
        }
    }

    /// Returns the bytes of the image in the order in which they are sent. The number of bytes is even and at least two.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Converts the image to its bytes without copying them.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// Returns the load address of the image in words.
    pub fn address_words(&self) -> u32 {
        self.address_words
    }

    /// Returns the length of the image in words.
    pub fn length_words(&self) -> u32 {
        (self.bytes.len() / 2) as u32
    }

    /// Returns the name of the format of the image file.
    pub fn format_name(&self) -> &'static str {
        match self.format {
            Format::Bin => "raw bytes",
            Format::IntelHex => "Intel HEX",
            Format::SRecord => "S-record",
        }
    }

    /// Returns the format of the image file.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Returns the unit of the record addresses; returns `None` for raw bytes, which have no addresses.
    pub fn address_unit(&self, options: &ImageOptions) -> Option<AddressUnit> {
        let detected = self.notes.iter().find_map(|note| match note {
            ImageNote::AddressesCount(unit) => Some(*unit),
            _ => None,
        });
        let usual = match self.format {
            Format::Bin => return None,
            Format::IntelHex => AddressUnit::Byte,
            Format::SRecord => AddressUnit::Word,
        };
        Some(options.address_unit.or(detected).unwrap_or(usual))
    }

    /// Returns notes about the image, such as changes that the reader made.
    pub fn notes(&self) -> &[ImageNote] {
        &self.notes
    }
}
