//! Motions through waypoints. Waypoints may have specified times.
use jtc_wire::Joint;

use crate::along::{Choices, along_at};
use crate::binding::{Binding, LimitKind};
use crate::kinematics::Route;
use crate::path::Waypointed;
use crate::{
    ArmDynamics, BlendedPath, JointVec, Limits, Motion, PlanError, along, choose, p2p, reasons, verify, warp,
};

/// Maximum deviation from the specified time of a waypoint, s. The value is half a tick of the controller.
const ON_TIME: f64 = 5e-4;
/// Maximum number of corrections of the speeds between specified times.
const CORRECTIONS: usize = 60;
/// Target duration of a part that is slowed down, as a share of the requested duration. A uniform slowdown then adds
/// the missing time.
const AIM: f64 = 0.98;
/// Minimum ratio of the reported shortest time to the specified time, if only the adjacent legs prevent the specified
/// time. The planner can always keep a time that is longer by this factor.
const SURE: f64 = 1.05;
/// Factor that reduces the speed of parts without a specified time after each failed attempt. `ROOM_MIN` is the
/// lowest speed factor of these parts.
const ROOM: f64 = 0.97;
const ROOM_MIN: f64 = 0.8;
/// Maximum number of consecutive attempts in which a part takes too long at full speed. The speeds of the adjacent
/// parts are corrected in these attempts.
const LATE_MAX: usize = 4;
/// Lowest speed factor.
const SLOWEST: f64 = 1e-4;

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Position, rad.
    pub position: JointVec,
    /// Time at which the motion is nearest to the waypoint, in seconds after the start. If the value is `None`, the motion passes the
    /// waypoint as soon as possible.
    pub time: Option<f64>,
}

impl From<JointVec> for Waypoint {
    fn from(position: JointVec) -> Self {
        Self { position, time: None }
    }
}

/// Plans a motion from the first waypoint to the last, as fast as the limits permit, on straight legs. Corners are
/// rounded within `blend` rad (see [`BlendedPath`]). If `blend` is 0, the arm stops at each waypoint. If a stop at a
/// corner takes less time than a rounded corner, the arm stops. Waypoints that are closer to each other than the blend
/// may be passed on a straighter line, if this is faster. This line is within the blend of each waypoint. If all
/// waypoints are equal, the arm stays at rest for 10 ms.
///
/// The motion passes a waypoint that has a specified time within half a millisecond of this time. If an earlier time is
/// possible, the motion between the previous waypoint with a time and this waypoint is slowed down. If these two
/// waypoints are at the same position, the arm stays at rest between the two times. Legs after the last specified time
/// are as fast as possible.
///
/// # Errors
///
/// Returns [`PlanError::TooFew`] for fewer than two waypoints. Returns [`PlanError::NotFinite`] and [`PlanError::Position`] for a waypoint
/// that is invalid or outside the limits. Returns [`PlanError::Blend`] for an invalid blend. Returns [`PlanError::Time`] for times that do
/// not increase from 0. Returns [`PlanError::TooEarly`] for a time that the limits do not permit. Also returns the errors of
/// [`along`](crate::along).
pub fn through(
    waypoints: &[Waypoint],
    blend: f64,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    limits.check()?;
    for (i, waypoint) in waypoints.iter().enumerate() {
        limits.holds(&waypoint.position, i + 1)?;
    }
    let given = given_times(waypoints)?;
    let positions: Vec<JointVec> = waypoints.iter().map(|w| w.position).collect();
    if !(blend >= 0.0 && blend.is_finite()) {
        return Err(PlanError::Blend { value: blend });
    }
    if let [first, others @ ..] = &positions[..]
        && !others.is_empty()
        && others.iter().all(|p| BlendedPath::are_one(first, p))
    {
        return verify::finished(rest(&positions, &given), limits, arm);
    }
    let path = BlendedPath::new(&positions, blend)?;
    let keep = |i: usize| waypoints[i].time.is_some();
    if given.len() < 2 {
        let chosen = choose::fastest(path, blend, &keep, limits, arm)?;
        return Ok(reasons::explained(chosen.motion, limits, arm));
    }
    match on_time(&path, &given, limits, arm) {
        // Another path within the blends of the waypoints can be fast enough.
        Err(PlanError::TooEarly { .. }) if blend > 0.0 => {
            let chosen = choose::fastest(path, blend, &keep, limits, arm)?;
            on_time(&chosen.path, &given, limits, arm)
        }
        motion => motion,
    }
}

/// Plans a motion from the first waypoint of a route to the last waypoint, as fast as the limits permit. `times`
/// contains the times of the waypoints, as in [`Waypoint`] and [`through`].
///
/// # Errors
///
/// Returns the errors of [`through`].
pub fn on_route(
    route: &Route,
    times: &[Option<f64>],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    limits.check()?;
    let time = |i: usize| times.get(i).copied().flatten();
    let waypoints = route.positions().iter().enumerate();
    let waypoints: Vec<Waypoint> =
        waypoints.map(|(i, &position)| Waypoint { position, time: time(i) }).collect();
    for (i, waypoint) in waypoints.iter().enumerate() {
        limits.holds(&waypoint.position, i + 1)?;
    }
    let given = given_times(&waypoints)?;
    if given.len() < 2 { along(route, limits, arm) } else { on_time(route, &given, limits, arm) }
}

/// Returns a motion without movement for equal waypoints, which ends at the last specified time.
fn rest(positions: &[JointVec], given: &[(usize, f64)]) -> Motion {
    let mut rest = p2p::standing(&positions[0], &positions[positions.len() - 1], positions.len());
    let last = given[given.len() - 1];
    let end = if last.0 > 0 && last.0 + 1 == positions.len() { last.1 } else { last.1 + rest.duration() };
    rest = rest.stretched(end / rest.duration());
    for (i, time) in rest.waypoint_times.iter_mut().enumerate().take(positions.len() - 1) {
        *time = given[given.partition_point(|g| g.0 <= i) - 1].1;
    }
    rest
}

/// Returns the index and the time of each waypoint that has a time. The first waypoint always has the time 0.
fn given_times(waypoints: &[Waypoint]) -> Result<Vec<(usize, f64)>, PlanError> {
    let mut given: Vec<(usize, f64)> = vec![(0, 0.0)];
    for (i, waypoint) in waypoints.iter().enumerate() {
        let Some(time) = waypoint.time else { continue };
        let before = given[given.len() - 1].1;
        let right = if i == 0 { time == 0.0 } else { time > before && time.is_finite() };
        if !right {
            return Err(PlanError::Time { waypoint: i + 1, time, before });
        }
        if i > 0 {
            given.push((i, time));
        }
    }
    Ok(given)
}

/// Part of a motion between two waypoints with specified times.
struct Stretch {
    /// Indices of the two waypoints.
    from: usize,
    to: usize,
    /// Specified duration, s.
    wanted: f64,
    /// Speed factor.
    share: f64,
    /// Number of consecutive attempts in which this part of the motion took too long at full speed.
    late: usize,
}

impl Stretch {
    fn takes(&self, motion: &Motion) -> f64 {
        motion.waypoint_times[self.to] - motion.waypoint_times[self.from]
    }
}

/// Corrects the speeds between consecutive specified times until the motion keeps all times.
fn on_time(
    path: &impl Waypointed,
    given: &[(usize, f64)],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    let between = |pair: &[(usize, f64)]| Stretch {
        from: pair[0].0,
        to: pair[1].0,
        wanted: pair[1].1 - pair[0].1,
        share: 1.0,
        late: 0,
    };
    // Between two waypoints at the same position, the arm is at rest.
    let (rests, mut stretches): (Vec<Stretch>, Vec<Stretch>) =
        given.windows(2).map(between).partition(|s| path.is_one_place(s.from, s.to));
    let motion = moving_on_time(path, &mut stretches, limits, arm)?;
    let mut reasons = reasons::find(&motion, limits, arm);
    with_given_times(&mut reasons.used_up, &motion, &stretches);
    let binding = reasons.joined(motion.duration());
    let mut motion = Motion { binding, ..motion };
    for rest in rests {
        motion.rest_at(rest.from, rest.wanted);
    }
    Ok(motion)
}

/// Makes the motion keep the specified times in the stretches (parts between two specified times) in which the arm
/// moves. Reduces the speed of each stretch until its duration is close to the specified duration. The module `warp`
/// then corrects the remaining difference.
fn moving_on_time(
    path: &impl Waypointed,
    stretches: &mut [Stretch],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    let mut choices = Choices::default();
    // Speed factor for the parts without a specified time. The factor is reduced if the limits leave no margin for
    // the transitions between the speeds of adjacent parts.
    let mut room = 1.0f64;
    for attempt in 0..CORRECTIONS {
        let share_of = |waypoint: usize| {
            let at = stretches.partition_point(|s| s.to < waypoint);
            stretches.get(at).filter(|s| s.from < waypoint).map_or(room, |s| s.share)
        };
        let motion = along_at(path, limits, arm, &share_of, &mut choices)?;
        for s in stretches.iter_mut() {
            let is_late = s.share >= 1.0 && s.takes(&motion) > s.wanted + ON_TIME;
            s.late = if is_late { s.late + 1 } else { 0 };
        }
        // A part that takes too long can still become faster if the adjacent parts become faster. In the first
        // attempt all parts have their highest speed, so none of them can become faster.
        let most = if attempt == 0 { 0 } else { LATE_MAX };
        if let Some(late) = stretches.iter().find(|s| s.late > most) {
            return Err(too_early(late, motion, limits, arm));
        }
        let is_near = |s: &Stretch| (0.95..=1.0 + 1e-9).contains(&(s.takes(&motion) / s.wanted));
        let between_rests = |s: &Stretch| path.stops_at(s.from) && path.stops_at(s.to);
        if stretches.iter().all(|s| is_near(s) || between_rests(s)) {
            let warped = warp::warped(&motion, &parts(stretches, &motion), limits);
            let warped = verify::finished(warped, limits, arm)?;
            // The time error at a waypoint is the sum of the errors of all parts before this waypoint.
            let mut off = 0.0;
            let on_time = stretches.iter().all(|s| {
                off += s.takes(&warped) - s.wanted;
                f64::abs(off) < 0.9 * ON_TIME
            });
            if on_time {
                return Ok(warped);
            }
            room = (room * ROOM).max(ROOM_MIN);
        }
        for s in stretches.iter_mut() {
            let wrong = s.takes(&motion) / (AIM * s.wanted);
            let damped = if attempt == 0 { wrong } else { wrong.powf(0.7) };
            s.share = (s.share * damped).clamp(SLOWEST, 1.0);
        }
    }
    // All attempts have failed: next to a part at full speed, the limits leave no margin for a change of speed. The
    // error reports the part with the highest ratio of planned duration to specified duration.
    let motion = along_at(path, limits, arm, &|_| 1.0, &mut choices)?;
    let tightness = |s: &&Stretch| s.takes(&motion) / s.wanted;
    match stretches.iter().max_by(|a, b| tightness(a).total_cmp(&tightness(b))) {
        Some(tightest) => Err(too_early(tightest, motion, limits, arm)),
        None => Ok(motion),
    }
}

/// Returns all parts of the motion for a change of its timing: the stretches between two specified times, and the
/// parts without a specified time.
fn parts(stretches: &[Stretch], motion: &Motion) -> Vec<warp::Part> {
    let times = &motion.waypoint_times;
    let mut parts = Vec::with_capacity(stretches.len() + 1);
    let mut before = 0.0;
    for s in stretches {
        if times[s.from] > before {
            parts.push(warp::Part { end: times[s.from], wanted: times[s.from] - before });
        }
        parts.push(warp::Part { end: times[s.to], wanted: s.wanted });
        before = times[s.to];
    }
    if motion.duration() > before {
        parts.push(warp::Part { end: motion.duration(), wanted: motion.duration() - before });
    }
    parts
}

/// Returns the error for a part between two specified times that takes too long, with the limit that determines its
/// duration.
fn too_early(late: &Stretch, motion: Motion, limits: &Limits, arm: Option<&ArmDynamics>) -> PlanError {
    let motion = reasons::explained(motion, limits, arm);
    let (from, to) = (motion.waypoint_times[late.from], motion.waypoint_times[late.to]);
    let inside = |b: &Binding| (b.to.min(to) - b.from.max(from)).max(0.0);
    let mut longest = (Joint::ALL[0], LimitKind::Velocity, 0.0);
    for b in motion.binding() {
        let same = |other: &&Binding| other.joint == b.joint && other.limit == b.limit;
        let time: f64 = motion.binding().iter().filter(same).map(inside).sum();
        if time > longest.2 {
            longest = (b.joint, b.limit, time);
        }
    }
    PlanError::TooEarly {
        from: late.from + 1,
        waypoint: late.to + 1,
        joint: longest.0,
        limit: longest.1,
        given: late.wanted,
        shortest: (to - from).max(SURE * late.wanted),
    }
}

/// If no limit is reached in an interval, adds the specified times as its binding limit.
fn with_given_times(binding: &mut Vec<Binding>, motion: &Motion, stretches: &[Stretch]) {
    let mut all: Vec<Binding> = Vec::new();
    for s in stretches {
        let (from, to) = (motion.waypoint_times[s.from], motion.waypoint_times[s.to]);
        let mut next = from;
        for b in binding.iter().filter(|b| b.to > from && b.from < to) {
            if b.from > next {
                all.push(Binding { from: next, to: b.from, joint: b.joint, limit: LimitKind::GivenTime });
            }
            next = b.to;
        }
        let joint = fastest_joint(motion, 0.5 * (from + to));
        if next < to {
            all.push(Binding { from: next, to, joint, limit: LimitKind::GivenTime });
        }
    }
    binding.append(&mut all);
    binding.sort_by(|a, b| a.from.total_cmp(&b.from));
}

/// Returns the joint that moves most at `time`.
fn fastest_joint(motion: &Motion, time: f64) -> Joint {
    let speeds = motion.at(time).velocity;
    let faster = |a: Joint, b: Joint| if speeds[b.index()].abs() > speeds[a.index()].abs() { b } else { a };
    Joint::ALL.into_iter().reduce(faster).unwrap_or(Joint::ALL[0])
}
