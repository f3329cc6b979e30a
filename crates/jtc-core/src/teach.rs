//! What Teaching carries besides the modelled arm: a mass at the flange, fitted to the torque that HoldPos had found missing
//! (J-25).
//!
//! HoldPos cannot distinguish an unknown payload or a wrong mass from stiction: the fit contains up to the static friction of
//! each joint. At the pose where teaching begins that is harmless, because the same friction holds the difference. So that
//! little friction never becomes a great mass elsewhere, nothing is fitted where a mass at the flange would hardly load the
//! joints, and the mass is bounded. Nor can it distinguish a load from somebody who leans on the arm and will let go: the
//! fitted torque drives a joint slowly at most.
use jtc_dynamics::Dynamics;

use crate::JOINTS;
use crate::config::Config;
use crate::interpolation::smooth;
use crate::limits::JointConfig;
use crate::remembered::remembered;

/// Ticks over which the missing torque is averaged: the time constant of a low-pass filter.
const AVERAGE_MS: f64 = 100.0;
/// Ticks of calm holding after which the average is trusted: an arm that swings below the speed of standing reverses twice.
const OBSERVED_MS: u16 = 400;
/// Share of a torque limit below which what is missing is no load worth waiting for: friction of the joint holds it.
const LITTLE: f64 = 0.1;
/// Torque of 1 kg at the flange, all joints together (N·m/kg): up to the first nothing is attributed to a mass, from the second
/// all that fits.
const LOAD: (f64, f64) = (2.0, 6.0);

/// The fit, and what it is made from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Payload {
    /// The torque that the model lacks to hold the arm, averaged, N·m.
    missing: [f64; JOINTS],
    /// Ticks that the average is of, at least.
    observed_ms: u16,
    /// Fitted mass at the flange, kg; negative where the modelled arm is too heavy.
    mass: f64,
    /// What did not fit, N·m, and how long it has been fading.
    rest: [f64; JOINTS],
    elapsed_ms: u16,
}

remembered!(Payload { missing, observed_ms, mass, rest, elapsed_ms });

impl Payload {
    /// The arm is not held: what is missing is to be found anew.
    pub fn forget(&mut self) {
        self.observed_ms = 0;
    }

    /// What is missing is known, N·m.
    pub fn know(&mut self, missing: [f64; JOINTS]) {
        (self.missing, self.observed_ms) = (missing, OBSERVED_MS);
    }

    /// It has been observed for long enough to know what the arm carries, or that it is next to nothing.
    pub fn is_known(&self, config: &Config) -> bool {
        let little = |(missing, joint): (&f64, &JointConfig)| missing.abs() < LITTLE * joint.torque_max;
        let nothing = self.observed_ms > 0 && self.missing.iter().zip(&config.joints).all(little);
        nothing || self.observed_ms >= OBSERVED_MS
    }

    /// A tick of HoldPos, which adds `correction` (N·m) to the torque of the model.
    pub fn observe(&mut self, correction: &[f64; JOINTS]) {
        let weight = 1.0 / (f64::from(self.observed_ms) + 1.0).min(AVERAGE_MS);
        self.observed_ms = self.observed_ms.saturating_add(1);
        for (missing, correction) in self.missing.iter_mut().zip(correction) {
            *missing += weight * (correction - *missing);
        }
    }

    /// Teaching begins at `q` (rad): fits the mass, by least squares over the joints.
    pub fn fit(&mut self, dynamics: &Dynamics, q: &[f64; JOINTS], config: &Config) {
        let missing = if self.observed_ms > 0 { self.missing } else { [0.0; JOINTS] };
        let unit = dynamics.flange_torque(q);
        let load: f64 = unit.iter().map(|u| u * u).sum();
        let fitted: f64 =
            unit.iter().zip(&missing).map(|(u, m)| u * m).sum::<f64>() / load.max(f64::MIN_POSITIVE);
        let (none, all) = (LOAD.0 * LOAD.0, LOAD.1 * LOAD.1);
        let mass = fitted * smooth((load - none) / (all - none));
        let bound = config.teach_payload_max;
        self.mass = if mass.is_finite() { mass.max(-bound).min(bound) } else { 0.0 };
        for j in 0..JOINTS {
            self.rest[j] = missing[j] - self.mass * unit[j];
        }
        self.elapsed_ms = 0;
    }

    /// So much mass (kg) at the flange comes into the model with this tick (J-60): as much goes of the fitted one. What is given beyond
    /// that is a load that was not there when the mass was fitted.
    pub fn give_way(&mut self, mass: f64) {
        let left = self.mass - mass;
        self.mass = if self.mass > 0.0 { left.max(0.0).min(self.mass) } else { left.min(0.0).max(self.mass) };
    }

    /// A tick of Teaching at `q` (rad) and `v` (rad/s): the torque that carries the mass, and what is left of the rest, N·m.
    pub fn torque(
        &mut self,
        dynamics: &Dynamics,
        q: &[f64; JOINTS],
        v: &[f64; JOINTS],
        config: &Config,
    ) -> [f64; JOINTS] {
        let unit = dynamics.flange_torque(q);
        let left = 1.0 - smooth(f64::from(self.elapsed_ms) / f64::from(config.teach_fade_ms.max(1)));
        self.elapsed_ms = self.elapsed_ms.saturating_add(1);
        core::array::from_fn(|j| driving(self.mass * unit[j] + self.rest[j] * left, v[j], config))
    }
}

/// A torque (N·m) that moves the joint by itself, as after a contact that is gone, fades with the speed (rad/s) that it makes.
fn driving(torque: f64, v: f64, config: &Config) -> f64 {
    let slow = config.teach_payload_velocity;
    let along = if torque < 0.0 { -v } else { v };
    // All of it up to that speed and against the motion, nothing from three times as fast on.
    torque * (1.0 - smooth((along - slow) / (2.0 * slow).max(f64::MIN_POSITIVE)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Parameters;

    fn dynamics() -> Dynamics {
        Dynamics::new(&Parameters::avena().model, Config::avena().gravity)
    }

    fn fitted(missing: [f64; JOINTS], q: &[f64; JOINTS]) -> Payload {
        let mut payload = Payload::default();
        for _ in 0..1000 {
            payload.observe(&missing);
        }
        payload.fit(&dynamics(), q, &Config::avena());
        payload
    }

    #[test]
    fn j25_a_mass_at_the_flange_is_found_and_carried_to_other_poses() {
        let (q, elsewhere) = ([0.3, 0.8, -0.9, 0.4, 0.7, 0.2], [-1.0, 1.2, 0.4, -0.3, 1.0, 2.0]);
        for mass in [-1.5, 0.4, 2.0, 4.5] {
            let mut payload = fitted(dynamics().flange_torque(&q).map(|u| mass * u), &q);
            let torque = payload.torque(&dynamics(), &elsewhere, &[0.0; JOINTS], &Config::avena());
            for (t, u) in torque.iter().zip(dynamics().flange_torque(&elsewhere)) {
                assert!((t - mass * u).abs() < 1e-9, "{t} {}", mass * u);
            }
        }
    }

    #[test]
    fn j25_what_does_not_fit_fades_over_half_a_second() {
        let q = [0.3, 0.8, -0.9, 0.4, 0.7, 0.2];
        let missing = [7.0, 0.0, -3.0, 1.0, 0.0, 2.0];
        let mut payload = fitted(missing, &q);
        let first = payload.torque(&dynamics(), &q, &[0.0; JOINTS], &Config::avena());
        for (t, m) in first.iter().zip(missing) {
            assert!((t - m).abs() < 1e-6, "no step at the beginning: {t} {m}");
        }
        let mut last = first;
        for _ in 0..500 {
            let torque = payload.torque(&dynamics(), &q, &[0.0; JOINTS], &Config::avena());
            for j in 0..JOINTS {
                assert!((torque[j] - last[j]).abs() < 0.03, "{} {}", torque[j], last[j]);
            }
            last = torque;
        }
        // Nothing at the flange loads the vertical first joint.
        assert!(last[0].abs() < 1e-6, "{}", last[0]);
    }

    #[test]
    fn j25_friction_never_becomes_a_great_mass() {
        // Stretched along the vertical, a mass at the flange loads nothing; nearly so it would have to be enormous.
        let up = fitted([8.0; JOINTS], &[0.0; JOINTS]);
        assert!(up.mass.abs() < 0.2, "{}", up.mass);
        for k in 0..200 {
            let q = [0.0, 0.01 * f64::from(k), 0.0, 0.0, 0.0, 0.0];
            let mass = fitted([8.0, 8.0, -8.0, 3.0, 3.0, 3.0], &q).mass;
            assert!(mass.abs() < 2.0, "{mass} kg at {q:?}");
        }
        let heavy = fitted([0.0, 1e9, 0.0, 0.0, 0.0, 0.0], &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(heavy.mass.abs(), Config::avena().teach_payload_max);
        let nan = fitted([f64::NAN; JOINTS], &[0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(nan.mass, 0.0);
    }

    #[test]
    fn j25_next_to_nothing_is_known_at_once_and_a_load_after_a_while() {
        let config = Config::avena();
        let known_after = |missing: [f64; JOINTS]| {
            let mut payload = Payload::default();
            let observations = (0..1_000).take_while(|_| {
                let known = payload.is_known(&config);
                payload.observe(&missing);
                !known
            });
            observations.count()
        };
        let share = |share: f64| config.joints.map(|joint| share * joint.torque_max);
        assert_eq!((known_after([0.0; JOINTS]), known_after(share(-0.099))), (1, 1));
        assert_eq!((known_after(share(LITTLE)), known_after(share(-0.5))), (400, 400));
        for j in 0..JOINTS {
            let mut one = [0.0; JOINTS];
            one[j] = 0.2 * config.joints[j].torque_max;
            assert_eq!(known_after(one), 400, "joint {} is enough", j + 1);
        }
    }

    #[test]
    fn j25_what_is_missing_is_the_mean_and_then_a_slow_average() {
        let mut payload = Payload::default();
        for n in 1..=99 {
            payload.observe(&[f64::from(n); JOINTS]);
            assert!((payload.missing[3] - 0.5 * f64::from(n + 1)).abs() < 1e-9, "{n}");
        }
        let mut payload = Payload::default();
        (0..1_000).for_each(|_| payload.observe(&[2.0; JOINTS]));
        (0..100).for_each(|_| payload.observe(&[3.0; JOINTS]));
        // A time constant of 100 ms: 1 − 1/e of the step.
        assert!((payload.missing[3] - 2.632).abs() < 0.005, "{}", payload.missing[3]);
    }

    /// Toward nothing, and not beyond it.
    #[test]
    fn j60_a_mass_that_is_given_goes_from_the_fitted_one() {
        for (fitted, given, left) in [
            (2.0, 0.1, 1.9),
            (2.0, 2.5, 0.0),
            (2.0, -0.5, 2.0),
            (-1.0, -0.25, -0.75),
            (-1.0, -3.0, 0.0),
            (-1.0, 2.0, -1.0),
            (0.0, 1.0, 0.0),
            (0.0, -1.0, 0.0),
        ] {
            let mut payload = Payload { mass: fitted, ..Payload::default() };
            payload.give_way(given);
            assert_eq!(payload.mass, left, "{fitted} kg, given {given} kg");
        }
    }

    /// What was found before the arm moved does not hold where it is now.
    #[test]
    fn j25_what_was_found_is_forgotten_when_the_arm_is_not_held() {
        let (config, q) = (Config::avena(), [0.3, 0.8, -0.9, 0.4, 0.7, 0.2]);
        let mut payload = fitted([9.0; JOINTS], &q);
        payload.forget();
        assert!(!payload.is_known(&config));
        payload.fit(&dynamics(), &q, &config);
        assert_eq!(payload.torque(&dynamics(), &q, &[0.0; JOINTS], &config), [0.0; JOINTS]);
        payload.observe(&[4.0; JOINTS]);
        assert_eq!(payload.missing, [4.0; JOINTS]);
    }

    #[test]
    fn j25_a_mass_is_fitted_as_far_as_it_loads_the_joints() {
        let mut last = 0.0;
        for k in 0..150 {
            let q = [0.0, 0.01 * f64::from(k), 0.0, 0.0, 0.0, 0.0];
            let unit = dynamics().flange_torque(&q);
            let load = unit.iter().map(|u| u * u).sum::<f64>().sqrt();
            let mass = fitted(unit.map(|u| 1.5 * u), &q).mass;
            if load <= LOAD.0 {
                assert_eq!(mass, 0.0, "{load} N·m/kg");
            } else if load >= LOAD.1 {
                assert!((mass - 1.5).abs() < 1e-9, "{load} N·m/kg: {mass}");
            }
            assert!(mass >= last - 1e-9 && mass < last + 0.2, "{load} N·m/kg: {last} to {mass}");
            last = mass;
        }
        assert!((last - 1.5).abs() < 1e-9);
    }

    #[test]
    fn j25_a_torque_that_drives_a_joint_fades_with_its_speed() {
        let config = Config::avena();
        let slow = config.teach_payload_velocity;
        for torque in [8.0, -8.0] {
            let at = |times: f64| driving(torque, times * slow * f64::signum(torque), &config) / torque;
            for against in [-100.0, -3.0, -1.0, 0.0, 0.5, 1.0] {
                assert_eq!(at(against), 1.0, "{torque} N·m at {against}");
            }
            assert!((at(2.0) - 0.5).abs() < 1e-9);
            assert!(at(3.0).abs() < 1e-9 && at(5.0) == 0.0);
            assert!((10..30).all(|k| at(0.1 * f64::from(k)) > at(0.1 * f64::from(k + 1))));
        }
    }
}
