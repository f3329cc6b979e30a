//! Tests that the LuGre model sticks, breaks away, slips, and follows the measured curve in motion.
use super::*;

const RIGID: f64 = 0.7;

fn with(model: FrictionModel, curve: SimFriction) -> FrictionTorques {
    let mut torques = FrictionTorques::new(
        model,
        core::array::from_fn(|_| curve.clone()),
        &[RIGID; JOINTS],
        &[1.5; JOINTS],
    );
    torques.warm(&[20.0; JOINTS], &[1.0; JOINTS]);
    torques
}

/// Returns a polynomial with a Coulomb torque of 6 N·m that does not depend on the temperature.
fn polynomial() -> SimFriction {
    SimFriction::Polynomial([6.0, 40.0, -30.0, 12.0, 0.0, 20.0])
}

fn table() -> SimFriction {
    let velocity: [f32; 20] = core::array::from_fn(|i| -0.95 + 0.1 * i as f32);
    let torque = velocity.map(|v| [6.0f32.copysign(v) + 20.0 * v; 20]);
    SimFriction::Table(TableOf { velocity, temperature: core::array::from_fn(|i| 4.0 * i as f32), torque })
}

/// Simulates a rotor on its bristles under `torque(t, v)`. Returns position, velocity and friction in every step of
/// `dt`.
fn rotor(
    torques: &FrictionTorques,
    dt: f64,
    seconds: f64,
    torque: impl Fn(f64, f64) -> f64,
) -> Vec<[f64; 3]> {
    let (mut q, mut v, mut z) = (0.0, 0.0, [0.0; JOINTS]);
    (0..(seconds / dt).round() as u64)
        .map(|k| {
            let friction = torques.at(&[v; JOINTS], &z)[0];
            v += dt * (torque(k as f64 * dt, v) - friction) / RIGID;
            z = torques.bend(&z, &[v; JOINTS], dt);
            q += dt * v;
            [q, v, friction]
        })
        .collect()
}

#[test]
fn at_speed_both_models_are_the_measured_curve() {
    for curve in [polynomial(), table()] {
        let smooth = with(FrictionModel::Smooth { width: 0.01 }, curve.clone());
        let lugre = with(FrictionModel::LuGre(LuGre::default()), curve);
        for v in [-0.9, -0.3, -0.15, 0.15, 0.4, 0.8] {
            // At constant speed, the bristles reach a constant deflection within milliseconds. After that, both
            // models must give nearly the same friction.
            let z = (0..200).fold([0.0; JOINTS], |z, _| lugre.bend(&z, &[v; JOINTS], 1e-3));
            let (a, b) = (smooth.at(&[v; JOINTS], &z)[0], lugre.at(&[v; JOINTS], &z)[0]);
            assert!((a - b).abs() < 0.02 * a.abs(), "{v} rad/s: smooth {a}, LuGre {b} N·m");
        }
    }
}

#[test]
fn below_stiction_a_rotor_springs_back_and_above_it_breaks_away() {
    for curve in [polynomial(), table()] {
        let torques = with(FrictionModel::LuGre(LuGre::default()), curve);
        // The torque rises to 1.2 times the Coulomb torque (6 N·m) within one second, and is then zero. The rotor
        // must deflect by about 1e-4 rad, and must spring back when the torque ends.
        let held = rotor(&torques, 1e-3, 2.0, |t, _| if t < 1.0 { t * 1.2 * 6.0 } else { 0.0 });
        let (loaded, released) = (held[999][0], held[1999][0]);
        assert!((0.8e-4..4e-4).contains(&loaded), "{loaded} rad");
        assert!(released < loaded - 0.8e-4 && held[1999][1].abs() < 1e-6, "{released} rad");
        // The torque rises to three times the Coulomb torque (6 N·m) in three seconds. The rotor must break away at
        // the stiction torque, which is 1.4 times the Coulomb torque.
        let away = rotor(&torques, 1e-3, 3.0, |t, _| t * 6.0);
        let left = away.iter().position(|x| x[0] > 1e-3).unwrap_or(0) as f64 * 1e-3;
        assert!((1.35..1.5).contains(&left), "it left at {left} of 6 N·m");
    }
}

#[test]
fn a_soft_drive_sticks_and_slips_and_smooth_friction_does_not() {
    // The free end of a spring of 20 N·m/rad moves at 5 mrad/s and pulls the rotor.
    let pull = |model| {
        let torques = with(model, SimFriction::Polynomial([6.0, 2.0, 0.0, 0.0, 0.0, 20.0]));
        let (mut q, mut v, mut z) = (0.0, 0.0, [0.0; JOINTS]);
        let (mut still, mut fastest) = (0, 0.0f64);
        for k in 0..200_000 {
            let dt = 1e-3;
            let spring = 20.0 * (5e-3 * f64::from(k) * dt - q);
            v += dt * (spring - torques.at(&[v; JOINTS], &z)[0]) / RIGID;
            z = torques.bend(&z, &[v; JOINTS], dt);
            q += dt * v;
            if k > 100_000 {
                still += u32::from(v.abs() < 5e-4);
                fastest = fastest.max(v);
            }
        }
        (still, fastest)
    };
    let (still, fastest) = pull(FrictionModel::LuGre(LuGre::default()));
    assert!(still > 20_000 && fastest > 0.05, "{still} ms at rest, up to {fastest} rad/s");
    let (still, fastest) = pull(FrictionModel::Smooth { width: 0.01 });
    assert!(still == 0 && fastest < 0.006, "{still} ms at rest, up to {fastest} rad/s");
}

#[test]
fn bristles_stay_within_stiction_at_any_step_and_speed() {
    let torques = with(FrictionModel::LuGre(LuGre::default()), polynomial());
    let longest = 1.4 * LuGre::default().presliding;
    for dt in [1e-5, 1e-3, 5e-3] {
        for speed in [1e-6, 1e-4, 1e-2, 1.0, 30.0] {
            let mut z = [0.0; JOINTS];
            for k in 0..500 {
                // The rotor moves forward for 100 steps and back for 100 steps, alternately. The bristles must not
                // deflect farther than their limit.
                let v = if k / 100 % 2 == 0 { speed } else { -speed };
                z = torques.bend(&z, &[v; JOINTS], dt);
                assert!(z[0].abs() <= longest * (1.0 + 1e-9), "{} rad at {speed} rad/s, {dt} s", z[0]);
            }
        }
    }
}

#[test]
fn beyond_the_speeds_that_a_curve_was_made_for_friction_does_not_fall() {
    // Three curves are tested: a cubic that ends with a driving torque, a cubic that ends with a steep slope, and a
    // table whose last segment decreases.
    let motor = SimFriction::Polynomial([2.7, 12.6, -3.7, -0.65, 0.0, 20.0]);
    let wall = SimFriction::Polynomial([6.0, 40.0, -30.0, 12.0, 0.0, 20.0]);
    let SimFriction::Table(mut falling) = table() else { unreachable!("a table") };
    falling.torque[19] = [3.0; 20];
    falling.torque[0] = [-3.0; 20];
    for (curve, end) in [(motor, 1.5), (wall.clone(), 1.5), (SimFriction::Table(falling), 0.95)] {
        for model in [FrictionModel::Smooth { width: 0.01 }, FrictionModel::LuGre(LuGre::default())] {
            let torques = with(model, curve.clone());
            let at = |v: f64| {
                let z = (0..200).fold([0.0; JOINTS], |z, _| torques.bend(&z, &[v; JOINTS], 1e-3));
                torques.at(&[v; JOINTS], &z)[0]
            };
            let (there, beyond) = (at(end), at(1.001 * end));
            assert!((there - beyond).abs() < 0.5, "a step at {end} rad/s: {there}, {beyond} N·m");
            let mut before = there;
            for v in [1.1 * end, 3.0, 10.0, 300.0] {
                let torque = at(v);
                // The tolerance of 0.01 N·m covers the part of the Stribeck curve that remains at this speed.
                assert!(torque > before - 0.01, "{torque} N·m at {v} rad/s after {before}");
                assert!((at(-v) + torque).abs() < 1e-6, "both ways alike");
                before = torque;
            }
        }
    }
    // Above 1.5 rad/s, the curve continues with its slope at 1.5 rad/s: 40 − 2·30·1.5 + 3·12·1.5² = 31 N·m·s/rad.
    // Over 100 rad/s, the torque rises by 3100 N·m.
    let torques = with(FrictionModel::Smooth { width: 0.01 }, wall);
    let rise =
        torques.at(&[101.5; JOINTS], &[0.0; JOINTS])[0] - torques.at(&[1.5; JOINTS], &[0.0; JOINTS])[0];
    assert!((rise - 3_100.0).abs() < 0.1, "{rise} N·m for 100 rad/s");
}
