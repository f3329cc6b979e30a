//! DMA1, DMA2 and DMAMUX1 (RM0399 chapters 15 to 18): single transfers between a peripheral and memory, in circular
//! or normal mode, with half-transfer and transfer-complete flags.

/// Number of streams of both DMA controllers. Streams 0..8 belong to DMA1, streams 8..16 to DMA2.
pub const STREAMS: usize = 16;

const EN: u32 = 1;
const DIR: u32 = 0xC0;
const TO_PERIPHERAL: u32 = 0x40;
const CIRC: u32 = 0x100;
const MINC: u32 = 0x400;

/// Flags of a DMA stream, as bit positions within the six bits of the stream in LISR or HISR.
const HTIF: u32 = 1 << 4;
const TCIF: u32 = 1 << 5;
const TEIF: u32 = 1 << 3;

/// Interrupt lines of the DMA streams.
pub const LINES: [usize; STREAMS] = [11, 12, 13, 14, 15, 16, 17, 47, 56, 57, 58, 59, 60, 68, 69, 70];

/// Memory that the DMA controllers access.
pub trait Memory {
    /// Reads bytes from memory. Returns `false` at an unmapped address.
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> bool;
    /// Writes bytes to memory. Returns `false` at an unmapped address.
    fn write(&mut self, address: u32, bytes: &[u8]) -> bool;
}

#[derive(Clone, Copy, Default)]
struct Stream {
    cr: u32,
    /// Value that was written to NDTR. The next field is the number of remaining transfers.
    total: u32,
    left: u32,
    par: u32,
    m0ar: u32,
    m1ar: u32,
    fcr: u32,
    flags: u32,
    request: u32,
}

impl Stream {
    fn size(&self) -> u32 {
        1 << (self.cr >> 13 & 3).min(2)
    }

    fn address(&self) -> u32 {
        if self.cr & MINC == 0 {
            return self.m0ar;
        }
        self.m0ar.wrapping_add((self.total - self.left) * self.size())
    }

    /// Counts one transfer of the stream.
    fn done(&mut self) {
        self.left -= 1;
        if self.left == self.total / 2 {
            self.flags |= HTIF;
        }
        if self.left == 0 {
            self.flags |= TCIF;
            if self.cr & CIRC != 0 {
                self.left = self.total;
            } else {
                self.cr &= !EN;
            }
        }
    }
}

/// Both DMA controllers and the request multiplexer.
#[derive(Default)]
pub struct Dma {
    streams: [Stream; STREAMS],
    /// Number of transfers that failed because DMA1 and DMA2 cannot access the address.
    pub errors: u32,
}

/// Returns `true` if DMA1 and DMA2 can access the address. Only the core can access TCM.
fn reachable(address: u32) -> bool {
    !(address < 0x0001_0000 || (0x2000_0000..0x2002_0000).contains(&address))
}

impl Dma {
    /// Resets DMA controller 0 or 1.
    pub fn reset(&mut self, controller: usize) {
        for stream in self.streams.iter_mut().skip(8 * controller).take(8) {
            *stream = Stream { request: stream.request, ..Stream::default() };
        }
    }

    /// Reads a register of DMA controller 0 or 1.
    pub fn read(&self, controller: usize, offset: u32) -> u32 {
        let streams = &self.streams[8 * controller..8 * controller + 8];
        match offset {
            0x00 | 0x04 => {
                let four = &streams[offset as usize..offset as usize + 4];
                four.iter().zip(SHIFTS).fold(0, |word, (s, shift)| word | s.flags << shift)
            }
            0x10..0xD0 => {
                let stream = &streams[(offset as usize - 0x10) / 0x18];
                match (offset - 0x10) % 0x18 {
                    0x00 => stream.cr,
                    0x04 => stream.left,
                    0x08 => stream.par,
                    0x0C => stream.m0ar,
                    0x10 => stream.m1ar,
                    _ => stream.fcr,
                }
            }
            _ => 0,
        }
    }

    /// Writes a register of DMA controller 0 or 1.
    pub fn write(&mut self, controller: usize, offset: u32, value: u32) {
        let streams = &mut self.streams[8 * controller..8 * controller + 8];
        match offset {
            0x08 | 0x0C => {
                let first = offset as usize - 8;
                for (stream, shift) in streams[first..first + 4].iter_mut().zip(SHIFTS) {
                    stream.flags &= !(value >> shift & 0x3D);
                }
            }
            0x10..0xD0 => {
                let stream = &mut streams[(offset as usize - 0x10) / 0x18];
                let enabled = stream.cr & EN != 0;
                match (offset - 0x10) % 0x18 {
                    0x00 => {
                        if enabled && value & EN == 0 {
                            // If the program switches off a running stream, the transfer-complete flag of the stream is
                            // set.
                            stream.flags |= TCIF;
                        }
                        stream.cr = value;
                        if value & EN != 0 && !enabled && stream.total == 0 {
                            stream.cr &= !EN;
                        }
                    }
                    0x04 if !enabled => {
                        stream.total = value & 0xFFFF;
                        stream.left = stream.total;
                    }
                    0x08 if !enabled => stream.par = value,
                    0x0C if !enabled => stream.m0ar = value,
                    0x10 => stream.m1ar = value,
                    0x14 => stream.fcr = value,
                    _ => {}
                }
                if stream.cr & EN != 0 && !enabled {
                    stream.left = if stream.left == 0 { stream.total } else { stream.left };
                }
            }
            _ => {}
        }
    }

    /// Reads a register of DMAMUX1.
    pub fn read_mux(&self, offset: u32) -> u32 {
        self.streams.get(offset as usize / 4).map_or(0, |s| s.request)
    }

    /// Writes a register of DMAMUX1.
    pub fn write_mux(&mut self, offset: u32, value: u32) {
        if let Some(stream) = self.streams.get_mut(offset as usize / 4) {
            stream.request = value;
        }
    }

    /// Returns the index of the running DMA stream that serves a request line, if any.
    pub fn serving(&self, request: u32) -> Option<usize> {
        self.streams.iter().position(|s| s.cr & EN != 0 && s.request & 0x7F == request)
    }

    /// Returns the number of transfers until the next enabled interrupt of the DMA stream.
    pub fn until_interrupt(&self, stream: usize) -> Option<u32> {
        let s = &self.streams[stream];
        let half = (s.cr & 8 != 0).then(|| s.left.checked_sub(s.total / 2)).flatten().filter(|&n| n > 0);
        let full = (s.cr & 16 != 0).then_some(s.left);
        half.into_iter().chain(full).min()
    }

    /// Transfers a byte from a peripheral to memory.
    pub fn give(&mut self, stream: usize, byte: u8, memory: &mut dyn Memory) {
        let s = &mut self.streams[stream];
        let word = u32::from(byte).to_le_bytes();
        let address = s.address();
        if s.cr & DIR != 0 || !reachable(address) || !memory.write(address, &word[..s.size() as usize]) {
            return self.fail(stream);
        }
        s.done();
    }

    /// Transfers a byte from memory to a peripheral.
    pub fn take(&mut self, stream: usize, memory: &mut dyn Memory) -> Option<u8> {
        let s = &mut self.streams[stream];
        let mut byte = [0];
        let address = s.address();
        if s.cr & DIR != TO_PERIPHERAL || !reachable(address) || !memory.read(address, &mut byte) {
            self.fail(stream);
            return None;
        }
        s.done();
        Some(byte[0])
    }

    fn fail(&mut self, stream: usize) {
        self.errors += 1;
        let s = &mut self.streams[stream];
        s.flags |= TEIF;
        s.cr &= !EN;
    }

    /// Returns the level of the interrupt line of a DMA stream.
    pub fn line(&self, stream: usize) -> bool {
        let s = &self.streams[stream];
        // The enable bits TEIE, HTIE and TCIE are in the same order as their flags, but one bit lower.
        s.flags & (s.cr & 0x1C) << 1 != 0
    }
}

/// Bit positions of the flags of four DMA streams in a status register.
const SHIFTS: [u32; 4] = [0, 6, 16, 22];

#[cfg(test)]
mod tests {
    use super::*;

    struct Ram(Vec<u8>);

    impl Memory for Ram {
        fn read(&mut self, address: u32, bytes: &mut [u8]) -> bool {
            let at = (address - 0x3000_0000) as usize;
            bytes.copy_from_slice(&self.0[at..at + bytes.len()]);
            true
        }
        fn write(&mut self, address: u32, bytes: &[u8]) -> bool {
            let at = (address - 0x3000_0000) as usize;
            self.0[at..at + bytes.len()].copy_from_slice(bytes);
            true
        }
    }

    #[test]
    fn a_ring_wraps_with_half_and_full_flags() {
        let mut dma = Dma::default();
        let mut ram = Ram(vec![0; 16]);
        dma.write_mux(4, 43);
        dma.write(0, 0x28 + 4, 8);
        dma.write(0, 0x28 + 0xC, 0x3000_0000);
        dma.write(0, 0x28, EN | CIRC | MINC | 0x18);
        let stream = dma.serving(43).unwrap();
        assert_eq!(stream, 1);
        assert_eq!(dma.until_interrupt(stream), Some(4));
        for byte in 1..=11 {
            dma.give(stream, byte, &mut ram);
            let flags = if byte < 4 {
                0
            } else if byte < 8 {
                HTIF
            } else {
                HTIF | TCIF
            };
            assert_eq!(dma.read(0, 0) >> 6 & 0x3D, flags, "byte {byte}");
        }
        assert_eq!(ram.0[..8], [9, 10, 11, 4, 5, 6, 7, 8]);
        assert_eq!(dma.read(0, 0x28 + 4), 5);
        assert!(dma.line(stream));
        dma.write(0, 8, 0x3D << 6);
        assert!(!dma.line(stream));
    }

    #[test]
    fn tcm_is_out_of_reach() {
        let mut dma = Dma::default();
        dma.write_mux(0, 43);
        dma.write(0, 0x14, 4);
        dma.write(0, 0x1C, 0x2000_0000);
        dma.write(0, 0x10, EN | MINC);
        dma.give(0, 1, &mut Ram(vec![0; 4]));
        assert_eq!((dma.errors, dma.serving(43)), (1, None));
    }
}
