//! Result of the check of a trajectory. The problems are grouped, and the worst problem is first.

use std::fmt;

use jtc_core::JOINTS;
use jtc_wire::Joint;
use serde::Serialize;

use super::cause::{Cause, Places, causes};
use super::kind::ProblemKind;
use super::margin::TorqueMargin;
use super::problem::{Problem, Seen};
use crate::trajectory::Trajectory;

/// Number of points with a contradiction between positions, velocities and accelerations up to which the check only
/// warns. Existing files have such points at the joins between two pieces.
const SEAMS: usize = 20;

/// Values of a joint along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JointFigures {
    /// Lowest position of the joint along the path, rad.
    pub position_min_rad: f64,
    /// Highest position of the joint along the path, rad.
    pub position_max_rad: f64,
    /// Peak velocity of the joint, rad/s.
    pub velocity_peak_rad_s: f64,
    /// Peak acceleration of the joint, rad/s².
    pub acceleration_peak_rad_s2: f64,
    /// Peak torque of the arm model, N·m; `None` if the torque was not computed.
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

/// Probable fault of a refused trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Suspicion {
    /// No probable fault was found.
    Nothing,
    /// Positions are far outside the range of a joint, but would be plausible after division by 57.3, the number of
    /// degrees per radian. Therefore they are probably in degrees.
    Degrees,
    /// The trajectory consists of pieces whose ends do not match.
    Pieces,
    /// The trajectory may pass the check at another speed.
    TooFast,
}

/// Result of the check of a trajectory.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Number of points of the trajectory.
    pub points: usize,
    /// Step time between two points, ms.
    pub step_ms: u16,
    /// Time from the first to the last point, s.
    pub duration_s: f64,
    /// Problems, the worst first. Each kind of problem has one entry per joint, but each jump has its own entry.
    pub problems: Vec<Problem>,
    /// Problems summarised by kind. The first entry is the kind with the strongest effect on an arm.
    pub causes: Vec<Cause>,
    #[serde(skip)]
    places: Places,
    /// Values of the joints along the path.
    pub joints: [JointFigures; JOINTS],
    /// Smallest torque margin of the arm model. The friction is computed at 20 °C and at the temperature of the
    /// check. `None` if the torque was not computed.
    pub margin: Option<TorqueMargin>,
}

/// Shortest step time at which the points count as waypoints, ms. With a shorter step time, the points count as
/// samples of a motion.
const WAYPOINTS_MS: u16 = 100;

impl Verdict {
    pub(super) fn new(t: &Trajectory) -> Self {
        let joints = [JointFigures::NONE; JOINTS];
        Self {
            points: t.points.len(),
            step_ms: t.step_ms,
            duration_s: t.duration_s(),
            problems: Vec::new(),
            causes: Vec::new(),
            places: Places::new(),
            joints,
            margin: None,
        }
    }

    pub(super) fn add(
        &mut self,
        kind: ProblemKind,
        joint: Option<Joint>,
        point: usize,
        ms: f64,
        value: f64,
        limit: f64,
    ) {
        let time_s = (point as f64 * f64::from(self.step_ms) + ms) * 1e-3;
        let first = Seen { joint, point, ms, time_s, value, limit };
        let new = Problem { kind, joint, first, point, ms, time_s, value, limit, count: 1, warning: false };
        self.places.entry(kind).or_default().insert(point);
        let same = |p: &&mut Problem| p.kind == kind && p.joint == joint && kind != ProblemKind::Jump;
        match self.problems.iter_mut().find(same) {
            Some(known) => {
                let count = known.count + 1;
                let first = if time_s < known.first.time_s { first } else { known.first };
                if new.excess() > known.excess() {
                    *known = new;
                }
                (known.count, known.first) = (count, first);
            }
            None => self.problems.push(new),
        }
    }

    /// Sorts the problems by the effect of their kind on an arm. Jumps are sorted by time along the path. Other problems are sorted by
    /// their excess over the limit.
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
        self.causes = causes(&self.problems, &self.places);
        self
    }

    /// Distinguishes moves that are too fast from pieces whose ends do not match. If the ends of two pieces do not match, the trajectory
    /// has a single jump between two samples. A jump belongs to a move that is too fast in three cases:
    ///
    /// - At least every fifth step has a jump, so the whole path is too fast or its positions are not in radians.
    /// - The step time is 100 ms or more, so the points are waypoints.
    /// - Three or more steps in a row have a jump.
    ///
    /// The jumps of a move that is too fast become one problem per joint.
    fn part_haste_from_seams(&mut self) {
        let is_jump = |p: &Problem| p.kind == ProblemKind::Jump;
        let mut places: Vec<usize> = self.problems.iter().filter(|p| is_jump(p)).map(|p| p.point).collect();
        places.sort_unstable();
        places.dedup();
        let all = 5 * places.len() >= self.points || self.step_ms >= WAYPOINTS_MS;
        // The join between two pieces of a trajectory affects only one step. If jumps occur in many consecutive
        // steps, they belong to a move that is too fast.
        let on_the_way = |point: usize| {
            let has = |p: Option<usize>| p.is_some_and(|p| places.binary_search(&p).is_ok());
            let (before, after) = (point.checked_sub(1), Some(point + 1));
            has(before) && has(after)
                || has(before) && has(point.checked_sub(2))
                || has(after) && has(Some(point + 2))
        };
        let is_haste = |p: &Problem| is_jump(p) && (all || on_the_way(p.point));
        let (jumps, rest): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.problems).into_iter().partition(is_haste);
        self.problems = rest;
        if let Some(places) = self.places.get_mut(&ProblemKind::Jump) {
            places.retain(|point| jumps.iter().all(|p| p.point != *point));
        }
        let h = f64::from(self.step_ms) * 1e-3;
        for Problem { joint, point, value, limit, .. } in jumps {
            self.add(ProblemKind::PositionSpeed, joint, point, 0.0, value / h, limit / h);
        }
    }

    /// Returns `true` if no problem prevents the execution of the trajectory.
    pub fn is_ok(&self) -> bool {
        self.problems.iter().all(|p| p.warning)
    }

    /// Returns `true` if only one problem prevents the execution: the arm is not at the first point.
    pub fn is_only_elsewhere(&self) -> bool {
        !self.is_ok() && self.refusals().all(|p| p.kind == ProblemKind::StartPose)
    }

    /// Returns the fault that probably causes all problems.
    pub fn suspicion(&self) -> Suspicion {
        use ProblemKind::*;
        let too_fast = |p: &Problem| {
            matches!(
                p.kind,
                Velocity
                    | Acceleration
                    | Torque
                    | NoStop
                    | PositionSpeed
                    | VelocityScale
                    | AccelerationScale
                    | FrictionVelocity
            )
        };
        let turn = std::f64::consts::TAU;
        if self.is_ok() {
            Suspicion::Nothing
        } else if self.furthest().is_some_and(|(_, far)| far.abs() > turn && far.abs() <= turn.to_degrees()) {
            Suspicion::Degrees
        } else if self.problems.iter().any(|p| p.kind == Jump) {
            Suspicion::Pieces
        } else if self.refusals().all(too_fast) {
            Suspicion::TooFast
        } else {
            Suspicion::Nothing
        }
    }

    /// Returns the joint with the position that is farthest from zero, and this position (rad).
    fn furthest(&self) -> Option<(Joint, f64)> {
        let ends = Joint::ALL.into_iter().zip(&self.joints);
        let ends = ends.flat_map(|(j, f)| [(j, f.position_min_rad), (j, f.position_max_rad)]);
        ends.filter(|(_, q)| q.is_finite()).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// Returns the problems that prevent the execution.
    pub fn refusals(&self) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(|p| !p.warning)
    }

    /// Returns the problems that do not prevent the execution.
    pub fn warnings(&self) -> impl Iterator<Item = &Problem> {
        self.problems.iter().filter(|p| p.warning)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (points, step, s) = (self.points, self.step_ms, self.duration_s);
        let word = if self.is_ok() { "passed" } else { "refused" };
        write!(f, "{word}: {points} points, step {step} ms, {s:.2} s")?;
        let (mut shown, mut left) = (self.causes.len(), 0);
        if let (Suspicion::Degrees, Some(far)) = (self.suspicion(), self.furthest()) {
            write!(f, "\n  the positions look like degrees: {} is at {:.1}", far.0, far.1)?;
            // If the unit of the positions is wrong, the wrong unit causes all other problems, so these are not
            // shown.
            shown = self.causes.iter().take_while(|c| c.kind <= ProblemKind::Position).count().max(1);
            left = self.causes.len().saturating_sub(shown);
        }
        for cause in self.causes.iter().take(shown) {
            write!(f, "\n  {cause}")?;
        }
        if left > 0 {
            write!(f, "\n  and {left} further kinds of problems that follow from this one")?;
        }
        Ok(())
    }
}
