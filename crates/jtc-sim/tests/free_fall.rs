//! The integration of the arm at 1 ms must be as accurate as the design requires.
use jtc_sim::{Arm, FrictionModel, LuGre, SimArm, SimFriction};

fn fall(q: [f64; 6], steps: u32, friction: Option<FrictionModel>) -> [f64; 6] {
    let mut parts = SimArm { stops: [(f64::NEG_INFINITY, f64::INFINITY); 6], ..SimArm::default() };
    match friction {
        Some(model) => parts.friction_model = model,
        None => parts.friction = std::array::from_fn(|_| SimFriction::Frictionless),
    }
    let mut arm = Arm::new(parts, [1.0; 6], q);
    for _ in 0..steps {
        arm.step(&[0.0; 6], 1.0 / f64::from(steps));
    }
    arm.q
}

#[test]
fn a_second_of_free_fall_at_1_ms_is_within_1_5_microradians() {
    for q in [[0.3, 0.5, -0.7, 0.4, 0.6, -0.2], [-1.0, 1.2, 0.4, -0.8, 1.5, 2.0]] {
        let (coarse, fine) = (fall(q, 1_000, None), fall(q, 100_000, None));
        let worst = coarse.iter().zip(&fine).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{q:?}: {worst:.2e} rad");
        assert!(worst <= 1.5e-6, "{worst} rad");
        assert!((fine[1] - q[1]).abs() > 0.5, "it did fall");
    }
}

#[test]
fn friction_is_integrated_stably_at_1_ms() {
    let q = [0.3, 0.5, -0.7, 0.4, 0.6, -0.2];
    for model in [FrictionModel::Smooth { width: 0.01 }, FrictionModel::LuGre(LuGre::default())] {
        let (coarse, fine) = (fall(q, 1_000, Some(model)), fall(q, 20_000, Some(model)));
        let worst = coarse.iter().zip(&fine).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{model:?}: {worst:.2e} rad");
        assert!(worst <= 1e-4, "{model:?}: {worst} rad");
    }
}

#[test]
fn end_stops_hold_a_falling_arm() {
    let mut arm = Arm::new(SimArm::default(), [1.0; 6], [0.0, 0.4, 0.0, 0.0, 0.0, 0.0]);
    for _ in 0..20_000 {
        arm.step(&[0.0; 6], 0.001);
    }
    let (_, high) = arm.parts().stops[1];
    assert!(arm.q[1] > high && arm.q[1] < high + 0.02, "{:?}", arm.q);
    assert!(arm.qd.iter().all(|v| v.abs() < 1e-2), "{:?}", arm.qd);
}
