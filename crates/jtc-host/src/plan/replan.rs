//! Replanning: planning of a new motion on the path of an existing trajectory, within the limits of an arm.

use jtc_plan::Waypoint;

use super::{Planned, Planner, at_speed};
use crate::plan::PlanError;
use crate::trajectory::Trajectory;
use crate::waypoints::thinned;

/// Maximum distance of a removed point from the segment between the remaining points, rad. The noise of encoders and of hand guidance is
/// smaller than this distance.
const THINNED: f64 = 0.005;
/// Blend of the corners between segments, rad.
const BLEND: f64 = 0.02;

impl Planner<'_> {
    /// Maximum deviation of the new motion from the path, in the joint with the largest deviation, rad.
    pub const ASIDE: f64 = THINNED + BLEND;

    /// Plans a new motion on the path of a trajectory, independent of the timing of this trajectory. The new motion is within the limits
    /// and begins and ends at rest. The new motion deviates from the path by at most [`Planner::ASIDE`] and is not faster than the original
    /// motion. This function is intended for measured paths. The spline of a measured path contains encoder noise, and the arm may be
    /// moving at the ends of the path.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Planner::through`]. The waypoint numbers in these errors refer to the points that remain after
    /// unnecessary points are removed.
    pub fn anew(&self, way: &Trajectory) -> Result<Planned, PlanError> {
        let positions: Vec<_> = way.points.iter().map(|point| point.position).collect();
        let place = |i: usize| positions.get(i).map(|q| Waypoint { position: *q, time: None });
        let waypoints: Vec<Waypoint> = thinned(&positions, THINNED).into_iter().filter_map(place).collect();
        let mut planned = Planner { blend: BLEND, ..self.clone() }.through(&waypoints)?;
        let share = planned.trajectory.duration_s() / way.duration_s();
        if share < 1.0 {
            planned.trajectory = at_speed(&planned.trajectory, (100.0 * share).max(1.0))?;
            planned.waypoint_times.iter_mut().for_each(|t| *t /= share);
            // No limit determines the speed of the new motion, because it was slowed down to the duration of the
            // original motion.
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

    /// The test replans two motions on their paths. The first motion has about twice the velocity limit and ends
    /// abruptly at high speed. The second motion is slow.
    #[test]
    fn a_way_that_is_too_fast_is_gone_within_the_limits() {
        let arm = Arm::avena();
        let (config, friction) = (arm.config(), arm.friction());
        let planner =
            Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
        for (seconds, too_fast) in [(0.6, true), (9.0, false)] {
            let shape = |u: f64| {
                let q = 0.7 * (1.0 - (2.5 * u).cos());
                // Simulated encoder noise is added to the positions.
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
