//! Prints what a call costs: lines of a name and nanoseconds (median over batches of calls on random states).
//!
//! `cargo run --release -p jtc-dynamics --example time`; with a file of six numbers a line (the `model` and `state` lines of
//! the example `reference`) as argument it takes that arm instead of its own.
use std::hint::black_box;
use std::time::Instant;

use jtc_dynamics::{ArmModel, Dynamics, JointVec, Link, Origin, sin_cos};

const STATES: usize = 1024;
const BATCHES: usize = 101;

struct State {
    q: JointVec,
    qd: JointVec,
    qdd: JointVec,
    tau: JointVec,
}

fn main() {
    let d = Dynamics::new(&arm(), [0.0, 0.0, -9.81]);
    let mut random = Random(1);
    let mut vector = |scale: f64| -> JointVec { core::array::from_fn(|_| scale * random.next()) };
    let states: Vec<State> = (0..STATES)
        .map(|_| State { q: vector(3.1), qd: vector(2.0), qdd: vector(10.0), tau: vector(50.0) })
        .collect();
    let rotor = [0.7; 6];
    let time = |name: &str, call: &dyn Fn()| {
        let mut batches: Vec<f64> = (0..BATCHES)
            .map(|_| {
                let begin = Instant::now();
                call();
                begin.elapsed().as_secs_f64() * 1e9 / STATES as f64
            })
            .collect();
        batches.sort_by(f64::total_cmp);
        println!("{name} {:.1}", batches[BATCHES / 2]);
    };
    time("sin_cos_6", &|| states.iter().for_each(|s| drop(black_box(s.q.map(sin_cos)))));
    time("inverse", &|| states.iter().for_each(|s| drop(black_box(d.inverse(&s.q, &s.qd, &s.qdd)))));
    time("gravity_torque", &|| states.iter().for_each(|s| drop(black_box(d.gravity_torque(&s.q)))));
    time("mass_matrix", &|| states.iter().for_each(|s| drop(black_box(d.mass_matrix(&s.q)))));
    time("forward", &|| states.iter().for_each(|s| drop(black_box(d.forward(&s.q, &s.qd, &s.tau, &rotor)))));
    time("forward_kinematics", &|| states.iter().for_each(|s| drop(black_box(d.forward_kinematics(&s.q)))));
}

/// A general arm: no angle or offset is one that a compiler could use.
fn arm() -> ArmModel {
    let mut random = Random(7);
    let mut triple = |scale: f64| -> [f64; 3] { core::array::from_fn(|_| scale * random.next()) };
    let mut model = ArmModel::default();
    for joint in &mut model.joints {
        *joint = Origin { xyz: triple(0.4), rpy: triple(3.0) };
    }
    for link in &mut model.links {
        let origin = Origin { xyz: triple(0.2), rpy: triple(3.0) };
        *link =
            Link { origin, inertia: [0.02, 0.001, -0.002, 0.03, 0.003, 0.04], mass: 3.0 + triple(2.0)[0] };
    }
    model
}

/// Numbers in (−1, 1), the same on every run (xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
