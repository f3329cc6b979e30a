//! Measures the duration of each function, and prints its name and time in nanoseconds: the minimum over many batches of calls.
//!
//! `cargo run --profile dist -p jtc-dynamics --example time -- FILE`, with a FILE that contains an arm and its states (format:
//! `lines/mod.rs`). `references/dynamics/anchors.py --ours` creates this file and measures the times of this crate and of other
//! implementations.
mod lines;

use std::hint::black_box;

use jtc_dynamics::{Dynamics, sin_cos};
use lines::Line;
use test_kit::clock::least_ns;

const BATCHES: usize = 101;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("usage: time FILE")?;
    let (mut dynamics, mut states) = (None, Vec::new());
    for line in std::fs::read_to_string(file)?.lines() {
        match lines::parse(line)? {
            Line::Model(model, gravity, payload) => {
                dynamics = Some(Dynamics::with_payload(&model, gravity, &payload));
            }
            Line::State(state) => states.push(state),
        }
    }
    let d = dynamics.ok_or("there is no model in the file")?;
    // Runs `$call` on every state. `black_box` prevents the compiler from removing the computation of a result.
    macro_rules! time {
        ($name:literal, |$state:ident| $call:expr) => {
            let least = least_ns(BATCHES, || {
                for $state in &states {
                    black_box($call);
                }
            });
            println!("{} {:.1}", $name, least / states.len() as f64);
        };
    }
    time!("sin_cos_6", |s| s[0].map(sin_cos));
    time!("inverse", |s| d.inverse(&s[0], &s[1], &s[2]));
    time!("gravity_torque", |s| d.gravity_torque(&s[0]));
    time!("mass_matrix", |s| d.mass_matrix(&s[0]));
    time!("forward", |s| d.forward(&s[0], &s[1], &s[3], &s[4]));
    time!("forward_kinematics", |s| d.forward_kinematics(&s[0]));
    Ok(())
}
