//! Errors of the planner.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, Next, next};
use jtc_core::POINTS_MAX;
use jtc_plan::kinematics;

use super::margin::{MARGIN_PCT, MARGIN_PCT_MAX};
use crate::check::Verdict;
use crate::error::facts;

/// Reason why a motion cannot be planned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The motion is not possible. The error contains the waypoint, joint, value and limit, if they apply.
    #[error(transparent)]
    Plan(#[from] jtc_plan::PlanError),
    /// All waypoints are equal.
    #[error("all {count} waypoints are at the same position, so there is no motion")]
    Nowhere {
        /// Number of waypoints.
        count: usize,
    },
    /// The check rejects the motion at every speed.
    #[error("{0}")]
    Refused(Box<Verdict>),
    /// The requested speed is out of range.
    #[error("speed {percent} % is out of range, expected 1..{most} %")]
    Speed {
        /// Requested speed, %.
        percent: f64,
        /// Maximum speed, %.
        most: f64,
    },
    /// The requested torque margin is out of range.
    #[error(
        "torque margin {percent} % is out of range, expected 0 to {MARGIN_PCT_MAX} % of each limit, by default {MARGIN_PCT}"
    )]
    Margin {
        /// Requested torque margin, % of each torque limit.
        percent: f64,
    },
    /// The blend is too large. Its unit is probably wrong.
    #[error("blend of {value} {unit} is out of range, expected 0..{most} {unit}")]
    Blend {
        /// Requested blend.
        value: f64,
        /// Maximum blend.
        most: f64,
        /// Unit of the blend: rad, or m for corners between lines and arcs.
        unit: &'static str,
    },
    /// The waypoints have too many corners for the maximum number of trajectory points.
    #[error(
        "too many sharp corners: {corners}, expected at most {most} for the {POINTS_MAX} points of a trajectory"
    )]
    TooManyCorners {
        /// Number of corners in the waypoints.
        corners: usize,
        /// Maximum number of corners.
        most: usize,
    },
    /// The motion is too long: the points of its trajectory are too far apart for its corners.
    #[error(
        "the motion is too long for its corners: in {seconds:.0} s, {POINTS_MAX} points are {step_ms} ms apart"
    )]
    TooFine {
        /// Duration of the motion, s.
        seconds: f64,
        /// Time step between the points, ms.
        step_ms: u16,
    },
    /// The motion takes longer than the longest possible trajectory.
    #[error(
        "the motion is too long: it takes {seconds:.0} s or more, which {POINTS_MAX} points cannot cover"
    )]
    TooLong {
        /// Minimum duration of the motion, s.
        seconds: f64,
    },
}

impl PlanError {
    /// Returns the number of the waypoint in the error, counted from 1. Returns `None` if the error is not about a waypoint.
    pub fn waypoint(&self) -> Option<usize> {
        match self {
            Self::Plan(error) => error.waypoint(),
            _ => None,
        }
    }

    /// Returns the remedy for a move whose goal or start is outside the limits. Returns `None` if the general remedy of [`Diagnose`]
    /// applies.
    pub fn next_of_move(&self) -> Option<Next> {
        match self {
            Self::Plan(jtc_plan::PlanError::Position { waypoint: 1, .. }) => {
                Some(next!("{} moves the joint back inside its limits", Jog))
            }
            Self::Plan(jtc_plan::PlanError::Position { .. }) => Some(next!(
                "choose a position inside the limits, which {} lists; positions are in rad, and in degrees with --deg",
                ArmShow
            )),
            _ => None,
        }
    }

    /// Returns the error message for a move. In a move, the first waypoint is the position of the arm, and the second waypoint is the goal.
    pub fn of_move(&self) -> String {
        use jtc_plan::PlanError as Of;
        use kinematics::PoseError as Pose;
        let Self::Plan(error) = self else { return self.to_string() };
        let what = error.what();
        match error {
            Of::Flange(Pose::Leg { distance, length, source, .. }) => {
                format!("{distance:.4} m of {length:.4} m along the line: {source}")
            }
            Of::Flange(Pose::Waypoint { waypoint: 1, .. }) => {
                format!("in the present pose of the arm: {what}")
            }
            Of::NotFinite { waypoint: 1, .. }
            | Of::Position { waypoint: 1, .. }
            | Of::Torque { waypoint: 1, .. } => {
                format!("in the present pose of the arm, {what}")
            }
            _ => what,
        }
    }
}

impl Diagnose for PlanError {
    fn diagnosis(&self) -> Diagnosis {
        use jtc_plan::PlanError as Of;
        match self {
            Self::Plan(
                e @ (Of::TooFew { .. } | Of::NotFinite { .. } | Of::Blend { .. } | Of::Time { .. }),
            ) => Diagnosis::new(ErrorKind::Usage, "waypoints", e.hint()),
            Self::Plan(Of::Flange(e @ kinematics::PoseError::Blend { .. })) => {
                Diagnosis::new(ErrorKind::Usage, "waypoints", e.hint())
            }
            Self::Plan(e @ Of::TooEarly { limit: jtc_plan::LimitKind::Torque, .. }) => {
                let hint = format!("{}; or plan with a smaller torque margin", e.hint());
                Diagnosis::new(ErrorKind::Refused, "plan", hint)
            }
            Self::Plan(e) => Diagnosis::new(ErrorKind::Refused, "plan", e.hint()),
            Self::Refused(verdict) => {
                let what = "choose waypoints or poses that are less stretched out or nearer to each other, or use a lighter payload";
                let slower = "give later times, or omit the times";
                let too_fast = verdict.slower(100.0).is_some();
                Diagnosis::new(ErrorKind::Refused, "check", if too_fast { slower } else { what })
            }
            Self::Nowhere { .. } => {
                Diagnosis::new(ErrorKind::Refused, "waypoints", "give a waypoint at another position")
            }
            Self::Speed { most, .. } => Diagnosis::new(
                ErrorKind::Usage,
                "speed",
                if *most > 100.0 {
                    "give 100 for the speed of the file itself"
                } else {
                    "give 100 for the fastest motion within the limits"
                },
            ),
            Self::Margin { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "margin",
                "use a larger margin for an arm with an uncertain model; 0 plans with the whole torque",
            ),
            Self::Blend { unit, .. } => {
                let next = if *unit == "m" {
                    Next::from("check the unit: this blend is in m (20 mm = 0.02 m)")
                } else {
                    next!(
                        "check the unit: a blend is in rad (5° = 0.0873 rad), and in degrees with {}, like the positions",
                        Degrees
                    )
                };
                Diagnosis::new(ErrorKind::Usage, "waypoints", next)
            }
            Self::TooManyCorners { .. } | Self::TooFine { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "too-long",
                "plan the motion in parts with fewer waypoints, or omit waypoints",
            ),
            Self::TooLong { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "too-long",
                "plan the motion in parts, or at a higher speed",
            ),
        }
    }

    fn facts(&self) -> Facts {
        facts::of_plan(self)
    }
}

#[cfg(test)]
mod tests {
    use jtc_plan::PlanError as Of;
    use jtc_wire::Joint;
    use kinematics::PoseError;

    use super::*;

    /// The error message of a move contains no waypoint numbers. Waypoint 1 is called the present pose of the arm,
    /// and the number of waypoint 2 (the goal) is omitted.
    #[test]
    fn a_move_is_refused_with_the_words_of_its_waypoint() {
        let joint = Joint::ALL[2];
        for (waypoint, place) in [(1, "in the present pose of the arm, "), (2, "")] {
            let torque =
                |holding| Of::Torque { waypoint, joint, torque: 90.0, limit: 77.6, whole: 80.0, holding };
            let position = Of::Position { waypoint, joint, value: 5.0, min: -1.0, max: 1.0 };
            let not_finite = Of::NotFinite { waypoint, joint, value: f64::NAN };
            for error in [not_finite, position, torque(true), torque(false)] {
                let (text, error) = (error.to_string(), PlanError::from(error));
                assert_eq!(error.waypoint(), Some(waypoint), "{text}");
                assert_eq!(error.of_move(), text.replace(&format!("waypoint {waypoint}, "), place));
            }
        }
        let source = || Box::new(PoseError::NoMotion);
        let of = |error: PoseError| PlanError::from(Of::from(error)).of_move();
        let start = of(PoseError::Waypoint { waypoint: 1, source: source() });
        assert_eq!(start, format!("in the present pose of the arm: {}", PoseError::NoMotion));
        assert_eq!(
            of(PoseError::Waypoint { waypoint: 2, source: source() }),
            PoseError::NoMotion.to_string()
        );
        let leg = of(PoseError::Leg { leg: 1, distance: 0.1, length: 0.4, source: source() });
        assert_eq!(leg, format!("0.1000 m of 0.4000 m along the line: {}", PoseError::NoMotion));
        let none = PlanError::Nowhere { count: 2 };
        assert_eq!((none.waypoint(), none.of_move()), (None, none.to_string()));
    }
}
