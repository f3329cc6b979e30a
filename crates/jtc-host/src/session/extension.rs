//! Protocol extensions for identity, settings, complete arms and jogging (J-50 to J-58). Existing devices do not
//! support these extensions.

use std::time::Duration;

use jtc_core::{Config, settings};
use jtc_wire::{
    Answer, FrameRef, FrameStatus, FrameType, Info, JOINTS, Name, Reactions, SET_VALUES_MAX, SettingValue,
    Status, StopCause, StoreState, fixed, floats, set_settings,
};

use super::limit::Limit;
use super::{Session, frame_type, type_byte};
use crate::arm::Arm;
use crate::error::{Error, ExtensionError, LinkError, StateError};
use crate::port::Port;

/// Maximum age of the last extension request. A device reports specific reasons for rejections only for 2 s after an
/// extension request (J-51), so an older request is repeated.
pub(super) const ASK_AGAIN: Duration = Duration::from_secs(1);
/// Maximum time that a device needs to store an arm, including the erasing of a flash sector.
const STORING: Duration = Duration::from_secs(30);

/// Knowledge of the session about the extensions of the device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Extensions {
    /// The session has not sent an extension request yet.
    #[default]
    Unknown,
    /// The device does not support the extensions.
    None,
    /// The device supports the extensions. The value is the time of the last extension request, on the clock of the
    /// port.
    Asked(Duration),
}

impl<P: Port> Session<P> {
    /// Returns the identity of the device. Returns `None` if the device has no extensions.
    ///
    /// # Errors
    ///
    /// Returns communication errors.
    pub fn info(&mut self) -> Result<Option<Info>, LinkError> {
        let info = self.ask(&fixed::GET_INFO, |answer| match answer {
            Answer::Info(info) => Some(info),
            _ => None,
        });
        match info {
            Ok(info) => Ok(Some(info)),
            Err(LinkError::NoExtension { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Returns the device's report about its reactions to detected problems (J-69). Returns `None` if the device has no such report or does
    /// not answer.
    pub fn reactions(&mut self) -> Option<Reactions> {
        self.info().ok().flatten()?.reactions
    }

    /// Returns the cause of the device's last held stop (J-69). Returns `None` if the device does not report the cause or does not answer.
    pub fn stop_cause(&mut self) -> Option<StopCause> {
        self.reactions()?.stop.map(|(cause, _)| cause)
    }

    /// Returns an error if the arm is in a held stop (J-69).
    pub(super) fn without_held_stop(&mut self, status: &Status) -> Result<(), Error> {
        if !status.is_held_stop() {
            return Ok(());
        }
        Err(StateError::HeldStop { status: Box::new(*status), cause: self.stop_cause() }.into())
    }

    /// Requests the identity of the device if the last extension request is more than 1 s old. After a GetInfo, the device reports specific
    /// reasons for rejections (J-51).
    pub(super) fn introduce(&mut self) -> Result<(), LinkError> {
        let due = match self.extensions {
            Extensions::Unknown => true,
            Extensions::None => false,
            Extensions::Asked(at) => self.port.now().saturating_sub(at) > ASK_AGAIN,
        };
        if !due {
            return Ok(());
        }
        match self.info() {
            // A missing answer is not treated as an error: statuses still arrive, so the next command may succeed.
            Err(LinkError::NotConfirmed { .. } | LinkError::Refused { .. } | LinkError::Denied { .. }) => {
                self.extensions = Extensions::Asked(self.port.now());
                Ok(())
            }
            asked => asked.map(drop),
        }
    }

    /// Sends an extension request. Returns an error if the device rejects the request or does not know this type of
    /// request.
    pub(super) fn extension(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let request = frame_type(type_byte(frame));
        if self.extensions == Extensions::None {
            return Err(LinkError::NoExtension { request });
        }
        let record = match self.request(frame) {
            // A device without extensions answers that the frame type is unknown (J-50).
            Err(LinkError::NotConfirmed { last: Some(last), .. })
                if last.status == FrameStatus::IncorrectFrameType =>
            {
                self.extensions = Extensions::None;
                return Err(LinkError::NoExtension { request });
            }
            record => record?,
        };
        self.extensions = Extensions::Asked(self.port.now());
        if !crate::error::accepted(&record) {
            return Err(self.refused(record));
        }
        self.presence.accepted();
        Ok(())
    }

    /// Sends an extension request and waits for its answer.
    pub(super) fn ask<T>(
        &mut self,
        frame: &[u8],
        take: impl Fn(Answer<'_>) -> Option<T>,
    ) -> Result<T, LinkError> {
        self.await_presence()?;
        for _ in 0..self.timeouts.tries {
            self.answers.clear();
            self.extension(frame)?;
            // The answer arrives after the response record of the request.
            let mut limit = Limit::new(self.confirmation_time(jtc_wire::ANSWER_MAX));
            loop {
                while let Some(bytes) = self.answers.pop_front() {
                    let answer = FrameRef::new_checked(&bytes).and_then(Answer::parse);
                    if let Some(found) = answer.and_then(&take) {
                        return Ok(found);
                    }
                }
                if !self.wait_within(&mut limit)? {
                    break;
                }
            }
        }
        let request = frame_type(type_byte(frame));
        Err(LinkError::NotConfirmed { request, tries: self.timeouts.tries, last: None })
    }

    /// Requests data that are longer than a frame, page by page. `request` creates the request for the page that begins at an index. `take`
    /// returns the page and the total length of the data.
    fn ask_pages<T, const N: usize>(
        &mut self,
        request: impl Fn(u16) -> [u8; N],
        take: impl Fn(Answer<'_>, u16) -> Option<(Vec<T>, u16)>,
    ) -> Result<Vec<T>, LinkError> {
        let mut all = Vec::new();
        loop {
            let from = all.len() as u16;
            let (page, total) = self.ask(&request(from), |answer| take(answer, from))?;
            let done = page.is_empty();
            all.extend(page);
            if done || all.len() >= usize::from(total) {
                return Ok(all);
            }
        }
    }

    /// Returns the identity of the device. If the device has no extensions, the error contains `request`.
    fn info_for(&mut self, request: FrameType) -> Result<Info, LinkError> {
        self.info()?.ok_or(LinkError::NoExtension { request })
    }

    /// Returns every setting of the device, in the order of the settings table.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::NoExtension`] if the device has no extensions. Also returns communication errors.
    pub fn settings(&mut self) -> Result<Vec<SettingValue>, LinkError> {
        self.ask_pages(fixed::get_settings, |answer, from| match answer {
            Answer::Settings { first, total, values } if first == from => {
                Some((values.iter().collect(), total))
            }
            _ => None,
        })
    }

    /// Returns the active settings of the device. If the device has no extensions, returns the built-in settings.
    ///
    /// # Errors
    ///
    /// Returns communication errors. Returns [`ExtensionError::NoArm`] if the settings are not a valid arm.
    pub fn device_config(&mut self) -> Result<Config, Error> {
        if !self.has_extensions() && self.info()?.is_none() {
            return Ok(Config::avena());
        }
        let values = self.settings()?;
        // Settings of a later firmware that this program does not know are ignored.
        let known = values.into_iter().filter(|value| settings::setting(value.setting).is_some());
        let config = settings::with_values(&Config::avena(), known);
        Ok(config.map_err(|e| ExtensionError::NoArm { why: e.to_string() })?)
    }

    /// Returns the active arm of the device.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::arm_image`], and [`ExtensionError::NoArm`] if the image is not a valid arm.
    pub fn device_arm(&mut self) -> Result<Arm, Error> {
        let image = self.arm_image()?;
        Ok(Arm::from_image(&image).map_err(|e| ExtensionError::NoArm { why: e.to_string() })?)
    }

    /// Changes settings. The device accepts either all of these settings or none of them.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if a value is out of range, or if the device does not permit changes in its state. Returns
    /// [`LinkError::NoExtension`] if the device has no extensions. Also returns communication errors.
    pub fn set_settings(&mut self, values: &[SettingValue]) -> Result<(), Error> {
        let mut frame = vec![0; 6 + jtc_wire::VALUE_LEN * values.len().min(SET_VALUES_MAX)];
        let n = set_settings(&mut frame, values.iter().copied())?;
        self.extension(&frame[..n])?;
        self.set_presence(values);
        Ok(())
    }

    /// Returns `true` if the device is known to have extensions.
    pub fn has_extensions(&self) -> bool {
        matches!(self.extensions, Extensions::Asked(_))
    }

    /// Returns the speed override (path seconds per second, J-57). The override is 1 if the device does not have this
    /// setting.
    ///
    /// # Errors
    ///
    /// Returns communication errors.
    pub fn speed(&mut self) -> Result<f64, LinkError> {
        let config = Config::avena();
        let first = settings::values(&config, 0, false)
            .position(|value| value.setting == settings::SPEED)
            .unwrap_or(0) as u16;
        let speed = self.ask(&fixed::get_settings(first), |answer| match answer {
            Answer::Settings { values, .. } => Some(
                values.iter().find(|value| value.setting == settings::SPEED).map_or(1.0, |value| value.value),
            ),
            _ => None,
        });
        match speed {
            Err(LinkError::NoExtension { .. }) => Ok(1.0),
            speed => speed,
        }
    }

    /// Sets the speed override, from 0.05 to 1. A running motion changes its speed along a ramp. Later motions also use the new speed
    /// override (J-57).
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::set_settings`].
    pub fn set_speed(&mut self, speed: f64) -> Result<(), Error> {
        self.set_settings(&[SettingValue { setting: settings::SPEED, joint: 0, value: speed }])
    }

    /// Sets the name of the arm that the device controls.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::set_settings`].
    pub fn set_name(&mut self, name: &Name) -> Result<(), LinkError> {
        self.extension(&fixed::set_name(name))
    }

    /// Returns the complete active arm as a [`jtc_wire::ArmImage`].
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::Changed`] if the arm changed while it was read. Also returns the errors of [`Session::settings`].
    pub fn arm_image(&mut self) -> Result<Vec<u8>, Error> {
        let info = self.info_for(FrameType::GetArm)?;
        let image = self.ask_pages(fixed::get_arm, |answer, from| match answer {
            Answer::Arm { offset, total, bytes } if offset == from => Some((bytes.to_vec(), total)),
            _ => None,
        })?;
        let whole = jtc_wire::ArmImage::parse(&image).is_some();
        if whole && jtc_wire::Hash::of_image(&image) == info.hash {
            Ok(image)
        } else {
            Err(ExtensionError::Changed.into())
        }
    }

    /// Stores the active arm in non-volatile memory and waits until it is stored. Returns the sequence number of the stored
    /// arm.
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::NotStored`] if the memory failed. Also returns the errors of [`Session::set_settings`].
    pub fn store_arm(&mut self) -> Result<u32, Error> {
        self.extension(&fixed::STORE_ARM)?;
        let end = self.port.now() + STORING;
        loop {
            let info = self.info_for(FrameType::StoreArm)?;
            match info.store {
                StoreState::Stored => return Ok(info.sequence),
                StoreState::Busy if self.port.now() < end => {
                    let until = self.port.now() + Duration::from_millis(200);
                    while self.port.now() < until {
                        self.read(until.saturating_sub(self.port.now()))?;
                    }
                }
                state => return Err(ExtensionError::NotStored { state }.into()),
            }
        }
    }

    /// Switches the torque off and returns to Init. The arm must be at rest. The parameters must then be sent again (J-53).
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if the arm is not held at rest. Returns [`LinkError::NoExtension`] if the device has no extensions.
    /// Also returns communication errors.
    pub fn disable(&mut self) -> Result<(), LinkError> {
        self.extension(&fixed::DISABLE)
    }

    /// Jogs at these joint velocities (rad/s, base to wrist). **The arm moves** until 200 ms after the last call, or until a
    /// call in which all velocities are 0 (J-58).
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Refused`] if the controller is not in HoldPos, if a trajectory is paused, or if a velocity exceeds its limit.
    /// Returns [`LinkError::NoExtension`] if the device has no extensions. Also returns communication errors.
    pub fn jog(&mut self, velocity: &[f64; JOINTS]) -> Result<(), Error> {
        let mut frame = [0; 30];
        floats(&mut frame, FrameType::Jog, velocity.iter().copied())?;
        let halts = self.port.halts();
        match self.extension(&frame) {
            // The controller has executed another program's Stop before this frame (J-04). The frame is sent again
            // only to get the reason: the port rejects it with an error that names the other program.
            Err(LinkError::Refused { .. }) if self.port.halts() != halts => Ok(self.extension(&frame)?),
            done => Ok(done?),
        }
    }
}
