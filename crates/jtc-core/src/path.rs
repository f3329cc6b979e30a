//! Time along the path: pause, stop and resume without leaving it (J-33). A trajectory is a path with a parameterisation by time (Bobrow,
//! Dubowsky and Gibson 1985; Pham and Pham 2018). Only the rate changes here.
//!
//! The *rate* is path seconds per second; its change is the *slope* (1/s). Resuming takes as long as the limits require. A pause or a stop
//! ends within a set time: first along an S and with a margin to the limits; if that would take too long, with all available torque. Then
//! the slope is what the arm achieves at its torque limits, which are computed with the feedback torque in it: set values never run away
//! from an arm that cannot follow (time scaling under torque limits, Dahl and Nielsen 1990).
use jtc_dynamics::sqrt;

use crate::DT;
use crate::remembered::remembered;

/// Path time and its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathClock {
    /// Time since point 0 along the path, ms.
    pub time: f64,
    /// Path seconds per second, 0..1.
    pub rate: f64,
    /// Change of `rate`, 1/s.
    pub slope: f64,
    /// The rate that is wanted: 0, or the speed override (J-57).
    target: f64,
    /// Ticks since standstill was requested.
    halting_ms: f64,
    /// The S with its margins is too slow for the time that a stop may take.
    hurried: bool,
}

remembered!(PathClock { time, rate, slope, target, halting_ms, hurried });

/// Lowest and highest slope of path time, 1/s. Empty, with the first above the second, if no slope fits.
pub type Bounds = (f64, f64);

/// Slopes that the arm can follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeBounds {
    /// Within the acceleration and torque limits, with a margin for what changes within a tick.
    pub easy: Bounds,
    /// Within the torque limits alone.
    pub full: Bounds,
}

/// A slope in the wrong direction (a pause during a resume) is taken out this much faster than a ramp is rounded; a stop in a
/// hurry changes its slope as fast.
const REVERSAL: f64 = 8.0;
/// Fraction of the remaining change to the wanted slope that a held back path makes in a tick.
const SETTLES: f64 = 0.1;
/// Share of the time for a stop within which the stop must end: the rest is for the path that is still ahead.
const PUNCTUAL: f64 = 0.6;

/// The S of a ramp from 0 to 1 (parabola, line, parabola, a third of its length each).
struct Ramp {
    /// Highest slope, 1/s.
    steepest: f64,
    /// Change of the slope in a tick, 1/s.
    round: f64,
}

impl Ramp {
    fn of(length_ms: f64) -> Self {
        let length = length_ms.max(1.0) / 1000.0;
        Self { steepest: 1.5 / length, round: 4.5 / (length * length) * DT }
    }

    /// Returns the slope from which the rest of the way just suffices to flatten out.
    fn flatten(&self, distance: f64) -> f64 {
        self.round * (sqrt(0.25 + 2.0 * distance / (self.round * DT)) - 0.5)
    }

    /// Returns the slope after `now` on the way to a rate that is `distance` away; both in the direction of travel.
    fn next(&self, now: f64, distance: f64) -> f64 {
        let step = if now < 0.0 { REVERSAL * self.round } else { self.round };
        self.flatten(distance).min(self.steepest).min(now + step)
    }
}

impl PathClock {
    /// Starts at point 0, which is at rest, and goes at this rate.
    pub fn start(pace: f64) -> Self {
        Self { rate: pace, target: pace, ..Self::default() }
    }

    /// Begins to go at this rate, from standing at the present time.
    pub fn go(&mut self, pace: f64) {
        self.target = pace;
        self.slope = 0.0;
    }

    /// Sets another wanted rate from now on; a standstill that is wanted remains so. Returns `true` if path time begins to change its rate.
    pub fn set_pace(&mut self, pace: f64) -> bool {
        let changes = self.target != 0.0 && self.target != pace;
        if changes {
            self.target = pace;
        }
        changes
    }

    /// Slows down to standstill. The time for it runs from the first call.
    pub fn halt(&mut self) {
        if self.target != 0.0 {
            (self.target, self.halting_ms, self.hurried) = (0.0, 0.0, false);
        }
    }

    /// Stops path time here and now.
    pub fn rest(&mut self) {
        *self = Self { time: self.time, ..Self::default() };
    }

    /// Returns `true` if path time does not move, and is not about to.
    pub fn standing(&self) -> bool {
        self.rate == 0.0 && self.target == 0.0
    }

    /// Returns `true` if path time is faster than wanted.
    pub fn above_pace(&self) -> bool {
        self.rate > self.target
    }

    /// Returns `true` if path time is on the way to standstill.
    pub fn halting(&self) -> bool {
        self.target == 0.0 && self.rate != 0.0
    }

    /// Returns `true` if path time goes, or is about to.
    pub fn is_going(&self) -> bool {
        self.target != 0.0
    }

    /// Returns `true` if path time is not at the wanted rate.
    pub fn ramping(&self) -> bool {
        self.rate != self.target
    }

    /// Returns `true` if path time goes as fast as time.
    pub fn at_full_speed(&self) -> bool {
        self.rate == 1.0 && self.target == 1.0
    }

    /// Advances path time by one tick, at most to `end` (ms).
    pub fn advance(&mut self, end: f64) {
        self.time = (self.time + self.rate).min(end);
    }

    /// Changes the rate to the wanted one: along an S of `ramp_ms`, or slower if the slope would leave `bounds`. If another rate is wanted
    /// on the way, the slope changes as fast as it may and does not step; meanwhile the rate goes on, never beyond the rate that was wanted
    /// before.
    pub fn change_pace(&mut self, ramp_ms: f64, bounds: Bounds) {
        let ahead = self.target - self.rate;
        let sign = if ahead < 0.0 { -1.0 } else { 1.0 };
        // In here slopes are positive towards the wanted rate.
        let (distance, now) = (ahead.abs(), sign * self.slope);
        let (low, high) = if sign < 0.0 { (-bounds.1, -bounds.0) } else { bounds };
        let ramp = Ramp::of(ramp_ms);
        let wanted = ramp.next(now, distance);
        // Bounds that leave no slope: keep the rate for now. Bounds of the other direction do not turn the rate round.
        let (within, high) = if low <= high {
            (wanted.min(high).max(low.min(wanted)).max(wanted.min(0.0)), high.max(0.0))
        } else {
            (0.0, 0.0)
        };
        let step = REVERSAL * ramp.round;
        let slope = within.max((now - step).min(high));
        if now.abs() <= step && (slope * DT >= distance || distance < 1e-9) {
            (self.rate, self.slope) = (self.target, 0.0);
        } else {
            self.rate = (self.rate + sign * slope * DT).clamp(0.0, 1.0);
            self.slope = sign * slope;
        }
    }

    /// Keeps the present rate, or slows down if the slope would leave `bounds` otherwise. Joints that contradict each other keep the rate,
    /// and so do joints that only a faster path would relieve.
    pub fn hold_back(&mut self, (low, high): Bounds) {
        let wanted = if low <= high { high.min(0.0) } else { 0.0 };
        // The torques that the bounds come from are noisy.
        let slope = self.slope + SETTLES * (wanted - self.slope);
        self.rate = (self.rate + slope * DT).clamp(0.0, 1.0);
        self.slope = if self.rate > 0.0 { slope } else { 0.0 };
    }

    /// Slows down to standstill, in at most `stop_ms` if the torque limits allow it: along an S of `ramp_ms` while that is possible within
    /// `bounds.easy`; if that would take too long, within `bounds.full` alone. Then the rate may also rise again if the arm cannot even be
    /// kept from gaining speed.
    pub fn slow_down(&mut self, ramp_ms: f64, stop_ms: f64, bounds: &SlopeBounds) {
        // In here slopes are decelerations: positive towards standstill.
        let (distance, now) = (self.rate, -self.slope);
        let ramp = Ramp::of(ramp_ms.min(0.8 * stop_ms));
        let wanted = ramp.next(now, distance);
        let (low, high) = (-bounds.easy.1, -bounds.easy.0);
        let eased = if low <= high { wanted.min(high).max(low.min(wanted)) } else { 0.0 };

        // Deceleration that is needed to be in time, rounded at the end.
        let left_s = 0.001 * (PUNCTUAL * stop_ms - self.halting_ms);
        let due = if left_s > DT { distance / left_s } else { distance / DT };
        let due = due.min(ramp.flatten(distance)).min(now.max(0.0) + REVERSAL * ramp.round);
        self.halting_ms += 1.0;
        self.hurried |= eased < wanted && eased < due;

        let slope = if self.hurried {
            let (low, high) = (-bounds.full.1, -bounds.full.0);
            // Joints that contradict each other: in between none has its way, and the nearest to standstill is taken.
            eased.max(due).min(low.max(high)).max(low.min(high)).max(-ramp.steepest)
        } else {
            eased
        };
        if slope * DT >= distance || distance < 1e-9 {
            (self.rate, self.slope) = (0.0, 0.0);
        } else {
            self.rate = (distance - slope * DT).min(1.0);
            // At full speed path time does not get any faster.
            self.slope = if self.rate < 1.0 { -slope } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests;
