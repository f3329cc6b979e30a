//! Polynomials in Bernstein form. A curve over 0..1 lies within the convex hull of its control points (Farin 2002).

/// Highest number of successive halvings of one curve. Each halving reduces the distance between hull and curve to about a quarter.
const DEPTH: usize = 6;

/// Position in an interval at which a curve leaves its bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaves {
    /// Position in the interval, 0..1.
    pub at: f64,
    /// Value of the curve at the position `at`. If all permitted halvings were used, this is the value of a control
    /// point, and the curve itself possibly does not reach this value.
    pub value: f64,
    /// Bound that the curve leaves.
    pub bound: f64,
}

/// Returns the first position that the function finds at which the curve leaves `low..=high`. The position is exact at the ends of the
/// curve and at its halving points. If all `halvings` are used, the function checks the hull instead, so a curve that leaves the bounds
/// never passes.
pub(super) fn leaves<const N: usize>(
    curve: [f64; N],
    low: f64,
    high: f64,
    halvings: &mut u8,
) -> Option<Leaves> {
    // The stack contains the pieces of the curve that are not checked yet, from the end of the interval to its start.
    let mut stack = [(curve, 0.0, 1.0); DEPTH + 1];
    let mut waiting = 1;
    while waiting > 0 {
        waiting -= 1;
        let &(piece, start, width) = stack.get(waiting)?;
        let Some((value, bound)) = outside(&piece, low, high) else { continue };
        let end = |end: Option<&f64>, at| {
            let &value = end?;
            let bound = bound_crossed(value, low, high)?;
            Some(Leaves { at, value, bound })
        };
        let on_the_curve = end(piece.first(), start).or(end(piece.last(), start + width));
        if on_the_curve.is_some() {
            return on_the_curve;
        }
        // The stack has no space for the halves of a piece at the full depth.
        let (Some(left), true) = (halvings.checked_sub(1), waiting + 1 < stack.len()) else {
            return Some(Leaves { at: start + 0.5 * width, value, bound });
        };
        *halvings = left;
        let (front, rear) = halve(piece);
        let half = 0.5 * width;
        for part in [(rear, start + half, half), (front, start, half)] {
            if let Some(slot) = stack.get_mut(waiting) {
                *slot = part;
                waiting += 1;
            }
        }
    }
    None
}

/// Returns the control point that is furthest out of the bounds, and the bound that the point exceeds.
fn outside<const N: usize>(curve: &[f64; N], low: f64, high: f64) -> Option<(f64, f64)> {
    let lowest = curve.iter().fold(f64::INFINITY, |a, &b| a.min(b));
    let highest = curve.iter().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
    let furthest = if low - lowest > highest - high { lowest } else { highest };
    Some((furthest, bound_crossed(furthest, low, high)?))
}

/// Returns the bound that `value` crosses.
pub(super) fn bound_crossed(value: f64, low: f64, high: f64) -> Option<f64> {
    if value < low {
        Some(low)
    } else if value <= high {
        None
    } else {
        Some(high)
    }
}

/// Splits a curve into two halves (De Casteljau).
fn halve<const N: usize>(curve: [f64; N]) -> ([f64; N], [f64; N]) {
    let (mut front, mut rear) = (curve, curve);
    for level in 1..N {
        for i in (level..N).rev() {
            front[i] = 0.5 * (front[i - 1] + front[i]);
        }
    }
    for level in 1..N {
        for i in 0..N - level {
            rear[i] = 0.5 * (rear[i] + rear[i + 1]);
        }
    }
    (front, rear)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a parabola whose maximum, 0, is at position `top`.
    fn parabola(top: f64) -> [f64; 3] {
        [-top * top, top - top * top, -(1.0 - top) * (1.0 - top)]
    }

    #[test]
    fn j36_where_a_curve_leaves_its_bounds_is_where_it_is_halved() {
        let high = -1e-6;
        for top in [0.5, 0.25, 0.75, 0.125, 0.375, 0.625, 0.875] {
            let found = leaves(parabola(top), -10.0, high, &mut 255);
            assert_eq!(found, Some(Leaves { at: top, value: 0.0, bound: high }), "{top}");
            let below = leaves(parabola(top).map(|value| -value), 1e-6, 10.0, &mut 255);
            assert_eq!(below, Some(Leaves { at: top, value: 0.0, bound: 1e-6 }), "{top}");
        }
    }

    /// At the full depth, the check compares the hull with the bounds. Without this comparison, the check would skip a piece of the curve,
    /// and would miss a violation in this piece.
    #[test]
    fn j36_at_the_full_depth_the_hull_decides() {
        // The curve exceeds the bound 1 only from 0 to 0.006. This range is shorter than half of the smallest piece,
        // which has the length 1/64.
        let found = leaves([1.0, 1.003, 0.0], -10.0, 1.0, &mut 255).expect("it leaves its bounds");
        assert_eq!((found.at, found.bound), (1.0 / 128.0, 1.0));
        assert!(found.value > 1.0 && found.value < 1.0001, "{found:?}");
        // Only two halvings remain, so the curve cannot be halved to the full depth.
        let found = leaves([1.0, 1.003, 0.0], -10.0, 1.0, &mut 2).expect("it may leave them");
        assert_eq!((found.at, found.bound), (1.0 / 8.0, 1.0));
    }

    #[test]
    fn j36_of_a_hull_that_is_outside_on_both_sides_the_further_one_is_named() {
        for (curve, named) in [
            ([0.0, 3.0, -2.0, 0.0], (3.0, 1.0)),
            ([0.0, 2.0, -3.0, 0.0], (-3.0, -1.0)),
            // If a curve exceeds both bounds by equal distances, the function reports the upper bound.
            ([0.0, 2.0, -2.0, 0.0], (2.0, 1.0)),
        ] {
            let found = leaves(curve, -1.0, 1.0, &mut 0);
            assert_eq!(found, Some(Leaves { at: 0.5, value: named.0, bound: named.1 }));
        }
    }
}
