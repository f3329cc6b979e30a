//! Exceptions of the core: pending state, enable state and priority order (ARMv7-M B1.5, with the four priority bits of
//! STM32).
use crate::clock::Time;

/// Number of interrupt lines of the chip.
pub const LINES: usize = 150;
/// Exception number of the first interrupt line.
pub const FIRST_LINE: usize = 16;
/// Number of exceptions, including interrupts.
pub const EXCEPTIONS: usize = FIRST_LINE + LINES;

/// Numbers of the exceptions of the core itself.
pub mod exception {
    /// Non-maskable interrupt (NMI).
    pub const NMI: usize = 2;
    /// Hard fault (HardFault).
    pub const HARD_FAULT: usize = 3;
    /// Supervisor call (SVCall).
    pub const SV_CALL: usize = 11;
    /// Pendable service request (PendSV).
    pub const PEND_SV: usize = 14;
    /// System tick timer (SysTick).
    pub const SYS_TICK: usize = 15;
}

/// Priority of code outside exceptions. A lower value means a higher priority.
const THREAD: i32 = 256;

/// Mask registers of the core.
#[derive(Clone, Copy, Debug, Default)]
pub struct Masks {
    /// Mask bit PRIMASK.PM.
    pub primask: bool,
    /// Mask bit FAULTMASK.FM.
    pub faultmask: bool,
    /// BASEPRI; the value 0 does not mask any exception.
    pub basepri: u8,
}

/// The interrupt controller and the priorities of the exceptions of the core itself.
pub struct Nvic {
    enabled: [bool; EXCEPTIONS],
    pending: [bool; EXCEPTIONS],
    /// Time at which each exception became pending.
    since: [Time; EXCEPTIONS],
    active: [bool; EXCEPTIONS],
    level: [bool; EXCEPTIONS],
    priority: [u8; EXCEPTIONS],
    /// Exceptions that are both pending and enabled, in any order.
    waiting: Vec<usize>,
    /// Value of AIRCR.PRIGROUP.
    pub prigroup: u32,
    /// `true` if an interrupt has become pending since this flag was cleared. If SCR.SEVONPEND is set, the flag ends a
    /// sleep in WFE.
    pub pended: bool,
}

impl Default for Nvic {
    fn default() -> Self {
        let mut enabled = [false; EXCEPTIONS];
        enabled[..FIRST_LINE].fill(true);
        Self {
            enabled,
            pending: [false; EXCEPTIONS],
            since: [0; EXCEPTIONS],
            active: [false; EXCEPTIONS],
            level: [false; EXCEPTIONS],
            priority: [0; EXCEPTIONS],
            waiting: Vec::with_capacity(16),
            prigroup: 0,
            pended: false,
        }
    }
}

impl Nvic {
    fn update(&mut self, exception: usize) {
        let waits = self.pending[exception] && self.enabled[exception];
        let at = self.waiting.iter().position(|&e| e == exception);
        match (waits, at) {
            (true, None) => self.waiting.push(exception),
            (false, Some(at)) => {
                self.waiting.swap_remove(at);
            }
            _ => {}
        }
    }

    /// Makes an exception pending.
    pub fn pend(&mut self, exception: usize, now: Time) {
        if !self.pending[exception] {
            self.pending[exception] = true;
            self.since[exception] = now;
            self.pended = true;
            self.update(exception);
        }
    }

    /// Clears the pending state of an exception.
    pub fn unpend(&mut self, exception: usize) {
        self.pending[exception] = false;
        self.update(exception);
    }

    /// Sets the level of an interrupt line. A rising edge makes the interrupt pending.
    pub fn set_line(&mut self, line: usize, level: bool, now: Time) {
        let exception = FIRST_LINE + line;
        let before = core::mem::replace(&mut self.level[exception], level);
        if level && !before {
            self.pend(exception, now);
        }
    }

    /// Returns `true` if the exception is pending.
    pub fn is_pending(&self, exception: usize) -> bool {
        self.pending[exception]
    }

    /// Returns `true` if the exception is running or preempted.
    pub fn is_active(&self, exception: usize) -> bool {
        self.active[exception]
    }

    /// Returns `true` if the exception is enabled.
    pub fn is_enabled(&self, exception: usize) -> bool {
        self.enabled[exception]
    }

    /// Enables (`true`) or disables (`false`) an exception.
    pub fn enable(&mut self, exception: usize, enabled: bool) {
        self.enabled[exception] = enabled;
        self.update(exception);
    }

    /// Returns the priority byte of an exception.
    pub fn priority(&self, exception: usize) -> u8 {
        self.priority[exception]
    }

    /// Sets the priority byte of an exception; only the upper four bits of the byte exist.
    pub fn set_priority(&mut self, exception: usize, priority: u8) {
        self.priority[exception] = priority & 0xF0;
    }

    /// Returns the time at which an exception became pending.
    pub fn pending_since(&self, exception: usize) -> Time {
        self.since[exception]
    }

    /// Returns `true` if an enabled exception is pending.
    pub fn any_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Returns the priority that decides preemption, without the lower bits that PRIGROUP excludes.
    fn group(&self, priority: i32) -> i32 {
        if priority < 0 { priority } else { priority >> (self.prigroup + 1) << (self.prigroup + 1) }
    }

    fn raw_priority(&self, exception: usize) -> i32 {
        match exception {
            exception::NMI => -2,
            exception::HARD_FAULT => -1,
            _ => i32::from(self.priority[exception]),
        }
    }

    /// Returns the priority of the running exception or thread, ignoring the mask registers.
    pub fn running_priority(&self) -> i32 {
        let active = (0..EXCEPTIONS).filter(|&e| self.active[e]);
        active.map(|e| self.group(self.raw_priority(e))).min().unwrap_or(THREAD)
    }

    /// Returns the waiting exception with the highest priority.
    fn most_urgent(&self) -> Option<usize> {
        self.waiting.iter().copied().min_by_key(|&e| (self.raw_priority(e), e))
    }

    fn masked(&self, running: i32, masks: Masks) -> i32 {
        let mut limit = running;
        if masks.basepri != 0 {
            limit = limit.min(self.group(i32::from(masks.basepri)));
        }
        if masks.primask {
            limit = limit.min(0);
        }
        if masks.faultmask {
            limit = limit.min(-1);
        }
        limit
    }

    /// Returns the exception that the core must enter now, if any.
    pub fn next(&self, masks: Masks) -> Option<usize> {
        let exception = self.most_urgent()?;
        let running = self.running_priority();
        (self.group(self.raw_priority(exception)) < self.masked(running, masks)).then_some(exception)
    }

    /// Returns `true` if only the mask registers block a waiting exception.
    pub fn held_by_masks(&self, masks: Masks) -> bool {
        self.next(masks).is_none() && self.next(Masks::default()).is_some()
    }

    /// Returns `true` if a waiting exception ends WFI. PRIMASK has no effect on this decision.
    pub fn wakes(&self, masks: Masks) -> bool {
        self.next(Masks { primask: false, ..masks }).is_some()
    }

    /// Marks an exception as running.
    pub fn enter(&mut self, exception: usize) {
        self.active[exception] = true;
        self.unpend(exception);
    }

    /// Ends an exception. If its interrupt line is still high, the exception becomes pending again.
    pub fn leave(&mut self, exception: usize, now: Time) {
        self.active[exception] = false;
        if self.level[exception] {
            self.pend(exception, now);
        }
    }

    /// Returns the value of ICSR.VECTPENDING.
    pub fn vect_pending(&self) -> usize {
        self.most_urgent().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: usize = FIRST_LINE + 3;
    const B: usize = FIRST_LINE + 7;

    fn with(priorities: [u8; 2]) -> Nvic {
        let mut nvic = Nvic::default();
        for (exception, priority) in [A, B].into_iter().zip(priorities) {
            nvic.set_priority(exception, priority);
            nvic.enable(exception, true);
            nvic.pend(exception, 5);
        }
        nvic
    }

    #[test]
    fn the_more_urgent_goes_first_and_equals_by_number() {
        assert_eq!(with([0x20, 0x10]).next(Masks::default()), Some(B));
        assert_eq!(with([0x10, 0x10]).next(Masks::default()), Some(A));
    }

    #[test]
    fn only_a_more_urgent_one_preempts() {
        let mut nvic = with([0x20, 0x20]);
        nvic.enter(A);
        assert_eq!(nvic.next(Masks::default()), None);
        nvic.set_priority(B, 0x10);
        assert_eq!(nvic.next(Masks::default()), Some(B));
    }

    #[test]
    fn masks_hold_back() {
        let nvic = with([0x20, 0x30]);
        assert!(nvic.held_by_masks(Masks { primask: true, ..Masks::default() }));
        assert!(nvic.wakes(Masks { primask: true, ..Masks::default() }));
        assert_eq!(nvic.next(Masks { basepri: 0x30, ..Masks::default() }), Some(A));
        assert_eq!(nvic.next(Masks { basepri: 0x20, ..Masks::default() }), None);
    }

    #[test]
    fn a_high_line_comes_again_after_return() {
        let mut nvic = Nvic::default();
        nvic.enable(A, true);
        nvic.set_line(3, true, 1);
        nvic.enter(A);
        assert!(!nvic.is_pending(A));
        nvic.leave(A, 9);
        assert!(nvic.is_pending(A));
        assert_eq!(nvic.pending_since(A), 9);
    }
}
