//! Compares the crate's sine and cosine with the functions of the standard library.
use jtc_dynamics::{SIN_COS_MAX, sin_cos};
use proptest::prelude::*;

/// Documented error bound of the sine and cosine, 2^-52.
const BOUND: f64 = f64::EPSILON;

fn error(x: f64) -> f64 {
    let (s, c) = sin_cos(x);
    (s - x.sin()).abs().max((c - x.cos()).abs())
}

#[test]
fn j40_sine_and_cosine_stay_within_their_bound_around_every_quadrant() {
    let mut worst = 0.0f64;
    for quadrant in -2_000..2_000 {
        for step in -50..=50 {
            let x = f64::from(quadrant) * std::f64::consts::FRAC_PI_4 + f64::from(step) * 1.0e-3 / 3.0;
            worst = worst.max(error(x));
        }
    }
    println!("worst error {worst:e}");
    assert!(worst <= BOUND, "{worst:e}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn j40_sine_and_cosine_stay_within_their_bound(x in -1.0e6..1.0e6f64, y in -4.0..4.0f64) {
        prop_assert!(error(x) <= BOUND, "{x}: {:e}", error(x));
        prop_assert!(error(y) <= BOUND, "{y}: {:e}", error(y));
    }

    #[test]
    fn j40_far_angles_are_as_good_as_the_number_is(x in -1.0e9..1.0e9f64) {
        let spacing = f64::EPSILON * x.abs();
        prop_assert!(error(x) <= BOUND + 0.5 * spacing, "{x}: {:e}", error(x));
    }

    #[test]
    fn j07_any_bits_give_a_unit_vector_or_nan(bits in any::<u64>()) {
        let x = f64::from_bits(bits);
        let (s, c) = sin_cos(x);
        if x.abs() <= SIN_COS_MAX {
            prop_assert!((s * s + c * c - 1.0).abs() < 1e-15);
        } else {
            prop_assert!(s.is_nan() && c.is_nan());
        }
    }
}

#[test]
fn j40_the_largest_argument_still_has_a_sine() {
    for x in [SIN_COS_MAX, -SIN_COS_MAX] {
        assert!(error(x) <= BOUND + 0.5 * f64::EPSILON * SIN_COS_MAX, "{x}: {:e}", error(x));
    }
}

#[test]
fn j40_exact_where_it_can_be() {
    assert_eq!(sin_cos(0.0), (0.0, 1.0));
    for x in [1e-9, -1e-12, 1e-300, f64::MIN_POSITIVE] {
        assert_eq!(sin_cos(x).0, x);
    }
}
