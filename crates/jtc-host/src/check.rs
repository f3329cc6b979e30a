//! Check of a trajectory before it is sent to a controller. The check finds exceeded limits at and between the points, jumps, contradictory
//! values and a wrong start pose. The check also covers the torque during the motion and at rest, and the ability to stop.
//!
//! Between the points, the check runs the controller's interpolation once per millisecond, with the rounded numbers of the serial frames.
//! Therefore the check computes the same values as the controller. The controller's own check (J-36) also uses these values, so the
//! controller accepts every trajectory that passes the check of the host.

mod cause;
mod checked;
mod hint;
mod holding;
mod kind;
mod margin;
mod problem;
mod stopping;
mod verdict;

use jtc_core::check::{Quantity, REST_SPEED};
use jtc_core::{
    Config, Friction, JOINTS, POINTS_MAX, PathRange, SEGMENT_POINTS_MAX, SEGMENTS_MAX, SetPoint,
    TrajectoryCheck, Violation, interpolate, position_speed,
};
use jtc_dynamics::{ArmModel, Dynamics};
use jtc_wire::Joint;

pub use cause::Cause;
pub use checked::{CheckOptions, CheckedTrajectory};
pub use kind::{HOLD_SHARE, ProblemKind};
pub use margin::{MARGIN_LOW_PCT, TorqueMargin};
pub use problem::{Problem, Seen};
pub use verdict::{JointFigures, Suspicion, Verdict};

use crate::plan::COLD;
use crate::trajectory::{Trajectory, UploadOptions};

/// Bearing temperature that a check assumes by default, °C.
pub const TEMPERATURE: f64 = 30.0;

/// Settings of the check of a trajectory.
#[derive(Clone, Debug)]
pub struct Checker<'a> {
    /// Controller settings with the limits, rotor inertias, gravity, payload and start tolerance.
    pub config: &'a Config,
    /// Arm model for the computation of the torque along the path. If the model is `None`, the torque is not checked.
    pub model: Option<&'a ArmModel>,
    /// Friction compensation that the controller will add to the torque of the arm model.
    pub friction: Option<&'a Friction>,
    /// Bearing temperature for which the friction is computed, °C.
    pub temperature: f64,
    /// Measured position of the arm, rad. If the position is `None`, the start pose is not checked.
    pub start: Option<[f64; JOINTS]>,
    /// Division of the trajectory into segments for the upload.
    pub upload: UploadOptions,
}

/// Range of positions that a path may contain (J-36).
struct Positions {
    ranges: [PathRange; JOINTS],
    /// Positions at the first point of the path.
    first: [f64; JOINTS],
}

impl Positions {
    /// Returns the limit that `position` of joint `j` exceeds. Returns `None` if the position is within the limits.
    fn limit_beyond(&self, j: usize, position: f64) -> Option<f64> {
        let range = &self.ranges[j];
        let (low, high) = range.of_path(self.first[j]);
        (!(low..=high).contains(&position)).then(|| range.limit_at(position))
    }
}

/// Smallest step of a position in a serial frame, rad. `VELOCITY_BIT` is the smallest step of a velocity, rad/s.
pub(crate) const POSITION_BIT: f64 = jtc_wire::POSITION_SCALE / 32767.0;
const VELOCITY_BIT: f64 = jtc_wire::VELOCITY_SCALE / 32767.0;

impl<'a> Checker<'a> {
    /// Creates a check against the limits of `config`, without a model, friction or start pose.
    pub fn new(config: &'a Config) -> Self {
        let upload = UploadOptions::default();
        Self { config, model: None, friction: None, temperature: TEMPERATURE, start: None, upload }
    }

    /// Checks the trajectory and returns all problems.
    pub fn check(&self, trajectory: &Trajectory) -> Verdict {
        let mut verdict = Verdict::new(trajectory);
        self.counts(trajectory, &mut verdict);
        // Trajectory points with the rounded values that the controller will receive. A number that does not fit into
        // a serial frame is a problem. The check then continues with the unrounded number.
        let points: Vec<SetPoint> = trajectory
            .points
            .iter()
            .enumerate()
            .map(|(i, p)| match p.raw(i) {
                Ok(raw) => SetPoint::from(&raw),
                Err(e) => {
                    let kind = ProblemKind::scale(e.channel);
                    verdict.add(kind, Some(e.joint), i, 0.0, e.value, e.limit);
                    SetPoint::from(p)
                }
            })
            .collect();
        let Some(first) = points.first() else { return verdict.done() };
        self.start_pose(first, &mut verdict);
        self.ends(&points, &mut verdict);
        let dynamics =
            self.model.map(|m| Dynamics::with_payload(m, self.config.gravity, &self.config.payload));
        self.path(trajectory.step_ms, &points, dynamics.as_ref(), &mut verdict);
        self.controller(trajectory, &mut verdict);
        if let Some(dynamics) = &dynamics {
            let stands_there = self.start.is_some();
            holding::holds(self.config, dynamics, trajectory.step_ms, &points, stands_there, &mut verdict);
        }
        // A path that cannot be executed at all is not checked for the ability to stop.
        if let Some(dynamics) = dynamics.filter(|_| verdict.problems.iter().all(|p| !p.kind.stops_at_once()))
        {
            stopping::stops(self.config, &dynamics, trajectory.step_ms, &points, &mut verdict);
        }
        verdict.done()
    }

    /// Adds the problems that the controller's own check would find during the upload (J-36). If the verdict already
    /// contains a problem of this kind and joint, it is added again only for kinds whose occurrences are counted. A
    /// problem is not added if the verdict contains a jump of this joint at the same point.
    fn controller(&self, trajectory: &Trajectory, verdict: &mut Verdict) {
        let tables = match self.friction {
            Some(Friction::Table(tables)) => Some(tables),
            _ => None,
        };
        if trajectory.step_ms == 0 {
            return;
        }
        let mut check = TrajectoryCheck::new(self.config, trajectory.step_ms, tables);
        let mut found = Vec::new();
        for (i, point) in trajectory.points.iter().enumerate() {
            let Ok(raw) = point.raw(i) else { return };
            found.extend(check.take(&raw).err());
        }
        found.extend(check.end().err());
        for Violation { point, fraction, joint, quantity, value, limit } in found {
            let kind = match quantity {
                Quantity::Position => ProblemKind::Position,
                Quantity::Velocity => ProblemKind::Velocity,
                Quantity::Acceleration => ProblemKind::Acceleration,
                Quantity::PositionSpeed => ProblemKind::PositionSpeed,
                Quantity::Rest => ProblemKind::NotAtRest,
                Quantity::FrictionVelocity => ProblemKind::FrictionVelocity,
                Quantity::FrictionTemperature => continue,
            };
            let (point, joint) = (point as usize, Joint::from_index(joint));
            let counted = matches!(kind, ProblemKind::PositionSpeed | ProblemKind::FrictionVelocity);
            let known = verdict.problems.iter().any(|p| {
                let jump = p.kind == ProblemKind::Jump && p.point == point;
                p.joint == joint && (jump || (p.kind == kind && !counted))
            });
            if !known {
                let ms = (fraction * f64::from(trajectory.step_ms)).round();
                verdict.add(kind, joint, point, ms, value, limit);
            }
        }
    }

    fn counts(&self, trajectory: &Trajectory, verdict: &mut Verdict) {
        let n = trajectory.points.len();
        let mut count = |kind, value: usize, limit: usize| {
            verdict.add(kind, None, 0, 0.0, value as f64, limit as f64);
        };
        if n == 0 {
            count(ProblemKind::Empty, 0, 1);
        }
        if n > POINTS_MAX {
            count(ProblemKind::TooManyPoints, n, POINTS_MAX);
        }
        if trajectory.step_ms == 0 {
            count(ProblemKind::StepTime, 0, 1);
        }
        let per_segment = self.upload.segment_points(n);
        if n.div_ceil(per_segment) > SEGMENTS_MAX {
            count(ProblemKind::TooManySegments, n.div_ceil(per_segment), SEGMENTS_MAX);
        }
        if self.upload.points_per_segment.is_some_and(|p| p == 0 || p > SEGMENT_POINTS_MAX) {
            let given = self.upload.points_per_segment.unwrap_or(0);
            count(ProblemKind::SegmentPoints, given, SEGMENT_POINTS_MAX);
        }
    }

    /// Checks that the arm is at the first point (J-34).
    fn start_pose(&self, first: &SetPoint, verdict: &mut Verdict) {
        for (joint, measured) in Joint::ALL.into_iter().zip(self.start.into_iter().flatten()) {
            let away = measured - first.position[joint.index()];
            if away.abs() > self.config.start_tolerance_rad || away.is_nan() {
                verdict.add(
                    ProblemKind::StartPose,
                    Some(joint),
                    0,
                    0.0,
                    away,
                    self.config.start_tolerance_rad,
                );
            }
        }
    }

    /// Checks that the path begins and ends at rest.
    fn ends(&self, points: &[SetPoint], verdict: &mut Verdict) {
        for i in [0, points.len() - 1] {
            for (joint, v) in Joint::ALL.into_iter().zip(&points[i].velocity) {
                if v.abs() > REST_SPEED {
                    verdict.add(ProblemKind::NotAtRest, Some(joint), i, 0.0, *v, REST_SPEED);
                }
            }
            if points.len() == 1 {
                break;
            }
        }
    }

    fn path(&self, step_ms: u16, points: &[SetPoint], dynamics: Option<&Dynamics>, verdict: &mut Verdict) {
        let h = f64::from(step_ms) * 1e-3;
        let ranges = std::array::from_fn(|j| PathRange::of(self.config, j, step_ms));
        let first = points.first().map_or([0.0; JOINTS], |point| point.position);
        let places = Positions { ranges, first };
        for (i, a) in points.iter().enumerate() {
            self.moment(a, i, 0.0, &places, dynamics, verdict);
            let Some(b) = points.get(i + 1) else { break };
            let senseless = self.step(a, b, i, h, verdict);
            // With a step of 1 ms, no whole millisecond lies between two points. Then the speed of the positions is
            // computed in the middle of the step.
            for k in 1..step_ms.max(2) {
                let u = f64::from(k) / f64::from(step_ms.max(2));
                for (figures, speed) in verdict.joints.iter_mut().zip(position_speed(a, b, h, u)) {
                    figures.speed(speed);
                }
                if !senseless && k < step_ms {
                    self.moment(&interpolate(a, b, h, u), i, f64::from(k), &places, dynamics, verdict);
                }
            }
        }
    }

    /// Finds jumps and contradictory values between two points. Returns `true` if the positions of the two points
    /// form a jump.
    fn step(&self, a: &SetPoint, b: &SetPoint, i: usize, h: f64, verdict: &mut Verdict) -> bool {
        let mut senseless = false;
        for (joint, limit) in Joint::ALL.into_iter().zip(&self.config.joints) {
            let j = joint.index();
            let (moved, v0, v1) = (b.position[j] - a.position[j], a.velocity[j], b.velocity[j]);
            let (a0, a1) = (a.acceleration[j], b.acceleration[j]);
            // `expected` is the displacement that the velocities of both points would cause. `slack` is the tolerance
            // for the rounding and for a change of the velocity between the points.
            let expected = 0.5 * h * (v0 + v1);
            let slack = 3.0 * POSITION_BIT
                + h * (0.5 * (v1 - v0).abs() + 2.0 * VELOCITY_BIT)
                + h * h * 0.25 * (a0.abs() + a1.abs());
            let beyond = (moved - expected).abs() - slack;
            if moved.abs() > 2.0 * limit.velocity_max * h + 3.0 * POSITION_BIT {
                verdict.add(ProblemKind::Jump, Some(joint), i, 0.0, moved, limit.velocity_max * h);
                senseless = true;
            } else if beyond > 0.05 * limit.velocity_max * h {
                verdict.add(ProblemKind::VelocityMismatch, Some(joint), i, 0.0, moved / h, expected / h);
            }
            let (sped, expected) = (v1 - v0, 0.5 * h * (a0 + a1));
            let slack = 3.0 * VELOCITY_BIT + h * 0.5 * (a1 - a0).abs();
            let beyond = (sped - expected).abs() - slack;
            if !senseless && beyond > 0.1 * limit.acceleration_max * h {
                verdict.add(ProblemKind::AccelerationMismatch, Some(joint), i, 0.0, sped / h, expected / h);
            }
        }
        senseless
    }

    /// Checks the limits at one millisecond of the path.
    fn moment(
        &self,
        s: &SetPoint,
        i: usize,
        ms: f64,
        places: &Positions,
        dynamics: Option<&Dynamics>,
        verdict: &mut Verdict,
    ) {
        let torque = dynamics.map(|d| d.inverse(&s.position, &s.velocity, &s.acceleration));
        for (joint, limit) in Joint::ALL.into_iter().zip(&self.config.joints) {
            let j = joint.index();
            let (q, v, a) = (s.position[j], s.velocity[j], s.acceleration[j]);
            if let Some(limit) = places.limit_beyond(j, q) {
                verdict.add(ProblemKind::Position, Some(joint), i, ms, q, limit);
            }
            let mut over = |kind, value: f64, min: f64, max: f64| {
                if !(min..=max).contains(&value) {
                    verdict.add(kind, Some(joint), i, ms, value, if value < min { min } else { max });
                }
            };
            over(ProblemKind::Velocity, v, -limit.velocity_max, limit.velocity_max);
            over(ProblemKind::Acceleration, a, -limit.acceleration_max, limit.acceleration_max);
            let mut whole = None;
            if let Some(torque) = torque {
                let rigid = torque[j] + limit.rotor_inertia * a;
                let tau = rigid + self.friction_torque(j, v);
                over(ProblemKind::Torque, tau, -limit.torque_max, limit.torque_max);
                whole = Some(tau);
                let cold = rigid + self.friction_at(j, v, COLD);
                let most = if cold.abs() > tau.abs() { (cold, COLD) } else { (tau, self.temperature) };
                verdict.take_margin(joint, (i, ms), most, limit.torque_max);
            }
            verdict.joints[j].take(q, v, a, whole);
        }
    }

    pub(crate) fn friction_torque(&self, j: usize, v: f64) -> f64 {
        self.friction_at(j, v, self.temperature)
    }

    fn friction_at(&self, j: usize, v: f64, temperature: f64) -> f64 {
        match self.friction {
            Some(Friction::Polynomial(c)) => {
                jtc_core::friction::polynomial(&c[j], v, temperature, self.config.friction_sign_width)
            }
            Some(Friction::Table(t)) => jtc_core::friction::table(&t[j], v, temperature).unwrap_or(0.0),
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests;
