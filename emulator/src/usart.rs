//! USART2 and USART3 (RM0399 chapter 51): asynchronous 8N1 with FIFOs, DMA requests, idle line and receiver timeout.
//! The transmission of each byte takes as long as on a real serial line.
mod bits;
mod next;
mod registers;

use std::collections::VecDeque;

use crate::clock::{NEVER, SECOND, Time};
use crate::dma::{Dma, Memory};
use bits::{cr1, isr};

const RTOEN: u32 = 1 << 23;
const DMAR: u32 = 0x40;
const DMAT: u32 = 0x80;
const FIFO: usize = 16;
/// Number of bytes that the model examines in advance to find the next event.
const LOOK_AHEAD: usize = 64;
/// Largest relative difference of the two bit rates at which the receiver still receives bytes correctly, in
/// thousandths.
const TOLERANCE: u64 = 40;

/// A transmitted byte and the end time of its stop bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireByte {
    /// Time of the end of the stop bit.
    pub end: Time,
    /// Value of the byte.
    pub byte: u8,
}

/// A serial port and the serial line to its host.
pub struct Usart {
    rx_request: u32,
    tx_request: u32,
    cr1: u32,
    cr2: u32,
    cr3: u32,
    brr: u32,
    gtpr: u32,
    rtor: u32,
    presc: u32,
    flags: u32,
    kernel_hz: u64,
    bit: Time,
    rx_fifo: VecDeque<u8>,
    last_rdr: u8,
    /// Bytes on the serial line from the host to the board, with their end times.
    rx_wire: VecDeque<WireByte>,
    rx_wire_free: Time,
    /// End time of the last received byte. The model derives the idle flag from this time.
    idle_from: Option<Time>,
    timeout_from: Option<Time>,
    tx_fifo: VecDeque<u8>,
    shifting: Option<WireByte>,
    output: VecDeque<WireByte>,
    /// Bit rate of the host, bit/s.
    pub host_baud: u32,
    /// Number of bytes from the host that arrived while the receiver was off.
    pub missed: u64,
    /// Number of receiver overruns.
    pub overruns: u64,
    /// Number of bytes in both directions that were received wrongly, because the bit rates of board and host differ.
    pub garbled: u64,
    /// Number of bytes that the board has received.
    pub received: u64,
    /// Number of bytes that the board has sent.
    pub sent: u64,
}

impl Usart {
    /// Creates USART2 or USART3 with its DMAMUX request lines.
    pub fn new(number: u32) -> Self {
        let rx_request = if number == 2 { 43 } else { 45 };
        Self {
            rx_request,
            tx_request: rx_request + 1,
            cr1: 0,
            cr2: 0,
            cr3: 0,
            brr: 0,
            gtpr: 0,
            rtor: 0,
            presc: 0,
            flags: isr::TC,
            kernel_hz: 0,
            bit: NEVER,
            rx_fifo: VecDeque::new(),
            last_rdr: 0,
            rx_wire: VecDeque::new(),
            rx_wire_free: 0,
            idle_from: None,
            timeout_from: None,
            tx_fifo: VecDeque::new(),
            shifting: None,
            output: VecDeque::new(),
            host_baud: 115_200,
            missed: 0,
            overruns: 0,
            garbled: 0,
            received: 0,
            sent: 0,
        }
    }

    /// Sets the registers to their values after a reset. The transmission of bytes on the serial line continues.
    pub fn reset(&mut self) {
        let old = core::mem::replace(self, Self::new(if self.rx_request == 43 { 2 } else { 3 }));
        self.rx_wire = old.rx_wire;
        self.rx_wire_free = old.rx_wire_free;
        self.output = old.output;
        self.host_baud = old.host_baud;
        self.kernel_hz = old.kernel_hz;
        (self.missed, self.overruns, self.garbled) = (old.missed, old.overruns, old.garbled);
        (self.received, self.sent) = (old.received, old.sent);
    }

    /// Sets the kernel clock of the USART.
    pub fn set_clock(&mut self, hz: u64) {
        if hz != self.kernel_hz {
            self.kernel_hz = hz;
            self.update_bit();
        }
    }

    fn update_bit(&mut self) {
        const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];
        let prescaler = PRESCALERS.get(self.presc as usize & 15).copied().unwrap_or(256);
        let (divider, halves) = if self.cr1 & cr1::OVER8 != 0 {
            (u64::from(self.brr & 0xFFF0 | (self.brr & 7) << 1), 2)
        } else {
            (u64::from(self.brr), 1)
        };
        let clocks = divider * prescaler;
        self.bit = if self.kernel_hz == 0 || clocks == 0 {
            NEVER
        } else {
            (u128::from(clocks) * u128::from(SECOND) / u128::from(self.kernel_hz * halves)) as Time
        };
    }

    /// Returns the bit rate that the registers set, bit/s; 0 if no rate is set.
    pub fn baud(&self) -> u32 {
        if self.bit == NEVER { 0 } else { (SECOND as f64 / self.bit as f64).round() as u32 }
    }

    fn frame(&self) -> Time {
        let stop = if self.cr2 >> 12 & 3 == 2 { 2 } else { 1 };
        self.bit.saturating_mul(9 + stop)
    }

    fn on(&self, bits: u32) -> bool {
        self.cr1 & (cr1::UE | bits) == cr1::UE | bits && self.bit != NEVER
    }

    fn rates_match(&self) -> bool {
        let own = u64::from(self.baud());
        let host = u64::from(self.host_baud.max(1));
        own.abs_diff(host) * 1000 <= host * TOLERANCE
    }

    /// Sends bytes from the host. The transmission of the first byte starts at `now`, or later if the serial line is
    /// still busy.
    pub fn host_write(&mut self, now: Time, bytes: &[u8]) {
        let length = 10 * SECOND / u64::from(self.host_baud.max(1));
        for &byte in bytes {
            let end = self.rx_wire_free.max(now) + length;
            self.rx_wire_free = end;
            self.rx_wire.push_back(WireByte { end, byte });
        }
    }

    /// Returns the number of host bytes that still wait for transmission on the serial line.
    pub fn host_pending(&self) -> usize {
        self.rx_wire.len()
    }

    /// Returns the bytes that the host has received since the last call.
    pub fn take_output(&mut self) -> impl Iterator<Item = WireByte> {
        core::mem::take(&mut self.output).into_iter()
    }

    /// Executes all events of the USART up to `now`.
    pub fn advance(&mut self, now: Time, dma: &mut Dma, memory: &mut dyn Memory) {
        while let Some(&next) = self.rx_wire.front().filter(|b| b.end <= now) {
            self.rx_wire.pop_front();
            self.idle(next.end.saturating_sub(self.frame()));
            self.receive(next, dma, memory);
        }
        // The silence on the line ends when the start bit of the next byte begins.
        let until = self.rx_wire.front().map_or(now, |b| now.min(b.end.saturating_sub(self.frame())));
        self.idle(until);
        self.drain_fifo(dma, memory);
        self.send(now, dma, memory);
    }

    /// Sets the idle and timeout flags that result from the silence of the serial line until the time `until`.
    fn idle(&mut self, until: Time) {
        if let Some(from) = self.idle_from
            && until >= from.saturating_add(self.frame())
        {
            self.flags |= isr::IDLE;
            self.idle_from = None;
        }
        if let Some(from) = self.timeout_from
            && until >= from.saturating_add(self.timeout())
        {
            self.flags |= isr::RTOF;
            self.timeout_from = None;
        }
    }

    fn timeout(&self) -> Time {
        if self.cr2 & RTOEN == 0 { NEVER } else { self.bit.saturating_mul(u64::from(self.rtor & 0xFF_FFFF)) }
    }

    fn receive(&mut self, next: WireByte, dma: &mut Dma, memory: &mut dyn Memory) {
        if !self.on(cr1::RE) {
            self.missed += 1;
            return;
        }
        self.received += 1;
        self.idle_from = Some(next.end);
        self.timeout_from = Some(next.end);
        let mut byte = next.byte;
        if !self.rates_match() {
            self.flags |= isr::FE | isr::NE;
            self.garbled += 1;
            byte = byte.rotate_left(3) ^ 0xA5;
        }
        let depth = if self.cr1 & cr1::FIFOEN != 0 { FIFO } else { 1 };
        self.drain_fifo(dma, memory);
        if self.rx_fifo.len() >= depth {
            self.flags |= isr::ORE;
            self.overruns += 1;
            return;
        }
        self.rx_fifo.push_back(byte);
        self.drain_fifo(dma, memory);
    }

    fn drain_fifo(&mut self, dma: &mut Dma, memory: &mut dyn Memory) {
        while self.cr3 & DMAR != 0
            && !self.rx_fifo.is_empty()
            && let Some(stream) = dma.serving(self.rx_request)
            && let Some(byte) = self.rx_fifo.pop_front()
        {
            dma.give(stream, byte, memory);
        }
    }

    fn send(&mut self, now: Time, dma: &mut Dma, memory: &mut dyn Memory) {
        if !self.on(cr1::TE) {
            return;
        }
        let depth = if self.cr1 & cr1::FIFOEN != 0 { FIFO } else { 1 };
        // The next byte can start when the previous byte has ended, but not earlier than `now`.
        loop {
            while self.cr3 & DMAT != 0
                && self.tx_fifo.len() < depth
                && let Some(stream) = dma.serving(self.tx_request)
                && let Some(byte) = dma.take(stream, memory)
            {
                self.tx_fifo.push_back(byte);
                self.flags &= !isr::TC;
            }
            let start = match self.shifting {
                Some(byte) if byte.end > now => return,
                Some(byte) => {
                    self.shifting = None;
                    self.deliver(byte);
                    byte.end
                }
                None => now,
            };
            match self.tx_fifo.pop_front() {
                Some(byte) => self.shifting = Some(WireByte { end: start + self.frame(), byte }),
                None => {
                    self.flags |= isr::TC;
                    return;
                }
            }
        }
    }

    fn deliver(&mut self, byte: WireByte) {
        self.sent += 1;
        if self.rates_match() {
            self.output.push_back(byte);
        } else {
            self.garbled += 1;
            self.output.push_back(WireByte { byte: byte.byte.rotate_left(3) ^ 0xA5, ..byte });
        }
    }
}
