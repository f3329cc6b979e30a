//! The program in flash: its length and its CRC-32 (J-67). A host that has written the program to the board compares
//! length and CRC-32 with the length and CRC-32 of its file.
//!
//! The links read the program, one piece per pass ([`Reader::step`]). Therefore neither the first tick nor any
//! interrupt waits for these reads. About a tenth of a second after program start, all bytes are read, and [`read`]
//! returns the result.
use core::sync::atomic::{AtomicU32, Ordering};

use crc::{CRC_32_ISO_HDLC, Crc, Digest, Table};
use jtc_wire::Program;

/// Address of the first byte of the flash.
const FLASH: usize = 0x0800_0000;
/// Number of bytes per piece of the program; reading one piece takes about 50 µs.
const PIECE: usize = 2048;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Result for the tick and for debuggers: the length of the program in bytes (0 until all bytes are read) and the
/// CRC-32 of the program.
#[unsafe(no_mangle)]
#[used]
pub static PROGRAM: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];

unsafe extern "C" {
    /// Address of the initial values of .data in flash, which follow all other data in bank 1.
    static __sidata: u8;
    /// Addresses of the first byte of .data and of the first byte after .data.
    static __sdata: u8;
    static __edata: u8;
}

/// Reads the program from the first byte of the flash to the last byte of the program. Does not read the few words of
/// the second core's program in bank 2, because bank 2 is not readable.
pub struct Reader {
    program: &'static [u8],
    at: usize,
    digest: Option<Digest<'static, u32, Table<1>>>,
}

impl Reader {
    /// Creates a reader that has not read anything yet.
    pub fn new() -> Self {
        let initial_values = &raw const __edata as usize - &raw const __sdata as usize;
        let end = &raw const __sidata as usize + initial_values;
        // SAFETY: the linker has placed the program in this range, and bank 1 is not written while the program runs.
        let program = unsafe { core::slice::from_raw_parts(FLASH as *const u8, end - FLASH) };
        Self { program, at: 0, digest: Some(CRC.digest()) }
    }

    /// Reads the next piece of the program, if any.
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

/// Returns the length and the CRC-32 of the program. Returns `None` until all bytes are read.
pub fn read() -> Option<Program> {
    let [bytes, crc32] = &PROGRAM;
    let bytes = bytes.load(Ordering::Acquire);
    (bytes != 0).then(|| Program { bytes, crc32: crc32.load(Ordering::Relaxed) })
}
