//! The checks of an arm before recover gives its parameters to a controller.

use std::sync::Arc;

use jtc_wire::Status;

use super::{ParameterSource, RecoverStep};
use crate::arm::Arm;
use crate::error::{CheckError, Error, ParametersError};
use crate::port::Port;
use crate::session::Session;

/// Parameters that recover gives to a controller without torque (J-55).
#[derive(Clone, Debug, Default)]
pub enum RecoverParameters {
    /// None: recover refuses a controller that needs some.
    #[default]
    None,
    /// Parameters that are built into the controller, or stored there.
    ControllerDefaults,
    /// Parameters of an arm.
    Arm {
        /// Arm with friction, gains and model.
        arm: Arc<Arm>,
        /// Accepts values of the arm that no frame carries and that the controller has otherwise.
        accept_device_limits: bool,
    },
}

impl RecoverParameters {
    /// Checks that an arm has all parameters and that its gains keep it stable.
    ///
    /// # Errors
    ///
    /// [`ParametersError::IncompleteArm`], [`ParametersError::Unstable`].
    pub fn check(&self) -> Result<(), ParametersError> {
        let Self::Arm { arm, .. } = self else { return Ok(()) };
        ParameterSource::Arm { name: &arm.name, set: &arm.parameter_set() }.check()?;
        arm.check_gains()
    }
}

impl<P: Port> Session<P> {
    /// Like [`Session::recover_until`], after a check of the parameters and a comparison of the arm's limits with those of the controller.
    ///
    /// # Errors
    ///
    /// The errors of [`RecoverParameters::check`] and [`Session::recover_until`]; [`CheckError::DeviceLimits`] if the controller has other
    /// limits than the arm and they are not accepted. The controller is unchanged in these cases.
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
        // A Stop that came meanwhile ends the recovery, too.
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
