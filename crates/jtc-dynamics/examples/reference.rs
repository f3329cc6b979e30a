//! Computes results for states of an arm, for comparison with other implementations.
//!
//! Standard input has lines in the format of `lines/mod.rs`. For each `state` the program prints one line of 144 numbers: inverse dynamics
//! and gravity torque (6 each), mass matrix (36, by rows), acceleration under the torque with and without rotors (6 each), and the poses of
//! the 7 frames (position, then rotation by rows).
mod lines;

use std::io::{BufRead, Write};

use jtc_dynamics::{Dynamics, JointVec};
use lines::Line;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut dynamics = None;
    for line in std::io::stdin().lock().lines() {
        match lines::parse(&line?)? {
            Line::Model(model, gravity, payload) => {
                model.check()?;
                payload.check()?;
                dynamics = Some(Dynamics::with_payload(&model, gravity, &payload));
            }
            Line::State(state) => {
                let d = dynamics.as_ref().ok_or("a state before the first model")?;
                let words: Vec<String> = answer(d, &state).iter().map(|v| format!("{v:.17e}")).collect();
                writeln!(out, "{}", words.join(" "))?;
            }
        }
    }
    Ok(())
}

fn answer(d: &Dynamics, [q, qd, qdd, tau, rotor]: &[JointVec; 5]) -> Vec<f64> {
    let mut all = Vec::new();
    all.extend(d.inverse(q, qd, qdd));
    all.extend(d.gravity_torque(q));
    all.extend(d.mass_matrix(q).as_flattened());
    all.extend(d.forward(q, qd, tau, rotor));
    all.extend(d.forward(q, qd, tau, &[0.0; 6]));
    for pose in d.forward_kinematics(q) {
        all.extend(pose.position);
        all.extend(pose.rotation.as_flattened());
    }
    all
}
