//! The results of the crate are equal bit for bit on every processor and at every optimisation level (J-40). A PC can
//! therefore replay the recording of a board.
use crate::arms;

use jtc_dynamics::{ArmModel, Dynamics, Link, Origin};

/// Returns numbers in (−1, 1), with the same sequence on every machine (xorshift).
fn random(state: &mut u64) -> f64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// Hash of the bits of the results.
struct Sum(u64);

impl Sum {
    const NONE: Sum = Sum(0xcbf2_9ce4_8422_2325);

    fn add(&mut self, values: &[f64]) {
        for v in values {
            self.0 = (self.0 ^ v.to_bits()).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// Compares a hash of the bits of all results for 1 000 arm states. Fused multiply-add, another order of operations
/// or another polynomial changes the hash. A developer who makes such a change must update the expected hash, and old
/// recordings can then no longer be replayed.
#[test]
fn j40_results_are_the_same_bits_everywhere() {
    let d = Dynamics::new(&arms::avena(), [0.0, 0.0, -9.81]);
    let mut seed = 1;
    let mut sum = Sum::NONE;
    for _ in 0..1000 {
        let mut six = |scale: f64| [0.0; 6].map(|_: f64| scale * random(&mut seed));
        let (q, qd, qdd, torque) = (six(3.1), six(2.0), six(10.0), six(50.0));
        sum.add(&d.inverse(&q, &qd, &qdd));
        sum.add(&d.gravity_torque(&q));
        sum.add(d.mass_matrix(&q).as_flattened());
        sum.add(&d.forward(&q, &qd, &torque, &[0.7; 6]));
        sum.add(&d.forward_kinematics(&q)[6].position);
    }
    assert_eq!(sum.0, 0x700f_d817_6e8b_cbd5, "{:#018x}", sum.0);
}

/// Compares the hash for arms with random angles. A host may upload any arm model, and recordings with that model must also be
/// replayable.
#[test]
fn j40_every_arm_is_made_ready_to_the_same_bits() {
    let mut seed = 2;
    let mut sum = Sum::NONE;
    for _ in 0..300 {
        let mut six = |scale: f64| [0.0; 6].map(|_: f64| scale * random(&mut seed));
        let mut origin = || {
            let [x, y, z, roll, pitch, yaw] = six(3.1);
            Origin { xyz: [0.2 * x, 0.2 * y, 0.2 * z], rpy: [roll, pitch, yaw] }
        };
        let mut model = ArmModel::default();
        model.joints = model.joints.map(|_| origin());
        model.links = model.links.map(|_| Link { origin: origin(), ..Link::default() });
        for link in &mut model.links {
            (link.inertia, link.mass) = (six(0.2), 4.0 + six(3.0)[0]);
        }
        let d = Dynamics::new(&model, [0.3, -0.2, -9.81]);
        let (q, qd, qdd, torque) = (six(3.1), six(2.0), six(10.0), six(50.0));
        sum.add(&d.inverse(&q, &qd, &qdd));
        sum.add(&d.flange_torque(&q));
        sum.add(&d.forward(&q, &qd, &torque, &[0.7; 6]));
        sum.add(&d.forward_kinematics(&q)[6].position);
    }
    assert_eq!(sum.0, 0x1bfc_513c_a22d_4aaa, "{:#018x}", sum.0);
}
