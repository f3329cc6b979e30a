//! Verification that a motion keeps its limits, also between samples. A motion that exceeds a limit is slowed down.
use jtc_wire::Joint;

use crate::motion::{Motion, Piece};
use crate::torque::HOLD_SHARE;
use crate::{ArmDynamics, JOINTS, JointVec, Limits, PlanError};

/// Tolerance for rounding, as a share of a limit.
const ROUNDING: f64 = 1e-9;
/// Time between torque samples, s.
const TORQUE_STEP: f64 = 0.004;
/// Share of the torque limit that the torque may reach at the samples. The rest is a margin, because the torque can
/// be higher between samples.
const TORQUE_SHARE: f64 = 0.9985;
/// Time factor (new duration divided by old duration) of a slowdown above which its cause is reported as the binding
/// limit.
const MUCH: f64 = 1.01;
/// Maximum number of torque samples. In a longer motion, the samples are further apart.
const SAMPLES_MAX: f64 = 200_000.0;
/// Maximum time factor of a motion that is slowed down because of its torque.
const SLOWEST: f64 = 64.0;

/// Returns the limits restricted to the speeds in the friction table (J-36).
pub(crate) fn with_table(limits: &Limits, arm: Option<&ArmDynamics>) -> Limits {
    let mut limits = limits.clone();
    for (j, velocity) in limits.velocity.iter_mut().enumerate() {
        // The speed limit is slightly below the last row of the friction table, so that rounding cannot exceed this
        // row.
        let table = arm.map_or(f64::INFINITY, |arm| arm.velocity_max(j) * (1.0 - 1e-4));
        *velocity = velocity.min(table);
    }
    limits
}

/// Slows a motion down until it keeps all limits.
pub(crate) fn finished(
    motion: Motion,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    let within = with_table(limits, arm);
    let motion = within_kinematics(motion, &within)?;
    match arm {
        Some(arm) => within_torque(motion, &within, arm),
        None => Ok(motion),
    }
}

/// Slows a motion down until it keeps the velocity, acceleration and jerk limits.
pub(crate) fn within_kinematics(motion: Motion, limits: &Limits) -> Result<Motion, PlanError> {
    let stretch = motion.pieces.iter().map(|p| kinematic_stretch(p, limits)).fold(1.0, f64::max);
    if !stretch.is_finite() {
        return Err(PlanError::NoTimeLaw { leg: 1, reason: "the motion is not finite".into() });
    }
    Ok(if stretch > 1.0 + ROUNDING { motion.stretched(stretch) } else { motion })
}

/// Returns the time factor (new duration divided by old duration) that a piece needs to keep the velocity,
/// acceleration and jerk limits. The factor is below 1 if the piece could be faster.
pub(crate) fn kinematic_stretch(piece: &Piece, limits: &Limits) -> f64 {
    let mut most = 0.0f64;
    for j in 0..JOINTS {
        let h = piece.length;
        // The unit of time is the duration of the piece.
        let [_, c1, c2, c3, c4, c5] = piece.coefficients[j];
        let velocity = [c1, 2.0 * c2 * h, 3.0 * c3 * h * h, 4.0 * c4 * h.powi(3), 5.0 * c5 * h.powi(4)];
        let acceleration = [2.0 * c2, 6.0 * c3 * h, 12.0 * c4 * h * h, 20.0 * c5 * h.powi(3)];
        let jerk = [6.0 * c3, 24.0 * c4 * h, 60.0 * c5 * h * h];
        let of = |p: &[f64], limit: f64| largest(p, limit) / limit;
        // The function computes no root for a value within its limit. Most values are within their limits, and roots
        // take computing time.
        let root = |share: f64, root: fn(f64) -> f64| if share > 1.0 { root(share) } else { share };
        most = most.max(of(&velocity, limits.velocity[j]));
        most = most.max(root(of(&acceleration, limits.acceleration[j]), f64::sqrt));
        if limits.jerk[j].is_finite() {
            most = most.max(root(of(&jerk, limits.jerk[j]), f64::cbrt));
        }
        if velocity.iter().chain(&jerk).any(|c| !c.is_finite()) {
            return f64::INFINITY;
        }
    }
    most
}

/// Returns the time factor that a piece needs so that the torque is sufficient at a few samples. A slower motion
/// reduces only the part of the torque that depends on the speed. Returns 1 if the torque is sufficient, or if it is
/// too small at every speed.
pub(crate) fn torque_stretch(piece: &Piece, limits: &Limits, arm: &ArmDynamics) -> f64 {
    let mut most = 1.0f64;
    // With a jerk limit, the acceleration does not jump between pieces. The start of a piece was already checked as the
    // end of the previous piece.
    let same = usize::from(limits.has_jerk());
    for t in moments(piece, TORQUE_STEP.max(piece.length / 8.0), limits, arm).into_iter().skip(same) {
        let state = piece.at(t);
        let rigid = arm.rigid(&state.position, &state.velocity, &state.acceleration);
        let friction: JointVec = std::array::from_fn(|j| arm.friction(j, state.velocity[j], rigid[j]));
        let torque: JointVec = std::array::from_fn(|j| rigid[j] + friction[j]);
        let suffices =
            |j: usize| torque[j].abs() <= TORQUE_SHARE * (1.0 - limits.margin[j]) * limits.torque[j];
        if (0..JOINTS).all(suffices) {
            continue;
        }
        let hold = arm.holding(&state.position);
        for j in 0..JOINTS {
            let limit = TORQUE_SHARE * arm.usable_torque(limits, j, hold[j]);
            let still = hold[j] + friction[j];
            let (room, needed) = (limit - (still * torque[j].signum()), (torque[j] - still).abs());
            if torque[j].abs() > limit && room > 0.0 {
                most = most.max((needed / room).sqrt());
            }
        }
    }
    most
}

/// Returns an upper bound of a polynomial's magnitude on 0..1. A bound above `limit` is accurate to a thousandth. The
/// range of the Bernstein coefficients always contains the polynomial (Farouki 2012).
fn largest(polynomial: &[f64], limit: f64) -> f64 {
    hull(&bernstein(polynomial)[..polynomial.len()], limit, 6)
}

/// Returns the Bernstein coefficients of the polynomial on 0..1.
fn bernstein(polynomial: &[f64]) -> [f64; 5] {
    let degree = polynomial.len() - 1;
    let mut bernstein = [0.0; 5];
    for (i, b) in bernstein.iter_mut().enumerate().take(degree + 1) {
        *b = (0..=i).map(|k| polynomial[k] * BINOMIAL[i][k] / BINOMIAL[degree][k]).sum();
    }
    bernstein
}

const BINOMIAL: [[f64; 5]; 5] = [
    [1.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, 2.0, 1.0, 0.0, 0.0],
    [1.0, 3.0, 3.0, 1.0, 0.0],
    [1.0, 4.0, 6.0, 4.0, 1.0],
];

fn hull(b: &[f64], limit: f64, depth: u8) -> f64 {
    let bound = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    let n = b.len() - 1;
    let reached = b[0].abs().max(b[n].abs());
    if depth == 0 || bound <= limit || bound <= reached * (1.0 + 1e-6) {
        return bound;
    }
    // The interval is divided into two halves (de Casteljau).
    let (mut work, mut left, mut right) = ([0.0; 5], [0.0; 5], [0.0; 5]);
    work[..=n].copy_from_slice(b);
    for i in 0..=n {
        left[i] = work[0];
        right[n - i] = work[n - i];
        for k in 0..n - i {
            work[k] = 0.5 * (work[k] + work[k + 1]);
        }
    }
    hull(&left[..=n], limit, depth - 1).max(hull(&right[..=n], limit, depth - 1))
}

/// Parts of the torque at one point of the motion, N·m, and the time of this point.
struct Load {
    time: f64,
    hold: JointVec,
    motion: JointVec,
    velocity: JointVec,
}

/// Slows a motion down until the torque is sufficient.
fn within_torque(motion: Motion, limits: &Limits, arm: &ArmDynamics) -> Result<Motion, PlanError> {
    holds_where_it_rests(&motion, limits, arm)?;
    let loads = loads(&motion, limits, arm);
    let over = |load: &Load, factor: f64| {
        let slow = 1.0 / factor;
        Joint::ALL.into_iter().find_map(|joint| {
            let j = joint.index();
            let rigid = load.hold[j] + load.motion[j] * slow * slow;
            let torque = rigid + arm.friction(j, load.velocity[j] * slow, rigid);
            let limit = TORQUE_SHARE * arm.usable_torque(limits, j, load.hold[j]);
            (torque.abs() > limit || torque.is_nan()).then_some((load.time, joint, torque, limit))
        })
    };
    let mut factor = 1.0;
    let mut slowed = None;
    // Points of the motion that have exceeded a torque limit so far. Only these points are used to compute the time
    // factor, because most points never exceed a limit.
    let mut some: Vec<&Load> = Vec::new();
    loop {
        let before = some.len();
        some.extend(loads.iter().filter(|load| over(load, factor).is_some()));
        if some.len() == before {
            break;
        }
        let (slow, joint) = factor_for(&motion, &limits.torque, factor, |factor| {
            some.iter().find_map(|load| over(load, factor))
        })?;
        (factor, slowed) = (slow, (slow > MUCH).then_some(joint).or(slowed));
    }
    if factor == 1.0 {
        return Ok(motion);
    }
    Ok(Motion { slowed, ..motion.stretched(factor) })
}

/// Time, joint, torque and torque limit at a point at which the torque is not sufficient.
type Over = (f64, Joint, f64, f64);

/// Returns the smallest time factor above `least` that keeps every point of the motion within the torque limit. Also
/// returns the last joint that exceeded the limit. `whole` contains the torque limits.
fn factor_for(
    motion: &Motion,
    whole: &JointVec,
    least: f64,
    over: impl Fn(f64) -> Option<Over>,
) -> Result<(f64, Joint), PlanError> {
    let Some((_, mut joint, ..)) = over(least) else { return Ok((least, Joint::ALL[0])) };
    let (mut fast, mut slow) = (least, 1.25 * least);
    while let Some((time, joint, torque, limit)) = over(slow) {
        if slow > SLOWEST {
            let waypoint = waypoint_at(motion, time);
            let (torque, whole) = (torque.abs(), whole[joint.index()]);
            return Err(PlanError::Torque { waypoint, joint, torque, limit, whole, holding: false });
        }
        fast = slow;
        slow *= 1.25;
    }
    for _ in 0..10 {
        let middle = 0.5 * (fast + slow);
        match over(middle) {
            Some(found) => (fast, joint) = (middle, found.1),
            None => slow = middle,
        }
    }
    Ok((slow, joint))
}

/// Returns the number (from 1) of the last waypoint that the motion has passed at `time`.
fn waypoint_at(motion: &Motion, time: f64) -> usize {
    motion.waypoint_times.partition_point(|t| *t <= time).max(1)
}

fn holds_where_it_rests(motion: &Motion, limits: &Limits, arm: &ArmDynamics) -> Result<(), PlanError> {
    for (i, &time) in motion.waypoint_times.iter().enumerate() {
        let state = motion.at(time);
        if state.velocity.iter().all(|v| v.abs() <= 1e-6) {
            holds(&state.position, i + 1, limits, Some(arm))?;
        }
    }
    Ok(())
}

/// Checks that the arm can be held at a position, if the dynamics of the arm are known. The error contains `waypoint`,
/// counted from 1.
pub(crate) fn holds(
    position: &JointVec,
    waypoint: usize,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<(), PlanError> {
    let Some(arm) = arm else { return Ok(()) };
    let torques = arm.holding(position);
    for joint in Joint::ALL {
        let (torque, whole) = (torques[joint.index()].abs(), limits.torque[joint.index()]);
        let limit = HOLD_SHARE * whole;
        if torque > limit || torque.is_nan() {
            return Err(PlanError::Torque { waypoint, joint, torque, limit, whole, holding: true });
        }
    }
    Ok(())
}

/// Returns the times at which the torque of a piece is sampled, in seconds after its start. The times are at most
/// `step` apart. The times include both ends, at which the acceleration can jump, and the times at which the smoothed
/// sign function of a joint's friction reaches ±1. A piece with higher accelerations inside than at its ends has more
/// sample times.
fn moments(piece: &Piece, step: f64, limits: &Limits, arm: &ArmDynamics) -> Vec<f64> {
    let least = if bulges(piece, limits) { 8.0 } else { 2.0 };
    let count = (piece.length / step).ceil().max(least) as usize;
    let mut moments: Vec<f64> = (0..=count).map(|i| piece.length * i as f64 / count as f64).collect();
    if let Some(width) = arm.sign_width() {
        let (first, last) = (piece.at(0.0).velocity, piece.at(piece.length).velocity);
        for (v, w) in first.iter().zip(&last) {
            for edge in [-width, width] {
                if (v - edge) * (w - edge) < 0.0 {
                    moments.push(piece.length * (edge - v) / (w - v));
                }
            }
        }
    }
    moments
}

/// Returns `true` if a joint's acceleration inside the piece can be outside the range of the accelerations at both
/// ends.
fn bulges(piece: &Piece, limits: &Limits) -> bool {
    let h = piece.length;
    piece.coefficients.iter().zip(&limits.acceleration).any(|([_, _, c2, c3, c4, c5], limit)| {
        let b = bernstein(&[2.0 * c2, 6.0 * c3 * h, 12.0 * c4 * h * h, 20.0 * c5 * h * h * h]);
        let slack = 1e-3 * limit;
        let (low, high) = (b[0].min(b[3]) - slack, b[0].max(b[3]) + slack);
        b[1].min(b[2]) < low || b[1].max(b[2]) > high
    })
}

fn loads(motion: &Motion, limits: &Limits, arm: &ArmDynamics) -> Vec<Load> {
    let step = TORQUE_STEP.max(motion.duration() / SAMPLES_MAX);
    let mut loads = Vec::new();
    for (i, piece) in motion.pieces.iter().enumerate() {
        // With a jerk limit, the acceleration does not jump between pieces.
        let same = usize::from(i > 0 && limits.has_jerk());
        for t in moments(piece, step, limits, arm).into_iter().skip(same) {
            let s = piece.at(t);
            let hold = arm.holding(&s.position);
            let mut motion = arm.rigid(&s.position, &s.velocity, &s.acceleration);
            motion.iter_mut().zip(&hold).for_each(|(m, h)| *m -= h);
            loads.push(Load { time: piece.start + t, hold, motion, velocity: s.velocity });
        }
    }
    loads
}
