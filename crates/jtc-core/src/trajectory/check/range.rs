//! Positions of a joint that a path may have (J-36).
//!
//! The check adds two allowances to the position limits. The first allowance is a tolerance for rounding. If a path
//! ends exactly on a position limit, rounding to the wire format can move its end slightly beyond this limit. This is
//! not an error of the path. The second allowance is for a joint that is outside a position limit when the path
//! begins. The path may then also start outside this limit. Until the joint is inside its limits again, the path must
//! not move the joint further out.
use super::{POSITION_STEP, VELOCITY_STEP};
use crate::config::{Config, WORKING_AREA};

/// Change of the quintic (rad) in the middle between two points that are 1 s apart. The velocity changes by +1 rad/s at the first point and
/// by −1 rad/s at the second point. The exact change is 5/16.
const WAY_OF_VELOCITY: f64 = 0.3125;

/// Range of positions that a path may have in one joint (J-36), rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathRange {
    /// Position limits, clipped to the working area of the drives if the drives keep to this area (J-43).
    limits: (f64, f64),
    /// Position limits with their tolerance, inside the working area.
    tolerated: (f64, f64),
    /// Largest increase of a position between two points due to rounding to the wire format.
    tolerance: f64,
    /// Half of the working area. This value is infinite if the drives do not keep to their working area.
    area: f64,
    /// Largest distance of the first point from the position limits, if this point is outside.
    start: f64,
}

impl PathRange {
    /// Returns the range of the joint with index `joint`, for a trajectory with `step_ms` between its points. The
    /// tolerance is one int16 step of the position (96 µrad), plus the change of the quintic between two points that
    /// one step of the velocity causes.
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

    /// Returns the position inside the limits that is nearest to `position`.
    pub fn nearest_inside(&self, position: f64) -> f64 {
        let (low, high) = self.limits;
        position.max(low).min(high)
    }

    /// Returns the position limits with their tolerance. A joint that is inside its limits may have any position within this tolerance.
    pub fn tolerated(&self) -> (f64, f64) {
        self.tolerated
    }

    /// Returns `true` if `position` is inside the limits with their tolerance. Returns `false` for NaN.
    pub fn contains(&self, position: f64) -> bool {
        let (low, high) = self.tolerated;
        position >= low && position <= high
    }

    /// Returns `true` if `position` is inside the limits without the tolerance.
    pub(super) fn limits_contain(&self, position: f64) -> bool {
        let (low, high) = self.limits;
        position >= low && position <= high
    }

    /// Returns the range of positions for the first point of a path. The first point may be outside the limits by the start tolerance, but
    /// must be inside the working area.
    pub fn of_first(&self) -> (f64, f64) {
        ((self.tolerated.0 - self.start).max(-self.area), (self.tolerated.1 + self.start).min(self.area))
    }

    /// Returns the range of positions for a whole path whose first point is at `first`. If a path cannot begin at this point, returns the
    /// range of a path that begins inside the limits.
    pub fn of_path(&self, first: f64) -> (f64, f64) {
        let (low, high) = self.of_first();
        let comes_in = !self.limits_contain(first) && first >= low && first <= high;
        if comes_in { self.between(first) } else { self.tolerated }
    }

    /// Returns the range of positions for the point after a point at `before`, for a joint that is moving back into its limits.
    pub(super) fn of_next(&self, before: f64) -> (f64, f64) {
        (self.tolerated.0.min(before), self.tolerated.1.max(before))
    }

    /// Returns the range of positions between a point at `before` and the next point, for a joint that is moving back into its limits.
    pub(super) fn between(&self, before: f64) -> (f64, f64) {
        let ((low, high), area) = (self.tolerated, self.area.max(before.abs()));
        if self.is_below(before) {
            ((before - self.tolerance).max(-area), high)
        } else {
            (low, (before + self.tolerance).min(area))
        }
    }

    /// Returns the range of the derivative of the position after a point at `before`, rad/s. The joint must move inwards, with an allowance
    /// of `slack` for rounding to the wire format.
    pub(super) fn inward(&self, before: f64, slack: f64) -> (f64, f64) {
        if self.is_below(before) { (-slack, f64::INFINITY) } else { (f64::NEG_INFINITY, slack) }
    }

    /// Returns `true` if `position` is nearer to the lower limit than to the upper limit, or is below the lower limit.
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
