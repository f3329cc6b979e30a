//! Everything around the core: peripherals by address, their clocks, their interrupt lines, and virtual time.
use std::collections::BTreeMap;

use crate::clock::{MICROSECOND, NEVER, Time, period};
use crate::code::Code;
use crate::dma::{self, Dma, Memory};
use crate::exti::Exti;
use crate::fdcan::Fdcan;
use crate::gpio::{Gpio, Pin};
use crate::iwdg::Iwdg;
use crate::nvic::Nvic;
use crate::observe::Observers;
use crate::plain::Plain;
use crate::rcc::{Gate, Rcc};
use crate::scs::{Moment, Scs};
use crate::timer::Timer;
use crate::usart::Usart;

/// Frequency of the ST-LINK's clock at OSC_IN, Hz.
const HSE_HZ: u64 = 8_000_000;
/// Interrupt lines of TIM2..TIM7.
const TIMER_LINES: [usize; 6] = [28, 29, 30, 50, 54, 55];
/// Interrupt lines of USART2 and USART3.
const USART_LINES: [usize; 2] = [38, 39];
/// Interrupt lines of FDCAN1.
const FDCAN_LINES: [usize; 2] = [19, 21];

/// How often a register was touched that these models do not know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Access {
    /// Reads.
    pub reads: u32,
    /// Writes.
    pub writes: u32,
    /// Instruction that touched it last.
    pub pc: u32,
    /// What was written last.
    pub value: u32,
}

/// State of the core that the hook of every instruction touches.
#[derive(Default)]
pub struct Core {
    /// Instructions executed.
    pub instructions: u64,
    /// Count at which the hook looks closer.
    pub look_at: u64,
    /// Count before which the machine must stop.
    pub stop_at: u64,
    /// The last instruction begun.
    pub pc: u32,
    /// A stop was requested at this address.
    pub stopping: Option<u32>,
    /// Something changed that the loop must see before the next instruction.
    pub attention: bool,
    /// Something pends that only masks hold back.
    pub masked: bool,
    /// The instruction before may have lowered the stack pointer.
    pub check_sp: bool,
    /// Event register.
    pub event: bool,
    /// Number of an exception that the core raised itself.
    pub raised: Option<u32>,
    /// Address of an access that failed.
    pub fault_address: u32,
    /// Exceptions that run, innermost last.
    pub contexts: Vec<usize>,
}

/// The chip.
pub struct Chip {
    /// Core.
    pub core: Core,
    /// What is known of the code.
    pub code: Code,
    /// Interrupts.
    pub nvic: Nvic,
    /// The core's registers.
    pub scs: Scs,
    /// Clocks and resets.
    pub rcc: Rcc,
    /// Pins.
    pub gpio: Gpio,
    /// Edges of pins.
    pub exti: Exti,
    /// DMA1, DMA2.
    pub dma: Dma,
    /// TIM2..TIM7.
    pub timers: [Timer; 6],
    /// USART2, USART3.
    pub usarts: [Usart; 2],
    /// FDCAN1 and the bus.
    pub fdcan: Fdcan,
    /// Watchdog.
    pub iwdg: Iwdg,
    /// Observers.
    pub observers: Observers,
    plain: Plain,
    /// Registers without a model, by address.
    pub unknown: BTreeMap<u32, Access>,
    /// Accesses to peripherals whose clock is off.
    pub unclocked: BTreeMap<u32, Access>,
    /// D2 SRAM that may be used has changed.
    pub remap: bool,
    base_time: Time,
    base_instructions: u64,
    cycle: Time,
    base_cycles: u64,
}

impl Default for Chip {
    fn default() -> Self {
        let mut chip = Self {
            core: Core::default(),
            code: Code::default(),
            nvic: Nvic::default(),
            scs: Scs::default(),
            rcc: Rcc::new(HSE_HZ),
            gpio: Gpio::default(),
            exti: Exti::default(),
            dma: Dma::default(),
            timers: core::array::from_fn(|i| Timer::new(2 + i as u32)),
            usarts: [Usart::new(2), Usart::new(3)],
            fdcan: Fdcan::default(),
            iwdg: Iwdg::default(),
            observers: Observers::default(),
            plain: Plain::default(),
            unknown: BTreeMap::new(),
            unclocked: BTreeMap::new(),
            remap: true,
            base_time: 0,
            base_instructions: 0,
            cycle: 1,
            base_cycles: 0,
        };
        chip.update_clocks();
        chip
    }
}

impl Chip {
    /// Virtual time.
    #[inline]
    pub fn now(&self) -> Time {
        self.base_time + (self.core.instructions - self.base_instructions) * self.cycle
    }

    /// Core clock cycles, sleep included.
    pub fn cycles(&self) -> u64 {
        self.base_cycles + (self.core.instructions - self.base_instructions)
    }

    /// Length of a core clock period.
    pub fn cycle(&self) -> Time {
        self.cycle
    }

    fn rebase(&mut self) {
        self.base_time = self.now();
        self.base_cycles = self.cycles();
        self.base_instructions = self.core.instructions;
    }

    /// The core sleeps until `time`.
    pub fn sleep_until(&mut self, time: Time) {
        self.rebase();
        if time > self.base_time {
            self.base_cycles += (time - self.base_time) / self.cycle;
            self.base_time = time;
        }
    }

    /// Take new frequencies over.
    fn update_clocks(&mut self) {
        let clocks = self.rcc.clocks();
        let now = self.now();
        for timer in &mut self.timers {
            timer.advance(now);
            timer.set_clock(clocks.timers, now);
        }
        for usart in &mut self.usarts {
            usart.set_clock(clocks.usart);
        }
        self.fdcan.set_clock(clocks.fdcan);
        let cycle = period(clocks.core);
        if cycle != self.cycle {
            self.rebase();
            self.cycle = cycle;
        }
    }

    /// Everything but memory as after a reset with these flags.
    pub fn reset(&mut self, flags: u32) {
        let now = self.now();
        self.rcc.reset(flags);
        self.gpio.reset(now);
        self.exti = Exti::default();
        self.nvic = Nvic::default();
        self.scs = Scs::default();
        self.dma = Dma::default();
        self.timers = core::array::from_fn(|i| Timer::new(2 + i as u32));
        for usart in &mut self.usarts {
            usart.reset();
        }
        self.fdcan.reset();
        self.iwdg.reset();
        self.plain = Plain::default();
        self.code.forget_itcm();
        let instructions = self.core.instructions;
        self.core = Core { instructions, ..Core::default() };
        self.remap = true;
        self.update_clocks();
    }

    /// Drive a pin from outside; `None`: leave it open. Its edges reach EXTI.
    pub fn drive_pin(&mut self, pin: Pin, level: Option<bool>) {
        let Some(port) = Gpio::port(pin) else { return };
        let before = self.gpio.levels(port);
        self.gpio.drive(pin, level);
        self.exti.edges(port, before, self.gpio.levels(port));
    }

    fn moment(&self) -> Moment {
        Moment {
            now: self.now(),
            cycles: self.cycles(),
            instructions: self.core.instructions,
            running: self.core.contexts.last().copied().unwrap_or(0),
        }
    }

    /// Let everything up to now happen, and set interrupt lines accordingly.
    pub fn advance(&mut self, memory: &mut dyn Memory) {
        let now = self.now();
        for timer in &mut self.timers {
            timer.advance(now);
        }
        for usart in &mut self.usarts {
            usart.advance(now, &mut self.dma, memory);
        }
        self.fdcan.advance(now);
        let cycles = self.cycles();
        self.scs.advance(cycles, now, &mut self.nvic);
        self.update_lines();
    }

    fn update_lines(&mut self) {
        let now = self.now();
        for (timer, line) in self.timers.iter().zip(TIMER_LINES) {
            self.nvic.set_line(line, timer.line(), now);
        }
        for (usart, line) in self.usarts.iter().zip(USART_LINES) {
            self.nvic.set_line(line, usart.line(), now);
        }
        for (stream, line) in dma::LINES.into_iter().enumerate() {
            self.nvic.set_line(line, self.dma.line(stream), now);
        }
        for (level, line) in self.fdcan.lines().into_iter().zip(FDCAN_LINES) {
            self.nvic.set_line(line, level, now);
        }
    }

    /// When something happens next without the core's doing.
    pub fn next_event(&self) -> Time {
        let timers = self.timers.iter().map(Timer::next_event);
        let usarts = self.usarts.iter().map(|u| u.next_event(&self.dma));
        let wrap = self.scs.next_wrap();
        let systick =
            if wrap == NEVER { NEVER } else { self.now() + wrap.saturating_sub(self.cycles()) * self.cycle };
        let others = [self.fdcan.next_event(), self.iwdg.bites(), systick];
        timers.chain(usarts).chain(others).min().unwrap_or(NEVER)
    }

    fn clocked(&mut self, gate: Gate, address: u32, write: Option<u32>) -> bool {
        let on = self.rcc.enabled(gate);
        if !on {
            note(&mut self.unclocked, address, self.core.pc, write);
        }
        on
    }

    /// A load by the core; what lies below a word is cut out.
    pub fn load(&mut self, address: u32, size: usize, memory: &mut dyn Memory) -> u32 {
        let word = self.read_word(address & !3, memory);
        let value = word >> (8 * (address & 3));
        if size < 4 { value & ((1 << (8 * size)) - 1) } else { value }
    }

    fn read_word(&mut self, address: u32, memory: &mut dyn Memory) -> u32 {
        let now = self.now();
        if address >= 0xE000_0000 {
            let at = self.moment();
            return self.scs.read(address, &self.nvic, at);
        }
        if let Some((gate, place)) = place(address) {
            if !self.clocked(gate, address, None) {
                return 0;
            }
            return match place {
                Place::Timer(n, offset) => self.timers[n].read(offset, now),
                Place::Usart(n, offset) => {
                    let value = self.usarts[n].read(offset, now, &mut self.dma, memory);
                    self.changed();
                    value
                }
                Place::Dma(n, offset) => {
                    self.catch_up(memory);
                    self.dma.read(n, offset)
                }
                Place::Mux(offset) => self.dma.read_mux(offset),
                Place::Gpio(n, offset) => self.gpio.read(n, offset),
                Place::Fdcan(offset) => self.fdcan.read(offset, now),
                Place::MessageRam(offset) => {
                    self.fdcan.advance(now);
                    self.fdcan.ram.read(offset)
                }
            };
        }
        match address {
            RCC..RCC_END => self.rcc.read(address - RCC),
            IWDG1..IWDG1_END => self.iwdg.read(address - IWDG1),
            EXTI..EXTI_END => self.exti.read(address - EXTI),
            EXTICR..EXTICR_END => self.exti.source((address - EXTICR) as usize / 4),
            _ => {
                if !is_plain(address) {
                    note(&mut self.unknown, address, self.core.pc, None);
                }
                self.plain.read(address) | ready_bits(address, &self.plain)
            }
        }
    }

    /// A store by the core.
    pub fn store(&mut self, address: u32, size: usize, value: u32, memory: &mut dyn Memory) {
        let now = self.now();
        let shift = 8 * (address & 3);
        let word_address = address & !3;
        if address >= 0xE000_0000 {
            let at = self.moment();
            let word = if size < 4 {
                // Priorities are written by byte.
                let mask = ((1u32 << (8 * size)) - 1) << shift;
                self.scs.read(word_address, &self.nvic, at) & !mask | value << shift
            } else {
                value
            };
            self.scs.write(word_address, word, &mut self.nvic, at);
            return self.changed();
        }
        let value = value << shift;
        if let Some((gate, place)) = place(word_address) {
            if !self.clocked(gate, word_address, Some(value)) {
                return;
            }
            match place {
                Place::Timer(n, offset) => self.timers[n].write(offset, value, now),
                Place::Usart(n, offset) => {
                    self.usarts[n].write(offset, value, now, &mut self.dma, memory);
                }
                Place::Dma(n, offset) => {
                    self.catch_up(memory);
                    self.dma.write(n, offset, value);
                    self.catch_up(memory);
                }
                Place::Mux(offset) => self.dma.write_mux(offset, value),
                Place::Gpio(n, offset) => return self.gpio.write(n, offset, value, now),
                Place::Fdcan(offset) => self.fdcan.write(offset, value, now),
                Place::MessageRam(offset) => {
                    self.fdcan.advance(now);
                    return self.fdcan.ram.write(offset, value);
                }
            }
            return self.changed();
        }
        match word_address {
            RCC..RCC_END => self.write_rcc(word_address - RCC, value, memory),
            IWDG1..IWDG1_END => self.iwdg.write(word_address - IWDG1, value, now),
            EXTI..EXTI_END => self.exti.write(word_address - EXTI, value),
            EXTICR..EXTICR_END => self.exti.set_source((word_address - EXTICR) as usize / 4, value),
            _ => {
                if !is_plain(word_address) {
                    note(&mut self.unknown, word_address, self.core.pc, Some(value));
                }
                self.plain.write(word_address, value);
            }
        }
        self.changed();
    }

    fn write_rcc(&mut self, offset: u32, value: u32, memory: &mut dyn Memory) {
        self.advance(memory);
        self.rcc.write(offset, value);
        let now = self.now();
        for gate in core::mem::take(&mut self.rcc.resets) {
            match gate {
                Gate::Dma(n) => self.dma.reset(n as usize),
                Gate::Timer(n) => self.timers[n as usize - 2] = Timer::new(n),
                Gate::Usart(n) => self.usarts[n as usize - 2].reset(),
                Gate::Fdcan => self.fdcan.reset(),
                Gate::Gpio(_) | Gate::Sram(_) => {}
            }
        }
        for timer in &mut self.timers {
            timer.advance(now);
        }
        self.update_clocks();
        self.remap = true;
    }

    fn catch_up(&mut self, memory: &mut dyn Memory) {
        let now = self.now();
        for usart in &mut self.usarts {
            usart.advance(now, &mut self.dma, memory);
        }
    }

    /// After an access that may have changed lines or events: the loop looks before the next instruction.
    fn changed(&mut self) {
        self.update_lines();
        self.core.attention = true;
        self.core.look_at = 0;
    }

    /// Supply and voltage scale as the PWR registers have them: CR3 and the VOS code of D3CR.
    pub fn supply(&self) -> (u32, u32) {
        (self.plain.read(PWR + 0x0C), self.plain.read(PWR + 0x18) >> 14 & 3)
    }

    /// Microseconds of virtual time.
    pub fn now_us(&self) -> u64 {
        self.now() / MICROSECOND
    }
}

fn note(list: &mut BTreeMap<u32, Access>, address: u32, pc: u32, write: Option<u32>) {
    let access = list.entry(address).or_default();
    access.pc = pc;
    match write {
        Some(value) => {
            access.writes += 1;
            access.value = value;
        }
        None => access.reads += 1,
    }
}

const RCC: u32 = 0x5802_4400;
const RCC_END: u32 = 0x5802_4800;
const PWR: u32 = 0x5802_4800;
const IWDG1: u32 = 0x5800_4800;
const IWDG1_END: u32 = 0x5800_4C00;
const EXTI: u32 = 0x5800_0000;
const EXTI_END: u32 = 0x5800_0400;
/// SYSCFG_EXTICR1..4.
const EXTICR: u32 = 0x5800_0408;
const EXTICR_END: u32 = 0x5800_0418;
const HSEM: u32 = 0x5802_6400;

/// A register of a peripheral that is modelled and can be switched off.
enum Place {
    Timer(usize, u32),
    Usart(usize, u32),
    Dma(usize, u32),
    Mux(u32),
    Gpio(usize, u32),
    Fdcan(u32),
    MessageRam(u32),
}

fn place(address: u32) -> Option<(Gate, Place)> {
    let block = address & !0x3FF;
    let offset = address & 0x3FF;
    Some(match block {
        0x4000_0000..=0x4000_1400 => {
            let n = ((block - 0x4000_0000) >> 10) as usize;
            (Gate::Timer(n as u32 + 2), Place::Timer(n, offset))
        }
        0x4000_4400 | 0x4000_4800 => {
            let n = ((block - 0x4000_4400) >> 10) as usize;
            (Gate::Usart(n as u32 + 2), Place::Usart(n, offset))
        }
        0x4000_A000 => (Gate::Fdcan, Place::Fdcan(offset)),
        0x4000_AC00..0x4000_D400 => (Gate::Fdcan, Place::MessageRam(address - 0x4000_AC00)),
        0x4002_0000 | 0x4002_0400 => {
            let n = ((block - 0x4002_0000) >> 10) as usize;
            (Gate::Dma(n as u32), Place::Dma(n, offset))
        }
        0x4002_0800 => (Gate::Dma(0), Place::Mux(offset)),
        0x5802_0000..0x5802_2C00 => {
            let n = (block - 0x5802_0000) >> 10;
            (Gate::Gpio(n), Place::Gpio(n as usize, offset))
        }
        _ => return None,
    })
}

/// Blocks that are nothing but memory for the firmware's purposes: CRS, FLASH, the rest of SYSCFG, RTC, PWR, HSEM, DBGMCU.
fn is_plain(address: u32) -> bool {
    matches!(
        address & !0x3FF,
        0x4000_8400 | 0x5200_2000 | 0x5800_0400 | 0x5800_4000 | PWR | HSEM | 0x5C00_1000 | 0x4000_A800
    )
}

/// Bits that read "ready", in blocks that are memory otherwise.
fn ready_bits(address: u32, plain: &Plain) -> u32 {
    let vos = plain.read(PWR + 0x18) & 0xC000;
    match address {
        // CSR1: ACTVOSRDY and the scale in use; CR3: SDEXTRDY; D3CR: VOSRDY; CCCSR: ready.
        0x5802_4804 => 1 << 13 | vos,
        0x5802_480C => 1 << 16,
        0x5802_4818 => 1 << 13,
        0x5800_0420 => 1 << 8,
        // A semaphore that is read to lock it is given to core 1.
        0x5802_6480..0x5802_6500 => 0x8000_0300,
        _ => 0,
    }
}
