//! PID controller of one joint (J-41).
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::parameters::PidGains;

/// Number of ticks over which the derivative is computed.
const WINDOW: usize = 5;
/// Inverse of the length of the derivative window, 1/s.
const RATE: f64 = 1.0 / (WINDOW as f64 * DT);

/// Position error, in encoder steps, above which the integral of a joint at rest changes again. A joint that slips
/// moves less than this distance.
const RELEASE_STEPS: f64 = 4.0;
/// Rounding error of the positions on the bus, in encoder steps.
const ROUNDING: f64 = 0.01;

/// State of the PID controller.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pid {
    /// Integral of the position error, rad·s.
    integral: f64,
    /// Last position errors, rad, oldest first.
    errors: [f64; WINDOW],
    /// `true` if the joint is at rest and close to its commanded position, so that the integral does not change.
    settled: bool,
}

/// Parts of the torque of the PID controller, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PidTorque {
    /// Torque of the position error, Kp·e.
    pub p: f64,
    /// Torque of the integral, Ki·∫e.
    pub i: f64,
    /// Torque of the derivative, Kd·ė.
    pub d: f64,
}

bit_codec!(Pid { integral, errors, settled });
bit_codec!(PidTorque { p, i, d });

impl PidTorque {
    /// Returns the sum of the three parts, N·m.
    pub(crate) fn sum(&self) -> f64 {
        self.p + self.i + self.d
    }
}

impl Pid {
    /// Resets the state of the PID controller. The function assumes that `error` (rad) was constant until now, so the derivative starts at
    /// 0.
    pub(crate) fn reset(&mut self, error: f64) {
        *self = Self { integral: 0.0, errors: [error; WINDOW], settled: false };
    }

    /// Resets the state like [`reset`](Self::reset) with an error of 0, and sets the integral so that it produces
    /// `torque` (N·m). The torque of the joint then continues without a step. With an integral gain of zero, or at
    /// the integral bounds, the integral produces less torque.
    pub(crate) fn take_over(&mut self, gains: &PidGains, torque: f64) {
        self.reset(0.0);
        self.keep(gains, torque);
    }

    /// Sets the integral to a `torque` (N·m), as far as these gains allow this torque.
    pub(crate) fn keep(&mut self, gains: &PidGains, torque: f64) {
        let integral = torque / gains.ki;
        self.integral =
            if integral.is_finite() { integral.max(gains.int_min).min(gains.int_max) } else { 0.0 };
    }

    /// Shifts the commanded position by `way` (rad) without an effect on the derivative.
    pub(crate) fn shift(&mut self, way: f64) {
        self.errors = self.errors.map(|error| error + way);
    }

    /// Executes one tick with the position error (rad). `saturated` is `true` if the torque is at its limit, so that the integral does not
    /// change. `encoder_step` (rad) is the resolution of the encoder if the joint is commanded to be at rest. In motion, `encoder_step` is
    /// `None`.
    ///
    /// At rest, the integral stops changing when the error is within one encoder step. The integral changes again when the error exceeds
    /// [`RELEASE_STEPS`]. If the integral changed below the encoder resolution, a joint with stiction would break away again and again
    /// (hunting). Hunting would also occur if the integral restarted at each change of the last bit of the encoder.
    pub(crate) fn step(
        &mut self,
        gains: &PidGains,
        error: f64,
        saturated: bool,
        encoder_step: Option<f64>,
    ) -> PidTorque {
        let settled_within = if self.settled { RELEASE_STEPS } else { 1.0 } + ROUNDING;
        self.settled = encoder_step.is_some_and(|step| error.abs() <= settled_within * step);
        let grown = self.integral + error * DT;
        let integral = if saturated || self.settled { self.integral } else { grown };
        // The bounds are applied even while the integral does not change, because new gains can have narrower bounds.
        self.integral = integral.max(gains.int_min).min(gains.int_max);
        let [oldest, a, b, c, d] = self.errors;
        self.errors = [a, b, c, d, error];
        let rate = (error - oldest) * RATE;
        PidTorque { p: gains.kp * error, i: gains.ki * self.integral, d: gains.kd * rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GAINS: PidGains = PidGains { kp: 100.0, ki: 10.0, kd: 5.0, int_min: -0.002, int_max: 0.003 };

    #[test]
    fn j41_no_kick_after_reset() {
        let mut pid = Pid::default();
        pid.reset(0.05);
        for _ in 0..20 {
            assert_eq!(pid.step(&GAINS, 0.05, false, None).d, 0.0);
        }
    }

    #[test]
    fn j41_derivative_is_the_slope_over_five_ticks() {
        let mut pid = Pid::default();
        pid.reset(0.0);
        let slope = 0.3;
        let mut d = 0.0;
        // The test executes more ticks than the window contains, because errors older than five ticks must have no effect.
        for k in 1..=12 {
            d = pid.step(&GAINS, slope * f64::from(k) * DT, false, None).d;
        }
        assert!((d - GAINS.kd * slope).abs() < 1e-12);
        // A step of the error affects the derivative for five ticks. In each of these ticks, the torque is at most
        // Kd·step/(5 ms).
        pid.reset(0.0);
        let first = pid.step(&GAINS, 0.01, false, None).d;
        assert!((first - GAINS.kd * 0.01 / 0.005).abs() < 1e-12);
    }

    #[test]
    fn j41_integral_is_held_while_saturated() {
        let mut pid = Pid::default();
        pid.reset(0.0);
        let before = pid.step(&GAINS, 0.01, false, None).i;
        for _ in 0..100 {
            assert_eq!(pid.step(&GAINS, 0.01, true, None).i, before);
        }
    }

    #[test]
    fn j41_at_rest_the_integral_is_held_within_one_encoder_step_until_four() {
        const STEP: f64 = 1e-4;
        let mut pid = Pid::default();
        pid.reset(0.0);
        let run = |pid: &mut Pid, steps: f64, at_rest: bool| {
            let before = pid.integral;
            for _ in 0..10 {
                pid.step(&GAINS, steps * STEP, false, at_rest.then_some(STEP));
            }
            pid.integral - before
        };
        // In motion, every error changes the integral. At rest, an error within one encoder step does not change it.
        // After the joint has settled, errors up to four steps do not change it either.
        assert!(run(&mut pid, 0.5, false) > 0.0);
        assert!(run(&mut pid, 2.0, true) > 0.0);
        assert_eq!(run(&mut pid, 1.0, true), 0.0);
        for toggled in [2.0, 0.0, -1.0, 2.0, -2.0, 4.0, 1.0] {
            assert_eq!(run(&mut pid, toggled, true), 0.0, "{toggled}");
        }
        assert!(run(&mut pid, 5.0, true) > 0.0);
        assert!(run(&mut pid, 2.0, true) > 0.0, "until it is within one step again");
        assert_eq!(run(&mut pid, -1.0, true), 0.0);
        assert!(run(&mut pid, -1.0, false) < 0.0);
    }

    proptest! {
        #[test]
        fn j41_integral_stays_in_its_bounds(errors in prop::collection::vec(-1.0..1.0f64, 1..200)) {
            let mut pid = Pid::default();
            pid.reset(0.0);
            for e in errors {
                let i = pid.step(&GAINS, e, false, None).i / GAINS.ki;
                prop_assert!((GAINS.int_min..=GAINS.int_max).contains(&i));
            }
        }
    }

    #[test]
    fn j25_the_integral_takes_over_a_torque_as_far_as_it_can() {
        let taken = |gains: PidGains, torque: f64| {
            let mut pid = Pid::default();
            pid.reset(0.3);
            pid.take_over(&gains, torque);
            let torque = pid.step(&gains, 0.0, true, None);
            assert_eq!((torque.p, torque.d), (0.0, 0.0));
            torque.i
        };
        let wide = PidGains { int_min: -9.0, int_max: 9.0, ..GAINS };
        assert_eq!((taken(wide, 24.0), taken(wide, -24.0)), (24.0, -24.0));
        assert_eq!((taken(GAINS, 24.0), taken(GAINS, -24.0)), (10.0 * 0.003, 10.0 * -0.002));
        let none = PidGains { ki: 0.0, ..wide };
        assert_eq!((taken(none, 24.0), taken(none, 0.0)), (0.0, 0.0));
        // A transfer to gains without an integral clears the integral. If gains with an integral follow, the integral
        // still holds no torque.
        for torque in [24.0, -24.0, 0.0] {
            let mut pid = Pid::default();
            pid.take_over(&none, torque);
            assert_eq!(pid.step(&wide, 0.0, true, None).i, 0.0, "{torque}");
        }
    }

    /// After a change of the gains, the integral holds the same torque, as far as the integral bounds allow this. The change of the gains
    /// does not affect the derivative.
    #[test]
    fn j71_the_integral_keeps_its_torque_under_other_gains() {
        let mut pid = Pid::default();
        pid.reset(0.0);
        let before = (0..200).map(|k| pid.step(&GAINS, 1e-5 * f64::from(k), false, None)).last().unwrap();
        for (ki, kept) in [(2.0, 1.0), (50.0, 1.0), (0.5, 0.5 * 0.003 / before.i), (0.0, 0.0)] {
            let (mut pid, gains) = (pid, PidGains { ki, kp: 300.0, ..GAINS });
            pid.keep(&gains, before.i);
            let after = pid.step(&gains, 199e-5, true, None);
            assert!((after.i - kept * before.i).abs() < 1e-12, "{ki}: {} N·m, then {}", before.i, after.i);
            assert!((after.d - 0.8 * before.d).abs() < 1e-9, "{ki}: four of five ticks of the same motion");
        }
    }

    #[test]
    fn j43_a_commanded_position_that_is_moved_is_no_motion() {
        let mut pid = Pid::default();
        pid.reset(0.05);
        pid.shift(-0.02);
        for _ in 0..10 {
            assert_eq!(pid.step(&GAINS, 0.05 - 0.02, false, None).d, 0.0);
        }
    }

    #[test]
    fn j41_the_torque_is_the_sum_of_the_three_parts() {
        assert_eq!(PidTorque { p: 1.0, i: 2.0, d: 4.0 }.sum(), 7.0);
    }

    /// A position error of one encoder step still counts as one step if the bus has rounded the position by a hundredth of a step.
    #[test]
    fn j41_a_step_is_a_step_after_rounding() {
        const STEP: f64 = 1e-4;
        for sign in [1.0, -1.0] {
            let mut pid = Pid::default();
            pid.reset(0.0);
            let mut held = |steps: f64| {
                let before = pid.integral;
                pid.step(&GAINS, sign * steps * STEP, false, Some(STEP));
                pid.integral == before
            };
            assert!(!held(1.02) && held(1.0 + ROUNDING), "settles");
            assert!(held(4.0 + ROUNDING) && !held(4.02), "goes on");
        }
    }
}
