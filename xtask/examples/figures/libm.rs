//! Execution time of sine and cosine in the mathematics library of the system, as a reference for the dynamics.
use std::hint::black_box;

use test_kit::clock::least_ns;

use crate::print;

pub(crate) fn figures() {
    const ROUNDS: usize = 101;
    let angles: Vec<f64> = (0..6144).map(|i| f64::from(i) * 0.001 - 3.0).collect();
    let least = least_ns(ROUNDS, || {
        for angle in &angles {
            black_box(black_box(angle).sin_cos());
        }
    });
    print("libm_sin_cos_6", 6.0 * least / angles.len() as f64);
}
