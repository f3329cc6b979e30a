//! Pins, safety wires and LEDs of the boards.
use embassy_stm32::gpio::{AfType, Flex, Output, OutputType, Pin, Pull, Speed};
use embassy_stm32::peripherals::IWDG1;
use embassy_stm32::{Peri, pac};
use jtc_core::ControllerState;

use crate::uart::Line;

mod safety_input;
use safety_input::SafetyInput;

mod nucleo_144;
pub use nucleo_144::wire;

/// A board whose pins are assigned to their functions.
pub struct Board {
    /// The serial lines RS422 and USB.
    pub lines: [Line; 2],
    /// Safety wires and LEDs.
    pub pins: Pins,
    /// Watchdog that the tick feeds.
    pub watchdog: Peri<'static, IWDG1>,
}

/// Safety wires and LEDs.
pub struct Pins {
    /// Safety input: 0 means an error. The pin is pulled down, so that a broken wire reads as an error (J-22).
    pub safety_input: SafetyInput,
    /// Safety output: 0 means an error (J-22).
    pub safety_output: Output<'static>,
    /// The three LEDs of the board: LED1, LED2, LED3.
    pub leds: [Output<'static>; 3],
}

impl Pins {
    /// Configures the pins; `input` and `output` are the pins of the safety wires.
    fn new(
        input: Peri<'static, impl Pin>,
        output: Peri<'static, impl Pin>,
        leds: [Output<'static>; 3],
    ) -> Self {
        Self {
            safety_input: SafetyInput::new(input),
            safety_output: Output::new(output, embassy_stm32::gpio::Level::Low, Speed::Low),
            leds,
        }
    }

    /// Shows the state of the controller on the LEDs as the manual describes.
    pub fn show(&mut self, state: ControllerState) {
        let lit = match state {
            ControllerState::Start => [false, false, false],
            ControllerState::Init => [true, false, false],
            ControllerState::Teaching => [true, true, false],
            ControllerState::HoldPos | ControllerState::Operate => [false, true, false],
            ControllerState::Error => [false, false, true],
        };
        for (led, lit) in self.leds.iter_mut().zip(lit) {
            led.set_level(lit.into());
        }
    }
}

/// Configures an LED pin and switches the LED off.
fn led(pin: Peri<'static, impl Pin>) -> Output<'static> {
    Output::new(pin, embassy_stm32::gpio::Level::Low, Speed::Low)
}

/// Assigns a pin to a peripheral permanently, as an output.
fn transmit(pin: Peri<'static, impl Pin>, function: u8) {
    let mut pin = Flex::new(pin);
    pin.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::High));
    core::mem::forget(pin);
}

/// Like `transmit`, but for an input. The pull-up drives the pin to the level of an idle line, so that an unconnected
/// input does not receive bytes.
fn receive(pin: Peri<'static, impl Pin>, function: u8) {
    let mut pin = Flex::new(pin);
    pin.set_as_af_unchecked(function, AfType::input(Pull::Up));
    core::mem::forget(pin);
}

/// Bit of the safety output in port D; all boards use this pin.
const SAFETY_OUTPUT_BIT: usize = if cfg!(feature = "swapped-safety-pins") { 3 } else { 4 };

/// Drives the safety output to 0 as the first action after a reset, even if the clocks do not start. This is urgent,
/// because the drives may still apply the torque that the program commanded before the reset.
pub fn safety_output_low_at_start() {
    pac::RCC.ahb4enr().modify(|w| w.set_gpioden(true));
    // The read of the clock enable register ensures that the clock of the port is running.
    pac::RCC.ahb4enr().read();
    safety_output_low();
    pac::GPIOD.moder().modify(|w| w.set_moder(SAFETY_OUTPUT_BIT, pac::gpio::vals::Moder::OUTPUT));
}

/// Drives the safety output to 0. The function can be called from any context and in any state of the program.
pub fn safety_output_low() {
    pac::GPIOD.bsrr().write(|w| w.set_br(SAFETY_OUTPUT_BIT, true));
}
