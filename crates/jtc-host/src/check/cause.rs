//! Summary of the problems with one cause: joints, number of points, first occurrence and worst occurrence.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use jtc_wire::Joint;
use serde::Serialize;

use super::kind::ProblemKind;
use super::problem::{Problem, Seen};

/// Summary of all problems of one kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cause {
    /// Kind of the problems.
    pub kind: ProblemKind,
    /// Kind in words.
    pub words: &'static str,
    /// Unit of values and limits. Empty for counts.
    pub unit: &'static str,
    /// Joints with this problem; empty if the problem concerns the whole trajectory.
    pub joints: Vec<Joint>,
    /// Number of file points with the problem, either at the point or before the next point.
    pub points: usize,
    /// First occurrence along the path.
    pub first: Seen,
    /// Occurrence with the largest excess over the limit.
    pub worst: Seen,
    /// `true` if the trajectory can run despite the problem.
    pub warning: bool,
}

/// Points at which each kind of problem occurs.
pub(super) type Places = BTreeMap<ProblemKind, BTreeSet<usize>>;

/// Returns one cause for each kind of `problems`, in the order of the problems.
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
    /// Writes one line if the problem occurs at a single place, otherwise three lines.
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
        // Removes the words that the previous line already contains.
        let short = |words: &str| words.replacen(&format!("{}: ", self.words), "", 1);
        write!(f, "\n    worst: {}", short(&worst))?;
        if self.first != self.worst {
            write!(f, "\n    first: {}", short(&self.first.words(self.kind)))?;
        }
        Ok(())
    }
}

/// Formats a list of joints, such as "joint 2", "joints 1, 2 and 6".
fn joints(joints: &[Joint]) -> String {
    let names: Vec<String> = joints.iter().map(|joint| joint.number().to_string()).collect();
    match names.split_last() {
        None => "the whole trajectory".into(),
        Some((last, [])) => format!("joint {last}"),
        Some((last, others)) => format!("joints {} and {last}", others.join(", ")),
    }
}
