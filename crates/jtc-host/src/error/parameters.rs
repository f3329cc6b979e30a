//! Errors when the friction, the gains and the arm model are sent to the controller.

use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};
use jtc_wire::{DataStatus, FrameType};

use crate::arm::{Beyond, ParameterError};
use crate::labels;

/// Reason why the controller did not receive its parameters.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParametersError {
    /// A value is out of range for its serial frame, or is not physically possible.
    #[error(transparent)]
    Value(#[from] ParameterError),
    /// The controller refused a parameter that is out of the bounds of known controllers.
    #[error("{}: {}: {beyond}", labels::request(*request), labels::data_status(DataStatus::IncorrectValue))]
    BeyondBounds {
        /// Type of the request.
        request: FrameType,
        /// Joint, value and bounds of the refused parameter.
        beyond: Beyond,
    },
    /// The arm lacks values, or has a body that cannot be a link of this arm. `jtc arm check` refuses this arm.
    #[error("{arm}: {problem}; nothing was sent")]
    Impossible {
        /// Name of the arm.
        arm: String,
        /// Text with the link or joint, the value and the limit.
        problem: String,
        /// Next step for the operator.
        next: Next,
    },
    /// The control loop of the arm is unstable with the gains.
    #[error("{arm}: {problem}; nothing was sent")]
    Unstable {
        /// Name of the arm.
        arm: String,
        /// Text with the joint, the value and the limit.
        problem: String,
        /// Next step for the operator.
        next: Next,
    },
    /// The controller needs parameters that the caller did not provide.
    #[error("the controller lacks parameters: {}; nothing was sent", missing.join(", "))]
    NoSource {
        /// Names of the missing parameters.
        missing: Vec<&'static str>,
    },
    /// An arm file does not contain all parameters that a controller needs.
    #[error("{arm}: {} missing, and parts of another arm cannot replace them; nothing was sent", missing.join(", "))]
    IncompleteArm {
        /// Name of the arm.
        arm: String,
        /// Names of the missing parameters.
        missing: Vec<&'static str>,
    },
}

impl Diagnose for ParametersError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Value(e) => e.diagnosis(),
            Self::BeyondBounds { .. } => Diagnosis::new(
                ErrorKind::Device,
                "beyond-bounds",
                "this number could throw or drop the arm: correct the file (`jtc params show FILE`). The parameters in the controller are unchanged",
            ),
            Self::Impossible { next, .. } => Diagnosis::new(
                ErrorKind::Refused,
                "impossible-arm",
                next.clone().then(next!("; {} lists all problems", ArmCheck)),
            ),
            Self::Unstable { next, .. } => Diagnosis::new(
                ErrorKind::Refused,
                "unstable-gains",
                next.clone().then(next!("; {} lists all problems", ArmCheck)),
            ),
            Self::NoSource { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "no-parameters",
                next!(
                    "{} sends the parameters of your arm; {} uses those of the arm that is built into the controller, if yours is that arm",
                    RecoverWithArm,
                    RecoverWithDefaults
                ),
            ),
            Self::IncompleteArm { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "incomplete-arm",
                "a URDF has neither friction nor gains: `jtc arm import` makes an arm file from it and proposes both. Otherwise copy \
                 arms/avena.toml and enter all numbers of this arm, or name all files with `jtc params push`",
            ),
        }
    }
}
