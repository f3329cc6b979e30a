//! Arms for the tests: the default arm, and arms from published Denavit-Hartenberg parameters.
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

use jtc_core::{Config, Parameters};
use jtc_dynamics::{ArmModel, JOINTS, JointVec, Origin, Pose};

/// Returns the default arm, which has three parallel axes.
pub(super) fn avena() -> ArmModel {
    Parameters::avena().model
}

/// Returns the position limits of the default arm, rad.
pub(super) fn avena_limits() -> [(f64, f64); JOINTS] {
    let config = Config::avena();
    std::array::from_fn(|joint| config.position_range(joint))
}

/// Returns an arm with these classic Denavit-Hartenberg parameters: d (m), a (m) and α (rad) for each joint.
pub(super) fn by_dh(parameters: [[f64; 3]; JOINTS]) -> ArmModel {
    let mut model = ArmModel::default();
    for (joint, [d, a, alpha]) in model.joints[1..].iter_mut().zip(parameters) {
        *joint = Origin { xyz: [a, 0.0, d], rpy: [alpha, 0.0, 0.0] };
    }
    model
}

/// Returns a Universal Robots UR5, which has three parallel axes.
pub(super) fn ur5() -> ArmModel {
    by_dh([
        [0.089159, 0.0, FRAC_PI_2],
        [0.0, -0.425, 0.0],
        [0.0, -0.39225, 0.0],
        [0.10915, 0.0, FRAC_PI_2],
        [0.09465, 0.0, -FRAC_PI_2],
        [0.0823, 0.0, 0.0],
    ])
}

/// Returns a Unimation PUMA 560 (Corke and Armstrong-Hélouvry 1994), which has a spherical wrist. Its axes 1 and 2
/// meet.
pub(super) fn puma560() -> ArmModel {
    by_dh([
        [0.0, 0.0, FRAC_PI_2],
        [0.0, 0.4318, 0.0],
        [0.15005, 0.0203, -FRAC_PI_2],
        [0.4318, 0.0, FRAC_PI_2],
        [0.0, 0.0, -FRAC_PI_2],
        [0.0, 0.0, 0.0],
    ])
}

/// Returns a KUKA KR 5 arc, which has a spherical wrist. Its axes 1 and 2 do not meet.
pub(super) fn kr5() -> ArmModel {
    by_dh([
        [0.4, 0.18, -FRAC_PI_2],
        [0.0, 0.6, 0.0],
        [0.0, 0.12, FRAC_PI_2],
        [0.62, 0.0, -FRAC_PI_2],
        [0.0, 0.0, FRAC_PI_2],
        [0.115, 0.0, 0.0],
    ])
}

/// Returns a Kinova Jaco 2 with six joints and a curved wrist (j2s6s200), which has no closed form.
pub(super) fn jaco2() -> ArmModel {
    // The curved link moves each of its two axes by sin(a)/sin(2a) = 1/√3 of a link. The angle a = 30° is half of the
    // angle between the two axes.
    let part = 0.0741 / 3f64.sqrt();
    by_dh([
        [0.2755, 0.0, FRAC_PI_2],
        [0.0, 0.29, PI],
        [-0.007, 0.0, FRAC_PI_2],
        [-(0.1233 + part), 0.0, FRAC_PI_3],
        [-2.0 * part, 0.0, FRAC_PI_3],
        [-(part + 0.16), 0.0, PI],
    ])
}

/// Returns an arm whose axes have arbitrary directions, so that it has no closed form.
pub(super) fn crooked() -> ArmModel {
    let joints = [
        ([0.02, 0.01, 0.12], [0.1, 0.2, 0.3]),
        ([0.06, 0.02, 0.1], [1.3, 0.2, 0.1]),
        ([0.31, 0.03, 0.02], [0.3, 0.2, -0.2]),
        ([0.25, -0.05, 0.04], [-1.2, 0.4, 0.2]),
        ([0.03, 0.05, 0.12], [1.1, -0.3, 0.6]),
        ([0.04, 0.02, 0.09], [-1.4, 0.1, 0.2]),
        ([0.01, 0.02, 0.08], [0.2, 0.1, 0.4]),
    ];
    ArmModel { joints: joints.map(|(xyz, rpy)| Origin { xyz, rpy }), ..ArmModel::default() }
}

/// Returns two arms with a spherical wrist. In one arm axes 2 and 3 meet, and in the other arm axes 1 and 2 are parallel. The parameters
/// are invented.
pub(super) fn more_closed_forms() -> [(&'static str, ArmModel); 2] {
    let half = FRAC_PI_2;
    let wrist = [[0.4, 0.0, -half], [0.0, 0.0, half], [0.1, 0.0, 0.0]];
    let with = |arm: [[f64; 3]; 3]| by_dh([arm[0], arm[1], arm[2], wrist[0], wrist[1], wrist[2]]);
    [
        ("axes 2 and 3 meet", with([[0.3, 0.2, half], [0.0, 0.0, half], [0.5, 0.1, -1.2]])),
        ("axes 1 and 2 parallel", with([[0.3, 0.4, 0.0], [0.1, 0.3, half], [0.2, 0.25, half]])),
    ]
}

/// Returns all arms with their names.
pub(super) fn named() -> [(&'static str, ArmModel); 6] {
    [
        ("avena", avena()),
        ("UR5", ur5()),
        ("PUMA 560", puma560()),
        ("KR 5", kr5()),
        ("Jaco 2", jaco2()),
        ("crooked", crooked()),
    ]
}

/// Returns all arms.
pub(super) fn all() -> Vec<ArmModel> {
    named().into_iter().map(|(_, model)| model).collect()
}

type Mat3 = [[f64; 3]; 3];

fn product(a: &Mat3, b: &Mat3) -> Mat3 {
    std::array::from_fn(|i| std::array::from_fn(|k| (0..3).map(|j| a[i][j] * b[j][k]).sum()))
}

/// Returns the distance between two poses, in m and rad.
pub(super) fn difference(a: &Pose, b: &Pose) -> (f64, f64) {
    let shift = (0..3).map(|i| (a.position[i] - b.position[i]).powi(2)).sum::<f64>().sqrt();
    // The chord between two rotation matrices is 2·√2·sin(angle/2).
    let chord = a.rotation.as_flattened().iter().zip(b.rotation.as_flattened()).map(|(a, b)| (a - b).powi(2));
    (shift, 2.0 * (chord.sum::<f64>().sqrt() / 8f64.sqrt()).min(1.0).asin())
}

/// Returns the pose of the flange by forward kinematics as specified in J-40, independent of the project's code.
pub(super) fn pose(model: &ArmModel, q: &JointVec) -> Pose {
    let about = |axis: usize, angle: f64| {
        let (s, c) = angle.sin_cos();
        match axis {
            0 => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
            1 => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        }
    };
    // An angle within 2 µrad of a multiple of a right angle is rounded to this multiple.
    let squared = |angle: f64| {
        let quarters = (angle / FRAC_PI_2).round() * FRAC_PI_2;
        if (angle - quarters).abs() <= 2e-6 { quarters } else { angle }
    };
    let (mut rotation, mut position) = (about(0, 0.0), [0.0; 3]);
    for (k, joint) in model.joints.iter().enumerate() {
        position =
            std::array::from_fn(|i| position[i] + (0..3).map(|j| rotation[i][j] * joint.xyz[j]).sum::<f64>());
        let [roll, pitch, yaw] = joint.rpy.map(squared);
        for turn in
            [about(2, yaw), about(1, pitch), about(0, roll), about(2, q.get(k).copied().unwrap_or(0.0))]
        {
            rotation = product(&rotation, &turn);
        }
    }
    Pose { rotation, position }
}
