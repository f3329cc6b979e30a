//! Overshoot of a curve beyond its waypoints.

use jtc_wire::Joint;

use super::Point;

/// Largest overshoot of a joint: the distance of the curve from the interval between the positions of two waypoints.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Overshoot {
    /// Joint.
    pub joint: Joint,
    /// Distance between the farthest position of the curve and the interval, rad.
    pub beyond_rad: f64,
    /// Position at the overshoot, rad.
    pub position_rad: f64,
    /// Waypoint (from 1) before the overshoot.
    pub after: usize,
}

/// Smallest overshoot that is reported, rad. An overshoot of this size moves a point that is 1 m from the joint axis by
/// 1 mm.
const LEAST: f64 = 1e-3;

/// Returns the largest overshoot of each joint that has an overshoot. The curve consists of cubics that have these
/// positions and velocities at these times (s).
pub(super) fn overshoots(times: &[f64], points: &[Point]) -> Vec<Overshoot> {
    let of_joint = |joint: Joint| {
        let j = joint.index();
        let intervals = points.windows(2).zip(times.windows(2)).enumerate();
        let all = intervals.filter_map(|(i, (p, t))| {
            let (a, b, h) = (p[0].position[j], p[1].position[j], t[1] - t[0]);
            let turns = extrema(b - a, p[0].velocity[j] * h, p[1].velocity[j] * h);
            let (low, high) = (a.min(b), a.max(b));
            let places = turns.into_iter().flatten().map(|d| a + d);
            let furthest = places.max_by(|x, y| outside(*x, low, high).total_cmp(&outside(*y, low, high)))?;
            let beyond_rad = outside(furthest, low, high);
            Some(Overshoot { joint, beyond_rad, position_rad: furthest, after: i + 1 })
        });
        all.filter(|o| o.beyond_rad >= LEAST).max_by(|x, y| x.beyond_rad.total_cmp(&y.beyond_rad))
    };
    Joint::ALL.into_iter().filter_map(of_joint).collect()
}

fn outside(x: f64, low: f64, high: f64) -> f64 {
    (x - high).max(low - x)
}

/// Returns the extrema of a cubic in the unit interval. The cubic has the values 0 and `d` and the slopes `v0` and `v1` at the ends of the
/// interval.
fn extrema(d: f64, v0: f64, v1: f64) -> [Option<f64>; 2] {
    let (c2, c3) = (3.0 * d - 2.0 * v0 - v1, v0 + v1 - 2.0 * d);
    // This form of the solution of v0 + 2·c2·u + 3·c3·u² = 0 avoids cancellation of digits.
    let root = (c2 * c2 - 3.0 * c3 * v0).sqrt();
    let q = -(c2 + root.copysign(c2));
    [q / (3.0 * c3), v0 / q].map(|u| (u > 0.0 && u < 1.0).then_some(u * (v0 + u * (c2 + u * c3))))
}

/// Returns all overshoots in one sentence; `None` for an empty list.
pub fn overshoot_words(all: &[Overshoot]) -> Option<String> {
    let each = all.iter().map(|o| {
        format!(
            "{} by {:.3} rad (to {:+.3} rad, after waypoint {})",
            o.joint, o.beyond_rad, o.position_rad, o.after
        )
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| {
        format!(
            "between waypoints the curve exceeds them: {}; place waypoints closer together, or give them velocities",
            each.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::Loaded;
    use super::*;

    #[test]
    fn what_the_curve_does_beyond_its_waypoints_is_known_before_it_runs() {
        let text =
            "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1,0.5,0,0,0,0,-0.1\n2,0.5,0,0,0,0,-0.2\n3,0,0,0,0,0,-0.3\n";
        let loaded = Loaded::parse(text, None).unwrap();
        let [over] = loaded.overshoot[..] else { panic!("{:?}", loaded.overshoot) };
        assert_eq!((over.joint.number(), over.after), (1, 2));
        // The spline passes through the positions 0, 0.5, 0.5, 0 and is at rest at both ends. The spline changes
        // direction at 1.5 s, with slopes of ±0.5 rad/s at the two middle points.
        assert!(
            (over.beyond_rad - 0.125).abs() < 1e-9 && (over.position_rad - 0.625).abs() < 1e-9,
            "{over:?}"
        );
        let words = overshoot_words(&loaded.overshoot).unwrap();
        assert!(words.contains("joint 1 by 0.125 rad (to +0.625 rad, after waypoint 2)"), "{words}");
        // The overshoot does not change if the times are resampled.
        let uneven = text.replace("\n3,", "\n3.0004,");
        let over = Loaded::parse(&uneven, None).unwrap().overshoot;
        assert!(over.len() == 1 && (over[0].beyond_rad - 0.125).abs() < 1e-3, "{over:?}");
        // A straight line has no overshoot.
        let straight =
            "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1,0.1,0,0,0,0,0\n2,0.3,0,0,0,0,0\n3,0.4,0,0,0,0,0\n";
        assert_eq!(Loaded::parse(straight, None).unwrap().overshoot, []);
        assert_eq!(overshoot_words(&[]), None);
    }
}
