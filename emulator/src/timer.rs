//! Timers TIM2..TIM7 (RM0399 chapters 40, 43): counter, prescaler, update events and compare events.
use crate::clock::{NEVER, Time, period};

const CEN: u32 = 1;
const UDIS: u32 = 2;
const URS: u32 = 4;
const OPM: u32 = 8;
const ARPE: u32 = 0x80;

/// A timer that counts up.
pub struct Timer {
    wide: bool,
    basic: bool,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: u32,
    psc_active: u32,
    arr: u32,
    arr_active: u32,
    ccr: [u32; 4],
    /// Counter value at time `at`. While the timer runs, the counter counts up from this value.
    count: u32,
    at: Time,
    /// Period of the timer clock.
    clock: Time,
    /// Number of update events since reset.
    pub updates: u64,
}

impl Timer {
    /// Creates the timer with this number, which is 2..7 for TIM2..TIM7.
    pub fn new(number: u32) -> Self {
        let wide = number == 2 || number == 5;
        let max = if wide { u32::MAX } else { 0xFFFF };
        Self {
            wide,
            basic: number >= 6,
            cr1: 0,
            cr2: 0,
            smcr: 0,
            dier: 0,
            sr: 0,
            ccmr: [0; 2],
            ccer: 0,
            psc: 0,
            psc_active: 0,
            arr: max,
            arr_active: max,
            ccr: [0; 4],
            count: 0,
            at: 0,
            clock: NEVER,
            updates: 0,
        }
    }

    /// Sets the kernel clock of the timer. The caller must advance the timer to `now` before this call.
    pub fn set_clock(&mut self, hz: u64, now: Time) {
        let clock = period(hz);
        if clock != self.clock {
            self.settle(now);
            self.clock = clock;
        }
    }

    fn tick(&self) -> Time {
        self.clock.saturating_mul(u64::from(self.psc_active) + 1)
    }

    fn runs(&self) -> bool {
        self.cr1 & CEN != 0 && self.clock != NEVER
    }

    /// Returns the counter value. The caller must execute all events before `now` first.
    fn value(&self, now: Time) -> u32 {
        if !self.runs() {
            return self.count;
        }
        self.count + (now.saturating_sub(self.at) / self.tick()) as u32
    }

    /// Advances `count` to `now` by whole timer ticks, and `at` by the same time, so that a started tick is not lost.
    fn settle(&mut self, now: Time) {
        if self.runs() {
            let ticks = now.saturating_sub(self.at) / self.tick();
            self.count += ticks as u32;
            self.at += ticks * self.tick();
        } else {
            self.at = now;
        }
    }

    /// Returns the number of timer clock ticks from `count` until the counter overflows to 0.
    fn to_overflow(&self) -> u64 {
        if self.count > self.arr_active {
            // ARR is less than the counter, so the counter first counts up to the end of its range.
            let top = if self.wide { 1u64 << 32 } else { 1 << 16 };
            return top - u64::from(self.count);
        }
        u64::from(self.arr_active - self.count) + 1
    }

    /// Returns the number of timer clock ticks until the next match of a compare channel. Returns `None` if the
    /// overflow occurs first.
    fn to_match(&self, channel: usize) -> Option<u64> {
        let compare = self.ccr[channel];
        (compare > self.count && compare <= self.arr_active).then(|| u64::from(compare - self.count))
    }

    fn next_ticks(&self) -> u64 {
        let overflow = self.to_overflow();
        if self.basic {
            return overflow;
        }
        (0..4).filter_map(|c| self.to_match(c)).fold(overflow, u64::min)
    }

    /// Returns the time of the next timer event with an enabled interrupt. In one-pulse mode, the overflow is always
    /// included.
    pub fn next_event(&self) -> Time {
        if !self.runs() {
            return NEVER;
        }
        // The model needs an event only for flags whose interrupt is enabled. The model computes all other flags when
        // the program reads a register.
        let mut ticks = NEVER;
        if self.dier & 1 != 0 || self.cr1 & OPM != 0 {
            ticks = self.to_overflow();
        }
        if !self.basic {
            for c in (0..4).filter(|c| self.dier >> (c + 1) & 1 == 1) {
                // If the counter overflows before the match, the overflow is the next event. Afterwards, the model
                // computes the time of the match again.
                ticks = ticks.min(self.to_match(c).unwrap_or_else(|| self.to_overflow()));
            }
        }
        if ticks == NEVER { NEVER } else { self.at.saturating_add(ticks.saturating_mul(self.tick())) }
    }

    /// Executes all events of the timer up to `now`.
    pub fn advance(&mut self, now: Time) {
        while self.runs() {
            let ticks = self.next_ticks();
            let when = self.at.saturating_add(ticks.saturating_mul(self.tick()));
            if when > now {
                return;
            }
            let overflow = ticks == self.to_overflow();
            self.at = when;
            if overflow {
                self.count = 0;
                self.update(true);
                if self.cr1 & OPM != 0 {
                    self.cr1 &= !CEN;
                }
            } else {
                self.count += ticks as u32;
            }
            if !self.basic {
                for c in 0..4 {
                    if self.ccr[c] == self.count && self.ccr[c] <= self.arr_active {
                        self.sr |= 2 << c;
                    }
                }
            }
        }
    }

    fn update(&mut self, overflow: bool) {
        if self.cr1 & UDIS != 0 {
            return;
        }
        self.psc_active = self.psc;
        self.arr_active = self.arr;
        self.updates += 1;
        if overflow || self.cr1 & URS == 0 {
            self.sr |= 1;
        }
    }

    /// Returns the level of the interrupt line of the timer.
    pub fn line(&self) -> bool {
        self.sr & self.dier & 0x1F != 0
    }

    /// Reads a register of the timer.
    pub fn read(&mut self, offset: u32, now: Time) -> u32 {
        self.advance(now);
        match offset {
            0x00 => self.cr1,
            0x04 => self.cr2,
            0x08 => self.smcr,
            0x0C => self.dier,
            0x10 => self.sr,
            0x18 | 0x1C => self.ccmr[(offset as usize - 0x18) / 4],
            0x20 => self.ccer,
            0x24 => self.value(now),
            0x28 => self.psc,
            0x2C => self.arr,
            0x34..=0x40 => self.ccr[(offset as usize - 0x34) / 4],
            _ => 0,
        }
    }

    /// Writes a register of the timer.
    pub fn write(&mut self, offset: u32, value: u32, now: Time) {
        self.advance(now);
        self.settle(now);
        let mask = if self.wide { u32::MAX } else { 0xFFFF };
        match offset {
            0x00 => {
                if value & CEN != 0 && self.cr1 & CEN == 0 {
                    self.at = now;
                }
                self.cr1 = value;
            }
            0x04 => self.cr2 = value,
            0x08 => self.smcr = value,
            0x0C => self.dier = value,
            // Writing a 0 to a flag clears the flag.
            0x10 => self.sr &= value,
            0x14 => {
                if value & 1 != 0 {
                    self.count = 0;
                    self.at = now;
                    self.update(false);
                }
                self.sr |= value & 0x1E;
            }
            0x18 | 0x1C => self.ccmr[(offset as usize - 0x18) / 4] = value,
            0x20 => self.ccer = value,
            0x24 => {
                self.count = value & mask;
                self.at = now;
            }
            0x28 => self.psc = value & 0xFFFF,
            0x2C => {
                self.arr = value & mask;
                if self.cr1 & ARPE == 0 {
                    self.arr_active = self.arr;
                }
            }
            0x34..=0x40 => self.ccr[(offset as usize - 0x34) / 4] = value & mask,
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{MICROSECOND, MILLISECOND};

    /// Creates a timer that counts microseconds up to `reload` and compares with `compare`. `interrupts` is the value
    /// of the register DIER.
    fn microsecond_timer(number: u32, reload: u32, compare: u32, interrupts: u32) -> Timer {
        let mut timer = Timer::new(number);
        timer.set_clock(200_000_000, 0);
        for (register, value) in [
            (0x28, 199),
            (0x2C, reload),
            (0x14, 1),
            (0x10, 0),
            (0x38, compare),
            (0x0C, interrupts),
            (0x00, 1),
        ] {
            timer.write(register, value, 0);
        }
        timer
    }

    #[test]
    fn a_basic_timer_fires_every_millisecond() {
        let mut timer = microsecond_timer(7, 999, 0, 1);
        for ms in 1..5 {
            assert_eq!(timer.next_event(), ms * MILLISECOND);
            timer.advance(ms * MILLISECOND - 1);
            assert!(!timer.line());
            timer.advance(ms * MILLISECOND);
            assert!(timer.line());
            timer.write(0x10, !1, ms * MILLISECOND);
            assert!(!timer.line());
        }
        assert_eq!(timer.read(0x24, 4 * MILLISECOND + 17 * MICROSECOND), 17);
    }

    #[test]
    fn compare_flags_come_at_their_count() {
        let mut timer = microsecond_timer(5, 0xFFFF, 100, 4);
        assert_eq!(timer.next_event(), 100 * MICROSECOND);
        timer.advance(100 * MICROSECOND);
        assert_eq!(timer.read(0x10, 100 * MICROSECOND), 4);
    }
}
