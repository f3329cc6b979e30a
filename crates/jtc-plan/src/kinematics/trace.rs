//! Path of the flange. The path consists of consecutive legs with blended corners.
//!
//! A blend begins at the distance r before a corner and ends at the distance r after the corner. Within the blend,
//! the motion on the previous leg slows down to a stop while the motion on the next leg starts.
//!
//! Let τ go from −r to r, let w rise smoothly from 0 to 1, and let W = ∫w. The point on the path is the point of the
//! previous leg at τ − W plus the displacement of the next leg by W. Position and orientation of the blended path
//! have continuous second derivatives. If the legs are straight, the position stays within the triangle of the
//! corner.
use nalgebra::Vector3;

use super::PoseError;
use super::chain::Frame;
use super::leg::{Drawn, Leg, Place, RADIUS, SHORTEST};

/// Cosine of the angle between two legs below which the path turns back. At such a corner the flange must stop, with
/// any blend.
const WAY_BACK: f64 = -0.98;

/// Path of the flange. The path parameter is the length of the legs, m.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    legs: Vec<Drawn>,
    /// Parameter at the start of each leg, and at the end of the path.
    begins: Vec<f64>,
    /// Blend radius at the end of each leg, m; 0 if the path stops at this end.
    blends: Vec<f64>,
    /// Number of legs in the request, including legs without motion.
    given: usize,
}

impl Trace {
    pub(super) fn new(start: &Frame, legs: &[Leg], blend: f64) -> Result<Self, PoseError> {
        if !(blend >= 0.0 && blend.is_finite()) {
            return Err(PoseError::Blend { radius: blend });
        }
        let (mut from, mut drawn, mut begins) = (*start, Vec::new(), vec![0.0]);
        for (n, leg) in legs.iter().enumerate() {
            let next = Drawn::new(n + 1, &from, leg).map_err(|error| error.at_waypoint(n + 2))?;
            if next.length > SHORTEST {
                from = next.to;
                begins.push(begins[begins.len() - 1] + next.length);
                drawn.push(next);
            }
        }
        if drawn.is_empty() {
            return Err(PoseError::NoMotion);
        }
        let corners = drawn.windows(2).map(|pair| radius(&pair[0], &pair[1], blend));
        let blends = corners.chain([0.0]).collect();
        Ok(Self { legs: drawn, begins, blends, given: legs.len() })
    }

    pub(super) fn end(&self) -> f64 {
        self.begins[self.legs.len()]
    }

    /// Returns the index of the leg to which `s` belongs. A corner belongs to the leg after the corner.
    fn leg(&self, s: f64) -> usize {
        let behind = self.begins.partition_point(|&begin| begin <= s);
        behind.saturating_sub(1).min(self.legs.len() - 1)
    }

    /// Returns the number (from 1) of the leg at `s`, the distance along this leg (m), and the length of the leg (m).
    pub(super) fn whereabouts(&self, s: f64) -> (usize, f64, f64) {
        let k = self.leg(s);
        (self.legs[k].number, s - self.begins[k], self.legs[k].length)
    }

    pub(super) fn at(&self, s: f64) -> Place {
        let k = self.leg(s);
        let (leg, u) = (&self.legs[k], s - self.begins[k]);
        let left = leg.length - u;
        if k > 0 && u < self.blends[k - 1] {
            blended(&self.legs[k - 1], leg, self.blends[k - 1], u)
        } else if left < self.blends[k] && k + 1 < self.legs.len() {
            blended(leg, &self.legs[k + 1], self.blends[k], -left)
        } else {
            leg.at(u)
        }
    }

    /// Returns the parameters at which the path must stop.
    pub(super) fn stops(&self) -> Vec<f64> {
        let inner = self.blends.iter().zip(&self.begins[1..self.legs.len()]);
        inner.filter(|(blend, _)| **blend == 0.0).map(|(_, &s)| s).collect()
    }

    /// Returns the parameters at which the path changes its form, without the ends.
    pub(super) fn breaks(&self) -> Vec<f64> {
        let corners = self.blends.iter().zip(&self.begins[1..self.legs.len()]);
        let mut all: Vec<f64> = corners.flat_map(|(&r, &s)| [s - r, s, s + r]).collect();
        all.dedup();
        all
    }

    /// Returns the parameter at which the arc with leg number `number` passes its `via` point.
    pub(super) fn via(&self, number: usize) -> Option<f64> {
        let k = self.legs.iter().position(|leg| leg.number == number)?;
        Some(self.begins[k] + self.legs[k].via()?)
    }

    /// Returns the parameter nearest to each waypoint, including the ends. For a leg without motion, the parameters at
    /// both ends are equal.
    pub(super) fn waypoints(&self) -> Vec<f64> {
        let passed = |n: usize| self.legs.partition_point(|leg| leg.number <= n);
        (0..=self.given).map(|n| self.begins[passed(n)]).collect()
    }
}

/// Returns the blend radius at a corner: at most half of each leg, and 0 if the path turns back.
fn radius(before: &Drawn, behind: &Drawn, blend: f64) -> f64 {
    let (a, b) = (before.at(before.length), behind.at(0.0));
    let along = a.velocity.dot(&b.velocity) + RADIUS * RADIUS * a.spin.dot(&b.spin);
    let size = |p: &Place| (p.velocity.norm_squared() + RADIUS * RADIUS * p.spin.norm_squared()).sqrt();
    if along < WAY_BACK * size(&a) * size(&b) {
        return 0.0;
    }
    let radius = blend.min(0.5 * before.length).min(0.5 * behind.length);
    if radius > SHORTEST { radius } else { 0.0 }
}

/// Returns the point on a blend of radius `r` at `tau`, both in m.
fn blended(before: &Drawn, behind: &Drawn, r: f64, tau: f64) -> Place {
    let t = (tau + r) / (2.0 * r);
    let w = t * t * (3.0 - 2.0 * t);
    let rate = 3.0 * t * (1.0 - t) / r;
    let sum = 2.0 * r * t * t * t * (1.0 - 0.5 * t);
    let (a, b) = (before.at(before.length + tau - sum), behind.at(sum));
    let corner = &before.to;
    // Rotation of the flange on the next leg, from the corner to the present point.
    let since = b.frame.rotation * corner.rotation.transpose();
    let spin: Vector3<f64> = since * a.spin;
    Place {
        frame: Frame {
            rotation: since * a.frame.rotation,
            position: a.frame.position + b.frame.position - corner.position,
        },
        velocity: a.velocity * (1.0 - w) + b.velocity * w,
        spin: spin * (1.0 - w) + b.spin * w,
        acceleration: a.acceleration * ((1.0 - w) * (1.0 - w))
            + b.acceleration * (w * w)
            + (b.velocity - a.velocity) * rate,
        spin_rate: (b.spin - spin) * rate + b.spin.cross(&spin) * (w * (1.0 - w)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::chain::logarithm;
    use super::*;
    use crate::kinematics::Orientation;
    use proptest::prelude::*;

    fn pose() -> impl Strategy<Value = jtc_dynamics::Pose> {
        (prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-0.9..0.9f64))
            .prop_map(|(position, rpy)| Orientation::Rpy(rpy).at(position).unwrap())
    }

    fn leg() -> impl Strategy<Value = Leg> {
        prop_oneof![
            pose().prop_map(|to| Leg::Line { to }),
            (prop::array::uniform3(-1.0..1.0f64), pose()).prop_map(|(via, to)| Leg::Arc { via, to }),
        ]
    }

    /// Returns the largest difference between a point's derivatives and the finite differences of the neighbouring
    /// points.
    fn wrong(trace: &Trace, s: f64) -> f64 {
        let step = 1e-5;
        let (before, here, after) = (trace.at(s - step), trace.at(s), trace.at(s + step));
        let slope = |a: Vector3<f64>, b: Vector3<f64>| (b - a) / (2.0 * step);
        let turn = logarithm(&(after.frame.rotation * before.frame.rotation.transpose())) / (2.0 * step);
        [
            slope(before.frame.position, after.frame.position) - here.velocity,
            turn - here.spin,
            slope(before.velocity, after.velocity) - here.acceleration,
            slope(before.spin, after.spin) - here.spin_rate,
        ]
        .iter()
        .fold(0.0, |worst, v| v.amax().max(worst))
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// The test also checks the ends of the blends. At such an end, a jump of the second derivative would cause an
        /// error of half the jump.
        #[test]
        fn derivatives_are_those_of_the_places_and_continuous(
            start in pose(), legs in prop::collection::vec(leg(), 2..5), blend in 0.05..0.3f64, at in 0.0..1.0f64
        ) {
            let Ok(trace) = Trace::new(&(&start).into(), &legs, blend) else { return Ok(()) };
            prop_assume!(trace.stops().is_empty() && trace.legs.iter().all(|leg| leg.length > 0.2));
            let at_ends = trace.breaks();
            for s in at_ends.into_iter().chain([at * trace.end()]) {
                let s = s.clamp(1e-5, trace.end() - 1e-5);
                // The third derivative jumps at the ends of a blend, and finite differences are less accurate on
                // tight arcs. The tolerance therefore increases with velocity and acceleration.
                let tight = trace.at(s).acceleration.norm() + trace.at(s).velocity.norm();
                prop_assert!(wrong(&trace, s) < 0.03 + 1e-3 * tight.powi(3), "{} at {s}: {trace:?}", wrong(&trace, s));
            }
        }

        #[test]
        fn a_blend_leaves_the_legs_within_its_radius_of_the_corner_only(
            poses in prop::collection::vec(pose(), 4), blend in 0.01..0.2f64
        ) {
            let legs: Vec<Leg> = poses[1..].iter().map(|&to| Leg::Line { to }).collect();
            let (sharp, round) = (
                Trace::new(&(&poses[0]).into(), &legs, 0.0).unwrap(),
                Trace::new(&(&poses[0]).into(), &legs, blend).unwrap(),
            );
            prop_assert_eq!(sharp.stops().len(), 2);
            prop_assert_eq!(sharp.waypoints(), round.waypoints());
            for k in 0..=300 {
                let s = sharp.end() * f64::from(k) / 300.0;
                let (a, b) = (sharp.at(s).frame, round.at(s).frame);
                let corner = sharp.begins[1..3].iter().any(|begin| (begin - s).abs() < blend);
                if !corner {
                    prop_assert!((a.position - b.position).amax() < 1e-12);
                    prop_assert!((a.rotation - b.rotation).amax() < 1e-12);
                }
                let near = |pose: &jtc_dynamics::Pose| (Vector3::from(pose.position) - b.position).norm() <= blend;
                prop_assert!((a.position - b.position).amax() < 1e-12 || poses[1..3].iter().any(near));
            }
        }
    }

    #[test]
    fn a_way_back_is_a_stop_and_a_leg_of_no_length_has_its_waypoint() {
        let at = |x: f64| Orientation::Rpy([0.0; 3]).at([x, 0.0, 0.0]).unwrap();
        let legs = [0.4, 0.4, 0.9, 0.1].map(|x| Leg::Line { to: at(x) });
        let trace = Trace::new(&(&at(0.0)).into(), &legs, 0.05).unwrap();
        assert!((trace.end() - 1.7).abs() < 1e-12);
        assert_eq!(trace.stops().len(), 1);
        assert!((trace.stops()[0] - 0.9).abs() < 1e-12);
        let expected = [0.0, 0.4, 0.4, 0.9, 1.7];
        assert!(trace.waypoints().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(trace.whereabouts(0.5).0, 3);
        let still = Trace::new(&(&at(0.4)).into(), &legs[..2], 0.0);
        assert_eq!(still.unwrap_err(), PoseError::NoMotion);
    }
}
