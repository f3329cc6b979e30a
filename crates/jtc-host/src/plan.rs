//! Planner for moves to a goal and motions through waypoints. This module also changes the speed of trajectories.
//!
//! The crate `jtc-plan` computes the motions. These motions are as fast as the limits of velocity, acceleration, jerk and torque allow.
//! This module converts a motion into a trajectory with points at a fixed time step. The planner returns a trajectory only if the
//! trajectory passes the [check](crate::check), which is the same check as for trajectory files. If rounding, a Pause on the path (J-33) or
//! friction would exceed a limit, the planner slows down the motion and adds a note to [`Planned::notes`].
//!
//! ```
//! use jtc_host::{Arm, plan::Planner};
//!
//! let arm = Arm::avena();
//! let (config, friction) = (arm.config(), arm.friction());
//! let planner = Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
//! let planned = planner.to(&[0.0; 6], &[0.5, 0.3, -0.4, 0.2, 0.6, -0.5])?;
//! assert_eq!(planned.trajectory.points.last().unwrap().position[4], 0.6);
//! # Ok::<(), jtc_host::plan::PlanError>(())
//! ```

mod approach;
mod corners;
mod default_speed;
mod error;
mod lines;
mod margin;
mod remainder;
mod replan;
mod sampled;
mod samples;
mod speed;
#[cfg(test)]
mod tests;
mod waypoint_path;

use jtc_core::{Config, Friction, JOINTS, PathRange};
use jtc_dynamics::ArmModel;
use jtc_plan::{ArmDynamics, Limits, Motion};
pub use jtc_plan::{Waypoint, furthest_joint, kinematics};
use jtc_wire::Joint;
use serde::Serialize;

pub use approach::{ApproachError, approach};
pub use corners::{BLEND_M_MAX, BLEND_MAX};
pub use default_speed::MoveSpeed;
pub use error::PlanError;
pub use lines::{Aside, furthest_aside};
pub use margin::{MARGIN_PCT, MARGIN_PCT_MAX, margin_in_range, margin_of};
pub use remainder::remainder;
pub use speed::at_speed;
pub use waypoint_path::{WayOptions, WaypointPath};

use crate::check::{Checker, Problem, ProblemKind, TEMPERATURE, Verdict};
use crate::trajectory::{Trajectory, UploadOptions};
use sampled::{least_s, sampled, step_ms};

/// Time step between the points of planned moves, ms.
const STEP_MS: u16 = 10;
/// Time in which the acceleration changes if the jerk is not limited, s: two steps. With a shorter time, the
/// interpolated acceleration between two points (J-32) would be higher than at the points.
const JUMP_S: f64 = 2e-3 * STEP_MS as f64;
/// Maximum share of the velocity and acceleration limits that a plan uses. The remaining 2 % are reserved for the rounding in serial
/// frames.
const SHARE: f64 = 0.98;
/// Time from standstill to full speed when the arm continues an interrupted trajectory, s. If the check rejects the
/// motion, the planner tries the longer times `RAMPS_S`.
const RAMP_S: f64 = 0.5;
const RAMPS_S: [f64; 3] = [1.0, 2.0, 4.0];
/// Lowest bearing temperature that a plan assumes by default, °C. This is the temperature of cold bearings in a
/// factory hall. Cold bearings have more friction than bearings at operating temperature.
pub const COLD: f64 = 20.0;
/// Largest slow-down factor of the planner for a motion. A motion that needs a larger factor is rejected.
const SLOWEST: f64 = 50.0;
/// Smallest and largest slow-down factor in one iteration of the planner.
const SLOWER: (f64, f64) = (1.01, 2.0);
/// Smallest slow-down factor in one iteration of the planner if a motion exceeds the torque margin. This factor is
/// close to 1, because a rounded motion exceeds the margin only slightly.
const SLOWER_FOR_MARGIN: f64 = 1.002;
/// Slow-down factor above which a note reports that the torque margin has slowed down a motion.
const NOTED: f64 = 1.01;

/// Planner for the motions of an arm. The planner checks each planned motion.
#[derive(Clone, Debug)]
pub struct Planner<'a> {
    /// Controller settings with the limits, rotor inertias, gravity and payload.
    pub config: &'a Config,
    /// Arm model for the torques. If the model is `None`, the planner ignores torques.
    pub model: Option<&'a ArmModel>,
    /// Friction compensation that the controller adds to the torque of the arm model.
    pub friction: Option<&'a Friction>,
    /// Lowest bearing temperature for which the plan includes friction, °C.
    pub temperature: f64,
    /// Speed of planned motions, 1 to 100 % of the limits.
    pub speed_pct: f64,
    /// Size of a rounded corner, rad. The path leaves the straight segments only within this distance from the
    /// waypoint. The distance is that of the joint that is furthest from the waypoint. If the blend is 0, the arm
    /// stops at each waypoint.
    pub blend: f64,
    /// `true` if the jerk is limited. If the value is `false`, the acceleration may change from one value to another
    /// within two steps.
    pub jerk: bool,
    /// Torque margin, 0 to [`MARGIN_PCT_MAX`] % of each torque limit, for masses and friction that the model does not contain.
    pub margin_pct: f64,
    /// Division of the trajectory into segments for the upload.
    pub upload: UploadOptions,
}

/// Limit that determines the speed of a motion during a time interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Time from the start of the motion to the start of the interval, s.
    pub from_s: f64,
    /// Time from the start of the motion to the end of the interval, s.
    pub to_s: f64,
    /// Joint whose limit determines the speed.
    pub joint: Joint,
    /// Name of the limit: "velocity", "acceleration", "jerk", "torque", "stop" (ability to stop in time), "friction" (range of the friction
    /// table) or "given time".
    pub limit: &'static str,
}

/// Planned motion that passed the check.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Trajectory that the controller can execute.
    pub trajectory: Trajectory,
    /// Result of the check, with the values of each joint and the warnings.
    pub verdict: Verdict,
    /// Limits that determine the speed of the motion, ordered by time.
    pub binding: Vec<Bound>,
    /// Times at which the motion is nearest to each waypoint, s.
    pub waypoint_times: Vec<f64>,
    /// Notes for the user about changes that were necessary to pass the check, and about waypoints that the motion misses because of
    /// rounded corners.
    pub notes: Vec<String>,
}

impl<'a> Planner<'a> {
    /// Creates a planner with full speed and a stop at each waypoint. The planner uses only the limits of `config`. If a model is set, the
    /// planner leaves [`MARGIN_PCT`] of each torque limit unused.
    pub fn new(config: &'a Config) -> Self {
        let upload = UploadOptions::default();
        Self {
            config,
            model: None,
            friction: None,
            temperature: COLD,
            speed_pct: 100.0,
            blend: 0.0,
            jerk: true,
            margin_pct: MARGIN_PCT,
            upload,
        }
    }

    /// Plans a motion that starts and ends at rest between two positions (rad, base to wrist). The motion is straight in joint space,
    /// unless a curved motion is faster. If a joint is outside its limits by at most the start tolerance, the motion begins at the nearest
    /// position inside the limits (J-58). If the goal is outside the limits by at most the rounding of a serial frame, the goal is moved to
    /// the limit (J-36).
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::Speed`] or [`PlanError::Margin`] if this setting of the planner is out of range. Returns [`PlanError::Plan`] if
    /// a position is outside the limits or its gravity torque is too high. Returns [`PlanError::Refused`] if the check finds a problem that
    /// a lower speed does not solve.
    pub fn to(&self, from: &[f64; JOINTS], to: &[f64; JOINTS]) -> Result<Planned, PlanError> {
        let arm = self.dynamics();
        let first = self.nearest_inside(from);
        let to = within_rounding(self.config, to);
        let motion = self.within(|limits| jtc_plan::point_to_point(&first, &to, limits, arm.as_ref()))?;
        self.checked(&motion, &first, Some(*from), false)
    }

    /// Returns the position inside the limits that is nearest to the position `place` and from which the controller can start a motion. A
    /// joint that is outside its limits by more than the start tolerance keeps its position.
    fn nearest_inside(&self, place: &[f64; JOINTS]) -> [f64; JOINTS] {
        std::array::from_fn(|j| {
            let inside = PathRange::of(self.config, j, 0).nearest_inside(place[j]);
            if (place[j] - inside).abs() <= self.config.start_tolerance_rad { inside } else { place[j] }
        })
    }

    /// Plans a motion through waypoints that starts and ends at rest. The segments between waypoints are straight in joint space, and the
    /// corners are rounded within the blend. If a waypoint has a time, the motion passes the waypoint at this time.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Planner::to`], with the number of the waypoint. Returns [`PlanError::Nowhere`] if all waypoints are equal,
    /// [`PlanError::Blend`] if the blend is too large, and [`PlanError::TooLong`] if the motion takes too long.
    pub fn through(&self, waypoints: &[Waypoint]) -> Result<Planned, PlanError> {
        let positions: Vec<[f64; JOINTS]> = waypoints.iter().map(|w| w.position).collect();
        if positions.len() > 1 && positions.iter().all(|q| Some(q) == positions.first()) {
            return Err(PlanError::Nowhere { count: positions.len() });
        }
        corners::within_reason(self.blend, 0.0)?;
        sampled::fits_corners(&positions, self.blend)?;
        self.fits_time(&positions)?;
        let arm = self.dynamics();
        let motion = self.within(|limits| jtc_plan::through(waypoints, self.blend, limits, arm.as_ref()))?;
        let first = positions.first().copied().unwrap_or_default();
        let timed = waypoints.iter().skip(1).any(|w| w.time.is_some());
        let mut planned = self.checked(&motion, &first, None, timed)?;
        planned.notes.extend(corners::notes(&planned, &positions, self.blend));
        Ok(planned)
    }

    /// Plans the remainder of a trajectory on the same path. The remainder begins at the path time `from_ms`, with the arm at the position
    /// `start`. After a ramp, the motion follows the original timing of the trajectory. The planner uses the shortest ramp for which the
    /// remainder passes the check.
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::Refused`] if the check rejects the remainder with every ramp, and [`PlanError::TooLong`] if the remainder is
    /// too long for the controller.
    pub fn rest(
        &self,
        trajectory: &Trajectory,
        from_ms: u32,
        start: Option<[f64; JOINTS]>,
    ) -> Result<Trajectory, PlanError> {
        let checker = self.checker(start);
        let mut ramps = RAMPS_S.into_iter();
        let mut ramp_s = RAMP_S;
        loop {
            let rest = remainder(trajectory, from_ms, ramp_s)?;
            let verdict = checker.check(&rest);
            match ramps.next() {
                _ if verdict.is_ok() => return Ok(rest),
                Some(longer) => ramp_s = longer,
                None => return Err(PlanError::Refused(Box::new(verdict))),
            }
        }
    }

    /// Rejects a motion before planning if the motion takes too long even at the highest speed. This function does not reject positions
    /// outside the limits and invalid blends, because the planner rejects them later.
    fn fits_time(&self, positions: &[[f64; JOINTS]]) -> Result<(), PlanError> {
        let limits = self.limits()?;
        let is_inside = |q: &[f64; JOINTS]| {
            let mut ranges = q.iter().zip(&limits.position);
            ranges.all(|(q, (min, max))| (*min..=*max).contains(q))
        };
        if positions.iter().all(is_inside) && self.blend >= 0.0 {
            step_ms(least_s(positions, self.blend, &limits.velocity))?;
        }
        Ok(())
    }

    fn dynamics(&self) -> Option<ArmDynamics<'a>> {
        let temperatures = [self.temperature, TEMPERATURE];
        self.model
            .map(|model| ArmDynamics::new(self.config, model, self.friction).at_temperatures(temperatures))
    }

    /// Returns the checker for a motion of an arm that is at the position `start`.
    fn checker(&self, start: Option<[f64; JOINTS]>) -> Checker<'a> {
        let Self { model, friction, upload, .. } = *self;
        Checker { model, friction, start, upload, ..Checker::new(self.config) }
    }

    /// Plans a motion within the limits. If the torque margin leaves a joint no torque for the motion, the function
    /// plans again without the margin of this joint.
    fn within(
        &self,
        plan: impl Fn(&Limits) -> Result<Motion, jtc_plan::PlanError>,
    ) -> Result<Within, PlanError> {
        let mut limits = self.limits()?;
        loop {
            match plan(&limits) {
                Err(jtc_plan::PlanError::Torque { joint, holding: false, .. })
                    if limits.margin[joint.index()] > 0.0 =>
                {
                    limits.margin[joint.index()] = 0.0;
                }
                motion => return Ok(Within { motion: motion?, limits }),
            }
        }
    }

    /// Returns the limits that a plan must respect.
    fn limits(&self) -> Result<Limits, PlanError> {
        if !(1.0..=100.0).contains(&self.speed_pct) {
            return Err(PlanError::Speed { percent: self.speed_pct, most: 100.0 });
        }
        margin_in_range(self.margin_pct)?;
        let mut limits = Limits::of(self.config).with_margin(0.01 * self.margin_pct);
        for j in 0..JOINTS {
            limits.velocity[j] *= SHARE;
            limits.acceleration[j] *= SHARE;
        }
        let limits = limits.at_speed(self.speed_pct / 100.0);
        if self.jerk {
            return Ok(limits);
        }
        Ok(Limits { jerk: limits.acceleration.map(|a| a / JUMP_S), ..limits })
    }

    /// Converts the motion into a trajectory that passes the check, and slows down the motion as far as necessary. If `timed` is `true`,
    /// the motion is not slowed down.
    fn checked(
        &self,
        within: &Within,
        first: &[f64; JOINTS],
        start: Option<[f64; JOINTS]>,
        timed: bool,
    ) -> Result<Planned, PlanError> {
        let Within { motion, limits } = within;
        let (checker, arm) = (self.checker(start), self.dynamics());
        let (mut stretch, mut for_margin) = (1.0, 1.0);
        let (mut slowed, mut joint) = (None::<Problem>, None);
        loop {
            let step = step_ms(motion.duration() * stretch)?;
            let sampled = sampled(motion, first, stretch, step, timed)?;
            // The planner first checks with cold bearings, and then with bearings at operating temperature. The
            // second check is needed because friction helps to brake: with less friction, the drives need more torque
            // to brake.
            let cold =
                Checker { temperature: self.temperature, ..checker.clone() }.check(&sampled.trajectory);
            let verdict =
                if cold.is_ok() { checker.check(&sampled.trajectory).or_less(cold.margin) } else { cold };
            // A warning in combination with a long step means that the corners of the path are closer together than
            // one step. A slower motion would not help, because its steps would be even longer.
            if step > STEP_MS && verdict.warnings().next().is_some() {
                return Err(PlanError::TooFine { seconds: sampled.trajectory.duration_s(), step_ms: step });
            }
            let worst = verdict.refusals().next().cloned();
            if let Some(worst) = worst {
                let Some(factor) = slower(&verdict).filter(|factor| !timed && stretch * factor <= SLOWEST)
                else {
                    return Err(PlanError::Refused(Box::new(verdict)));
                };
                stretch *= factor;
                slowed = Some(worst);
                continue;
            }
            // The trajectory may exceed the torque limit that the margin allows, although the planned motion does
            // not. The causes are the rounding in serial frames, and torques between the samples of the plan.
            let excess = arm.as_ref().filter(|_| !timed);
            let excess = excess.and_then(|arm| margin::excess(&sampled.trajectory, limits, arm));
            if let Some(excess) = excess {
                let factor = excess.stretch.clamp(SLOWER_FOR_MARGIN, SLOWER.1);
                if stretch * factor <= SLOWEST {
                    (stretch, for_margin, joint) =
                        (stretch * factor, for_margin * factor, Some(excess.joint));
                    continue;
                }
            }
            let scale = sampled.scale;
            let of_margin = joint.filter(|_| for_margin > NOTED).map(|joint| {
                format!(
                    "slowed down to {:.0} % of the planned speed, for the torque margin of {joint}",
                    100.0 / for_margin
                )
            });
            return Ok(Planned {
                binding: binding(motion, scale, slowed.as_ref()),
                waypoint_times: motion.waypoint_times().iter().map(|t| t * scale).collect(),
                notes: slowed
                    .map(|p| slowed_words(&p, stretch))
                    .into_iter()
                    .chain(of_margin)
                    .chain(
                        arm.as_ref().and_then(|arm| {
                            margin::note(&verdict, self.margin_pct, &sampled.trajectory, arm)
                        }),
                    )
                    .collect(),
                trajectory: sampled.trajectory,
                verdict,
            });
        }
    }
}

/// Returns the position `place`. If a joint is outside its limit by at most the rounding of a serial frame, the joint is moved to this
/// limit (J-36).
fn within_rounding(config: &Config, place: &[f64; JOINTS]) -> [f64; JOINTS] {
    std::array::from_fn(|j| {
        let range = PathRange::of(config, j, 0);
        if range.contains(place[j]) { range.nearest_inside(place[j]) } else { place[j] }
    })
}

/// Planned motion and the limits within which it was planned.
struct Within {
    motion: Motion,
    limits: Limits,
}

/// Returns the slow-down factor for the next iteration, estimated from the problems in the verdict. Returns `None` if a slower motion does
/// not solve these problems.
fn slower(verdict: &Verdict) -> Option<f64> {
    use ProblemKind::{Acceleration, FrictionVelocity, NoStop, PositionSpeed, Torque, Velocity};
    let factors = verdict.refusals().map(|p| {
        let over = (p.value / p.limit).abs();
        match p.kind {
            Velocity | PositionSpeed | FrictionVelocity => Some(over),
            Acceleration => Some(over.sqrt()),
            // The gravity part of the torque does not depend on the speed, so this factor is only an estimate.
            Torque | NoStop => Some(over.max(1.03)),
            _ => None,
        }
    });
    let factor = factors.collect::<Option<Vec<f64>>>()?.into_iter().fold(1.0, f64::max);
    factor.is_finite().then_some((1.005 * factor).clamp(SLOWER.0, SLOWER.1))
}

fn limit_name(kind: ProblemKind) -> &'static str {
    match kind {
        ProblemKind::Velocity | ProblemKind::PositionSpeed => "velocity",
        ProblemKind::Acceleration => "acceleration",
        ProblemKind::NoStop => "stop",
        ProblemKind::FrictionVelocity => "friction",
        _ => "torque",
    }
}

/// Returns the limits that determine the speed of a motion. If the motion was slowed down because of a problem, the
/// result is only the limit of this problem, for the whole motion.
fn binding(motion: &Motion, scale: f64, slowed: Option<&Problem>) -> Vec<Bound> {
    if let Some(problem) = slowed {
        let (joint, limit) = (problem.joint.unwrap_or(Joint::ALL[0]), limit_name(problem.kind));
        return vec![Bound { from_s: 0.0, to_s: motion.duration() * scale, joint, limit }];
    }
    let bound = |b: &jtc_plan::Binding| Bound {
        from_s: b.from * scale,
        to_s: b.to * scale,
        joint: b.joint,
        limit: b.limit.name(),
    };
    motion.binding().iter().map(bound).collect()
}

fn slowed_words(problem: &Problem, stretch: f64) -> String {
    format!("slowed down to {:.0} % of the planned speed, to pass the check: {problem}", 100.0 / stretch)
}

/// Plans a move between two positions at `speed_pct` % of the limits of `config`, like [`Planner::to`], but ignores torques.
///
/// # Errors
///
/// Returns the same errors as [`Planner::to`].
pub fn joint_move(
    from: &[f64; JOINTS],
    to: &[f64; JOINTS],
    config: &Config,
    speed_pct: f64,
) -> Result<Trajectory, PlanError> {
    Ok(Planner { speed_pct, ..Planner::new(config) }.to(from, to)?.trajectory)
}
