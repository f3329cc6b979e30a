//! Positions of a joint that a path may have (J-36).
//!
//! Two allowances are added to the position limits. The first is the tolerance: rounding to the wire format moves a path that ends exactly
//! on a limit slightly beyond it, which is not a fault of the path. The second is for a joint outside a limit. Such a joint may start
//! there. Until it is back inside, it must not move further out.
use super::{POSITION_STEP, VELOCITY_STEP};
use crate::config::{Config, WORKING_AREA};

/// Distance (rad) in the middle of the quintic between two points 1 s apart, if the first velocity is 1 rad/s higher and the second one 1
/// rad/s lower: 5/16.
const WAY_OF_VELOCITY: f64 = 0.3125;

/// Positions of one joint that a path may have (J-36), rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRange {
    /// Position limits, inside the working area of the drives while these keep to it (J-43).
    limits: (f64, f64),
    /// The limits with their tolerance, inside the working area.
    tolerated: (f64, f64),
    /// Largest increase of a position between two points due to rounding to the wire format.
    tolerance: f64,
    /// Half of the working area; infinite while the drives do not keep to it.
    area: f64,
    /// Highest distance of the first point from the limits.
    start: f64,
}

impl PathRange {
    /// Returns the range of the joint with index `joint`, for a trajectory whose points are `step_ms` apart. The tolerance is one int16
    /// step of the position (96 µrad), plus the effect of one step of the velocity on the quintic between two points.
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

    /// Returns the limits with their tolerance, which are the range of a joint that is inside.
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

    /// Returns the range of the first point: it may be outside the limits by the start tolerance, but must be inside the working area.
    pub fn of_first(&self) -> (f64, f64) {
        ((self.tolerated.0 - self.start).max(-self.area), (self.tolerated.1 + self.start).min(self.area))
    }

    /// Returns the range of a whole path whose first point is at `first`. If a path cannot begin there, returns the range of a path that
    /// begins inside.
    pub fn of_path(&self, first: f64) -> (f64, f64) {
        let (low, high) = self.of_first();
        let comes_in = !self.limits_contain(first) && first >= low && first <= high;
        if comes_in { self.between(first) } else { self.tolerated }
    }

    /// Returns the range of the point after a point at `before`, for a joint that is moving back inside.
    pub(super) fn of_next(&self, before: f64) -> (f64, f64) {
        (self.tolerated.0.min(before), self.tolerated.1.max(before))
    }

    /// Returns the range of the interval between a point at `before` and the next one, for a joint that is moving back inside.
    pub(super) fn between(&self, before: f64) -> (f64, f64) {
        let ((low, high), area) = (self.tolerated, self.area.max(before.abs()));
        if self.is_below(before) {
            ((before - self.tolerance).max(-area), high)
        } else {
            (low, (before + self.tolerance).min(area))
        }
    }

    /// Returns the range of the derivative of the position in that interval, rad/s: inwards, plus `slack` for rounding to the wire format.
    pub(super) fn inward(&self, before: f64, slack: f64) -> (f64, f64) {
        if self.is_below(before) { (-slack, f64::INFINITY) } else { (f64::NEG_INFINITY, slack) }
    }

    /// Returns `true` if `position` is nearer to the lower limit, or below it.
    fn is_below(&self, position: f64) -> bool {
        let (low, high) = self.limits;
        position - low < high - position
    }

    /// Returns the limit that `position` is closest to or has passed.
    pub fn limit_at(&self, position: f64) -> f64 {
        let (low, high) = self.limits;
        if self.is_below(position) { low } else { high }
    }
}
