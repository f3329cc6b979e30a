//! Settings that users name: all are checked before any is sent (J-53).

use jtc_core::settings;
use jtc_wire::SettingValue;

use super::Session;
use crate::error::{Error, ExtensionError};
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Changes settings, all of them or none, like [`Session::set_settings`]. Before anything is sent, checks each
    /// value, and all values together with the settings that the device has.
    ///
    /// # Errors
    ///
    /// [`ExtensionError::Setting`], with the value and its limit; those of [`Session::device_config`] and [`Session::set_settings`].
    pub fn change_settings(&mut self, values: &[SettingValue]) -> Result<(), Error> {
        let config = self.device_config()?;
        settings::with_values(&config, values.iter().copied()).map_err(ExtensionError::Setting)?;
        self.set_settings(values)
    }
}
