//! What the waypoints of a file lead through: places, or lines and arcs of the flange.

use super::kinematics::Route;
use super::{Aside, PlanError, Planned, Planner, Waypoint, corners, furthest_aside};
use crate::arm::Arm;
use crate::waypoints::{WaypointError, WaypointFile};

/// How far the flange may leave a straight line without a word, m.
const ASIDE_M: f64 = 5e-4;

/// How an arm is to go through waypoints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WayOptions {
    /// The flange keeps to a straight line on each leg of which the file does not say how the arm moves.
    pub line: bool,
    /// How far from a waypoint its corner may be rounded, rad of the joint that is furthest; 0: the arm stops at each.
    pub blend: f64,
    /// How far from a waypoint the corner between two lines or arcs may be rounded, m; 0: the arm stops there.
    pub blend_m: f64,
}

/// What a plan leads through.
#[derive(Debug)]
pub struct Way<'a> {
    file: &'a WaypointFile,
    options: WayOptions,
    course: Course,
}

#[derive(Debug)]
enum Course {
    Joints(Vec<Waypoint>),
    /// Of these the one that is passed the fastest, with the times of the waypoints.
    Lines(Vec<Route>, Vec<Option<f64>>),
}

impl<'a> Way<'a> {
    /// The way of an arm through the waypoints of a file.
    ///
    /// # Errors
    ///
    /// Those of [`WaypointFile::positions`] and [`WaypointFile::route`], and [`PlanError::Blend`].
    pub fn of(file: &'a WaypointFile, arm: &Arm, options: WayOptions) -> Result<Self, WaypointError> {
        let WayOptions { line, blend, blend_m } = options;
        corners::within_reason(blend, blend_m)?;
        let course = if file.has_lines(line) {
            let (rounded, times) = file.route(arm, line, (blend, blend_m))?;
            // A stop is within every blend, and beside a sharp corner it may be faster than a small one.
            let sharp = if blend_m > 0.0 { Some(file.route(arm, line, (blend, 0.0))?.0) } else { None };
            Course::Lines([rounded].into_iter().chain(sharp).collect(), times)
        } else {
            Course::Joints(file.positions(arm)?)
        };
        Ok(Self { file, options, course })
    }

    /// The flange keeps to a line or an arc somewhere.
    pub fn has_lines(&self) -> bool {
        matches!(self.course, Course::Lines(..))
    }

    /// The motion along it.
    ///
    /// # Errors
    ///
    /// Those of [`Planner::through`] and [`Planner::on_route`].
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

    /// Where the flange leaves the straight line between two of its poses, by more than nobody would see.
    pub fn off_the_line(&self, planned: &Planned, arm: &Arm) -> Option<Aside> {
        // With the option a leg in joint space is one that was asked for.
        let legs = if self.options.line { Vec::new() } else { self.file.legs_between_flange_poses() };
        furthest_aside(planned, &arm.model, &legs).filter(|aside| aside.distance_m >= ASIDE_M)
    }
}
