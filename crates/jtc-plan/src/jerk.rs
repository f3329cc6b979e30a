//! Time laws with limited jerk.
//!
//! The fastest law with limited speed and acceleration of the parameter is averaged over a time window. The averaging
//! changes each jump of the acceleration into a ramp as long as the window. If the window is as long as the
//! acceleration divided by the jerk limit, the law keeps the jerk limit. [`crate::profile`] ensures that the averaged
//! law keeps the limits of the cells around it.
use crate::along::{Made, Plan};
use crate::cells::Cell;
use crate::interior::Search;
use crate::law::Law;
use crate::motion::Motion;
use crate::profile::{self, Bounds};
use crate::{JOINTS, Limits};

/// Factor of the acceleration from one attempt to the next. A lower acceleration results in shorter acceleration
/// ramps.
const LOWER: f64 = 0.7;
/// Maximum number of accelerations that are tried.
const ATTEMPTS: usize = 24;
/// Shares of the acceleration and jerk limits that the curvature may use, in the order of the attempts. The first
/// share is for motions with constant speed in curves. The second share leaves a margin for changes of the speed in
/// curves.
const CURVATURE_SHARES: [f64; 2] = [0.97, 0.7];
/// Largest time factor (new duration divided by old duration) for which no cell is slowed down further. If all cells
/// need at most this factor, the whole motion is slowed down instead.
const LEFT_OVER: f64 = 1.002;
/// Like [`LEFT_OVER`], for a time law that the interior-point method has found.
const LITTLE: f64 = 1.005;
/// Share of the jerk limit from which the length of the window is computed.
const JERK_SHARE: f64 = 0.995;

/// Shares of the limits that a time law uses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shares {
    /// Share of the acceleration along the path.
    acceleration: f64,
    /// Share of the acceleration and jerk limits that the curvature may use.
    curvature: f64,
}

/// Returns the best of several time laws with different shares of the limits. If `shares` is set, returns the time
/// law with these shares.
pub(crate) fn limited(plan: &Plan, shares: Option<Shares>, repairs: usize) -> Result<Made, String> {
    let none = || String::from("no attempt took a finite time");
    let shares = shares.or_else(|| best_shares(plan)).ok_or_else(none)?;
    let bounds = bounds(plan, shares);
    let mut best = Attempt::new(plan, &bounds, true);
    best.repair(plan, bounds, repairs);
    if !best.duration().is_finite() {
        return Err(none());
    }
    Ok(Made { law: best.law, motion: best.motion, shares: Some(shares) })
}

/// Shares of the limits for the time law from which the interior-point method starts.
const SEED: Shares = Shares { acceleration: LOWER * LOWER, curvature: CURVATURE_SHARES[0] };

/// Returns the motion found by the interior-point method, if it is faster than the time law from which the method
/// starts.
pub(crate) fn interior(plan: &Plan, repairs: usize) -> Option<Motion> {
    let bounds = bounds(plan, SEED);
    let window = window(plan.cells, &bounds, plan.limits);
    let seed = Law::of_vertices(&profile::fastest(&bounds, window)).averaged(window);
    let mut slower = vec![1.0; plan.cells.len()];
    let mut search = Search::new(plan, &seed)?;
    let mut best: Option<Attempt> = None;
    for repaired in 0..=repairs {
        let Some(law) = search.fastest(&slower) else { break };
        let motion = plan.section.motion(&law, plan.limits);
        let next = Attempt { slower: plan.slower(&motion, &law, true), law, motion };
        slower.iter_mut().zip(&next.slower).for_each(|(all, s)| *all *= s);
        let done = repaired == repairs || next.slower.iter().all(|s| *s <= LITTLE);
        if best.as_ref().is_none_or(|best| next.duration() < best.duration()) {
            best = Some(next);
        }
        if done {
            break;
        }
    }
    best.filter(|best| best.duration() < seed.duration()).map(|best| best.motion)
}

/// Returns the shares that give the motion with the shortest duration, ignoring torque.
fn best_shares(plan: &Plan) -> Option<Shares> {
    let duration = |shares| Attempt::new(plan, &bounds(plan, shares), false).duration();
    let mut best: Option<(Shares, f64)> = None;
    let mut take = |shares| {
        let duration = duration(shares);
        let better = duration.is_finite() && best.is_none_or(|(_, least)| duration < least);
        if better {
            best = Some((shares, duration));
        }
        (better, best.map(|(shares, _)| shares))
    };
    let mut acceleration = 1.0;
    let mut worse = 0;
    for _ in 0..ATTEMPTS {
        worse = if take(Shares { acceleration, curvature: CURVATURE_SHARES[0] }).0 { 0 } else { worse + 1 };
        if worse > 1 {
            break;
        }
        acceleration *= LOWER;
    }
    let found = take(Shares { acceleration, curvature: CURVATURE_SHARES[1] }).1?;
    for (factor, curvature) in
        [(1.0, CURVATURE_SHARES[1]), (LOWER.sqrt(), found.curvature), (LOWER.sqrt().recip(), found.curvature)]
    {
        take(Shares { acceleration: (found.acceleration * factor).min(1.0), curvature });
    }
    best.map(|(shares, _)| shares)
}

fn bounds(plan: &Plan, shares: Shares) -> Vec<Bounds> {
    let of_cell = |(i, cell): (usize, &Cell)| {
        let bounds = cell.bounds(plan.caps[i], plan.reached[i], shares.curvature, plan.limits, plan.arm);
        // The limits of squared speed and acceleration in a cell are multiplied by the square of the cell's speed
        // factor.
        let slow = plan.shares[i] * plan.shares[i];
        let (up, down) = (bounds.up * slow * shares.acceleration, bounds.down * slow * shares.acceleration);
        Bounds { cap: bounds.cap * slow, up, down, ..bounds }
    };
    plan.cells.iter().enumerate().map(of_cell).collect()
}

/// A time law, its motion, and the time factor of each cell.
struct Attempt {
    law: Law,
    motion: Motion,
    slower: Vec<f64>,
}

impl Attempt {
    fn new(plan: &Plan, bounds: &[Bounds], with_torque: bool) -> Self {
        let window = window(plan.cells, bounds, plan.limits);
        let law = Law::of_vertices(&profile::fastest(bounds, window)).averaged(window);
        let motion = plan.section.motion(&law, plan.limits);
        let slower = plan.slower(&motion, &law, with_torque);
        Self { law, motion, slower }
    }

    /// Returns the duration (s) of the motion after the whole motion is slowed down until it keeps all limits.
    fn duration(&self) -> f64 {
        self.motion.duration() * self.slower.iter().copied().fold(1.0, f64::max)
    }

    /// Slows down the cells in which a limit is violated, up to `repairs` times. Keeps the attempt that is shortest
    /// after the whole motion is slowed down until it keeps all limits.
    fn repair(&mut self, plan: &Plan, mut bounds: Vec<Bounds>, repairs: usize) {
        let mut slower = self.slower.clone();
        for _ in 0..repairs {
            if slower.iter().all(|s| *s <= LEFT_OVER) {
                break;
            }
            for (bounds, slower) in bounds.iter_mut().zip(&slower) {
                let square = slower * slower;
                (bounds.cap, bounds.up, bounds.down) =
                    (bounds.cap / square, bounds.up / square, bounds.down / square);
            }
            let next = Self::new(plan, &bounds, true);
            slower.clone_from(&next.slower);
            if next.duration() < self.duration() {
                *self = next;
            }
        }
    }
}

/// Returns the length of the time window (s) that keeps the jerk limit of each joint along a straight line.
fn window(cells: &[Cell], bounds: &[Bounds], limits: &Limits) -> f64 {
    let mut longest = 0.0f64;
    for (cell, bounds) in cells.iter().zip(bounds) {
        for end in &cell.ends {
            for j in 0..JOINTS {
                let change = end.point.first[j].abs() * bounds.up.max(bounds.down);
                longest = longest.max(change / (JERK_SHARE * limits.jerk[j]));
            }
        }
    }
    longest
}
