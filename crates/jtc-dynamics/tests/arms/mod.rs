//! Arms for the tests: the default arm from its file, and random arms.
use jtc_dynamics::{ArmModel, JointVec, Link, Origin};
use proptest::prelude::*;

/// Returns the arm of `arms/avena.toml`.
pub(crate) fn avena() -> ArmModel {
    let file: toml::Table = include_str!("../../../../arms/avena.toml").parse().expect("arms/avena.toml");
    let number =
        |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64)).expect("a number");
    fn row<const N: usize>(t: &toml::Value, key: &str, number: &dyn Fn(&toml::Value) -> f64) -> [f64; N] {
        let values: Vec<f64> = t[key].as_array().expect(key).iter().map(number).collect();
        values.try_into().expect(key)
    }
    let mut model = ArmModel::default();
    for (joint, t) in model.joints.iter_mut().zip(file["joint"].as_array().expect("joints")) {
        *joint = Origin { xyz: row(t, "origin_xyz_m", &number), rpy: row(t, "origin_rpy_rad", &number) };
    }
    for (link, t) in model.links.iter_mut().zip(file["link"].as_array().expect("links")) {
        let origin = Origin { xyz: row(t, "com_xyz_m", &number), rpy: row(t, "com_rpy_rad", &number) };
        *link = Link { origin, inertia: row(t, "inertia_kg_m2", &number), mass: number(&t["mass_kg"]) };
    }
    model
}

fn triple(scale: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-scale..scale)
}

/// Generates random angles. Many of these angles are equal or close to angles of real arms.
fn rpy() -> impl Strategy<Value = [f64; 3]> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let special = prop::sample::select(vec![0.0, FRAC_PI_2, -FRAC_PI_2, PI, 1.570796, 3.141592, 1.0e-9]);
    prop_oneof![triple(PI), prop::array::uniform3(special)]
}

fn origin(reach: f64) -> impl Strategy<Value = Origin> {
    (prop_oneof![4 => triple(reach), 1 => Just([0.0; 3])], rpy()).prop_map(|(xyz, rpy)| Origin { xyz, rpy })
}

/// Generates a link with the inertia of a box of random size and with a random hollow part.
fn link() -> impl Strategy<Value = Link> {
    (origin(0.3), prop::array::uniform3(0.02..0.5f64), 0.2..9.0f64).prop_map(|(origin, [x, y, z], mass)| {
        let (x, y, z) = (mass * x * x, mass * y * y, mass * z * z);
        Link { origin, inertia: [y + z, 0.01 * x, -0.02 * z, x + z, 0.01 * y, x + y], mass }
    })
}

/// Generates a random physical arm.
pub(crate) fn model() -> impl Strategy<Value = ArmModel> {
    (prop::array::uniform7(origin(0.8)), prop::array::uniform7(link()))
        .prop_map(|(joints, links)| ArmModel { joints, links })
        .prop_filter("inertia of a body", |m| m.check().is_ok())
}

/// Generates six random numbers within ±`scale`.
pub(crate) fn vector(scale: f64) -> impl Strategy<Value = JointVec> {
    prop::array::uniform6(-scale..scale)
}
