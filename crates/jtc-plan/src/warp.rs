//! Change of the timing of a motion on an unchanged path. Each part of the motion has its own rate (speed factor),
//! and the transitions between the rates are smooth.
use crate::Limits;
use crate::compose::Section;
use crate::law::{Law, Phase};
use crate::motion::{Motion, Piece};
use crate::path::{Path, PathPoint};

/// Maximum duration of a change from one rate to the next, s. The next constant is the maximum as a share of the
/// duration of the shorter adjacent part.
const CHANGE: f64 = 0.5;
const CHANGE_SHARE: f64 = 0.4;
/// Speed below which a motion is considered at rest, rad/s.
const RESTS: f64 = 1e-9;

/// Part of a motion, from the end of the previous part to `end` (s), with its requested duration, s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub end: f64,
    pub wanted: f64,
}

/// Motion as a path whose parameter is the time of the motion.
struct InTime<'a>(&'a Motion);

impl Path for InTime<'_> {
    fn end(&self) -> f64 {
        self.0.duration()
    }

    fn at(&self, s: f64) -> PathPoint {
        let state = self.0.at(s);
        PathPoint { position: state.position, first: state.velocity, second: state.acceleration }
    }
}

/// Returns the motion in which each part has its requested duration, except for rounding. The caller must check the
/// limits again.
pub(crate) fn warped(motion: &Motion, parts: &[Part], limits: &Limits) -> Motion {
    let parts: Vec<Part> = parts.iter().copied().filter(|p| p.wanted > 0.0).collect();
    let changes = changes(motion, &parts);
    if changes.iter().all(|change| *change == 0.0) {
        return scaled(motion, &parts);
    }
    let law = law(motion, &parts, &changes);
    let breaks: Vec<f64> = motion.pieces.iter().skip(1).map(|p| p.start).collect();
    let path = InTime(motion);
    let waypoints = motion.waypoint_times[1..].to_vec();
    let to = motion.duration();
    let section = Section { path: &path, from: 0.0, to, parts_of_path: breaks.len() + 1, breaks, waypoints };
    let mut warped = section.motion(&law, limits);
    warped.end = motion.end;
    // The motion must begin exactly at rest.
    if let Some(first) = warped.pieces.first_mut() {
        first.coefficients.iter_mut().for_each(|c| c[1] = 0.0);
    }
    warped
}

/// Stretches each part separately. The caller ensures that all parts begin and end at rest.
fn scaled(motion: &Motion, parts: &[Part]) -> Motion {
    // Values for each part: end of the part, start before and after stretching, and time factor.
    let (mut before, mut after) = (0.0, 0.0);
    let mut scales = Vec::with_capacity(parts.len());
    for part in parts {
        let factor = part.wanted / (part.end - before);
        scales.push((part.end, before, after, factor));
        (before, after) = (part.end, after + part.wanted);
    }
    let at = |time: f64, inside: f64| {
        let (_, before, after, factor) =
            scales[scales.partition_point(|s| s.0 < inside).min(scales.len() - 1)];
        (after + (time - before) * factor, factor)
    };
    let pieces = motion.pieces.iter().map(|piece| {
        let (start, factor) = at(piece.start, piece.start + 0.5 * piece.length);
        Piece { start, ..piece.stretched(factor) }
    });
    let times = motion.waypoint_times.iter().map(|time| at(*time, *time).0).collect();
    Motion::new(pieces.collect(), motion.end.position, times)
}

/// Returns the duration of the change of rate at the end of each part except the last, s.
fn changes(motion: &Motion, parts: &[Part]) -> Vec<f64> {
    let change = |pair: &[Part]| {
        let rests = motion.at(pair[0].end).velocity.iter().all(|v| v.abs() < RESTS);
        if rests { 0.0 } else { CHANGE.min(CHANGE_SHARE * pair[0].wanted.min(pair[1].wanted)) }
    };
    parts.windows(2).map(change).collect()
}

/// Returns the time in the old motion as a function of the time in the new motion.
fn law(motion: &Motion, parts: &[Part], changes: &[f64]) -> Law {
    let begins = std::iter::once(0.0).chain(parts.iter().map(|p| p.end));
    let lengths: Vec<f64> = parts.iter().zip(begins).map(|(p, begin)| p.end - begin).collect();
    let rates = rates(parts, &lengths, changes);
    let mut phases: Vec<Phase> = Vec::with_capacity(3 * parts.len());
    let mut next = Phase::default();
    for (i, part) in parts.iter().enumerate() {
        let before = if i > 0 { changes[i - 1] } else { 0.0 };
        let change = changes.get(i).copied().unwrap_or(0.0);
        let rate = rates[i];
        next = Phase { speed: rate, acceleration: 0.0, jerk: 0.0, ..next };
        let steady = part.wanted - 0.5 * (before + change);
        let ramp = rates
            .get(i + 1)
            .map_or(0.0, |r| if change > 0.0 { 4.0 * (r - rate) / (change * change) } else { 0.0 });
        for (length, jerk) in [(steady, 0.0), (0.5 * change, ramp), (0.5 * change, -ramp)] {
            if length > 0.0 {
                phases.push(Phase { length, jerk, ..next });
                let (s, speed, acceleration) = phases[phases.len() - 1].at(length);
                next = Phase { start: next.start + length, length, s, speed, acceleration, jerk: 0.0 };
            }
        }
    }
    Law { phases, end: motion.duration(), rests: false }
}

/// Returns the rates (speed factors) that give each part its requested duration. Half of a change of rate is in the
/// part before the change, and half is in the part after the change.
fn rates(parts: &[Part], lengths: &[f64], changes: &[f64]) -> Vec<f64> {
    let mut rates: Vec<f64> = parts.iter().zip(lengths).map(|(p, length)| length / p.wanted).collect();
    // Compared with a constant rate, half a change of rate adds (adjacent rate − own rate)·(duration of the
    // change)/12 to the distance of a part.
    for _ in 0..60 {
        for i in 0..parts.len() {
            let mut way = lengths[i];
            let mut time = parts[i].wanted;
            for (at, other) in [(i.checked_sub(1), i.wrapping_sub(1)), (Some(i), i + 1)] {
                let change = at.and_then(|at| changes.get(at)).copied().unwrap_or(0.0) / 12.0;
                if change > 0.0 {
                    way -= rates[other] * change;
                    time -= change;
                }
            }
            rates[i] = way / time;
        }
    }
    rates
}
