//! Tests that the simplified recursions for arms of known shape give the same result as the general recursion.
extern crate std;
use core::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;

use super::*;
use crate::model::{ArmModel, Link, Origin};
use crate::payload::Payload;

/// Generates arms whose axes have the directions of a shape, with random roll and yaw angles. Some neighbouring joints have the
/// same axis.
fn arm(axes: [Axes; JOINTS]) -> impl Strategy<Value = ArmModel> {
    let right = || prop::sample::select(std::vec![FRAC_PI_2, -FRAC_PI_2, 1.570796, -1.5707974]);
    let straight = || prop::sample::select(std::vec![0.0, PI, -PI, 3.141592, 1e-6]);
    let xyz = || prop_oneof![4 => prop::array::uniform3(-0.8..0.8f64), 1 => Just([0.0, 0.0, 0.3]), 1 => Just([0.0; 3])];
    let origin = move |(xyz, right, straight, yaw, by_pitch): ([f64; 3], f64, f64, f64, bool), axes| {
        let bend = if axes == Axes::Perpendicular { right } else { straight };
        Origin { xyz, rpy: if by_pitch { [0.0, bend, yaw] } else { [bend, 0.0, yaw] } }
    };
    let joints = prop::array::uniform6((xyz(), right(), straight(), -PI..PI, any::<bool>()));
    let links = prop::array::uniform6((prop::array::uniform9(-0.3..0.3f64), 0.2..9.0f64));
    (joints, links).prop_map(move |(joints, links)| {
        let mut model = ArmModel::default();
        for k in 0..JOINTS {
            model.joints[k] = origin(joints[k], axes[k]);
            let ([x, y, z, a, b, c, d, e, f], mass) = links[k];
            let origin = Origin { xyz: [x, y, z], rpy: [a, b, c] };
            model.links[k + 1] = Link { origin, inertia: [1.0 + a, d, e, 1.0 + b, f, 1.0 + c], mass };
        }
        model
    })
}

/// Checks that the recursion for a shape gives the same values as the general recursion, although it omits
/// multiplications by known zeros and ones.
fn same<S: Shape>(model: &ArmModel, shape: KnownShape, q: &JointVec, qd: &JointVec, qdd: &JointVec) {
    let chain = Chain::new(model, [0.3, -0.2, -9.81], &Payload::default());
    assert_eq!(chain.shape, shape);
    let any = inverse_of::<AnyShape>(&chain, q, qd, qdd);
    assert_eq!(inverse_of::<S>(&chain, q, qd, qdd), any);
    assert_eq!(inverse(&chain, q, qd, qdd), any);
}

fn vector(scale: f64) -> impl Strategy<Value = JointVec> {
    prop::array::uniform6(-scale..scale)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    #[test]
    fn j40_what_is_left_out_for_an_arm_of_known_shape_is_nothing(
        three in arm(ThreeParallel::AXES), two in arm(TwoParallel::AXES),
        q in vector(3.2), qd in vector(3.0), qdd in vector(20.0),
    ) {
        same::<ThreeParallel>(&three, KnownShape::ThreeParallel, &q, &qd, &qdd);
        same::<TwoParallel>(&two, KnownShape::TwoParallel, &q, &qd, &qdd);
    }
}

/// Axes that are nearly parallel or nearly at a right angle, or that have another direction, give the general shape.
#[test]
fn j40_an_arm_of_another_shape_is_any() {
    for bend in [0.3, 2.1e-6, FRAC_PI_2 + 2.1e-6] {
        let mut model = ArmModel::default();
        for k in [1, 4, 5] {
            model.joints[k].rpy = [FRAC_PI_2, 0.0, 0.7];
        }
        let shape = |model: &ArmModel| Chain::new(model, [0.0; 3], &Payload::default()).shape;
        assert_eq!(shape(&model), KnownShape::ThreeParallel);
        for k in 1..JOINTS {
            let mut bent = model;
            bent.joints[k].rpy[0] = bend;
            assert_eq!(shape(&bent), KnownShape::Any, "joint {} by {bend} rad", k + 1);
        }
    }
}
