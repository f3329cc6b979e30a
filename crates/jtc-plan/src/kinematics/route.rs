//! Routes. A route consists of sections that are straight in joint space, and of sections on which the flange follows
//! lines and arcs.
use jtc_dynamics::JointVec;

use super::target::one;
use super::{FlangePath, Kinematics, Leg, PoseError, Target};
use crate::path::Waypointed;
use crate::{BlendedPath, Path, PathPoint, PlanError, furthest_joint};

/// Largest distance between the joint positions of a waypoint and the end of the line to this waypoint, rad.
const SAME: f64 = 1e-5;

/// Type of motion from the previous waypoint to a waypoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LegKind {
    /// Straight motion in joint space.
    #[default]
    Joint,
    /// Motion with the flange on a straight line.
    Line,
    /// Motion on an arc that passes this waypoint and ends at the next waypoint. The orientation of this waypoint is
    /// ignored.
    Via,
    /// Motion with the flange on an arc through the previous waypoint, whose kind must be [`LegKind::Via`].
    Arc,
}

/// A waypoint of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoutePoint {
    /// Position of the waypoint.
    pub target: Target,
    /// Type of motion to the waypoint. The type of motion of the first waypoint is ignored.
    pub leg: LegKind,
}

/// A path through waypoints, straight in joint space or with the flange on lines and arcs. The path stops between a
/// section in joint space and a section of lines and arcs.
///
/// Along lines and arcs, the arm keeps its configuration (elbow, wrist, shoulder) from the start of the first line or
/// arc. The arm reaches a flange pose at the end of a line in this configuration. Joint positions at the end of a line
/// must also have this configuration. If a flange pose is not at the end of a line or an arc, the solution nearest to
/// the previous waypoint is used.
///
/// The path parameter continues from section to section. The unit of the parameter is rad in joint space, and m along
/// lines and arcs.
#[derive(Clone, Debug)]
pub struct Route {
    sections: Vec<Section>,
    positions: Vec<JointVec>,
    waypoints: Vec<f64>,
    end: f64,
}

#[derive(Clone, Debug)]
struct Section {
    way: Way,
    begin: f64,
    /// Points at which the path changes its form, including the ends, each as route parameter and section parameter.
    /// These pairs prevent that rounding of the sum `begin` plus section parameter moves a point across a change of
    /// form.
    marks: Vec<(f64, f64)>,
}

#[derive(Clone, Debug)]
enum Way {
    Joint(BlendedPath),
    Flange(Box<FlangePath>),
}

impl Way {
    fn path(&self) -> &dyn Path {
        match self {
            Self::Joint(path) => path,
            Self::Flange(path) => path.as_ref(),
        }
    }
}

impl Section {
    fn new(way: Way, begin: f64) -> Self {
        let path = way.path();
        let mut places = path.breaks();
        places.extend(path.stops());
        places.extend([0.0, path.end()]);
        places.sort_by(f64::total_cmp);
        places.dedup();
        let marks = places.into_iter().map(|own| (begin + own, own)).collect();
        Self { way, begin, marks }
    }

    /// Converts the route parameter to the section parameter.
    fn own(&self, s: f64) -> f64 {
        let behind = self.marks.partition_point(|mark| mark.0 <= s);
        match (behind.checked_sub(1).map(|i| self.marks[i]), self.marks.get(behind)) {
            (Some((at, own)), _) if at == s => own,
            (Some((_, low)), Some((_, high))) => {
                (s - self.begin).clamp(low.next_up(), high.next_down().max(low.next_up()))
            }
            (Some((_, end)), None) => end,
            (None, _) => 0.0,
        }
    }
}

impl Route {
    /// Creates the route through `points`. If the first point is a flange pose, the solution nearest to `near` (rad)
    /// is used. Corners between two legs in joint space are rounded within `blend` rad (see [`BlendedPath`]). Corners
    /// between lines and arcs are rounded within `blend_m` m (see [`FlangePath`]). With a blend of 0, the path stops
    /// at the corner.
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::TooFew`] for fewer than two waypoints, and [`PlanError::Blend`] for an invalid `blend`.
    /// Returns [`PlanError::Flange`] for an impossible waypoint or leg, with the waypoint, or the leg and the
    /// distance along the leg (see [`PoseError`]). The flange error is [`PoseError::NoMotion`] if all waypoints are
    /// at the same position, and [`PoseError::Blend`] for an invalid `blend_m`.
    pub fn new(
        kinematics: &Kinematics,
        points: &[RoutePoint],
        near: &JointVec,
        (blend, blend_m): (f64, f64),
    ) -> Result<Self, PlanError> {
        let [first, _, ..] = points else { return Err(PlanError::TooFew { count: points.len() }) };
        if !(blend >= 0.0 && blend.is_finite()) {
            return Err(PlanError::Blend { value: blend });
        }
        if !(blend_m >= 0.0 && blend_m.is_finite()) {
            return Err(PoseError::Blend { radius: blend_m }.into());
        }
        let start = one(kinematics, &first.target, near).map_err(|e| e.at_waypoint(1))?;
        let mut route = Self { sections: Vec::new(), positions: vec![start], waypoints: vec![0.0], end: 0.0 };
        let mut done = 1;
        while let Some(next) = points.get(done) {
            let is_joint = |point: &RoutePoint| point.leg == LegKind::Joint;
            let rest = &points[done..];
            let count = rest.iter().take_while(|point| is_joint(point) == is_joint(next)).count();
            if is_joint(next) {
                route.in_joint_space(kinematics, &rest[..count], blend)?;
            } else {
                route.along_lines(kinematics, &rest[..count], blend_m)?;
            }
            done += count;
        }
        if route.sections.is_empty() { Err(PoseError::NoMotion.into()) } else { Ok(route) }
    }

    /// Returns the joint positions at the waypoints, rad. At a rounded corner, the result is the position of the
    /// waypoint, which the path does not pass exactly.
    pub fn positions(&self) -> &[JointVec] {
        &self.positions
    }

    /// Returns `true` if `s` is on a line or an arc of the flange.
    pub fn is_on_line(&self, s: f64) -> bool {
        matches!(self.section(s).way, Way::Flange(_))
    }

    fn section(&self, s: f64) -> &Section {
        let behind = self.sections.partition_point(|section| section.begin <= s);
        &self.sections[behind.saturating_sub(1)]
    }

    fn last(&self) -> JointVec {
        self.positions.last().copied().unwrap_or_default()
    }

    /// Appends a section. `waypoints` contains the section parameter at each waypoint of the section except the first.
    fn push(&mut self, way: Way, waypoints: &[f64]) {
        let section = Section::new(way, self.end);
        self.waypoints.extend(waypoints.iter().map(|own| self.end + own));
        self.end += section.way.path().end();
        self.sections.push(section);
    }

    /// Appends `count` waypoints that need no movement.
    fn stay(&mut self, count: usize) {
        self.waypoints.extend(std::iter::repeat_n(self.end, count));
    }

    fn in_joint_space(
        &mut self,
        kinematics: &Kinematics,
        points: &[RoutePoint],
        blend: f64,
    ) -> Result<(), PlanError> {
        let mut ends = vec![self.last()];
        for point in points {
            let number = self.positions.len() + 1;
            let found = one(kinematics, &point.target, &self.last()).map_err(|e| e.at_waypoint(number))?;
            self.positions.push(found);
            ends.push(found);
        }
        if ends.iter().all(|end| BlendedPath::are_one(&ends[0], end)) {
            self.stay(points.len());
            return Ok(());
        }
        let path = BlendedPath::new(&ends, blend)?;
        let waypoints = path.waypoints();
        self.push(Way::Joint(path), &waypoints[1..]);
        Ok(())
    }

    fn along_lines(
        &mut self,
        kinematics: &Kinematics,
        points: &[RoutePoint],
        blend: f64,
    ) -> Result<(), PlanError> {
        let first = self.positions.len() + 1;
        let legs = legs(kinematics, points, first)?;
        let start = self.last();
        let path = |blend: f64| FlangePath::new(kinematics, &start, &legs.legs, blend);
        // Waypoint positions are taken from a path without blends, because a blended path does not pass its corners
        // exactly.
        let sharp = match path(0.0) {
            Err(PoseError::NoMotion) => None,
            other => Some(other.map_err(|e| legs.numbered(e))?),
        };
        let ends = sharp.as_ref().map(Path::waypoints);
        let mut waypoints = Vec::with_capacity(points.len());
        for (k, point) in points.iter().enumerate() {
            let leg = legs.of_point(k);
            let at = match (&sharp, &ends) {
                (Some(sharp), _) if point.leg == LegKind::Via => sharp.via(leg).unwrap_or(0.0),
                (_, Some(ends)) => ends[leg],
                _ => 0.0,
            };
            waypoints.push(at);
            let reached = sharp.as_ref().map_or(start, |sharp| sharp.at(at).position);
            let position = match point.target {
                Target::Joints(wanted) if point.leg != LegKind::Via => {
                    same(&reached, &wanted).map_err(|e| e.at_waypoint(first + k))?;
                    wanted
                }
                // A solution of the inverse kinematics has rounding errors, so it is clamped to the position limits.
                _ => std::array::from_fn(|j| {
                    let (low, high) = kinematics.limits()[j];
                    reached[j].clamp(low, high)
                }),
            };
            self.positions.push(position);
        }
        match sharp {
            None => self.stay(points.len()),
            Some(sharp) => {
                let path = if blend > 0.0 { path(blend).map_err(|e| legs.numbered(e))? } else { sharp };
                self.push(Way::Flange(Box::new(path)), &waypoints);
            }
        }
        Ok(())
    }
}

/// Legs of the flange, and for each leg the number (from 1) of the waypoint at its end.
struct Legs {
    legs: Vec<Leg>,
    ends: Vec<usize>,
    /// Number of the waypoint at the end of the first leg, or of its `via` point.
    first: usize,
}

impl Legs {
    /// Returns the number (from 1) of the leg that contains the point with this index.
    fn of_point(&self, index: usize) -> usize {
        self.ends.partition_point(|end| *end < self.first + index) + 1
    }

    /// Converts an error of these legs to an error with the waypoint and leg numbers of the route.
    fn numbered(&self, error: PoseError) -> PoseError {
        let end = |leg: usize| leg.checked_sub(1).and_then(|i| self.ends.get(i)).copied();
        match error {
            PoseError::Waypoint { waypoint, source } => {
                let before = self.first.saturating_sub(1);
                PoseError::Waypoint { waypoint: end(waypoint.saturating_sub(1)).unwrap_or(before), source }
            }
            PoseError::Leg { leg, distance, length, source } => {
                let leg = end(leg).map_or(leg, |end| end.saturating_sub(1));
                PoseError::Leg { leg, distance, length, source }
            }
            other => other,
        }
    }
}

/// Returns the legs to `points`. The first of these points is waypoint number `first`.
fn legs(kinematics: &Kinematics, points: &[RoutePoint], first: usize) -> Result<Legs, PoseError> {
    let (mut legs, mut ends, mut via) = (Vec::new(), Vec::new(), None);
    for (k, point) in points.iter().enumerate() {
        let number = first + k;
        let to = match point.target {
            Target::Joints(q) => {
                one(kinematics, &point.target, &q).map_err(|e| e.at_waypoint(number))?;
                kinematics.flange(&q)
            }
            Target::Flange(pose) => pose,
        };
        let leg = match (point.leg, via.take()) {
            (LegKind::Via, None) => {
                via = Some(to.position);
                continue;
            }
            (LegKind::Arc, Some(via)) => Leg::Arc { via, to },
            (LegKind::Arc, None) => return Err(PoseError::NoVia.at_waypoint(number)),
            (_, Some(_)) => return Err(PoseError::NoArc.at_waypoint(number - 1)),
            (LegKind::Line | LegKind::Joint, None) => Leg::Line { to },
        };
        legs.push(leg);
        ends.push(number);
    }
    if via.is_some() {
        return Err(PoseError::NoArc.at_waypoint(first + points.len() - 1));
    }
    Ok(Legs { legs, ends, first })
}

/// Checks that the arm reaches the requested joint positions. A difference means that the arm is in another
/// configuration.
fn same(reached: &JointVec, wanted: &JointVec) -> Result<(), PoseError> {
    let (joint, away) = furthest_joint(reached, wanted);
    if away > SAME {
        let (value, wanted) = (reached[joint.index()], wanted[joint.index()]);
        return Err(PoseError::Configuration { joint, value, wanted });
    }
    Ok(())
}

impl Path for Route {
    fn end(&self) -> f64 {
        self.end
    }

    fn at(&self, s: f64) -> PathPoint {
        let section = self.section(s);
        section.way.path().at(section.own(s))
    }

    fn waypoint(&self, s: f64) -> Option<usize> {
        Some(self.waypoints.partition_point(|&at| at <= s).max(1))
    }

    fn breaks(&self) -> Vec<f64> {
        let marks = self.sections.iter().flat_map(|section| &section.marks).map(|mark| mark.0);
        let mut all: Vec<f64> = marks.filter(|s| *s > 0.0 && *s < self.end).collect();
        all.dedup();
        all
    }

    fn stops(&self) -> Vec<f64> {
        let mut all = Vec::new();
        for section in &self.sections {
            all.push(section.begin);
            all.extend(section.way.path().stops().iter().map(|own| section.begin + own));
        }
        all.retain(|s| *s > 0.0);
        all
    }

    fn waypoints(&self) -> Vec<f64> {
        self.waypoints.clone()
    }
}

impl Waypointed for Route {
    fn is_one_place(&self, from: usize, to: usize) -> bool {
        self.waypoints[from] == self.waypoints[to]
    }

    fn stops_at(&self, waypoint: usize) -> bool {
        let s = self.waypoints[waypoint];
        s == 0.0 || s == self.end || self.stops().contains(&s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jtc_dynamics::JOINTS;

    /// A route parameter just before or just after a change of form must give a section parameter on the same side of
    /// this change.
    #[test]
    fn rounding_does_not_lead_across_a_mark() {
        let ends = [[0.0; JOINTS], [0.7, 0.1, 0.0, 0.0, 0.0, 0.0], [0.1, 0.3, 0.0, 0.0, 0.0, 0.0]];
        for begin in [0.0, 0.1, 1.3, 2.0 / 3.0, 77.7] {
            let section = Section::new(Way::Joint(BlendedPath::new(&ends, 0.0).unwrap()), begin);
            for (at, own) in section.marks.clone() {
                assert_eq!(section.own(at), own);
                if own > 0.0 {
                    assert!(section.own(at.next_down()) < own);
                }
                if own < section.way.path().end() {
                    assert!(section.own(at.next_up()) > own);
                }
            }
        }
    }
}
