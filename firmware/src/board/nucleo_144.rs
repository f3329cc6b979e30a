//! NUCLEO-H743ZI2 (MB1364) with an STM32H743ZI, and NUCLEO-H745ZI-Q (MB1363) with an STM32H745ZI. The STM32H745ZI also
//! has a Cortex-M4, which this firmware does not use. The controller uses the same pins on both boards.
use embassy_stm32::Peripherals;

use super::{Board, Pins, led, receive, transmit};
use crate::uart::Line;

/// Assigns a function to every pin.
pub fn wire(p: Peripherals) -> Board {
    // FDCAN1 is the joint bus.
    receive(p.PD0, 9);
    transmit(p.PD1, 9);
    // USART2 is the RS422 line.
    transmit(p.PD5, 7);
    receive(p.PD6, 7);
    // USART3 is the virtual serial port of the ST-LINK.
    transmit(p.PD8, 7);
    receive(p.PD9, 7);

    let leds = [led(p.PB0), led(p.PE1), led(p.PB14)];
    #[cfg(not(feature = "swapped-safety-pins"))]
    let pins = Pins::new(p.PD3, p.PD4, leds);
    #[cfg(feature = "swapped-safety-pins")]
    let pins = Pins::new(p.PD4, p.PD3, leds);

    Board { lines: [Line::usart2(p.USART2), Line::usart3(p.USART3)], pins, watchdog: p.IWDG1 }
}
