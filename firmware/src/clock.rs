//! The clock tree and the rates derived from it: 85 MHz for the joint bus, 1 kHz for the tick, 15 MBd for the serial
//! lines.
//!
//! All clocks are derived from the 8 MHz clock of the ST-LINK (bypass), because CAN FD needs a more accurate clock than
//! the internal oscillator.
use jtc_bus::timing;

/// Frequency at OSC_IN, Hz.
pub const HSE_HZ: u32 = 8_000_000;

/// `true` if Vcore comes from the SMPS, which is the wiring of a new board. With the SMPS, the highest voltage scale
/// and the highest frequency are not permitted.
pub const SMPS: bool = cfg!(feature = "nucleo-h745zi-q");

/// Settings of an output of a phase-locked loop.
#[derive(Clone, Copy, Debug)]
pub struct Pll {
    /// Divider of the PLL's input clock.
    pub m: u32,
    /// Multiplier of the PLL.
    pub n: u32,
    /// Divider of the PLL's output clock.
    pub divide: u32,
}

impl Pll {
    /// Returns the frequency of the PLL's oscillator, Hz.
    pub const fn vco(&self) -> u32 {
        HSE_HZ / self.m * self.n
    }

    /// Returns the frequency of the PLL's output, Hz.
    pub const fn hz(&self) -> u32 {
        self.vco() / self.divide
    }

    /// Returns `true` if the settings satisfy the rules of the reference manual for the wide-range oscillator and every
    /// division is exact.
    const fn valid(&self) -> bool {
        let reference = HSE_HZ / self.m;
        HSE_HZ.is_multiple_of(self.m)
            && reference >= 2_000_000
            && reference <= 4_000_000
            && self.n >= 4
            && self.n <= 512
            && self.vco() >= 192_000_000
            && self.vco() <= 960_000_000
            && self.vco().is_multiple_of(self.divide)
    }
}

/// PLL1, whose output P is the clock of the core.
pub const CORE: Pll = Pll { m: 4, n: if SMPS { 400 } else { 480 }, divide: 2 };
/// PLL2, whose output Q is the clock of the CAN controller.
pub const CAN: Pll = Pll { m: 4, n: 170, divide: 4 };
/// PLL3, whose output Q is the clock of both serial lines.
pub const SERIAL: Pll = Pll { m: 4, n: 180, divide: 3 };

/// Frequency of the core, Hz.
pub const CORE_HZ: u32 = CORE.hz();
/// Frequency of buses and memories, which is half of the core frequency.
pub const AHB_HZ: u32 = CORE_HZ / 2;
/// Frequency of the peripherals, which is half of the frequency of buses and memories.
pub const APB_HZ: u32 = AHB_HZ / 2;
/// Frequency of the timers, which is twice the frequency of their peripheral bus.
pub const TIMER_HZ: u32 = 2 * APB_HZ;

/// Ticks of the controller per second.
pub const TICK_HZ: u32 = 1_000;
/// Prescaler of TIM7, so that TIM7 counts microseconds.
pub const TICK_PRESCALER: u32 = TIMER_HZ / 1_000_000;
/// Duration of a tick, µs.
pub const TICK_US: u32 = 1_000_000 / TICK_HZ;

const _: () = {
    assert!(CORE.valid() && CAN.valid() && SERIAL.valid());
    // Highest frequencies that are permitted for the voltage scale. The scale is VOS1 with the SMPS and VOS0 with the
    // LDO.
    assert!(CORE_HZ <= if SMPS { 400_000_000 } else { 480_000_000 });
    assert!(APB_HZ <= if SMPS { 100_000_000 } else { 120_000_000 });
    assert!(CAN.hz() == timing::KERNEL_CLOCK_HZ && CAN.hz() <= APB_HZ);
    assert!(timing::NOMINAL.bit_rate(CAN.hz()) == timing::NOMINAL_BIT_RATE);
    assert!(timing::DATA.bit_rate(CAN.hz()) == timing::DATA_BIT_RATE);
    assert!(TICK_PRESCALER * 1_000_000 == TIMER_HZ && TICK_PRESCALER <= 65_536);
    assert!(TICK_US * TICK_HZ == 1_000_000 && TICK_US <= 65_536);
    assert!(SERIAL.hz() == 8 * 15_000_000);
};

/// Settings of a USART for a baud rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Baud {
    /// Value of the register BRR.
    pub brr: u32,
    /// `true` if the USART oversamples by 8, otherwise by 16.
    pub over8: bool,
}

impl Baud {
    /// Returns the settings for `rate` Bd. Returns `None` if the clock cannot produce the rate within 1 %.
    pub const fn new(rate: u32) -> Option<Self> {
        let clock = SERIAL.hz();
        if rate == 0 || rate > clock / 8 {
            return None;
        }
        let over8 = rate > clock / 16;
        let divided = if over8 { 2 * clock } else { clock };
        let divider = (divided + rate / 2) / rate;
        let actual = divided / divider;
        let error = actual.abs_diff(rate);
        if divider < 16 || divider > 0xFFFF || error > rate / 100 {
            return None;
        }
        // With oversampling by 8, the lowest four bits of the divider are shifted right by one.
        let brr = if over8 { divider & 0xFFF0 | (divider & 0xF) >> 1 } else { divider };
        Some(Self { brr, over8 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes the baud rate of a serial line with the formula of the reference manual.
    fn rate(baud: Baud) -> f64 {
        let clock = f64::from(SERIAL.hz());
        if baud.over8 {
            2.0 * clock / f64::from(baud.brr & 0xFFF0 | (baud.brr & 0x7) << 1)
        } else {
            clock / f64::from(baud.brr)
        }
    }

    #[test]
    fn j01_every_standard_rate_up_to_15_mbd() {
        let rates = [
            9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000, 3_000_000,
        ];
        for wanted in
            rates.into_iter().chain([4_000_000, 6_000_000, 7_500_000, 8_000_000, 12_000_000, 15_000_000])
        {
            let baud = Baud::new(wanted).unwrap_or_else(|| panic!("{wanted} Bd"));
            let error = rate(baud) / f64::from(wanted) - 1.0;
            // The total error of both ends of a serial line may be about 3 %, so at most 1 % is permitted for each end.
            assert!(error.abs() < 0.01, "{wanted} Bd: {error}");
        }
        assert_eq!(Baud::new(15_000_000), Some(Baud { brr: 0x10, over8: true }));
        assert_eq!(Baud::new(115_200), Some(Baud { brr: 1042, over8: false }));
        assert_eq!((Baud::new(0), Baud::new(15_000_001), Baud::new(1000)), (None, None, None));
    }

    #[test]
    fn j10_kernel_clock_of_the_bus() {
        assert_eq!(CAN.hz(), 85_000_000);
        assert_eq!(CORE_HZ, if SMPS { 400_000_000 } else { 480_000_000 });
    }
}
