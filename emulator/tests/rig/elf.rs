//! The firmware files of the boards, and the version record in each file.
use jtc_wire::Program;
use openjtc_emulator::Elf;
use std::path::PathBuf;

/// File names of the firmware of all boards.
pub const BOARDS: [&str; 3] = ["nucleo-h745zi-q", "nucleo-h745zi-q-ldo", "nucleo-h743zi2"];

/// Bit rate of the firmware that [`fast_elf`] returns, Bd.
pub const FAST: u32 = 15_000_000;

fn directory() -> PathBuf {
    let Some(directory) = std::env::var_os("OPENJTC_FIRMWARE") else {
        panic!(
            "OPENJTC_FIRMWARE must name the directory with {}.elf and the others; `cargo xtask emulate` builds them \
             and runs these tests",
            BOARDS[0]
        )
    };
    directory.into()
}

fn load(file: &str) -> Elf {
    let path = directory().join(file);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Elf::parse(&bytes).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Returns the firmware file of a board.
pub fn elf(board: &str) -> Elf {
    load(&format!("{board}.elf"))
}

/// Returns the firmware file of the first board for 15 MBd serial lines.
pub fn fast_elf() -> Elf {
    load(&format!("{}-{FAST}.elf", BOARDS[0]))
}

/// The version record at a fixed address, as documented in `docs/board.md`.
#[derive(Debug)]
pub struct Version {
    pub version: String,
    pub board: String,
    pub build: String,
    pub points: u32,
    pub segments: u32,
    pub segment_points: u32,
    pub tick_hz: u32,
    pub baud: u32,
    pub core_hz: u32,
}

/// Reads the version record from the firmware file. Returns `None` if the file does not contain a version record.
pub fn version(elf: &Elf) -> Option<Version> {
    const ADDRESS: u32 = 0x0800_0400;
    let bytes = elf.segments.iter().find_map(|(start, data)| {
        let at = ADDRESS.checked_sub(*start)? as usize;
        data.get(at..at + 96)
    })?;
    if &bytes[..8] != b"OPENJTC\0" || bytes[8..12] != [1, 0, 96, 0] {
        return None;
    }
    let number = |n: usize| u32::from_le_bytes(bytes[72 + 4 * n..][..4].try_into().expect("four"));
    let text =
        |at: std::ops::Range<usize>| String::from_utf8_lossy(&bytes[at]).trim_end_matches('\0').to_owned();
    let (version, board, build) = (text(12..24), text(24..48), text(48..72));
    let [points, segments, segment_points, tick_hz, baud, core_hz] = core::array::from_fn(number);
    Some(Version { version, board, build, points, segments, segment_points, tick_hz, baud, core_hz })
}

/// Returns the length and the CRC-32 of the program in flash bank 1 after this file is loaded into an erased chip. The
/// function computes the CRC bit by bit from its definition.
pub fn program(elf: &Elf) -> Program {
    const BANK1: std::ops::Range<u32> = 0x0800_0000..0x0810_0000;
    let mut flash = Vec::new();
    for (start, data) in elf.segments.iter().filter(|(start, _)| BANK1.contains(start)) {
        let at = (start - BANK1.start) as usize;
        flash.resize(flash.len().max(at + data.len()), 0xFF);
        flash[at..at + data.len()].copy_from_slice(data);
    }
    let bit = |register: u32, _| (register >> 1) ^ (0xEDB8_8320 * (register & 1));
    let byte = |register: u32, byte: &u8| (0..8).fold(register ^ u32::from(*byte), bit);
    Program { bytes: flash.len() as u32, crc32: !flash.iter().fold(u32::MAX, byte) }
}
