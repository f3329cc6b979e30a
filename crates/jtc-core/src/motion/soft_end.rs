//! Soft end of the position range of a joint. A spring acts against the joint if a hand or a push moves the joint towards a position limit
//! (J-25, J-68).

/// Distance from a position limit at which the spring begins to act, rad.
pub(crate) const SOFT_END: f64 = 0.1;

/// Returns the depth (rad) of a joint at `position` inside the soft end of its `range` (lowest and highest position, rad). The depth is
/// positive at the upper end and negative at the lower end.
pub(crate) fn depth(position: f64, range: (f64, f64)) -> f64 {
    let (low, high) = range;
    let above = (position - (high - SOFT_END)).max(0.0);
    let below = ((low + SOFT_END) - position).max(0.0);
    above - below
}

/// Returns the torque of the spring of a soft end that is compressed by `depth` (rad), N·m. At the position limit,
/// the torque is `most`.
pub(crate) fn spring(depth: f64, most: f64) -> f64 {
    -most * depth / SOFT_END
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j25_j68_the_spring_acts_from_a_tenth_before_each_limit() {
        for (position, expected) in
            [(0.0, 0.0), (1.9, 0.0), (1.95, -5.0), (2.0, -10.0), (2.1, -20.0), (-2.85, 0.0)]
        {
            let torque = spring(depth(position, (-3.0, 2.0)), 10.0);
            assert!((torque - expected).abs() < 1e-9, "{torque} N·m at {position} rad");
        }
        for (position, expected) in [(-2.9, 0.0), (-2.95, 5.0), (-3.0, 10.0)] {
            assert!((spring(depth(position, (-3.0, 2.0)), 10.0) - expected).abs() < 1e-9, "{position}");
        }
    }
}
