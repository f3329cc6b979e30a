//! Path through the waypoints of a file. The segments of the path are straight in joint space, or are lines and arcs of the flange.

use super::kinematics::Route;
use super::{Aside, PlanError, Planned, Planner, Waypoint, corners, furthest_aside};
use crate::arm::Arm;
use crate::waypoints::{WaypointError, WaypointFile};

/// Deviation of the flange from a straight line (m) above which the user gets a note.
const ASIDE_M: f64 = 5e-4;

/// Options for the path through waypoints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WayOptions {
    /// `true` if the flange moves along a straight line in each segment for which the file does not specify another
    /// motion.
    pub line: bool,
    /// Size of a rounded corner, rad. The path leaves the straight segments only within this distance from the
    /// waypoint. The distance is that of the joint that is furthest from the waypoint. If `blend` is 0, the arm stops
    /// at each waypoint.
    pub blend: f64,
    /// Size of a rounded corner between two lines or arcs of the flange: the largest distance of the flange from the
    /// waypoint in the corner, m. If `blend_m` is 0, the arm stops at each of these corners.
    pub blend_m: f64,
}

/// Path through waypoints, for the planner.
#[derive(Debug)]
pub struct WaypointPath<'a> {
    file: &'a WaypointFile,
    options: WayOptions,
    course: Course,
}

#[derive(Debug)]
enum Course {
    Joints(Vec<Waypoint>),
    /// Alternative routes and the times of the waypoints. The planner uses the fastest route.
    Lines(Vec<Route>, Vec<Option<f64>>),
}

impl<'a> WaypointPath<'a> {
    /// Returns the path of an arm through the waypoints of a file.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`WaypointFile::positions`] and [`WaypointFile::route`], and [`PlanError::Blend`] if a blend is too large.
    pub fn of(file: &'a WaypointFile, arm: &Arm, options: WayOptions) -> Result<Self, WaypointError> {
        let WayOptions { line, blend, blend_m } = options;
        corners::within_reason(blend, blend_m)?;
        let course = if file.has_lines(line) {
            let (rounded, times) = file.route(arm, line, (blend, blend_m))?;
            // A path that stops at a waypoint always respects the blend, and at a sharp corner a stop may be faster
            // than a small rounding. Therefore the planner gets two routes, one with rounded corners and one with
            // stops, and uses the faster route.
            let sharp = if blend_m > 0.0 { Some(file.route(arm, line, (blend, 0.0))?.0) } else { None };
            Course::Lines([rounded].into_iter().chain(sharp).collect(), times)
        } else {
            Course::Joints(file.positions(arm)?)
        };
        Ok(Self { file, options, course })
    }

    /// Returns `true` if the flange moves along a line or an arc in any segment.
    pub fn has_lines(&self) -> bool {
        matches!(self.course, Course::Lines(..))
    }

    /// Plans the motion along the path.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Planner::through`] and [`Planner::on_route`].
    pub fn planned(&self, planner: &Planner) -> Result<Planned, PlanError> {
        let (routes, times) = match &self.course {
            Course::Joints(waypoints) => return planner.through(waypoints),
            Course::Lines(routes, times) => (routes, times),
        };
        let seconds = |planned: &Planned| planned.trajectory.duration_s();
        let mut fastest = None::<Result<Planned, PlanError>>;
        for route in routes {
            let planned = planner.on_route(route, times);
            fastest = match (fastest, planned) {
                (Some(Ok(before)), Ok(planned)) if seconds(&planned) < seconds(&before) => Some(Ok(planned)),
                (Some(Err(_)) | None, planned) => Some(planned),
                (before, _) => before,
            };
        }
        fastest.unwrap_or(Err(PlanError::Nowhere { count: 0 }))
    }

    /// Returns the largest deviation of the flange from the straight line between two poses of the flange. Returns `None` if the deviation
    /// is smaller than 0.5 mm.
    pub fn off_the_line(&self, planned: &Planned, arm: &Arm) -> Option<Aside> {
        // With the option `line`, each segment in joint space was explicitly requested by the user. Therefore no
        // deviation from a straight line is reported.
        let legs = if self.options.line { Vec::new() } else { self.file.legs_between_flange_poses() };
        furthest_aside(planned, &arm.model, &legs).filter(|aside| aside.distance_m >= ASIDE_M)
    }
}
