//! Motions in which the flange follows lines and arcs. For motions in joint space, this module computes the distance of the flange from the
//! straight line.

use jtc_core::{JOINTS, SetPoint, interpolate};
use jtc_dynamics::ArmModel;
use jtc_plan::kinematics::{Kinematics, LegKind, Route, RoutePoint, Target};
use jtc_plan::{Limits, on_route};

use super::{PlanError, Planned, Planner, corners};
use crate::trajectory::Trajectory;

/// Maximum deviation of the flange from its path between two points of a trajectory, m.
const ASIDE_M: f64 = 1e-4;
/// Number of positions that are checked between two points of a trajectory.
const PARTS: usize = 4;

/// Deviation of the flange from the straight line between the ends of a joint-space segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aside {
    /// Waypoint at the end of the segment, counted from 1.
    pub waypoint: usize,
    /// Largest distance of the flange from the straight line, m.
    pub distance_m: f64,
}

impl Planner<'_> {
    /// Plans a motion through the waypoints of a route. The motion starts and ends at rest. In each segment, the motion is straight in
    /// joint space, or the flange moves along a line or an arc. If a waypoint has a time, the motion passes the waypoint at this time.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Planner::through`].
    pub fn on_route(&self, route: &Route, times: &[Option<f64>]) -> Result<Planned, PlanError> {
        self.along_route(route, times, None)
    }

    /// Plans a motion from rest at `from` (rad) to `target`. The motion is straight in joint space, or the flange moves along a straight
    /// line.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Planner::to`], and [`PlanError::Plan`] if the arm does not reach the pose or cannot follow
    /// the line.
    pub fn to_target(
        &self,
        model: &ArmModel,
        from: &[f64; JOINTS],
        target: &Target,
        line: bool,
    ) -> Result<Planned, PlanError> {
        let kinematics = Kinematics::new(model, &Limits::of(self.config).position);
        if line {
            let first = self.nearest_inside(from);
            let start = RoutePoint { target: Target::Joints(first), leg: LegKind::Line };
            let points = [start, RoutePoint { target: *target, leg: LegKind::Line }];
            let route = Route::new(&kinematics, &points, &first, (0.0, 0.0))?;
            return self.along_route(&route, &[], Some(*from));
        }
        let to = match target {
            Target::Joints(to) => *to,
            Target::Flange(pose) => kinematics.solve(pose, from).map_err(jtc_plan::PlanError::from)?,
        };
        self.to(from, &to)
    }

    fn along_route(
        &self,
        route: &Route,
        times: &[Option<f64>],
        start: Option<[f64; JOINTS]>,
    ) -> Result<Planned, PlanError> {
        let arm = self.dynamics();
        let within = self.within(|limits| on_route(route, times, limits, arm.as_ref()))?;
        let first = route.positions().first().copied().unwrap_or_default();
        let timed = times.iter().skip(1).any(Option::is_some);
        let mut planned = self.checked(&within, &first, start, timed)?;
        let motion = &within.motion;
        planned.notes.extend(corners::notes(&planned, route.positions(), self.blend));
        let seconds = planned.trajectory.duration_s();
        let scale = if timed { 1.0 } else { seconds / motion.duration() };
        if let Some(model) = self.model
            && between_points(&planned.trajectory, model, |t| motion.at(t / scale).position) > ASIDE_M
        {
            return Err(PlanError::TooLong { seconds });
        }
        Ok(planned)
    }
}

/// Returns the largest deviation of the flange from its path between two points, with the interpolation of the controller (J-32), m. The
/// function measures only the deviation perpendicular to the path.
fn between_points(trajectory: &Trajectory, model: &ArmModel, way: impl Fn(f64) -> [f64; JOINTS]) -> f64 {
    const MOMENT: f64 = 1e-4;
    let kinematics = Kinematics::new(model, &[(0.0, 0.0); JOINTS]);
    let flange = |q: &[f64; JOINTS]| kinematics.flange(q).position;
    let h = f64::from(trajectory.step_ms) * 1e-3;
    let mut most = 0.0f64;
    for (i, pair) in trajectory.points.windows(2).enumerate() {
        let (a, b) = (SetPoint::from(&pair[0]), SetPoint::from(&pair[1]));
        for part in 0..PARTS {
            let u = part as f64 / PARTS as f64;
            let t = (i as f64 + u) * h;
            let here = flange(&interpolate(&a, &b, h, u).position);
            let (before, at, after) = (flange(&way(t - MOMENT)), flange(&way(t)), flange(&way(t + MOMENT)));
            most = most.max(from_line(&here, &at, &sub(&after, &before)));
        }
    }
    most
}

/// Returns the joint-space segment with the largest deviation of the flange from the straight line. `legs` contains the waypoint at the end
/// of each compared segment.
pub fn furthest_aside(planned: &Planned, model: &ArmModel, legs: &[usize]) -> Option<Aside> {
    let kinematics = Kinematics::new(model, &[(0.0, 0.0); JOINTS]);
    let times = &planned.waypoint_times;
    let flange = |ms: f64| {
        let at = planned.trajectory.at_ms(ms.round().max(0.0) as u32).unwrap_or_default();
        kinematics.flange(&at.position).position
    };
    let aside = |&leg: &usize| {
        let (from, to) = (1e3 * times.get(leg.checked_sub(1)?)?, 1e3 * times.get(leg)?);
        let (a, b) = (flange(from), flange(to));
        let places = (0..=100).map(|k| flange(from + (to - from) * f64::from(k) / 100.0));
        let distance_m = places.map(|p| from_line(&p, &a, &sub(&b, &a))).fold(0.0, f64::max);
        Some(Aside { waypoint: leg + 1, distance_m })
    };
    legs.iter().filter_map(aside).max_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
}

fn sub(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Returns the distance of the point `p` from the line through `a` along `direction`. If `direction` is zero, returns the distance from the
/// point `a`.
fn from_line(p: &[f64; 3], a: &[f64; 3], direction: &[f64; 3]) -> f64 {
    let (off, squared) = (sub(p, a), direction.iter().map(|d| d * d).sum::<f64>());
    let along: f64 = off.iter().zip(direction).map(|(o, d)| o * d).sum();
    let share = if squared > 1e-18 { along / squared } else { 0.0 };
    (0..3).map(|i| (off[i] - share * direction[i]).powi(2)).sum::<f64>().sqrt()
}
