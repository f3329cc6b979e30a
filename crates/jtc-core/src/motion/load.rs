//! Unmodelled load: a load that a joint must hold and that the model does not contain. The controller learns this load from the integral of
//! the position controller.
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::config::limits::JointConfig;

/// Number of ticks between two observations of the load of the same joint. Each tick observes a single joint.
const PERIOD: f64 = crate::JOINTS as f64;
/// Time constant of the low-pass filter of the load, s.
const TIME_S: f64 = 1.0;
/// Highest load of a joint, as a share of the torque limit.
const HIGHEST: f64 = 0.3;
/// Largest difference between the torque of the integral and the learned load, as a share of the torque limit, at
/// which the controller adapts the learned load. A larger difference may come from a contact, so the learned load
/// does not change.
const APART: f64 = 0.1;
/// Largest change of the integral torque of a joint that is held steadily, as a share of the torque limit.
const STEADY: f64 = 0.03;
/// Time, s. After a joint was held steadily for this time, the controller takes the torque of the integral as the
/// load.
const STEADY_S: f64 = 10.0;

/// Learned load of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Load {
    /// Torque of the load, N·m. The torque has single precision, because the flight recorder stores it.
    torque: f32,
    /// `true` if the joint has settled since it was enabled, or since its load was cleared.
    known: bool,
    /// Torque of the integral when steady holding began, N·m. `observations` is the number of observations since
    /// then.
    steady: f32,
    observations: u16,
}

bit_codec!(Load { torque, known, steady, observations });

impl Load {
    /// Clears the load, so that the controller must learn the load again.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Returns the torque of the load, N·m. Before the load is known, returns the torque of the `integral` (N·m).
    pub(crate) fn torque(&self, integral: f64) -> f64 {
        if self.known { self.torque.into() } else { integral }
    }

    /// Returns the torque of the load, N·m. Returns zero before the load is known.
    pub(crate) fn known_torque(&self) -> f64 {
        self.torque.into()
    }

    /// Limits a torque (N·m) to the highest load that the controller accepts without having observed it. Returns the
    /// limited torque.
    pub(crate) fn bounded(torque: f64, limits: &JointConfig) -> f64 {
        let highest = HIGHEST * limits.torque_max;
        torque.max(-highest).min(highest)
    }

    /// Returns `true` if the load is known.
    pub(crate) fn is_known(&self) -> bool {
        self.known
    }

    /// Sets the load to the torque (N·m) that the controller has learned while the joint lowered the load.
    pub(crate) fn set(&mut self, torque: f64) {
        *self = Self { torque: torque as f32, known: true, ..Self::default() };
    }

    /// Observes the torque of the `integral` (N·m) of a joint. `settled` is `true` if the joint has settled since it was enabled. Call this
    /// function once in [`PERIOD`] ticks for each joint.
    pub(crate) fn observe(&mut self, integral: f64, settled: bool, limits: &JointConfig) {
        if !settled {
            self.forget();
            return;
        }
        let (limit, torque) = (limits.torque_max, f64::from(self.torque));
        let highest = (HIGHEST * limit).max(torque.abs());
        let bounded = |torque: f64| torque.max(-highest).min(highest) as f32;
        if (integral - f64::from(self.steady)).abs() > STEADY * limit {
            (self.steady, self.observations) = (integral as f32, 0);
        }
        self.observations = self.observations.saturating_add(1);
        let steady = f64::from(self.observations) * PERIOD * DT >= STEADY_S;
        if !self.known || steady {
            (self.torque, self.known) = (bounded(integral), true);
        } else if (integral - torque).abs() <= APART * limit {
            self.torque = bounded(torque + (integral - torque) * (PERIOD * DT / TIME_S));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Config;

    /// Returns the limits of a joint with a torque limit of 180 N·m.
    fn limits() -> JointConfig {
        Config::avena().joints[1]
    }

    fn observe(load: &mut Load, integral: f64, seconds: f64) {
        for _ in 0..(seconds / (PERIOD * DT)).round() as usize {
            load.observe(integral, true, &limits());
        }
    }

    #[test]
    fn j66_the_load_is_found_when_the_joint_first_settles_and_is_bounded() {
        for (integral, found) in [(20.0, 20.0), (-40.0, -40.0), (90.0, 54.0), (-90.0, -54.0)] {
            let mut load = Load::default();
            load.observe(integral, false, &limits());
            assert_eq!((load.torque(7.0), load.known_torque()), (7.0, 0.0), "what the integral has");
            load.observe(integral, true, &limits());
            assert_eq!((load.torque(7.0), load.known_torque()), (found, found));
            load.forget();
            assert_eq!((load.torque(7.0), load.known_torque()), (7.0, 0.0));
        }
    }

    #[test]
    fn j66_the_load_follows_the_integral_within_a_second_and_no_contact() {
        let mut load = Load::default();
        observe(&mut load, 10.0, 0.1);
        // If integral and load differ by at most a tenth of the torque limit, 63 % of this difference is added to the
        // load within a second.
        observe(&mut load, 20.0, 1.0);
        assert!((load.torque(0.0) - 16.3).abs() < 0.1, "{}", load.torque(0.0));
        observe(&mut load, 16.3, 5.0);
        let known = load.torque(0.0);
        // A larger difference between integral and load counts as a contact, so the load does not change. After the
        // integral has been steady for ten seconds, it is taken as the load.
        observe(&mut load, 40.0, 9.9);
        assert_eq!(load.torque(0.0), known);
        observe(&mut load, 40.0, 0.2);
        assert_eq!(load.torque(0.0), 40.0);
    }

    #[test]
    fn j66_a_load_that_changes_all_the_time_is_not_taken_anew() {
        let mut load = Load::default();
        observe(&mut load, 0.0, 0.1);
        for k in 0..20 {
            observe(&mut load, if k % 2 == 0 { 40.0 } else { 50.0 }, 5.0);
        }
        assert_eq!(load.torque(0.0), 0.0);
    }

    /// If a load was learned while a joint lowered it, it can be above the bound for other loads. Later observations
    /// do not reduce it to this bound.
    #[test]
    fn j70_a_load_that_was_lowered_is_kept() {
        let mut load = Load::default();
        load.set(80.0);
        observe(&mut load, 80.0, 3.0);
        assert_eq!(load.torque(0.0), 80.0);
    }

    /// Returns the limits of a joint with a torque limit of 100 N·m.
    fn round_limits() -> JointConfig {
        JointConfig { torque_max: 100.0, ..limits() }
    }

    /// The bound is 30 % of the torque limit: 54 N·m of 180 N·m, and 30 N·m of 100 N·m.
    #[test]
    fn j70_a_load_without_observation_is_bounded_to_30_percent_of_the_limit() {
        for sign in [1.0, -1.0] {
            for (torque, of_180, of_100) in
                [(0.0, 0.0, 0.0), (20.0, 20.0, 20.0), (40.0, 40.0, 30.0), (90.0, 54.0, 30.0)]
            {
                assert_eq!(Load::bounded(sign * torque, &limits()), sign * of_180);
                assert_eq!(Load::bounded(sign * torque, &round_limits()), sign * of_100);
            }
        }
    }

    /// The limit is 100 N·m, so a difference of 10 N·m is not a contact. An observation in 6 ms changes the load by 10
    /// N·m · 6 ms / 1 s = 0.06 N·m.
    #[test]
    fn j66_a_difference_of_exactly_ten_percent_of_the_limit_is_not_a_contact() {
        for sign in [1.0, -1.0] {
            for (integral, expected) in [(10.0, 0.06), (10.5, 0.0)] {
                let mut load = Load::default();
                load.set(0.0);
                load.observe(sign * integral, true, &round_limits());
                let torque = load.known_torque();
                assert!((torque - sign * expected).abs() < 1e-6, "{integral} N·m: {torque} N·m");
            }
        }
    }

    /// The integral alternates between 0 and 3 N·m, exactly 3 % of the limit of 100 N·m. The 1,667th observation is the first one after ten
    /// seconds: 1,666 · 6 ms = 9.996 s, and 1,667 · 6 ms = 10.002 s. This observation sets the load to the integral.
    #[test]
    fn j66_an_integral_within_exactly_three_percent_of_the_limit_is_steady() {
        let mut load = Load::default();
        for k in 1..1_667 {
            load.observe(if k % 2 == 0 { 3.0 } else { 0.0 }, true, &round_limits());
            assert!(load.known_torque() < 2.0, "the mean is 1.5 N·m: {}", load.known_torque());
        }
        load.observe(3.0, true, &round_limits());
        assert_eq!(load.known_torque(), 3.0);
        // The integral changes by more than 3 % of the torque limit, so it is not steady and the load does not
        // change.
        let mut load = Load::default();
        for k in 1..=1_667 {
            load.observe(if k % 2 == 0 { 0.0 } else { 3.5 }, true, &round_limits());
        }
        assert!(load.known_torque() < 2.5, "the mean is 1.75 N·m: {}", load.known_torque());
    }
}
