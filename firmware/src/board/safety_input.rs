//! The safety input with edge detection, so that the next tick detects a pulse between two ticks (J-22).
use embassy_stm32::gpio::{Input, Pin, Pull};
use embassy_stm32::{Peri, pac};

/// The pin of the safety input, and the EXTI line with the same number, which latches falling edges of the pin.
///
/// RM0399, EXTI: SYSCFG_EXTICR selects a pin for the EXTI line. A falling edge of the pin sets the bit of the line in
/// EXTI_C1PR1 within nanoseconds, without the processor. The bit remains set until a 1 is written to it. The line is
/// unmasked in EXTI_C1IMR1, because the manual does not guarantee pending bits of masked lines. The interrupt of the
/// EXTI line remains disabled in the NVIC, and the tick polls the bit.
pub struct SafetyInput {
    pin: Input<'static>,
    /// Bit of the EXTI line in the EXTI registers.
    mask: u32,
}

impl SafetyInput {
    /// Configures the safety input. The pin is pulled down, so that a broken wire reads as an error.
    pub fn new(pin: Peri<'static, impl Pin>) -> Self {
        let line = usize::from(pin.pin());
        let port = pin.port();
        let pin = Input::new(pin, Pull::Down);
        // The clock of SYSCFG must be enabled (RCC_APB4ENR); EXTI does not need a clock enable.
        pac::RCC.apb4enr().modify(|w| w.set_syscfgen(true));
        // The read of the clock enable register ensures that the clock of SYSCFG is running.
        pac::RCC.apb4enr().read();
        pac::SYSCFG.exticr(line / 4).modify(|w| w.set_exti(line % 4, port));
        pac::EXTI.ftsr(0).modify(|w| w.set_line(line, true));
        pac::EXTI.imr(0).modify(|w| w.set_line(line, true));
        let mut input = Self { pin, mask: 1 << (line % 16) };
        // Discards a falling edge that occurred before the pin was an input.
        input.take_edge();
        input
    }

    /// Returns `true` if the level of the safety input is 1 and has been 1 since the last call.
    pub fn is_safe(&mut self) -> bool {
        // The edge is read before the level. A falling edge between these two reads is not lost: the read of the
        // level or the next call detects it.
        let edge = self.take_edge();
        !edge && self.pin.is_high()
    }

    /// Returns `true` if the safety input had a falling edge since the last call.
    fn take_edge(&mut self) -> bool {
        // The code uses a bit mask instead of a bit index. For an index, the compiler would add a bounds check with a
        // panic, and the tick must not contain a panic path.
        let edges = pac::EXTI.pr(0).read().0 & self.mask;
        // A write of 1 clears the bit of this EXTI line; the bits of other EXTI lines do not change.
        pac::EXTI.pr(0).write(|w| w.0 = edges);
        edges != 0
    }
}
