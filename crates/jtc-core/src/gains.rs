//! Check that the gains match the inertia of the joints (J-71), and trial of new gains.
//!
//! The torques of the derivative and of the position error take effect with a delay, so a joint with too little
//! inertia for its gains oscillates. The controller computes the smallest effective inertia of each joint in a fixed
//! set of poses, one pose per tick, and compares it with the inertia that the gains require.
use core::f64::consts::TAU;

use jtc_dynamics::{ArmModel, Dynamics, JointVec};
use jtc_wire::StopKind;

use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::smooth;
use crate::parameters::PidGains;
use crate::{DT, JOINTS};

/// Number of poses in which the inertia of the joints is computed.
pub(crate) const POSES: usize = 17;
/// Delay of the derivative torque in addition to [`Config::delay_ticks`], ticks. This delay is half of the window over
/// which the derivative is computed, plus half of a tick, because a torque is constant for one tick.
const DERIVATIVE_AGE: f64 = 3.0;
/// Additional delay of the torque of the position error, ticks, on top of [`Config::delay_ticks`].
const POSITION_AGE: f64 = 0.5;
/// Factors in the formula for the required inertia. `PER_KD` multiplies Kd and the delay of its torque. `PER_KP`
/// multiplies Kp and both delays. With these factors, the required inertia is 1.1 to 1.7 times the smallest inertia
/// at which a joint is stable. This applies if Kp is at most half of the highest Kp that Kd can damp.
const PER_KD: f64 = 0.75;
const PER_KP: f64 = 2.0;
/// Largest permitted sag of a joint under new gains, as a share of the position error limit. A joint sags if its new
/// gains allow less integral torque than its old gains.
const SAG: f64 = 0.25;
/// Least torque that the position gain must produce at the position error limit, as a share of the torque limit.
const STIFF: f64 = 0.03;
/// Time over which new gains are blended in, and duration of the trial of new gains, ms.
const BLEND_MS: u16 = 500;
const TRIAL_MS: u16 = 2_000;
/// Time after a change of gains, ms. If a control loop becomes unstable within this time, the controller assumes that
/// the new gains are the cause.
const BLAMED_MS: u16 = 10_000;
/// Reduction factor for the gains of a joint with an unstable control loop. If the loop is unstable again within
/// `AGAIN_MS` (ms) after this reduction, the controller raises an error.
const SOFTER: f64 = 0.3;
const AGAIN_MS: u16 = 500;

/// Position of each joint, as a share of its range, in all poses except pose 0. The poses fill the ranges evenly
/// (Halton 1960).
const SHARES: [[f32; JOINTS]; POSES - 1] = shares();

const fn shares() -> [[f32; JOINTS]; POSES - 1] {
    const PRIMES: [usize; JOINTS] = [2, 3, 5, 7, 11, 13];
    let mut shares = [[0.0; JOINTS]; POSES - 1];
    let mut n = 0;
    while n < POSES - 1 {
        let mut j = 0;
        while j < JOINTS {
            let (mut rest, mut unit) = (n + 1, 1.0);
            while rest > 0 {
                unit /= PRIMES[j] as f32;
                shares[n][j] += unit * (rest % PRIMES[j]) as f32;
                rest /= PRIMES[j];
            }
            j += 1;
        }
        n += 1;
    }
    shares
}

/// Returns the pose `number`, within the position limits of the joints. Pose 0 is the zero pose.
fn pose(number: usize, config: &Config) -> JointVec {
    let shares = number.checked_sub(1).and_then(|n| SHARES.get(n));
    core::array::from_fn(|j| {
        let (low, high) = config.position_range(j);
        let (low, high) = (low.max(-TAU), high.min(TAU));
        match shares.and_then(|shares| shares.get(j)) {
            Some(share) => low + f64::from(*share) * (high - low),
            None => 0.0f64.max(low).min(high),
        }
    })
}

/// Smallest effective inertia of each joint, kg·m², in the poses that were computed so far. In each pose, the other joints are free.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeltInertia {
    joints: [f64; JOINTS],
}

bit_codec!(FeltInertia { joints });

impl FeltInertia {
    /// Initial value, before the inertia was computed in any pose.
    pub(crate) const NONE: Self = Self { joints: [f64::INFINITY; JOINTS] };

    /// Computes the effective inertias in the pose `number`, for an arm without a payload.
    #[inline(never)]
    pub(crate) fn look(&mut self, number: usize, model: &ArmModel, config: &Config) {
        let rotor = config.joints.each_ref().map(JointConfig::counted_rotor);
        let felt = Dynamics::new(model, [0.0; 3]).felt_inertia(&pose(number, config), &rotor);
        for (least, felt) in self.joints.iter_mut().zip(felt) {
            *least = least.min(felt);
        }
    }

    /// Returns `true` if all poses of an arm have been computed.
    pub(crate) fn is_known(&self) -> bool {
        self.joints.iter().all(|felt| felt.is_finite())
    }

    /// Returns `true` if the inertia of every joint is sufficient for its gains.
    pub(crate) fn bears(&self, gains: &[PidGains; JOINTS], config: &Config) -> bool {
        // The comparison also rejects NaN.
        gains.iter().zip(&self.joints).all(|(gains, felt)| *felt >= inertia_needed(gains, config.delay_ticks))
    }
}

/// Returns the smallest effective inertia (kg·m²) of each joint of an arm without a payload, while the other joints
/// are free. The function uses the same poses as a controller with these settings (J-71): the zero pose and sixteen
/// poses within the position limits. For a drive without a configured rotor inertia, 0.7 kg·m² is used.
pub fn least_felt_inertia(model: &ArmModel, config: &Config) -> [f64; JOINTS] {
    let mut felt = FeltInertia::NONE;
    (0..POSES).for_each(|number| felt.look(number, model, config));
    felt.joints
}

/// Returns the smallest effective inertia (kg·m²) at which a controller accepts these gains for a joint (J-71).
pub fn inertia_needed(gains: &PidGains, delay_ticks: u8) -> f64 {
    let derivative = DT * (f64::from(delay_ticks) + DERIVATIVE_AGE);
    derivative * (PER_KD * gains.kd + PER_KP * gains.kp * position_delay(delay_ticks))
}

/// Returns the delay of the torque of the position error, s.
fn position_delay(delay_ticks: u8) -> f64 {
    // The delay of the position torque is at least the tick for which a torque is constant.
    DT * (f64::from(delay_ticks) + POSITION_AGE).max(1.0)
}

/// Returns `true` if a held joint does not fall when these gains are applied (J-71). `p` is the present torque of the
/// position error, and `i` is the present torque of the integral, N·m.
///
/// The position gain must produce a minimum torque at the position error limit. If the integral must release torque
/// under the new gains, the resulting position error must be small.
pub(crate) fn hold_on(gains: &PidGains, p: f64, i: f64, limits: &JointConfig) -> bool {
    let held = p + i;
    let kept = held.max(gains.ki * gains.int_min).min(gains.ki * gains.int_max);
    let stiff = gains.kp * limits.position_error_max >= STIFF * limits.torque_max;
    stiff && gains.kp > 0.0 && (held - kept).abs() < SAG * limits.position_error_max * gains.kp
}

/// Trial of gains that a host has sent while the torque was on.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Trial {
    /// Gains before the trial, which the controller restores if the new gains fail. `None` without such gains.
    before: Option<[PidGains; JOINTS]>,
    /// Time of the trial in which all joints were settled and no joint yielded, ms.
    held_ms: u16,
    /// Kp and Kd at the time when the gains changed. `blend_ms` is the remaining time of the blend to the new gains,
    /// ms.
    from: [[f32; 2]; JOINTS],
    blend_ms: u16,
    /// Joints (one bit each) whose gains were reduced or restored because their control loop was unstable. `again_ms`
    /// is the remaining time in which a further instability of these joints is an error, ms.
    unstable: u8,
    again_ms: u16,
}

bit_codec!(Trial { before, held_ms, from, blend_ms, unstable, again_ms });
bit_codec!(PidGains { kp, ki, kd, int_min, int_max });

impl Trial {
    /// Begins a trial of the gains `given`, which a host has sent while the torque was on. The new gains replace the
    /// gains `before`.
    pub(crate) fn begin(&mut self, before: &[PidGains; JOINTS], given: &[PidGains; JOINTS]) {
        self.blend_from(before);
        // If the gains in `before` have not held the arm for the whole trial, they may be unstable. The controller
        // then keeps the older gains that it has already stored.
        if self.before.is_none() || self.held_ms >= TRIAL_MS {
            self.before = Some(*before);
        }
        // If the host sends the stored earlier gains again, no trial is necessary, because these gains have already
        // held the arm.
        self.before = self.before.filter(|before| before != given);
        self.held_ms = 0;
    }

    /// Ends the trial, because the controller no longer holds the arm. Returns the earlier gains if the new gains
    /// have not held the arm for long enough, and `None` otherwise.
    pub(crate) fn end(&mut self) -> Option<[PidGains; JOINTS]> {
        let before = self.before.filter(|_| self.is_on());
        *self = Self::default();
        before
    }

    /// Discards the stored earlier gains if the function `may` returns `false` for them. The controller then cannot
    /// restore these gains.
    pub(crate) fn keep_if(&mut self, may: impl FnOnce(&[PidGains; JOINTS]) -> bool) {
        self.before = self.before.filter(may);
    }

    /// Returns `true` during a trial or a blend of gains, and as long as an instability of a joint is remembered.
    #[inline(always)]
    pub(crate) fn runs(&self) -> bool {
        self.before.is_some() | (self.again_ms > 0) | (self.blend_ms > 0)
    }

    /// Executes one tick of the trial while the torque is on. `held` is `true` if all joints have settled and no joint yields.
    pub(crate) fn step(&mut self, held: bool) {
        self.again_ms = self.again_ms.saturating_sub(1);
        self.blend_ms = self.blend_ms.saturating_sub(1);
        self.held_ms = self.held_ms.saturating_add(u16::from(held));
        if self.held_ms > BLAMED_MS {
            self.before = None;
        }
    }

    /// Returns `true` if gains are on trial.
    pub(crate) fn is_on(&self) -> bool {
        self.before.is_some() && self.held_ms <= TRIAL_MS
    }

    /// Returns the gains of this tick during the blend to the new gains `given`, or `None` if the blend is over. Kp
    /// and Kd change gradually. The integral gain changes at once.
    pub(crate) fn blended(&self, given: &[PidGains; JOINTS]) -> Option<[PidGains; JOINTS]> {
        if self.blend_ms == 0 {
            return None;
        }
        let left = smooth(f64::from(self.blend_ms) / f64::from(BLEND_MS));
        let mut blended = *given;
        for (gains, [kp, kd]) in blended.iter_mut().zip(&self.from) {
            gains.kp += left * (f64::from(*kp) - gains.kp);
            gains.kd += left * (f64::from(*kd) - gains.kd);
        }
        Some(blended)
    }

    /// Begins a blend to other gains. The blend starts from the gains that are effective now. `given` are the configured gains.
    fn blend_from(&mut self, given: &[PidGains; JOINTS]) {
        let acting = self.blended(given).unwrap_or(*given);
        self.from = acting.map(|gains| [gains.kp as f32, gains.kd as f32]);
        self.blend_ms = BLEND_MS;
    }

    /// Returns `true` if the joint was unstable less than [`AGAIN_MS`] ago.
    pub(crate) fn again(&self, joint: usize) -> bool {
        self.again_ms > 0 && self.unstable >> joint & 1 != 0
    }

    /// Handles joints that have `failed` and joints with `unstable` control loops (one bit each). `gains` are the
    /// present gains.
    ///
    /// If the gains must change, returns the cause and the new gains. The new gains are the gains before the trial.
    /// If no earlier gains are stored, the unstable joints get softer gains.
    pub(crate) fn fails(
        &mut self,
        failed: u8,
        unstable: u8,
        gains: &[PidGains; JOINTS],
        delay_ticks: u8,
    ) -> Option<(StopKind, [PidGains; JOINTS])> {
        if unstable != 0 {
            (self.unstable, self.again_ms) = (unstable, AGAIN_MS);
        }
        if unstable == 0 && (failed == 0 || !self.is_on()) {
            return None;
        }
        let before = self.before.take().map(|before| (StopKind::Gains, before));
        let next = before.or_else(|| {
            (unstable != 0).then(|| (StopKind::Unstable, softer(gains, unstable, delay_ticks)))
        })?;
        self.blend_from(gains);
        // The gains of the joints that failed change at once, without a blend.
        for j in 0..JOINTS {
            if failed >> j & 1 != 0 {
                self.from[j] = [next.1[j].kp as f32, next.1[j].kd as f32];
            }
        }
        Some(next)
    }
}

/// Returns gains that are reduced for the `joints` (one bit each). Their integral gain is 0, and their Kd is high
/// enough to damp the reduced Kp.
fn softer(gains: &[PidGains; JOINTS], joints: u8, delay_ticks: u8) -> [PidGains; JOINTS] {
    core::array::from_fn(|j| match gains[j] {
        own if joints >> j & 1 == 0 => own,
        own => {
            let kp = SOFTER * own.kp;
            // Kd is high enough that the delay of the Kp torque cancels at most half of the damping.
            let kd = (SOFTER * own.kd).max(2.0 * kp * position_delay(delay_ticks));
            PidGains { kp, kd, ki: 0.0, ..own }
        }
    })
}

#[cfg(test)]
mod tests;
