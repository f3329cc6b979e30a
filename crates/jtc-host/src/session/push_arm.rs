//! Transfer of a complete arm to a device (J-51, J-54).
use jtc_wire::{ControllerState, Name, SettingValue};

use super::{PushReport, Session};
use crate::arm::{Arm, ParameterSet};
use crate::error::{Error, ExtensionError, LinkError};
use crate::port::Port;

/// Part of an arm that the device has received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArmPart<'a> {
    /// Number of settings.
    Settings(usize),
    /// Name of the arm.
    Name,
    /// Friction, gains or model.
    Parameter(&'a PushReport),
}

impl<P: Port> Session<P> {
    /// Sends the complete arm to the device. If the settings or the name differ from the device, the function sends these values first. The
    /// function then sends friction, gains and model. Finally the function reads the arm back from the device and compares it with `arm`.
    /// If settings of the device and the arm differ, the device must be in Init or Error.
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::Incomplete`] for an arm without gains or friction. Returns
    /// [`ParametersError::Unstable`](crate::ParametersError) if the arm is not stable with its gains. Returns [`ExtensionError::Differs`]
    /// if the arm that was read back differs. Also returns the errors of [`Session::set_settings`] and [`Session::push`].
    pub fn push_arm(&mut self, arm: &Arm, done: impl FnMut(ArmPart<'_>)) -> Result<Vec<PushReport>, Error> {
        self.push_arm_until(arm, || false, done)
    }

    /// Like [`Session::push_arm`], but stops once `ended` returns `true` because the user cancels. The device then keeps the parts for
    /// which `done` was called.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::push_arm`], and [`Error::Cancelled`] if the caller cancels.
    pub fn push_arm_until(
        &mut self,
        arm: &Arm,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(ArmPart<'_>),
    ) -> Result<Vec<PushReport>, Error> {
        let (set, hash) = whole(arm)?;
        self.withdraw_arm()?;
        self.push_settings(arm, &ended, &mut done)?;
        let pushed = self.push_until(&set, &ended, |report| done(ArmPart::Parameter(report)))?;
        self.has_arm(arm, hash)?;
        Ok(pushed)
    }

    /// Sends the complete arm like [`Session::push_arm`] and stores it (J-54). Returns the number of the stored arm.
    /// The arm has no torque during the transfer.
    ///
    /// A controller that has friction, gains and model leaves Init and holds the arm. To prevent this, the function
    /// makes the controller drop the parameters that it has already received, before it sends the last of the three.
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::Powered`], before a frame is sent, if the controller is neither in Init nor in
    /// Error. Also returns the errors of [`Session::push_arm`] and [`Session::store_arm`].
    pub fn push_and_store_arm(
        &mut self,
        arm: &Arm,
        done: impl FnMut(ArmPart<'_>),
    ) -> Result<(Vec<PushReport>, u32), Error> {
        self.push_and_store_arm_until(arm, || false, done)
    }

    /// Like [`Session::push_and_store_arm`], but stops once `ended` returns `true` because the user cancels. The device then keeps the
    /// parts for which `done` was called.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::push_and_store_arm`], and [`Error::Cancelled`] if the caller cancels.
    pub fn push_and_store_arm_until(
        &mut self,
        arm: &Arm,
        ended: impl Fn() -> bool,
        mut done: impl FnMut(ArmPart<'_>),
    ) -> Result<(Vec<PushReport>, u32), Error> {
        let (set, hash) = whole(arm)?;
        let state = self.fresh_status()?.state;
        if !state.is_in(&[ControllerState::Init, ControllerState::Error]) {
            return Err(ExtensionError::Powered { state }.into());
        }
        let last = ParameterSet { pid: set.pid, ..ParameterSet::default() };
        let first = ParameterSet { pid: None, ..set };
        self.withdraw_arm()?;
        self.push_settings(arm, &ended, &mut done)?;
        let mut pushed = self.push_until(&first, &ended, |report| done(ArmPart::Parameter(report)))?;
        self.withdraw_arm()?;
        pushed.extend(self.push_until(&last, &ended, |report| done(ArmPart::Parameter(report)))?);
        self.has_arm(arm, hash)?;
        let number = self.store_arm()?;
        // The device now has no active arm, as after its start. The device uses the stored arm when a host requests
        // this.
        self.withdraw_arm()?;
        Ok((pushed, number))
    }

    /// If the arm has no torque, commands the device to drop its active arm. A device without an active arm cannot combine parts of two
    /// arms (J-71).
    fn withdraw_arm(&mut self) -> Result<(), Error> {
        let state = self.fresh_status()?.state;
        if state == ControllerState::Init {
            self.disable()?;
        } else if state == ControllerState::Error {
            match self.disable() {
                // Older firmware rejects this command in the state Error. The rejection is ignored, because this
                // firmware accepts each parameter separately in this state.
                Err(LinkError::Refused { .. }) => {}
                done => done?,
            }
        }
        Ok(())
    }

    /// Sends the settings and the name that differ from the values of the device.
    fn push_settings(
        &mut self,
        arm: &Arm,
        ended: &impl Fn() -> bool,
        done: &mut impl FnMut(ArmPart<'_>),
    ) -> Result<(), Error> {
        let goes_on = || if ended() { Err(Error::Cancelled) } else { Ok(()) };
        let now = self.settings()?;
        let settings: Vec<SettingValue> =
            arm.settings().into_iter().filter(|own| !now.contains(own)).collect();
        if !settings.is_empty() {
            goes_on()?;
            self.set_settings(&settings)?;
            done(ArmPart::Settings(settings.len()));
        }
        let name = Name::cut(&arm.name);
        if self.info()?.is_some_and(|info| info.arm != name) {
            goes_on()?;
            self.set_name(&name)?;
            done(ArmPart::Name);
        }
        goes_on()
    }

    /// Reads the arm back from the device, and checks that it is equal to `arm`.
    fn has_arm(&mut self, arm: &Arm, hash: u64) -> Result<(), Error> {
        if self.info()?.is_some_and(|info| info.hash == hash) {
            return Ok(());
        }
        let differences = arm.differences(&self.device_arm()?);
        Err(ExtensionError::Differs { arm: arm.name.clone(), differences }.into())
    }
}

/// Returns all parameters of an arm that a device needs, and the hash of the arm.
fn whole(arm: &Arm) -> Result<(ParameterSet, u64), Error> {
    let set = arm.parameter_set();
    let Some(hash) = arm.hash()? else {
        return Err(ExtensionError::Incomplete { arm: arm.name.clone(), missing: set.missing() }.into());
    };
    arm.check_gains()?;
    Ok((set, hash))
}
