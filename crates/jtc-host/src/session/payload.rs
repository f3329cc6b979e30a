//! Payload at the flange of the arm (J-60).

use jtc_core::{Config, Payload, settings};
use jtc_dynamics::Dynamics;
use jtc_wire::{ControllerState, DataStatus, Joint};

use super::Session;
use crate::error::{Error, ExtensionError, LinkError};
use crate::port::Port;

/// Largest radius of gyration of a payload, m. A straight rod of 3.4 m has this radius.
const RADIUS_MAX: f64 = 1.0;

/// Returns the reason why the inertia is larger than that of any body that an arm carries. Returns `None` for a credible
/// inertia. Such an inertia is in another unit, is not about the centre of mass, or is a placeholder.
fn too_wide(payload: &Payload) -> Option<String> {
    let [xx, _, _, yy, _, zz] = payload.inertia;
    // The sum of the moments about three axes is twice the mass times the square of the distance from the centre of mass.
    let radius = ((xx + yy + zz) / (2.0 * payload.mass)).sqrt();
    (payload.mass > 0.0 && radius > RADIUS_MAX).then(|| {
        format!(
            "payload: {} kg with moments of inertia of {xx}, {yy} and {zz} kg m2 have a radius of gyration of {radius:.2} m, expected {RADIUS_MAX} m at most; \
             check the unit, and that the inertia is about the centre of mass",
            payload.mass
        )
    })
}

impl<P: Port> Session<P> {
    /// Returns the payload that the controller assumes at the flange. If the device has no extensions, the payload is
    /// [`Payload::NONE`].
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::device_config`].
    pub fn payload(&mut self) -> Result<Payload, Error> {
        Ok(self.device_config()?.payload)
    }

    /// Sets the payload. The controller changes its torque to the new payload within half a second. Until then,
    /// Execute and teaching wait, and the controller rejects jogging.
    ///
    /// # Errors
    ///
    /// Returns [`ExtensionError::NoBody`], before a frame is sent, if the payload is not a physical body. Returns
    /// [`ExtensionError::TooHeavy`] if a joint could not hold the payload in the present pose of the arm. Returns
    /// [`ExtensionError::PayloadInMotion`] if a commanded motion is in progress. Also returns the errors of
    /// [`Session::set_settings`]. After an error the controller keeps its earlier payload.
    pub fn set_payload(&mut self, payload: &Payload) -> Result<(), Error> {
        payload.check().map_err(|e| ExtensionError::NoBody { why: e.to_string() })?;
        if let Some(why) = too_wide(payload) {
            return Err(ExtensionError::NoBody { why }.into());
        }
        let values: Vec<_> = settings::payload_values(payload).collect();
        // The payload is checked with the default settings. A value that is out of range here is out of range for
        // every controller.
        let alone = settings::with_values(&Config::avena(), values.iter().copied());
        if let Err(settings::SettingError::Value { .. }) = alone.as_ref() {
            return Err(
                ExtensionError::NoBody { why: alone.err().map_or(String::new(), |e| e.to_string()) }.into()
            );
        }
        match self.set_settings(&values) {
            Err(Error::Link(LinkError::Refused {
                code: DataStatus::NotAllowed, state, trajectory, ..
            })) => Err(ExtensionError::PayloadInMotion { state, trajectory }.into()),
            Err(Error::Link(refused @ LinkError::Refused { code: DataStatus::IncorrectValue, .. })) => {
                Err(self.why_refused(payload)?.map_or(Error::Link(refused), Error::Extension))
            }
            done => done,
        }
    }

    /// Returns the reason why the controller rejected a physically valid payload, if the reason can be determined.
    fn why_refused(&mut self, payload: &Payload) -> Result<Option<ExtensionError>, Error> {
        let config = self.device_config()?;
        if let Err(e) = config.parameter_bounds.check_payload(payload) {
            let why = format!("{} is {}, expected {} to {}", e.what, e.value, e.low, e.high);
            return Ok(Some(ExtensionError::NoBody { why }));
        }
        let (arm, status) = (self.device_arm()?, self.fresh_status()?);
        if status.state == ControllerState::Start {
            return Ok(None);
        }
        let torque =
            Dynamics::with_payload(&arm.model, config.gravity, payload).gravity_torque(&status.positions());
        let share = |joint: &Joint| torque[joint.index()].abs() / config.joints[joint.index()].torque_max;
        let worst = Joint::ALL.into_iter().max_by(|a, b| share(a).total_cmp(&share(b)));
        Ok(worst.filter(|joint| share(joint) > 0.99).map(|joint| ExtensionError::TooHeavy {
            mass: payload.mass,
            joint,
            torque: torque[joint.index()],
            limit: config.joints[joint.index()].torque_max,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J-60: a body with the inertia of a much larger one is refused before it is sent, and every real tool is accepted.
    #[test]
    fn j60_an_inertia_that_is_too_large_for_a_body_is_refused() {
        let of = |mass, [xx, yy, zz]: [f64; 3]| Payload {
            mass,
            com: [0.0, 0.0, 0.08],
            inertia: [xx, 0.0, 0.0, yy, 0.0, zz],
        };
        let why = too_wide(&of(2.0, [100.0; 3])).expect("the radius of gyration is 8.66 m");
        assert!(why.contains("8.66 m"), "{why}");
        // A point mass, a gripper of 2 kg, and a rod of 2 kg that is 2 m long: 2 · 2² / 12 = 0.667 kg·m².
        for body in
            [of(2.0, [0.0; 3]), of(2.0, [0.01, 0.01, 0.005]), of(2.0, [0.667, 0.667, 0.001]), Payload::NONE]
        {
            assert_eq!(too_wide(&body), None);
        }
    }
}
