//! Actions that a board executes when their due time is reached.

use super::{App, Application, Flash, FlashState, Node, Pins, Store};
use crate::error_code::ErrorCode;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Returns the time that is `ms` milliseconds after the current time.
    pub(super) fn after_ms(&self, ms: u32) -> u64 {
        self.now_us.saturating_add(u64::from(ms) * 1000)
    }

    /// Returns a random number from 1 to `most`.
    pub(super) fn random(&mut self, most: u32) -> u32 {
        // The generator is xorshift32 (Marsaglia 2003).
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        1 + self.random % most.max(1)
    }

    /// Sends DSP_ERROR, unless the rate limit for this error code is reached (section 9).
    pub(super) fn error(&mut self, code: ErrorCode) {
        let from = self.own_number();
        let limit = self.config.profile.error_rate;
        let rate = self.error_rates.get_mut(usize::from(code.number()).wrapping_sub(1));
        let allowed = rate.is_some_and(|rate| rate.allow(self.now_us, limit));
        if !allowed || !self.outbox.push_error(code, from) {
            self.counters.errors_dropped = self.counters.errors_dropped.saturating_add(1);
        }
    }

    /// Sets the current time to `now_us`; the time never moves backwards.
    pub(super) fn advance(&mut self, now_us: u64) {
        self.now_us = self.now_us.max(now_us);
        let now = self.now_us;
        let due = |at: Option<u64>| at.is_some_and(|at| at <= now);
        if self.boot_until.is_some() {
            // A flash erase that began before the reset may still be in progress.
            if due(self.boot_until) && self.flash.state(now) != FlashState::Busy {
                self.booted();
            }
            return;
        }
        self.program_timers();
        if due(self.autostart_at) {
            self.autostart_at = None;
            self.start();
        }
        if self.app == App::Starting && self.application.is_up(now) {
            self.application_up();
        }
        if due(self.pc_lost_at) {
            self.pc_lost();
        }
        if due(self.step_at) {
            self.application.step(now);
            self.step_at = Some(next_beat(self.step_at, self.config.control_period_us, now));
        }
        if due(self.so_at) {
            let period = u64::from(self.config.profile.so_period) * 1000;
            self.so_at = Some(next_beat(self.so_at, period, now));
            if self.jobs.so.is_some() {
                self.counters.so_skipped = self.counters.so_skipped.saturating_add(1);
            } else {
                self.application.sample_so();
                self.jobs.so = Some(0);
            }
        }
        if due(self.alive_at) {
            let period = u64::from(self.config.profile.alive_dsp_period) * 1000;
            self.alive_at = Some(next_beat(self.alive_at, period, now));
            self.outbox.alive = true;
        }
    }

    pub(super) fn deadline(&self) -> u64 {
        let soon = self.now_us.saturating_add(1000);
        if let Some(until) = self.boot_until {
            return if until > self.now_us { until } else { soon };
        }
        let mut next = self.programming.deadline(self.now_us, &self.config);
        for at in [self.autostart_at, self.pc_lost_at, self.step_at, self.so_at, self.alive_at] {
            next = next.min(at.unwrap_or(u64::MAX));
        }
        if self.app == App::Starting {
            next = next.min(soon);
        }
        if self.outbox.in_flight.is_none() {
            next = next.min(self.outbox.deadline()).min(self.jobs.deadline());
            if self.wants_text() {
                next = 0;
            }
        }
        next
    }
}

/// Returns the next due time of a periodic action: the first time after `now` that is a whole number of periods after
/// `at`. Missed due times are skipped.
fn next_beat(at: Option<u64>, period_us: u64, now: u64) -> u64 {
    let period = period_us.max(1);
    let at = at.unwrap_or(now);
    let missed = now.saturating_sub(at) / period;
    at.saturating_add((missed + 1).saturating_mul(period))
}
