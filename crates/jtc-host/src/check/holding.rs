//! Check that the drives can hold the arm at rest: at the start, at the end, and wherever the arm stops along the
//! path.
//!
//! If a joint needs nearly its whole torque limit at rest, the arm falls after some time. The cause is the encoder
//! noise: the gains amplify it, so the commanded torque exceeds the limit again and again. The controller reports an
//! error if a torque exceeds its limit for more than 10 ms within 100 ms (J-43). The check accepts a path that passes
//! such a pose without stopping, although a Pause could stop the arm there.

use jtc_core::{Config, JOINTS, SetPoint, interpolate};
use jtc_dynamics::Dynamics;
use jtc_wire::Joint;

use super::{HOLD_SHARE, ProblemKind, Verdict};

/// Speed up to which a joint counts as at rest, rad/s. For comparison, the smallest velocity in a serial frame is about 0.1 mrad/s.
const STANDS: f64 = 0.001;

/// Adds a problem for every joint that needs more than [`HOLD_SHARE`] of its torque limit while the arm is at rest on
/// the path. If `stands_at_start` is `true`, the arm is already at rest in the start pose before the motion, so this
/// pose is not checked.
pub(super) fn holds(
    config: &Config,
    dynamics: &Dynamics,
    step_ms: u16,
    points: &[SetPoint],
    stands_at_start: bool,
    verdict: &mut Verdict,
) {
    let last = points.len().saturating_sub(1);
    let h = f64::from(step_ms) * 1e-3;
    let mut leaving = stands_at_start;
    let mut look = |s: &SetPoint, i: usize, ms: u16| {
        let rests = s.velocity.iter().all(|v| v.abs() <= STANDS);
        leaving &= rests;
        let is_end = i == last;
        if (rests && !leaving) || is_end || (i == 0 && ms == 0 && !stands_at_start) {
            hold(config, dynamics, s, i, ms, verdict);
        }
    };
    for (i, a) in points.iter().enumerate() {
        look(a, i, 0);
        let Some(b) = points.get(i + 1) else { break };
        for ms in 1..step_ms {
            look(&interpolate(a, b, h, f64::from(ms) / f64::from(step_ms)), i, ms);
        }
    }
}

fn hold(config: &Config, dynamics: &Dynamics, s: &SetPoint, i: usize, ms: u16, verdict: &mut Verdict) {
    let zero = [0.0; JOINTS];
    let torque = dynamics.inverse(&s.position, &zero, &zero);
    for (joint, limit) in Joint::ALL.into_iter().zip(&config.joints) {
        let torque = torque[joint.index()];
        let most = HOLD_SHARE * limit.torque_max;
        if torque.abs() > most {
            verdict.add(
                ProblemKind::HoldTorque,
                Some(joint),
                i,
                f64::from(ms),
                torque,
                most.copysign(torque),
            );
        }
    }
}
