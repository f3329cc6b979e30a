//! Tests of an arm whose gears have stiction. At rest, the controller must not oscillate (hunt).
//!
//! With bristle friction, a joint stops as soon as stiction holds it, with a small deviation from the command. If the
//! integral term continues to grow at this deviation, the torque rises until the joint breaks away and stops on the
//! other side. The torque then oscillates permanently by twice the stiction torque. The frequency is a few tenths of
//! a hertz or, because of the encoder steps, higher. The test averages the torque command over 50 ms, which keeps
//! this oscillation and removes single encoder steps.
use jtc_core::JOINTS;
use jtc_sim::{FrictionModel, LuGre, Operator, SimConfig, host};

const FROM: [f64; JOINTS] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];
const TO: [f64; JOINTS] = [1.1, 0.4, -0.3, 1.2, 0.8, -0.9];
/// Averaging time, ms.
const MEAN_MS: u16 = 50;
/// Largest permitted peak-to-peak torque at rest, N·m: two encoder steps times the largest Kp.
const AT_REST: f64 = 1.6;

/// Returns the peak-to-peak torque command of each joint (means over 50 ms), N·m. The measurement covers 20 s of
/// HoldPos, and begins 2 s after a motion.
fn swing(seed: u64, model: FrictionModel) -> [f64; JOINTS] {
    let mut config = SimConfig { start: FROM, seed, baud: None, ..SimConfig::default() };
    config.arm.friction_model = model;
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
    operator.execute(10_000).unwrap();
    operator.run(2_000);
    let mut range = [(f64::INFINITY, f64::NEG_INFINITY); JOINTS];
    for _ in 0..20_000 / MEAN_MS {
        let mut mean = [0.0; JOINTS];
        for _ in 0..MEAN_MS {
            operator.step();
            let joints = &operator.world.telemetry().joints;
            mean.iter_mut().zip(joints).for_each(|(m, joint)| *m += joint.torque / f64::from(MEAN_MS));
        }
        for ((low, high), m) in range.iter_mut().zip(mean) {
            (*low, *high) = (low.min(m), high.max(m));
        }
    }
    range.map(|(low, high)| high - low)
}

/// At rest, no torque may oscillate by more than 1.6 N·m. If the integral term continued to grow at rest, the torque
/// of joints 1 to 3 would oscillate by 7 to 8 N·m in this test.
#[test]
fn j41_no_hunting_in_stiction() {
    for seed in [1, 2, 3] {
        let swing = swing(seed, FrictionModel::LuGre(LuGre::default()));
        println!("seed {seed}: {:?} N·m", swing.map(|x| (x * 100.0).round() / 100.0));
        for (j, swing) in swing.into_iter().enumerate() {
            assert!(swing <= AT_REST, "seed {seed}: joint {} hunts by {swing:.1} N·m", j + 1);
        }
    }
}

#[test]
fn j41_smooth_friction_shows_no_hunting() {
    let swing = swing(1, FrictionModel::Smooth { width: 0.01 });
    assert!(swing.iter().all(|&x| x <= AT_REST), "{swing:?} N·m");
}
