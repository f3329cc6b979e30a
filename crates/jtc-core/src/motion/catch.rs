//! Catch of a load that is missing in the arm model, when the joints are enabled (J-43).
//!
//! A load that is missing in the model begins to fall when its joint is enabled. The joint then oscillates around the position at which it
//! will be held. At the end of the first oscillation, the control law needs up to 1.7 times the torque that is missing in the model. If the
//! required torque is above the torque limit, the controller commands the torque limit. The torque limit stops every load that the drive
//! can hold. While the torque is at the limit, the set position *sags*: it moves towards the joint, in proportion to the torque above the
//! limit. The joint therefore comes to rest at the position at which the limit torque has stopped it. Without this sag of the set position,
//! the joint would be thrown upwards and fall again. Without the sag, the oscillation of a joint with little friction would never end.
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::motion::deceleration::moves;

/// Time for which a joint must be at rest, with a torque within its limit, before its load counts as caught, ms. An
/// oscillating joint is also slow at each reversal, but for a shorter time.
const CALM_MS: u16 = 100;

/// Speed below which growth of a swing is treated as noise, rad/s.
const FAST_SWING: f64 = 0.1;

/// State of the catch of a joint, in which the controller stops a falling load that the model does not contain. The
/// state also records how the joint swings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Catch {
    /// Remaining time of the catch, ms. The remaining time is 0 if the catch is over or if the joint was not enabled.
    left_ms: u16,
    /// Remaining time until the load of the joint is considered caught, ms.
    busy_ms: u16,
    /// `true` if the joint has been calm for `CALM_MS` at least once since it was enabled.
    settled: bool,
    /// Total sag of the set position, rad. The sag can grow in one direction only.
    sag: f64,
    /// Highest speed of the present half swing, with its sign, rad/s. `peak_before` is the highest speed of the half
    /// swing before it.
    peak: f64,
    peak_before: f64,
    /// `true` if the previous half swing was faster than the half swing before it.
    grew: bool,
}

bit_codec!(Catch { left_ms, busy_ms, settled, sag, peak, peak_before, grew });

impl Catch {
    /// Begins the catch of a joint that was just enabled.
    pub(crate) fn begin(config: &Config) -> Self {
        Self { left_ms: config.catch_ms_max, busy_ms: CALM_MS, ..Self::default() }
    }

    /// Returns `true` if a joint in a catch has not come to rest yet.
    pub(crate) fn busy(&self) -> bool {
        self.left_ms > 0 && self.busy_ms > 0
    }

    /// Returns `true` if the joint has come to rest, within its torque limit, at any time since it was enabled.
    pub(crate) fn settled(&self) -> bool {
        self.settled
    }

    /// Executes one tick of the catch with the measured velocity of the joint (rad/s). Returns `true` while the catch continues. If the
    /// swing of the joint grows, its control loop is unstable, so the catch ends.
    pub(crate) fn step(&mut self, velocity: f64) -> bool {
        if self.settled && self.left_ms == 0 {
            return false;
        }
        self.left_ms = self.left_ms.saturating_sub(1);
        if moves(velocity) {
            self.busy_ms = CALM_MS;
            self.swing(velocity);
        } else {
            // Noise of a joint at rest is not recorded as a half swing. If it were, a joint that begins to fall after
            // the noise would look like a growing swing.
            self.busy_ms = self.busy_ms.saturating_sub(1);
            self.settled |= self.busy_ms == 0;
        }
        if self.swing_grows() {
            self.left_ms = 0;
        }
        self.left_ms > 0
    }

    /// Updates the peak speeds of the swing in one tick.
    fn swing(&mut self, velocity: f64) {
        if velocity * self.peak < 0.0 {
            let peak = self.peak.abs();
            self.grew = self.peak_before > 0.0 && peak > self.peak_before;
            (self.peak_before, self.peak) = (peak, velocity);
        } else if velocity.abs() > self.peak.abs() {
            self.peak = velocity;
        }
    }

    /// Clears the record of earlier swings.
    pub(crate) fn watch_anew(&mut self) {
        (self.peak, self.peak_before, self.grew) = (0.0, 0.0, false);
    }

    /// Executes one tick for a joint that has settled. Returns `true` if the joint has made three half swings, each faster than the half
    /// swing before it.
    pub(crate) fn watch(&mut self, velocity: f64) -> bool {
        if !self.settled || self.left_ms > 0 {
            return false;
        }
        if moves(velocity) {
            self.swing(velocity);
        }
        self.grew && self.peak.abs() > self.peak_before.max(FAST_SWING)
    }

    /// Ends the catch, because another function of the controller has stopped the joint.
    pub(crate) fn calm_down(&mut self) {
        *self = Self { settled: true, ..Self::default() };
    }

    /// Returns `true` if a joint that has not settled yet oscillates with a growing amplitude, because its control loop is unstable.
    pub(crate) fn swing_grows(&self) -> bool {
        !self.settled && self.peak_before > 0.0 && self.peak.abs() > self.peak_before.max(FAST_SWING)
    }

    /// Returns the change of the set position, rad. `excess` is the computed torque above the limit (N·m), and
    /// `error` is the position error (rad).
    ///
    /// The catch ends if the sag would exceed the position error limit. The catch also ends if the sag would change its
    /// direction, because the joint then swings between both torque limits.
    pub(crate) fn sag(&mut self, excess: f64, kp: f64, error: f64, limits: &JointConfig) -> f64 {
        // The set position moves at most to the measured position of the joint.
        let wanted = excess / kp;
        let step = if error > 0.0 { -wanted.max(0.0).min(error) } else { -wanted.min(0.0).max(error) };
        let sag = self.sag + step;
        let good = step * self.sag >= 0.0 && sag.abs() <= limits.position_error_max;
        if !good {
            // The catch ends, although the joint has not come to rest.
            (self.left_ms, self.busy_ms) = (0, CALM_MS);
            return 0.0;
        }
        (self.sag, self.busy_ms) = (sag, CALM_MS);
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KP: f64 = 1_000.0;

    fn limits() -> JointConfig {
        Config::avena().joints[0]
    }

    fn begun() -> Catch {
        Catch::begin(&Config::avena())
    }

    #[test]
    fn j43_the_set_position_sags_by_the_excess_and_never_beyond_the_joint() {
        for sign in [1.0, -1.0] {
            let mut catch = begun();
            assert_eq!(catch.sag(sign * 10.0, KP, sign * 0.05, &limits()), -sign * 0.01);
            assert_eq!(catch.sag(sign * 10.0, KP, sign * 0.002, &limits()), -sign * 0.002);
            // The first case has a torque above the limit that comes only from the derivative, so the set position
            // does not sag. The second case has a position gain of zero, so the set position sags to the measured
            // position.
            assert_eq!(catch.sag(sign * 10.0, KP, -sign * 0.05, &limits()), 0.0);
            assert_eq!(catch.sag(sign * 10.0, 0.0, sign * 0.003, &limits()), -sign * 0.003);
            assert!(catch.step(0.0), "it goes on");
        }
    }

    #[test]
    fn j43_a_catch_ends_at_the_limit_of_the_position_error_and_when_the_load_turns() {
        let mut catch = begun();
        let steps = (0..200).take_while(|_| catch.sag(1.0, KP, 0.05, &limits()) != 0.0).count();
        assert!((89..=90).contains(&steps), "{steps} mrad");
        assert!(!catch.step(0.0) && !catch.busy());
        let mut catch = begun();
        catch.sag(1.0, KP, 0.05, &limits());
        assert_eq!(catch.sag(-1.0, KP, -0.05, &limits()), 0.0);
        assert!(!catch.step(0.0));
    }

    #[test]
    fn j43_a_catch_takes_a_second_at_most() {
        let mut catch = begun();
        assert_eq!((0..2_000).take_while(|_| catch.step(1.0)).count(), 999);
        assert!(!Catch::default().step(0.0), "a joint that was not enabled");
    }

    #[test]
    fn j34_a_joint_is_busy_until_it_has_been_calm_for_a_while() {
        let mut catch = begun();
        for k in 0..400 {
            catch.step(if k == 50 { -0.1 } else { 0.0 });
            if k == 200 {
                catch.sag(1.0, KP, 0.05, &limits());
            }
            assert_eq!(catch.busy(), k < 150 || (200..300).contains(&k), "{k}");
        }
    }

    /// Returns `true` if the catch continues after these velocities (rad/s), one velocity per tick.
    fn goes_on(velocities: &[f64]) -> bool {
        let mut catch = begun();
        velocities.iter().all(|&velocity| catch.step(velocity))
    }

    #[test]
    fn j43_a_swing_that_grows_from_half_to_half_is_no_load_that_comes_to_rest() {
        assert!(goes_on(&[0.1, 0.2, 0.1, -0.15, -0.18, -0.05, 0.15, 0.1, -0.14]), "it fades");
        assert!(goes_on(&[0.2, -0.2, 0.2]), "it does not grow");
        assert!(!goes_on(&[0.2, -0.15, 0.16]) && !goes_on(&[-0.2, 0.15, 0.21]));
        assert!(goes_on(&[0.03, -0.05, 0.1]), "too slow to count");
        assert!(!goes_on(&[0.03, -0.05, 0.101]));
    }

    /// A load begins to fall after noise in the opposite direction. The noise is not half a swing, so the catch
    /// continues.
    #[test]
    fn j43_noise_around_standstill_is_no_half_of_a_swing() {
        for noise in [0.001, 0.01, 0.02] {
            assert!(goes_on(&[noise, -0.15]) && goes_on(&[-noise, 0.15]), "{noise} before a fall");
            assert!(goes_on(&[0.2, -noise, 0.15, -noise, 0.19]), "{noise} within a half");
        }
    }

    /// During a trial of gains, a settled joint oscillates without an external cause only if its control loop is unstable.
    #[test]
    fn j71_a_swing_that_grows_over_three_halves_is_seen_of_a_joint_that_has_settled() {
        let seen = |peaks: &[f64]| {
            let mut catch = begun();
            for _ in 0..1_000 {
                catch.step(0.0);
            }
            catch.watch_anew();
            let halves = peaks.iter().flat_map(|peak| [0.5, 1.0, 0.5, 0.0].map(|share| share * peak));
            halves.into_iter().any(|velocity| catch.watch(velocity))
        };
        assert!(seen(&[0.05, -0.08, 0.11]) && seen(&[-0.2, 0.21, -0.22]) && seen(&[0.3, -0.1, 0.12, -0.13]));
        assert!(!seen(&[0.2, -0.3]), "two halves may be a push and its answer");
        assert!(!seen(&[0.03, -0.05, 0.09]) && !seen(&[0.3, -0.31, 0.2, -0.25]) && !seen(&[0.1, 0.2, 0.3]));
    }

    /// Returns a catch whose joint has settled and whose time is over.
    fn over() -> Catch {
        let mut catch = begun();
        (0..1_000).for_each(|_| {
            catch.step(0.0);
        });
        catch
    }

    /// Returns `true` if `watch` reports a growing swing at any of these velocities (rad/s), one velocity per tick.
    fn grows(catch: &mut Catch, velocities: &[f64]) -> bool {
        velocities.iter().any(|&velocity| catch.watch(velocity))
    }

    /// Each of the three half swings is faster than the half swing before it, and the third is faster than 0.1 rad/s. A half swing with
    /// the same speed does not grow. Noise of 0.01 rad/s is not half a swing.
    #[test]
    fn j71_a_swing_with_two_halves_alike_does_not_grow() {
        for sign in [1.0, -1.0] {
            for (peaks, expected) in [
                ([0.125, -0.25, 0.5], true),
                ([0.25, -0.25, 0.5], false),
                ([0.125, -0.25, 0.25], false),
                ([0.03, -0.05, 0.1], false),
                ([0.03, -0.05, 0.11], true),
                ([0.01, -0.2, 0.3], false),
            ] {
                assert_eq!(grows(&mut over(), &peaks.map(|peak| sign * peak)), expected, "{peaks:?}");
            }
        }
    }

    /// When a trial of gains begins, the record of earlier half swings is cleared. A growing swing needs three new
    /// half swings.
    #[test]
    fn j71_a_swing_before_the_trial_does_not_count() {
        let mut catch = over();
        assert!(!grows(&mut catch, &[0.2, -0.3]));
        catch.watch_anew();
        assert!(!grows(&mut catch, &[0.4, -0.5]), "two halves since the trial began");
        assert!(grows(&mut catch, &[0.6]));
        // The record is also cleared if a growing swing was already reported.
        let mut catch = over();
        assert!(grows(&mut catch, &[0.2, -0.3, 0.4]));
        catch.watch_anew();
        assert!(!grows(&mut catch, &[0.4]));
    }

    /// After a catch is over, calls of `step` do not record the swing of the joint.
    #[test]
    fn j71_a_catch_that_is_over_does_not_record_a_swing() {
        let mut catch = over();
        for velocity in [0.2, -0.3] {
            assert!(!catch.step(velocity));
        }
        assert!(!grows(&mut catch, &[0.4, -0.5]));
        let mut calmed = begun();
        calmed.calm_down();
        for velocity in [0.2, -0.3] {
            assert!(!calmed.step(velocity));
        }
        assert!(calmed.settled() && !grows(&mut calmed, &[0.4]));
    }

    /// `watch` reports a growing swing only if the joint has settled and its catch is over.
    #[test]
    fn j71_a_swing_is_watched_only_after_the_catch_and_after_the_joint_has_settled() {
        let peaks = [0.2, -0.3, 0.4, -0.5];
        assert!(grows(&mut over(), &peaks));
        let mut settled = begun();
        (0..CALM_MS).for_each(|_| {
            settled.step(0.0);
        });
        assert!(settled.settled() && !grows(&mut settled, &peaks), "the catch continues");
        let mut moves = begun();
        (0..1_000).for_each(|_| {
            moves.step(0.1);
        });
        assert!(!moves.settled() && !grows(&mut moves, &peaks), "the joint has not settled");
        assert!(!grows(&mut begun(), &peaks), "the joint has not settled, and the catch continues");
    }

    /// A joint that moves for the whole second of its catch settles as soon as it has been at rest for 100 ms.
    #[test]
    fn j66_a_joint_may_settle_after_its_catch() {
        let mut catch = begun();
        (0..1_000).for_each(|_| {
            catch.step(0.5);
        });
        for ms in 1..=100 {
            assert!(!catch.settled(), "{ms}");
            assert!(!catch.step(0.0));
        }
        assert!(catch.settled());
    }

    /// A joint that has settled swings with a growing amplitude because of a push. This does not end its catch.
    #[test]
    fn j43_a_growing_swing_ends_only_the_catch_of_a_joint_that_has_not_settled() {
        let mut catch = begun();
        assert!((0..100).all(|_| catch.step(0.0)));
        assert!([0.2, -0.3, 0.4].iter().all(|&velocity| catch.step(velocity)));
        assert!(!catch.swing_grows());
    }

    #[test]
    fn j34_a_joint_that_keeps_moving_is_not_busy_for_longer_than_a_catch_takes() {
        let mut catch = begun();
        for ms in 1..=1_000 {
            catch.step(0.5);
            assert_eq!(catch.busy(), ms < 1_000, "{ms}");
        }
        let mut stands = begun();
        (0..100).for_each(|_| assert!(stands.step(0.02)));
        assert!(!stands.busy(), "what counts as standing is calm");
    }

    #[test]
    fn j43_the_set_position_may_sag_by_the_whole_position_error() {
        let (mut catch, most) = (begun(), limits().position_error_max);
        assert_eq!(catch.sag(most * KP, KP, 1.0, &limits()), -most);
        assert!(catch.step(0.0));
    }
}
