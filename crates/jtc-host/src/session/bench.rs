//! Joints that are not there, for work on a bench (J-53).

use jtc_core::{JOINTS, settings};
use jtc_wire::{Joint, SettingValue};

use super::Session;
use crate::error::Error;
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Where the model has each joint that is set absent, rad; `None` for those that are there.
    ///
    /// # Errors
    ///
    /// Those of [`Session::device_config`].
    pub fn absent(&mut self) -> Result<[Option<f64>; JOINTS], Error> {
        let config = self.device_config()?;
        Ok(std::array::from_fn(|j| config.absent[j].then_some(config.absent_position[j])))
    }

    /// Sets the joints with a position (rad) absent, and all others not. The controller has to be in Init or Error. It executes no motion
    /// while a joint is absent, and a drive that answers all the same is an error.
    ///
    /// # Errors
    ///
    /// Those of [`Session::set_settings`].
    pub fn set_absent(&mut self, absent: &[Option<f64>; JOINTS]) -> Result<(), Error> {
        let mut values = Vec::new();
        for (joint, position) in Joint::ALL.into_iter().zip(absent) {
            let mut set =
                |setting, value| values.push(SettingValue { setting, joint: joint.number(), value });
            set(settings::ABSENT, f64::from(u8::from(position.is_some())));
            set(settings::ABSENT_POSITION, position.unwrap_or(0.0));
        }
        self.set_settings(&values)
    }
}
