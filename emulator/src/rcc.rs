//! Reset and clock control (RM0399 chapter 9): the clock tree, enable and reset bits, reset flags. This module also
//! contains the bits of PWR on which clocks depend.
use crate::plain::Plain;

const HSI_HZ: u64 = 64_000_000;
const CSI_HZ: u64 = 4_000_000;

/// Register offsets of the RCC.
mod reg {
    pub const CR: u32 = 0x00;
    pub const CFGR: u32 = 0x10;
    pub const D1CFGR: u32 = 0x18;
    pub const D2CFGR: u32 = 0x1C;
    pub const PLLCKSELR: u32 = 0x28;
    pub const PLLCFGR: u32 = 0x2C;
    pub const PLL1DIVR: u32 = 0x30;
    pub const PLL1FRACR: u32 = 0x34;
    pub const D2CCIP1R: u32 = 0x50;
    pub const D2CCIP2R: u32 = 0x54;
    pub const BDCR: u32 = 0x70;
    pub const CSR: u32 = 0x74;
    pub const AHB3RSTR: u32 = 0x7C;
    pub const APB4RSTR: u32 = 0x9C;
    pub const RSR: u32 = 0xD0;
    pub const AHB1ENR: u32 = 0xD8;
    pub const AHB2ENR: u32 = 0xDC;
    pub const AHB4ENR: u32 = 0xE0;
    pub const APB1LENR: u32 = 0xE8;
    pub const APB1HENR: u32 = 0xEC;
    /// Address range of the register copies for core 1, and the offset between a copy and the common register.
    pub const C1: core::ops::Range<u32> = 0x130..0x190;
    pub const C1_OFFSET: u32 = 0x60;
}

/// Reset flags of RSR.
pub mod flag {
    /// Reset of core 1.
    pub const CPU: u32 = 1 << 17;
    /// Reset of domain D1.
    pub const D1: u32 = 1 << 19;
    /// Reset of domain D2.
    pub const D2: u32 = 1 << 20;
    /// Brown-out reset.
    pub const BOR: u32 = 1 << 21;
    /// Reset by the NRST pin.
    pub const PIN: u32 = 1 << 22;
    /// Power-on reset.
    pub const POR: u32 = 1 << 23;
    /// Core 1 requested a software reset.
    pub const SFT: u32 = 1 << 24;
    /// Reset by independent watchdog 1.
    pub const IWDG1: u32 = 1 << 26;
    /// Bit RMVF. Writing a 1 to this bit clears all reset flags.
    pub const REMOVE: u32 = 1 << 16;
    /// All reset flags.
    pub const ALL: u32 = 0xFFFE_0000;
}

/// Peripheral with its own clock enable bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// DMA1 or DMA2, with an index from 0.
    Dma(u32),
    /// GPIO port, with an index from 0; port A has index 0.
    Gpio(u32),
    /// Timer TIM2 to TIM7, with its number.
    Timer(u32),
    /// USART2 or USART3, with its number.
    Usart(u32),
    /// FDCAN controller.
    Fdcan,
    /// SRAM1 to SRAM3 of domain D2, with its number.
    Sram(u32),
}

impl Gate {
    /// Returns the offset of the enable register and the bit of the peripheral.
    fn place(self) -> (u32, u32) {
        match self {
            Self::Dma(n) => (reg::AHB1ENR, n),
            Self::Gpio(n) => (reg::AHB4ENR, n),
            Self::Timer(n) => (reg::APB1LENR, n - 2),
            Self::Usart(n) => (reg::APB1LENR, n + 15),
            Self::Fdcan => (reg::APB1HENR, 8),
            Self::Sram(n) => (reg::AHB2ENR, 28 + n),
        }
    }
}

/// Clock frequencies that the registers configure, Hz; 0 for a clock that is off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clocks {
    /// Clock of the core.
    pub core: u64,
    /// Clock of the AHB.
    pub hclk: u64,
    /// Clock of the APB1.
    pub pclk1: u64,
    /// Clock of TIM2..7.
    pub timers: u64,
    /// Kernel clock of USART2 and USART3.
    pub usart: u64,
    /// Kernel clock of FDCAN.
    pub fdcan: u64,
}

/// Reset and clock control.
pub struct Rcc {
    plain: Plain,
    /// Frequency at OSC_IN, Hz.
    hse_hz: u64,
    rsr: u32,
    clocks: Clocks,
    /// Peripherals whose reset bit the program has set since the list was last read.
    pub resets: Vec<Gate>,
}

impl Rcc {
    /// Creates the RCC in its state after power-on, with a clock at OSC_IN.
    pub fn new(hse_hz: u64) -> Self {
        let rsr = flag::POR | flag::PIN | flag::BOR | flag::D1 | flag::D2 | flag::CPU;
        let mut rcc =
            Self { plain: Plain::default(), hse_hz, rsr, clocks: Clocks::default(), resets: Vec::new() };
        rcc.defaults();
        rcc
    }

    fn defaults(&mut self) {
        for (offset, value) in [
            (reg::CR, 0xC001),
            (reg::PLLCKSELR, 0x0202_0200),
            (reg::PLLCFGR, 0x01FF_0000),
            (reg::PLL1DIVR, 0x0101_0280),
            (reg::PLL1DIVR + 8, 0x0101_0280),
            (reg::PLL1DIVR + 16, 0x0101_0280),
        ] {
            self.plain.write(offset, value);
        }
        self.update();
    }

    /// Resets the RCC, and sets the flags of the reset cause in addition to the existing flags.
    pub fn reset(&mut self, flags: u32) {
        self.plain = Plain::default();
        self.rsr |= flags;
        self.defaults();
    }

    /// Returns the value of RSR, which contains the reset flags.
    pub fn reset_flags(&self) -> u32 {
        self.rsr
    }

    /// Returns all clock frequencies.
    pub fn clocks(&self) -> Clocks {
        self.clocks
    }

    /// Returns `true` if the clock of the peripheral is enabled.
    pub fn enabled(&self, gate: Gate) -> bool {
        let (offset, bit) = gate.place();
        self.plain.read(offset) >> bit & 1 == 1
    }

    /// Reads a register of the RCC.
    pub fn read(&self, offset: u32) -> u32 {
        let offset = if reg::C1.contains(&offset) { offset - reg::C1_OFFSET } else { offset };
        let value = self.plain.read(offset);
        match offset {
            // Each oscillator (HSI, CSI, HSI48, HSE, PLL1..3) is ready as soon as it is switched on. The ready flags
            // of HSIDIV and of the domains are always set.
            reg::CR => {
                let ready = (value & 1) << 2
                    | (value >> 7 & 1) << 8
                    | (value >> 12 & 1) << 13
                    | (value >> 16 & 1) << 17
                    | (value & 0x1500_0000) << 1;
                value & !0x2A02_2124 | ready | 0xC020
            }
            reg::CFGR => value & !0x38 | (value & 7) << 3,
            reg::BDCR | reg::CSR => value & !2 | (value & 1) << 1,
            reg::RSR => self.rsr,
            _ => value,
        }
    }

    /// Writes a register of the RCC.
    pub fn write(&mut self, offset: u32, value: u32) {
        let offset = if reg::C1.contains(&offset) { offset - reg::C1_OFFSET } else { offset };
        if offset == reg::RSR {
            if value & flag::REMOVE != 0 {
                self.rsr = 0;
            }
            return;
        }
        if (reg::AHB3RSTR..=reg::APB4RSTR).contains(&offset) {
            self.note_resets(offset, value & !self.plain.read(offset));
        }
        self.plain.write(offset, value);
        if offset <= reg::D2CCIP2R {
            self.update();
        }
    }

    fn note_resets(&mut self, offset: u32, rising: u32) {
        // The bits of a reset register have the same order as the bits of its enable register.
        let enable = match offset {
            0x80 => reg::AHB1ENR,
            0x88 => reg::AHB4ENR,
            0x90 => reg::APB1LENR,
            0x94 => reg::APB1HENR,
            _ => return,
        };
        let all = (0..2)
            .map(Gate::Dma)
            .chain((0..11).map(Gate::Gpio))
            .chain((2..8).map(Gate::Timer))
            .chain((2..4).map(Gate::Usart))
            .chain([Gate::Fdcan]);
        let hit = all.filter(|gate| {
            let (register, bit) = gate.place();
            register == enable && rising >> bit & 1 == 1
        });
        self.resets.extend(hit);
    }

    /// Returns the frequency of PLL `n` (0..3) at its output P, Q or R (`output` 0..3).
    fn pll(&self, n: u32, output: u32) -> u64 {
        let cr = self.plain.read(reg::CR);
        let select = self.plain.read(reg::PLLCKSELR);
        let config = self.plain.read(reg::PLLCFGR);
        let divr = self.plain.read(reg::PLL1DIVR + 8 * n);
        let source = match select & 3 {
            0 => self.hsi(),
            1 => CSI_HZ,
            2 => self.hse_hz,
            _ => 0,
        };
        let m = u64::from(select >> (4 + 8 * n) & 0x3F);
        let on = cr >> (24 + 2 * n) & 1 == 1 && config >> (16 + 3 * n + output) & 1 == 1 && m != 0;
        if !on {
            return 0;
        }
        let fraction = if config >> (4 * n) & 1 == 1 {
            u64::from(self.plain.read(reg::PLL1FRACR + 8 * n) >> 3 & 0x1FFF)
        } else {
            0
        };
        let multiplier = (u64::from(divr & 0x1FF) + 1) * 8192 + fraction;
        let divider = match output {
            0 => divr >> 9 & 0x7F,
            1 => divr >> 16 & 0x7F,
            _ => divr >> 24 & 0x7F,
        };
        source * multiplier / 8192 / m / (u64::from(divider) + 1)
    }

    fn hsi(&self) -> u64 {
        HSI_HZ >> (self.plain.read(reg::CR) >> 3 & 3)
    }

    fn update(&mut self) {
        let cfgr = self.plain.read(reg::CFGR);
        let sys = match cfgr & 7 {
            0 => self.hsi(),
            1 => CSI_HZ,
            2 => self.hse_hz,
            _ => self.pll(0, 0),
        };
        let d1 = self.plain.read(reg::D1CFGR);
        let d2 = self.plain.read(reg::D2CFGR);
        let core = sys / ahb_divider(d1 >> 8 & 15);
        let hclk = core / ahb_divider(d1 & 15);
        let apb1 = apb_divider(d2 >> 4 & 7);
        let pclk1 = hclk / apb1;
        let timers = match (cfgr >> 15 & 1, apb1) {
            (_, 1) => hclk,
            (0, _) => 2 * pclk1,
            (_, 2) => hclk,
            _ => 4 * pclk1,
        };
        let usart = match self.plain.read(reg::D2CCIP2R) & 7 {
            0 => pclk1,
            1 => self.pll(1, 1),
            2 => self.pll(2, 1),
            3 => self.hsi(),
            4 => CSI_HZ,
            _ => 32_768,
        };
        let fdcan = match self.plain.read(reg::D2CCIP1R) >> 28 & 3 {
            0 => self.hse_hz,
            1 => self.pll(0, 1),
            2 => self.pll(1, 1),
            _ => 0,
        };
        self.clocks = Clocks { core, hclk, pclk1, timers, usart, fdcan };
    }
}

/// Returns the divider for a code of HPRE or D1CPRE.
fn ahb_divider(code: u32) -> u64 {
    match code {
        0..=7 => 1,
        8..=11 => 2 << (code - 8),
        _ => 64 << (code - 12),
    }
}

/// Returns the divider for a code of D1PPRE, D2PPRE1 or D2PPRE2.
fn apb_divider(code: u32) -> u64 {
    if code < 4 { 1 } else { 2 << (code - 4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_of_a_board_at_400_mhz() {
        let mut rcc = Rcc::new(8_000_000);
        assert_eq!(rcc.clocks().core, HSI_HZ);
        rcc.write(reg::CR, 0x1501_0001);
        rcc.write(reg::PLLCKSELR, 2 | 4 << 4 | 4 << 12 | 4 << 20);
        rcc.write(reg::PLLCFGR, 0x01FF_0000);
        rcc.write(reg::PLL1DIVR, 399 | 1 << 9 | 7 << 16);
        rcc.write(reg::PLL1DIVR + 8, 169 | 3 << 16);
        rcc.write(reg::D1CFGR, 8);
        rcc.write(reg::D2CFGR, 4 << 4);
        rcc.write(reg::D2CCIP1R, 2 << 28);
        rcc.write(reg::CFGR, 3);
        assert_eq!(rcc.read(reg::CFGR), 3 | 3 << 3);
        let clocks = rcc.clocks();
        assert_eq!((clocks.core, clocks.hclk, clocks.pclk1), (400_000_000, 200_000_000, 100_000_000));
        assert_eq!((clocks.timers, clocks.fdcan), (200_000_000, 85_000_000));
    }

    #[test]
    fn reset_flags_stay_until_removed() {
        let mut rcc = Rcc::new(8_000_000);
        rcc.write(0x130, flag::REMOVE);
        rcc.reset(flag::IWDG1 | flag::CPU);
        assert_eq!(rcc.read(reg::RSR), flag::IWDG1 | flag::CPU);
        rcc.reset(flag::SFT);
        assert_eq!(rcc.read(0x130), flag::IWDG1 | flag::CPU | flag::SFT);
    }
}
