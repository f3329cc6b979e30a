//! Steps of a recovery as text.

use crate::arm::Difference;

/// A step of a recovery.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RecoverStep {
    /// Controller and arm have different values for a setting, and the user has accepted the difference.
    Differs(Difference),
    /// State of the controller.
    Found(String),
    /// The safety input is low, so the operator must release the emergency stop.
    SafetyInput,
    /// The motion is stopped.
    Stop,
    /// Teaching is switched off.
    TeachOff,
    /// The current errors of the controller and of these nodes are cleared.
    Clear(Vec<String>),
    /// Nodes are reset.
    Reset(Vec<String>),
    /// Friction, gains and arm model are set. The values are the parameters of the arm with this name, or the defaults of the controller.
    Give(Option<String>),
    /// No parameters are sent, so the controller keeps its parameters.
    Keep,
    /// The parameters of the user's arm are not sent, because the controller already holds the arm's weight with
    /// other parameters.
    KeepHolding(String),
    /// Nodes start up.
    WaitNodes(Vec<String>),
    /// The recovery is complete, and the controller is in HoldPos without errors.
    HoldPos,
}

impl std::fmt::Display for RecoverStep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RecoverStep::Differs(difference) => write!(f, "warning: {difference}"),
            RecoverStep::Found(line) => write!(f, "found: {line}"),
            RecoverStep::SafetyInput => {
                write!(f, "the safety input is low: release the emergency stop (waiting)")
            }
            RecoverStep::Stop => write!(f, "stopping the motion"),
            RecoverStep::TeachOff => write!(f, "switching teaching off"),
            RecoverStep::Clear(nodes) if nodes.is_empty() => write!(f, "clearing the controller's errors"),
            RecoverStep::Clear(nodes) => {
                write!(f, "clearing the errors of the controller and of {}", nodes.join(", "))
            }
            RecoverStep::Reset(nodes) => write!(f, "resetting {}", nodes.join(", ")),
            RecoverStep::Give(None) => write!(
                f,
                "friction, gains and arm model: the defaults of the controller, those of its built-in arm"
            ),
            RecoverStep::Give(Some(arm)) => write!(f, "friction, gains and arm model: those of {arm}"),
            RecoverStep::Keep => {
                write!(f, "friction, gains and arm model: unchanged, as the controller received them before")
            }
            RecoverStep::KeepHolding(arm) => write!(
                f,
                "the controller holds the arm with its previous friction, gains and arm model, not with those of {arm}; push the parameters to \
                 change this"
            ),
            RecoverStep::WaitNodes(nodes) => write!(f, "waiting for {}", nodes.join(", ")),
            RecoverStep::HoldPos => write!(f, "HoldPos, no errors"),
        }
    }
}
