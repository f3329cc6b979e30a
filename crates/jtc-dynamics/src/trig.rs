//! Sine, cosine and square root of f64 without the standard library; sine and cosine without branches on the argument.

use core::f64::consts::FRAC_2_PI;

/// π/2 in three parts. The first two have 33 significant bits, so that their products with a quotient below
/// 2^20 are exact.
const HALF_PI: [f64; 3] = [1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21];
/// 1.5·2^52: adding it rounds to an integer and leaves that integer in the low bits of the sum.
const ROUND: f64 = 6755399441055744.0;
/// (sin r − r)/r³ as a polynomial in r², minimax on |r| ≤ π/4 (relative error of sin below 3.5e-18).
const SIN: [f64; 6] = [
    -0.16666666666666632,
    0.00833333333332237,
    -0.00019841269829771086,
    2.7557313678643845e-06,
    -2.505075595863526e-08,
    1.5896666370939634e-10,
];
/// (cos r − 1 + r²/2)/r⁴ as a polynomial in r², minimax on |r| ≤ π/4 (error of cos below 5e-20).
const COS: [f64; 6] = [
    0.0416666666666666,
    -0.0013888888888874064,
    2.480158728944353e-05,
    -2.755731434067416e-07,
    2.0875721625702183e-09,
    -1.1359559428690583e-11,
];

/// Largest argument that [`sin_cos`] takes, rad; beyond it the result is NaN.
pub const SIN_COS_MAX: f64 = 1.0e9;

/// Sine and cosine of `x` (rad).
///
/// The absolute error of each is at most 2^-52 (2.3e-16) for |x| ≤ 1e6 and grows to half the spacing of
/// numbers around `x` beyond. Above [`SIN_COS_MAX`] and for a NaN both results are NaN. Every call executes
/// the same instructions, whatever `x` is.
#[inline(always)]
pub fn sin_cos(x: f64) -> (f64, f64) {
    let rounded = x * FRAC_2_PI + ROUND;
    let quadrant = rounded.to_bits();
    // NaN where the reduction has no digits left, and for infinities.
    let k = if x.abs() <= SIN_COS_MAX { rounded - ROUND } else { f64::NAN };
    let r = ((x - k * HALF_PI[0]) - k * HALF_PI[1]) - k * HALF_PI[2];
    // The polynomials in pairs of terms: shorter to wait for than one term after the other.
    let z = r * r;
    let zz = z * z;
    let rz = r * z;
    let s = ((SIN[0] + z * SIN[1]) + zz * (SIN[2] + z * SIN[3])) + (zz * zz) * (SIN[4] + z * SIN[5]);
    let c = ((COS[0] + z * COS[1]) + zz * (COS[2] + z * COS[3])) + (zz * zz) * (COS[4] + z * COS[5]);
    let s = (r + rz * s).to_bits();
    let c = ((1.0 - 0.5 * z) + zz * c).to_bits();
    // Odd quadrants swap sine and cosine; bit 1 of the quadrant (of the next one for the cosine) is the sign.
    let swap = (quadrant & 1).wrapping_neg();
    let mixed = (s ^ c) & swap;
    let sign_s = (quadrant & 2) << 62;
    let sign_c = (quadrant.wrapping_add(1) & 2) << 62;
    (f64::from_bits((s ^ mixed) ^ sign_s), f64::from_bits((c ^ mixed) ^ sign_c))
}

/// Square root of a finite `x` ≥ 0 by Newton's method, within 2^-52 of its value; 0 for a NaN and for anything below the
/// normal numbers, negative ones among them. It takes five divisions.
pub fn sqrt(x: f64) -> f64 {
    if x.is_nan() || x < f64::MIN_POSITIVE {
        return 0.0;
    }
    // Halving the exponent is within 6 % of the root; each step squares the relative error.
    let mut y = f64::from_bits((x.to_bits() >> 1) + (1023 << 51));
    for _ in 0..5 {
        y = 0.5 * (y + x / y);
    }
    y
}

/// The angle in (−π, π] of a direction given by its sine and cosine. For set-up, not for the tick.
pub(crate) fn angle(sin: f64, cos: f64) -> f64 {
    use core::f64::consts::{FRAC_PI_2, PI};
    let mut angle = if cos >= sin.abs() {
        0.0
    } else if -cos >= sin.abs() {
        if sin < 0.0 { -PI } else { PI }
    } else {
        FRAC_PI_2.copysign(sin)
    };
    // Each step takes the error e (at first below π/4) to e − sin e.
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
