//! Through waypoints, with given times.
use jtc_wire::Joint;

use crate::along::{Choices, along_at};
use crate::binding::{Binding, LimitKind};
use crate::kinematics::Route;
use crate::path::Waypointed;
use crate::{
    ArmDynamics, BlendedPath, JointVec, Limits, Motion, PlanError, along, choose, p2p, reasons, verify, warp,
};

/// How near a motion passes a waypoint to the time that was given for it, s: half a tick of the controller.
const ON_TIME: f64 = 5e-4;
/// How often the speeds between given times are corrected.
const CORRECTIONS: usize = 60;
/// Share of the time wanted that the speed is lowered to: what is left over is done by running it slower.
const AIM: f64 = 0.98;
/// By how much later than refused a time is sure to be possible, where it was refused only because its neighbours leave nothing over.
const SURE: f64 = 1.05;
/// What is left over of the speed where no time is given, each time that this is not possible, and at least.
const ROOM: f64 = 0.97;
const ROOM_MIN: f64 = 0.8;
/// How often in a row a part may take too long at full speed while its neighbours' speeds are corrected.
const LATE_MAX: usize = 4;
/// The slowest share of the speed.
const SLOWEST: f64 = 1e-4;

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// rad.
    pub position: JointVec,
    /// When the motion is to be nearest to it, s from the start; `None`: as soon as it can be.
    pub time: Option<f64>,
}

impl From<JointVec> for Waypoint {
    fn from(position: JointVec) -> Self {
        Self { position, time: None }
    }
}

/// From the first waypoint to the last, as fast as the limits allow, on straight legs whose corners are rounded within `blend` rad (see
/// [`BlendedPath`]); 0: a stop at each waypoint. Where it is faster the arm stops at a corner, or waypoints closer to each other than the
/// blend are passed on a straighter line, within the blend of each of them. Waypoints that are all the same are a rest of 10 ms.
///
/// A waypoint with a time is passed at that time, to half a millisecond; where it could be earlier, the motion since the waypoint
/// with a time before it is slower; between waypoints at one place the arm rests. Legs without a time after them are as fast as they can be.
///
/// # Errors
///
/// [`PlanError::TooFew`] for fewer than two waypoints, [`PlanError::NotFinite`] and [`PlanError::Position`] for one that is none or
/// outside the limits, [`PlanError::Blend`]; [`PlanError::Time`] for times that do not rise from 0, [`PlanError::TooEarly`] for one
/// that the limits do not allow, and those of [`along`](crate::along).
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
        // Another path may be faster.
        Err(PlanError::TooEarly { .. }) if blend > 0.0 => {
            let chosen = choose::fastest(path, blend, &keep, limits, arm)?;
            on_time(&chosen.path, &given, limits, arm)
        }
        motion => motion,
    }
}

/// From the first waypoint of a route to its last, as fast as the limits allow. `times` are those of its waypoints, as those of [`Waypoint`];
/// they are kept as in [`through`].
///
/// # Errors
///
/// As [`through`].
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

/// A rest at waypoints that are all the same, until the last time that was given.
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

/// Index and time of the waypoints that have one, the first one at 0 in any case.
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

/// A part of a motion between two waypoints with times.
struct Stretch {
    /// Indices of the waypoints.
    from: usize,
    to: usize,
    /// Time wanted, s.
    wanted: f64,
    /// Of the speed.
    share: f64,
    /// How often in a row it took too long at full speed.
    late: usize,
}

impl Stretch {
    fn takes(&self, motion: &Motion) -> f64 {
        motion.waypoint_times[self.to] - motion.waypoint_times[self.from]
    }
}

/// Corrects the speed between every two given times until all are kept.
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
    // Between waypoints at one place the arm rests.
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

/// The same for those between whose waypoints the arm moves: the speed of each is lowered until it takes nearly as long as it is to, and the
/// rest is done by running it at another rate.
fn moving_on_time(
    path: &impl Waypointed,
    stretches: &mut [Stretch],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    let mut choices = Choices::default();
    // Of the speed where no time is given: less where changing the rates leaves nothing over.
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
        // Its neighbours may still become faster, but not those of the fastest motion.
        let most = if attempt == 0 { 0 } else { LATE_MAX };
        if let Some(late) = stretches.iter().find(|s| s.late > most) {
            return Err(too_early(late, motion, limits, arm));
        }
        let is_near = |s: &Stretch| (0.95..=1.0 + 1e-9).contains(&(s.takes(&motion) / s.wanted));
        let between_rests = |s: &Stretch| path.stops_at(s.from) && path.stops_at(s.to);
        if stretches.iter().all(|s| is_near(s) || between_rests(s)) {
            let warped = warp::warped(&motion, &parts(stretches, &motion), limits);
            let warped = verify::finished(warped, limits, arm)?;
            // Errors add up.
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
    // One that is as fast as it can be leaves nothing over for going over from one rate to the next.
    let motion = along_at(path, limits, arm, &|_| 1.0, &mut choices)?;
    let tightness = |s: &&Stretch| s.takes(&motion) / s.wanted;
    match stretches.iter().max_by(|a, b| tightness(a).total_cmp(&tightness(b))) {
        Some(tightest) => Err(too_early(tightest, motion, limits, arm)),
        None => Ok(motion),
    }
}

/// The stretches as parts of a motion, with those between them that have no time.
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

/// What limits a stretch that takes longer than it may.
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

/// Where no limit is used up, the given times bind.
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

/// The joint that moves most at `time`.
fn fastest_joint(motion: &Motion, time: f64) -> Joint {
    let speeds = motion.at(time).velocity;
    let faster = |a: Joint, b: Joint| if speeds[b.index()].abs() > speeds[a.index()].abs() { b } else { a };
    Joint::ALL.into_iter().reduce(faster).unwrap_or(Joint::ALL[0])
}
