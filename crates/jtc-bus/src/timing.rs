//! Bit timing of the bus (J-10), in the terminology of a Bosch M_CAN (the FDCAN of the STM32).
//!
//! A bit has 17 time quanta in both phases, with the sample point after the 13th quantum. The kernel clock is 85 MHz.

/// Kernel clock of the CAN controller, Hz.
pub const KERNEL_CLOCK_HZ: u32 = 85_000_000;

/// Bit timing in periods of the kernel clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Kernel clock periods per time quantum.
    pub prescaler: u16,
    /// Time quanta from the end of the synchronisation quantum to the sample point, including the propagation segment.
    pub segment1: u8,
    /// Time quanta after the sample point.
    pub segment2: u8,
    /// Highest number of quanta that a resynchronisation may add to the bit or remove from it.
    pub jump_width: u8,
}

impl BitTiming {
    /// Returns the number of time quanta in a bit, which is the synchronisation quantum plus both segments.
    pub const fn quanta(&self) -> u32 {
        1 + self.segment1 as u32 + self.segment2 as u32
    }

    /// Returns the bit rate in bit/s for a kernel clock in Hz.
    pub const fn bit_rate(&self, clock_hz: u32) -> u32 {
        clock_hz / (self.prescaler as u32 * self.quanta())
    }

    /// Returns the number of quanta from the start of the bit to the sample point.
    pub const fn sample_point(&self) -> u32 {
        1 + self.segment1 as u32
    }

    /// Returns the timing for a bit rate with 17 quanta and the sample point at 13/17.
    const fn at(bit_rate: u32) -> Self {
        let prescaler = KERNEL_CLOCK_HZ / (17 * bit_rate);
        assert!(prescaler * 17 * bit_rate == KERNEL_CLOCK_HZ, "the clock is no multiple of this bit rate");
        assert!(prescaler >= 1 && prescaler <= 512);
        Self { prescaler: prescaler as u16, segment1: 12, segment2: 4, jump_width: 2 }
    }
}

/// Bit rate outside the data phase, bit/s.
pub const NOMINAL_BIT_RATE: u32 = 1_000_000;
/// Bit rate in the data phase, bit/s.
pub const DATA_BIT_RATE: u32 = 5_000_000;
/// Bit timing outside the data phase.
pub const NOMINAL: BitTiming = BitTiming::at(NOMINAL_BIT_RATE);
/// Bit timing in the data phase.
pub const DATA: BitTiming = BitTiming::at(DATA_BIT_RATE);
/// Offset of the transmitter delay compensation, in kernel clock periods: the time from the measured loop delay to the secondary sample
/// point. With this offset the secondary sample point is at the same position in the bit as the sample point of the receivers.
pub const TDC_OFFSET: u8 = {
    // The CAN controller supports the transmitter delay compensation only with prescalers 1 and 2.
    assert!(DATA.prescaler <= 2);
    let offset = DATA.prescaler as u32 * DATA.sample_point();
    assert!(offset <= 127);
    offset as u8
};
/// Window of the filter for the measured loop delay. The value 0 switches this filter off.
pub const TDC_FILTER: u8 = 0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j10_prescalers_and_segments() {
        assert_eq!(NOMINAL, BitTiming { prescaler: 5, segment1: 12, segment2: 4, jump_width: 2 });
        assert_eq!(DATA, BitTiming { prescaler: 1, segment1: 12, segment2: 4, jump_width: 2 });
    }

    #[test]
    fn j10_rates_and_sample_points() {
        for (timing, rate) in [(NOMINAL, 1_000_000), (DATA, 5_000_000)] {
            assert_eq!(timing.bit_rate(85_000_000), rate);
            assert_eq!((timing.sample_point(), timing.quanta()), (13, 17));
        }
        assert_eq!(TDC_OFFSET, 13);
    }
}
