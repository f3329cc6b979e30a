//! Equivalent joint positions within the position limits. Equivalent positions differ by whole turns of a joint.
use std::f64::consts::TAU;

use jtc_dynamics::{JOINTS, JointVec};
use jtc_wire::Joint;

/// Distance beyond a limit that is tolerated because of the rounding errors of solutions, rad.
pub(crate) const ROUNDING: f64 = 1e-10;

type Limits = [(f64, f64); JOINTS];

/// Returns `angle` if the angle is within the limits, except for rounding.
fn within(angle: f64, (low, high): (f64, f64)) -> Option<f64> {
    (low <= high && low - ROUNDING <= angle && angle <= high + ROUNDING).then(|| angle.clamp(low, high))
}

/// Turns each joint of `q` by whole turns until it is as near to `near` as the limits permit. Returns `None` if a joint
/// is outside its limits at every number of turns.
pub(crate) fn nearest(q: &JointVec, near: &JointVec, limits: &Limits) -> Option<JointVec> {
    let mut found = *q;
    for (j, angle) in found.iter_mut().enumerate() {
        let turned = *angle + TAU * ((near[j] - *angle) / TAU).round();
        let ends = [limits[j].0, limits[j].1].map(|end| *angle + TAU * ((end - *angle) / TAU).round());
        // The turn nearest to `near` may be outside the limits. The nearest valid turn, if there is one, is then next
        // to one of the limits.
        let candidates = [turned, ends[0], ends[0] + TAU, ends[1], ends[1] - TAU];
        let inside = candidates.into_iter().filter_map(|angle| within(angle, limits[j]));
        *angle = inside.min_by(|a, b| (a - near[j]).abs().total_cmp(&(b - near[j]).abs()))?;
    }
    Some(found)
}

/// Returns the variants of `q` within the limits. Each joint of `q` is within (−π, π]. In a variant, each joint is
/// unchanged or turned by ±2π.
pub(crate) fn variants(q: &JointVec, limits: &Limits) -> Vec<JointVec> {
    let mut all = vec![*q];
    for j in 0..JOINTS {
        let turned = [0.0, -TAU, TAU].map(|turn| within(q[j] + turn, limits[j]));
        let set = |mut v: JointVec, angle: f64| {
            v[j] = angle;
            v
        };
        all = all.iter().flat_map(|v| turned.iter().flatten().map(|&angle| set(*v, angle))).collect();
    }
    all
}

/// A joint outside its limits.
pub(crate) struct Outside {
    pub joint: Joint,
    /// Position, rad.
    pub value: f64,
    /// Distance of the position beyond the limit, rad.
    pub beyond: f64,
}

/// Returns the joint that is farthest outside its limits. For each joint, the function uses the turn that is least
/// outside the limits.
pub(crate) fn outside(q: &JointVec, limits: &Limits) -> Outside {
    let mut worst = Outside { joint: Joint::ALL[0], value: q[0], beyond: f64::NEG_INFINITY };
    for (joint, (&angle, &(low, high))) in Joint::ALL.into_iter().zip(q.iter().zip(limits)) {
        let middle = 0.5 * (low + high);
        let value = angle + TAU * ((middle - angle) / TAU).round();
        let beyond = (low - value).max(value - high);
        if beyond > worst.beyond {
            worst = Outside { joint, value, beyond };
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_rounding_leaves_beyond_a_limit_is_the_limit() {
        let (limits, near) = ([(-1.0, 2.0); JOINTS], [0.0; JOINTS]);
        for (angle, limit) in [(-1.0 - 5e-11, -1.0), (2.0 + 5e-11, 2.0)] {
            let q = [angle; JOINTS];
            assert_eq!(nearest(&q, &near, &limits), Some([limit; JOINTS]));
            assert_eq!(variants(&q, &limits), vec![[limit; JOINTS]]);
        }
        for angle in [-1.0 - 2e-10, 2.0 + 2e-10] {
            let q = [angle; JOINTS];
            assert_eq!(nearest(&q, &near, &limits), None);
            assert!(variants(&q, &limits).is_empty());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// The test compares the result with a search over all turns in a wide range.
        #[test]
        fn the_nearest_turn_is_the_nearest_of_all(
            angle in -3.1..3.1f64, near in -20.0..20.0f64, low in -15.0..10.0f64, width in 0.1..14.0f64
        ) {
            let limits = [(low, low + width); JOINTS];
            let inside = (-6..=6).map(|k| angle + TAU * f64::from(k)).filter(|a| (low..=low + width).contains(a));
            let wanted = inside.min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()));
            let got = nearest(&[angle; JOINTS], &[near; JOINTS], &limits);
            match (wanted, got) {
                (Some(wanted), Some(got)) => prop_assert!(got.iter().all(|q| (q - wanted).abs() < 1e-9)),
                (wanted, got) => prop_assert!(wanted.is_none() && got.is_none(), "{wanted:?} {got:?}"),
            }
        }

        #[test]
        fn variants_are_the_turns_within_the_limits(
            q in prop::array::uniform6(-3.1..3.1f64), limits in prop::array::uniform6((-7.0..0.0f64, 0.0..7.0f64))
        ) {
            let all = variants(&q, &limits);
            let count = |j: usize| {
                let turns = [-1.0, 0.0, 1.0].map(|k| q[j] + k * TAU);
                turns.iter().filter(|&&a| limits[j].0 <= a && a <= limits[j].1).count()
            };
            prop_assert_eq!(all.len(), (0..JOINTS).map(count).product::<usize>());
            for v in &all {
                for j in 0..JOINTS {
                    prop_assert!(limits[j].0 <= v[j] && v[j] <= limits[j].1);
                    prop_assert!(((v[j] - q[j]) / TAU - ((v[j] - q[j]) / TAU).round()).abs() < 1e-12);
                }
            }
        }

        #[test]
        fn what_is_outside_in_any_turn_is_named_with_the_turn_that_is_the_least(
            inner in prop::array::uniform6(-0.5..0.5f64), joint in 0..JOINTS, angle in 1.0..3.1f64, negative in any::<bool>()
        ) {
            let mut q = inner;
            q[joint] = if negative { -angle } else { angle };
            let found = outside(&q, &[(-0.6, 0.6); JOINTS]);
            prop_assert_eq!((found.joint.index(), found.value), (joint, q[joint]));
            prop_assert!((found.beyond - (angle - 0.6)).abs() < 1e-12);
        }
    }
}
