//! Errors from the check of a trajectory before its execution.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts, next};

use super::facts;
use crate::arm::{Difference, NOT_CARRIED};
use crate::check::Verdict;
use crate::file::FileError;

/// Reason why a trajectory must not be executed. No frame was sent.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckError {
    /// The check found problems in the trajectory.
    #[error("{0}")]
    Refused(Box<Verdict>),
    /// The arm file and the controller have different values of the limits, the gravity or the rotor inertia (J-55).
    #[error("{arm}: {} of this arm cannot be sent to the controller, which uses its own; nothing was sent ({})", values(differences.len()), listed(differences))]
    DeviceLimits {
        /// Name of the arm.
        arm: String,
        /// Values that differ between the arm file and the controller.
        differences: Vec<Difference>,
    },
    /// The numbers of the arm are not physically possible.
    #[error(transparent)]
    Arm(#[from] FileError),
}

fn values(n: usize) -> String {
    if n == 1 { "1 value".into() } else { format!("{n} values") }
}

fn listed(differences: &[Difference]) -> String {
    differences.iter().map(Difference::to_string).collect::<Vec<_>>().join("; ")
}

impl Diagnose for CheckError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Refused(verdict) => Diagnosis::new(ErrorKind::Refused, "check", verdict.hint()),
            Self::DeviceLimits { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "device-limits",
                next!("a controller with extensions accepts the whole arm with {}; ", ArmPush)
                    .then(format!("for other controllers, set {NOT_CARRIED} in the firmware. "))
                    .then(next!(
                        "If its own values are safe for this arm, {} accepts them",
                        AcceptDeviceLimits
                    )),
            ),
            Self::Arm(e) => e.diagnosis(),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Refused(verdict) => facts::of_verdict(verdict),
            Self::DeviceLimits { .. } | Self::Arm(_) => Facts::default(),
        }
    }
}
