//! Tests the check that an arm model is physical (J-06).
use crate::arms;

use jtc_dynamics::{ArmModel, Field, ModelError};
use proptest::prelude::*;

/// Returns number `i` of the 133 numbers of a model, in the order of the ArmModel frame.
fn number(model: &mut ArmModel, i: usize) -> &mut f64 {
    if i < 42 {
        let joint = &mut model.joints[i / 6];
        return if i % 6 < 3 { &mut joint.xyz[i % 6] } else { &mut joint.rpy[i % 6 - 3] };
    }
    let (link, i) = (&mut model.links[(i - 42) / 13], (i - 42) % 13);
    match i {
        0..3 => &mut link.origin.xyz[i],
        3..6 => &mut link.origin.rpy[i - 3],
        6..12 => &mut link.inertia[i - 6],
        _ => &mut link.mass,
    }
}

#[test]
fn j06_the_default_arm_is_physical() {
    assert_eq!(arms::avena().check(), Ok(()));
}

#[test]
fn j06_the_default_arm_is_physical_after_rounding_to_f32() {
    let mut model = arms::avena();
    for i in 0..133 {
        let v = number(&mut model, i);
        *v = f64::from(*v as f32);
    }
    assert_eq!(model.check(), Ok(()));
}

#[test]
fn j06_any_number_that_is_not_finite_is_refused_and_named() {
    for i in 0..133 {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut model = arms::avena();
            *number(&mut model, i) = bad;
            let Err(ModelError::NotFinite { index, field, value }) = model.check() else {
                panic!("place {i}: {bad}")
            };
            assert_eq!(value.to_bits(), bad.to_bits());
            let place = match field {
                Field::JointXyz(k) => 6 * index + k,
                Field::JointRpy(k) => 6 * index + 3 + k,
                Field::LinkXyz(k) => 42 + 13 * index + k,
                Field::LinkRpy(k) => 42 + 13 * index + 3 + k,
                Field::Inertia(k) => 42 + 13 * index + 6 + k,
                _ => 42 + 13 * index + 12,
            };
            assert_eq!(place, i, "{field:?} of {index}");
        }
    }
}

#[test]
fn j06_mass_is_not_negative_and_zero_only_in_links_0_and_6() {
    for link in 0..7 {
        let mut model = arms::avena();
        model.links[link].mass = -0.001;
        assert_eq!(model.check(), Err(ModelError::MassNegative { link, mass: -0.001 }));
        model.links[link].mass = 0.0;
        let wanted = if (1..=5).contains(&link) { Err(ModelError::MassZero { link }) } else { Ok(()) };
        assert_eq!(model.check(), wanted, "link {link}");
    }
}

#[test]
fn j06_a_link_without_mass_may_have_any_inertia() {
    let mut model = arms::avena();
    model.links[6].mass = 0.0;
    model.links[6].inertia = [-1.0, 0.0, 0.0, 5.0, 0.0, 1.0];
    assert_eq!(model.check(), Ok(()));
}

#[test]
fn j06_inertia_must_be_positive_semidefinite() {
    for link in 0..7 {
        let mut model = arms::avena();
        // The principal moments are 3, 1 and −1. The off-diagonal element Iyz makes the last moment negative.
        model.links[link].inertia = [3.0, 0.0, 0.0, 1.0, 2.0, 1.0];
        let Err(ModelError::InertiaNegative { link: at, moment }) = model.check() else {
            panic!("link {link}")
        };
        assert_eq!(at, link);
        assert!((moment + 1.0).abs() < 1e-12, "{moment}");
    }
}

#[test]
fn j06_inertia_must_hold_the_triangle_inequality() {
    for link in 0..7 {
        let mut model = arms::avena();
        // The principal moments are 1, 1 and 3. The axis of the largest moment is not an axis of the frame.
        model.links[link].inertia = [2.0, 1.0, 0.0, 2.0, 0.0, 1.0];
        let Err(ModelError::InertiaTriangle { link: at, moment, limit }) = model.check() else {
            panic!("link {link}")
        };
        assert_eq!(at, link);
        assert!((moment - 3.0).abs() < 1e-12 && (limit - 2.0).abs() < 1e-12, "{moment} {limit}");
    }
}

#[test]
fn j06_bodies_at_the_limit_pass() {
    let mut model = arms::avena();
    for inertia in [[0.0; 6], [0.0, 0.0, 0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0, 0.0, 2.0]] {
        model.links[3].inertia = inertia;
        assert_eq!(model.check(), Ok(()), "point, rod, plate: {inertia:?}");
    }
}

#[test]
fn j06_angles_without_a_meaning_are_refused() {
    let mut model = arms::avena();
    model.joints[2].rpy[1] = 1e7;
    let Err(error) = model.check() else { panic!("accepted") };
    assert!(matches!(error, ModelError::AngleTooLarge { index: 2, field: Field::JointRpy(1), .. }));
    assert_eq!(
        error.to_string(),
        "joint 2: origin pitch is 10000000 rad, limit 1000000 rad; the value may be in degrees"
    );
}

/// The error must contain the largest allowed angle.
#[test]
fn j06_an_angle_at_the_limit_is_accepted() {
    let mut model = arms::avena();
    model.links[3].origin.rpy[2] = -1e9;
    let Err(ModelError::AngleTooLarge { index: 3, field: Field::LinkRpy(2), value, limit }) = model.check()
    else {
        panic!("accepted")
    };
    assert_eq!(value, -1e9);
    for angle in [limit, -limit] {
        model.links[3].origin.rpy[2] = angle;
        assert_eq!(model.check(), Ok(()));
    }
}

/// A body at the limit is still valid after its numbers have been rounded to f32, as in the ArmModel frame. A body
/// that violates the limit by 100 times this rounding error is not valid. The test uses light and heavy bodies.
#[test]
fn j06_only_the_rounding_of_f32_is_allowed_for_in_light_and_heavy_links() {
    let off = f64::from(f32::EPSILON);
    for unit in [1e-6, 1e-3, 1.0, 1e3] {
        // In each body, one principal moment violates its limit slightly. For the rod, a moment is below zero. For
        // the plate, a moment is above the sum of the other two.
        for (shape, defect) in [([0.0, 1.0, 1.0], [-1.0, 0.0, 0.0]), ([1.0, 1.0, 2.0], [0.0, 0.0, 1.0])] {
            let check = |off: f64| {
                let [a, b, c]: [f64; 3] = core::array::from_fn(|i| unit * (shape[i] + off * defect[i]));
                let mut model = arms::avena();
                model.links[2].inertia = [a, 0.0, 0.0, b, 0.0, c];
                model.check()
            };
            assert_eq!(check(off), Ok(()), "{shape:?} in units of {unit}");
            assert!(check(100.0 * off).is_err(), "{shape:?} in units of {unit}");
        }
    }
}

#[test]
fn j06_what_is_not_physical_is_said_with_its_place_value_and_limit() {
    let shows = |error: ModelError, text: &str| assert_eq!(error.to_string(), text);
    let fields = [
        (Field::JointXyz(0), "joint 2: origin x"),
        (Field::JointRpy(2), "joint 2: origin yaw"),
        (Field::LinkXyz(1), "link 2: centre of mass y"),
        (Field::LinkRpy(0), "link 2: inertia frame roll"),
        (Field::Inertia(4), "link 2: iyz"),
        (Field::Mass, "link 2: mass"),
    ];
    for (field, place) in fields {
        let error = ModelError::NotFinite { index: 2, field, value: f64::INFINITY };
        shows(error, &format!("{place} is inf, not a finite number"));
        let error = ModelError::AngleTooLarge { index: 2, field, value: 90.0, limit: 7.0 };
        shows(error, &format!("{place} is 90 rad, limit 7 rad; the value may be in degrees"));
    }
    shows(ModelError::MassNegative { link: 4, mass: -2.5 }, "link 4: mass is -2.5 kg, must not be negative");
    shows(ModelError::MassZero { link: 4 }, "link 4: mass is 0, only links 0 and 6 may have no mass");
    shows(
        ModelError::InertiaNegative { link: 4, moment: -1.5 },
        "link 4: smallest principal moment of inertia is -1.5 kg m2, must not be negative; check the sign of the \
         products of inertia",
    );
    shows(
        ModelError::InertiaTriangle { link: 4, moment: 3.0, limit: 2.5 },
        "link 4: largest principal moment of inertia is 3 kg m2, more than the sum of the others, 2.5 kg m2; check \
         the unit and the order of ixx ixy ixz iyy iyz izz",
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// The inertia of point masses is valid in every orientation. If the inertia about one axis is reduced by more
    /// than the point masses can contribute, the inertia is not valid.
    #[test]
    fn j06_what_points_of_mass_make_is_accepted(
        points in prop::collection::vec(prop::array::uniform4(-1.0..1.0f64), 1..6)
    ) {
        let mut inertia = [0.0; 6];
        for [x, y, z, m] in points {
            let m = m.abs();
            let (xx, yy, zz) = (m * x * x, m * y * y, m * z * z);
            let add = [yy + zz, -m * x * y, -m * x * z, xx + zz, -m * y * z, xx + yy];
            inertia.iter_mut().zip(add).for_each(|(i, a)| *i += a);
        }
        let mut model = arms::avena();
        model.links[4].inertia = inertia;
        prop_assert_eq!(model.check(), Ok(()));
        // The trace is twice the sum of the second moments, so `too_much` is larger than the second moment of any axis.
        let too_much = 0.6 * (inertia[0] + inertia[3] + inertia[5]) + 1e-3;
        model.links[4].inertia[0] += too_much;
        model.links[4].inertia[3] -= too_much;
        prop_assert!(model.check().is_err());
    }
}
