//! The chip around the core: the address map, clocks and interrupt lines of the peripherals, and virtual time.
mod access;
mod map;

use std::collections::BTreeMap;
use std::ops::Range;

use crate::clock::{MICROSECOND, NEVER, Time, period};
use crate::code::Code;
use crate::dma::{self, Dma, Memory};
use crate::exti::Exti;
use crate::fdcan::Fdcan;
use crate::flash::Flash;
use crate::gpio::{Gpio, Pin};
use crate::iwdg::Iwdg;
use crate::nvic::Nvic;
use crate::observe::Observers;
use crate::plain::Plain;
use crate::rcc::Rcc;
use crate::scs::{Moment, Scs};
use crate::timer::Timer;
use crate::usart::Usart;
use map::PWR;

/// Frequency of the ST-LINK's clock at OSC_IN, Hz.
const HSE_HZ: u64 = 8_000_000;
/// Interrupt lines of TIM2..TIM7.
const TIMER_LINES: [usize; 6] = [28, 29, 30, 50, 54, 55];
/// Interrupt lines of USART2 and USART3.
const USART_LINES: [usize; 2] = [38, 39];
/// Interrupt lines of FDCAN1.
const FDCAN_LINES: [usize; 2] = [19, 21];

/// Counts of accesses to a register that the emulator does not model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Access {
    /// Number of reads of the register.
    pub reads: u32,
    /// Number of writes to the register.
    pub writes: u32,
    /// Address of the last instruction that accessed the register.
    pub pc: u32,
    /// Value that was written last.
    pub value: u32,
}

/// State of the core for the hook that runs before every instruction.
#[derive(Default)]
pub struct Core {
    /// Number of instructions that the core has executed.
    pub instructions: u64,
    /// Instruction count from which the hook performs its full checks before each instruction.
    pub look_at: u64,
    /// Instruction count at which the machine must stop.
    pub stop_at: u64,
    /// Address of the last instruction that the core started.
    pub pc: u32,
    /// Addresses of the instructions in the last IT block.
    pub it_block: Range<u32>,
    /// `true` if a stop of the machine was requested.
    pub stopping: bool,
    /// `true` if interrupt lines or events may have changed, so that the main loop must check them before the next
    /// instruction.
    pub attention: bool,
    /// `true` if only the mask registers block a pending exception.
    pub masked: bool,
    /// `true` if the previous instruction may have lowered the stack pointer.
    pub check_sp: bool,
    /// Event register of the core, which WFE tests.
    pub event: bool,
    /// Number of an exception that an instruction raised.
    pub raised: Option<u32>,
    /// Address of an access that failed.
    pub fault_address: u32,
    /// Address of an access that the memory bus or the protection unit rejected.
    pub refused: Option<u32>,
    /// Active exceptions; the innermost exception is the last element.
    pub contexts: Vec<usize>,
}

/// The chip around the core, with its peripherals.
pub struct Chip {
    /// State of the core.
    pub core: Core,
    /// Class of each instruction in memory.
    pub code: Code,
    /// Interrupt controller.
    pub nvic: Nvic,
    /// Registers of the core.
    pub scs: Scs,
    /// Clock and reset control.
    pub rcc: Rcc,
    /// Pins of the chip.
    pub gpio: Gpio,
    /// Edge detection of pins.
    pub exti: Exti,
    /// DMA controllers DMA1 and DMA2.
    pub dma: Dma,
    /// Timers TIM2 to TIM7.
    pub timers: [Timer; 6],
    /// Serial ports USART2 and USART3.
    pub usarts: [Usart; 2],
    /// FDCAN1 and the joint bus.
    pub fdcan: Fdcan,
    /// Bank 2 of the flash.
    pub flash: Flash,
    /// Independent watchdog.
    pub iwdg: Iwdg,
    /// Observers that measure the running firmware.
    pub observers: Observers,
    plain: Plain,
    /// Accesses to registers that the emulator does not model, by address.
    pub unknown: BTreeMap<u32, Access>,
    /// Accesses to peripherals whose clock is off.
    pub unclocked: BTreeMap<u32, Access>,
    /// `true` if the firmware may have switched blocks of D2 SRAM on or off, so that the memory must be mapped again.
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
            flash: Flash::default(),
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
    /// Returns the virtual time.
    #[inline]
    pub fn now(&self) -> Time {
        self.base_time + (self.core.instructions - self.base_instructions) * self.cycle
    }

    /// Returns the number of core clock cycles since power-on, including sleep.
    pub fn cycles(&self) -> u64 {
        self.base_cycles + (self.core.instructions - self.base_instructions)
    }

    /// Returns the length of a core clock period.
    pub fn cycle(&self) -> Time {
        self.cycle
    }

    fn rebase(&mut self) {
        self.base_time = self.now();
        self.base_cycles = self.cycles();
        self.base_instructions = self.core.instructions;
    }

    /// Lets the core sleep until `time`.
    pub fn sleep_until(&mut self, time: Time) {
        self.rebase();
        if time > self.base_time {
            self.base_cycles += (time - self.base_time) / self.cycle;
            self.base_time = time;
        }
    }

    /// Passes the clock frequencies, as configured in the RCC registers, to the peripherals.
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

    /// Resets the core and all peripherals, but not the memory, and sets these reset flags.
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
        self.flash.reset(now);
        self.iwdg.reset();
        self.plain = Plain::default();
        self.code.forget_itcm();
        let instructions = self.core.instructions;
        self.core = Core { instructions, ..Core::default() };
        self.remap = true;
        self.update_clocks();
    }

    /// Drives a pin from outside the chip; with `None`, the pin is not connected. EXTI detects the edges of the pin.
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

    /// Executes all events of the peripherals that are due, and updates the interrupt lines.
    pub fn advance(&mut self, memory: &mut dyn Memory) {
        let now = self.now();
        for timer in &mut self.timers {
            timer.advance(now);
        }
        for usart in &mut self.usarts {
            usart.advance(now, &mut self.dma, memory);
        }
        self.fdcan.advance(now);
        self.flash.advance(now);
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

    /// Returns the time of the next event that does not depend on the core.
    pub fn next_event(&self) -> Time {
        let timers = self.timers.iter().map(Timer::next_event);
        let usarts = self.usarts.iter().map(|u| u.next_event(&self.dma));
        let wrap = self.scs.next_wrap();
        let systick =
            if wrap == NEVER { NEVER } else { self.now() + wrap.saturating_sub(self.cycles()) * self.cycle };
        let others = [self.fdcan.next_event(), self.iwdg.bites(), systick];
        timers.chain(usarts).chain(others).min().unwrap_or(NEVER)
    }

    /// Returns the state of the power supply: the PWR register CR3, and the VOS code of D3CR, which is the voltage
    /// scale.
    pub fn supply(&self) -> (u32, u32) {
        (self.plain.read(PWR + 0x0C), self.plain.read(PWR + 0x18) >> 14 & 3)
    }

    /// Returns the virtual time in microseconds.
    pub fn now_us(&self) -> u64 {
        self.now() / MICROSECOND
    }
}
