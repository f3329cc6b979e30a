//! What goes beyond the protocol of existing devices: identity, settings, the arm as one thing, jogging (J-50 to J-58).

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

/// A device reports every reason to a host that sent an extension request within the last 2 s (J-51): it is repeated in time.
pub(super) const ASK_AGAIN: Duration = Duration::from_secs(1);
/// Longest that a device may take to store an arm: erasing a sector of flash does.
const STORING: Duration = Duration::from_secs(30);

/// What is known of the device's extensions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Extensions {
    /// Nobody has asked yet.
    #[default]
    Unknown,
    /// It has none.
    None,
    /// It has some; asked at this time of the port.
    Asked(Duration),
}

impl<P: Port> Session<P> {
    /// Who the device is; `None` when it has no extensions.
    ///
    /// # Errors
    ///
    /// Those of the line.
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

    /// What the device does about what it has found (J-69); `None` where it does not tell, or the line does not answer.
    pub fn reactions(&mut self) -> Option<Reactions> {
        self.info().ok().flatten()?.reactions
    }

    /// What the device has found when it held the arm last (J-69); `None` where it does not tell, or the line does not answer.
    pub fn stop_cause(&mut self) -> Option<StopCause> {
        self.reactions()?.stop.map(|(cause, _)| cause)
    }

    /// Fails where the arm is in a held stop (J-69).
    pub(super) fn without_held_stop(&mut self, status: &Status) -> Result<(), Error> {
        if !status.is_held_stop() {
            return Ok(());
        }
        Err(StateError::HeldStop { status: Box::new(*status), cause: self.stop_cause() }.into())
    }

    /// Asks the device who it is where that was not done of late: only then it reports each reason of a refusal (J-51).
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
            // Statuses come: the command itself is worth a try.
            Err(LinkError::NotConfirmed { .. } | LinkError::Refused { .. } | LinkError::Denied { .. }) => {
                self.extensions = Extensions::Asked(self.port.now());
                Ok(())
            }
            asked => asked.map(drop),
        }
    }

    /// Sends an extension request; an error when it is refused or not known.
    pub(super) fn extension(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let request = frame_type(type_byte(frame));
        if self.extensions == Extensions::None {
            return Err(LinkError::NoExtension { request });
        }
        let record = match self.request(frame) {
            // An existing device finds no such type (J-50).
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

    /// Sends an extension request and waits for what it returns.
    pub(super) fn ask<T>(
        &mut self,
        frame: &[u8],
        take: impl Fn(Answer<'_>) -> Option<T>,
    ) -> Result<T, LinkError> {
        self.await_presence()?;
        for _ in 0..self.timeouts.tries {
            self.answers.clear();
            self.extension(frame)?;
            // It follows the record.
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

    /// Asks for what is longer than a frame, page by page: `request` asks for the page from an index on, and `take` returns that
    /// page and the length of the whole.
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

    /// Who the device is, which `request` needs.
    fn info_for(&mut self, request: FrameType) -> Result<Info, LinkError> {
        self.info()?.ok_or(LinkError::NoExtension { request })
    }

    /// Every setting as the device has it, in the order of its table.
    ///
    /// # Errors
    ///
    /// [`LinkError::NoExtension`], and those of the line.
    pub fn settings(&mut self) -> Result<Vec<SettingValue>, LinkError> {
        self.ask_pages(fixed::get_settings, |answer, from| match answer {
            Answer::Settings { first, total, values } if first == from => {
                Some((values.iter().collect(), total))
            }
            _ => None,
        })
    }

    /// The settings that the device computes with; those that are built in where it has no extensions.
    ///
    /// # Errors
    ///
    /// Those of the line, and [`ExtensionError::NoArm`] for settings of no arm.
    pub fn device_config(&mut self) -> Result<Config, Error> {
        if !self.has_extensions() && self.info()?.is_none() {
            return Ok(Config::avena());
        }
        let values = self.settings()?;
        // Those of a later version that this one does not know are left out.
        let known = values.into_iter().filter(|value| settings::setting(value.setting).is_some());
        let config = settings::with_values(&Config::avena(), known);
        Ok(config.map_err(|e| ExtensionError::NoArm { why: e.to_string() })?)
    }

    /// The arm that the device has in use.
    ///
    /// # Errors
    ///
    /// Those of [`Session::arm_image`], and [`ExtensionError::NoArm`] when it is none.
    pub fn device_arm(&mut self) -> Result<Arm, Error> {
        let image = self.arm_image()?;
        Ok(Arm::from_image(&image).map_err(|e| ExtensionError::NoArm { why: e.to_string() })?)
    }

    /// Changes settings, all of them or none.
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`]: a value out of range, or a state that does not allow it; [`LinkError::NoExtension`], and those of the
    /// line.
    pub fn set_settings(&mut self, values: &[SettingValue]) -> Result<(), Error> {
        let mut frame = vec![0; 6 + jtc_wire::VALUE_LEN * values.len().min(SET_VALUES_MAX)];
        let n = set_settings(&mut frame, values.iter().copied())?;
        self.extension(&frame[..n])?;
        self.set_presence(values);
        Ok(())
    }

    /// The device has extensions, as far as it was asked.
    pub fn has_extensions(&self) -> bool {
        matches!(self.extensions, Extensions::Asked(_))
    }

    /// The speed override: path seconds per second (J-57); 1 where the device has none.
    ///
    /// # Errors
    ///
    /// Those of the line.
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

    /// Sets the speed override, 0.05 to 1: a motion gets there along a ramp, and later ones run at it, too (J-57).
    ///
    /// # Errors
    ///
    /// Those of [`Session::set_settings`].
    pub fn set_speed(&mut self, speed: f64) -> Result<(), Error> {
        self.set_settings(&[SettingValue { setting: settings::SPEED, joint: 0, value: speed }])
    }

    /// Names the arm that the device controls.
    ///
    /// # Errors
    ///
    /// Those of [`Session::set_settings`].
    pub fn set_name(&mut self, name: &Name) -> Result<(), LinkError> {
        self.extension(&fixed::set_name(name))
    }

    /// The arm in use as one thing: a [`jtc_wire::ArmImage`].
    ///
    /// # Errors
    ///
    /// [`ExtensionError::Changed`] when the arm changed meanwhile; those of [`Session::settings`].
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

    /// Keeps the arm in use over a loss of power, and waits until it is kept; returns its number.
    ///
    /// # Errors
    ///
    /// [`ExtensionError::NotStored`] when the memory failed; those of [`Session::set_settings`].
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

    /// Torque off at rest, back to Init; the parameters have to be given again (J-53).
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`] when the arm is not held at rest; [`LinkError::NoExtension`], and those of the line.
    pub fn disable(&mut self) -> Result<(), LinkError> {
        self.extension(&fixed::DISABLE)
    }

    /// Joint velocities, rad/s, base to wrist: **the arm moves**, for 200 ms, unless this is called again before (J-58).
    ///
    /// # Errors
    ///
    /// [`LinkError::Refused`] outside HoldPos, beside a paused path, or for a velocity beyond its limit;
    /// [`LinkError::NoExtension`], and those of the line.
    pub fn jog(&mut self, velocity: &[f64; JOINTS]) -> Result<(), Error> {
        let mut frame = [0; 30];
        floats(&mut frame, FrameType::Jog, velocity.iter().copied())?;
        let halts = self.port.halts();
        match self.extension(&frame) {
            // Another program's Stop has overtaken it (J-04). The port says whose it was, and sends nothing that moves the arm.
            Err(LinkError::Refused { .. }) if self.port.halts() != halts => Ok(self.extension(&frame)?),
            done => Ok(done?),
        }
    }
}
