//! Whose parameters a controller is given on its way back.

use jtc_wire::{ControllerState, Status};

use super::RecoverStep;
use crate::arm::ParameterSet;
use crate::error::ParametersError;
use crate::words;

/// Whose friction, gains and arm model a controller is given that misses some (J-55).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ParameterSource<'a> {
    /// Nobody's: a controller that misses some is refused.
    #[default]
    None,
    /// The defaults that are built into the controller, by name.
    ControllerDefaults,
    /// Those of an arm, all of them: a controller without torque is given them whatever it has.
    Arm {
        /// Name of the arm or its file.
        name: &'a str,
        /// All three parts.
        set: &'a ParameterSet,
    },
}

impl ParameterSource<'_> {
    /// An arm must be whole: friction, gains and arm model.
    ///
    /// # Errors
    ///
    /// [`ParametersError::IncompleteArm`] for a set that cannot be given whole.
    pub fn check(&self) -> Result<(), ParametersError> {
        match self {
            ParameterSource::Arm { name, set } if !set.missing().is_empty() => {
                Err(ParametersError::IncompleteArm { arm: (*name).to_owned(), missing: set.missing() })
            }
            _ => Ok(()),
        }
    }

    /// A controller that misses parameters needs a source.
    pub(super) fn enough_for(&self, status: &Status) -> Result<(), ParametersError> {
        match self {
            ParameterSource::None if status.jtc_init != 0 => {
                Err(ParametersError::NoSource { missing: words::missing_parameters(status.jtc_init) })
            }
            _ => Ok(()),
        }
    }

    /// An arm's parameters are given once to any controller, the defaults to one that misses some; always all three, so that those
    /// of two arms are never mixed.
    pub(super) fn due(&self, status: &Status, given: bool) -> bool {
        match self {
            ParameterSource::None => false,
            ParameterSource::ControllerDefaults => status.jtc_init != 0,
            ParameterSource::Arm { .. } => status.jtc_init != 0 || !given,
        }
    }

    /// The step to report when nothing will be given.
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
