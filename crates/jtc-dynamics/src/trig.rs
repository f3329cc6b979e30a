//! Sine, cosine and square root of f64 without the standard library. Sine and cosine have no branches that depend on the argument.
//!
//! A table contains sine and cosine of 128 directions. The functions rotate the values of the nearest direction by the remaining
//! angle. The remaining angle is at most π/128, so that short polynomials suffice.

/// Number of directions per full turn in the table; a power of two.
const DIRECTIONS: usize = 128;
/// Reciprocal of the angle between two directions, 1/rad.
const PER_RAD: f64 = 20.371832715762604;
/// The angle between two directions, π/64, in two parts. The first part has 28 significant bits, so its product with a number of steps
/// below 2^25 is exact.
const STEP: [f64; 2] = [0.049087385181337595, 3.100292436501689e-11];
/// 1.5·2^52. Adding this constant rounds a number to an integer and leaves this integer in the low bits of the sum.
const ROUND: f64 = 6755399441055744.0;
/// Coefficients of the minimax polynomial in r² for (sin r − r)/r³ on |r| ≤ π/128 (error of sin below 3e-17).
const SIN: [f64; 2] = [-0.1666666666295987, 0.00833315540165295];
/// Coefficients of the minimax polynomial in r² for (cos r − 1 + r²/2)/r⁴ on |r| ≤ π/128 (error of cos below 7e-20).
const COS: [f64; 2] = [0.0416666666614692, -0.001388865603520279];

/// Sines of the directions of the first quarter of a turn, rounded to the nearest f64.
const QUARTER: [f64; DIRECTIONS / 4 + 1] = [
    0.0,
    0.049067674327418015,
    0.0980171403295606,
    0.14673047445536175,
    0.19509032201612828,
    0.2429801799032639,
    0.2902846772544624,
    0.33688985339222005,
    0.3826834323650898,
    0.4275550934302821,
    0.47139673682599764,
    0.5141027441932218,
    0.5555702330196022,
    0.5956993044924334,
    0.6343932841636455,
    0.6715589548470184,
    0.7071067811865476,
    0.7409511253549591,
    0.773010453362737,
    0.8032075314806449,
    0.8314696123025452,
    0.8577286100002721,
    0.881921264348355,
    0.9039892931234433,
    0.9238795325112867,
    0.9415440651830208,
    0.9569403357322088,
    0.970031253194544,
    0.9807852804032304,
    0.989176509964781,
    0.9951847266721969,
    0.9987954562051724,
    1.0,
];

/// Sine and cosine of each direction in the table.
static TABLE: [[f64; 2]; DIRECTIONS] = table();

const fn table() -> [[f64; 2]; DIRECTIONS] {
    let mut table = [[0.0; 2]; DIRECTIONS];
    let mut k = 0;
    while k < DIRECTIONS {
        table[k] = [direction_sin(k), direction_sin(k + DIRECTIONS / 4)];
        k += 1;
    }
    table
}

/// Returns the sine of direction `k`, computed from the corresponding direction in the first quarter.
const fn direction_sin(k: usize) -> f64 {
    let (half, quarter) = (DIRECTIONS / 2, DIRECTIONS / 4);
    let in_half = k % half;
    let sin = if in_half <= quarter { QUARTER[in_half] } else { QUARTER[half - in_half] };
    if k % DIRECTIONS < half { sin } else { -sin }
}

/// Largest magnitude of an argument of [`sin_cos`], rad. Above this limit, both results are NaN.
pub const SIN_COS_MAX: f64 = 1.0e9;

/// Returns sine and cosine of `x` (rad).
///
/// The absolute error of sine and cosine is at most 2^-52 (2.3e-16) for |x| ≤ 1e6. For larger |x| the error grows to half the spacing of
/// f64 numbers around `x`. If |x| is above [`SIN_COS_MAX`], or `x` is NaN, both results are NaN. Every call executes the same
/// instructions, for every value of `x`.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    let rounded = x * PER_RAD + ROUND;
    let [sin, cos] = TABLE[rounded.to_bits() as usize % DIRECTIONS];
    // `k` is NaN if `x` is infinite or so large that the range reduction leaves no valid digits.
    let k = if x.abs() <= SIN_COS_MAX { rounded - ROUND } else { f64::NAN };
    let r = (x - k * STEP[0]) - k * STEP[1];
    let z = r * r;
    // `s` is sin r, and `c` is cos r − 1.
    let s = r + (r * z) * (SIN[0] + z * SIN[1]);
    let c = z * (z * (COS[0] + z * COS[1]) - 0.5);
    (sin + (cos * s + sin * c), cos + (cos * c - sin * s))
}

/// Returns the square root of a finite `x` ≥ 0 by Newton's method, with a relative error of at most 2^-52. Returns 0 for NaN, for negative
/// numbers, and for numbers below the normal range. The computation needs five divisions.
pub fn sqrt(x: f64) -> f64 {
    if x.is_nan() || x < f64::MIN_POSITIVE {
        return 0.0;
    }
    // Halving the exponent gives a first estimate of the root with an error below 6 %. Each Newton step squares the relative error.
    let mut y = f64::from_bits((x.to_bits() >> 1) + (1023 << 51));
    for _ in 0..5 {
        y = 0.5 * (y + x / y);
    }
    y
}

/// Returns the angle in (−π, π] of a direction with the given sine and cosine. The precomputation uses this function; the tick never uses
/// it.
pub(crate) fn angle(sin: f64, cos: f64) -> f64 {
    use core::f64::consts::{FRAC_PI_2, PI};
    let mut angle = if cos >= sin.abs() {
        0.0
    } else if -cos >= sin.abs() {
        if sin < 0.0 { -PI } else { PI }
    } else {
        FRAC_PI_2.copysign(sin)
    };
    // Each step reduces the error e to e − sin e. The error is below π/4 at first.
    for _ in 0..6 {
        let (s, c) = sin_cos(angle);
        angle += sin * c - cos * s;
    }
    angle
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};
    use proptest::prelude::*;

    #[test]
    fn square_roots_of_what_has_none_are_zero() {
        for x in [0.0, -0.0, -1.0, f64::NEG_INFINITY, f64::NAN, f64::MIN_POSITIVE / 2.0] {
            assert_eq!(sqrt(x), 0.0, "{x}");
        }
    }

    #[test]
    fn the_smallest_normal_number_has_a_square_root() {
        assert_eq!(sqrt(f64::MIN_POSITIVE), 2f64.powi(-511));
    }

    #[test]
    fn angles_along_the_axes_are_exact() {
        assert_eq!(angle(0.0, 1.0), 0.0);
        assert_eq!(angle(1.0, 0.0), FRAC_PI_2);
        assert_eq!(angle(-1.0, 0.0), -FRAC_PI_2);
        assert_eq!(angle(0.0, -1.0), PI, "not -π, which is no angle of the range");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn square_roots_are_those_of_the_processor(x in prop::num::f64::POSITIVE) {
            prop_assert!((sqrt(x) - x.sqrt()).abs() <= f64::EPSILON * x.sqrt(), "{x}: {}", sqrt(x));
        }

        #[test]
        fn an_angle_is_that_of_its_sine_and_cosine(wanted in -PI..PI) {
            let got = angle(wanted.sin(), wanted.cos());
            prop_assert!((got - wanted).abs() <= f64::EPSILON * PI, "{wanted}: {got}");
        }
    }
}
