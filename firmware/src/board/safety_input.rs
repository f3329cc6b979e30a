//! The safety input with its edges: the next tick detects a pulse between two ticks (J-22).
use embassy_stm32::gpio::{Input, Pin, Pull};
use embassy_stm32::{Peri, pac};

/// The pin, and the EXTI line of the same number that latches its falling edges.
///
/// RM0399, EXTI: a falling edge of the pin that SYSCFG_EXTICR selects for the line sets its bit in EXTI_C1PR1, within
/// nanoseconds and without the processor, until a 1 is written to it. The line is unmasked in EXTI_C1IMR1, because pending
/// bits of masked lines are not promised; its interrupt stays disabled in the NVIC, and the tick polls the bit.
pub struct SafetyInput {
    pin: Input<'static>,
    /// Bit of the line in the registers of EXTI.
    mask: u32,
}

impl SafetyInput {
    /// Pulled down, so that a broken wire is an error.
    pub fn new(pin: Peri<'static, impl Pin>) -> Self {
        let line = usize::from(pin.pin());
        let port = pin.port();
        let pin = Input::new(pin, Pull::Down);
        // SYSCFG has a clock to enable (RCC_APB4ENR); EXTI has none.
        pac::RCC.apb4enr().modify(|w| w.set_syscfgen(true));
        // Reading back makes sure that the clock runs.
        pac::RCC.apb4enr().read();
        pac::SYSCFG.exticr(line / 4).modify(|w| w.set_exti(line % 4, port));
        pac::EXTI.ftsr(0).modify(|w| w.set_line(line, true));
        pac::EXTI.imr(0).modify(|w| w.set_line(line, true));
        let mut input = Self { pin, mask: 1 << (line % 16) };
        // A falling edge from the time before the pin was an input does not count.
        input.take_edge();
        input
    }

    /// Returns `true` if the level is 1 now and has been 1 since the last call.
    pub fn is_safe(&mut self) -> bool {
        // Reads the edge first: if an edge comes between the two reads, the level or the next call shows it.
        let edge = self.take_edge();
        !edge && self.pin.is_high()
    }

    /// Returns `true` if there was a falling edge since the last call.
    fn take_edge(&mut self) -> bool {
        // A mask, because an index is bounds-checked and the tick must contain no panic path.
        let edges = pac::EXTI.pr(0).read().0 & self.mask;
        // A 1 clears its bit and leaves the others.
        pac::EXTI.pr(0).write(|w| w.0 = edges);
        edges != 0
    }
}
