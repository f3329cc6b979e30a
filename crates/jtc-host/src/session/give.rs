//! A whole arm for a device, as one thing (J-51, J-54).
use jtc_wire::{ControllerState, Name, SettingValue};

use super::{PushReport, Session};
use crate::arm::{Arm, ParameterSet};
use crate::error::{Error, ExtensionError, LinkError};
use crate::port::Port;

/// What a device has got of an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ArmPart<'a> {
    /// So many settings.
    Settings(usize),
    /// Its name.
    Name,
    /// Friction, gains or model.
    Parameter(&'a PushReport),
}

impl<P: Port> Session<P> {
    /// Gives the device the whole arm: settings and name where they differ, then friction, gains and model; reads it back and
    /// compares. The device has to be in Init or Error where settings differ.
    ///
    /// # Errors
    ///
    /// [`ExtensionError::Incomplete`] for an arm without gains or friction, [`ParametersError::Unstable`](crate::ParametersError) for gains
    /// with which it is not stable, [`ExtensionError::Differs`] when what is read back is
    /// another one; those of [`Session::set_settings`] and [`Session::push`].
    pub fn push_arm(&mut self, arm: &Arm, done: impl FnMut(ArmPart<'_>)) -> Result<Vec<PushReport>, Error> {
        self.push_arm_until(arm, || false, done)
    }

    /// The same, until `ended` returns true because a person wants it to end: nothing more is sent then, and the device keeps what `done` was
    /// called with.
    ///
    /// # Errors
    ///
    /// Those of [`Session::push_arm`]; [`Error::Cancelled`].
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

    /// Gives the device the whole arm like [`Session::push_arm`], and has it stored (J-54); returns the number that the stored arm
    /// has. The arm has no torque meanwhile: with friction, gains and model the controller would leave Init and hold it, so what it
    /// has got is withdrawn before the last of the three comes.
    ///
    /// # Errors
    ///
    /// [`ExtensionError::Powered`] outside Init and Error, before anything is sent; those of [`Session::push_arm`] and
    /// [`Session::store_arm`].
    pub fn push_and_store_arm(
        &mut self,
        arm: &Arm,
        done: impl FnMut(ArmPart<'_>),
    ) -> Result<(Vec<PushReport>, u32), Error> {
        self.push_and_store_arm_until(arm, || false, done)
    }

    /// The same, until `ended` returns true because a person wants it to end: nothing more is sent then, and the device keeps what `done` was
    /// called with.
    ///
    /// # Errors
    ///
    /// Those of [`Session::push_and_store_arm`]; [`Error::Cancelled`].
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
        // As after a start: what is stored is in use when a host asks for it, all of it.
        self.withdraw_arm()?;
        Ok((pushed, number))
    }

    /// Without torque, the device forgets its arm: parts of another one do not go with it (J-71).
    fn withdraw_arm(&mut self) -> Result<(), Error> {
        let state = self.fresh_status()?.state;
        if state == ControllerState::Init {
            self.disable()?;
        } else if state == ControllerState::Error {
            match self.disable() {
                // Older firmware does not do that in Error, and takes each part by itself.
                Err(LinkError::Refused { .. }) => {}
                done => done?,
            }
        }
        Ok(())
    }

    /// Settings and name, where they differ.
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

    /// The device has this arm, read back.
    fn has_arm(&mut self, arm: &Arm, hash: u64) -> Result<(), Error> {
        if self.info()?.is_some_and(|info| info.hash == hash) {
            return Ok(());
        }
        let differences = arm.differences(&self.device_arm()?);
        Err(ExtensionError::Differs { arm: arm.name.clone(), differences }.into())
    }
}

/// All that a device takes of an arm by parameter frames, and the arm's hash.
fn whole(arm: &Arm) -> Result<(ParameterSet, u64), Error> {
    let set = arm.parameter_set();
    let Some(hash) = arm.hash()? else {
        return Err(ExtensionError::Incomplete { arm: arm.name.clone(), missing: set.missing() }.into());
    };
    arm.check_gains()?;
    Ok((set, hash))
}
