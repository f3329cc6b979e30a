//! USART2 and USART3 (RM0399 chapter 51): asynchronous 8N1 with FIFOs, DMA requests, idle line and receiver timeout; every
//! byte takes its time on the wire.
use std::collections::VecDeque;

use crate::clock::{NEVER, SECOND, Time};
use crate::dma::{Dma, Memory};

/// Bits of CR1.
mod cr1 {
    pub const UE: u32 = 1;
    pub const RE: u32 = 4;
    pub const TE: u32 = 8;
    pub const IDLEIE: u32 = 0x10;
    pub const RXNEIE: u32 = 0x20;
    pub const TCIE: u32 = 0x40;
    pub const TXEIE: u32 = 0x80;
    pub const OVER8: u32 = 0x8000;
    pub const RTOIE: u32 = 1 << 26;
    pub const FIFOEN: u32 = 1 << 29;
}

/// Bits of ISR.
mod isr {
    pub const FE: u32 = 2;
    pub const NE: u32 = 4;
    pub const ORE: u32 = 8;
    pub const IDLE: u32 = 0x10;
    pub const RXNE: u32 = 0x20;
    pub const TC: u32 = 0x40;
    pub const TXE: u32 = 0x80;
    pub const RTOF: u32 = 0x800;
    pub const BUSY: u32 = 1 << 16;
    pub const TEACK: u32 = 1 << 21;
    pub const REACK: u32 = 1 << 22;
    pub const TXFE: u32 = 1 << 23;
    pub const RXFF: u32 = 1 << 24;
    /// Flags that ICR clears.
    pub const STICKY: u32 = FE | NE | ORE | IDLE | TC | RTOF | 1;
}

const RTOEN: u32 = 1 << 23;
const DMAR: u32 = 0x40;
const DMAT: u32 = 0x80;
const EIE: u32 = 1;
const FIFO: usize = 16;
/// Bytes ahead that are looked at for the next event.
const LOOK_AHEAD: usize = 64;
/// Largest difference of rates at which bytes still arrive whole, in parts of 1000.
const TOLERANCE: u64 = 40;

/// A byte and when its stop bit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireByte {
    /// End of the stop bit.
    pub end: Time,
    /// The byte.
    pub byte: u8,
}

/// A serial port and the line to its host.
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
    /// On the wire to the device.
    rx_wire: VecDeque<WireByte>,
    rx_wire_free: Time,
    /// End of the last byte received, until the idle flag was made of it.
    idle_from: Option<Time>,
    timeout_from: Option<Time>,
    tx_fifo: VecDeque<u8>,
    shifting: Option<WireByte>,
    output: VecDeque<WireByte>,
    /// Rate of the host, bit/s.
    pub host_baud: u32,
    /// Bytes from the host that arrived while the receiver was off.
    pub missed: u64,
    /// Overruns.
    pub overruns: u64,
    /// Bytes sent at a rate that the other end cannot read.
    pub garbled: u64,
    /// Bytes received and sent.
    pub received: u64,
    /// Bytes sent.
    pub sent: u64,
}

impl Usart {
    /// USART2 or USART3 with their DMAMUX request lines.
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

    /// Registers as after reset; what is on the wire goes on.
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

    /// Kernel clock.
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

    /// Rate that the registers give, bit/s; 0: none.
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

    /// The host sends bytes, the first no earlier than `now`.
    pub fn host_write(&mut self, now: Time, bytes: &[u8]) {
        let length = 10 * SECOND / u64::from(self.host_baud.max(1));
        for &byte in bytes {
            let end = self.rx_wire_free.max(now) + length;
            self.rx_wire_free = end;
            self.rx_wire.push_back(WireByte { end, byte });
        }
    }

    /// Bytes of the host that are not through yet.
    pub fn host_pending(&self) -> usize {
        self.rx_wire.len()
    }

    /// What has reached the host since the last call.
    pub fn take_output(&mut self) -> impl Iterator<Item = WireByte> {
        core::mem::take(&mut self.output).into_iter()
    }

    /// Let everything up to `now` happen.
    pub fn advance(&mut self, now: Time, dma: &mut Dma, memory: &mut dyn Memory) {
        while let Some(&next) = self.rx_wire.front().filter(|b| b.end <= now) {
            self.rx_wire.pop_front();
            self.idle(next.end.saturating_sub(self.frame()));
            self.receive(next, dma, memory);
        }
        // A byte that is on its way ends the silence with its start bit.
        let until = self.rx_wire.front().map_or(now, |b| now.min(b.end.saturating_sub(self.frame())));
        self.idle(until);
        self.drain_fifo(dma, memory);
        self.send(now, dma, memory);
    }

    /// The line was silent until `until`.
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
        // When the next byte can start: at the end of the one before, or now.
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

    /// When something happens next that the firmware would notice by an interrupt.
    pub fn next_event(&self, dma: &Dma) -> Time {
        self.next_receive(dma).min(self.next_send(dma))
    }

    fn next_receive(&self, dma: &Dma) -> Time {
        if !self.on(cr1::RE) {
            return NEVER;
        }
        let frame = self.frame();
        let idle_on = self.cr1 & cr1::IDLEIE != 0;
        let silent = |from: Time| {
            let idle = if idle_on { from.saturating_add(frame) } else { NEVER };
            let timeout =
                if self.cr1 & cr1::RTOIE != 0 { from.saturating_add(self.timeout()) } else { NEVER };
            idle.min(timeout)
        };
        let Some(first) = self.rx_wire.front() else {
            // Each of the two has come or not: a moment that is over would be looked at in every cycle.
            let idle = self.idle_from.filter(|_| idle_on).map_or(NEVER, |from| from.saturating_add(frame));
            let timeout = self.timeout_from.filter(|_| self.cr1 & cr1::RTOIE != 0);
            return idle.min(timeout.map_or(NEVER, |from| from.saturating_add(self.timeout())));
        };
        let byte_by_byte = self.cr1 & cr1::RXNEIE != 0 || self.cr3 & DMAR == 0 || !self.rates_match();
        if byte_by_byte {
            let idle = self.idle_from.map_or(NEVER, silent);
            return first.end.min(idle);
        }
        let until = dma
            .serving(self.rx_request)
            .and_then(|s| dma.until_interrupt(s))
            .map_or(LOOK_AHEAD, |n| (n as usize).min(LOOK_AHEAD));
        let mut before = self.idle_from;
        for (i, byte) in self.rx_wire.iter().enumerate() {
            if let Some(from) = before {
                let quiet = silent(from);
                if quiet <= byte.end.saturating_sub(frame) {
                    return quiet;
                }
            }
            if i + 1 >= until {
                return byte.end;
            }
            before = Some(byte.end);
        }
        before.map_or(NEVER, silent)
    }

    fn next_send(&self, dma: &Dma) -> Time {
        let Some(shifting) = self.shifting else { return NEVER };
        let frame = self.frame();
        let mut next = NEVER;
        if self.cr1 & cr1::TXEIE != 0 {
            next = shifting.end;
        }
        let stream = if self.cr3 & DMAT != 0 { dma.serving(self.tx_request) } else { None };
        if let Some(transfers) = stream.and_then(|s| dma.until_interrupt(s)) {
            next = next.min(shifting.end + u64::from(transfers.max(1) - 1) * frame);
        }
        if self.cr1 & cr1::TCIE != 0 {
            next = next.min(shifting.end + self.tx_fifo.len() as u64 * frame);
        }
        next
    }

    fn status(&self) -> u32 {
        let fifo = self.cr1 & cr1::FIFOEN != 0;
        let depth = if fifo { FIFO } else { 1 };
        let bit = |condition: bool, mask: u32| if condition { mask } else { 0 };
        self.flags & !isr::TC
            | bit(self.flags & isr::TC != 0 && self.shifting.is_none() && self.tx_fifo.is_empty(), isr::TC)
            | bit(!self.rx_fifo.is_empty(), isr::RXNE)
            | bit(self.tx_fifo.len() < depth, isr::TXE)
            | bit(fifo && self.tx_fifo.is_empty(), isr::TXFE)
            | bit(fifo && self.rx_fifo.len() >= FIFO, isr::RXFF)
            | bit(self.on(cr1::TE), isr::TEACK)
            | bit(self.on(cr1::RE), isr::REACK)
            | bit(self.idle_from.is_some() && !self.rx_wire.is_empty(), isr::BUSY)
    }

    /// Interrupt line.
    pub fn line(&self) -> bool {
        let status = self.status();
        let pairs = [
            (cr1::IDLEIE, isr::IDLE),
            (cr1::RXNEIE, isr::RXNE | isr::ORE),
            (cr1::TCIE, isr::TC),
            (cr1::TXEIE, isr::TXE),
            (cr1::RTOIE, isr::RTOF),
        ];
        self.cr1 & cr1::UE != 0
            && (pairs.iter().any(|&(enable, flag)| self.cr1 & enable != 0 && status & flag != 0)
                || self.cr3 & EIE != 0 && status & (isr::FE | isr::NE | isr::ORE) != 0)
    }

    /// Read a word.
    pub fn read(&mut self, offset: u32, now: Time, dma: &mut Dma, memory: &mut dyn Memory) -> u32 {
        self.advance(now, dma, memory);
        match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.cr3,
            0x0C => self.brr,
            0x10 => self.gtpr,
            0x14 => self.rtor,
            0x1C => self.status(),
            0x24 => {
                if let Some(byte) = self.rx_fifo.pop_front() {
                    self.last_rdr = byte;
                }
                u32::from(self.last_rdr)
            }
            0x2C => self.presc,
            _ => 0,
        }
    }

    /// Write a word.
    pub fn write(&mut self, offset: u32, value: u32, now: Time, dma: &mut Dma, memory: &mut dyn Memory) {
        self.advance(now, dma, memory);
        match offset {
            0x00 => {
                self.cr1 = value;
                if value & cr1::UE == 0 {
                    self.flags = isr::TC;
                    self.rx_fifo.clear();
                    self.tx_fifo.clear();
                    (self.idle_from, self.timeout_from) = (None, None);
                }
            }
            0x04 => self.cr2 = value,
            0x08 => self.cr3 = value,
            0x0C => self.brr = value & 0xFFFF,
            0x10 => self.gtpr = value,
            0x14 => self.rtor = value,
            0x18 => {
                if value & 8 != 0 {
                    self.rx_fifo.clear();
                }
                if value & 16 != 0 {
                    self.tx_fifo.clear();
                }
            }
            0x20 => self.flags &= !(value & isr::STICKY),
            0x28 => {
                self.flags &= !isr::TC;
                self.tx_fifo.push_back(value as u8);
            }
            0x2C => self.presc = value,
            _ => {}
        }
        self.update_bit();
        self.advance(now, dma, memory);
    }
}
