//! Problems summed by what causes them: which joints, at how many points, where it is first and where it is worst.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use jtc_wire::Joint;
use serde::Serialize;

use super::HOLD_SHARE;
use super::kind::ProblemKind;
use super::verdict::Problem;

/// A place of the path where something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// `None`: the trajectory as a whole.
    pub joint: Option<Joint>,
    /// Point (from 0); with `ms` > 0 between this and the next.
    pub point: usize,
    /// ms after `point`.
    pub ms: f64,
    /// Time along the path, s.
    pub time_s: f64,
    /// In the unit of its kind.
    pub value: f64,
    /// Its limit, or what the other channel says.
    pub limit: f64,
}

/// All problems of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// What is wrong.
    pub kind: ProblemKind,
    /// The same in words.
    pub words: &'static str,
    /// Unit of values and limits; empty for numbers.
    pub unit: &'static str,
    /// None where it is the trajectory as a whole.
    pub joints: Vec<Joint>,
    /// Points of the file at which it is, or after which it is before the next.
    pub points: usize,
    /// The first place along the path.
    pub first: Seen,
    /// The place where it is furthest beyond its limit.
    pub worst: Seen,
    /// The trajectory can run all the same.
    pub warning: bool,
}

/// Points at which each kind is.
pub(super) type Places = BTreeMap<ProblemKind, BTreeSet<usize>>;

/// One cause for each kind of `problems`, in their order.
pub(super) fn causes(problems: &[Problem], places: &Places) -> Vec<Cause> {
    let mut causes: Vec<Cause> = Vec::new();
    let mut excess = Vec::new();
    for problem in problems {
        let (kind, warning) = (problem.kind, problem.warning);
        let at = causes.iter().position(|c: &Cause| c.kind == kind && c.warning == warning);
        let Some(at) = at else {
            causes.push(Cause {
                kind,
                words: kind.words(),
                unit: kind.unit(),
                joints: problem.joint.into_iter().collect(),
                points: places.get(&kind).map_or(1, BTreeSet::len),
                first: problem.first,
                worst: problem.worst(),
                warning,
            });
            excess.push(problem.excess());
            continue;
        };
        let cause = &mut causes[at];
        cause.joints.extend(problem.joint);
        if problem.first.time_s < cause.first.time_s {
            cause.first = problem.first;
        }
        if problem.excess() > excess[at] {
            (cause.worst, excess[at]) = (problem.worst(), problem.excess());
        }
    }
    for cause in &mut causes {
        cause.joints.sort_unstable();
        cause.joints.dedup();
    }
    causes
}

impl fmt::Display for Cause {
    /// One line where it is at one place, or else three.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.warning {
            f.write_str("warning: ")?;
        }
        let worst = self.worst.words(self.kind);
        if self.points <= 1 && self.joints.len() <= 1 {
            return f.write_str(&worst);
        }
        write!(f, "{}: {}", self.words, joints(&self.joints))?;
        if self.points > 1 {
            write!(f, ", at {} points", self.points)?;
        }
        // The words stand in the line above.
        let short = |words: &str| words.replacen(&format!("{}: ", self.words), "", 1);
        write!(f, "\n    worst: {}", short(&worst))?;
        if self.first != self.worst {
            write!(f, "\n    first: {}", short(&self.first.words(self.kind)))?;
        }
        Ok(())
    }
}

/// "joint 2", "joints 1, 2 and 6".
fn joints(joints: &[Joint]) -> String {
    let names: Vec<String> = joints.iter().map(|joint| joint.number().to_string()).collect();
    match names.split_last() {
        None => "the whole trajectory".into(),
        Some((last, [])) => format!("joint {last}"),
        Some((last, others)) => format!("joints {} and {last}", others.join(", ")),
    }
}

impl Seen {
    /// What is wrong there, with value, limit, point and time.
    pub(super) fn words(&self, kind: ProblemKind) -> String {
        use ProblemKind::*;
        let Self { joint, point, ms, time_s, value, limit } = self;
        let (unit, words, next) = (kind.unit(), kind.words(), point + 1);
        let joint = joint.map_or(String::new(), |joint| format!("{joint}: "));
        let place = if *ms > 0.0 {
            format!("{ms} ms after point {point} ({time_s:.3} s)")
        } else {
            format!("at point {point} ({time_s:.3} s)")
        };
        let what = match kind {
            Empty | StepTime => words.to_owned(),
            TooManyPoints | TooManySegments => format!("{words}: {value}, at most {limit}"),
            SegmentPoints => format!("{words}: {value}, 1 to {limit} are possible"),
            Jump => format!(
                "jump of {value:+.4} rad between points {point} and {next} ({time_s:.3} s; at most {limit:.4} rad in a step)"
            ),
            StartPose => format!("{value:+.4} rad away from the first point (tolerance {limit} rad)"),
            NoStop => format!(
                "a stop in time from {ms} ms after point {point} ({time_s:.3} s) needs {value:+.1} N·m, more than the {limit} N·m \
                 that there are"
            ),
            HoldTorque => {
                let most = limit.abs() / HOLD_SHARE;
                let (share, limit) = (100.0 * value.abs() / most, limit.abs());
                format!(
                    "standing still at point {point} ({time_s:.3} s) takes {value:+.1} N·m, {share:.1} % of the torque limit \
                     ({most:.1} N·m); at most {:.0} % ({limit:.1} N·m), or the noise of the encoder drops the arm later",
                    100.0 * HOLD_SHARE
                )
            }
            NotAtRest => format!("{words}: {value:+.4} {unit} {place}"),
            VelocityMismatch | AccelerationMismatch => format!(
                "{words}: {value:+.4} {unit} between points {point} and {next} ({time_s:.3} s) where {limit:+.4} {unit} is said"
            ),
            _ => format!("{words}: {value:+.4} {unit} (limit {limit}) {place}"),
        };
        joint + &what
    }
}
