//! Changes of settings by a user. All values are checked before the first value is sent (J-53).

use jtc_core::settings;
use jtc_wire::SettingValue;

use super::Session;
use crate::error::{Error, ExtensionError};
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Changes settings like [`Session::set_settings`], either all settings or none. Before anything is sent, each value
    /// is checked, and all values are checked together with the device's settings.
    ///
    /// # Errors
    ///
    /// [`ExtensionError::Setting`] with the value and its limit; the errors of [`Session::device_config`] and
    /// [`Session::set_settings`].
    pub fn change_settings(&mut self, values: &[SettingValue]) -> Result<(), Error> {
        let config = self.device_config()?;
        settings::with_values(&config, values.iter().copied()).map_err(ExtensionError::Setting)?;
        self.set_settings(values)
    }
}
