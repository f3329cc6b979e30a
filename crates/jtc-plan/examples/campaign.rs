//! Plans random motions and checks the samples of each motion.
//!
//!     cargo run --profile dist -p jtc-plan --example campaign -- [CASES [SEED]]
//!
//! The program prints the seed of every failed case. The program ends with exit code 1 if a case failed.
use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Instant;

use jtc_plan::{PlanError, point_to_point, through};

#[path = "../tests/judge/mod.rs"]
#[allow(dead_code, reason = "the tests use more")]
mod judge;

use judge::Case;

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let cases = numbers.first().copied().unwrap_or(1000);
    let seed = numbers.get(1).copied().unwrap_or_else(|| fastrand::u64(..1 << 32));
    println!("{cases} cases from seed {seed}");
    let (mut bad, mut used, mut refused) = (0, [0.0f64; 4], BTreeMap::<String, usize>::new());
    let mut slowest = (0.0, 0);
    for case_seed in (0..cases).map(|i| seed.wrapping_add(i)) {
        let case = Case::random(case_seed);
        let arm = case.arm();
        let start = Instant::now();
        let planned = if case.waypoints.len() == 2 && case_seed % 2 == 0 {
            point_to_point(&case.waypoints[0], &case.waypoints[1], &case.limits, arm.as_ref())
                .map(|m| (m, false))
        } else {
            through(&case.given(), case.blend, &case.limits, arm.as_ref()).map(|m| (m, true))
        };
        let taken = start.elapsed().as_secs_f64();
        if taken > slowest.0 {
            slowest = (taken, case_seed);
        }
        match planned {
            Ok((motion, on_legs)) => {
                let (wrong, shares) = case.judge(&motion, on_legs);
                for (used, share) in used.iter_mut().zip(shares) {
                    *used = used.max(share);
                }
                if !wrong.is_empty() {
                    bad += 1;
                    println!("seed {case_seed}:\n{wrong}");
                }
            }
            Err(error) => {
                if let PlanError::NoTimeLaw { .. } | PlanError::Path { .. } | PlanError::Position { .. } =
                    error
                {
                    bad += 1;
                    println!("seed {case_seed}: {error}");
                }
                let holding = matches!(error, PlanError::Torque { holding: true, .. });
                let name = format!("{error:?}").split(' ').next().unwrap_or_default().to_owned();
                *refused.entry(format!("{name}{}", if holding { ", holding" } else { "" })).or_default() += 1;
            }
        }
    }
    println!(
        "used of velocity {:.6}, acceleration {:.6}, jerk {:.6}, torque {:.6}",
        used[0], used[1], used[2], used[3]
    );
    println!("refused {refused:?}; slowest {:.1} ms, seed {}", slowest.0 * 1e3, slowest.1);
    println!("{bad} wrong");
    if bad == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
