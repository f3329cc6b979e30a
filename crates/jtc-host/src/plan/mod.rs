//! Moves made here: to a place, through waypoints, and trajectories at another speed.
//!
//! The motions are those of `jtc-plan`, as fast as the limits of velocity, acceleration, jerk and torque allow. Here they become
//! trajectories, points at a fixed step as the wire carries them, and each passes the same [check](crate::check) as a file before it
//! is given to anybody: where rounding, a pause on the path (J-33) or friction ask for more, the motion is slowed down and
//! [`Planned::notes`] reports it.
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

mod again;
mod approach;
mod corners;
mod default_speed;
mod error;
mod lines;
mod margin;
mod rest_of;
mod sampled;
mod samples;
mod speed;
#[cfg(test)]
mod tests;
mod way;

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
pub use rest_of::rest_of;
pub use speed::at_speed;
pub use way::{Way, WayOptions};

use crate::check::{Checker, Problem, ProblemKind, TEMPERATURE, Verdict};
use crate::trajectory::{Trajectory, UploadOptions};
use sampled::{least_s, sampled, step_ms};

/// Step of planned moves, ms.
const STEP_MS: u16 = 10;
/// Time that the acceleration has to change where jerk is not limited, s: in less than two steps the position between the points (J-32)
/// would accelerate more than the points do.
const JUMP_S: f64 = 2e-3 * STEP_MS as f64;
/// Share of the velocity and acceleration limits that a plan uses: the rest is for the rounding of the wire.
const SHARE: f64 = 0.98;
/// Time in which the rest of a trajectory gets to its speed, s, and longer ones where the check refuses that.
const RAMP_S: f64 = 0.5;
const RAMPS_S: [f64; 3] = [1.0, 2.0, 4.0];
/// Bearing temperature that a plan reckons with, °C: that of a cold hall. Friction is higher there than at the usual temperature.
pub const COLD: f64 = 20.0;
/// A motion that is slowed down by more than this is none any more.
const SLOWEST: f64 = 50.0;
/// Least and most by which one step slows a motion down.
const SLOWER: (f64, f64) = (1.01, 2.0);
/// Least by which one step slows a motion down for the torque margin: it is exceeded by rounding alone.
const SLOWER_FOR_MARGIN: f64 = 1.002;
/// A motion that is made slower than this for the torque margin, as a factor of its time, has a note.
const NOTED: f64 = 1.01;

/// Makes motions for an arm, and checks them.
#[derive(Clone, Debug)]
pub struct Planner<'a> {
    /// Limits, rotor inertia, gravity, payload.
    pub config: &'a Config,
    /// Model for the torques; `None`: torque is neither planned nor checked.
    pub model: Option<&'a ArmModel>,
    /// Friction compensation that the controller will add to it.
    pub friction: Option<&'a Friction>,
    /// Lowest bearing temperature, °C, at which the friction may have to be overcome.
    pub temperature: f64,
    /// Speed, 1 to 100 % of what the limits allow.
    pub speed_pct: f64,
    /// How far from a waypoint its corner may be rounded, rad of the joint that is furthest; 0: the arm stops at each waypoint.
    pub blend: f64,
    /// Whether jerk is limited, too; else the acceleration changes within two steps.
    pub jerk: bool,
    /// Torque margin, 0 to [`MARGIN_PCT_MAX`] % of each limit: what the plan leaves for masses and friction that the model does not know.
    pub margin_pct: f64,
    /// Segments that the trajectory will be sent in.
    pub upload: UploadOptions,
}

/// Which limit a motion uses up, from when to when.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// s from the start.
    pub from_s: f64,
    /// s from the start.
    pub to_s: f64,
    /// Which joint.
    pub joint: Joint,
    /// "velocity", "acceleration", "jerk", "torque", "stop" (room to stop in time), "friction" (its table) or "given time".
    pub limit: &'static str,
}

/// A motion that passed the check.
#[derive(Clone, Debug)]
pub struct Planned {
    /// What is run.
    pub trajectory: Trajectory,
    /// What the check found: figures of each joint, warnings.
    pub verdict: Verdict,
    /// What binds when, in the order of time.
    pub binding: Vec<Bound>,
    /// When the motion is nearest to each waypoint, s.
    pub waypoint_times: Vec<f64>,
    /// What was changed for the check, and which waypoints rounded corners miss, in words.
    pub notes: Vec<String>,
}

impl<'a> Planner<'a> {
    /// Within the limits of `config` alone, as fast as they allow, with a stop at each waypoint. With a model it leaves [`MARGIN_PCT`] of
    /// each torque limit.
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

    /// From a place at rest to another one (rad, base to wrist), straight in joint space where that takes no longer. Where a joint stands
    /// outside its limits by up to the start tolerance, the motion begins at the nearest place inside (J-58). A goal outside by no more than the
    /// rounding of a frame is the limit itself (J-36).
    ///
    /// # Errors
    ///
    /// [`PlanError::Speed`], [`PlanError::Margin`]; [`PlanError::Plan`] for a place outside the limits or that no torque holds; [`PlanError::Refused`] when the
    /// check finds what no speed mends.
    pub fn to(&self, from: &[f64; JOINTS], to: &[f64; JOINTS]) -> Result<Planned, PlanError> {
        let arm = self.dynamics();
        let first = self.nearest_inside(from);
        let to = within_rounding(self.config, to);
        let motion = self.within(|limits| jtc_plan::point_to_point(&first, &to, limits, arm.as_ref()))?;
        self.checked(&motion, &first, Some(*from), false)
    }

    /// The nearest place inside the limits from which the controller executes a motion of an arm that stands at `place`: joints that are
    /// further outside than the start tolerance remain there.
    fn nearest_inside(&self, place: &[f64; JOINTS]) -> [f64; JOINTS] {
        std::array::from_fn(|j| {
            let inside = PathRange::of(self.config, j, 0).nearest_inside(place[j]);
            if (place[j] - inside).abs() <= self.config.start_tolerance_rad { inside } else { place[j] }
        })
    }

    /// Through waypoints, from rest to rest: straight legs in joint space, with corners rounded within the blend. Times that are given
    /// are kept.
    ///
    /// # Errors
    ///
    /// As [`Planner::to`], with the waypoint that is meant; [`PlanError::Nowhere`], [`PlanError::Blend`], [`PlanError::TooLong`].
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

    /// The rest of a trajectory from `from_ms` of its path on, where the arm stands at `start`: on the same path, at its own times once it has
    /// sped up, as fast as the check allows that.
    ///
    /// # Errors
    ///
    /// [`PlanError::Refused`] when the check refuses the rest however slowly it begins, [`PlanError::TooLong`].
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
            let rest = rest_of(trajectory, from_ms, ramp_s)?;
            let verdict = checker.check(&rest);
            match ramps.next() {
                _ if verdict.is_ok() => return Ok(rest),
                Some(longer) => ramp_s = longer,
                None => return Err(PlanError::Refused(Box::new(verdict))),
            }
        }
    }

    /// Refuses what would be too long at the highest speed all the way, before it is planned. Positions outside the limits, and blends
    /// that are none, are left to the plan.
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

    /// The check before a run, where the arm stands at `start`.
    fn checker(&self, start: Option<[f64; JOINTS]>) -> Checker<'a> {
        let Self { model, friction, upload, .. } = *self;
        Checker { model, friction, start, upload, ..Checker::new(self.config) }
    }

    /// A motion within the limits of a plan. A joint whose margin leaves no torque for it has none.
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

    /// What a plan keeps to.
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

    /// The motion as a trajectory that passes the check, slowed down as far as it has to be; one that is `timed` is not.
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
            // Cold, and as before a run: where friction brakes, it is its lack that costs torque.
            let cold =
                Checker { temperature: self.temperature, ..checker.clone() }.check(&sampled.trajectory);
            let verdict =
                if cold.is_ok() { checker.check(&sampled.trajectory).or_less(cold.margin) } else { cold };
            // Corners closer than its steps are no motion that a longer trajectory could carry.
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
            // Rounding to the wire's steps, and what lies between the samples of the plan.
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
                    "slowed down to {:.0} % of the speed that was planned, for the torque margin of {joint}",
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

/// The same place with each joint at its limit that is beyond it by no more than the rounding of a frame (J-36).
fn within_rounding(config: &Config, place: &[f64; JOINTS]) -> [f64; JOINTS] {
    std::array::from_fn(|j| {
        let range = PathRange::of(config, j, 0);
        if range.contains(place[j]) { range.nearest_inside(place[j]) } else { place[j] }
    })
}

/// A motion with the limits that it keeps.
struct Within {
    motion: Motion,
    limits: Limits,
}

/// By how much a motion is slowed down for what is wrong with it; `None` where that does not mend it.
fn slower(verdict: &Verdict) -> Option<f64> {
    use ProblemKind::{Acceleration, FrictionVelocity, NoStop, PositionSpeed, Torque, Velocity};
    let factors = verdict.refusals().map(|p| {
        let over = (p.value / p.limit).abs();
        match p.kind {
            Velocity | PositionSpeed | FrictionVelocity => Some(over),
            Acceleration => Some(over.sqrt()),
            // Part of it is gravity, which no speed changes.
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

/// What binds: the limits that the motion was planned by, or else what it was slowed down for.
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
    format!("slowed down to {:.0} % of the speed that was planned, for the check: {problem}", 100.0 / stretch)
}

/// A move between two places within the limits of `config` alone, at `speed_pct` of them: [`Planner::to`] without torques.
///
/// # Errors
///
/// Those of [`Planner::to`].
pub fn joint_move(
    from: &[f64; JOINTS],
    to: &[f64; JOINTS],
    config: &Config,
    speed_pct: f64,
) -> Result<Trajectory, PlanError> {
    Ok(Planner { speed_pct, ..Planner::new(config) }.to(from, to)?.trajectory)
}
