//! Choice of the corners that are rounded, and of the waypoints that are corners.
//!
//! A path that stops at a corner is always within the blend. A straight line that passes close to dense waypoints is
//! also within the blend. The planner compares these options and uses the fastest.
use crate::along::unexplained;
use crate::path::{Path, PathPoint};
use crate::{ArmDynamics, BlendedPath, JOINTS, JointVec, Limits, Motion, PlanError, verify};

/// Maximum distances of removed waypoints from the straight line, as shares of the blend. For each value, the planner
/// creates one path.
const THIN: [f64; 2] = [0.2, 0.5];
/// Ratio of the numbers of corners before and after the removal of waypoints. If this ratio or a higher ratio is
/// reached and there is a jerk limit, the path with all waypoints is not planned.
const DENSE: usize = 8;
/// Number of rounds in which rounded corners are replaced by stops.
const ROUNDS: usize = 5;
/// A stop replaces a rounded corner if the time with the stop is below this share of the time with the rounded corner.
const WORTH: f64 = 0.99;

/// Fastest motion found so far, without its limiting constraints, and the path of this motion.
pub(crate) struct Chosen {
    pub path: BlendedPath,
    pub motion: Motion,
}

/// Plans several motions through the waypoints of `path` and returns the fastest motion. The options are the path
/// itself, paths without some of the waypoints, paths with stops at some corners, and a path with stops at all
/// waypoints. Waypoints for which `keep` returns `true` are not dropped.
pub(crate) fn fastest(
    path: BlendedPath,
    blend: f64,
    keep: &dyn Fn(usize) -> bool,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Chosen, PlanError> {
    let line_limits = verify::with_table(limits, arm);
    let all_stops = path.stopping_at(&(1..path.corners() - 1).collect::<Vec<_>>());
    let is_rounded = (0..path.corners()).any(|i| path.is_rounded(i));
    let mut paths: Vec<BlendedPath> =
        THIN.iter().filter_map(|share| path.thinned(blend, *share, keep)).collect();
    let least = paths.iter().map(BlendedPath::corners).min().unwrap_or(path.corners());
    if !limits.has_jerk() || path.corners() < DENSE * least {
        paths.insert(0, path);
    }
    let mut best: Option<Timed> = None;
    let mut failed: Option<PlanError> = None;
    for path in paths {
        match Timed::new(path, limits, arm) {
            Ok(timed)
                if best.as_ref().is_none_or(|best| timed.motion.duration() < best.motion.duration()) =>
            {
                best = Some(timed);
            }
            Ok(_) => {}
            Err(error) => failed = failed.or(Some(error)),
        }
    }
    if is_rounded {
        for _ in 0..ROUNDS {
            let Some(slow) = best.as_ref().map(|best| best.slow_corners(&line_limits)) else { break };
            if slow.is_empty() {
                break;
            }
            let stopping = best.as_ref().map(|best| Timed::new(best.path.stopping_at(&slow), limits, arm));
            match (stopping, &mut best) {
                (Some(Ok(stopping)), Some(best)) if stopping.motion.duration() < best.motion.duration() => {
                    *best = stopping;
                }
                _ => break,
            }
        }
        // If the best path already stops at all corners, planning the path with all stops would give the same motion
        // again.
        let is_planned =
            |best: &Timed| best.path.corners() == all_stops.corners() && best.path.stops_everywhere();
        let with_stops: f64 = all_stops.legs().map(|(a, b)| rest_to_rest(&a, &b, &line_limits)).sum();
        if best.as_ref().is_none_or(|best| !is_planned(best) && with_stops < best.motion.duration())
            && let Ok(stops) = Timed::new(all_stops, limits, arm)
            && best.as_ref().is_none_or(|best| stops.motion.duration() < best.motion.duration())
        {
            best = Some(stops);
        }
    }
    match (best, failed) {
        (Some(best), _) => Ok(Chosen { path: best.path, motion: best.motion }),
        (None, Some(error)) => Err(error),
        (None, None) => Err(PlanError::Path { leg: 1, parameter: 0.0 }),
    }
}

/// A path with its motion and the times at which the motion passes the middle of each leg.
struct Timed {
    path: BlendedPath,
    motion: Motion,
    middles: Vec<f64>,
}

impl Timed {
    fn new(path: BlendedPath, limits: &Limits, arm: Option<&ArmDynamics>) -> Result<Self, PlanError> {
        let with_middles = WithMiddles::new(&path);
        let mut motion = unexplained(&with_middles, limits, arm)?;
        let mut middles = Vec::new();
        let mut is_middle = with_middles.places.iter().map(|place| place.1);
        motion.waypoint_times.retain(|time| {
            let middle = is_middle.next().unwrap_or(false);
            if middle {
                middles.push(*time);
            }
            !middle
        });
        Ok(Self { path, motion, middles })
    }

    /// Returns the rounded corners at which a stop would take less time. The time with a stop is half of the
    /// rest-to-rest times of the two adjacent legs.
    fn slow_corners(&self, limits: &Limits) -> Vec<usize> {
        let at_rest: Vec<f64> = self.path.legs().map(|(a, b)| rest_to_rest(&a, &b, limits)).collect();
        let is_slow = |&i: &usize| {
            let stop = 0.5 * (at_rest[i - 1] + at_rest[i]);
            self.path.is_rounded(i) && stop < WORTH * (self.middles[i] - self.middles[i - 1])
        };
        (1..self.path.corners() - 1).filter(is_slow).collect()
    }
}

/// A path that has the middles of its legs as additional waypoints.
struct WithMiddles<'a> {
    path: &'a BlendedPath,
    /// Parameter of each waypoint, with `true` for the middle of a leg.
    places: Vec<(f64, bool)>,
}

impl<'a> WithMiddles<'a> {
    fn new(path: &'a BlendedPath) -> Self {
        let waypoints = path.waypoints().into_iter().map(|s| (s, false));
        let mut places: Vec<(f64, bool)> =
            waypoints.chain(path.middles().into_iter().map(|s| (s, true))).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { path, places }
    }
}

impl Path for WithMiddles<'_> {
    fn end(&self) -> f64 {
        self.path.end()
    }

    fn at(&self, s: f64) -> PathPoint {
        self.path.at(s)
    }

    fn waypoint(&self, s: f64) -> Option<usize> {
        self.path.waypoint(s)
    }

    fn breaks(&self) -> Vec<f64> {
        self.path.breaks()
    }

    fn stops(&self) -> Vec<f64> {
        self.path.stops()
    }

    fn waypoints(&self) -> Vec<f64> {
        self.places.iter().map(|place| place.0).collect()
    }
}

/// Returns the time of the fastest motion on a straight line from rest to rest, s, ignoring torque. Speed, acceleration
/// and jerk on the line are the highest values that the joint limits permit.
fn rest_to_rest(from: &JointVec, to: &JointVec, limits: &Limits) -> f64 {
    let least = |limit: &JointVec| {
        let of = |j: usize| limit[j] / (to[j] - from[j]).abs();
        (0..JOINTS).map(of).fold(f64::INFINITY, f64::min)
    };
    let (speed, acceleration, jerk) =
        (least(&limits.velocity), least(&limits.acceleration), least(&limits.jerk));
    // Positions are fractions of the line. The acceleration phase lasts `ramp` seconds. The distance of this phase is
    // half of `ramp` times the speed.
    let ramp = |speed: f64| {
        if speed * jerk < acceleration * acceleration {
            2.0 * (speed / jerk).sqrt()
        } else {
            speed / acceleration + acceleration / jerk
        }
    };
    if speed * ramp(speed) <= 1.0 {
        return ramp(speed) + 1.0 / speed;
    }
    let short = acceleration * acceleration / jerk;
    if 2.0 * short * acceleration / jerk >= 1.0 {
        return 4.0 * (0.5 / jerk).cbrt();
    }
    let top = 0.5 * ((short * short + 4.0 * acceleration).sqrt() - short);
    2.0 * ramp(top)
}
