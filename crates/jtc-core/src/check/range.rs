//! Positions of a joint that a path may have (J-36).
//!
//! Two allowances are added to the position limits. Rounding to the wire moves a path that ends exactly on a limit a little beyond it,
//! which is not a fault of the path: that is the tolerance. A joint that stands outside a limit may be moved back inside: it may begin
//! there, and comes no further out up to its first point inside.
use super::{POSITION_STEP, VELOCITY_STEP};
use crate::config::{Config, WORKING_AREA};

/// Way (rad) in the middle of the quintic between two points that are a second apart, for 1 rad/s more in the first one and less in the
/// second one: 5/16.
const WAY_OF_VELOCITY: f64 = 0.3125;

/// Positions of one joint that a path may have (J-36), rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRange {
    /// Position limits, inside the working area of the drives while these keep to it (J-43).
    limits: (f64, f64),
    /// The limits with their tolerance, inside the working area.
    tolerated: (f64, f64),
    /// Addition to a position between two points by rounding to the wire.
    tolerance: f64,
    /// Half of the working area; infinite while the drives do not keep to it.
    area: f64,
    /// Highest distance of the first point outside the limits.
    start: f64,
}

impl PathRange {
    /// Returns the range of the joint with index `joint`, for a trajectory whose points are `step_ms` apart. The tolerance is one int16
    /// step of the position (96 µrad), plus the addition of one step of the velocity to the quintic between two points.
    pub fn of(config: &Config, joint: usize, step_ms: u16) -> Self {
        let (low, high) = config.position_range(joint);
        let tolerance = POSITION_STEP + WAY_OF_VELOCITY * f64::from(step_ms) / 1000.0 * VELOCITY_STEP;
        let area = if config.keeps_to_working_area() { WORKING_AREA } else { f64::INFINITY };
        Self {
            limits: (low, high),
            tolerated: ((low - tolerance).max(-area), (high + tolerance).min(area)),
            tolerance,
            area,
            start: config.start_tolerance_rad,
        }
    }

    /// Returns the nearest position inside the limits.
    pub fn nearest_inside(&self, position: f64) -> f64 {
        let (low, high) = self.limits;
        position.max(low).min(high)
    }

    /// Returns the limits with their tolerance: the range of a joint that is inside.
    pub fn tolerated(&self) -> (f64, f64) {
        self.tolerated
    }

    /// Returns `true` if `position` is inside the limits with their tolerance; `false` for NaN.
    pub fn contains(&self, position: f64) -> bool {
        let (low, high) = self.tolerated;
        position >= low && position <= high
    }

    /// Returns `true` if `position` is inside the limits themselves.
    pub(super) fn limits_contain(&self, position: f64) -> bool {
        let (low, high) = self.limits;
        position >= low && position <= high
    }

    /// Returns the range of the first point: up to the start tolerance outside the limits, and inside the working area.
    pub fn of_first(&self) -> (f64, f64) {
        ((self.tolerated.0 - self.start).max(-self.area), (self.tolerated.1 + self.start).min(self.area))
    }

    /// Returns the range of a whole path whose first point is at `first`; the range from inside if a path cannot begin there.
    pub fn of_path(&self, first: f64) -> (f64, f64) {
        let (low, high) = self.of_first();
        let comes_in = !self.limits_contain(first) && first >= low && first <= high;
        if comes_in { self.between(first) } else { self.tolerated }
    }

    /// Returns the range of the point that follows one at `before`, of a joint that is coming inside.
    pub(super) fn of_next(&self, before: f64) -> (f64, f64) {
        (self.tolerated.0.min(before), self.tolerated.1.max(before))
    }

    /// Returns the range of the interval between a point at `before` and the next one, of a joint that is coming inside.
    pub(super) fn between(&self, before: f64) -> (f64, f64) {
        let ((low, high), area) = (self.tolerated, self.area.max(before.abs()));
        if self.is_below(before) {
            ((before - self.tolerance).max(-area), high)
        } else {
            (low, (before + self.tolerance).min(area))
        }
    }

    /// Returns the range of the speed of the position there, rad/s: inwards, plus `slack` for rounding to the wire.
    pub(super) fn inward(&self, before: f64, slack: f64) -> (f64, f64) {
        if self.is_below(before) { (-slack, f64::INFINITY) } else { (f64::NEG_INFINITY, slack) }
    }

    /// Returns `true` if `position` is nearer to the lower limit, or below it.
    fn is_below(&self, position: f64) -> bool {
        let (low, high) = self.limits;
        position - low < high - position
    }

    /// Returns the limit that `position` is nearer to, or beyond.
    pub fn limit_at(&self, position: f64) -> f64 {
        let (low, high) = self.limits;
        if self.is_below(position) { low } else { high }
    }
}
