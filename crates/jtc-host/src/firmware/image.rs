//! Flash image of a board. The program reads the image from a file and checks the image before the image is used.

use std::fs;
use std::path::{Path, PathBuf};

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use jtc_wire::Program;

use super::drive::has_second_core;
use super::elf;
use super::{Catalogue, FirmwareError};

/// First address of the flash.
pub const FLASH: u32 = 0x0800_0000;
/// Size of bank 1 of the flash, bytes. Bank 1 contains the program.
pub(super) const BANK1: usize = 1024 * 1024;
/// Offset in the flash at which the storage for the arm begins. An image must end before this offset.
pub(super) const STORED_ARM: usize = 0x1C_0000;
/// Number of words in the vector table at the beginning of a program. The table contains the stack pointer and the interrupt vectors of the
/// core and the chip.
const VECTORS: usize = 166;
/// Value of a byte in erased flash.
pub(super) const ERASED: u8 = 0xFF;

/// Memories in which a stack can be: the tightly coupled memory and the memory on the AXI bus. Each entry contains
/// the first address of the memory and the first address after it.
const STACKS: [(u32, u32); 2] = [(0x2000_0000, 0x2002_0000), (0x2400_0000, 0x2408_0000)];

static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// Record in an image that describes the image.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Record {
    /// Version of the firmware in the image.
    pub version: String,
    /// Name of the board for which the image was built.
    pub board: String,
    /// Commit from which the image was built, with `+` if files were changed after this commit.
    pub build: String,
    /// Bit rate of the serial lines, Bd.
    pub baud: u32,
}

impl Record {
    /// Offset of the record in the image.
    pub const OFFSET: usize = 0x400;
    const MAGIC: &[u8] = b"OPENJTC\0";
    /// Size of the first version of the record, bytes. Later versions of the record are longer.
    const LEN: usize = 96;
    /// Bit rates that are valid in a record, Bd.
    const RATES: std::ops::RangeInclusive<u32> = 9_600..=15_000_000;

    /// Reads the record of an image. Returns `None` if the image does not contain a record at this offset.
    pub fn parse(image: &[u8]) -> Option<Self> {
        let bytes = image.get(Self::OFFSET..Self::OFFSET + Self::LEN)?;
        let size = u16::from_le_bytes([bytes[10], bytes[11]]);
        if !bytes.starts_with(Self::MAGIC) || usize::from(size) < Self::LEN {
            return None;
        }
        let text = |at: std::ops::Range<usize>| {
            let text = bytes[at].split(|byte| *byte == 0).next().unwrap_or_default();
            let printable = !text.is_empty() && text.iter().all(u8::is_ascii_graphic);
            printable.then(|| String::from_utf8_lossy(text).into_owned())
        };
        let baud = u32::from_le_bytes(*bytes[88..].first_chunk()?);
        if !Self::RATES.contains(&baud) {
            return None;
        }
        Some(Self { version: text(12..24)?, board: text(24..48)?, build: text(48..72)?, baud })
    }
}

/// Flash image that starts at the first byte of the flash.
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    path: PathBuf,
    bytes: Vec<u8>,
    record: Record,
    whole: bool,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image {{ {}, {} bytes, {:?} }}", self.path.display(), self.bytes.len(), self.record)
    }
}

impl Image {
    /// Reads a binary or an ELF file, and checks that the file is firmware for a board of this project. If a catalogue in the same folder
    /// lists the file, the content must match the catalogue.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::File`] if the file cannot be read. Returns [`FirmwareError::NoImage`] if the file is not firmware for these
    /// boards. Returns [`FirmwareError::Damaged`] if the file differs from the catalogue.
    pub fn read(path: &Path) -> Result<Self, FirmwareError> {
        let bytes = fs::read(path).map_err(|source| FirmwareError::File { path: path.to_owned(), source })?;
        let listed = Catalogue::lists(path, &bytes)?;
        let image = Self::parse(path, bytes)?;
        Ok(if listed { image.listed() } else { image })
    }

    /// Like [`Image::read`], but uses `bytes` as the content of the file `path`, and does not use a catalogue.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NoImage`] if the file is not firmware for these boards.
    pub fn parse(path: &Path, bytes: Vec<u8>) -> Result<Self, FirmwareError> {
        // An ELF file contains the lengths of all its segments, so the parser notices if the end of the file is
        // missing.
        let whole = elf::is_elf(&bytes);
        let flat = if whole { elf::flat(&bytes) } else { Ok(bytes) };
        let looked_at = flat.and_then(|bytes| Ok((examine(&bytes)?, bytes)));
        let (record, bytes) =
            looked_at.map_err(|why| FirmwareError::NoImage { path: path.to_owned(), why })?;
        Ok(Self { path: path.to_owned(), bytes, record, whole })
    }

    /// Marks the image as complete, because a catalogue lists the same length and digest.
    pub(super) fn listed(self) -> Self {
        Self { whole: true, ..self }
    }

    /// Returns `true` if an ELF file or a catalogue proves that the image is complete. Without a catalogue, only some truncated binary
    /// files are detected.
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// Returns the file from which the image was read.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the bytes that are written at [`FLASH`].
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the record of the image.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// Checks that the flash report of a device matches this image (J-67). The CRC that the device reports must equal the CRC over the same
    /// number of bytes in the image. After these bytes, bank 1 of the image may contain only filler bytes (0 or the value of erased flash).
    ///
    /// # Errors
    ///
    /// Returns a text that describes the difference.
    pub fn is_what_runs(&self, program: Program) -> Result<(), String> {
        let bank1 = &self.bytes[..self.bytes.len().min(BANK1)];
        let Some((read, rest)) = bank1.split_at_checked(program.bytes as usize) else {
            return Err(format!("its program has {} bytes, the image has {}", program.bytes, bank1.len()));
        };
        let fills = |byte: u8| rest.iter().all(|b| *b == byte);
        if !fills(0) && !fills(ERASED) {
            return Err(format!(
                "its program ends after {} bytes, but the program of the image is longer",
                program.bytes
            ));
        }
        match CRC.checksum(read) {
            crc32 if crc32 == program.crc32 => Ok(()),
            crc32 => Err(format!(
                "the CRC-32 of its {} bytes is {:08x}, that of the image is {crc32:08x}",
                program.bytes, program.crc32
            )),
        }
    }
}

/// Returns the record of the image, or the reason why the image must not be written to a board.
fn examine(bytes: &[u8]) -> Result<Record, String> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(stack), Some(reset)) = (word(0), word(4)) else {
        return Err(format!("{} bytes, too few for a program", bytes.len()));
    };
    if bytes.len() > STORED_ARM {
        return Err(format!(
            "{} bytes are too many, expected at most {STORED_ARM}, where the stored arm of a board begins",
            bytes.len()
        ));
    }
    if !STACKS.iter().any(|(first, end)| stack > *first && stack <= *end) || stack % 8 != 0 {
        return Err(format!("its first word, {stack:#010x}, is not a stack address of these processors"));
    }
    let program = FLASH..FLASH + bytes.len().min(BANK1) as u32;
    let entry = |word: u32| word % 2 == 1 && program.contains(&(word & !1));
    if !entry(reset) {
        return Err(format!("its second word, {reset:#010x}, is not the entry of a program in this file"));
    }
    let record = Record::parse(bytes)
        .ok_or_else(|| format!("no record of this project's firmware at {:#x}", Record::OFFSET))?;
    let unused = |word: u32| word == 0 || word == u32::MAX;
    let lost = (2..VECTORS).filter_map(|n| word(4 * n)).find(|word| !unused(*word) && !entry(*word));
    if let Some(lost) = lost {
        return Err(format!(
            "incomplete or damaged: an interrupt leads to {lost:#010x}, which is outside the file"
        ));
    }
    if has_second_core(&record.board) && !starts_second_core(bytes) {
        return Err(format!(
            "incomplete: {} bytes, but the program of the second core, {BANK1} bytes after the first, is not complete",
            bytes.len()
        ));
    }
    Ok(record)
}

/// Returns `true` if bank 2 contains the reset address of the second core, and the image contains the instructions at
/// this address.
fn starts_second_core(bytes: &[u8]) -> bool {
    let bank2 = FLASH + BANK1 as u32;
    let reset = bytes.get(BANK1 + 4..BANK1 + 8).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    // The program of the second core is an endless loop of two instructions of 2 bytes. Therefore the image must
    // contain 4 bytes from the reset address.
    reset.is_some_and(|reset| {
        reset % 2 == 1 && reset >= bank2 && (reset & !1) + 4 <= FLASH + bytes.len() as u32
    })
}

#[cfg(test)]
mod tests {
    use super::super::fake::{catalogue, image_bytes, program_of};
    use super::*;

    fn parsed(bytes: Vec<u8>) -> Result<Image, String> {
        Image::parse(Path::new("x.bin"), bytes).map_err(|e| e.to_string())
    }

    #[test]
    fn an_image_says_what_it_is() {
        let image = parsed(image_bytes("nucleo-h745zi-q", 7)).unwrap();
        let record = image.record();
        assert_eq!((record.board.as_str(), record.version.as_str()), ("nucleo-h745zi-q", "0.2.0"));
        assert_eq!((record.build.as_str(), record.baud), ("0123456789abc", 115_200));
    }

    #[test]
    fn what_is_no_firmware_of_these_boards_is_refused_with_the_reason() {
        let good = || image_bytes("nucleo-h745zi-q", 7);
        let with = |at: usize, bytes: &[u8]| {
            let mut image = good();
            image[at..at + bytes.len()].copy_from_slice(bytes);
            image
        };
        let mut long = good();
        long.resize(STORED_ARM + 1, 0);
        for (bytes, why) in [
            (vec![1, 2, 3], "3 bytes, too few"),
            (good()[..0x400].to_vec(), "is not the entry"),
            (good()[..0xF00].to_vec(), "0x08000f05, which is outside the file"),
            (b"#!/bin/sh\necho this is no program at all".to_vec(), "is not a stack address"),
            (with(0, &[0; 4]), "0x00000000, is not a stack address"),
            (with(0, &0x2002_0008u32.to_le_bytes()), "is not a stack address"),
            (with(4, &0x0800_0500u32.to_le_bytes()), "is not the entry"),
            (with(4, &0x0810_0001u32.to_le_bytes()), "is not the entry"),
            (with(0x400, b"openjtc"), "no record"),
            (with(0x40A, &[95, 0]), "no record"),
            (with(0x418, &[0]), "no record"),
            (with(0x458, &[0, 0, 0]), "no record"),
            (long, "stored arm"),
        ] {
            let said = parsed(bytes).unwrap_err();
            assert!(said.starts_with("x.bin: ") && said.contains(why), "{why}: {said}");
        }
    }

    #[test]
    fn a_file_that_is_cut_before_the_program_of_the_second_core_is_refused() {
        let good = image_bytes("nucleo-h745zi-q", 7);
        assert!(parsed(good.clone()).is_ok());
        for end in [0x1000, BANK1 - 1, BANK1, BANK1 + 4, BANK1 + 66, good.len() - 1] {
            let said = parsed(good[..end].to_vec()).unwrap_err();
            assert!(said.contains("incomplete") && said.contains("second core"), "{end}: {said}");
        }
        // The NUCLEO-H743ZI2 has only one core, so its image contains no second program.
        assert_eq!(image_bytes("nucleo-h743zi2", 7).len(), 0x1000);
        assert!(parsed(image_bytes("nucleo-h743zi2", 7)).is_ok());
    }

    #[test]
    fn a_binary_is_known_to_be_whole_where_a_catalogue_lists_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nucleo-h743zi2.bin");
        fs::write(&path, image_bytes("nucleo-h743zi2", 7)).unwrap();
        assert!(!Image::read(&path).unwrap().is_whole());
        // If the catalogue does not list the file, or if the catalogue is invalid, it does not prove that the image
        // is complete.
        catalogue(folder.path(), &["nucleo-h745zi-q"]);
        assert!(!Image::read(&path).unwrap().is_whole());
        fs::write(folder.path().join("firmware.json"), "{").unwrap();
        assert!(!Image::read(&path).unwrap().is_whole());
        catalogue(folder.path(), &["nucleo-h743zi2"]);
        assert!(Image::read(&path).unwrap().is_whole());
        // The test cuts off the end of the file at a position at which only the catalogue can detect this.
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..0xFF0]).unwrap();
        assert!(parsed(bytes[..0xFF0].to_vec()).is_ok());
        assert!(matches!(Image::read(&path), Err(FirmwareError::Damaged { .. })));
    }

    #[test]
    fn j67_what_runs_is_the_image_or_it_is_not() {
        let image = parsed(image_bytes("nucleo-h743zi2", 7)).unwrap();
        let program = program_of(image.bytes());
        assert_eq!(image.is_what_runs(program), Ok(()));
        // The comparison ignores the program of the second core in bank 2, and the filler bytes before bank 2.
        for gap in [0, 0xFF] {
            let mut longer = image.bytes().to_vec();
            longer.resize(BANK1, gap);
            longer.extend([1, 2, 3, 4]);
            assert_eq!(parsed(longer.clone()).unwrap().is_what_runs(program), Ok(()));
            longer[BANK1 - 1] = 9;
            let said = parsed(longer).unwrap().is_what_runs(program).unwrap_err();
            assert!(said.contains("the program of the image is longer"), "{said}");
        }
        let other = parsed(image_bytes("nucleo-h743zi2", 8)).unwrap();
        assert!(other.is_what_runs(program).unwrap_err().contains("CRC-32"));
        let more = Program { bytes: program.bytes + 1, ..program };
        assert!(image.is_what_runs(more).unwrap_err().contains("the image"));
        let less = Program { bytes: program.bytes - 4, ..program };
        assert!(image.is_what_runs(less).unwrap_err().contains("ends after"));
    }

    /// The test compares the CRC with the published check value of CRC-32/ISO-HDLC.
    #[test]
    fn j67_the_crc_is_that_of_ethernet_and_zlib() {
        assert_eq!(CRC.checksum(b"123456789"), 0xCBF4_3926);
    }
}
