//! Measures what the crates reach and prints lines `name value`; `cargo xtask bench` puts them beside their anchors.
//!
//! Times are medians of many repetitions. Everything in virtual time is the same on every run.

mod line;
mod path;
mod tick;
mod tracking;
mod wire;
mod world;

use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let only = std::env::args().nth(1);
    let wanted = |name: &str| only.as_deref().is_none_or(|only| only == name);
    if wanted("wire") {
        wire::figures();
        wire::libm();
    }
    if wanted("tick") {
        tick::figures()?;
    }
    if wanted("line") {
        line::figures()?;
    }
    if wanted("tracking") {
        tracking::figures()?;
    }
    Ok(())
}

/// One figure.
fn print(name: &str, value: f64) {
    println!("{name} {value:.6}");
}

/// Median of `rounds` runs of `body`, in ns.
fn median_ns(rounds: usize, mut body: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..rounds)
        .map(|_| {
            let start = Instant::now();
            body();
            start.elapsed().as_secs_f64() * 1e9
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
