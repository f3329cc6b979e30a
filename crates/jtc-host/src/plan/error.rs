//! Why there is no plan.

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_core::POINTS_MAX;
use jtc_plan::kinematics;

use crate::check::Verdict;

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// There is no such motion; waypoint, joint, value and limit are in it.
    #[error(transparent)]
    Plan(#[from] jtc_plan::PlanError),
    /// Waypoints that are all the same.
    #[error("all {count} waypoints are at the same place: that is no motion")]
    Nowhere {
        /// Waypoints given.
        count: usize,
    },
    /// The check refuses the motion, however slow it is.
    #[error("{0}")]
    Refused(Box<Verdict>),
    /// Not a share of the speed.
    #[error("speed {percent} % is not within 1..{most} %")]
    Speed {
        /// As it was asked for, %.
        percent: f64,
        /// The most, %.
        most: f64,
    },
    /// More corners than a trajectory has points for.
    #[error(
        "{corners} sharp corners are more than the {POINTS_MAX} points of a trajectory can follow: it has room for {most}"
    )]
    TooManyCorners {
        /// Found.
        corners: usize,
        /// At most.
        most: usize,
    },
    /// So long that its points are too far apart for its corners.
    #[error(
        "the motion takes {seconds:.0} s: {POINTS_MAX} points are {step_ms} ms apart then, too far to follow its corners"
    )]
    TooFine {
        /// s.
        seconds: f64,
        /// Step of the points, ms.
        step_ms: u16,
    },
    /// Longer than a trajectory can be.
    #[error("the motion takes {seconds:.0} s, more than {POINTS_MAX} points can hold")]
    TooLong {
        /// s.
        seconds: f64,
    },
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
            Self::Plan(e) => Diagnosis::new(ErrorKind::Refused, "plan", e.hint()),
            Self::Refused(verdict) => {
                let what = "choose other waypoints or poses: less stretched out, or nearer to each other; or carry a lighter payload";
                let slower = "give later times, or leave the times out";
                let too_fast = verdict.slower(100.0).is_some();
                Diagnosis::new(ErrorKind::Refused, "check", if too_fast { slower } else { what })
            }
            Self::Nowhere { .. } => {
                Diagnosis::new(ErrorKind::Refused, "waypoints", "give a waypoint that is elsewhere")
            }
            Self::Speed { .. } => {
                Diagnosis::new(ErrorKind::Usage, "speed", "100 is as fast as the limits allow")
            }
            Self::TooManyCorners { .. } | Self::TooFine { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "too-long",
                "plan it in parts, each of fewer waypoints, or leave waypoints out",
            ),
            Self::TooLong { .. } => {
                Diagnosis::new(ErrorKind::Refused, "too-long", "plan it in parts, or at a higher speed")
            }
        }
    }
}
