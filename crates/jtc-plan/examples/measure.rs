//! Measures the planning time, and the quality of jerk-limited motions, on fixed random waypoints.
//!
//!     cargo run --profile dist -p jtc-plan --example measure -- speed
//!     cargo run --profile dist -p jtc-plan --example measure -- quality [CASES [SEED [FILE]]]
//!
//! `speed` prints the processor time in ms, which is the shortest time of several runs. `quality` prints a line for
//! each kind of path, with these values:
//!
//! - sum of the durations of all motions, and ratio of this sum to the sum without a jerk limit;
//! - largest ratio of a single motion to the same motion without a jerk limit;
//! - number of motions that became slower when all limits were doubled;
//! - number of motions that could not be planned;
//! - processor time.
//!
//! The durations of all motions are written to FILE.
use std::fmt::Write as _;

use jtc_core::{Config, Parameters};
use jtc_plan::{ArmDynamics, BlendedPath, JOINTS, JointVec, Limits, Waypoint, along, through};

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, other: u64| words.get(i).and_then(|w| w.parse().ok()).unwrap_or(other);
    match words.first().map(String::as_str) {
        Some("speed") => speed(),
        Some("quality") => quality(number(1, 100), number(2, 1), words.get(3)),
        _ => eprintln!("measure what: speed, or quality"),
    }
}

/// Returns the processor time that this thread has used, ms (Linux).
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(f64::NAN) * 1e-6
}

fn random(rng: &mut fastrand::Rng, size: f64) -> JointVec {
    std::array::from_fn(|_| size * (2.0 * rng.f64() - 1.0))
}

/// Returns a random walk within ±1 rad, with steps of at most `size` rad per joint, as in `cargo xtask bench`.
fn walk(rng: &mut fastrand::Rng, count: usize, size: f64) -> Vec<JointVec> {
    let mut all = vec![[0.0; JOINTS]];
    while all.len() < count {
        let (last, step) = (all[all.len() - 1], random(rng, size));
        all.push(std::array::from_fn(|j| (last[j] + step[j]).clamp(-1.0, 1.0)));
    }
    all
}

fn given(positions: &[JointVec]) -> Vec<Waypoint> {
    positions.iter().copied().map(Waypoint::from).collect()
}

fn speed() {
    let (config, parameters) = (Config::avena(), Parameters::avena());
    let limits = Limits::of(&config);
    let arm = |friction| ArmDynamics::new(&config, &parameters.model, friction);
    let table = Parameters::avena_friction_table();
    let arms = [
        ("no torque", None),
        ("no friction", Some(arm(None))),
        ("polynomial", Some(arm(Some(&parameters.friction)))),
        ("table", Some(arm(Some(&table)))),
    ];
    for count in [100, 400] {
        let positions = walk(&mut fastrand::Rng::with_seed(1), count, 0.4);
        let path = BlendedPath::new(&positions, 0.05).expect("waypoints");
        for (name, arm) in &arms {
            let least = |plan: &dyn Fn() -> f64| {
                let mut duration = 0.0;
                let took = (0..if count > 100 { 4 } else { 12 }).map(|_| {
                    let before = cpu_ms();
                    duration = plan();
                    cpu_ms() - before
                });
                let took = took.fold(f64::INFINITY, f64::min);
                (took, duration)
            };
            let of_along = least(&|| along(&path, &limits, arm.as_ref()).map_or(f64::NAN, |m| m.duration()));
            let waypoints = given(&positions);
            let of_through = least(&|| {
                through(&waypoints, 0.05, &limits, arm.as_ref()).map_or(f64::NAN, |m| m.duration())
            });
            println!(
                "{count} waypoints, {name:12} along {:7.2} ms ({:.4} s), through {:7.2} ms ({:.4} s)",
                of_along.0, of_along.1, of_through.0, of_through.1
            );
        }
    }
}

struct Set {
    name: &'static str,
    /// Waypoints (rad) and blend (rad) of each path.
    paths: Vec<(Vec<JointVec>, f64)>,
}

/// Waypoints on a smooth closed curve.
fn curve(rng: &mut fastrand::Rng) -> impl Fn(usize) -> Vec<JointVec> {
    let amplitudes: [JointVec; 4] = std::array::from_fn(|_| random(rng, 0.5));
    move |count| {
        let at = |i: usize| -> JointVec {
            let turn = std::f64::consts::TAU * i as f64 / (count - 1) as f64;
            std::array::from_fn(|j| {
                amplitudes[0][j] * turn.sin()
                    + amplitudes[1][j] * (1.0 - turn.cos())
                    + 0.3
                        * (amplitudes[2][j] * (2.0 * turn).sin()
                            + amplitudes[3][j] * (1.0 - (2.0 * turn).cos()))
            })
        };
        (0..count).map(at).collect()
    }
}

fn sets(cases: u64, seed: u64) -> Vec<Set> {
    let mut sets = Vec::new();
    for (name, count, size) in [("walks of 5", 5, 0.8), ("walks of 12", 12, 0.4), ("walks of 40", 40, 0.15)] {
        let one = |i: u64| {
            let rng = &mut fastrand::Rng::with_seed(seed.wrapping_add(i));
            let blend = [0.02, 0.05, 0.1, 0.2][(i % 4) as usize];
            (walk(rng, count, size), blend)
        };
        sets.push(Set { name, paths: (0..cases).map(one).collect() });
    }
    for (name, count) in [
        ("curves by 12", 12),
        ("curves by 26", 26),
        ("curves by 51", 51),
        ("curves by 101", 101),
        ("curves by 401", 401),
    ] {
        let one = |i: u64| {
            let rng = &mut fastrand::Rng::with_seed(seed.wrapping_add(1000 + i));
            (curve(rng)(count), [0.02, 0.05, 0.1][(i % 3) as usize])
        };
        sets.push(Set { name, paths: (0..cases).map(one).collect() });
    }
    sets
}

fn doubled(limits: &Limits) -> Limits {
    let twice = |of: &JointVec| of.map(|x| 2.0 * x);
    Limits {
        velocity: twice(&limits.velocity),
        acceleration: twice(&limits.acceleration),
        jerk: twice(&limits.jerk),
        torque: limits.torque,
        ..limits.clone()
    }
}

fn quality(cases: u64, seed: u64, file: Option<&String>) {
    let (config, parameters) = (Config::avena(), Parameters::avena());
    let limits = Limits::of(&config);
    let arm = ArmDynamics::new(&config, &parameters.model, Some(&parameters.friction));
    let mut lines = String::new();
    for (with, arm) in [("", None), (" torque", Some(&arm))] {
        for Set { name, paths } in sets(cases, seed) {
            if arm.is_some() && name.contains("01") {
                continue;
            }
            let (mut sum, mut sum_without, mut worst, mut slower, mut by) = (0.0, 0.0, 0.0f64, 0, 0.0f64);
            let before = cpu_ms();
            let mut refused = 0;
            for (i, (positions, blend)) in paths.iter().enumerate() {
                let waypoints = given(positions);
                let plan = |limits: &Limits| through(&waypoints, *blend, limits, arm).map(|m| m.duration());
                let (Ok(motion), Ok(without), Ok(doubled)) =
                    (plan(&limits), plan(&limits.clone().without_jerk()), plan(&doubled(&limits)))
                else {
                    refused += 1;
                    continue;
                };
                let _ = writeln!(lines, "{name}{with} {i} {motion:.6} {without:.6} {doubled:.6}");
                (sum, sum_without) = (sum + motion, sum_without + without);
                worst = worst.max(motion / without);
                slower += u32::from(doubled > motion * (1.0 + 1e-6));
                by = by.max(doubled / motion);
            }
            println!(
                "{:22} {sum:9.3} s, {:.4} of {sum_without:9.3} s, worst {worst:.3}; doubled: {slower} slower, worst {by:.3}; refused {refused}; {:.0} ms",
                format!("{name}{with}"),
                sum / sum_without,
                cpu_ms() - before
            );
        }
    }
    if let Some(file) = file {
        std::fs::write(file, lines).expect("a file that can be written");
    }
}
