//! Check of a trajectory during its upload, point by point, before the arm moves (J-36).
//!
//! Between two points (J-32), the commanded velocity is a cubic polynomial and the commanded position is a quintic
//! polynomial. The derivative of the position is a quartic polynomial. This derivative differs from the commanded
//! velocity if the distance between the points is not equal to the integral of the cubic. The difference has the shape
//! of a bump. In Bernstein form, each curve lies within the convex hull of a few control points. An interval passes the
//! check at once if a rough estimate of the hulls of its curves is within the limits (`screen`). For any other
//! interval, the check halves the curves until the hull is within the limits or a point of the curve is outside
//! (`curve`).
//!
//! The wire format rounds positions to steps of 96 µrad. The derivative of the rounded positions can exceed a limit
//! that the path itself does not exceed. The check therefore reduces the distance of each interval by one rounding
//! step. The module `range` handles the effect of rounding on the positions, and paths that begin outside the limits
//! of a joint.
mod curve;
mod range;
mod screen;
#[cfg(test)]
mod tests;

use jtc_wire::{ACCELERATION_SCALE, POSITION_SCALE, RAW_FULL_SCALE, RawPoint, VELOCITY_SCALE};

use crate::bit_codec::{BitCodec, BitSink, BitSource, bit_codec};
use crate::config::Config;
use crate::friction;
use crate::interpolation::{SetPoint, interpolate};
use crate::parameters::TableOf;
use crate::{JOINTS, joint_error};
use curve::{Leaves, bound_crossed, leaves};
pub use range::PathRange;
pub(crate) use screen::SpeedRange;
use screen::{Screen, Steps};

/// Highest speed at the first and the last point that is considered standstill, rad/s.
pub const REST_SPEED: f64 = 0.02;
/// Steps of the wire format for position, velocity and acceleration, in rad, rad/s and rad/s².
const POSITION_STEP: f64 = POSITION_SCALE / RAW_FULL_SCALE;
const VELOCITY_STEP: f64 = VELOCITY_SCALE / RAW_FULL_SCALE;
const ACCELERATION_STEP: f64 = ACCELERATION_SCALE / RAW_FULL_SCALE;
/// Highest number of halvings in one interval, for all curves of all joints together. The check halves a curve until
/// the hull is at most about a thousandth of the height of the curve away from it. Six joints at their limits in one
/// interval can use up this number. After the last halving, the check compares the hull with the limits.
const HALVINGS: u8 = 16;

/// Quantity of a trajectory that can be outside its bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Position at a point, or position of the quintic between two points, rad.
    Position,
    /// Velocity at a point, or velocity of the cubic between two points, rad/s.
    Velocity,
    /// Acceleration at a point, rad/s².
    Acceleration,
    /// Derivative of the position between two points, rad/s. The distance between the two points is first reduced by one int16 step.
    PositionSpeed,
    /// Speed at the first or the last point, at which the joint must be at rest, rad/s.
    Rest,
    /// Velocity outside the friction table that the controller uses, rad/s.
    FrictionVelocity,
    /// Bearing temperature outside the friction table that the controller uses, °C.
    FrictionTemperature,
}

impl Quantity {
    /// All quantities, in the order of their numbers in a snapshot.
    const ALL: [Self; 7] = [
        Self::Position,
        Self::Velocity,
        Self::Acceleration,
        Self::PositionSpeed,
        Self::Rest,
        Self::FrictionVelocity,
        Self::FrictionTemperature,
    ];
}

impl BitCodec for Quantity {
    fn write<S: BitSink>(&self, to: &mut S) {
        to.put(*self as u32, 3);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        Self::ALL.get(from.take(3) as usize).copied().unwrap_or_else(|| {
            from.damage();
            Self::Position
        })
    }
}

/// First point or interval at which a trajectory is outside its bounds (J-36).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Violation {
    /// Index of the point, counted from 0.
    pub point: u32,
    /// Position in the interval to the next point, as a fraction from 0 to 1.
    pub fraction: f64,
    /// Index of the joint, counted from the base.
    pub joint: usize,
    /// Quantity that is outside its bounds.
    pub quantity: Quantity,
    /// Value of the quantity, in its unit.
    pub value: f64,
    /// Bound that the value exceeds.
    pub limit: f64,
}

bit_codec!(Violation { point, fraction, joint, quantity, value, limit });

/// Bounds of the trajectory in one joint.
#[derive(Clone, Copy, Debug)]
struct JointBounds {
    position: PathRange,
    speed: f64,
    acceleration: f64,
    /// Velocity range of the friction table. The range is unbounded if the controller uses no table.
    friction: (f64, f64),
}

/// State of the check of one trajectory, with the bounds and the last point.
#[derive(Clone, Debug)]
pub struct TrajectoryCheck {
    bounds: [JointBounds; JOINTS],
    screen: Screen,
    /// Time between points, s.
    step: f64,
    points: u32,
    last: RawPoint,
    last_steps: Steps,
    passed: Passed,
}

/// State of the check after all points that have been checked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Passed {
    /// Range of the velocities of each joint at and between the points that have been checked.
    pub speeds: [SpeedRange; JOINTS],
    /// Joints that began outside their position limits and have not moved inside yet.
    coming_in: [bool; JOINTS],
}

bit_codec!(Passed { speeds, coming_in });

impl Violation {
    /// Returns the error that this violation would cause in motion (J-43), as a bit of [`crate::joint_error`].
    pub fn joint_error(&self) -> u16 {
        match self.quantity {
            Quantity::Position => joint_error::POSITION,
            Quantity::Velocity | Quantity::PositionSpeed | Quantity::Rest => joint_error::VELOCITY,
            Quantity::Acceleration => joint_error::ACCELERATION,
            Quantity::FrictionVelocity | Quantity::FrictionTemperature => joint_error::FRICTION_TABLE,
        }
    }
}

impl TrajectoryCheck {
    /// Begins the check of a trajectory whose points are `step_ms` apart. `tables` are the friction tables, if the controller uses tables.
    pub fn new(config: &Config, step_ms: u16, tables: Option<&[TableOf<f32>; JOINTS]>) -> Self {
        let bounds = core::array::from_fn(|j| JointBounds {
            position: PathRange::of(config, j, step_ms),
            speed: config.joints[j].velocity_max,
            acceleration: config.joints[j].acceleration_max,
            friction: tables.map_or((f64::NEG_INFINITY, f64::INFINITY), |t| friction::velocities(&t[j])),
        });
        let step = f64::from(step_ms) / 1000.0;
        Self {
            screen: Screen::new(&bounds, step),
            bounds,
            step,
            points: 0,
            last: RawPoint::default(),
            last_steps: Steps::default(),
            passed: Passed::default(),
        }
    }

    /// Continues a check in which the first `points` points have passed. `last` is the last of these points, and `passed` is the state of
    /// the check after these points.
    pub(crate) fn behind(mut self, points: u32, last: RawPoint, passed: Passed) -> Self {
        (self.points, self.last, self.last_steps, self.passed) = (points, last, (&last).into(), passed);
        self
    }

    /// Checks the next point, and the interval from the last point to this point. The check then continues from this point, even if the
    /// point was rejected.
    pub fn take(&mut self, point: &RawPoint) -> Result<(), Violation> {
        let steps = Steps::from(point);
        let verdict = if self.points == 0 {
            self.begins(point)
        } else if self.screen.passes(&self.last_steps, &steps) {
            Ok(())
        } else {
            self.judge(point)
        };
        for (range, velocities) in self.passed.speeds.iter_mut().zip(self.screen.velocities(&steps)) {
            range.add(velocities, self.points);
        }
        if self.points == 0 {
            self.passed.coming_in = self.outside(point);
        } else if self.passed.coming_in != [false; JOINTS] {
            let outside = self.outside(point);
            self.passed.coming_in = core::array::from_fn(|j| self.passed.coming_in[j] & outside[j]);
        }
        (self.last, self.last_steps) = (*point, steps);
        self.points = self.points.saturating_add(1);
        verdict
    }

    /// Checks that the trajectory may end with the last point.
    pub fn end(&self) -> Result<(), Violation> {
        at_rest(&self.last, self.points.saturating_sub(1))
    }

    /// Returns the state of the check after the points that were checked so far.
    pub(crate) fn passed(&self) -> Passed {
        self.passed
    }

    /// Returns `true` for each joint that is outside its position limits, without the tolerance, at a point.
    fn outside(&self, point: &RawPoint) -> [bool; JOINTS] {
        let positions = point.position_rad();
        core::array::from_fn(|j| !self.bounds[j].position.limits_contain(positions[j]))
    }

    /// Checks the first point of a trajectory.
    fn begins(&self, point: &RawPoint) -> Result<(), Violation> {
        self.stands(point)?;
        at_rest(point, 0)
    }

    /// Checks a point of a trajectory, without the interval before this point.
    fn stands(&self, point: &RawPoint) -> Result<(), Violation> {
        let (at, before) = (SetPoint::from(point), self.last.position_rad());
        for (j, bounds) in self.bounds.iter().enumerate() {
            let (q, v, a) = (at.position[j], at.velocity[j], at.acceleration[j]);
            let range = &bounds.position;
            let (low, high) = match self.points {
                0 => range.of_first(),
                _ if self.passed.coming_in[j] => range.of_next(before[j]),
                _ => range.tolerated(),
            };
            if bound_crossed(q, low, high).is_some() {
                let (point, quantity, limit) = (self.points, Quantity::Position, range.limit_at(q));
                return Err(Violation { point, fraction: 0.0, joint: j, quantity, value: q, limit });
            }
            let outside = |quantity, value, (low, high)| {
                bound_crossed(value, low, high).map_or(Ok(()), |limit| {
                    Err(Violation { point: self.points, fraction: 0.0, joint: j, quantity, value, limit })
                })
            };
            outside(Quantity::Velocity, v, (-bounds.speed, bounds.speed))?;
            outside(Quantity::Acceleration, a, (-bounds.acceleration, bounds.acceleration))?;
            outside(Quantity::FrictionVelocity, v, bounds.friction)?;
            if self.points == 0 {
                // When path time starts or stops, the velocity of each joint passes through zero. The friction table
                // must therefore contain the velocity 0.
                outside(Quantity::FrictionVelocity, 0.0, bounds.friction)?;
            }
        }
        Ok(())
    }

    /// Checks a point of a trajectory, and the interval from the last point to this point.
    fn judge(&self, point: &RawPoint) -> Result<(), Violation> {
        self.stands(point)?;
        let (a, b, h) = (SetPoint::from(&self.last), SetPoint::from(point), self.step);
        let mut halvings = HALVINGS;
        for (j, bounds) in self.bounds.iter().enumerate() {
            let outside = |quantity, found: Option<Leaves>| {
                found.map_or(Ok(()), |Leaves { at, value, bound }| {
                    let point = self.points.saturating_sub(1);
                    Err(Violation { point, fraction: at, joint: j, quantity, value, limit: bound })
                })
            };
            let (p0, p1) = (a.position[j], b.position[j]);
            let (v0, v1) = (a.velocity[j] * h, b.velocity[j] * h);
            let (a0, a1) = (a.acceleration[j] * h * h, b.acceleration[j] * h * h);
            let position = [
                p0,
                p0 + v0 / 5.0,
                p0 + 2.0 * v0 / 5.0 + a0 / 20.0,
                p1 - 2.0 * v1 / 5.0 + a1 / 20.0,
                p1 - v1 / 5.0,
                p1,
            ];
            let (range, coming_in) = (&bounds.position, self.passed.coming_in[j]);
            let (low, high) = if coming_in { range.between(p0) } else { range.tolerated() };
            let found = leaves(position, low, high, &mut halvings);
            let limit = |found: Leaves| Leaves { bound: range.limit_at(found.value), ..found };
            outside(Quantity::Position, found.map(limit))?;
            // The velocities before this line are in rad per interval. The velocities after this line are in rad/s.
            let velocity = [v0, v0 + a0 / 3.0, v1 - a1 / 3.0, v1].map(|v| v / h);
            let found = leaves(velocity, -bounds.speed, bounds.speed, &mut halvings);
            outside(Quantity::Velocity, found)?;
            let found = leaves(velocity, bounds.friction.0, bounds.friction.1, &mut halvings);
            outside(Quantity::FrictionVelocity, found)?;
            let unexplained = p1 - p0 - 0.5 * (v0 + v1) - (a0 - a1) / 12.0;
            let unexplained = unexplained - unexplained.clamp(-POSITION_STEP, POSITION_STEP);
            let [c0, c1, c2, c3] = velocity;
            let speed = [
                c0,
                0.25 * (c0 + 3.0 * c1),
                0.5 * (c1 + c2) + 5.0 * unexplained / h,
                0.25 * (3.0 * c2 + c3),
                c3,
            ];
            let found = leaves(speed, -bounds.speed, bounds.speed, &mut halvings);
            outside(Quantity::PositionSpeed, found)?;
            if coming_in && !range.contains(p0) {
                let (low, high) = range.inward(p0, VELOCITY_STEP + h * ACCELERATION_STEP);
                let found = leaves(speed, low, high, &mut halvings);
                // `at` is the position in the interval at which the curve turns outwards. If the curve is still inside the range at `at`,
                // the check reports the point at the start of the interval.
                let place = |Leaves { at, .. }: Leaves| {
                    let value = interpolate(&a, &b, h, at).position[j];
                    let value = if range.contains(value) { p0 } else { value };
                    Leaves { at, value, bound: range.limit_at(p0) }
                };
                outside(Quantity::Position, found.map(place))?;
            }
        }
        Ok(())
    }
}

/// Checks that every joint is at rest at this point.
fn at_rest(point: &RawPoint, index: u32) -> Result<(), Violation> {
    for (j, value) in point.velocity_rad_s().into_iter().enumerate() {
        if let Some(limit) = bound_crossed(value, -REST_SPEED, REST_SPEED) {
            let quantity = Quantity::Rest;
            return Err(Violation { point: index, fraction: 0.0, joint: j, quantity, value, limit });
        }
    }
    Ok(())
}

/// Checks that a trajectory with these `speeds` is inside the present friction `tables`. The trajectory was loaded while the controller
/// used another friction model.
pub(crate) fn inside_tables(
    speeds: &[SpeedRange; JOINTS],
    tables: &[TableOf<f32>; JOINTS],
) -> Result<(), Violation> {
    for (joint, (range, table)) in speeds.iter().zip(tables).enumerate() {
        let (low, high) = friction::velocities(table);
        for (value, point) in range.ends() {
            if let Some(limit) = bound_crossed(value, low, high) {
                let quantity = Quantity::FrictionVelocity;
                return Err(Violation { point, fraction: 0.0, joint, quantity, value, limit });
            }
        }
    }
    Ok(())
}

/// Checks that these bearing `temperatures` (°C) are inside the friction `tables`.
pub(crate) fn temperatures_inside(
    temperatures: &[f64; JOINTS],
    tables: &[TableOf<f32>; JOINTS],
) -> Result<(), Violation> {
    for (joint, (&value, table)) in temperatures.iter().zip(tables).enumerate() {
        let (low, high) = friction::temperatures(table);
        if let Some(limit) = bound_crossed(value, low, high) {
            let quantity = Quantity::FrictionTemperature;
            return Err(Violation { point: 0, fraction: 0.0, joint, quantity, value, limit });
        }
    }
    Ok(())
}
