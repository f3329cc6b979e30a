//! Lets arms fall freely for one second and prints their positions. Each line on stdin describes an arm. For each arm,
//! the example writes a line of six positions to stdout.
//!
//! Each input line contains 154 numbers: x y z roll pitch yaw for each of 7 joints; x y z roll pitch yaw Ixx Ixy Ixz
//! Iyy Iyz Izz mass for each of 7 links; gravity (3); rotor inertia, position and velocity for each of 6 joints. The
//! arms have no friction, end stops and drives. The integration is RK4 in steps of 1 ms, or in steps of the duration
//! (ms) in the first argument.
use std::io::{BufRead, Write};

use jtc_sim::{Arm, SimArm, SimFriction};

fn main() -> Result<(), String> {
    let step_ms: f64 = match std::env::args().nth(1) {
        Some(text) => text.parse().map_err(|e| format!("the step in ms is no number: `{text}`: {e}"))?,
        None => 1.0,
    };
    let mut out = std::io::stdout().lock();
    for (number, line) in (1..).zip(std::io::stdin().lock().lines()) {
        let line = line.map_err(|e| e.to_string())?;
        let q = fall(&line, step_ms).map_err(|e| format!("line {number}: {e}"))?;
        let words: Vec<_> = q.iter().map(|x| format!("{x:.17e}")).collect();
        writeln!(out, "{}", words.join(" ")).map_err(|e| e.to_string())?;
    }
    Ok(())
}

fn fall(line: &str, step_ms: f64) -> Result<[f64; 6], String> {
    let numbers: Vec<f64> = line
        .split_whitespace()
        .map(|word| word.parse().map_err(|e| format!("`{word}`: {e}")))
        .collect::<Result<_, _>>()?;
    if numbers.len() != 154 {
        return Err(format!("{} numbers instead of 154", numbers.len()));
    }
    let mut numbers = numbers.into_iter();
    let mut next = || numbers.next().unwrap_or(f64::NAN);
    let mut parts = SimArm::default();
    for joint in &mut parts.model.joints {
        joint.xyz = std::array::from_fn(|_| next());
        joint.rpy = std::array::from_fn(|_| next());
    }
    for link in &mut parts.model.links {
        link.origin.xyz = std::array::from_fn(|_| next());
        link.origin.rpy = std::array::from_fn(|_| next());
        link.inertia = std::array::from_fn(|_| next());
        link.mass = next();
    }
    parts.gravity = std::array::from_fn(|_| next());
    parts.rotor_inertia = std::array::from_fn(|_| next());
    parts.friction = std::array::from_fn(|_| SimFriction::Frictionless);
    parts.stops = [(f64::NEG_INFINITY, f64::INFINITY); 6];
    let q = std::array::from_fn(|_| next());
    let mut arm = Arm::new(parts, [1.0; 6], q);
    arm.qd = std::array::from_fn(|_| next());
    let steps = (1000.0 / step_ms).round() as u64;
    for _ in 0..steps {
        arm.step(&[0.0; 6], step_ms * 1e-3);
    }
    Ok(arm.q)
}
