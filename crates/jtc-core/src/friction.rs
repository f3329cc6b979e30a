//! Friction compensation of one joint (J-42).
use crate::interpolation::ROUNDING;
use crate::parameters::TableOf;

/// Returns the torque of the polynomial c0..c5 at speed `v` (rad/s) and temperature `t` (°C), N·m.
///
/// The torque is (1 + c4·(T − c5))·(c0·s + c1·v + c2·v²·s + c3·v³), with s as the smoothed sign of v. The temperature factor is clipped to
/// 0.2..2, because the straight line that was fitted to the measured drives becomes negative near 60 °C. Without the clip, the compensation
/// would then act against the motion.
pub fn polynomial(c: &[f64; 6], v: f64, t: f64, sign_width: f64) -> f64 {
    polynomial_by_slope(c, v, t, 1.0 / sign_width)
}

/// Like [`polynomial`], but with `sign_slope` (s/rad) instead of the width of the smoothed sign. Around standstill,
/// the smoothed sign is a straight line with this slope: it reaches ±1 at the speed 1/`sign_slope`.
#[inline]
pub fn polynomial_by_slope(c: &[f64; 6], v: f64, t: f64, sign_slope: f64) -> f64 {
    // If the speed is NaN, the c1 term makes the torque NaN.
    let s = within(v * sign_slope, -1.0, 1.0);
    warmth(c, t) * (c[0] * s + v * (c[1] + v * (c[2] * s + c[3] * v)))
}

/// Returns the Coulomb friction of the polynomial, N·m.
pub(crate) fn coulomb_of_polynomial(c: &[f64; 6], t: f64) -> f64 {
    (warmth(c, t) * c[0]).max(0.0)
}

/// Returns the factor of the temperature `t` (°C) in the polynomial.
fn warmth(c: &[f64; 6], t: f64) -> f64 {
    within(1.0 + c[4] * (t - c[5]), 0.2, 2.0)
}

/// Returns the Coulomb friction of the table, N·m. For each direction, a straight line through the torques at two slow speeds is extended
/// to standstill. The Coulomb friction is the lower of the two torques at standstill. Returns zero if the table does not contain the two
/// slow speeds.
pub(crate) fn coulomb_of_table(of: &TableOf<f32>, t: f64) -> f64 {
    const SLOW: f64 = 0.1;
    let at = |direction: f64| {
        let (near, far) = (table(of, direction * SLOW, t)?, table(of, 2.0 * direction * SLOW, t)?);
        Some((direction * (2.0 * near - far)).min(direction * near))
    };
    at(1.0).unwrap_or(0.0).min(at(-1.0).unwrap_or(0.0)).max(0.0)
}

/// Limits `x` to the range from `low` to `high`. The processor of the board has instructions for `max` and `min`, so
/// this is faster than `clamp`.
fn within(x: f64, low: f64, high: f64) -> f64 {
    x.max(low).min(high)
}

/// Returns the lowest and highest velocity of the table, rad/s.
pub fn velocities(table: &TableOf<f32>) -> (f64, f64) {
    ends(&table.velocity)
}

/// Returns the lowest and highest temperature of the table, °C.
pub fn temperatures(table: &TableOf<f32>) -> (f64, f64) {
    ends(&table.temperature)
}

fn ends(axis: &[f32; 20]) -> (f64, f64) {
    let [first, .., last] = axis;
    (f64::from(*first), f64::from(*last))
}

/// Returns the bilinear value of the table at speed `v` (rad/s) and temperature `t` (°C), N·m. For a temperature outside the table, the
/// column of the nearest temperature is used. Returns `None` for a velocity outside the table. The first and the last velocity of the table
/// are inside the table.
pub fn table(table: &TableOf<f32>, v: f64, t: f64) -> Option<f64> {
    let (slowest, fastest) = velocities(table);
    // The interpolation between two points can move a velocity out of the table by a rounding error. A velocity that is outside only by a
    // rounding error counts as inside the table.
    let inside = (v >= slowest - ROUNDING) & (v <= fastest + ROUNDING);
    let (coldest, warmest) = temperatures(table);
    // `clamp` is not used, because it may panic. A temperature of NaN becomes the lowest temperature.
    let (v, t) = (v.max(slowest).min(fastest), t.max(coldest).min(warmest));
    let (x, [row, next]) = locate(&table.velocity, table.torque.array_windows(), v)?;
    let columns = row.array_windows().zip(next.array_windows());
    let (y, ([a, b], [c, d])) = locate(&table.temperature, columns, t)?;
    let [a, b, c, d] = [a, b, c, d].map(|&torque| f64::from(torque));
    // First interpolates along the velocity, at both temperatures of the cell. Then interpolates between the two
    // results along the temperature.
    let (low, high) = (a + x * (c - a), b + x * (d - b));
    inside.then_some(low + y * (high - low))
}

/// Finds the cell of an axis that contains `value`, and the element of `cells` that belongs to it. Returns the
/// position of `value` within the cell (0..1) and this element. Returns `None` if `value` is outside the axis.
fn locate<T>(axis: &[f32; 20], cells: impl Iterator<Item = T>, value: f64) -> Option<(f64, T)> {
    let mut found = None;
    // The loop has no early exit, so that it takes the same number of instructions for every value.
    for (&[start, end], cell) in axis.array_windows().zip(cells) {
        if value >= f64::from(start) {
            found = Some((start, end, cell));
        }
    }
    let (start, end, cell) = found.filter(|_| value <= f64::from(axis[19]))?;
    Some(((value - f64::from(start)) / (f64::from(end) - f64::from(start)), cell))
}

/// Returns the temperature that a byte from a drive represents, °C. Drives send negative temperatures modulo 256, and no bearing reaches
/// 200 °C.
pub(crate) fn celsius(byte: u8) -> f64 {
    let t = f64::from(byte);
    if byte >= 200 { t - 256.0 } else { t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> TableOf<f32> {
        let velocity = core::array::from_fn(|i| -1.0 + i as f32 * 0.125);
        let temperature = core::array::from_fn(|i| 20.0 + i as f32 * 2.0);
        // The torque of this table is bilinear in velocity and temperature, so a correct interpolation reproduces the torque everywhere.
        let torque = core::array::from_fn(|r| {
            core::array::from_fn(|c| {
                3.0 + 2.0 * velocity[r] - 0.5 * temperature[c] + 0.25 * velocity[r] * temperature[c]
            })
        });
        TableOf { velocity, temperature, torque }
    }

    #[test]
    fn j42_table_includes_the_ends_of_both_axes() {
        let t = sample();
        for (v, temp) in [(-1.0, 20.0), (1.375, 58.0), (-1.0, 58.0), (0.125, 30.0)] {
            assert!(
                (table(&t, v, temp).unwrap() - (3.0 + 2.0 * v - 0.5 * temp + 0.25 * v * temp)).abs() < 1e-5
            );
        }
        for (v, temp) in [(-1.001, 30.0), (1.376, 30.0), (f64::NAN, 30.0)] {
            assert_eq!(table(&t, v, temp), None);
        }
    }

    #[test]
    fn j42_a_temperature_outside_the_table_has_the_nearest_column() {
        let t = sample();
        for v in [-1.0, 0.3, 1.375] {
            assert_eq!(table(&t, v, 5.0), table(&t, v, 20.0));
            assert_eq!(table(&t, v, 90.0), table(&t, v, 58.0));
            assert_ne!(table(&t, v, 20.0), table(&t, v, 58.0));
        }
    }

    #[test]
    fn j42_temperature_factor_never_turns_compensation_into_drag() {
        let c = [6.5, 46.5, -38.0, 21.0, -0.0272, 19.9];
        assert!(polynomial(&c, 0.5, 100.0, 0.02) > 0.0);
        let cold = polynomial(&c, 0.5, -200.0, 0.02);
        assert!(
            (cold - 2.0 * polynomial(&[c[0], c[1], c[2], c[3], 0.0, 0.0], 0.5, 25.0, 0.02)).abs() < 1e-12
        );
    }

    #[test]
    fn j42_four_coefficients_do_not_depend_on_temperature() {
        let c = [8.0, 49.0, -34.0, 14.5, 0.0, 0.0];
        assert_eq!(polynomial(&c, 0.3, 10.0, 0.02), polynomial(&c, 0.3, 70.0, 0.02));
        let v: f64 = 0.3;
        let expected = 8.0 + 49.0 * v - 34.0 * v * v + 14.5 * v * v * v;
        assert!((polynomial(&c, v, 10.0, 0.02) - expected).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn j42_table_is_bilinear(v in -1.0..1.375f64, temp in 20.0..58.0f64) {
            let expected = 3.0 + 2.0 * v - 0.5 * temp + 0.25 * v * temp;
            prop_assert!((table(&sample(), v, temp).unwrap() - expected).abs() < 1e-4);
        }

        #[test]
        fn j42_polynomial_is_odd_and_continuous(c in prop::array::uniform6(-5.0..5.0f64), v in -1.5..1.5f64, t in 0.0..80.0f64) {
            let at = |v| polynomial(&c, v, t, 0.02);
            prop_assert!((at(v) + at(-v)).abs() < 1e-9);
            prop_assert!((at(v + 1e-9) - at(v)).abs() < 1e-5);
            prop_assert_eq!(at(0.0), 0.0);
        }
    }

    #[test]
    fn j42_a_byte_of_temperature_is_below_zero_from_200_on() {
        assert_eq!([0, 1, 25, 199].map(celsius), [0.0, 1.0, 25.0, 199.0]);
        assert_eq!([200, 246, 255].map(celsius), [-56.0, -10.0, -1.0]);
    }

    /// At a velocity outside the table by at most the rounding tolerance, the torque at the end of the table is used.
    /// At twice the rounding tolerance, the table has no torque.
    #[test]
    fn j36_j42_what_rounding_adds_to_a_velocity_has_the_torque_at_the_end() {
        let t = sample();
        for (end, outward) in [(-1.0, -1.0), (1.375, 1.0)] {
            for added in [0.5 * ROUNDING, ROUNDING] {
                assert_eq!(table(&t, end + outward * added, 30.0), table(&t, end, 30.0));
            }
            assert_eq!(table(&t, end + outward * 2.0 * ROUNDING, 30.0), None);
        }
    }

    #[test]
    fn j42_the_temperature_factor_reaches_from_a_fifth_to_twice() {
        let at = |factor: f64| polynomial(&[2.0, 0.0, 0.0, 0.0, 1.0, 20.0], 0.5, 19.0 + factor, 0.02);
        assert_eq!([0.1, 0.2, 1.0, 1.5, 2.0, 2.1].map(at), [0.4, 0.4, 2.0, 3.0, 4.0, 4.0]);
    }

    #[test]
    fn j42_the_coulomb_friction_of_the_polynomial_is_c0_times_the_temperature_factor() {
        // At 20.5 °C, the factor is 1 + 1 · (20.5 − 20) = 1.5.
        for (c0, t, coulomb) in [(4.0, 20.5, 6.0), (4.0, 20.0, 4.0), (4.0, 0.0, 0.8), (-4.0, 20.5, 0.0)] {
            let found = coulomb_of_polynomial(&[c0, 9.0, 9.0, 9.0, 1.0, 20.0], t);
            assert!((found - coulomb).abs() < 1e-12, "{c0} {t}: {found}");
        }
    }

    /// Returns a table with the friction torque `c0 + c1·|v|` against the motion. `forward` and `backward` contain c0
    /// and c1 for each direction. The velocities are `first + i · 0.1`, rad/s.
    fn straight(first: f32, forward: [f32; 2], backward: [f32; 2]) -> TableOf<f32> {
        let velocity: [f32; 20] = core::array::from_fn(|i| first + i as f32 * 0.1);
        let torque = velocity.map(|v| {
            let [c0, c1] = if v > 0.0 { forward } else { backward };
            [(c0 + c1 * v.abs()) * v.signum(); 20]
        });
        TableOf { velocity, temperature: core::array::from_fn(|i| 20.0 + i as f32), torque }
    }

    /// A straight line through the torques at 0.1 and 0.2 rad/s gives the torque at standstill, but at most the
    /// torque at 0.1 rad/s. The Coulomb friction is the lower torque of both directions.
    #[test]
    fn j42_the_coulomb_friction_of_the_table_is_the_lower_torque_at_standstill() {
        for (first, forward, backward, coulomb) in [
            // The line of the forward direction gives 4 N·m at standstill, and the line of the backward direction
            // gives 6 N·m.
            (-0.95, [4.0, 3.0], [6.0, 3.0], 4.0),
            (-0.95, [6.0, 3.0], [4.0, 3.0], 4.0),
            // In the forward direction the torque falls with the speed, so the torque at 0.1 rad/s is used: 5 − 2 ·
            // 0.1 = 4.8 N·m.
            (-0.95, [5.0, -2.0], [6.0, 3.0], 4.8),
            (-0.95, [6.0, 3.0], [5.0, -2.0], 4.8),
            // A torque in the direction of the motion is not friction, so the Coulomb friction is 0.
            (-0.95, [-4.0, 0.0], [6.0, 3.0], 0.0),
            (-0.95, [6.0, 3.0], [-4.0, 0.0], 0.0),
            // In one direction the table does not reach 0.2 rad/s, so the Coulomb friction is 0.
            (-0.15, [4.0, 3.0], [6.0, 3.0], 0.0),
            (-1.75, [4.0, 3.0], [6.0, 3.0], 0.0),
        ] {
            let found = coulomb_of_table(&straight(first, forward, backward), 25.0);
            assert!((found - coulomb).abs() < 1e-5, "{first} {forward:?} {backward:?}: {found}");
        }
    }
}
