//! Reduction of the number of positions of a recorded motion. Every removed position is close to the straight segment
//! between two remaining positions.

use jtc_core::JOINTS;

/// Returns the indices of the `positions` (rad) that remain after the reduction. For every removed position, the
/// distance from the straight segment between its remaining neighbours is at most `tolerance` (rad) in every joint.
/// The first and the last position always remain (Ramer 1972; Douglas & Peucker 1973).
pub fn thinned(positions: &[[f64; JOINTS]], tolerance: f64) -> Vec<usize> {
    let last = positions.len().saturating_sub(1);
    let mut keep = vec![false; positions.len()];
    for end in [0, last] {
        if let Some(kept) = keep.get_mut(end) {
            *kept = true;
        }
    }
    // The function uses a list instead of recursion, because recursion over a path with many positions could overflow
    // the stack.
    let mut parts = vec![(0, last)];
    while let Some((from, to)) = parts.pop() {
        let between = (from + 1..to).map(|i| (i, distance(&positions[i], &positions[from], &positions[to])));
        let Some((furthest, far)) = between.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if far > tolerance {
            keep[furthest] = true;
            parts.extend([(from, furthest), (furthest, to)]);
        }
    }
    (0..positions.len()).filter(|i| keep[*i]).collect()
}

/// Returns the distance from `p` to the nearest point of the segment between `a` and `b`. The distance is the largest
/// distance of a joint, rad.
fn distance(p: &[f64; JOINTS], a: &[f64; JOINTS], b: &[f64; JOINTS]) -> f64 {
    let dot =
        |u: &dyn Fn(usize) -> f64, v: &dyn Fn(usize) -> f64| (0..JOINTS).map(|j| u(j) * v(j)).sum::<f64>();
    let (leg, way) = (|j: usize| b[j] - a[j], |j: usize| p[j] - a[j]);
    let length = dot(&leg, &leg);
    let share = if length > 0.0 { (dot(&way, &leg) / length).clamp(0.0, 1.0) } else { 0.0 };
    (0..JOINTS).map(|j| (way(j) - share * leg(j)).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// After thinning a random path, every removed position is near a segment between two remaining positions.
        #[test]
        fn what_is_left_out_is_within_the_tolerance(
            steps in prop::collection::vec(prop::array::uniform6(-0.1..0.1f64), 2..80),
            tolerance in 0.001..0.2f64,
        ) {
            let mut at = [0.0; JOINTS];
            let positions: Vec<[f64; JOINTS]> = steps
                .iter()
                .map(|step| {
                    at = std::array::from_fn(|j| at[j] + step[j]);
                    at
                })
                .collect();
            let kept = thinned(&positions, tolerance);
            prop_assert_eq!((kept[0], *kept.last().unwrap()), (0, positions.len() - 1));
            for leg in kept.windows(2) {
                let (a, b) = (&positions[leg[0]], &positions[leg[1]]);
                for p in &positions[leg[0]..=leg[1]] {
                    // The test compares the formula with a search over many points of the segment.
                    let near = (0..=1000)
                        .map(|k| {
                            let u = f64::from(k) / 1000.0;
                            (0..JOINTS).map(|j| (p[j] - a[j] - u * (b[j] - a[j])).abs()).fold(0.0, f64::max)
                        })
                        .fold(f64::INFINITY, f64::min);
                    prop_assert!(near <= tolerance + 1e-3, "{near}");
                }
            }
        }
    }

    #[test]
    fn a_straight_walk_has_two_waypoints_and_a_corner_three() {
        let walk = |corner: f64| {
            (0..=20)
                .map(|i| [0.01 * f64::from(i), corner * f64::from(i.min(10)), 0.0, 0.0, 0.0, 0.0])
                .collect::<Vec<_>>()
        };
        assert_eq!(thinned(&walk(0.0), 0.002), [0, 20]);
        assert_eq!(thinned(&walk(0.02), 0.002), [0, 10, 20]);
        assert_eq!(thinned(&[[0.5; JOINTS]; 9], 0.002), [0, 8]);
        assert_eq!((thinned(&[], 0.1), thinned(&[[0.0; JOINTS]], 0.1)), (vec![], vec![0]));
    }
}
