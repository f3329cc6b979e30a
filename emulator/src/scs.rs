//! The registers of the core itself, at address 0xE000_0000: system control block, NVIC, SysTick, MPU, debug cycle
//! counter (ARMv7-M B3).
use crate::clock::{NEVER, Time};
use crate::nvic::{EXCEPTIONS, FIRST_LINE, Nvic, exception};
use crate::plain::Plain;

/// Value of CPUID for a Cortex-M7 r1p1.
const CPUID: u32 = 0x411F_C271;
const AIRCR_KEY: u32 = 0x05FA;
/// CCSIDR of a 16 KiB data cache: 128 sets, 4 ways, 32-byte lines.
const CCSIDR_DATA: u32 = 0xF00F_E019;
/// CCSIDR of a 16 KiB instruction cache: 256 sets, 2 ways, 32-byte lines.
const CCSIDR_INSTRUCTION: u32 = 0xF01F_E009;
/// Bits ICSR.PENDSTSET and ICSR.PENDSVSET.
const PEND_ST: u32 = 1 << 26;
const PEND_SV: u32 = 1 << 28;
const MPU_CTRL: u32 = 0xE000_ED94;

/// The timer SysTick, which counts core clock cycles.
#[derive(Default)]
pub struct SysTick {
    ctrl: u32,
    load: u32,
    /// Cycle count at which VAL had the reload value.
    start: u64,
    /// Cycle count at which SysTick reloads next.
    wrap: u64,
    wrapped: bool,
}

/// The registers of the core itself.
#[derive(Default)]
pub struct Scs {
    /// Address of the vector table.
    pub vtor: u32,
    /// Register SCR with bit 4 (SEVONPEND) and bit 1 (SLEEPONEXIT).
    pub scr: u32,
    /// Value of register CPACR.
    pub cpacr: u32,
    /// Value of CFSR after the last fault.
    pub cfsr: u32,
    /// Value of HFSR after the last fault.
    pub hfsr: u32,
    /// Value of BFAR after the last fault.
    pub bfar: u32,
    csselr: u32,
    ccr: u32,
    mpu_rnr: u32,
    mpu: [(u32, u32); 16],
    systick: SysTick,
    cyccnt_base: u64,
    cyccnt_on: bool,
    /// `true` if the program wrote SYSRESETREQ.
    pub reset_request: bool,
    plain: Plain,
}

/// Access rights that the memory protection unit grants for an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protection {
    /// `true` if the access is permitted.
    pub allowed: bool,
    /// `true` if the core may cache or prefetch the memory.
    pub ahead: bool,
}

/// Time of an access, in cycles and in instructions, and the running exception.
#[derive(Clone, Copy)]
pub struct Moment {
    /// Virtual time.
    pub now: Time,
    /// Number of core clock cycles, including sleep.
    pub cycles: u64,
    /// Number of instructions that the core has executed.
    pub instructions: u64,
    /// Number of the running exception.
    pub running: usize,
}

impl Scs {
    /// Reads a register of the core.
    pub fn read(&mut self, address: u32, nvic: &Nvic, at: Moment) -> u32 {
        match address {
            0xE000_1004 if self.cyccnt_on => at.instructions.wrapping_sub(self.cyccnt_base) as u32,
            0xE000_E004 => (LINES_WORDS - 1) as u32,
            0xE000_E010 => {
                let flag = u32::from(core::mem::take(&mut self.systick.wrapped)) << 16;
                self.systick.ctrl | flag
            }
            0xE000_E014 => self.systick.load,
            0xE000_E018 => self.systick.value(at.cycles),
            0xE000_E01C => 0xC000_0000,
            0xE000_E100..0xE000_E400 => nvic_bits(nvic, address),
            0xE000_E400..0xE000_E500 => priorities(nvic, FIRST_LINE + (address - 0xE000_E400) as usize),
            0xE000_ED00 => CPUID,
            0xE000_ED04 => {
                let pend = |e: usize, bit: u32| if nvic.is_pending(e) { bit } else { 0 };
                at.running as u32
                    | (nvic.vect_pending() as u32) << 12
                    | pend(exception::SYS_TICK, PEND_ST)
                    | pend(exception::PEND_SV, PEND_SV)
                    | u32::from(nvic.any_waiting()) << 22
            }
            0xE000_ED08 => self.vtor,
            0xE000_ED0C => 0xFA05_0000 | nvic.prigroup << 8,
            0xE000_ED10 => self.scr,
            0xE000_ED14 => self.ccr | 0x0004_0200,
            0xE000_ED18..0xE000_ED24 => priorities(nvic, 4 + (address - 0xE000_ED18) as usize),
            0xE000_ED28 => self.cfsr,
            0xE000_ED2C => self.hfsr,
            0xE000_ED38 => self.bfar,
            0xE000_ED78 => 0x0900_0003,
            0xE000_ED7C => 0x8303_C003,
            0xE000_ED80 => {
                if self.csselr & 1 == 1 {
                    CCSIDR_INSTRUCTION
                } else {
                    CCSIDR_DATA
                }
            }
            0xE000_ED84 => self.csselr,
            0xE000_ED88 => self.cpacr,
            0xE000_ED90 => 0x1000,
            0xE000_ED98 => self.mpu_rnr,
            0xE000_ED9C => self.mpu[self.mpu_rnr as usize & 15].0,
            0xE000_EDA0 => self.mpu[self.mpu_rnr as usize & 15].1,
            _ => self.plain.read(address),
        }
    }

    /// Writes a register of the core.
    pub fn write(&mut self, address: u32, value: u32, nvic: &mut Nvic, at: Moment) {
        match address {
            0xE000_1000 => {
                self.cyccnt_on = value & 1 == 1;
                self.plain.write(address, value);
            }
            0xE000_1004 => self.cyccnt_base = at.instructions.wrapping_sub(u64::from(value)),
            0xE000_E010 => self.systick.control(value & 7, at.cycles),
            0xE000_E014 => self.systick.load = value & 0xFF_FFFF,
            0xE000_E018 => self.systick.restart(at.cycles),
            0xE000_E100..0xE000_E400 => set_nvic_bits(nvic, address, value, at.now),
            0xE000_E400..0xE000_E500 => {
                set_priorities(nvic, FIRST_LINE + (address - 0xE000_E400) as usize, value);
            }
            0xE000_ED04 => {
                for (bit, e) in [(26, exception::SYS_TICK), (28, exception::PEND_SV), (31, exception::NMI)] {
                    if value >> bit & 1 == 1 {
                        nvic.pend(e, at.now);
                    }
                }
                for (bit, e) in [(25, exception::SYS_TICK), (27, exception::PEND_SV)] {
                    if value >> bit & 1 == 1 {
                        nvic.unpend(e);
                    }
                }
            }
            0xE000_ED08 => self.vtor = value & !0x7F,
            0xE000_ED0C if value >> 16 == AIRCR_KEY => {
                nvic.prigroup = value >> 8 & 7;
                self.reset_request |= value & 4 != 0;
            }
            0xE000_ED0C => {}
            0xE000_ED10 => self.scr = value,
            0xE000_ED14 => self.ccr = value,
            0xE000_ED18..0xE000_ED24 => {
                set_priorities(nvic, 4 + (address - 0xE000_ED18) as usize, value);
            }
            0xE000_ED28 => self.cfsr &= !value,
            0xE000_ED2C => self.hfsr &= !value,
            0xE000_ED84 => self.csselr = value,
            0xE000_ED88 => self.cpacr = value,
            0xE000_ED98 => self.mpu_rnr = value & 0xFF,
            0xE000_ED9C => {
                if value & 0x10 != 0 {
                    self.mpu_rnr = value & 15;
                }
                self.mpu[self.mpu_rnr as usize & 15].0 = value & !0x1F | self.mpu_rnr & 15;
            }
            0xE000_EDA0 => self.mpu[self.mpu_rnr as usize & 15].1 = value,
            0xE000_EF00 => nvic.pend((FIRST_LINE + (value & 0x1FF) as usize).min(EXCEPTIONS - 1), at.now),
            _ => self.plain.write(address, value),
        }
    }

    /// Returns the MPU regions as (RBAR, RASR). A region is enabled if bit 0 of RASR is set.
    pub fn mpu_regions(&self) -> &[(u32, u32); 16] {
        &self.mpu
    }

    /// Returns the access rights that the memory protection unit grants for a load or store by the program (ARMv7-M
    /// B3.5). `faults_masked` means that FAULTMASK is set, or that HardFault or NMI is running.
    pub fn protection(&self, address: u32, faults_masked: bool) -> Protection {
        const DEFAULT: Protection = Protection { allowed: true, ahead: true };
        let ctrl = self.plain.read(MPU_CTRL);
        let (on, with_faults_masked, default_elsewhere) = (ctrl & 1, ctrl >> 1 & 1, ctrl >> 2 & 1);
        if on == 0 || faults_masked && with_faults_masked == 0 {
            return DEFAULT;
        }
        let holds = |(rbar, rasr): &&(u32, u32)| {
            let (size, start) = (1u64 << ((rasr >> 1 & 31) + 1), u64::from(rbar & !31));
            let offset = u64::from(address).checked_sub(start).filter(|offset| *offset < size);
            let left_out = |offset: u64| size >= 256 && rasr >> (8 + offset * 8 / size) & 1 == 1;
            rasr & 1 == 1 && offset.is_some_and(|offset| !left_out(offset))
        };
        let Some((_, rasr)) = self.mpu.iter().rev().find(holds) else {
            return Protection { allowed: default_elsewhere == 1, ..DEFAULT };
        };
        let (tex, c, b) = (rasr >> 19 & 7, rasr >> 17 & 1, rasr >> 16 & 1);
        // `true` for strongly ordered memory and device memory. The model does not distinguish read-only from
        // writable regions.
        let in_order = matches!((tex, c, b), (0, 0, _) | (2, 0, 0));
        Protection { allowed: rasr >> 24 & 7 != 0, ahead: !in_order }
    }

    /// Returns `true` if the core ignores bus faults of loads and stores while faults are masked (CCR.BFHFNMIGN).
    pub fn ignores_bus_faults(&self) -> bool {
        self.ccr >> 8 & 1 == 1
    }

    /// Returns the cycle count of the next wrap of SysTick.
    pub fn next_wrap(&self) -> u64 {
        if self.systick.ctrl & 1 == 1 { self.systick.wrap } else { NEVER }
    }

    /// Advances SysTick to a cycle count.
    pub fn advance(&mut self, cycles: u64, now: Time, nvic: &mut Nvic) {
        let tick = &mut self.systick;
        while tick.ctrl & 1 == 1 && tick.wrap <= cycles {
            tick.wrapped = true;
            tick.start = tick.wrap;
            tick.wrap += u64::from(tick.load) + 1;
            if tick.ctrl & 2 != 0 {
                nvic.pend(exception::SYS_TICK, now);
            }
        }
    }
}

impl SysTick {
    fn control(&mut self, value: u32, cycles: u64) {
        if value & 1 == 1 && self.ctrl & 1 == 0 {
            self.restart(cycles);
        }
        self.ctrl = value;
    }

    fn restart(&mut self, cycles: u64) {
        self.wrapped = false;
        self.start = cycles;
        self.wrap = cycles + u64::from(self.load) + 1;
    }

    fn value(&self, cycles: u64) -> u32 {
        if self.ctrl & 1 == 0 {
            return 0;
        }
        self.load.saturating_sub(cycles.saturating_sub(self.start) as u32)
    }
}

const LINES_WORDS: usize = 5;

/// Returns the bits of a word in the enable, pending and active registers, each with its exception number.
fn word_lines(address: u32) -> impl Iterator<Item = (u32, usize)> {
    let first = FIRST_LINE + ((address & 0x7F) as usize / 4) * 32;
    (0..32).map(move |bit| (bit, first + bit as usize)).filter(|&(_, e)| e < EXCEPTIONS)
}

fn nvic_bits(nvic: &Nvic, address: u32) -> u32 {
    let bits = word_lines(address).filter(|&(_, e)| match address {
        0xE000_E100..0xE000_E200 => nvic.is_enabled(e),
        0xE000_E200..0xE000_E300 => nvic.is_pending(e),
        _ => nvic.is_active(e),
    });
    bits.fold(0, |word, (bit, _)| word | 1 << bit)
}

fn set_nvic_bits(nvic: &mut Nvic, address: u32, value: u32, now: Time) {
    for (_, e) in word_lines(address).filter(|&(bit, _)| value >> bit & 1 == 1) {
        match address & 0xF80 {
            0x100 => nvic.enable(e, true),
            0x180 => nvic.enable(e, false),
            0x200 => nvic.pend(e, now),
            0x280 => nvic.unpend(e),
            _ => {}
        }
    }
}

fn priorities(nvic: &Nvic, first: usize) -> u32 {
    let first = first & !3;
    (0..4)
        .filter(|i| first + i < EXCEPTIONS)
        .fold(0, |w, i| w | u32::from(nvic.priority(first + i)) << (8 * i))
}

fn set_priorities(nvic: &mut Nvic, first: usize, value: u32) {
    let first = first & !3;
    for i in (0..4).filter(|i| first + i < EXCEPTIONS) {
        nvic.set_priority(first + i, (value >> (8 * i)) as u8);
    }
}
