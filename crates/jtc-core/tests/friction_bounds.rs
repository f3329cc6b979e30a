//! Tests of the bounds of friction parameters from a host (J-06, J-42). The controller accepts all values that occur on
//! arms with these drives. The controller refuses values that would make the friction compensation itself drive the
//! arm.
use crate::rig;

use jtc_core::{Config, Friction, Parameters, TableOf};
use jtc_wire::{DataStatus, FrameType, RawPoint};
use rig::{Rig, floats};

type Table = TableOf<f32>;

fn polynomials() -> [[f64; 6]; 6] {
    let Friction::Polynomial(polynomials) = Parameters::avena().friction else { panic!() };
    polynomials
}

fn tables() -> [Table; 6] {
    let Friction::Table(tables) = Parameters::avena_friction_table() else { panic!() };
    tables
}

/// Returns the coefficients c0, c1.. in the order of the wire format, which begins with the highest index.
fn wire<const N: usize>(joints: &[[f64; N]; 6]) -> Vec<u8> {
    floats(joints.iter().flat_map(|c| c.iter().rev().map(|c| *c as f32)))
}

fn table_wire(tables: &[Table; 6]) -> Vec<u8> {
    floats(tables.iter().flat_map(|t| {
        t.velocity.iter().chain(&t.temperature).chain(t.torque.iter().flatten()).copied().collect::<Vec<_>>()
    }))
}

/// Returns a friction table with the torques `torque`, which begins at `velocity` and has steps of 0.1 rad/s.
fn table_of(velocity: f32, torque: impl Fn(f32) -> f32) -> Table {
    let velocity: [f32; 20] = core::array::from_fn(|i| velocity + 0.1 * i as f32);
    Table {
        velocity,
        temperature: core::array::from_fn(|i| 20.0 + i as f32),
        torque: velocity.map(|v| [torque(v); 20]),
    }
}

/// Executes a path through standstill. Returns the friction torques of all joints on this path.
fn friction_on_a_path(rig: &mut Rig) -> Vec<[u64; 6]> {
    let points: Vec<_> = (0..60i16)
        .map(|i| {
            let velocity = if i == 0 || i == 59 { 0 } else { 300 };
            RawPoint { position: [i * 3; 6], velocity: [velocity; 6], ..RawPoint::default() }
        })
        .collect();
    rig.execute(&points);
    let mut torques = Vec::new();
    // The list begins with the first friction torque. The number of ticks before it is not compared, because a
    // response record may arrive after a different number of ticks.
    while torques.len() < 500 {
        rig.tick();
        let torque = rig.controller.telemetry().joints.map(|j| j.torque_friction.to_bits());
        if !torques.is_empty() || torque != [0; 6] {
            torques.push(torque);
        }
    }
    torques
}

#[test]
fn j06_the_friction_of_the_known_arm_is_taken_in_every_form() {
    let mut rig = Rig::holding();
    let known = polynomials();
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &wire(&known)), DataStatus::NoError);
    let four = known.map(|[c0, c1, c2, c3, ..]| [c0, c1, c2, c3]);
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &wire(&four)), DataStatus::NoError);
    // An existing host sends the coefficients of its file from left to right, so their order is reversed. The
    // controller must accept these coefficients as well.
    let reversed = known.map(|[a, b, c, d, e, f]| [f, e, d, c, b, a]);
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &wire(&reversed)), DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::FrictionTable, &table_wire(&tables())), DataStatus::NoError);
    // The controller also accepts friction that is zero, that contains noise around standstill, or that acts in only
    // one direction.
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &wire(&[[0.0; 6]; 6])), DataStatus::NoError);
    for table in [
        table_of(-0.95, |_| 0.0),
        table_of(-0.95, |v| 8.0 * v.signum() + 20.0 * v),
        table_of(-0.95, |v| if v.abs() < 0.1 { -0.5 * v.signum() } else { 10.0 * v }),
        table_of(0.0, |v| 5.0 + 10.0 * v),
    ] {
        assert_eq!(rig.ask(FrameType::FrictionTable, &table_wire(&[table; 6])), DataStatus::NoError);
    }
}

/// Checks that the controller refuses the frame, and that the friction torque on a path is then the same as without
/// the frame.
fn refused_whole(what: &str, frame_type: FrameType, body: &[u8]) {
    let (mut asked, mut quiet) = (Rig::holding(), Rig::holding());
    assert_eq!(asked.ask(frame_type, body), DataStatus::IncorrectValue, "{what}");
    quiet.ask(FrameType::ClearCurrentErrors, &[1, 0, 0, 0]);
    assert!(friction_on_a_path(&mut asked) == friction_on_a_path(&mut quiet), "{what}: something changed");
}

#[test]
fn j06_a_polynomial_that_would_throw_the_arm_is_refused_whole() {
    let good = polynomials();
    for (what, place, value) in [
        ("Coulomb friction of 1000 N·m", 0, 1e3),
        ("negative Coulomb friction", 0, -5.0),
        ("viscous friction of 1000 N·m·s/rad", 1, 1e3),
        ("negative viscous friction", 1, -60.0),
        ("a huge square", 2, 1e30),
        ("a negative square", 2, -90.0),
        ("a huge cube", 3, 3e38),
        ("a huge negative cube", 3, -3e38),
        ("no number", 1, f64::NAN),
    ] {
        // Only the last joint has a wrong coefficient, but the friction of the other joints must not change either.
        let mut body = good.map(|c| c.map(|c| 0.5 * c));
        body[5] = good[5];
        body[5][place] = value;
        refused_whole(what, FrameType::FrictionPolynomial, &wire(&body));
    }
}

#[test]
fn j06_a_table_that_would_throw_the_arm_is_refused_whole() {
    let good = table_of(-0.95, |v| 5.0 * v.signum());
    for (what, bad) in [
        ("500 N·m", table_of(-0.95, |v| 500.0 * v.signum())),
        ("with the motion", table_of(-0.95, |v| -8.0 * v.signum())),
        ("more than the joint has, slowly", table_of(-0.95, |v| 41.0 * v.signum())),
        ("more than one and a half times as much, fast", table_of(-0.95, |v| 80.0 * v * v * v)),
        ("20 N·m at standstill", table_of(-1.0, |v| if v.abs() < 0.01 { 20.0 } else { 0.0 })),
        ("20 N·m at standstill, between two rows", table_of(-0.03, |v| if v < 0.0 { 0.0 } else { 35.0 })),
        ("no number", table_of(-0.95, |_| f32::NAN)),
    ] {
        let mut tables = [good; 6];
        tables[5] = bad;
        refused_whole(what, FrameType::FrictionTable, &table_wire(&tables));
    }
}

#[test]
fn j06_the_bounds_of_friction_are_settings() {
    let mut config = Config::avena();
    config.parameter_bounds.friction_max = 0.2;
    let mut rig = Rig::new(config);
    assert_eq!(rig.ask(FrameType::FrictionTable, &table_wire(&tables())), DataStatus::IncorrectValue);
    assert_eq!(rig.ask(FrameType::FrictionTableUseDefault, &[]), DataStatus::IncorrectValue);
    assert_eq!(rig.ask(FrameType::FrictionPolynomialUseDefault, &[]), DataStatus::IncorrectValue);
}

/// The cubic polynomial of this test exceeds the bounds between the checked speeds, at slow speeds at which arms
/// often move. The controller must refuse it.
#[test]
fn j06_a_polynomial_is_bounded_at_slow_speeds_too() {
    let limits = Config::avena().joints.map(|joint| joint.torque_max);
    // At 0.02 rad/s, the torque of the first polynomial is 1.7 times the torque limit against the motion. The torque
    // of the second polynomial is 0.78 times this limit along the motion.
    for shares in [
        [1.946984127, -12.050370370, 21.744197531, -10.161740153],
        [-1.017777778, 12.327407407, -22.332839506, 10.155720165],
    ] {
        let mut rig = Rig::holding();
        let joints: [[f64; 4]; 6] = limits.map(|limit| shares.map(|share| 0.999 * share * limit));
        assert_eq!(rig.ask(FrameType::FrictionPolynomial, &wire(&joints)), DataStatus::IncorrectValue);
    }
}

/// A friction table may contain a torque at standstill. The controller blends this torque in during the approach, not in one tick.
#[test]
fn j44_the_friction_of_a_table_at_standstill_makes_no_step() {
    let tables = Config::avena().joints.map(|joint| {
        let share = (joint.torque_max / 180.0) as f32;
        table_of(-1.0, |v| share * (9.0 + 40.0 * v))
    });
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(FrameType::FrictionTable, &table_wire(&tables)), DataStatus::NoError);
    rig.run(300);
    rig.execute(&[RawPoint::default(); 30]);
    let correction = |rig: &Rig| rig.controller.telemetry().joints.map(|j| j.torque - j.torque_model);
    let (mut last, mut most) = (correction(&rig), 0.0_f64);
    for _ in 0..700 {
        rig.tick();
        let now = correction(&rig);
        for j in 0..6 {
            assert!((now[j] - last[j]).abs() < 0.5, "joint {}: {} after {} N·m", j + 1, now[j], last[j]);
        }
        most = most.max(rig.controller.telemetry().joints[1].torque_friction);
        last = now;
    }
    assert!(most > 8.0, "there was friction: {most} N·m");
}
