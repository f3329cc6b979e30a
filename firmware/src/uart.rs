//! Driver of a serial line. DMA writes received bytes into a ring and never stops, even after line errors. The tick
//! starts the DMA that sends statuses.
//!
//! Received bytes do not cause interrupts. The tick searches the ring for Stop and Pause. The links check the ring
//! after every tick, and immediately when the line becomes idle.
use core::sync::atomic::{Ordering, fence};

use embassy_stm32::interrupt::InterruptExt;
use embassy_stm32::pac::common::{RW, Reg, W};
use embassy_stm32::pac::dma::St;
use embassy_stm32::pac::dma::regs::Ixr;
use embassy_stm32::pac::dma::vals::{Dir, Pl, Size};
use embassy_stm32::pac::dmamux::regs::Ccr;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::pac::usart::vals::Over8;
use embassy_stm32::pac::{DMA1, DMAMUX1};
use embassy_stm32::peripherals::{USART2, USART3};
use embassy_stm32::{Peri, interrupt, pac, rcc};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use jtc_wire::ANSWER_MAX;
use openjtc_firmware::clock::Baud;

use crate::clocks;

/// Event that wakes the links when a tick has ended or a serial line has become idle.
pub static WORK: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Number of bytes per DMA ring, which is enough for about 21 ms at 15 MBd.
pub const RING: usize = 32 * 1024;

/// A USART and the streams of DMA1 that transfer its bytes.
pub struct Line {
    usart: Usart,
    receive: Stream,
    transmit: Stream,
    interrupt: pac::Interrupt,
}

impl Line {
    /// Returns USART2 as a serial line.
    pub fn usart2(_usart: Peri<'static, USART2>) -> Self {
        rcc::enable_and_reset::<USART2>();
        Self {
            usart: pac::USART2,
            receive: Stream::new(0, 43),
            transmit: Stream::new(1, 44),
            interrupt: pac::Interrupt::USART2,
        }
    }

    /// Returns USART3 as a serial line.
    pub fn usart3(_usart: Peri<'static, USART3>) -> Self {
        rcc::enable_and_reset::<USART3>();
        Self {
            usart: pac::USART3,
            receive: Stream::new(2, 45),
            transmit: Stream::new(3, 46),
            interrupt: pac::Interrupt::USART3,
        }
    }
}

/// Stream of DMA1, and the multiplexer request that starts the transfers of the stream.
#[derive(Clone, Copy)]
struct Stream {
    registers: St,
    /// Register that clears the flags of the DMA stream. The next field is the bit mask of these flags.
    clear: Reg<Ixr, W>,
    flags: Ixr,
    multiplexer: Reg<Ccr, RW>,
    request: u8,
}

impl Stream {
    const fn new(number: usize, request: u8) -> Self {
        // Each DMA stream has five flags, and four streams share a register.
        const SHIFT: [u32; 4] = [0, 6, 16, 22];
        Self {
            registers: DMA1.st(number),
            clear: DMA1.ifcr(number / 4),
            flags: Ixr(0b11_1101 << SHIFT[number % 4]),
            multiplexer: DMAMUX1.ccr(number),
            request,
        }
    }

    /// Configures a DMA stream for transfers of bytes between a register and memory. `start` starts the transfers.
    fn configure(self, direction: Dir, register: *mut (), memory: *mut u8, ring: bool) {
        self.multiplexer.write(|w| w.set_dmareq_id(self.request));
        let stream = self.registers;
        stream.par().write_value(register as u32);
        stream.m0ar().write_value(memory as u32);
        stream.cr().write(|w| {
            w.set_dir(direction);
            w.set_circ(ring);
            w.set_minc(true);
            w.set_psize(Size::BITS8);
            w.set_msize(Size::BITS8);
            // Reception must not wait, so its DMA stream has a higher priority than the stream for transmission.
            w.set_pl(if ring { Pl::VERY_HIGH } else { Pl::LOW });
            // A USART needs buffered transfers, because without buffered transfers the DMA stream can lock up.
            w.set_trbuff(true);
        });
    }

    /// Transfers `count` bytes. This function must be called only when the DMA stream has stopped.
    fn start(self, count: usize) {
        // A DMA stream does not start while flags of its last transfer are set.
        self.clear.write_value(self.flags);
        let stream = self.registers;
        stream.ndtr().write(|w| w.set_ndt(count as u16));
        // The data must be in memory before the DMA stream reads them.
        fence(Ordering::SeqCst);
        cortex_m::asm::dmb();
        stream.cr().modify(|w| w.set_en(true));
    }

    fn running(self) -> bool {
        self.registers.cr().read().en()
    }

    /// Returns the number of bytes that the DMA stream must still transfer.
    fn remaining(self) -> usize {
        self.registers.ndtr().read().ndt().into()
    }
}

/// Starts a serial line.
pub fn open(
    line: Line,
    ring: &'static mut [u8; RING],
    status: &'static mut [u8; ANSWER_MAX],
    rate: u32,
) -> (Receiver, Lookahead, Transmitter) {
    let usart = line.usart;
    let baud = defmt::unwrap!(Baud::new(rate), "{=u32} Bd cannot be made", rate);
    usart.brr().write_value(pac::usart::regs::Brr(baud.brr));
    usart.cr3().write(|w| {
        w.set_dmar(true);
        w.set_dmat(true);
    });
    usart.cr1().write(|w| {
        w.set_over8(if baud.over8 { Over8::OVERSAMPLING8 } else { Over8::OVERSAMPLING16 });
        // With the FIFO, no byte is lost if DMA is late by less than the transmission time of 16 bytes.
        w.set_fifoen(true);
        w.set_te(true);
        w.set_re(true);
        w.set_idleie(true);
    });
    line.receive.configure(Dir::PERIPHERAL_TO_MEMORY, usart.rdr().as_ptr().cast(), ring.as_mut_ptr(), true);
    line.transmit.configure(
        Dir::MEMORY_TO_PERIPHERAL,
        usart.tdr().as_ptr().cast(),
        status.as_mut_ptr(),
        false,
    );
    line.receive.start(RING);
    usart.cr1().modify(|w| w.set_ue(true));

    line.interrupt.set_priority(clocks::LOW);
    // SAFETY: the interrupt handler only accesses the flags of the serial line and wakes the links.
    unsafe { line.interrupt.enable() };
    (
        Receiver { usart, ring: Ring { stream: line.receive, bytes: ring.as_ptr(), next: 0 }, errors: 0 },
        Lookahead(Ring { stream: line.receive, bytes: ring.as_ptr(), next: 0 }),
        Transmitter { stream: line.transmit, buffer: status },
    )
}

/// Reader of the ring that DMA fills. Each serial line has two independent readers.
struct Ring {
    stream: Stream,
    /// Pointer to the DMA ring. DMA writes the ring, so no Rust reference to the ring may exist.
    bytes: *const u8,
    /// Position of the first byte that this reader has not taken yet.
    next: usize,
}

impl Ring {
    /// Returns the number of bytes that have arrived and that this reader has not taken yet. The result is valid only
    /// if the number of waiting bytes is smaller than the size of the ring.
    fn waiting(&self) -> usize {
        let end = RING - self.stream.remaining();
        (end + RING - self.next) % RING
    }

    /// Copies the oldest waiting bytes without taking them. Copies as many bytes as are contiguous and fit into the
    /// buffer.
    fn peek<'a>(&self, into: &'a mut [u8]) -> &'a [u8] {
        let count = self.waiting().min(into.len()).min(RING - self.next);
        cortex_m::asm::dmb();
        // SAFETY: `next + count` is at most the length of the ring. DMA has written these bytes, and does not overwrite
        // them before it has overwritten all other bytes of the ring.
        unsafe { core::ptr::copy_nonoverlapping(self.bytes.add(self.next), into.as_mut_ptr(), count) };
        &into[..count]
    }

    fn take(&mut self, count: usize) {
        self.next = (self.next + count) % RING;
    }
}

/// The reader that the tick uses for a serial line. This reader returns every received byte, independently of the
/// links.
pub struct Lookahead(Ring);

// SAFETY: the reader reads a register and memory that only DMA writes; both reads are possible from any context.
unsafe impl Send for Lookahead {}

impl Lookahead {
    /// Passes the bytes that have arrived since the last call to `look`, in pieces. Passes at most `most` bytes; the
    /// next call passes the bytes after them.
    pub fn read(&mut self, most: usize, mut look: impl FnMut(&[u8])) {
        let mut left = self.0.waiting().min(most);
        let mut piece = [0; 64];
        while left > 0 {
            let room = left.min(piece.len());
            let bytes = self.0.peek(&mut piece[..room]);
            let count = bytes.len();
            if count == 0 {
                break;
            }
            look(bytes);
            self.0.take(count);
            left -= count;
        }
    }
}

/// Receiver of a serial line.
pub struct Receiver {
    usart: Usart,
    ring: Ring,
    /// Number of checks since program start that found an overrun, a framing error or a noise error.
    errors: u32,
}

impl Receiver {
    /// Returns the number of bytes that have arrived and that this receiver has not taken yet.
    pub fn waiting(&self) -> usize {
        self.ring.waiting()
    }

    /// Copies the oldest waiting bytes without taking them. Copies as many bytes as are contiguous and fit into the
    /// buffer.
    pub fn peek<'a>(&self, into: &'a mut [u8]) -> &'a [u8] {
        self.ring.peek(into)
    }

    /// Removes the `count` oldest waiting bytes.
    pub fn take(&mut self, count: usize) {
        self.ring.take(count);
    }

    /// Continues reading at byte `position`, counted from the first byte that the line received.
    pub fn jump(&mut self, position: u64) {
        self.ring.next = (position % RING as u64) as usize;
    }

    /// Checks the line for errors. Returns the number of checks since program start that found an error. Reception
    /// continues, because the parser detects wrong bytes.
    pub fn errors(&mut self) -> u32 {
        let flags = self.usart.isr().read();
        if flags.ore() || flags.fe() || flags.ne() {
            self.errors = self.errors.wrapping_add(1);
            self.usart.icr().write(|w| {
                w.set_ore(true);
                w.set_fe(true);
                w.set_ne(true);
            });
        }
        self.errors
    }
}

/// Transmitter of a serial line.
pub struct Transmitter {
    stream: Stream,
    /// Buffer for transmission, which DMA reads while the DMA stream runs.
    buffer: &'static mut [u8; ANSWER_MAX],
}

// SAFETY: the registers can be used from any context, and only this transmitter owns the buffer.
unsafe impl Send for Transmitter {}

impl Transmitter {
    /// Returns `true` if DMA has read all bytes of the last frame.
    pub fn is_free(&self) -> bool {
        !self.stream.running()
    }

    /// Sends a frame. Does not send the frame if the last frame is still being sent, or if the frame is longer than the
    /// transmit buffer.
    pub fn send(&mut self, frame: &[u8]) {
        if self.is_free()
            && let Some(place) = self.buffer.get_mut(..frame.len())
        {
            place.copy_from_slice(frame);
            self.stream.start(frame.len());
        }
    }
}

#[interrupt]
fn USART2() {
    idle(pac::USART2);
}

#[interrupt]
fn USART3() {
    idle(pac::USART3);
}

/// Handles the idle interrupt, which occurs when the serial line has been silent for the duration of a byte.
fn idle(usart: Usart) {
    usart.icr().write(|w| w.set_idle(true));
    WORK.signal(());
}
