//! Reasons why a motion is not faster, for each point in time.
use jtc_wire::Joint;

use crate::binding::{Binding, LimitKind};
use crate::motion::Motion;
use crate::{ArmDynamics, JOINTS, Limits, verify};

/// Share of a limit above which the limit is considered binding.
const BINDS: f64 = 0.985;
/// Time between samples, s, and maximum number of samples.
const STEP: f64 = 0.002;
const SAMPLES_MAX: f64 = 4000.0;
/// Longest time between an instant and the place at which its binding limit is reached, s. Acceleration ramps can
/// last as long as this time. For example, a motion is slow before a corner because of a limit that is reached in the
/// corner.
const NEAR: f64 = 0.05;
/// Share of the usable torque below which the torque is not reported as the binding limit. A lower torque can be
/// mainly holding torque, which does not depend on the speed.
const TORQUE: f64 = 0.9;
/// Minimum duration of an interval, s. Shorter intervals are merged into the previous interval.
const SHORT: f64 = 0.004;

/// A limit and its use. The use is the ratio of the motion's speed to the speed at which the limit would be reached.
type Use = (f64, Joint, LimitKind);

/// Binding limits of a motion.
pub(crate) struct Reasons {
    /// Limits that the motion reaches.
    pub used_up: Vec<Binding>,
    /// Binding limits for the times at which no limit is reached. If the whole motion was slowed down because of a torque limit, this limit
    /// is the binding limit. If the whole motion was not slowed down, the binding limit is the limit with the highest use around this time.
    otherwise: Vec<Binding>,
}

/// Returns the motion with its binding limits.
pub(crate) fn explained(mut motion: Motion, limits: &Limits, arm: Option<&ArmDynamics>) -> Motion {
    motion.binding = find(&motion, limits, arm).joined(motion.duration());
    motion
}

/// Finds the binding limits of a motion.
pub(crate) fn find(motion: &Motion, limits: &Limits, arm: Option<&ArmDynamics>) -> Reasons {
    let limits = &verify::with_table(limits, arm);
    let duration = motion.duration();
    let count = (duration / (duration / SAMPLES_MAX).max(STEP)).ceil().max(1.0) as usize;
    let step = duration / count as f64;
    let uses: Vec<(Use, Option<Use>)> =
        (0..count).map(|i| uses(motion, (i as f64 + 0.5) * step, limits, arm)).collect();
    let used_up = uses.iter().map(|u| u.1.map(|(_, joint, limit)| (joint, limit)));
    let otherwise = match motion.slowed {
        Some(joint) => vec![Binding { from: 0.0, to: duration, joint, limit: LimitKind::Torque }],
        None => {
            let reach = (NEAR / step).ceil() as usize;
            runs(highest(&uses, reach).into_iter().map(|(_, joint, limit)| Some((joint, limit))), step)
        }
    };
    Reasons { used_up: runs(used_up, step), otherwise }
}

/// Returns the limit with the highest use (see [`Use`]) at `time`, and the limit that the motion reaches, if there is
/// one.
fn uses(motion: &Motion, time: f64, limits: &Limits, arm: Option<&ArmDynamics>) -> (Use, Option<Use>) {
    let state = motion.at(time);
    // The holding torque is computed only if the torque is near the usable limit.
    let torque = arm.map(|arm| {
        let torque = arm.torque(&state);
        let least = |j: usize| (1.0 - limits.margin[j]) * limits.torque[j];
        let far = (0..JOINTS).all(|j| torque[j].abs() < TORQUE * least(j));
        let hold = if far { [0.0; JOINTS] } else { arm.holding(&state.position) };
        (torque, std::array::from_fn::<f64, JOINTS, _>(|j| arm.usable_torque(limits, j, hold[j])))
    });
    let jerk = motion.jerk_at(time);
    let mut most: Use = (0.0, Joint::ALL[0], LimitKind::Velocity);
    let mut used_up: Option<Use> = None;
    for joint in Joint::ALL {
        let j = joint.index();
        let mut take = |value: f64, limit: f64, kind, as_speed: fn(f64) -> f64| {
            let share = value.abs() / limit;
            if as_speed(share) > most.0 {
                most = (as_speed(share), joint, kind);
            }
            if share > used_up.map_or(BINDS, |u| u.0) {
                used_up = Some((share, joint, kind));
            }
        };
        take(state.velocity[j], limits.velocity[j], LimitKind::Velocity, |share| share);
        take(state.acceleration[j], limits.acceleration[j], LimitKind::Acceleration, f64::sqrt);
        take(jerk[j], limits.jerk[j], LimitKind::Jerk, f64::cbrt);
        if let Some((torque, usable)) = torque {
            let moves = |share| if share > TORQUE { share } else { 0.0 };
            take(torque[j], usable[j], LimitKind::Torque, moves);
        }
    }
    (most, used_up)
}

/// Returns, for each sample, the highest use of a limit among all samples that are at most `reach` samples away.
fn highest(uses: &[(Use, Option<Use>)], reach: usize) -> Vec<Use> {
    // Indices of samples, in descending order of their use. The use of the first index is the highest within `reach`
    // samples.
    let mut falling: std::collections::VecDeque<usize> = std::collections::VecDeque::new();
    let mut next = 0;
    let at = |i: usize| {
        while next < uses.len().min(i + reach + 1) {
            while falling.back().is_some_and(|&b| uses[b].0.0 <= uses[next].0.0) {
                falling.pop_back();
            }
            falling.push_back(next);
            next += 1;
        }
        while falling.front().is_some_and(|f| f + reach < i) {
            falling.pop_front();
        }
        uses[falling.front().copied().unwrap_or(i)].0
    };
    (0..uses.len()).map(at).collect()
}

/// Merges consecutive samples with the same binding limit into intervals.
fn runs(samples: impl Iterator<Item = Option<(Joint, LimitKind)>>, step: f64) -> Vec<Binding> {
    let mut runs: Vec<Binding> = Vec::new();
    for (i, sample) in samples.enumerate() {
        let Some((joint, limit)) = sample else { continue };
        let (from, to) = (i as f64 * step, (i + 1) as f64 * step);
        match runs.last_mut() {
            Some(last) if last.joint == joint && last.limit == limit && from - last.to < SHORT => {
                last.to = to
            }
            _ => runs.push(Binding { from, to, joint, limit }),
        }
    }
    runs
}

impl Reasons {
    /// Returns one list for a motion of `duration` s. The list contains the limits that are reached, and the other
    /// binding limits for the times between them.
    pub(crate) fn joined(&self, duration: f64) -> Vec<Binding> {
        let mut all: Vec<Binding> = Vec::new();
        let mut take = |next: Binding| match all.last_mut() {
            _ if next.to <= next.from => {}
            Some(last)
                if next.to - next.from < SHORT || (last.joint, last.limit) == (next.joint, next.limit) =>
            {
                last.to = next.to;
            }
            _ => all.push(next),
        };
        let (mut time, mut other) = (0.0, 0);
        let end = Binding { from: duration, to: duration, joint: Joint::ALL[0], limit: LimitKind::Velocity };
        for b in self.used_up.iter().chain([&end]) {
            while let Some(o) = self.otherwise.get(other).filter(|o| o.from < b.from) {
                take(Binding { from: o.from.max(time), to: o.to.min(b.from), ..*o });
                if o.to > b.from {
                    break;
                }
                other += 1;
            }
            take(Binding { from: b.from.max(time), ..*b });
            time = b.to.max(time);
        }
        all
    }
}
