//! Joints that are marked as absent, for work on a bench (J-53).

use jtc_core::{JOINTS, settings};
use jtc_wire::{Joint, SettingValue};

use super::Session;
use crate::error::Error;
use crate::port::Port;

impl<P: Port> Session<P> {
    /// Returns the position that the model uses for each joint that is marked as absent, rad. The position of a present joint is `None`.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::device_config`].
    pub fn absent(&mut self) -> Result<[Option<f64>; JOINTS], Error> {
        let config = self.device_config()?;
        Ok(std::array::from_fn(|j| config.absent[j].then_some(config.absent_position[j])))
    }

    /// Marks each joint with a position (rad) in `absent` as absent, and all other joints as present. The controller must be in Init or
    /// Error. While a joint is marked as absent, the controller executes no motion. An answer from the drive of this joint is an error.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::set_settings`].
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
