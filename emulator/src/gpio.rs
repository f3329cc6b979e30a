//! Pins of the chip (RM0399 chapter 12). External signals can drive the pins, and the module records every change that
//! the firmware makes.
use crate::clock::Time;

/// A pin, as port letter and number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pin(pub char, pub u8);

/// A change of a pin that the firmware drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinChange {
    /// Time at which the level changed.
    pub time: Time,
    /// The pin whose level changed.
    pub pin: Pin,
    /// New level of the pin.
    pub level: bool,
}

const PORTS: usize = 11;

#[derive(Clone, Copy)]
struct Port {
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    odr: u32,
    lckr: u32,
    afr: [u32; 2],
    /// Levels that external signals drive. A level is valid if the bit of the pin is set in `driven`.
    outside: u16,
    driven: u16,
}

impl Port {
    fn new(index: usize) -> Self {
        // After a reset, the debug pins have their alternate function.
        let (moder, pupdr) = match index {
            0 => (0xABFF_FFFF, 0x6400_0000),
            1 => (0xFFFF_FEBF, 0x0000_0100),
            _ => (0xFFFF_FFFF, 0),
        };
        Self { moder, otyper: 0, ospeedr: 0, pupdr, odr: 0, lckr: 0, afr: [0; 2], outside: 0, driven: 0 }
    }

    fn is_output(&self, pin: u32) -> bool {
        self.moder >> (2 * pin) & 3 == 1
    }

    /// Returns the levels on the pins. If the firmware drives a pin, the level is the output level. Otherwise, the
    /// level is the external level, if any, or the level of the pull resistor.
    fn idr(&self) -> u32 {
        (0..16).fold(0, |word, pin| {
            let outside = u32::from(self.outside) >> pin & 1;
            let level = if self.is_output(pin) {
                self.odr >> pin & 1
            } else if self.driven >> pin & 1 == 1 {
                outside
            } else {
                u32::from(self.pupdr >> (2 * pin) & 3 == 1)
            };
            word | level << pin
        })
    }

    fn outputs(&self) -> u32 {
        (0..16).filter(|&pin| self.is_output(pin)).fold(0, |word, pin| word | self.odr & 1 << pin)
    }
}

/// All GPIO ports.
pub struct Gpio {
    ports: [Port; PORTS],
    changes: Vec<PinChange>,
}

impl Default for Gpio {
    fn default() -> Self {
        Self { ports: core::array::from_fn(Port::new), changes: Vec::new() }
    }
}

impl Gpio {
    /// Resets all ports, so that all pins are inputs again. Levels that external signals drive do not change.
    pub fn reset(&mut self, now: Time) {
        for index in 0..PORTS {
            let before = self.ports[index].outputs();
            let old = self.ports[index];
            self.ports[index] = Port { outside: old.outside, driven: old.driven, ..Port::new(index) };
            self.note(index, before, now);
        }
    }

    fn note(&mut self, index: usize, before: u32, now: Time) {
        let after = self.ports[index].outputs();
        for pin in (0..16).filter(|pin| (before ^ after) >> pin & 1 == 1) {
            let name = Pin(char::from(b'A' + index as u8), pin);
            self.changes.push(PinChange { time: now, pin: name, level: after >> pin & 1 == 1 });
        }
    }

    /// Reads a register of a port.
    pub fn read(&self, index: usize, offset: u32) -> u32 {
        let Some(port) = self.ports.get(index) else { return 0 };
        match offset {
            0x00 => port.moder,
            0x04 => port.otyper,
            0x08 => port.ospeedr,
            0x0C => port.pupdr,
            0x10 => port.idr(),
            0x14 => port.odr,
            0x1C => port.lckr,
            0x20 | 0x24 => port.afr[(offset as usize - 0x20) / 4],
            _ => 0,
        }
    }

    /// Writes a register of a port.
    pub fn write(&mut self, index: usize, offset: u32, value: u32, now: Time) {
        let Some(port) = self.ports.get_mut(index) else { return };
        let before = port.outputs();
        match offset {
            0x00 => port.moder = value,
            0x04 => port.otyper = value & 0xFFFF,
            0x08 => port.ospeedr = value,
            0x0C => port.pupdr = value,
            0x14 => port.odr = value & 0xFFFF,
            // If both bits of a pin are set, the set bit has priority over the reset bit.
            0x18 => port.odr = port.odr & !(value >> 16) | value & 0xFFFF,
            0x1C => port.lckr = value,
            0x20 | 0x24 => port.afr[(offset as usize - 0x20) / 4] = value,
            _ => {}
        }
        self.note(index, before, now);
    }

    fn place(pin: Pin) -> Option<(usize, u32)> {
        let index = (pin.0.to_ascii_uppercase() as usize).checked_sub('A' as usize)?;
        (index < PORTS && pin.1 < 16).then_some((index, u32::from(pin.1)))
    }

    /// Returns the index of the port of a pin; port A has index 0.
    pub fn port(pin: Pin) -> Option<usize> {
        Self::place(pin).map(|(port, _)| port)
    }

    /// Returns the levels on the pins of a port (register IDR).
    pub fn levels(&self, port: usize) -> u32 {
        self.ports.get(port).map_or(0, Port::idr)
    }

    /// Drives a pin from outside the chip; with `None`, the pin is not connected.
    pub fn drive(&mut self, pin: Pin, level: Option<bool>) {
        let Some((index, bit)) = Self::place(pin) else { return };
        let port = &mut self.ports[index];
        let mask = 1 << bit;
        port.driven = port.driven & !mask | if level.is_some() { mask } else { 0 };
        port.outside = port.outside & !mask | if level == Some(true) { mask } else { 0 };
    }

    /// Returns the level that the firmware drives at a pin. Returns `None` if the pin is not an output.
    pub fn output(&self, pin: Pin) -> Option<bool> {
        let (index, bit) = Self::place(pin)?;
        let port = &self.ports[index];
        port.is_output(bit).then_some(port.odr >> bit & 1 == 1)
    }

    /// Returns the pull resistor of a pin (register PUPDR).
    pub fn pull(&self, pin: Pin) -> u32 {
        Self::place(pin).map_or(0, |(index, bit)| self.ports[index].pupdr >> (2 * bit) & 3)
    }

    /// Returns every change of an output since power-on, oldest first.
    pub fn changes(&self) -> &[PinChange] {
        &self.changes
    }
}
