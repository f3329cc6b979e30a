//! Check that the arm can stop from every point of a path within the stop time of Pause and Stop (J-33).
//!
//! The rate r of the path time is 1 at full speed and 0 at rest. A ramp is the decrease of r to 0, with the slope s.
//! During a ramp, the torque of the arm model is g + r²·f + s·h (Bobrow 1985; Pham & Pham 2018). The term g is the
//! torque that holds the arm. The term f belongs to the motion at full speed, and h belongs to the change of r. The
//! check computes g, f and h once for each checked time of the path. The torque during a ramp is then a weighted sum
//! of these terms.

use std::collections::VecDeque;

use jtc_core::{Config, JOINTS, SetPoint, interpolate};
use jtc_dynamics::Dynamics;
use jtc_wire::Joint;

use super::{ProblemKind, Verdict};

/// Time between two checks of the torque, along the path and along each ramp, ms.
const SPACING: f64 = 10.0;
/// Durations of the ramps that the check tries, as shares of the allowed stop time. The arm can stop if the torques
/// of at least one of these ramps are within the limits.
const LENGTHS: [f64; 3] = [1.0, 0.7, 0.4];
/// Share of the ramp time in which the slope increases to its maximum. In an equal share at the end of the ramp, the
/// slope decreases to 0.
const CORNER: f64 = 0.2;

/// Terms of the torque of each joint at one time of the path, N·m.
struct Place {
    /// Index of the last point at or before this time of the path. `ms` is the time since this point, ms.
    point: usize,
    ms: f64,
    hold: [f64; JOINTS],
    motion: [f64; JOINTS],
    slope: [f64; JOINTS],
}

/// Torque of the joint that comes closest to its limit during a ramp.
#[derive(Clone, Copy)]
struct Load {
    share: f64,
    joint: Joint,
    torque: f64,
}

/// Adds a problem for every checked time of the path from which the arm cannot stop within `config.stop_ms`: each
/// tried ramp would exceed a torque limit. The torque is computed with the arm model, without friction.
pub(super) fn stops(
    config: &Config,
    dynamics: &Dynamics,
    step_ms: u16,
    points: &[SetPoint],
    verdict: &mut Verdict,
) {
    let end = points.len().saturating_sub(1) as f64 * f64::from(step_ms);
    let last = (end / SPACING).ceil() as usize;
    let stop_ms = f64::from(config.stop_ms).max(SPACING);
    // During a ramp, the path time advances by half of the ramp's duration, so the window must contain at least this
    // part of the path.
    let ahead = (0.5 * stop_ms / SPACING).ceil() as usize + 1;
    let mut window = VecDeque::with_capacity(ahead + 1);
    let mut next = 0;
    for _ in 0..=last {
        while window.len() <= ahead && next <= last {
            window.push_back(place(config, dynamics, step_ms, points, (next as f64 * SPACING).min(end)));
            next += 1;
        }
        let loads = LENGTHS.iter().map(|share| ramp(config, &window, share * stop_ms));
        let easiest = loads.reduce(|a, b| if a.share <= 1.0 || a.share <= b.share { a } else { b });
        if let (Some(load), Some(start)) = (easiest.filter(|l| l.share > 1.0), window.front()) {
            let limit = config.joints[load.joint.index()].torque_max.copysign(load.torque);
            verdict.add(ProblemKind::NoStop, Some(load.joint), start.point, start.ms, load.torque, limit);
        }
        window.pop_front();
    }
}

fn place(config: &Config, dynamics: &Dynamics, step_ms: u16, points: &[SetPoint], at: f64) -> Place {
    let step = f64::from(step_ms);
    let point = ((at / step) as usize).min(points.len() - 1);
    let ms = at - point as f64 * step;
    let s = match points.get(point + 1) {
        Some(b) => interpolate(&points[point], b, step * 1e-3, ms / step),
        None => points[point],
    };
    let zero = [0.0; JOINTS];
    let hold = dynamics.inverse(&s.position, &zero, &zero);
    let all = dynamics.inverse(&s.position, &s.velocity, &s.acceleration);
    let slope = dynamics.inverse(&s.position, &zero, &s.velocity);
    let rotor = |j: usize| config.joints[j].rotor_inertia;
    Place {
        point,
        ms,
        hold,
        motion: std::array::from_fn(|j| all[j] - hold[j] + rotor(j) * s.acceleration[j]),
        slope: std::array::from_fn(|j| slope[j] - hold[j] + rotor(j) * s.velocity[j]),
    }
}

/// Returns the torque that comes closest to its limit during a ramp of `length` ms. The ramp begins at the first
/// element of `window`.
fn ramp(config: &Config, window: &VecDeque<Place>, length: f64) -> Load {
    let mut worst = Load { share: 0.0, joint: Joint::ALL[0], torque: 0.0 };
    let samples = (length / SPACING).ceil().max(2.0);
    let (mut way, mut before) = (0.0, 1.0);
    for k in 0..=samples as usize {
        let (done, steepness) = profile(k as f64 / samples);
        let (rate, slope) = (1.0 - done, -steepness / (length * 1e-3));
        way += 0.5 * (rate + before) * length / samples / SPACING * f64::from(u8::from(k > 0));
        before = rate;
        let index = (way as usize).min(window.len() - 1);
        let (a, u) = (&window[index], way - index as f64);
        let b = window.get(index + 1).unwrap_or(a);
        for joint in Joint::ALL {
            let j = joint.index();
            let between = |part: fn(&Place) -> &[f64; JOINTS]| {
                let (x, y) = (part(a)[j], part(b)[j]);
                x + u.min(1.0) * (y - x)
            };
            let torque =
                between(|p| &p.hold) + rate * rate * between(|p| &p.motion) + slope * between(|p| &p.slope);
            let share = torque.abs() / config.joints[j].torque_max;
            if share > worst.share {
                worst = Load { share, joint, torque };
            }
        }
    }
    worst
}

/// Returns how much of the ramp is completed (0 to 1) after the share `x` of the ramp time, and the slope at this
/// time. The ramp is a straight line with rounded ends.
fn profile(x: f64) -> (f64, f64) {
    let steepest = 1.0 / (1.0 - CORNER);
    let end = 1.0 - x;
    if x < CORNER {
        (0.5 * steepest * x * x / CORNER, steepest * x / CORNER)
    } else if end < CORNER {
        (1.0 - 0.5 * steepest * end * end / CORNER, steepest * end / CORNER)
    } else {
        (steepest * (x - 0.5 * CORNER), steepest)
    }
}
