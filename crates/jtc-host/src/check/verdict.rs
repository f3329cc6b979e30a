//! All that a check found, grouped, worst first.

use std::fmt;

use jtc_core::JOINTS;
use serde::Serialize;

use super::HOLD_SHARE;
use crate::trajectory::Trajectory;

/// What can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProblemKind {
    /// No point.
    Empty,
    /// More points than the controller holds.
    TooManyPoints,
    /// More segments than a trajectory may have.
    TooManySegments,
    /// Points per segment outside 1..1500.
    SegmentPoints,
    /// Step time 0.
    StepTime,
    /// A position that no frame carries.
    PositionScale,
    /// A velocity that no frame carries.
    VelocityScale,
    /// An acceleration that no frame carries.
    AccelerationScale,
    /// Two points so far apart that the arm cannot get from one to the other in a step.
    Jump,
    /// Position over its limit.
    Position,
    /// Velocity over its limit.
    Velocity,
    /// Acceleration over its limit.
    Acceleration,
    /// Torque by the arm model over its limit.
    Torque,
    /// Holding the arm where the path stands takes nearly all of a joint's torque: it would fall later.
    HoldTorque,
    /// A velocity that the friction table does not have (J-36).
    FrictionVelocity,
    /// A place from which Pause or Stop cannot bring the arm to rest in time with the torque that there is (J-33).
    NoStop,
    /// Positions move faster than the velocity limit, whatever the velocities say.
    PositionSpeed,
    /// Positions move at another speed than the velocities say; a warning at single places.
    VelocityMismatch,
    /// The first or last point is not at rest.
    NotAtRest,
    /// The arm is not at the first point (J-34).
    StartPose,
    /// Velocities change otherwise than the accelerations say.
    AccelerationMismatch,
}

impl ProblemKind {
    /// All of them.
    pub const ALL: [Self; 21] = {
        use ProblemKind::*;
        [
            Empty,
            TooManyPoints,
            TooManySegments,
            SegmentPoints,
            StepTime,
            PositionScale,
            VelocityScale,
            AccelerationScale,
            Jump,
            Position,
            Velocity,
            Acceleration,
            Torque,
            HoldTorque,
            FrictionVelocity,
            NoStop,
            PositionSpeed,
            VelocityMismatch,
            NotAtRest,
            StartPose,
            AccelerationMismatch,
        ]
    };

    pub(super) fn scale(channel: &str) -> Self {
        match channel {
            "position" => ProblemKind::PositionScale,
            "velocity" => ProblemKind::VelocityScale,
            _ => ProblemKind::AccelerationScale,
        }
    }

    /// It ends the motion before anybody could stop it, or leaves no motion to stop.
    pub(super) fn stops_at_once(self) -> bool {
        use ProblemKind::*;
        !matches!(
            self,
            NotAtRest | StartPose | VelocityMismatch | AccelerationMismatch | FrictionVelocity | HoldTorque
        )
    }

    fn unit(self) -> &'static str {
        use ProblemKind::*;
        match self {
            Jump | Position | StartPose | PositionScale => "rad",
            Velocity | FrictionVelocity | VelocityScale | PositionSpeed | VelocityMismatch | NotAtRest => {
                "rad/s"
            }
            Acceleration | AccelerationScale | AccelerationMismatch => "rad/s²",
            Torque | HoldTorque | NoStop => "N·m",
            _ => "",
        }
    }

    /// The kind in words, without the facts.
    pub fn words(self) -> &'static str {
        use ProblemKind::*;
        match self {
            Empty => "no points",
            TooManyPoints => "too many points",
            TooManySegments => "too many segments",
            SegmentPoints => "points per segment",
            StepTime => "step time of 0 ms",
            PositionScale => "position outside what a frame carries",
            VelocityScale => "velocity outside what a frame carries",
            AccelerationScale => "acceleration outside what a frame carries",
            Jump => "jump",
            Position => "position over its limit",
            Velocity => "velocity over its limit",
            Acceleration => "acceleration over its limit",
            Torque => "torque over its limit",
            HoldTorque => "nearly all torque to stand",
            FrictionVelocity => "velocity outside the friction table",
            NoStop => "no stop in time",
            PositionSpeed => "positions move faster than the velocity limit",
            VelocityMismatch => "positions and velocities disagree",
            NotAtRest => "not at rest at an end",
            StartPose => "the arm is not at the first point",
            AccelerationMismatch => "velocities and accelerations disagree",
        }
    }
}

/// Problems of one kind in one joint; jumps are listed one by one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// What is wrong.
    pub kind: ProblemKind,
    /// Joint from 1; `None`: the trajectory as a whole.
    pub joint: Option<usize>,
    /// First point (from 0) where it is; with `ms` > 0 between this and the next.
    pub first_point: usize,
    /// Point (from 0) where it is worst.
    pub point: usize,
    /// ms after `point` where it is worst.
    pub ms: f64,
    /// Worst value, in the unit of its kind.
    pub value: f64,
    /// Its limit, or what the other channel says.
    pub limit: f64,
    /// Milliseconds (or points, or steps) in which it is.
    pub count: usize,
    /// The trajectory can run all the same; only the feed-forward is not what it could be.
    pub warning: bool,
}

/// Places with contradicting channels that existing files have where their pieces meet.
const SEAMS: usize = 20;

impl Problem {
    fn excess(&self) -> f64 {
        match self.kind {
            ProblemKind::VelocityMismatch | ProblemKind::AccelerationMismatch => {
                (self.value - self.limit).abs()
            }
            _ if self.limit == 0.0 => self.value.abs(),
            _ if self.value.is_nan() => f64::INFINITY,
            _ => self.value.abs() / self.limit.abs(),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use ProblemKind::*;
        let Problem { kind, point, ms, value, limit, .. } = self;
        let unit = kind.unit();
        let next = point + 1;
        if let Some(joint) = self.joint {
            write!(f, "joint {joint}: ")?;
        }
        match kind {
            Empty | StepTime => write!(f, "{}", kind.words())?,
            TooManyPoints | TooManySegments => write!(f, "{}: {value}, at most {limit}", kind.words())?,
            SegmentPoints => write!(f, "{}: {value}, 1 to {limit} are possible", kind.words())?,
            Jump => {
                return write!(
                    f,
                    "jump of {value:+.4} rad between points {point} and {next} (at most {limit:.4} rad in a step)"
                );
            }
            StartPose => {
                return write!(f, "{value:+.4} rad away from the first point (tolerance {limit} rad)");
            }
            NoStop => write!(
                f,
                "a stop in time from {ms} ms after point {point} needs {value:+.1} N·m, more than the {limit} N·m \
                 that there are"
            )?,
            HoldTorque => {
                let most = limit.abs() / HOLD_SHARE;
                let (share, limit) = (100.0 * value.abs() / most, limit.abs());
                return write!(
                    f,
                    "standing still at point {point} takes {value:+.1} N·m, {share:.1} % of the torque limit ({most:.1} N·m); \
                     at most {:.0} % ({limit:.1} N·m), or the noise of the encoder drops the arm later",
                    100.0 * HOLD_SHARE
                );
            }
            NotAtRest => write!(f, "{}: {value:+.4} {unit} at point {point}", kind.words())?,
            VelocityMismatch | AccelerationMismatch => write!(
                f,
                "{}: {value:+.4} {unit} between points {point} and {next} where {limit:+.4} {unit} is said",
                kind.words()
            )?,
            _ if *ms > 0.0 => {
                write!(f, "{}: {value:+.4} {unit} (limit {limit}) {ms} ms after point {point}", kind.words())?
            }
            _ => write!(f, "{}: {value:+.4} {unit} (limit {limit}) at point {point}", kind.words())?,
        }
        if self.count > 1 {
            write!(f, "; {} times, first at point {}", self.count, self.first_point)?;
        }
        Ok(())
    }
}

/// What a joint does along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointFigures {
    /// rad.
    pub position_min_rad: f64,
    /// rad.
    pub position_max_rad: f64,
    /// rad/s.
    pub velocity_peak_rad_s: f64,
    /// rad/s².
    pub acceleration_peak_rad_s2: f64,
    /// N·m by the model; `None`: not computed.
    pub torque_peak_nm: Option<f64>,
}

impl JointFigures {
    const NONE: Self = Self {
        position_min_rad: f64::INFINITY,
        position_max_rad: f64::NEG_INFINITY,
        velocity_peak_rad_s: 0.0,
        acceleration_peak_rad_s2: 0.0,
        torque_peak_nm: None,
    };

    pub(super) fn speed(&mut self, v: f64) {
        self.velocity_peak_rad_s = self.velocity_peak_rad_s.max(v.abs());
    }

    pub(super) fn take(&mut self, q: f64, v: f64, a: f64, torque: Option<f64>) {
        self.position_min_rad = self.position_min_rad.min(q);
        self.position_max_rad = self.position_max_rad.max(q);
        self.velocity_peak_rad_s = self.velocity_peak_rad_s.max(v.abs());
        self.acceleration_peak_rad_s2 = self.acceleration_peak_rad_s2.max(a.abs());
        if let Some(torque) = torque {
            self.torque_peak_nm = Some(self.torque_peak_nm.unwrap_or(0.0).max(torque.abs()));
        }
    }
}

/// Result of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Points.
    pub points: usize,
    /// ms.
    pub step_ms: u16,
    /// First to last point, s.
    pub duration_s: f64,
    /// What is wrong, worst first.
    pub problems: Vec<Problem>,
    /// What the joints do along the path.
    pub joints: [JointFigures; JOINTS],
}

/// Lines of a verdict in words.
const LINES: usize = 24;

impl Verdict {
    pub(super) fn new(t: &Trajectory) -> Self {
        let joints = [JointFigures::NONE; JOINTS];
        Self {
            points: t.points.len(),
            step_ms: t.step_ms,
            duration_s: t.duration_s(),
            problems: Vec::new(),
            joints,
        }
    }

    pub(super) fn add(
        &mut self,
        kind: ProblemKind,
        joint: Option<usize>,
        point: usize,
        ms: f64,
        value: f64,
        limit: f64,
    ) {
        let joint = joint.map(|j| j + 1);
        let new =
            Problem { kind, joint, first_point: point, point, ms, value, limit, count: 1, warning: false };
        let same = |p: &&mut Problem| p.kind == kind && p.joint == joint && kind != ProblemKind::Jump;
        match self.problems.iter_mut().find(same) {
            Some(known) => {
                let count = known.count + 1;
                if new.excess() > known.excess() {
                    *known = Problem { first_point: known.first_point, ..new };
                }
                known.count = count;
            }
            None => self.problems.push(new),
        }
    }

    /// Kinds in the order of what they do to an arm, jumps in the order of the path, others by how far they are over.
    pub(super) fn done(mut self) -> Self {
        self.part_haste_from_seams();
        let seams = SEAMS.max(self.points / 50);
        for p in &mut self.problems {
            p.warning = match p.kind {
                ProblemKind::AccelerationMismatch => true,
                ProblemKind::VelocityMismatch => p.count <= seams,
                _ => false,
            };
        }
        self.problems.sort_by(|a, b| {
            let within = match a.kind {
                ProblemKind::Jump => a.point.cmp(&b.point).then(b.excess().total_cmp(&a.excess())),
                _ => b.excess().total_cmp(&a.excess()),
            };
            a.warning.cmp(&b.warning).then(a.kind.cmp(&b.kind)).then(within)
        });
        self
    }

    /// Pieces that do not meet make single jumps. Where every fifth step or more is one, the path is too fast all along, or not
    /// in radians: one line per joint says so.
    fn part_haste_from_seams(&mut self) {
        let is_jump = |p: &Problem| p.kind == ProblemKind::Jump;
        let mut places: Vec<usize> = self.problems.iter().filter(|p| is_jump(p)).map(|p| p.point).collect();
        places.sort_unstable();
        places.dedup();
        if 5 * places.len() < self.points {
            return;
        }
        let (jumps, rest): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.problems).into_iter().partition(is_jump);
        self.problems = rest;
        let h = f64::from(self.step_ms) * 1e-3;
        for Problem { joint, point, value, limit, .. } in jumps {
            let joint = joint.map(|j| j - 1);
            self.add(ProblemKind::PositionSpeed, joint, point, 0.0, value / h, limit / h);
        }
    }

    /// Nothing forbids to run it.
    pub fn is_ok(&self) -> bool {
        self.problems.iter().all(|p| p.warning)
    }

    /// What forbids to run it.
    pub fn refusals(&self) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(|p| !p.warning)
    }

    /// What does not.
    pub fn warnings(&self) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(|p| p.warning)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (points, step, s) = (self.points, self.step_ms, self.duration_s);
        let word = if self.is_ok() { "passed" } else { "refused" };
        write!(f, "{word}: {points} points, step {step} ms, {s:.2} s")?;
        let jumps: Vec<&Problem> = self.problems.iter().filter(|p| p.kind == ProblemKind::Jump).collect();
        if jumps.len() > 1 {
            let worst = jumps.iter().map(|p| p.value.abs()).fold(0.0, f64::max);
            let mut places: Vec<usize> = jumps.iter().map(|p| p.point).collect();
            places.dedup();
            write!(f, "; jumps at {} places, up to {worst:.2} rad", places.len())?;
        }
        for p in self.problems.iter().take(LINES) {
            write!(f, "\n  {}{p}", if p.warning { "warning: " } else { "" })?;
        }
        if self.problems.len() > LINES {
            write!(f, "\n  and {} more", self.problems.len() - LINES)?;
        }
        Ok(())
    }
}
