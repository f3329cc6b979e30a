//! Changes of settings by a user. The session checks all values before it sends the first value (J-53).

use jtc_core::settings;
use jtc_wire::SettingValue;

use super::Session;
use crate::error::{Error, ExtensionError};
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Changes settings like [`Session::set_settings`]: the device accepts either all of these settings or none of them. Before the
    /// function sends a setting, it checks each value, and checks all values together with the device's other settings.
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::Setting`] with the value and its limit. Also returns the errors of [`Session::device_config`] and
    /// [`Session::set_settings`].
    pub fn change_settings(&mut self, values: &[SettingValue]) -> Result<(), Error> {
        let config = self.device_config()?;
        settings::with_values(&config, values.iter().copied()).map_err(ExtensionError::Setting)?;
        self.set_settings(values)
    }
}
