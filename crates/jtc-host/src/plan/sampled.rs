//! Conversion of a motion into a trajectory with points at a fixed time step.

use jtc_core::{JOINTS, POINTS_MAX, SetPoint, interpolate};
use jtc_plan::{Motion, State};

use super::{PlanError, STEP_MS};
use crate::trajectory::{Point, Trajectory};

/// Minimum number of steps of a trajectory. A very short motion has fewer steps, so that no step is shorter than
/// [`STEP_MIN_MS`].
const STEPS_MIN: f64 = 20.0;
/// Shortest step of a trajectory, ms. In a shorter step, a position would change by less than its rounding.
const STEP_MIN_MS: f64 = 2.0;
/// Longest step that a trajectory frame can contain, ms.
const STEP_MAX_MS: f64 = 1000.0;
/// Maximum deviation of a trajectory from the motion between two points, rad.
const ASIDE: f64 = 1e-3;
/// Minimum number of points for each sharp corner. With fewer points, the trajectory deviates more from the motion.
/// At a sharp corner, both segments are longer than `CORNER_LEG` (rad). In addition, the unit directions of the
/// segments differ by more than `CORNER_TURN` in at least one joint.
const CORNER_POINTS: usize = 3;
const CORNER_TURN: f64 = 0.5;
const CORNER_LEG: f64 = 0.05;
/// Number of positions that are checked between two points.
const PARTS: usize = 4;

/// Trajectory that was created from a motion.
pub(super) struct Sampled {
    pub trajectory: Trajectory,
    /// Ratio of the times in the trajectory to the times in the motion.
    pub scale: f64,
}

/// Returns the time step for a motion of this duration, ms.
///
/// # Errors
///
/// Returns [`PlanError::TooLong`] if the controller cannot store a motion of this duration.
pub(super) fn step_ms(seconds: f64) -> Result<u16, PlanError> {
    let fits = (seconds * 1e3 / (POINTS_MAX - 1) as f64).ceil();
    let short = (seconds * 1e3 / STEPS_MIN).floor().clamp(STEP_MIN_MS, f64::from(STEP_MS));
    let step = fits.max(short);
    if step <= STEP_MAX_MS { Ok(step as u16) } else { Err(PlanError::TooLong { seconds }) }
}

/// Converts the motion into a trajectory. The duration of the motion is first multiplied by `stretch`. A trajectory
/// has a whole number of steps, so the motion is slowed down further until it fills the last step. If `kept` is
/// `true`, the motion is not slowed down further, and the arm rests until the end of the last step. The first point
/// of the trajectory is `first`, and the last point is exactly the end of the motion.
///
/// # Errors
///
/// Returns [`PlanError::TooFine`] if the time step is too long for the corners of the motion.
pub(super) fn sampled(
    motion: &Motion,
    first: &[f64; JOINTS],
    stretch: f64,
    step_ms: u16,
    kept: bool,
) -> Result<Sampled, PlanError> {
    let h = f64::from(step_ms) * 1e-3;
    let seconds = motion.duration() * stretch;
    let steps = ((seconds / h - 1e-6).ceil() as usize).clamp(1, POINTS_MAX - 1);
    let scale = if kept { stretch } else { steps as f64 * h / motion.duration() };
    let end = motion.at(motion.duration());
    let rest = Point { position: end.position, ..Point::default() };
    let at = |t: f64| slowed(&motion.at(t / scale), scale);
    let mut points: Vec<Point> = (0..steps).map(|k| at(k as f64 * h)).collect();
    // The first point is exactly the requested position, at rest. If the acceleration jumps at the start, the values
    // before and after the jump are both correct, so the acceleration is not changed.
    if let Some(point) = points.first_mut() {
        (point.position, point.velocity) = (*first, [0.0; JOINTS]);
    }
    points.push(rest);
    let aside = aside(&points, h, at);
    if aside > ASIDE && step_ms > STEP_MS {
        return Err(PlanError::TooFine { seconds, step_ms });
    }
    Ok(Sampled { trajectory: Trajectory { step_ms, points }, scale })
}

/// Rejects waypoints with more sharp corners than the points of a trajectory can represent.
///
/// # Errors
///
/// Returns [`PlanError::TooManyCorners`] if the waypoints have too many sharp corners.
pub(super) fn fits_corners(positions: &[[f64; JOINTS]], blend: f64) -> Result<(), PlanError> {
    let most = (POINTS_MAX - 1) / CORNER_POINTS;
    let leg = |pair: &[[f64; JOINTS]]| {
        let way: [f64; JOINTS] = std::array::from_fn(|j| pair[1][j] - pair[0][j]);
        (way, way.iter().map(|w| w.abs()).fold(0.0, f64::max))
    };
    let is_sharp = |three: &&[[f64; JOINTS]]| {
        let ((a, long), (b, longer)) = (leg(&three[..2]), leg(&three[1..]));
        let turn = (0..JOINTS).map(|j| (b[j] / longer - a[j] / long).abs()).fold(0.0, f64::max);
        long.min(longer) > CORNER_LEG.max(blend) && turn > CORNER_TURN
    };
    let corners = positions.windows(3).filter(is_sharp).count();
    if corners > most { Err(PlanError::TooManyCorners { corners, most }) } else { Ok(()) }
}

/// Returns a lower bound for the duration (s) of a motion through `positions` with at most the joint velocities `velocity` (rad/s). The
/// motion passes each position within `blend` rad.
pub(super) fn least_s(positions: &[[f64; JOINTS]], blend: f64, velocity: &[f64; JOINTS]) -> f64 {
    let leg = |pair: &[[f64; JOINTS]]| {
        let way = |j: usize| (pair[1][j] - pair[0][j]).abs() - 2.0 * blend;
        (0..JOINTS).map(|j| way(j) / velocity[j]).fold(0.0, f64::max)
    };
    positions.windows(2).map(leg).sum()
}

fn slowed(state: &State, scale: f64) -> Point {
    Point {
        position: state.position,
        velocity: state.velocity.map(|v| v / scale),
        acceleration: state.acceleration.map(|a| a / (scale * scale)),
    }
}

/// Returns the largest deviation of the controller's interpolation from the motion between the points, rad.
fn aside(points: &[Point], h: f64, at: impl Fn(f64) -> Point) -> f64 {
    let mut most = 0.0f64;
    for (i, pair) in points.windows(2).enumerate() {
        for part in 1..PARTS {
            let u = part as f64 / PARTS as f64;
            let curve = interpolate(&SetPoint::from(&pair[0]), &SetPoint::from(&pair[1]), h, u);
            let motion = at((i as f64 + u) * h);
            for j in 0..JOINTS {
                most = most.max((curve.position[j] - motion.position[j]).abs());
            }
        }
    }
    most
}
