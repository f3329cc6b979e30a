//! Computation of time laws for paths. A time law is the path parameter as a function of time.
use jtc_wire::Joint;

use crate::cells::{Cell, cells};
use crate::compose::Section;
use crate::law::Law;
use crate::motion::Motion;
use crate::path::Path;
use crate::{ArmDynamics, Limits, PlanError, jerk, reach, reasons, verify};

/// Plans the fastest motion from rest to rest along a path within the limits of velocity, acceleration and torque. The
/// method is time-optimal path parameterisation by reachability analysis (Pham and Pham 2018). If the limits include a
/// jerk limit, the law is averaged over a time window, and then an interior-point method shortens it. The
/// interior-point method evaluates velocity, acceleration, jerk and torque at points along the path. Every motion is
/// also verified between its samples, and is slowed down until it keeps all limits.
///
/// # Errors
///
/// Returns [`PlanError::Limit`] and [`PlanError::Range`] for limits that permit no motion. Returns
/// [`PlanError::Position`] and [`PlanError::Path`] if the path is partly outside the limits or has no direction.
/// Returns [`PlanError::Torque`] if the torque is too small at every speed.
pub fn along(path: &dyn Path, limits: &Limits, arm: Option<&ArmDynamics>) -> Result<Motion, PlanError> {
    unexplained(path, limits, arm).map(|motion| reasons::explained(motion, limits, arm))
}

/// Like [`along`], but does not determine the limiting constraints.
pub(crate) fn unexplained(
    path: &dyn Path,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    along_at(path, limits, arm, &|_| 1.0, &mut Choices::default())
}

/// Planning method that was chosen for each section of a path. If a slightly changed path is planned, the planner
/// reuses these methods, so that the time law also changes only slightly.
#[derive(Debug, Default)]
pub(crate) struct Choices(Vec<Option<Choice>>);

/// Planning method for a section of a path from one stop to the next.
#[derive(Clone, Copy, Debug)]
enum Choice {
    InteriorPoint,
    /// Time law without a jerk limit (`None`), or time law averaged over a time window with these shares of the
    /// limits.
    Other(Option<jerk::Shares>),
}

/// Like [`unexplained`], with a speed factor that depends on the last passed waypoint (counted from 1).
pub(crate) fn along_at(
    path: &dyn Path,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
    share: &dyn Fn(usize) -> f64,
    choices: &mut Choices,
) -> Result<Motion, PlanError> {
    limits.check()?;
    let limits_of_motion = verify::with_table(limits, arm);
    let rests = std::iter::once(0.0).chain(path.stops()).chain([path.end()]);
    for s in rests.filter(|s| s.is_finite()) {
        verify::holds(&path.at(s).position, first_waypoint(path, s), limits, arm)?;
    }
    let mut motion: Option<Motion> = None;
    for (i, section) in sections(path)?.iter().enumerate() {
        if choices.0.len() <= i {
            choices.0.push(None);
        }
        let planned = of_section(section, &limits_of_motion, arm, share, &mut choices.0[i])?;
        let planned = verify::within_kinematics(planned, &limits_of_motion)?;
        match &mut motion {
            None => motion = Some(planned),
            Some(motion) => motion.append(&planned),
        }
    }
    let motion = motion.ok_or(PlanError::Path { leg: 1, parameter: 0.0 })?;
    verify::finished(motion, limits, arm)
}

/// Returns the number (from 1) of the first waypoint at `s`, because several consecutive waypoints can have the same
/// position. Without a waypoint at `s`, returns the last passed waypoint.
fn first_waypoint(path: &dyn Path, s: f64) -> usize {
    let passed = |s: f64| if s < 0.0 { 0 } else { path.waypoint(s).unwrap_or(1) };
    passed(s).min(passed(s.next_down()) + 1)
}

/// Returns the sections of the path. A section goes from one stop to the next.
fn sections(path: &dyn Path) -> Result<Vec<Section<'_>>, PlanError> {
    let end = path.end();
    if !(end.is_finite() && end > 0.0) {
        return Err(PlanError::Path { leg: 1, parameter: end });
    }
    let inside = |places: Vec<f64>| -> Vec<f64> {
        let mut places: Vec<f64> = places.into_iter().filter(|s| *s > 0.0 && *s < end).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        places
    };
    let (stops, breaks, waypoints) = (inside(path.stops()), inside(path.breaks()), path.waypoints());
    let ends = |places: &[f64]| -> Vec<f64> {
        std::iter::once(0.0).chain(places.iter().copied()).chain([end]).collect()
    };
    let between = |places: &[f64], from: f64, to: f64| -> Vec<f64> {
        let first = places.partition_point(|s| *s <= from);
        places[first..].iter().copied().take_while(|s| *s < to).collect()
    };
    let ends = ends(&stops);
    let sections = ends.windows(2).map(|pair| {
        let (from, to) = (pair[0], pair[1]);
        let mut of_section = between(&waypoints, from, to);
        // Counts the waypoints at one parameter of the path, which can be more than one.
        let at = |place: f64| {
            waypoints.partition_point(|s| *s <= place) - waypoints.partition_point(|s| *s < place)
        };
        let first = if from == 0.0 { at(from).max(1) - 1 } else { 0 };
        of_section.splice(0..0, std::iter::repeat_n(from, first));
        of_section.extend(std::iter::repeat_n(to, at(to)));
        let parts_of_path = breaks.len() + 1;
        Section { path, from, to, breaks: between(&breaks, from, to), waypoints: of_section, parts_of_path }
    });
    Ok(sections.collect())
}

fn of_section(
    section: &Section,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
    share: &dyn Fn(usize) -> f64,
    chosen: &mut Option<Choice>,
) -> Result<Motion, PlanError> {
    let leg = section.path.waypoint(section.from).unwrap_or(1);
    let cells = cells(section, arm, limits, !limits.has_jerk())?;
    let shares: Vec<f64> = cells
        .iter()
        .map(|cell| share(section.path.waypoint(section.from + 0.5 * (cell.from + cell.to)).unwrap_or(leg)))
        .collect();
    let caps = caps(section, &cells, limits, arm)?;
    let plan = Plan { section, cells: &cells, reached: caps.clone(), caps, shares, limits, arm };
    // On a straight line without torque limits, the time law averaged over a time window is already the fastest.
    let is_straight = cells.iter().all(Cell::is_straight);
    let found = match *chosen {
        Some(Choice::Other(_)) => None,
        _ if !limits.has_jerk() || (is_straight && arm.is_none()) => None,
        _ => jerk::interior(&plan, INTERIOR_REPAIRS),
    };
    if let Some(motion) = &found
        && (chosen.is_some() || (!is_straight && cells.len() > FEW))
    {
        *chosen = Some(Choice::InteriorPoint);
        return Ok(motion.clone());
    }
    let shares = if let Some(Choice::Other(shares)) = *chosen { shares } else { None };
    let failed = |reason| PlanError::NoTimeLaw { leg, reason };
    let (motion, shares) = without_interior(plan, shares).map_err(failed)?;
    match found {
        Some(found) if found.duration() < motion.duration() => {
            *chosen = Some(Choice::InteriorPoint);
            Ok(found)
        }
        _ => {
            *chosen = Some(Choice::Other(shares));
            Ok(motion)
        }
    }
}

/// Returns the motion of a time law without the interior-point method. The time law has no jerk limit, or is averaged
/// over a time window with the chosen shares of the limits.
fn without_interior(
    mut plan: Plan,
    shares: Option<jerk::Shares>,
) -> Result<(Motion, Option<jerk::Shares>), String> {
    let Some(arm) = plan.arm.take() else {
        let made = plan.make(shares, REPAIRS)?;
        return Ok((made.motion, made.shares));
    };
    let mut made = plan.make(shares, 0)?;
    let shares = made.shares;
    // Friction is evaluated up to the highest speed in each cell. Each round estimates this highest speed more
    // accurately.
    plan.arm = Some(arm);
    let mut best: Option<Motion> = None;
    for _ in 0..TORQUE_ROUNDS {
        plan.reached = plan.reached_by(&made.law);
        made = plan.make(made.shares, REPAIRS)?;
        let before = best.as_ref().map_or(f64::INFINITY, Motion::duration);
        let shorter = made.motion.duration() < (1.0 - WORTH) * before;
        if made.motion.duration() < before {
            best = Some(made.motion);
        }
        if !shorter || !arm.has_friction() {
            break;
        }
    }
    Ok((best.ok_or("the time of the motion is not finite")?, shares))
}

/// Returns the highest squared path speed in each cell (short interval of the path) that the velocity limits and the
/// friction permit.
fn caps(
    section: &Section,
    cells: &[Cell],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Vec<f64>, PlanError> {
    let cap = |cell: &Cell| {
        let cap = cell.speed_cap(limits);
        let Some(arm) = arm else { return Ok(cap) };
        cell.friction_cap(cap, limits, arm).map_err(|(joint, torque, limit): (Joint, f64, f64)| {
            let waypoint = section.path.waypoint(section.from + cell.from).unwrap_or(1);
            let whole = limits.torque[joint.index()];
            PlanError::Torque { waypoint, joint, torque, limit, whole, holding: false }
        })
    };
    cells.iter().map(cap).collect()
}

/// Data from which a time law is computed. A cell is a short interval of the path.
pub(crate) struct Plan<'a> {
    pub section: &'a Section<'a>,
    pub cells: &'a [Cell],
    /// Highest squared path speed in each cell.
    pub caps: Vec<f64>,
    /// Estimate of the highest squared path speed in each cell. Friction is evaluated up to this speed.
    pub reached: Vec<f64>,
    /// Factor that reduces the path speed in each cell.
    pub shares: Vec<f64>,
    pub limits: &'a Limits,
    pub arm: Option<&'a ArmDynamics<'a>>,
}

/// A time law and the motion that results from it.
pub(crate) struct Made {
    pub law: Law,
    pub motion: Motion,
    /// Shares of the limits that a time law with a jerk limit uses; `None` for a time law without a jerk limit.
    pub shares: Option<jerk::Shares>,
}

/// Number of repairs of a time law that the interior-point method has found. A repair slows down each cell of the
/// path in which a limit is violated between samples.
const INTERIOR_REPAIRS: usize = 1;
/// Largest number of path cells for which time laws averaged over a time window are also tried.
const FEW: usize = 200;
/// Maximum number of rounds in which a section is planned with torque limits.
const TORQUE_ROUNDS: usize = 4;
/// Minimum reduction of the duration by a round, as a share of the duration. If a round reduces the duration by less,
/// it is the last round.
const WORTH: f64 = 0.004;
/// Largest ratio of a cell's speeds in two consecutive rounds.
const FASTER: f64 = 1.1;

/// Maximum number of repairs. A repair slows down the cells of the path in which a limit is violated between samples.
/// If a limit is still violated after the last repair, the whole motion is slowed down.
const REPAIRS: usize = 4;
/// Largest time factor (new duration divided by old duration) for which no repair is made. If all cells need at most
/// this factor, the whole motion is slowed down instead.
const LEFT_OVER: f64 = 1.001;

impl Plan<'_> {
    /// Returns the time law and its motion. Cells in which a limit is violated between the samples are slowed down up to `repairs`
    /// times.
    fn make(&self, shares: Option<jerk::Shares>, repairs: usize) -> Result<Made, String> {
        if self.limits.has_jerk() { jerk::limited(self, shares, repairs) } else { self.without_jerk(repairs) }
    }

    /// Returns a squared speed for each cell. This speed is slightly above the highest squared speed of `law` in this
    /// cell, but not above the cap of the cell.
    fn reached_by(&self, law: &Law) -> Vec<f64> {
        let speed = |s: f64| law.at(law.time_of(s)).1;
        let mut before = 0.0;
        let cells = self.cells.iter().zip(&self.caps).map(|(cell, &cap)| {
            let (middle, after) = (speed(0.5 * (cell.from + cell.to)), speed(cell.to));
            let fastest = FASTER * after.max(middle).max(before);
            before = after;
            cap.min(fastest * fastest)
        });
        cells.collect()
    }

    fn without_jerk(&self, repairs: usize) -> Result<Made, String> {
        let slow = self.caps.iter().zip(&self.shares).map(|(cap, share)| cap * share * share);
        let mut caps: Vec<f64> = slow.zip(&self.reached).map(|(cap, reached)| cap.min(*reached)).collect();
        let mut shares: Vec<f64> = self.shares.iter().map(|s| s * s).collect();
        let mut repaired = 0;
        loop {
            let vertices = reach::fastest(self.cells, &caps, &shares, self.limits, self.arm)?;
            let law = Law::of_vertices(&vertices);
            let motion = self.section.motion(&law, self.limits);
            if repairs == 0 {
                return Ok(Made { law, motion, shares: None });
            }
            let slower = self.slower(&motion, &law, true);
            let worst = slower.iter().copied().fold(1.0, f64::max);
            if worst <= LEFT_OVER || repaired == repairs {
                return Ok(Made { law, motion, shares: None });
            }
            repaired += 1;
            for ((cap, share), slower) in caps.iter_mut().zip(&mut shares).zip(slower) {
                *cap /= slower * slower;
                *share /= slower * slower;
            }
        }
    }

    /// Returns, for each cell, the time factor (new duration divided by old duration) that makes the motion keep all
    /// limits.
    pub(crate) fn slower(&self, motion: &Motion, law: &Law, with_torque: bool) -> Vec<f64> {
        let mut slower = vec![1.0f64; self.cells.len()];
        for piece in &motion.pieces {
            let mut stretch = verify::kinematic_stretch(piece, self.limits);
            if let Some(arm) = self.arm.filter(|_| with_torque) {
                stretch = stretch.max(verify::torque_stretch(piece, self.limits, arm));
            }
            if stretch <= 1.0 {
                continue;
            }
            let (from, to) = (law.at(piece.start).0, law.at(piece.start + piece.length).0);
            let first = self.cells.partition_point(|c| c.to <= from);
            for (cell, slower) in self.cells[first..].iter().zip(&mut slower[first..]) {
                if cell.from >= to {
                    break;
                }
                *slower = slower.max(1.0 + 1.1 * (stretch.min(3.0) - 1.0));
            }
        }
        slower
    }
}
