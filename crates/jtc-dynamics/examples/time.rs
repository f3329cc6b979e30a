//! Prints what a call costs: lines of a name and nanoseconds, the median over batches of calls.
//!
//! `cargo run --release -p jtc-dynamics --example time -- FILE`, with an arm and its states as lines (see
//! `lines/mod.rs`). `references/dynamics/anchors.py --ours` makes such a file and times other implementations
//! beside this one.
mod lines;

use std::hint::black_box;
use std::time::Instant;

use jtc_dynamics::{Dynamics, sin_cos};
use lines::Line;

const BATCHES: usize = 101;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1).ok_or("usage: time FILE")?;
    let (mut dynamics, mut states) = (None, Vec::new());
    for line in std::fs::read_to_string(file)?.lines() {
        match lines::parse(line)? {
            Line::Model(model, gravity) => dynamics = Some(Dynamics::new(&model, gravity)),
            Line::State(state) => states.push(state),
        }
    }
    let d = dynamics.ok_or("there is no model in the file")?;
    // `$call` on every state; each result has to be made, none can be kept from one call to the next.
    macro_rules! time {
        ($name:literal, |$state:ident| $call:expr) => {
            let mut batches: Vec<f64> = (0..BATCHES)
                .map(|_| {
                    let begin = Instant::now();
                    for $state in &states {
                        black_box($call);
                    }
                    begin.elapsed().as_secs_f64() * 1e9 / states.len() as f64
                })
                .collect();
            batches.sort_by(f64::total_cmp);
            println!("{} {:.1}", $name, batches[BATCHES / 2]);
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
