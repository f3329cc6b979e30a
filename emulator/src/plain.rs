//! Peripheral registers that behave as plain memory.
use std::collections::BTreeMap;

/// Values of the registers, by address. The value of a register that was never written is 0.
#[derive(Clone, Debug, Default)]
pub struct Plain {
    words: BTreeMap<u32, u32>,
}

impl Plain {
    /// Returns the value of the register at an address.
    pub fn read(&self, address: u32) -> u32 {
        self.words.get(&(address & !3)).copied().unwrap_or(0)
    }

    /// Sets the value of the register at an address.
    pub fn write(&mut self, address: u32, value: u32) {
        self.words.insert(address & !3, value);
    }
}
