//! What stands in flash: how long this program is there, and the CRC-32 of it as it reads back (J-67). A host that has put the
//! program there compares both with its file.
//!
//! The links' rounds read it, a piece in each ([`Reader::step`]): the first tick does not wait for it, and no interrupt does. A tenth of a
//! second after the start the tick finds it in [`read`].
use core::sync::atomic::{AtomicU32, Ordering};

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use jtc_wire::Program;

/// First byte of the flash.
const FLASH: usize = 0x0800_0000;
/// Bytes that a round reads, in some 50 µs.
const PIECE: usize = 2048;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// What was read, for the tick and for debuggers: bytes of the program, 0 before all are read, and their CRC-32.
#[unsafe(no_mangle)]
#[used]
pub static PROGRAM: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

unsafe extern "C" {
    /// Where the initial values of .data stand in flash: behind everything else of bank 1.
    static __sidata: u8;
    /// First byte of .data, and the one behind its last.
    static __sdata: u8;
    static __edata: u8;
}

/// Reads the program, from the first byte of the flash to its last. The few words of the second core in bank 2, which is closed, are
/// not read.
pub struct Reader {
    program: &'static [u8],
    at: usize,
    digest: Option<Digest<'static, u32, Table<1>>>,
}

impl Reader {
    /// Nothing is read yet.
    pub fn new() -> Self {
        let initial_values = &raw const __edata as usize - &raw const __sdata as usize;
        let end = &raw const __sidata as usize + initial_values;
        // SAFETY: the linker has put the program there, and nothing writes bank 1 while it runs.
        let program = unsafe { core::slice::from_raw_parts(FLASH as *const u8, end - FLASH) };
        Self { program, at: 0, digest: Some(CRC.digest()) }
    }

    /// Reads a piece; nothing once all are read.
    pub fn step(&mut self) {
        let Some(digest) = &mut self.digest else { return };
        let rest = self.program.get(self.at..).unwrap_or(&[]);
        let piece = rest.get(..PIECE).unwrap_or(rest);
        digest.update(piece);
        self.at += piece.len();
        if self.at == self.program.len()
            && let Some(digest) = self.digest.take()
        {
            let [bytes, crc32] = &PROGRAM;
            crc32.store(digest.finalize(), Ordering::Relaxed);
            bytes.store(self.program.len() as u32, Ordering::Release);
        }
    }
}

/// What was read; `None` before all of it was.
pub fn read() -> Option<Program> {
    let [bytes, crc32] = &PROGRAM;
    let bytes = bytes.load(Ordering::Acquire);
    (bytes != 0).then(|| Program { bytes, crc32: crc32.load(Ordering::Relaxed) })
}
