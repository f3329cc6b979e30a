//! Source of the parameters that a recovery sends to a controller.

use jtc_wire::{ControllerState, Status};

use super::RecoverStep;
use crate::arm::ParameterSet;
use crate::error::ParametersError;
use crate::labels;

/// Source of friction, gains and arm model for a controller that lacks some of these parameters (J-55).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ParameterSource<'a> {
    /// No source. If the controller lacks parameters, the recovery fails.
    #[default]
    None,
    /// Default parameters of the controller, built in or stored.
    ControllerDefaults,
    /// All parameters of an arm. The parameters are sent to every controller without torque.
    Arm {
        /// Name of the arm or of the arm file.
        name: &'a str,
        /// Friction, gains and arm model.
        set: &'a ParameterSet,
    },
}

impl ParameterSource<'_> {
    /// Checks that an arm that is used as a source contains friction, gains and arm model.
    ///
    /// # Errors
    ///
    /// Returns [`ParametersError::IncompleteArm`] if the set is not complete.
    pub fn check(&self) -> Result<(), ParametersError> {
        match self {
            ParameterSource::Arm { name, set } if !set.missing().is_empty() => {
                Err(ParametersError::IncompleteArm { arm: (*name).to_owned(), missing: set.missing() })
            }
            _ => Ok(()),
        }
    }

    /// If the controller lacks parameters, checks that there is a source.
    pub(super) fn enough_for(&self, status: &Status) -> Result<(), ParametersError> {
        match self {
            ParameterSource::None if status.jtc_init != 0 => {
                Err(ParametersError::NoSource { missing: labels::missing_parameters(status.jtc_init) })
            }
            _ => Ok(()),
        }
    }

    /// Returns `true` if parameters must be sent. The parameters of an arm are sent once to every controller. The
    /// command to use the defaults is sent only if the controller lacks parameters. Friction, gains and model are
    /// always sent together, so that parameters of two arms are never mixed.
    pub(super) fn due(&self, status: &Status, given: bool) -> bool {
        match self {
            ParameterSource::None => false,
            ParameterSource::ControllerDefaults => status.jtc_init != 0,
            ParameterSource::Arm { .. } => status.jtc_init != 0 || !given,
        }
    }

    /// Returns the step that the recovery reports if it does not send parameters.
    pub(super) fn kept(&self, status: &Status) -> Option<RecoverStep> {
        match self {
            _ if status.jtc_init != 0 => None,
            ParameterSource::Arm { name, .. } => {
                let held = [ControllerState::HoldPos, ControllerState::Operate, ControllerState::Teaching];
                status.state.is_in(&held).then(|| RecoverStep::KeepHolding((*name).to_owned()))
            }
            ParameterSource::None | ParameterSource::ControllerDefaults => Some(RecoverStep::Keep),
        }
    }

    pub(super) fn arm_name(&self) -> Option<String> {
        match self {
            ParameterSource::Arm { name, .. } => Some((*name).to_owned()),
            _ => None,
        }
    }
}
