//! Summary of the problems of one kind: joints, number of points, first occurrence and worst occurrence.

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
    /// Text that describes the kind of the problems.
    pub words: &'static str,
    /// Unit of the values and limits; empty if the problems are about a count.
    pub unit: &'static str,
    /// Joints in which the problem occurs; empty if the problem concerns the whole trajectory.
    pub joints: Vec<Joint>,
    /// Number of points of the file at which, or directly after which, the problem occurs.
    pub points: usize,
    /// First occurrence of the problem along the path.
    pub first: Seen,
    /// Occurrence at which the value exceeds the limit the most.
    pub worst: Seen,
    /// `true` if the trajectory can run despite the problem.
    pub warning: bool,
}

/// For each kind of problem, the indices of the points at which it occurs.
pub(super) type Places = BTreeMap<ProblemKind, BTreeSet<usize>>;

/// Returns one cause for each kind of problem, in the order of `problems`. Warnings get their own cause.
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
    /// Writes one line if the problem occurs at a single point in at most one joint, otherwise two or three lines.
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
        // The first line already contains the text of the kind, so the texts of the occurrences do not repeat it.
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
