//! The way of a trajectory, planned anew within the limits of an arm.

use jtc_plan::Waypoint;

use super::{Planned, Planner, at_speed};
use crate::plan::PlanError;
use crate::trajectory::Trajectory;
use crate::waypoints::thinned;

/// Places this near to the legs between others are left out, rad: encoders and hands tremble less.
const THINNED: f64 = 0.005;
/// How far corners between legs are rounded, rad.
const BLEND: f64 = 0.02;

impl Planner<'_> {
    /// How far [`Planner::anew`] may leave the way, rad of the joint that is furthest.
    pub const ASIDE: f64 = THINNED + BLEND;

    /// A motion along the way of a trajectory, whatever its times are: within the limits and at rest at both ends, at most
    /// [`Planner::ASIDE`] beside it, and no faster than it was. For ways that were measured, whose spline shows the noise of the
    /// encoders and whose ends may be cut off in motion.
    ///
    /// # Errors
    ///
    /// As [`Planner::through`]; its waypoints are those points of the trajectory that remain.
    pub fn anew(&self, way: &Trajectory) -> Result<Planned, PlanError> {
        let positions: Vec<_> = way.points.iter().map(|point| point.position).collect();
        let place = |i: usize| positions.get(i).map(|q| Waypoint { position: *q, time: None });
        let waypoints: Vec<Waypoint> = thinned(&positions, THINNED).into_iter().filter_map(place).collect();
        let mut planned = Planner { blend: BLEND, ..self.clone() }.through(&waypoints)?;
        let share = planned.trajectory.duration_s() / way.duration_s();
        if share < 1.0 {
            planned.trajectory = at_speed(&planned.trajectory, (100.0 * share).max(1.0))?;
            planned.waypoint_times.iter_mut().for_each(|t| *t /= share);
            // No limit binds a motion that is as slow as it was.
            planned.binding.clear();
        }
        Ok(planned)
    }
}

#[cfg(test)]
mod tests {
    use jtc_core::JOINTS;

    use super::*;
    use crate::Arm;
    use crate::check::Checker;
    use crate::trajectory::fit::Samples;

    /// A motion at twice the limit of velocity, cut off in the middle, and one that is slow: both are run along their ways.
    #[test]
    fn a_way_that_is_too_fast_is_gone_within_the_limits() {
        let arm = Arm::avena();
        let (config, friction) = (arm.config(), arm.friction());
        let planner =
            Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
        for (seconds, too_fast) in [(0.6, true), (9.0, false)] {
            let shape = |u: f64| {
                let q = 0.7 * (1.0 - (2.5 * u).cos());
                // With a trembling of the encoders.
                let noise = 2e-4 * (u * 1e4).sin();
                [q + noise, 0.3 * q, -0.5 * q - noise, 0.2 * q, 0.4 * q, noise]
            };
            let count = (seconds / 0.04) as usize;
            let times = (0..=count).map(|k| k as f64 * 0.04).collect();
            let position: Vec<_> = (0..=count).map(|k| shape(k as f64 / count as f64)).collect();
            let way = Samples { times, position, ..Samples::default() }.fit().unwrap().trajectory;
            let checker =
                Checker { model: Some(&arm.model), friction: friction.as_ref(), ..Checker::new(&config) };
            assert!(!too_fast || !checker.check(&way).is_ok());
            let planned = planner.anew(&way).unwrap().trajectory;
            assert!(checker.check(&planned).is_ok(), "{}", checker.check(&planned));
            let (took, was) = (planned.duration_s(), way.duration_s());
            assert!(
                if too_fast { took > was } else { (was - 0.02..1.5 * was).contains(&took) },
                "{took} s, {was} s"
            );
            for ms in (0..(took * 1e3) as u32).step_by(5) {
                let at = planned.at_ms(ms).unwrap().position;
                let near = (0..=2000).map(|k| {
                    let on = shape(f64::from(k) / 2000.0);
                    (0..JOINTS).map(|j| (on[j] - at[j]).abs()).fold(0.0, f64::max)
                });
                let aside = near.fold(f64::INFINITY, f64::min);
                assert!(aside < Planner::ASIDE + 2e-3, "{ms} ms: {aside}");
            }
        }
    }
}
