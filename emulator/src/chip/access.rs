//! Loads and stores of the core. This module selects the peripheral register of each access, and starts the checks of
//! interrupt lines and events after the access.
use std::collections::BTreeMap;

use super::map::{
    EXTI, EXTI_END, EXTICR, EXTICR_END, FLASH, FLASH_END, IWDG1, IWDG1_END, MPU, Place, RCC, RCC_END,
    is_plain, place, ready_bits,
};
use super::{Access, Chip};
use crate::dma::Memory;
use crate::flash::{BANK2, BANK2_SIZE};
use crate::rcc::Gate;
use crate::timer::Timer;

impl Chip {
    fn clocked(&mut self, gate: Gate, address: u32, write: Option<u32>) -> bool {
        let on = self.rcc.enabled(gate);
        if !on {
            note(&mut self.unclocked, address, self.core.pc, write);
        }
        on
    }

    /// Loads a value for the core. For an access that is smaller than a word, returns the accessed part of the word.
    pub fn load(&mut self, address: u32, size: usize, memory: &mut dyn Memory) -> u32 {
        let word = self.read_word(address & !3, memory);
        let value = word >> (8 * (address & 3));
        if size < 4 { value & ((1 << (8 * size)) - 1) } else { value }
    }

    fn read_word(&mut self, address: u32, memory: &mut dyn Memory) -> u32 {
        let now = self.now();
        if address >= 0xE000_0000 {
            let at = self.moment();
            return self.scs.read(address, &self.nvic, at);
        }
        if let Some((gate, place)) = place(address) {
            if !self.clocked(gate, address, None) {
                return 0;
            }
            return match place {
                Place::Timer(n, offset) => self.timers[n].read(offset, now),
                Place::Usart(n, offset) => {
                    let value = self.usarts[n].read(offset, now, &mut self.dma, memory);
                    self.changed();
                    value
                }
                Place::Dma(n, offset) => {
                    self.catch_up(memory);
                    self.dma.read(n, offset)
                }
                Place::Mux(offset) => self.dma.read_mux(offset),
                Place::Gpio(n, offset) => self.gpio.read(n, offset),
                Place::Fdcan(offset) => self.fdcan.read(offset, now),
                Place::MessageRam(offset) => {
                    self.fdcan.advance(now);
                    self.fdcan.ram.read(offset)
                }
            };
        }
        match address {
            RCC..RCC_END => self.rcc.read(address - RCC),
            FLASH..FLASH_END => {
                let register = self.flash.read_register(address - FLASH, now);
                register.unwrap_or_else(|| self.plain.read(address))
            }
            IWDG1..IWDG1_END => self.iwdg.read(address - IWDG1),
            EXTI..EXTI_END => self.exti.read(address - EXTI),
            EXTICR..EXTICR_END => self.exti.source((address - EXTICR) as usize / 4),
            _ => {
                if !is_plain(address) {
                    note(&mut self.unknown, address, self.core.pc, None);
                }
                self.plain.read(address) | ready_bits(address, &self.plain)
            }
        }
    }

    /// Stores a value for the core.
    pub fn store(&mut self, address: u32, size: usize, value: u32, memory: &mut dyn Memory) {
        let now = self.now();
        let shift = 8 * (address & 3);
        let word_address = address & !3;
        if address >= 0xE000_0000 {
            let at = self.moment();
            let word = if size < 4 {
                // The program may write a part of a register. For example, it can write interrupt priorities byte by
                // byte.
                let mask = ((1u32 << (8 * size)) - 1) << shift;
                self.scs.read(word_address, &self.nvic, at) & !mask | value << shift
            } else {
                value
            };
            self.scs.write(word_address, word, &mut self.nvic, at);
            if MPU.contains(&word_address) {
                let closed = self.bank2_closed();
                self.flash.guard(now, closed);
            }
            return self.changed();
        }
        let value = value << shift;
        if let Some((gate, place)) = place(word_address) {
            if !self.clocked(gate, word_address, Some(value)) {
                return;
            }
            match place {
                Place::Timer(n, offset) => self.timers[n].write(offset, value, now),
                Place::Usart(n, offset) => {
                    self.usarts[n].write(offset, value, now, &mut self.dma, memory);
                }
                Place::Dma(n, offset) => {
                    self.catch_up(memory);
                    self.dma.write(n, offset, value);
                    self.catch_up(memory);
                }
                Place::Mux(offset) => self.dma.write_mux(offset, value),
                Place::Gpio(n, offset) => return self.gpio.write(n, offset, value, now),
                Place::Fdcan(offset) => self.fdcan.write(offset, value, now),
                Place::MessageRam(offset) => {
                    self.fdcan.advance(now);
                    return self.fdcan.ram.write(offset, value);
                }
            }
            return self.changed();
        }
        match word_address {
            RCC..RCC_END => self.write_rcc(word_address - RCC, value, memory),
            FLASH..FLASH_END => {
                let closed = self.bank2_closed();
                if !self.flash.write_register(word_address - FLASH, value, now, closed) {
                    self.plain.write(word_address, value);
                }
            }
            IWDG1..IWDG1_END => self.iwdg.write(word_address - IWDG1, value, now),
            EXTI..EXTI_END => self.exti.write(word_address - EXTI, value),
            EXTICR..EXTICR_END => self.exti.set_source((word_address - EXTICR) as usize / 4, value),
            _ => {
                if !is_plain(word_address) {
                    note(&mut self.unknown, word_address, self.core.pc, Some(value));
                }
                self.plain.write(word_address, value);
            }
        }
        self.changed();
    }

    fn write_rcc(&mut self, offset: u32, value: u32, memory: &mut dyn Memory) {
        self.advance(memory);
        self.rcc.write(offset, value);
        let now = self.now();
        for gate in core::mem::take(&mut self.rcc.resets) {
            match gate {
                Gate::Dma(n) => self.dma.reset(n as usize),
                Gate::Timer(n) => self.timers[n as usize - 2] = Timer::new(n),
                Gate::Usart(n) => self.usarts[n as usize - 2].reset(),
                Gate::Fdcan => self.fdcan.reset(),
                Gate::Gpio(_) | Gate::Sram(_) => {}
            }
        }
        for timer in &mut self.timers {
            timer.advance(now);
        }
        self.update_clocks();
        self.remap = true;
    }

    fn catch_up(&mut self, memory: &mut dyn Memory) {
        let now = self.now();
        for usart in &mut self.usarts {
            usart.advance(now, &mut self.dma, memory);
        }
    }

    /// Returns `true` if the protection unit blocks access to flash bank 2.
    fn bank2_closed(&self) -> bool {
        !self.scs.protection(BANK2 + BANK2_SIZE - 1, false).allowed
    }

    /// Checks an access of the core to flash bank 2. Returns `false` if the access is rejected. While the bank is busy,
    /// the core waits.
    fn reach_bank2(&mut self, address: u32, faults_masked: bool) -> bool {
        let protection = self.scs.protection(address, faults_masked);
        if !protection.allowed {
            self.refuse(address);
            return false;
        }
        self.flash.ahead += u32::from(protection.ahead);
        let now = self.now();
        if let Some(ready) = self.flash.busy_until(now) {
            let until = ready.min(self.iwdg.bites()).max(now);
            self.flash.stalls.push((now, until - now));
            self.sleep_until(until);
            self.changed();
        }
        let now = self.now();
        self.flash.advance(now);
        true
    }

    fn refuse(&mut self, address: u32) {
        self.core.refused = Some(address);
        self.changed();
    }

    /// Loads a value from flash bank 2 for the core.
    pub fn load_bank2(&mut self, address: u32, size: usize, faults_masked: bool) -> u32 {
        if !self.reach_bank2(address, faults_masked) {
            return 0;
        }
        let (value, unreadable) = self.flash.load(address, size);
        if unreadable && !(faults_masked && self.scs.ignores_bus_faults()) {
            self.refuse(address);
        }
        value
    }

    /// Stores a value to flash bank 2 for the core.
    pub fn store_bank2(&mut self, address: u32, size: usize, value: u32, faults_masked: bool) {
        if self.reach_bank2(address, faults_masked) {
            let (now, closed) = (self.now(), self.bank2_closed());
            self.flash.store(address, size, value, now, closed);
            self.changed();
        }
    }

    /// Makes the main loop check interrupt lines and events before the next instruction. The model calls this
    /// function after each access that may have changed them.
    fn changed(&mut self) {
        self.update_lines();
        self.core.attention = true;
        self.core.look_at = 0;
    }
}

fn note(list: &mut BTreeMap<u32, Access>, address: u32, pc: u32, write: Option<u32>) {
    let access = list.entry(address).or_default();
    access.pc = pc;
    match write {
        Some(value) => {
            access.writes += 1;
            access.value = value;
        }
        None => access.reads += 1,
    }
}
