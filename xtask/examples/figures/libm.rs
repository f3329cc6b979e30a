//! Sine and cosine by the system's mathematics library, an anchor of the dynamics.
use std::hint::black_box;
use std::time::Instant;

use crate::print;

pub fn figures() {
    const ROUNDS: usize = 101;
    let angles: Vec<f64> = (0..6144).map(|i| f64::from(i) * 0.001 - 3.0).collect();
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            for angle in &angles {
                black_box(black_box(angle).sin_cos());
            }
            start.elapsed().as_secs_f64() * 1e9
        })
        .collect();
    times.sort_by(f64::total_cmp);
    print("libm_sin_cos_6", 6.0 * times[ROUNDS / 2] / angles.len() as f64);
}
