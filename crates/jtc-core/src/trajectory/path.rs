//! Control of the time along the path, so that the arm stays on the path during a pause, a stop and a resume (J-33). A trajectory is a path
//! with a time parameterisation (Bobrow, Dubowsky and Gibson 1985; Pham and Pham 2018). This module changes only the rate of path time.
//!
//! The *rate* is the speed of path time, in seconds of path time per second. The change of the rate is the *slope* (1/s). A resume takes as
//! long as the limits require. A pause or a stop ends within the configured time. A pause or a stop begins along an S-shaped ramp that
//! keeps a margin to the acceleration and torque limits. If the S-shaped ramp would take too long, the pause or stop uses all available
//! torque. In such a hurried stop, the slope stays within the slopes that the arm can achieve at its torque limits, with its feedback
//! torque. The set values therefore do not advance faster than the arm can follow (time scaling under torque limits, Dahl and Nielsen
//! 1990).
use jtc_dynamics::sqrt;

use crate::DT;
use crate::bit_codec::bit_codec;

/// Path time and its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PathClock {
    /// Path time since point 0, ms.
    pub time: f64,
    /// Rate of path time, in seconds of path time per second, 0..1.
    pub rate: f64,
    /// Change of the rate of path time, 1/s.
    pub slope: f64,
    /// Target rate of path time, which is 0 or the speed override (J-57).
    target: f64,
    /// Number of ticks since standstill was requested.
    halting_ms: f64,
    /// `true` if the S-shaped ramp with its margins is too slow for the permitted time of a stop.
    hurried: bool,
}

bit_codec!(PathClock { time, rate, slope, target, halting_ms, hurried });

/// Lowest and highest slope of path time, 1/s. If no slope is possible, the first bound is above the second.
pub(crate) type Bounds = (f64, f64);

/// Ranges of the slopes of path time that the arm can follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SlopeBounds {
    /// Slopes within the acceleration and torque limits, with a margin for changes within a tick.
    pub easy: Bounds,
    /// Slopes within the torque limits alone.
    pub full: Bounds,
}

/// Factor for the change of a slope, compared with a normal ramp. The factor applies to a slope in the wrong direction,
/// for example if a pause begins during a resume. The factor also applies to a hurried stop.
const REVERSAL: f64 = 8.0;
/// Filter coefficient of the slope while a path is held back: change of the slope per tick, as a fraction of its
/// difference to the target slope.
const SETTLES: f64 = 0.1;
/// Share of the configured time within which a stop must end. The remaining time is a reserve, in case the next part
/// of the path permits only smaller slopes.
const PUNCTUAL: f64 = 0.6;

/// S-shaped ramp of the rate from 0 to 1. The ramp consists of a parabola, a line and a parabola, each with a third of its length.
struct Ramp {
    /// Highest slope of the ramp, 1/s.
    steepest: f64,
    /// Change of the slope in one tick, 1/s.
    round: f64,
}

impl Ramp {
    fn of(length_ms: f64) -> Self {
        let length = length_ms.max(1.0) / 1000.0;
        Self { steepest: 1.5 / length, round: 4.5 / (length * length) * DT }
    }

    /// Returns the highest slope that can still be reduced to zero while the rate changes by `distance`.
    fn flatten(&self, distance: f64) -> f64 {
        self.round * (sqrt(0.25 + 2.0 * distance / (self.round * DT)) - 0.5)
    }

    /// Returns the next slope after `now`, for a rate that must still change by `distance`. Both `now` and `distance` are positive in the
    /// direction of the change.
    fn next(&self, now: f64, distance: f64) -> f64 {
        let step = if now < 0.0 { REVERSAL * self.round } else { self.round };
        self.flatten(distance).min(self.steepest).min(now + step)
    }
}

impl PathClock {
    /// Creates a clock at point 0, for an arm at rest. The rate of the clock is `pace` from the start.
    pub(crate) fn start(pace: f64) -> Self {
        Self { rate: pace, target: pace, ..Self::default() }
    }

    /// Begins to accelerate path time from standstill to the rate `pace`, along a ramp.
    pub(crate) fn go(&mut self, pace: f64) {
        self.target = pace;
        self.slope = 0.0;
    }

    /// Sets the target rate of path time, except if path time must stop (target rate 0). Returns `true` if the target
    /// rate has changed.
    pub(crate) fn set_pace(&mut self, pace: f64) -> bool {
        let changes = self.target != 0.0 && self.target != pace;
        if changes {
            self.target = pace;
        }
        changes
    }

    /// Begins to slow path time down to standstill. The permitted time of the stop starts at the first call.
    pub(crate) fn halt(&mut self) {
        if self.target != 0.0 {
            (self.target, self.halting_ms, self.hurried) = (0.0, 0.0, false);
        }
    }

    /// Stops path time at once.
    pub(crate) fn rest(&mut self) {
        *self = Self { time: self.time, ..Self::default() };
    }

    /// Returns `true` if path time is at rest and its target is standstill.
    pub(crate) fn standing(&self) -> bool {
        self.rate == 0.0 && self.target == 0.0
    }

    /// Returns `true` if path time is faster than its target rate.
    pub(crate) fn above_pace(&self) -> bool {
        self.rate > self.target
    }

    /// Returns `true` if path time is slowing down to standstill.
    pub(crate) fn halting(&self) -> bool {
        self.target == 0.0 && self.rate != 0.0
    }

    /// Returns `true` if the target rate of path time is not standstill.
    pub(crate) fn is_going(&self) -> bool {
        self.target != 0.0
    }

    /// Returns `true` if path time is not at its target rate.
    pub(crate) fn ramping(&self) -> bool {
        self.rate != self.target
    }

    /// Returns `true` if path time is at full speed and its target is full speed.
    pub(crate) fn at_full_speed(&self) -> bool {
        self.rate == 1.0 && self.target == 1.0
    }

    /// Advances path time by one tick, at most to `end` (ms).
    pub(crate) fn advance(&mut self, end: f64) {
        self.time = (self.time + self.rate).min(end);
    }

    /// Changes the rate towards the target rate along an S-shaped ramp of `ramp_ms`, or more slowly if the slope
    /// would leave `bounds`. If a slope has the wrong direction because the target has changed, the slope changes as
    /// fast as permitted, but without a step. Until its sign changes, the rate moves on, but never beyond the
    /// previous target.
    pub(crate) fn change_pace(&mut self, ramp_ms: f64, bounds: Bounds) {
        let ahead = self.target - self.rate;
        let sign = if ahead < 0.0 { -1.0 } else { 1.0 };
        // In this function, slopes towards the target rate are positive.
        let (distance, now) = (ahead.abs(), sign * self.slope);
        let (low, high) = if sign < 0.0 { (-bounds.1, -bounds.0) } else { bounds };
        let ramp = Ramp::of(ramp_ms);
        let wanted = ramp.next(now, distance);
        // If the bounds contradict each other, or allow only slopes away from the target, the slope becomes zero. The
        // rate does not reverse its direction.
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

    /// Reduces the rate of path time if the upper bound of the slope requires this. In all other cases, the rate
    /// stays constant, even if the bounds of several joints contradict each other, or if only a faster path would
    /// reduce the torque of a joint.
    pub(crate) fn hold_back(&mut self, (low, high): Bounds) {
        let wanted = if low <= high { high.min(0.0) } else { 0.0 };
        // The bounds come from noisy torques, so the slope follows these bounds through a filter.
        let slope = self.slope + SETTLES * (wanted - self.slope);
        self.rate = (self.rate + slope * DT).clamp(0.0, 1.0);
        self.slope = if self.rate > 0.0 { slope } else { 0.0 };
    }

    /// Slows path time down to standstill, in at most `stop_ms` if the torque limits allow this. The clock follows an
    /// S-shaped ramp of `ramp_ms` within `bounds.easy`. If this ramp would take too long, the clock uses
    /// `bounds.full`, and the rate may even rise for a time, if the available torque cannot prevent the arm from
    /// gaining speed.
    pub(crate) fn slow_down(&mut self, ramp_ms: f64, stop_ms: f64, bounds: &SlopeBounds) {
        // In this function, slopes are decelerations, which are positive towards standstill.
        let (distance, now) = (self.rate, -self.slope);
        let ramp = Ramp::of(ramp_ms.min(0.8 * stop_ms));
        let wanted = ramp.next(now, distance);
        let (low, high) = (-bounds.easy.1, -bounds.easy.0);
        let eased = if low <= high { wanted.min(high).max(low.min(wanted)) } else { 0.0 };

        // `due` is the deceleration that ends the stop within the share [`PUNCTUAL`] of `stop_ms`, with a rounded end.
        let left_s = 0.001 * (PUNCTUAL * stop_ms - self.halting_ms);
        let due = if left_s > DT { distance / left_s } else { distance / DT };
        let due = due.min(ramp.flatten(distance)).min(now.max(0.0) + REVERSAL * ramp.round);
        self.halting_ms += 1.0;
        self.hurried |= eased < wanted && eased < due;

        let slope = if self.hurried {
            let (low, high) = (-bounds.full.1, -bounds.full.0);
            // If the bounds of several joints contradict each other, no slope satisfies all of them. The function then uses the bound that
            // is nearest to standstill.
            eased.max(due).min(low.max(high)).max(low.min(high)).max(-ramp.steepest)
        } else {
            eased
        };
        if slope * DT >= distance || distance < 1e-9 {
            (self.rate, self.slope) = (0.0, 0.0);
        } else {
            self.rate = (distance - slope * DT).min(1.0);
            // Path time never becomes faster than full speed.
            self.slope = if self.rate < 1.0 { -slope } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests;
