//! Division of a path section into cells (short intervals), and limits of the path speed and acceleration in each
//! cell. These limits follow from the joint limits.
use jtc_wire::Joint;

use crate::compose::Section;
use crate::path::PathPoint;
use crate::profile::Bounds;
use crate::{ArmDynamics, JOINTS, JointVec, Limits, PlanError};

/// Number of cells into which each part of a path between two breaks is divided.
struct Division {
    straight: usize,
    curved: usize,
    /// Smallest number of cells of the whole path, for a path that has few parts.
    least: usize,
}

const COARSE: Division = Division { straight: 6, curved: 3, least: 120 };
/// Division for a time law whose acceleration changes only at the ends of the cells.
const FINE: Division = Division { straight: 16, curved: 9, least: 400 };

/// Largest share of the torque available for motion that the term with ṡ² (the squared path speed) is allowed to use.
const SPEED_TORQUE_SHARE: f64 = 0.8;
/// Share of the usable torque that a plan uses.
const TORQUE_SHARE: f64 = 0.9975;
/// Share of the torque limit that must remain available for motion after friction. The path speed is reduced until
/// this share remains.
const MOTION_SHARE: f64 = 0.05;
/// Share of the torque left at standstill that must remain available for motion, if this is less than
/// [`MOTION_SHARE`] of the limit. The torque left at standstill is the usable torque minus holding torque and
/// breakaway friction.
const STANDING_SHARE: f64 = 0.5;
/// Smallest share of the torque limit that must always remain available for motion. This share is sufficient for a slow
/// motion.
const CREEP_SHARE: f64 = 0.002;

/// Parts of the torque at a point, N·m. With q̈ = q′·s̈ + q″·ṡ² the torque is hold + mass·s̈ + speed·ṡ², plus friction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Loads {
    pub hold: JointVec,
    pub mass: JointVec,
    pub speed: JointVec,
}

impl Loads {
    fn at(point: &PathPoint, arm: &ArmDynamics) -> Self {
        let zero = [0.0; JOINTS];
        let hold = arm.holding(&point.position);
        let without = |mut torque: JointVec| {
            torque.iter_mut().zip(&hold).for_each(|(t, h)| *t -= h);
            torque
        };
        let mass = without(arm.rigid(&point.position, &zero, &point.first));
        Self { hold, mass, speed: without(arm.rigid(&point.position, &point.first, &point.second)) }
    }
}

/// Point of the path at one end of a cell, and the torques at this point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub point: PathPoint,
    pub loads: Option<Loads>,
}

/// Short interval of a path section, on which the path is a single smooth curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    /// Path parameter at the start of the cell, counted from the start of the section. The next field is the
    /// parameter at the end of the cell.
    pub from: f64,
    pub to: f64,
    pub ends: [End; 2],
    /// Third derivative of the path, averaged over the cell.
    pub third: JointVec,
}

/// Returns the cells of a section. If `fine` is set, the cells are smaller, for a time law whose acceleration changes
/// only at the ends of the cells.
pub(crate) fn cells(
    section: &Section,
    arm: Option<&ArmDynamics>,
    limits: &Limits,
    fine: bool,
) -> Result<Vec<Cell>, PlanError> {
    let division = if fine { FINE } else { COARSE };
    let mut cells = Vec::new();
    for (from, to) in section.parts() {
        let side = (from, to);
        let inside = [0.25, 0.5, 0.75].map(|u| section.at(from + u * (to - from), side));
        let is_straight = inside.iter().all(|p| p.second == [0.0; JOINTS]);
        let count = if is_straight { division.straight } else { division.curved };
        let count = count.max(division.least / section.parts_of_path);
        // Near a point at which the arm is at rest, the speed changes within a short distance, so the cells there are
        // shorter.
        let (begins, ends) = (from == section.from && !fine, to == section.to && !fine);
        let share = |i: usize| {
            let u = i as f64 / count as f64;
            match (begins, ends) {
                (true, true) => (0.5 * std::f64::consts::PI * u).sin().powi(2),
                (true, false) => u * u,
                (false, true) => u * (2.0 - u),
                (false, false) => u,
            }
        };
        let place = |i: usize| from + (to - from) * share(i);
        let end = |i: usize| {
            let s = place(i);
            let point = section.at(if i == count { to } else { s }, side);
            checked(section, &point, s, limits)?;
            Ok::<End, PlanError>(End { point, loads: arm.map(|arm| Loads::at(&point, arm)) })
        };
        let mut before = end(0)?;
        for i in 0..count {
            let after = end(i + 1)?;
            let (a, b) = (place(i) - section.from, place(i + 1) - section.from);
            let (p, q) = (&before.point.second, &after.point.second);
            let third = std::array::from_fn(|j| (q[j] - p[j]) / (b - a));
            cells.push(Cell { from: a, to: b, ends: [before, after], third });
            before = after;
        }
    }
    Ok(cells)
}

/// Checks that a point of the path is within the position limits, and that the path has a direction at this point.
fn checked(section: &Section, point: &PathPoint, s: f64, limits: &Limits) -> Result<(), PlanError> {
    let leg = section.path.waypoint(s).unwrap_or(1);
    let numbers = point.first.iter().chain(&point.second);
    if numbers.into_iter().any(|x| !x.is_finite()) {
        return Err(PlanError::Path { leg, parameter: s });
    }
    // The tolerance allows for rounding between two positions that are exactly at the limit.
    for joint in Joint::ALL {
        let (value, (min, max)) = (point.position[joint.index()], limits.position[joint.index()]);
        if !(min - 1e-9..=max + 1e-9).contains(&value) {
            return Err(PlanError::Position { waypoint: leg, joint, value, min, max });
        }
    }
    Ok(())
}

/// Torque available for motion in the positive (`high`) and negative (`low`) direction at one end of a cell, N·m. The
/// available torque is the usable torque minus the holding torque and the highest friction torque. The friction is
/// evaluated up to the cell's speed in the direction of the path.
pub(crate) struct Room {
    pub high: JointVec,
    pub low: JointVec,
    /// Usable torque.
    limit: JointVec,
}

/// Returns the torque of the joint with index `j` (N·m) that a plan is allowed to use if the holding torque is
/// `hold`.
pub(crate) fn planned_torque(arm: &ArmDynamics, limits: &Limits, j: usize, hold: f64) -> f64 {
    TORQUE_SHARE * arm.usable_torque(limits, j, hold)
}

impl Room {
    /// Computes the available torque for a squared parameter speed of at most `cap`.
    pub(crate) fn new(end: &End, loads: &Loads, cap: f64, limits: &Limits, arm: &ArmDynamics) -> Self {
        let mut room = Self { high: [0.0; JOINTS], low: [0.0; JOINTS], limit: [0.0; JOINTS] };
        for j in 0..JOINTS {
            let limit = planned_torque(arm, limits, j, loads.hold[j]);
            room.limit[j] = limit;
            let fastest = end.point.first[j] * cap.sqrt();
            let (low, high) = arm.friction_range(j, fastest);
            room.high[j] = limit - loads.hold[j] - high;
            room.low[j] = limit + loads.hold[j] + low;
        }
        room
    }

    /// Returns the available torque and the index of the joint for which the difference between available torque and
    /// `needed` is smallest. The torques are shares of the joint's torque limit.
    fn least(&self, limits: &Limits, needed: &JointVec) -> (f64, usize) {
        let share = |j: usize| self.high[j].min(self.low[j]) / limits.torque[j];
        let over = |j: &usize| share(*j) - needed[*j];
        let least = (0..JOINTS).min_by(|a, b| over(a).total_cmp(&over(b))).unwrap_or(0);
        (share(least), least)
    }
}

impl Cell {
    /// Returns `true` if the path has no curvature in this cell.
    pub(crate) fn is_straight(&self) -> bool {
        self.ends.iter().all(|end| end.point.second == [0.0; JOINTS])
    }

    /// Returns the highest squared speed that the velocity limits permit.
    pub(crate) fn speed_cap(&self, limits: &Limits) -> f64 {
        let mut cap = f64::INFINITY;
        for end in &self.ends {
            for j in 0..JOINTS {
                let ratio = limits.velocity[j] / end.point.first[j].abs();
                cap = cap.min(ratio * ratio);
            }
        }
        cap
    }

    /// Returns the squared speed, at most `cap`, at which enough torque remains for motion after friction.
    ///
    /// # Errors
    ///
    /// Returns the joint, the required torque and the usable torque if a joint has no torque for motion at any speed.
    pub(crate) fn friction_cap(
        &self,
        mut cap: f64,
        limits: &Limits,
        arm: &ArmDynamics,
    ) -> Result<f64, (Joint, f64, f64)> {
        const SLOWEST: f64 = 1e-4;
        let fastest = cap;
        for end in &self.ends {
            let Some(loads) = &end.loads else { continue };
            let needed = std::array::from_fn(|j| {
                let stands = loads.hold[j].abs() + arm.breakaway(j);
                let left = planned_torque(arm, limits, j, loads.hold[j]) - stands;
                (STANDING_SHARE * left / limits.torque[j]).clamp(CREEP_SHARE, MOTION_SHARE)
            });
            loop {
                let room = Room::new(end, loads, cap, limits, arm);
                let (share, j) = room.least(limits, &needed);
                if share >= needed[j] {
                    break;
                }
                if cap <= SLOWEST * fastest {
                    // The torque is sufficient for a slow motion, so the speed is not reduced further.
                    if share > CREEP_SHARE {
                        break;
                    }
                    let joint = Joint::ALL[j];
                    let with = |share: f64| room.limit[j] - share * limits.torque[j];
                    return Err((joint, with(share), with(CREEP_SHARE)));
                }
                cap *= 0.8;
            }
        }
        Ok(cap)
    }

    /// Returns limits of the speed and the acceleration of the path parameter. The squared speed is at most `cap`.
    /// Each combination of speed and acceleration within these limits keeps the joints within their limits.
    ///
    /// `share` is the share of the acceleration and jerk limits that the curvature of the path is allowed to use.
    /// Friction is considered up to the squared speed `reached`.
    pub(crate) fn bounds(
        &self,
        cap: f64,
        reached: f64,
        share: f64,
        limits: &Limits,
        arm: Option<&ArmDynamics>,
    ) -> Bounds {
        let mut cap = cap;
        for end in &self.ends {
            for j in 0..JOINTS {
                let curvature = end.point.second[j].abs();
                cap = cap.min(share * limits.acceleration[j] / curvature);
                let turn = share * limits.jerk[j] / self.third[j].abs();
                cap = cap.min(turn.cbrt() * turn.cbrt());
            }
            if let (Some(loads), Some(arm)) = (&end.loads, arm) {
                let room = Room::new(end, loads, cap.min(reached), limits, arm);
                for j in 0..JOINTS {
                    let room = if loads.speed[j] > 0.0 { room.high[j] } else { room.low[j] };
                    cap = cap.min((SPEED_TORQUE_SHARE * room / loads.speed[j].abs()).max(1e-12));
                }
            }
        }
        let mut bounds = Bounds { from: self.from, to: self.to, cap, up: f64::INFINITY, down: f64::INFINITY };
        for end in &self.ends {
            self.accelerations(end, reached, limits, arm, &mut bounds);
        }
        bounds
    }

    fn accelerations(
        &self,
        end: &End,
        reached: f64,
        limits: &Limits,
        arm: Option<&ArmDynamics>,
        bounds: &mut Bounds,
    ) {
        let (cap, speed) = (bounds.cap, bounds.cap.sqrt());
        let mut most = f64::INFINITY;
        for j in 0..JOINTS {
            let (first, second) = (end.point.first[j].abs(), end.point.second[j].abs());
            most = most.min((limits.acceleration[j] - second * cap) / first);
            // Half of the remaining jerk is reserved for changes of the acceleration.
            let left = limits.jerk[j] - self.third[j].abs() * cap * speed;
            most = most.min(0.5 * left / (3.0 * second * speed));
        }
        (bounds.up, bounds.down) = (bounds.up.min(most), bounds.down.min(most));
        let (Some(loads), Some(arm)) = (&end.loads, arm) else { return };
        let room = Room::new(end, loads, cap.min(reached), limits, arm);
        for j in 0..JOINTS {
            let (mass, by_speed) = (loads.mass[j], loads.speed[j] * cap.min(reached));
            let high = room.high[j] - by_speed.max(0.0);
            let low = room.low[j] + by_speed.min(0.0);
            let (up, down) = if mass > 0.0 { (high, low) } else { (low, high) };
            bounds.up = bounds.up.min((up / mass.abs()).max(1e-9));
            bounds.down = bounds.down.min((down / mass.abs()).max(1e-9));
        }
    }
}
