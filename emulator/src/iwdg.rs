//! Independent watchdog 1 (RM0399 chapter 47). The watchdog counts down with the LSI clock and resets the machine at
//! zero.
use crate::clock::{NEVER, SECOND, Time};

const LSI_HZ: u64 = 32_000;

/// The independent watchdog.
#[derive(Debug)]
pub struct Iwdg {
    prescaler: u32,
    reload: u32,
    window: u32,
    unlocked: bool,
    bites: Time,
    /// Shortest time to the watchdog reset that remained when the firmware fed the watchdog.
    pub least_left: Time,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self { prescaler: 0, reload: 0xFFF, window: 0xFFF, unlocked: false, bites: NEVER, least_left: NEVER }
    }
}

impl Iwdg {
    /// Switches the watchdog off, as every reset does.
    pub fn reset(&mut self) {
        *self = Self { least_left: self.least_left, ..Self::default() };
    }

    /// Reads a register of the watchdog.
    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x10 => self.window,
            _ => 0,
        }
    }

    /// Writes a register of the watchdog.
    pub fn write(&mut self, offset: u32, value: u32, now: Time) {
        match offset {
            0x00 => match value & 0xFFFF {
                0xCCCC => {
                    self.bites = now + self.timeout();
                    self.unlocked = false;
                }
                0x5555 => self.unlocked = true,
                0xAAAA => {
                    if self.bites != NEVER {
                        self.least_left = self.least_left.min(self.bites.saturating_sub(now));
                        self.bites = now + self.timeout();
                    }
                    self.unlocked = false;
                }
                _ => self.unlocked = false,
            },
            0x04 if self.unlocked => self.prescaler = value & 7,
            0x08 if self.unlocked => self.reload = value & 0xFFF,
            0x10 if self.unlocked => self.window = value & 0xFFF,
            _ => {}
        }
    }

    /// Returns the watchdog timeout.
    pub fn timeout(&self) -> Time {
        let divider = 4 << self.prescaler.min(6);
        (u64::from(self.reload) + 1) * divider * SECOND / LSI_HZ
    }

    /// Returns the time at which the watchdog resets the machine if the firmware does not feed the watchdog.
    pub fn bites(&self) -> Time {
        self.bites
    }

    /// Returns `true` while the watchdog runs.
    pub fn running(&self) -> bool {
        self.bites != NEVER
    }
}
