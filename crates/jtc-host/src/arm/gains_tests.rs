//! Tests that compare the computed stability limits with a tick-by-tick simulation of the control loop.

use super::*;
use crate::arm::Arm;

/// Simulates the control loop of a joint for `ticks` ticks. Returns the largest position error in the last third,
/// divided by the largest error in the second third. A result above 1 means that the error grows.
fn growth(gains: &PidGains, delay: u8, inertia: f64, ticks: usize) -> f64 {
    let mut torques = vec![0.0; usize::from(delay) + 1];
    let mut errors = [0.0; 6];
    let (mut q, mut qd, mut integral) = (0.0, 1e-3, 0.0);
    let mut sizes = [0.0f64; 3];
    for k in 0..ticks {
        let error = -q;
        errors.rotate_left(1);
        errors[5] = error;
        integral += error * DT;
        torques.rotate_left(1);
        torques[usize::from(delay)] =
            gains.kp * error + gains.ki * integral + gains.kd * (error - errors[0]) / (5.0 * DT);
        let qdd = torques[0] / inertia;
        q += qd * DT + 0.5 * qdd * DT * DT;
        qd += qdd * DT;
        let part = &mut sizes[3 * k / ticks];
        *part = part.max(f64::abs(q));
    }
    sizes[2] / sizes[1]
}

#[test]
fn j41_j71_a_joint_is_stable_between_two_inertias_and_nowhere_else() {
    let gains = |kp, ki, kd| PidGains { kp, ki, kd, int_min: -1e9, int_max: 1e9 };
    for (gains, delay) in [
        (gains(8000.0, 14000.0, 80.0), 2),
        (gains(4000.0, 24000.0, 60.0), 2),
        (gains(200.0, 400.0, 10.0), 2),
        (gains(200.0, 0.0, 10.0), 2),
        (gains(2.0, 30.0, 0.1), 2),
        (gains(0.5, 0.2, 0.5), 2),
        (gains(1600.0, 3200.0, 80.0), 0),
        (gains(1600.0, 3200.0, 80.0), 5),
        (gains(1600.0, 3200.0, 80.0), 7),
        (gains(8000.0, 2000.0, 100.0), 2),
    ] {
        let StableInertia { least, most } = StableInertia::of(&gains, delay).expect("a stable range");
        let fast = |inertia| growth(&gains, delay, inertia, 6_000);
        assert!(fast(1.03 * least) < 1.0, "{gains:?}: {least} {}", fast(1.03 * least));
        assert!(fast(0.97 * least) > 1.0, "{gains:?}: {least} {}", fast(0.97 * least));
        if gains.ki == 0.0 {
            assert_eq!(most, f64::INFINITY);
            continue;
        }
        // Near the upper stability limit, the oscillation grows or decays slowly, so the test simulates some hundred
        // oscillations.
        let slow = |inertia: f64| {
            let swing = std::f64::consts::TAU * (inertia / gains.kp).sqrt() / DT;
            growth(&gains, delay, inertia, ((300.0 * swing) as usize).clamp(6_000, 20_000_000))
        };
        assert!(slow(0.97 * most) < 1.0, "{gains:?}: {most} {}", slow(0.97 * most));
        assert!(slow(1.03 * most) > 1.0, "{gains:?}: {most} {}", slow(1.03 * most));
    }
}

#[test]
fn j41_gains_that_hold_no_inertia_are_known() {
    let gains = |kp, ki, kd| PidGains { kp, ki, kd, int_min: -1.0, int_max: 1.0 };
    for none in [
        gains(0.0, 0.0, 0.0),
        gains(100.0, 0.0, 0.0),
        gains(100.0, 50.0, 0.0),
        gains(100.0, 0.0, 0.1),
        gains(100.0, 1e6, 5.0),
        gains(-100.0, 0.0, -5.0),
        gains(f64::NAN, 0.0, 1.0),
        gains(1.0, f64::INFINITY, 1.0),
        gains(1.0, 0.0, f64::NAN),
        gains(1.0, 0.0, f64::INFINITY),
    ] {
        assert_eq!(StableInertia::of(&none, 2), None, "{none:?}");
    }
}

/// With a mass matrix of zero, only the rotor inertia determines the margin of the rotor.
#[test]
fn j71_the_margin_of_a_rotor_alone_is_that_of_its_inertia() {
    let arm = Arm::avena();
    let gains = arm.pid.unwrap();
    let stable = gains.map(|g| StableInertia::of(&g, 2).unwrap());
    let rotor = [0.7; JOINTS];
    let margin = rotor_margin(&[[[0.0; JOINTS]; JOINTS]], &rotor, &stable, [true; JOINTS]).unwrap();
    let least = stable.iter().map(|s| s.least / 0.7).fold(0.0, f64::max);
    let most = stable.iter().map(|s| s.most / 0.7).fold(f64::INFINITY, f64::min);
    assert!((margin.down - least).abs() < 1e-6 && (margin.up - most).abs() < 1e-6 * most, "{margin:?}");
    // Two fully coupled joints behave like one joint with twice the stiffness, so the margins differ. With very light
    // rotors, the gains are unstable, without any margin.
    let mut both = [[0.0; JOINTS]; JOINTS];
    (both[4][4], both[5][5], both[4][5], both[5][4]) = (0.3, 0.3, 0.3, 0.3);
    let coupled = rotor_margin(&[both], &rotor, &stable, [true; JOINTS]).unwrap();
    assert!(coupled.up < margin.up || coupled.down <= margin.down, "{coupled:?}");
    assert_eq!(rotor_margin(&[both], &[0.01; JOINTS], &stable, [true; JOINTS]), None);
}

/// For every delay, the minimum inertia that a controller requires is 1.1 to 1.7 times the lowest stable inertia of
/// the control loop. Exception: if the delay is below two ticks and Kp is high, the factor may be as low as 0.85.
#[test]
fn j71_the_inertia_that_a_controller_asks_for_is_stable_with_reserve() {
    for delay in 0..=7u8 {
        let position_ms = (f64::from(delay) + 0.5).max(1.0);
        for share in [0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5] {
            let kd = 70.0;
            let gains = PidGains { kp: share * kd / (1e-3 * position_ms), kd, ..PidGains::default() };
            let least = StableInertia::of(&gains, delay).expect("a stable range").least;
            let reserve = jtc_core::inertia_needed(&gains, delay) / least;
            let enough = if delay < 2 && share > 0.3 { 0.85 } else { 1.1 };
            assert!((enough..1.7).contains(&reserve), "delay {delay}, share {share}: {reserve}");
        }
    }
}

/// A controller accepts the gains of two arms in 300 poses, with payloads of 0, 3 and 5 kg. The controller refuses
/// the gains of the built-in arm if Kp and Kd are multiplied by three or five.
#[test]
fn j71_the_gains_in_use_are_taken_in_all_poses_with_all_loads() {
    let plain = include_str!("../../tests/sessions/plain.urdf");
    let plain = Arm::import_text(plain, &Default::default()).unwrap();
    for (arm, factor, taken) in [
        (Arm::avena(), 1.0, true),
        (plain, 1.0, true),
        (Arm::avena(), 3.0, false),
        (Arm::avena(), 5.0, false),
    ] {
        let rotor = arm.joints.map(|j| j.rotor_inertia);
        let gains = arm.pid.unwrap().map(|g| PidGains { kp: factor * g.kp, kd: factor * g.kd, ..g });
        for mass in [0.0, 3.0, 5.0] {
            let payload = jtc_dynamics::Payload { mass, ..jtc_dynamics::Payload::default() };
            let dynamics = Dynamics::with_payload(&arm.model, [0.0; 3], &payload);
            let borne = (0..300).all(|n| {
                let felt = dynamics.felt_inertia(&pose(n, &arm.ranges()), &rotor);
                felt.iter().zip(&gains).all(|(felt, gains)| *felt >= jtc_core::inertia_needed(gains, 2))
            });
            assert_eq!(borne, taken, "{}, times {factor}, {mass} kg", arm.name);
        }
        let felt = jtc_core::least_felt_inertia(&arm.model, &arm.config());
        let borne = felt.iter().zip(&gains).all(|(felt, gains)| *felt >= jtc_core::inertia_needed(gains, 2));
        assert_eq!(borne, taken, "{}, times {factor}: as the controller looks at it", arm.name);
    }
}
