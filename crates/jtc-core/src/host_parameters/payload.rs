//! Blend of a new payload into the model (J-60). For half a second, the model changes gradually from the old to the
//! new payload. The change therefore does not cause a torque step.
use jtc_dynamics::{Dynamics, LinkInertias};

use crate::JOINTS;
use crate::bit_codec::bit_codec;

/// Length of the blend, ms.
pub(crate) const BLEND_MS: u16 = 500;

/// State of the blend from one payload to another.
#[derive(Clone, Debug)]
pub(crate) struct PayloadBlend {
    from: LinkInertias,
    to: LinkInertias,
    /// Mass that the blend has not added yet, kg. The remaining mass is negative if the new payload is lighter.
    mass: f64,
    left_ms: u16,
}

/// State of a payload blend for a snapshot. The inertial parameters at the end of the blend follow from the arm and its
/// configured payload, so this state does not contain them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlendState {
    left_ms: u16,
    mass: f64,
    /// Inertial parameters of the arm at the beginning of the blend. `None` if the blend has ended.
    from: Option<[[f64; 7]; JOINTS]>,
}

bit_codec!(BlendState { left_ms, mass, from });

impl PayloadBlend {
    /// Returns the state of the blend.
    pub(crate) fn state(&self) -> BlendState {
        BlendState {
            left_ms: self.left_ms,
            mass: self.mass,
            from: (self.left_ms > 0).then(|| self.from.numbers()),
        }
    }

    /// Continues the blend from this state. `dynamics` are the dynamics of the arm with its whole payload.
    pub(crate) fn restore(&mut self, state: &BlendState, dynamics: &mut Dynamics) {
        *self = Self::none(dynamics);
        if let Some(from) = &state.from {
            (self.left_ms, self.mass) = (state.left_ms.min(BLEND_MS), state.mass);
            self.from = LinkInertias::from_numbers(from);
            dynamics.set_inertias(&self.between());
        }
    }

    /// Returns the inertial parameters of the arm at the present stage of the blend.
    fn between(&self) -> LinkInertias {
        self.from.toward(&self.to, 1.0 - f64::from(self.left_ms) * (1.0 / BLEND_MS as f64))
    }

    /// Creates a blend that has ended.
    pub(crate) fn none(dynamics: &Dynamics) -> Self {
        let now = dynamics.inertias();
        Self { from: now, to: now, mass: 0.0, left_ms: 0 }
    }

    /// Begins a blend from the present arm `now` to the arm `next` with the new payload. An earlier blend need not
    /// have ended. `heavier` is the mass of the new payload minus the mass of the last payload, kg.
    pub(crate) fn begin(&mut self, now: &Dynamics, next: &Dynamics, heavier: f64) {
        let mass = self.mass + heavier;
        *self = Self { from: now.inertias(), to: next.inertias(), mass, left_ms: BLEND_MS };
    }

    /// Clears the blend, because the rebuilt model contains the whole payload.
    pub(crate) fn forget(&mut self) {
        (self.left_ms, self.mass) = (0, 0.0);
    }

    /// Returns the mass that the next tick of the blend adds, kg.
    pub(crate) fn next_mass(&self) -> f64 {
        self.mass / f64::from(self.left_ms.max(1))
    }

    /// Returns the remaining time of the blend, ms.
    pub(crate) fn left_ms(&self) -> u16 {
        self.left_ms
    }

    /// Executes one tick of the blend.
    pub(crate) fn step(&mut self, dynamics: &mut Dynamics) {
        match self.left_ms {
            0 => {}
            1 => self.end(dynamics),
            _ => {
                self.mass -= self.next_mass();
                self.left_ms -= 1;
                dynamics.set_inertias(&self.between());
            }
        }
    }

    /// Ends the blend at once, because a torque step does not matter while the torque is off.
    pub(crate) fn end(&mut self, dynamics: &mut Dynamics) {
        self.mass = 0.0;
        if core::mem::take(&mut self.left_ms) > 0 {
            dynamics.set_inertias(&self.to);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Parameters};

    /// The masses of three successive payload changes add up to 1.25 kg. The blend adds exactly this mass, although
    /// the second and the third change begin before the previous blend has ended.
    #[test]
    fn j60_as_much_mass_comes_as_is_given() {
        let mut dynamics = Dynamics::new(&Parameters::avena().model, Config::avena().gravity);
        let mut blend = PayloadBlend::none(&dynamics);
        let mut come = 0.0;
        for (heavier, ticks) in [(1.5, 200), (-0.5, 499), (0.25, 1_000)] {
            let now = dynamics.clone();
            blend.begin(&now, &now, heavier);
            for _ in 0..ticks {
                come += blend.next_mass();
                blend.step(&mut dynamics);
            }
        }
        assert!((come - 1.25).abs() < 1e-12, "{come}");
        assert_eq!((blend.left_ms(), blend.next_mass()), (0, 0.0));
    }

    #[test]
    fn j60_a_rebuilt_model_ends_the_blend() {
        let dynamics = Dynamics::new(&Parameters::avena().model, Config::avena().gravity);
        let mut blend = PayloadBlend::none(&dynamics);
        blend.begin(&dynamics, &dynamics, 1.5);
        assert_eq!((blend.left_ms(), blend.next_mass()), (500, 1.5 / 500.0));
        assert!(blend.state().from.is_some());
        blend.forget();
        assert_eq!((blend.left_ms(), blend.next_mass()), (0, 0.0));
        assert!(blend.state().from.is_none(), "the state of an ended blend needs no inertias");
    }

    /// At the end of the blend, the model is exactly the model with the next payload. The last step copies this
    /// model, because an interpolation from a heavy payload to a light one would leave a rounding error.
    #[test]
    fn j60_at_the_end_of_the_blend_the_model_is_exactly_the_next_arm() {
        let (model, gravity) = (Parameters::avena().model, Config::avena().gravity);
        let with = |mass: f64| {
            let payload = jtc_dynamics::Payload { mass, com: [0.3, -0.7, 0.11], inertia: [0.0; 6] };
            Dynamics::with_payload(&model, gravity, &payload)
        };
        for (from, mass) in [(0.1, 1.3), (50.0, 0.1), (47.0, 0.003), (33.0, 0.0)] {
            let (mut dynamics, next) = (with(from), with(mass));
            let mut blend = PayloadBlend::none(&dynamics);
            let now = dynamics.clone();
            blend.begin(&now, &next, mass - from);
            for _ in 0..BLEND_MS {
                assert_ne!(dynamics.inertias().numbers(), next.inertias().numbers(), "{mass}");
                blend.step(&mut dynamics);
            }
            assert_eq!(dynamics.inertias().numbers(), next.inertias().numbers(), "{mass}");
            assert_eq!(blend.left_ms(), 0);
        }
    }
}
