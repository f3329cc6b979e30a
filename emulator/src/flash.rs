//! Bank 2 of the embedded flash (RM0399 chapter 4). Erasing and programming take time, and a read during a flash
//! operation stalls the core. After a loss of power during a flash operation, the contents of the affected words are
//! undefined. Bank 1 contains the program and remains locked.
mod bank;

use crate::clock::{MICROSECOND, SECOND, Time};
use bank::Cell;

pub use bank::{BANK2, BANK2_SIZE, Bank2, WORD};

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Register offsets of bank 1. The register offsets of bank 2 are larger by [`SECOND_BANK`].
mod reg {
    pub const KEYR: u32 = 0x04;
    pub const CR: u32 = 0x0C;
    pub const SR: u32 = 0x10;
    pub const CCR: u32 = 0x14;
}
const SECOND_BANK: u32 = 0x100;

/// Bits of register CR.
mod cr {
    pub const LOCK: u32 = 1 << 0;
    pub const PG: u32 = 1 << 1;
    pub const SER: u32 = 1 << 2;
    pub const START: u32 = 1 << 7;
    pub const EOPIE: u32 = 1 << 16;
    /// Value of CR after a reset: the bank is locked, and 64 bits are programmed at once.
    pub const RESET: u32 = 0x31;
}

/// Bits of register SR.
pub mod sr {
    /// A flash operation is running.
    pub const BSY: u32 = 1 << 0;
    /// Some bytes of a word were written, but not all bytes.
    pub const WBNE: u32 = 1 << 1;
    /// A flash operation is running or waiting.
    pub const QW: u32 = 1 << 2;
    /// A flash operation has ended without an error. The flag is only set if its interrupt is enabled.
    pub const EOP: u32 = 1 << 16;
    /// The program attempted a write to a protected sector.
    pub const WRPERR: u32 = 1 << 17;
    /// The program wrote a word while programming was not enabled.
    pub const PGSERR: u32 = 1 << 18;
    /// The program wrote a byte twice.
    pub const STRBERR: u32 = 1 << 19;
    /// The program wrote bytes of another word before the first word was complete.
    pub const INCERR: u32 = 1 << 21;
    /// The flash operation failed.
    pub const OPERR: u32 = 1 << 22;
    /// A word has more wrong bits than the flash can correct.
    pub const DBECCERR: u32 = 1 << 26;
}

/// Kind of a flash operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OperationKind {
    /// Erasing of a sector, which sets all bits of the sector to 1.
    Erase {
        /// Number of the sector.
        sector: usize,
    },
    /// Programming of a word.
    Program {
        /// Address of the word.
        address: u32,
    },
}

/// An operation of flash bank 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operation {
    /// Kind of the flash operation.
    pub kind: OperationKind,
    /// Start of the flash operation.
    pub start: Time,
    /// End of the flash operation.
    pub end: Time,
}

/// The flash interface of bank 2.
pub struct Flash {
    /// Contents of flash bank 2.
    pub bank: Bank2,
    /// Time to erase a sector.
    pub erase_time: Time,
    /// Time to program a word.
    pub program_time: Time,
    /// All flash operations, oldest first.
    pub operations: Vec<Operation>,
    /// Reads and writes that waited for a flash operation. Each entry contains the time of the access and the duration
    /// for which the core was stalled.
    pub stalls: Vec<(Time, Time)>,
    /// Number of accesses to the bank while the protection unit permitted the core to cache or prefetch the bank.
    pub ahead: u32,
    /// Number of words that were programmed a second time without an erase operation in between.
    pub overwrites: u32,
    /// Longest time during a flash operation in which the protection unit permitted reads of the bank.
    pub longest_open: Time,
    /// Error bits of SR that the next flash operation sets when it ends.
    pub fail_next: u32,
    /// `true` if the program has unlocked bank 1.
    pub bank1_unlocked: bool,
    /// Number of resets. The model uses this number as the seed for the random contents after an interrupted flash
    /// operation.
    torn: u64,
    cr: u32,
    sr: u32,
    /// Number of correct keys that the program has written in sequence. After a wrong key, the value is `usize::MAX`,
    /// and the flash cannot be unlocked until a reset.
    keys: usize,
    running: Option<Operation>,
    /// Word that the program is writing: its index, its bytes, and a mask of the bytes written so far.
    buffer: Option<(usize, [u8; WORD], u32)>,
    open_since: Option<Time>,
}

impl Default for Flash {
    fn default() -> Self {
        Self {
            bank: Bank2::default(),
            // Typical values from the data sheet, for programming 32 bits at a time.
            erase_time: 2 * SECOND,
            program_time: 130 * MICROSECOND,
            operations: Vec::new(),
            stalls: Vec::new(),
            ahead: 0,
            overwrites: 0,
            longest_open: 0,
            fail_next: 0,
            bank1_unlocked: false,
            torn: 0,
            cr: cr::RESET,
            sr: 0,
            keys: 0,
            running: None,
            buffer: None,
            open_since: None,
        }
    }
}

impl Flash {
    /// Sets the registers to their values after a reset. The reset interrupts a running flash operation.
    pub fn reset(&mut self, now: Time) {
        self.torn += 1;
        self.bank = self.cut(now, self.torn);
        (self.cr, self.sr, self.keys, self.buffer, self.running) = (cr::RESET, 0, 0, None, None);
        self.open_since = None;
    }

    /// Returns the contents of bank 2 after a power failure at `now`. `seed` determines the random contents of the
    /// words that an operation was changing.
    pub fn cut(&self, now: Time, seed: u64) -> Bank2 {
        let mut bank = self.bank.clone();
        if let Some(operation) = self.running.filter(|o| o.start < now) {
            let word = self.buffer.map_or([0xFF; WORD], |(_, bytes, _)| bytes);
            bank.tear(operation.kind, &word, &mut fastrand::Rng::with_seed(seed));
        }
        bank
    }

    /// Returns the end of the flash operation that is running at `now`.
    pub fn busy_until(&self, now: Time) -> Option<Time> {
        self.running.map(|operation| operation.end).filter(|end| *end > now)
    }

    /// Completes the running flash operation if its end time has passed.
    pub fn advance(&mut self, now: Time) {
        let Some(operation) = self.running.take_if(|operation| operation.end <= now) else { return };
        self.guard(operation.end, true);
        let buffer = self.buffer.take();
        let fail = core::mem::take(&mut self.fail_next);
        self.sr |= fail;
        if fail == 0 && self.cr & cr::EOPIE != 0 {
            self.sr |= sr::EOP;
        }
        match (operation.kind, buffer) {
            _ if fail != 0 => self.bank.tear(
                operation.kind,
                &buffer.map_or([0xFF; WORD], |(_, bytes, _)| bytes),
                &mut fastrand::Rng::with_seed(now),
            ),
            (OperationKind::Erase { sector }, _) => self.bank.erase_sector(sector),
            (OperationKind::Program { .. }, Some((n, bytes, _))) => {
                self.overwrites += u32::from(!self.bank.program(n, &bytes));
            }
            (OperationKind::Program { .. }, None) => {}
        }
    }

    /// Records that the protection unit blocks or permits accesses of the core from `now` on.
    pub fn guard(&mut self, now: Time, closed: bool) {
        if closed {
            let open = self.open_since.take().map_or(0, |since| now.saturating_sub(since));
            self.longest_open = self.longest_open.max(open);
        } else if self.running.is_some() {
            self.open_since.get_or_insert(now);
        }
    }

    fn begin(&mut self, kind: OperationKind, now: Time, closed: bool) {
        let time = match kind {
            OperationKind::Erase { .. } => self.erase_time,
            OperationKind::Program { .. } => self.program_time,
        };
        let operation = Operation { kind, start: now, end: now + time };
        self.operations.push(operation);
        self.running = Some(operation);
        self.guard(now, closed);
    }

    /// Reads a register of the flash interface. Returns `None` for registers that are modelled as plain memory.
    pub fn read_register(&mut self, offset: u32, now: Time) -> Option<u32> {
        self.advance(now);
        Some(match offset {
            reg::KEYR | reg::CCR => 0,
            reg::CR => cr::RESET & !u32::from(self.bank1_unlocked),
            reg::SR => 0,
            _ => match offset.checked_sub(SECOND_BANK)? {
                reg::KEYR | reg::CCR => 0,
                reg::CR => self.cr,
                reg::SR => {
                    let busy = if self.running.is_some() { sr::BSY | sr::QW } else { 0 };
                    let waits = self.buffer.is_some() && self.running.is_none();
                    self.sr | busy | if waits { sr::WBNE } else { 0 }
                }
                _ => return None,
            },
        })
    }

    /// Writes a register of the flash interface. Returns `false` for registers that are modelled as plain memory.
    /// `closed` means that the protection unit blocks accesses of the core to bank 2.
    pub fn write_register(&mut self, offset: u32, value: u32, now: Time, closed: bool) -> bool {
        self.advance(now);
        match offset {
            reg::KEYR => self.bank1_unlocked = true,
            reg::CR | reg::SR | reg::CCR => {}
            _ => match offset.wrapping_sub(SECOND_BANK) {
                reg::KEYR => self.key(value),
                reg::CR => self.control(value, now, closed),
                reg::CCR => self.sr &= !value,
                reg::SR => {}
                _ => return false,
            },
        }
        true
    }

    fn key(&mut self, value: u32) {
        let right = KEYS.get(self.keys) == Some(&value);
        self.keys = if right { self.keys + 1 } else { usize::MAX };
        if self.keys == KEYS.len() {
            self.cr &= !cr::LOCK;
        }
    }

    fn control(&mut self, value: u32, now: Time, closed: bool) {
        if self.cr & cr::LOCK != 0 || self.running.is_some() {
            return;
        }
        self.cr = value & !cr::START;
        if value & cr::LOCK != 0 {
            self.keys = 0;
        }
        match (value & cr::START != 0, value & cr::SER != 0, value & cr::PG != 0) {
            (true, true, false) if self.buffer.is_none() => {
                let sector = (value >> 8 & 7) as usize;
                self.begin(OperationKind::Erase { sector }, now, closed);
            }
            (true, ..) => self.sr |= sr::PGSERR,
            _ => {}
        }
    }

    /// Handles a read of bank 2 by the core. The flag in the result is `true` if the word is unreadable.
    pub fn load(&mut self, address: u32, size: usize) -> (u32, bool) {
        let at = (address - BANK2) as usize;
        let bad = self.bank.cells[at / WORD] == Cell::Unreadable;
        if bad {
            self.sr |= sr::DBECCERR;
        }
        let bytes = self.bank.bytes.as_flattened().iter().skip(at).take(size);
        (bytes.rev().fold(0, |value, byte| value << 8 | u32::from(*byte)), bad)
    }

    /// Handles a write to bank 2 by the core. No flash operation may be running.
    pub fn store(&mut self, address: u32, size: usize, value: u32, now: Time, closed: bool) {
        let at = (address - BANK2) as usize;
        let (n, first) = (at / WORD, at % WORD);
        if self.cr & cr::LOCK != 0 || self.cr & cr::PG == 0 {
            self.sr |= sr::PGSERR;
            return;
        }
        let buffer = self.buffer.get_or_insert((n, [0xFF; WORD], 0));
        if buffer.0 != n {
            self.sr |= sr::INCERR;
            return;
        }
        for (i, byte) in value.to_le_bytes().into_iter().enumerate().take(size) {
            if buffer.2 >> (first + i) & 1 == 1 {
                self.sr |= sr::STRBERR;
            }
            buffer.1[first + i] = byte;
            buffer.2 |= 1 << (first + i);
        }
        if buffer.2 == u32::MAX {
            self.begin(OperationKind::Program { address: BANK2 + (n * WORD) as u32 }, now, closed);
        }
    }
}
