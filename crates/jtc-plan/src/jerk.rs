//! Laws of time that are limited in jerk.
//!
//! The fastest law under limits of the parameter's speed and acceleration is averaged over a window. A jump of the acceleration
//! becomes a ramp as long as the window: with a window of acceleration over jerk the jerk holds. [`crate::profile`] sees to it that
//! what was averaged keeps to the limits of the cells around it.
use crate::along::{Made, Plan};
use crate::cells::Cell;
use crate::interior::Search;
use crate::law::Law;
use crate::motion::Motion;
use crate::profile::{self, Bounds};
use crate::{JOINTS, Limits};

/// By what the acceleration is lowered from one attempt to the next: lower ones have shorter ramps.
const LOWER: f64 = 0.7;
/// Attempts at most.
const ATTEMPTS: usize = 24;
/// What the curvature may take of acceleration and jerk, in attempts one after the other: where a path keeps its speed in its curves, nearly
/// all; where it has to change it there, less.
const CURVATURE_SHARES: [f64; 2] = [0.97, 0.7];
/// By how much all of the motion is slowed down without that.
const LEFT_OVER: f64 = 1.002;
/// The same for a law by the interior-point method.
const LITTLE: f64 = 1.005;
/// Share of the jerk limit that the window is made for.
const JERK_SHARE: f64 = 0.995;

/// How much of the limits a law uses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shares {
    /// Of the acceleration along the path.
    acceleration: f64,
    /// Of acceleration and jerk by the curvature.
    curvature: f64,
}

/// The best of some laws that use more or less of the limits, or that with these `shares`.
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

/// Shares of the law from which the search for a faster one begins.
const SEED: Shares = Shares { acceleration: LOWER * LOWER, curvature: CURVATURE_SHARES[0] };

/// The motion by an interior-point method, where that finds one that is faster than the law from which it begins.
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

/// The shares with which the motion is the shortest, torque not counted.
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
        // At a share of the speed.
        let slow = plan.shares[i] * plan.shares[i];
        let (up, down) = (bounds.up * slow * shares.acceleration, bounds.down * slow * shares.acceleration);
        Bounds { cap: bounds.cap * slow, up, down, ..bounds }
    };
    plan.cells.iter().enumerate().map(of_cell).collect()
}

/// A law, its motion, and by what the time in each cell has to be multiplied.
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

    /// s, when all of it is slowed down.
    fn duration(&self) -> f64 {
        self.motion.duration() * self.slower.iter().copied().fold(1.0, f64::max)
    }

    /// Slows the cells down in which a limit does not hold, as long as that is faster than slowing down all.
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

/// The window in which no joint's acceleration along a straight line changes faster than its jerk allows, s.
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
