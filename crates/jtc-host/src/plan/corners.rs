//! Rounded corners of a motion: valid range of the blend, and notes about the distances between the motion and the waypoints.

use jtc_core::JOINTS;
use jtc_plan::furthest_joint;

use super::{PlanError, Planned};

/// Largest valid blend, rad. A larger value is probably an angle in degrees.
pub const BLEND_MAX: f64 = 0.5;
/// Largest valid blend of corners between lines and arcs, m. A larger value is probably a length in mm.
pub const BLEND_M_MAX: f64 = 0.5;
/// Distance (rad) above which a note reports that the motion misses a waypoint.
const NOTED: f64 = 0.05;
/// Maximum number of waypoints that one note lists.
const NAMED: usize = 3;

/// Rejects blends that are probably in a wrong unit. The planner itself rejects negative blends and NaN.
///
/// # Errors
///
/// Returns [`PlanError::Blend`] if a blend is too large.
pub(super) fn within_reason(blend: f64, blend_m: f64) -> Result<(), PlanError> {
    match (blend, blend_m) {
        (value, _) if value > BLEND_MAX => Err(PlanError::Blend { value, most: BLEND_MAX, unit: "rad" }),
        (_, value) if value > BLEND_M_MAX => Err(PlanError::Blend { value, most: BLEND_M_MAX, unit: "m" }),
        _ => Ok(()),
    }
}

/// Returns notes about the corners of a motion through `positions`. The notes list the waypoints that the motion misses by more than 0.05
/// rad. The notes also list the corners that are rounded by less than `blend` because a segment is too short.
pub(super) fn notes(planned: &Planned, positions: &[[f64; JOINTS]], blend: f64) -> Vec<String> {
    [missed(planned, positions), cut(positions, blend)].into_iter().flatten().collect()
}

/// Returns a note that lists the waypoints that the motion misses, each with the distance.
fn missed(planned: &Planned, positions: &[[f64; JOINTS]]) -> Option<String> {
    let (trajectory, times) = (&planned.trajectory, &planned.waypoint_times);
    let step_s = f64::from(trajectory.step_ms) * 1e-3;
    let index = |t: f64| ((t / step_s).max(0.0) as usize).min(trajectory.points.len());
    let miss = |i: usize| {
        let (before, at, after) = (times.get(i.checked_sub(1)?)?, times.get(i)?, times.get(i + 1)?);
        let point = trajectory.at_ms((1e3 * at).round().max(0.0) as u32)?.position;
        let near = trajectory.points.get(index(*before)..index(*after))?.iter().map(|point| point.position);
        let apart = near.chain([point]).map(|q| furthest_joint(&q, &positions[i]));
        apart.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(joint, by)| (i + 1, joint, by))
    };
    let mut all: Vec<_> = (0..positions.len()).filter_map(miss).filter(|miss| miss.2 > NOTED).collect();
    all.sort_by(|a, b| b.2.total_cmp(&a.2));
    let others = all.len().saturating_sub(NAMED);
    all.truncate(NAMED);
    let words = |(k, (waypoint, joint, by)): (usize, &(usize, _, f64))| {
        let missed = if k == 0 { " is missed" } else { "" };
        format!("waypoint {waypoint}{missed} by {by:.3} rad ({:.1}°) at {joint}", by.to_degrees())
    };
    let mut named: Vec<String> = all.iter().enumerate().map(words).collect();
    if others > 0 {
        named.push(format!("{others} more by smaller distances"));
    }
    (!named.is_empty()).then(|| format!("rounded corners: {}", named.join(", ")))
}

/// Returns a note that lists the corners whose segments are shorter than twice the blend.
fn cut(positions: &[[f64; JOINTS]], blend: f64) -> Option<String> {
    let leg = |a: &[f64; JOINTS], b: &[f64; JOINTS]| {
        let length = furthest_joint(a, b).1;
        (length, std::array::from_fn::<f64, JOINTS, _>(|j| (b[j] - a[j]) / length))
    };
    let is_cut = |three: &[[f64; JOINTS]]| {
        let ((before, from), (after, to)) = (leg(&three[0], &three[1]), leg(&three[1], &three[2]));
        let shorter = before.min(after);
        let (turn, back) = (furthest_joint(&from, &to).1, furthest_joint(&from, &to.map(|v| -v)).1);
        shorter > 1e-6 && shorter < 2.0 * blend && turn > 1e-6 && back > 1e-6
    };
    let corners = positions.windows(3).enumerate().filter(|(_, three)| is_cut(three));
    let all: Vec<String> = corners.map(|(i, _)| (i + 2).to_string()).collect();
    if blend <= NOTED || all.is_empty() {
        return None;
    }
    let named = all[..all.len().min(NAMED)].join(", ");
    let (s, more) = match all.len() {
        1 => ("", String::new()),
        n if n <= NAMED => ("s", String::new()),
        n => ("s", format!(" and {} more", n - NAMED)),
    };
    Some(format!(
        "the blend of {blend} rad is more than half of a leg at waypoint{s} {named}{more}: such a corner is rounded only within half of its shorter \
         leg"
    ))
}

#[cfg(test)]
mod tests {
    use jtc_core::Config;
    use proptest::prelude::*;

    use super::*;
    use crate::plan::{Planner, Waypoint};

    fn planned(positions: &[[f64; JOINTS]], blend: f64) -> Result<Planned, PlanError> {
        let config = Config::avena();
        let waypoints: Vec<_> = positions.iter().map(|q| Waypoint::from(*q)).collect();
        Planner { blend, jerk: false, ..Planner::new(&config) }.through(&waypoints)
    }

    /// Returns three waypoints with a corner at the second. Both segments have the length `length`, and only one
    /// joint moves in each segment.
    fn corner(length: f64) -> [[f64; JOINTS]; 3] {
        [[0.0; JOINTS], [length, 0.0, 0.0, 0.0, 0.0, 0.0], [length, length, 0.0, 0.0, 0.0, 0.0]]
    }

    #[test]
    fn a_blend_in_degrees_is_refused_where_rad_are_meant() {
        for taken in [0.0, 1e-6, 0.02, 0.0873, 0.3, 0.5] {
            assert!(planned(&corner(1.0), taken).is_ok(), "{taken}");
        }
        for refused in [0.5001, 0.6, 1.0, 2.0, 5.0, 10.0, 45.0, 90.0, 1e9, f64::INFINITY] {
            let error = planned(&corner(1.0), refused).unwrap_err();
            assert_eq!(error, PlanError::Blend { value: refused, most: 0.5, unit: "rad" });
        }
        for other in [-0.1, f64::NAN, f64::NEG_INFINITY] {
            assert!(matches!(planned(&corner(1.0), other), Err(PlanError::Plan(_))), "{other}");
        }
        for in_mm in [0.6, 5.0, 20.0, 300.0] {
            let error = PlanError::Blend { value: in_mm, most: 0.5, unit: "m" };
            assert_eq!(within_reason(0.1, in_mm), Err(error));
        }
        assert_eq!(within_reason(0.5, 0.5), Ok(()));
    }

    #[test]
    fn waypoints_that_rounded_corners_miss_are_named() {
        let notes = planned(&corner(1.0), 0.4).unwrap().notes;
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("rounded corners: waypoint 2 is missed by 0."), "{notes:?}");
        for little in [0.0, 0.02, 0.05, 0.1] {
            assert_eq!(planned(&corner(1.0), little).unwrap().notes, Vec::<String>::new(), "{little}");
        }
    }

    #[test]
    fn corners_that_are_cut_to_half_a_leg_are_named() {
        for (length, blend, named) in [
            (0.3, 0.2, true),
            (0.3, 0.5, true),
            (0.39, 0.2, true),
            (0.41, 0.2, false),
            (0.1, 0.06, true),
            (0.1, 0.05, false),
            (0.01, 0.3, true),
            (1.0, 0.5, false),
            (0.99, 0.5, true),
            (0.3, 0.0, false),
        ] {
            let note = cut(&corner(length), blend);
            assert_eq!(note.is_some(), named, "{length} rad, blend {blend}: {note:?}");
        }
        let [a, b, c] = corner(0.3);
        let there_and_back = [a, b, c, b, a, b, c, a, b, c, a, b];
        let note = cut(&there_and_back, 0.2).unwrap();
        assert!(note.contains("waypoints 2, 4, 6 and "), "{note}");
        // A straight continuation and a reversal, at which the arm stops, are not corners. Therefore the function
        // returns no note.
        let [straight, back] = [[a, b, b.map(|q| 2.0 * q)], [a, b, a]];
        assert_eq!((cut(&straight, 0.2), cut(&back, 0.2)), (None, None));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]

        /// The distances in the notes equal the distances from a search for the nearest position at each millisecond.
        #[test]
        fn notes_name_the_waypoints_that_are_missed(
            positions in prop::collection::vec(prop::array::uniform6(-1.0..1.0f64), 3..6), blend in 0.0..0.5f64
        ) {
            let planned = planned(&positions, blend).unwrap();
            let ends = (1e3 * planned.trajectory.duration_s()) as u32;
            let missed = |q: &[f64; JOINTS]| {
                let each = (0..=ends).filter_map(|ms| planned.trajectory.at_ms(ms));
                each.map(|point| furthest_joint(&point.position, q).1).fold(f64::INFINITY, f64::min)
            };
            let words = planned.notes.join("; ");
            for (i, q) in positions.iter().enumerate() {
                let (by, named) = (missed(q), words.contains(&format!("waypoint {} ", i + 1)));
                prop_assert!(by > NOTED - 0.01 || !named, "{by} rad from waypoint {}: {words}", i + 1);
                prop_assert!(by < NOTED + 0.01 || named || words.contains("more by smaller"), "{by}: {words}");
                prop_assert!(by <= blend + 1e-3, "{by} rad with a blend of {blend} rad");
            }
        }
    }
}
