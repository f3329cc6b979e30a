//! The same bits on every processor and at every optimisation level (J-40): what a board records replays on a PC.
mod arms;

use jtc_dynamics::Dynamics;

/// Numbers in (−1, 1), the same on every machine (xorshift).
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A sum over the bits of all results of 1 000 states. Fused multiply-add, another order of operations or another
/// polynomial changes it; then the figure below has to be set anew, on purpose, and old recordings replay no more.
#[test]
fn j40_results_are_the_same_bits_everywhere() {
    let d = Dynamics::new(&arms::avena(), [0.0, 0.0, -9.81]);
    let mut seed = 1;
    let mut sum = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |values: &[f64]| {
        for v in values {
            sum = (sum ^ v.to_bits()).wrapping_mul(0x0000_0100_0000_01b3);
        }
    };
    for _ in 0..1000 {
        let mut six = |scale: f64| [0.0; 6].map(|_: f64| scale * random(&mut seed));
        let (q, qd, qdd, torque) = (six(3.1), six(2.0), six(10.0), six(50.0));
        add(&d.inverse(&q, &qd, &qdd));
        add(&d.gravity_torque(&q));
        add(d.mass_matrix(&q).as_flattened());
        add(&d.forward(&q, &qd, &torque, &[0.7; 6]));
        add(&d.forward_kinematics(&q)[6].position);
    }
    assert_eq!(sum, 0x902e_2b92_06b5_d0f3, "{sum:#018x}");
}
