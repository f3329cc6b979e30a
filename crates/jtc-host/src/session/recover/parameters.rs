//! Checks of an arm before a recovery sends its parameters to a controller.

use std::sync::Arc;

use jtc_wire::Status;

use super::{ParameterSource, RecoverStep};
use crate::arm::Arm;
use crate::error::{CheckError, Error, ParametersError};
use crate::port::Port;
use crate::session::Session;

/// Parameters that a recovery sends to a controller without torque (J-55).
#[derive(Clone, Debug, Default)]
pub enum RecoverParameters {
    /// No parameters. If the controller lacks parameters, the recovery fails.
    #[default]
    None,
    /// Default parameters of the controller, built in or stored.
    ControllerDefaults,
    /// Parameters of an arm.
    Arm {
        /// Arm with friction, gains and model.
        arm: Arc<Arm>,
        /// `true` if the caller accepts that settings of the controller differ from the settings of the arm. The recovery sends only
        /// friction, gains and model, and does not send settings.
        accept_device_limits: bool,
    },
}

impl RecoverParameters {
    /// Checks that an arm has all parameters and that its gains keep it stable.
    ///
    /// # Errors
    ///
    /// Returns [`ParametersError::IncompleteArm`] if a parameter is missing. Returns [`ParametersError::Unstable`] if the arm is not stable
    /// with its gains.
    pub fn check(&self) -> Result<(), ParametersError> {
        let Self::Arm { arm, .. } = self else { return Ok(()) };
        ParameterSource::Arm { name: &arm.name, set: &arm.parameter_set() }.check()?;
        arm.check_gains()
    }
}

impl<P: Port> Session<P> {
    /// Like [`Session::recover_until`]. Before the recovery, checks the parameters and compares the arm's limits with the
    /// limits of the controller.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`RecoverParameters::check`] and [`Session::recover_until`]. Returns [`CheckError::DeviceLimits`] if
    /// controller and arm have different limits, and the caller does not accept the differences. If one of these checks fails, the
    /// controller is unchanged.
    pub fn recover_with(
        &mut self,
        parameters: &RecoverParameters,
        ended: impl Fn() -> bool,
        mut report: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        parameters.check()?;
        let (arm, accept_device_limits) = match parameters {
            RecoverParameters::None => return self.recover_until(ParameterSource::None, ended, report),
            RecoverParameters::ControllerDefaults => {
                return self.recover_until(ParameterSource::ControllerDefaults, ended, report);
            }
            RecoverParameters::Arm { arm, accept_device_limits } => (arm, *accept_device_limits),
        };
        let stops = self.port.halts().stops;
        let differences = arm.device_differences(&self.device_config()?);
        // A Stop that arrived during these checks also ends the recovery.
        let stopped = self.port.halts().stops != stops;
        if !differences.is_empty() && !accept_device_limits {
            return Err(CheckError::DeviceLimits { arm: arm.name.clone(), differences }.into());
        }
        for difference in differences {
            report(&RecoverStep::Differs(difference));
        }
        let set = arm.parameter_set();
        let source = ParameterSource::Arm { name: &arm.name, set: &set };
        self.recover_until(source, || stopped || ended(), report)
    }
}
