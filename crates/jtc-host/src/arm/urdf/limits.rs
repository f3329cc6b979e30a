//! Joint limits of a robot description. Limits beyond the range of the drives are reduced to this range.

use std::f64::consts::PI;

use jtc_core::{Config, JOINTS, JointConfig, WORKING_AREA};
use jtc_wire::Joint as Number;

use super::Chain;
use super::choice::about;
use super::robot::{Joint, Kind, Limit, TURN};
use crate::arm::{Arm, Change};
use crate::file::FileError;

/// Largest credible position limit of a multi-turn joint in either direction, rad. A larger value is probably in
/// degrees.
const TWO_TURNS: f64 = 4.0 * PI;
/// Largest credible velocity limit of a joint, rad/s. The fastest wrist joints reach 900 °/s, which is 15.7 rad/s. A larger velocity limit
/// is in degrees per second, or is a placeholder.
const BELIEVABLE_SPEED: f64 = 16.0;
/// Largest acceleration that a frame of a trajectory can contain, rad/s².
const ACCELERATION_MAX: f64 = jtc_wire::ACCELERATION_SCALE;

/// Rounds a number to four decimals.
pub(super) fn short(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn is_limit(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

/// Returns the highest velocity limit that the drives accept, rad/s.
fn fastest() -> f64 {
    let drives = Config::avena();
    drives.drive_speed_trip.min(drives.velocity_full_scale) / drives.overspeed_factor
}

/// Rejects position limits that are not a valid range in rad. Invalid limits are not replaced by the whole range of
/// the drives, because the arm could then hit its end stops. Returns `true` if the joint can turn more than one full
/// turn in each direction, like some wrists.
fn turns_more_than_once(joint: &Joint, (lower, upper): (f64, f64)) -> Result<bool, FileError> {
    if let Some(limit) = [lower, upper].into_iter().find(|limit| limit.is_nan()) {
        return Err(about(
            joint,
            format!("position limit {limit} is not a number: write both limits in rad"),
        ));
    }
    if lower == upper {
        let problem = format!(
            "position limits {lower}..{upper} rad leave no range of motion: write both limits in rad, or type=\"fixed\" for a joint that does not \
             move"
        );
        return Err(about(joint, problem));
    }
    if lower > upper {
        return Err(about(joint, format!("lower limit {lower} is not below upper limit {upper}")));
    }
    let beyond = |limit: &f64| limit.is_finite() && limit.abs() > TURN;
    let degrees: Vec<String> = [lower, upper]
        .iter()
        .filter(|limit| beyond(limit))
        .map(|limit| format!("{limit}° are {} rad", short(limit.to_radians())))
        .collect();
    if degrees.is_empty() {
        return Ok(false);
    }
    if [-lower, upper].iter().all(|limit| (TURN..=TWO_TURNS).contains(limit)) {
        return Ok(true);
    }
    let problem = format!(
        "position limits {}..{} rad exceed one turn. If they are degrees: {}. Write rad, or type=\"continuous\" for a joint without stops",
        short(lower),
        short(upper),
        degrees.join(", ")
    );
    Err(about(joint, problem))
}

impl Chain<'_> {
    /// Returns the limits of all six joints. A missing limit is replaced by the limit of the default arm or of the
    /// drives, and is marked as a default.
    pub(super) fn limits(&mut self) -> Result<[JointConfig; JOINTS], FileError> {
        let mut all = Arm::avena().joints;
        for (number, joint) in Number::ALL.into_iter().zip(self.rotary) {
            let to = &mut all[number.index()];
            to.rotor_inertia = 0.0;
            let limit = joint.limit()?;
            self.position(number, joint, &limit, to)?;
            self.dynamic_limits(number, joint, &limit, to);
            let defaults =
                ["position_error_max_rad", "torque_gain", "drive_torque_max_nm", "teach_damping_nm_s_rad"];
            for key in defaults {
                self.sources.fill_in((Some(number), key));
            }
            let place = format!("joint {}", joint.name);
            if joint.has_safety_controller() {
                self.warn(Change::NotCarried, place, "safety_controller");
            }
        }
        self.narrow_to_drives(&mut all)?;
        Ok(all)
    }

    fn position(
        &mut self,
        number: Number,
        joint: &Joint,
        limit: &Limit,
        to: &mut JointConfig,
    ) -> Result<(), FileError> {
        const WHOLE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
        let endless = joint.kind == Kind::Continuous;
        let ends = match limit.range {
            None => WHOLE,
            Some(range) if endless => self.credible(joint, range),
            Some(range) => {
                if turns_more_than_once(joint, range)? {
                    for key in ["position_min_rad", "position_max_rad"] {
                        self.sources.fill_in((Some(number), key));
                    }
                }
                range
            }
        };
        (to.position_min, to.position_max) = ends;
        // If a position limit is missing, the limit of the drives is used, because the description does not contain
        // the end stops of the joint.
        let mut assumed = Vec::new();
        for (key, limit, end) in [
            ("position_min_rad", &mut to.position_min, -WORKING_AREA),
            ("position_max_rad", &mut to.position_max, WORKING_AREA),
        ] {
            if limit.is_infinite() {
                *limit = end;
                self.sources.fill_in((Some(number), key));
                assumed.push(end);
            }
        }
        let words = match assumed.as_slice() {
            [] => return Ok(()),
            [end] => format!("no position limit on one side: {end} rad is used there"),
            _ if endless => {
                format!(
                    "continuous joint, no position limits: {}..{} rad are used",
                    -WORKING_AREA, WORKING_AREA
                )
            }
            _ => format!("no position limits: {}..{} rad are used", -WORKING_AREA, WORKING_AREA),
        };
        self.warn(Change::LimitAssumed, format!("joint {}", joint.name), words);
        Ok(())
    }

    /// Returns the limits of a continuous joint that the description contains all the same. A limit that is not an
    /// angle in rad within one turn is not used. The joint has no stops, so the range of the drives is used instead.
    fn credible(&mut self, joint: &Joint, (lower, upper): (f64, f64)) -> (f64, f64) {
        let believed = |limit: f64| limit.abs() <= TURN;
        let ends = (
            if believed(lower) { lower } else { f64::NEG_INFINITY },
            if believed(upper) { upper } else { f64::INFINITY },
        );
        let range = (ends.0.max(-WORKING_AREA), ends.1.min(WORKING_AREA));
        let all_believed = [lower, upper].into_iter().all(|limit| limit.is_infinite() || believed(limit));
        if range.0 < range.1 && all_believed {
            return ends;
        }
        let problem = format!(
            "position limits {lower}..{upper} of a continuous joint are not a range in rad within one turn: what is beyond is not used"
        );
        self.warn(Change::LimitAssumed, format!("joint {}", joint.name), problem);
        if range.0 < range.1 { ends } else { (f64::NEG_INFINITY, f64::INFINITY) }
    }

    fn dynamic_limits(&mut self, number: Number, joint: &Joint, limit: &Limit, to: &mut JointConfig) {
        let place = format!("joint {}", joint.name);
        if is_limit(limit.velocity) && limit.velocity <= BELIEVABLE_SPEED {
            to.velocity_max = limit.velocity;
        } else if is_limit(limit.velocity) {
            // The value is too high for rad/s, so the reader assumes °/s, which is the lower speed. The reader also
            // limits the value to the highest speed of the drives, and marks it as a default.
            let in_degrees = limit.velocity.to_radians();
            to.velocity_max = in_degrees.min(fastest());
            self.sources.fill_in((Some(number), "velocity_max_rad_s"));
            let problem = format!(
                "velocity limit {}: too high for an arm in rad/s; {0} °/s are {} rad/s; {} rad/s is used",
                limit.velocity,
                short(in_degrees),
                short(to.velocity_max)
            );
            self.warn(Change::LimitAssumed, &place, problem);
        } else {
            self.sources.fill_in((Some(number), "velocity_max_rad_s"));
            let problem = format!("velocity limit {}: {} rad/s is used", limit.velocity, to.velocity_max);
            self.warn(Change::LimitAssumed, &place, problem);
        }
        if is_limit(limit.effort) {
            to.torque_max = limit.effort;
        } else {
            self.sources.fill_in((Some(number), "torque_max_nm"));
            let problem = format!("effort limit {}: {} N·m is used", limit.effort, to.torque_max);
            self.warn(Change::LimitAssumed, &place, problem);
        }
        if is_limit(limit.acceleration) {
            to.acceleration_max = limit.acceleration.min(ACCELERATION_MAX);
            if limit.acceleration > ACCELERATION_MAX {
                let problem = format!(
                    "acceleration limit {}: {ACCELERATION_MAX:.4} rad/s² is used, because a trajectory cannot contain more",
                    limit.acceleration
                );
                self.warn(Change::LimitCut, &place, problem);
            }
        } else {
            self.sources.fill_in((Some(number), "acceleration_max_rad_s2"));
        }
    }

    /// Narrows the joint limits to the limits of the drives. A description contains the limits of the mechanism. The controller refuses
    /// limits beyond the limits of the drives (J-35, J-43).
    fn narrow_to_drives(&mut self, joints: &mut [JointConfig; JOINTS]) -> Result<(), FileError> {
        let drives = Config::avena();
        let fastest = fastest();
        let bus = jtc_bus::TORQUE_FULL_SCALE;
        for ((rotary, to), drive) in self.rotary.into_iter().zip(joints).zip(jtc_bus::DRIVE_TORQUE_MAX) {
            let place = format!("joint {}", rotary.name);
            self.narrow_position(rotary, to)?;
            if to.velocity_max > fastest {
                let problem = format!(
                    "velocity limit {}: {fastest} rad/s is used, because the drives trip above {} rad/s",
                    short(to.velocity_max),
                    drives.drive_speed_trip
                );
                to.velocity_max = fastest;
                self.warn(Change::LimitCut, &place, problem);
            }
            if to.torque_max > drive.min(bus) {
                let why = if drive < bus {
                    "the maximum of the known drives at this joint; for a stronger drive, set torque_max_nm and drive_torque_max_nm in the file"
                } else {
                    "the maximum of the joint bus"
                };
                let problem =
                    format!("effort limit {}: {} N·m is used, {why}", to.torque_max, drive.min(bus));
                to.torque_max = drive.min(bus);
                self.warn(Change::LimitCut, &place, problem);
            }
        }
        Ok(())
    }

    fn narrow_position(&mut self, joint: &Joint, to: &mut JointConfig) -> Result<(), FileError> {
        let (min, max) = (to.position_min, to.position_max);
        if min >= -WORKING_AREA && max <= WORKING_AREA {
            return Ok(());
        }
        (to.position_min, to.position_max) =
            (min.clamp(-WORKING_AREA, WORKING_AREA), max.clamp(-WORKING_AREA, WORKING_AREA));
        let limits = format!("position limits {}..{}", short(min), short(max));
        let shift = short(0.5 * (min + max));
        if to.position_min >= to.position_max {
            let problem = format!(
                "{limits} rad are outside the drives' working area, ±{WORKING_AREA} rad: move the zero of the joint by {shift} rad into the middle \
                 of its range (turn its origin about its axis, and subtract this angle from both limits)"
            );
            return Err(about(joint, problem));
        }
        let kept = to.position_max - to.position_min;
        let could = (max - min).min(2.0 * WORKING_AREA);
        let mut problem = format!(
            "{limits} exceed the drives' working area: {}..{} rad are used",
            short(to.position_min),
            short(to.position_max)
        );
        if kept < 0.9 * could {
            problem +=
                &format!("; with the zero of the joint at {shift} rad, {} rad would be usable", short(could));
        }
        self.warn(Change::LimitCut, format!("joint {}", joint.name), problem);
        Ok(())
    }
}
