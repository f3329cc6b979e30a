//! Tests of the inertia that gains require, and of the trial of new gains.
use proptest::prelude::*;

use super::*;
use crate::Parameters;

fn given() -> [PidGains; JOINTS] {
    Parameters::avena().pid
}

fn scaled(factor: f64) -> [PidGains; JOINTS] {
    given().map(|g| PidGains { kp: factor * g.kp, ki: factor * g.ki, kd: factor * g.kd, ..g })
}

#[test]
fn j71_the_poses_are_within_the_limits_and_apart() {
    let mut config = Config::avena();
    (config.joints[1].position_min, config.joints[1].position_max) = (0.2, 1.0);
    let poses: [JointVec; POSES] = core::array::from_fn(|number| pose(number, &config));
    assert_eq!(poses[0], [0.0, 0.2, 0.0, 0.0, 0.0, 0.0], "the zero pose, as far as there is one");
    for (n, pose) in poses.iter().enumerate() {
        for j in 0..JOINTS {
            let (low, high) = config.position_range(j);
            assert!(pose[j] >= low && pose[j] <= high, "pose {n}, joint {}", j + 1);
        }
        assert!(poses[..n].iter().all(|other| other != pose), "pose {n}");
    }
    // The poses fill the range of the first joint evenly: each quarter of the range contains a quarter of the poses.
    let (low, high) = config.position_range(0);
    for quarter in 0..4 {
        let inside = |q: f64| ((q - low) / (high - low) * 4.0) as i32 == quarter;
        assert_eq!(poses[1..].iter().filter(|pose| inside(pose[0])).count(), 4, "quarter {quarter}");
    }
}

/// docs/protocol-jtc.md contains these values for the default arm.
#[test]
fn j71_the_default_arm_feels_what_is_said() {
    let felt = least_felt_inertia(&Parameters::avena().model, &Config::avena());
    assert_eq!(felt.map(|felt| (100.0 * felt).round() / 100.0), [0.83, 3.77, 1.32, 0.72, 0.70, 0.70]);
}

proptest! {
    /// The check of gains computes the inertia only in a few poses. In any other pose, the effective inertia of a
    /// joint may be only slightly lower than the smallest computed inertia.
    #[test]
    fn j71_a_joint_feels_little_less_in_other_poses(shares in prop::array::uniform6(0.0..1.0f64)) {
        let (model, config) = (Parameters::avena().model, Config::avena());
        let pose: JointVec = core::array::from_fn(|j| {
            let (low, high) = config.position_range(j);
            low + shares[j] * (high - low)
        });
        let rotor = config.joints.each_ref().map(|joint| joint.rotor_inertia);
        let felt = Dynamics::new(&model, [0.0; 3]).felt_inertia(&pose, &rotor);
        let looked_at = least_felt_inertia(&model, &config);
        prop_assert!((0..JOINTS).all(|j| felt[j] > 0.83 * looked_at[j]), "{felt:?} {looked_at:?}");
    }
}

#[test]
fn j71_the_arm_bears_its_gains_and_not_twice_as_much() {
    let (mut felt, config) = (FeltInertia::NONE, Config::avena());
    (0..POSES).for_each(|number| felt.look(number, &Parameters::avena().model, &config));
    for (factor, borne) in [(1.0, true), (1.5, true), (2.0, false), (3.0, false), (5.0, false), (0.0, true)] {
        assert_eq!(felt.bears(&scaled(factor), &config), borne, "times {factor}");
    }
    let mut nan = given();
    nan[3].kd = f64::NAN;
    assert!(!felt.bears(&nan, &config));
    // With a longer delay, the gains require more inertia.
    assert!(!felt.bears(&given(), &Config { delay_ticks: 7, ..config.clone() }));
}

/// If no rotor inertia is configured, the rotor inertia of the known drives is used.
#[test]
fn j71_a_drive_without_a_rotor_has_that_of_the_known_drives() {
    let model = Parameters::avena().model;
    let with = |rotor: f64| {
        let mut config = Config::avena();
        config.joints.iter_mut().for_each(|joint| joint.rotor_inertia = rotor);
        least_felt_inertia(&model, &config)
    };
    assert_eq!(with(0.0), with(0.7));
    assert!(with(0.1)[5] < 0.11);
}

#[test]
fn j71_gains_that_let_a_held_joint_fall_do_not_hold_on() {
    let limits = Config::avena().joints[1];
    let gains = PidGains { kp: 1_000.0, ki: 100.0, kd: 10.0, int_min: -1.0, int_max: 1.0 };
    // The position error limit is 0.09 rad. With 1 000 N·m/rad, the largest permitted sag of 0.0225 rad (a quarter of
    // this limit) produces 22.5 N·m.
    for (gains, i, holds) in [
        (gains, 100.0, true),
        (gains, 122.0, true),
        (gains, 123.0, false),
        (PidGains { ki: 0.0, ..gains }, 22.0, true),
        (PidGains { ki: 0.0, ..gains }, -23.0, false),
        (PidGains { kp: 0.0, ..gains }, 0.0, false),
        (PidGains { kp: f64::NAN, ..gains }, 0.0, false),
    ] {
        assert_eq!(hold_on(&gains, 0.0, i, &limits), holds, "{gains:?}, {i} N·m");
        assert_eq!(hold_on(&gains, i, 0.0, &limits), holds, "what the position error has is held as well");
    }
}

proptest! {
    /// New gains are blended in without a step, for any earlier gains. In a millisecond, each gain changes by at most 1/200 of the
    /// difference.
    #[test]
    fn j71_gains_come_in_over_half_a_second(factors in prop::array::uniform3(0.05..1.5f64), again_ms in 0..900u16) {
        let [before, second, third] = factors.map(scaled);
        let mut trial = Trial::default();
        prop_assert!(trial.blended(&second).is_none());
        trial.begin(&before, &second);
        let (mut last, mut given) = (before, second);
        let most = |j: usize, of: fn(&PidGains) -> f64| {
            let all = [of(&before[j]), of(&second[j]), of(&third[j])];
            let (low, high) = (all.into_iter().fold(f64::MAX, f64::min), all.into_iter().fold(0.0, f64::max));
            (high - low) / 200.0 + 1e-6 * high
        };
        for ms in 1..=again_ms + BLEND_MS {
            if ms == again_ms + 1 {
                trial.begin(&given, &third);
                given = third;
            }
            trial.step(true);
            let now = trial.blended(&given).unwrap_or(given);
            for j in 0..JOINTS {
                prop_assert!((now[j].kp - last[j].kp).abs() <= most(j, |gains| gains.kp), "{}", ms);
                prop_assert!((now[j].kd - last[j].kd).abs() <= most(j, |gains| gains.kd), "{}", ms);
                prop_assert_eq!(now[j].ki, given[j].ki);
            }
            last = now;
        }
        prop_assert_eq!(last, third);
    }

    /// Softer gains require less inertia than the gains before. The delay of the Kp torque cancels a part of the
    /// damping. The damping of softer gains is at least twice this part.
    #[test]
    fn j66_softer_gains_are_stable_where_the_others_were_borne(kp in 1.0..50_000.0f64, kd in 0.0..500.0f64, delay in 0..8u8) {
        let own = PidGains { kp, ki: 1000.0, kd, ..given()[0] };
        let [softer, ..] = softer(&[own; JOINTS], 1, delay);
        prop_assert!(inertia_needed(&softer, delay) < 0.6 * inertia_needed(&own, delay));
        let late_s = 1e-3 * (f64::from(delay) + 0.5);
        prop_assert!(softer.kd >= 1.99 * softer.kp * late_s);
        prop_assert_eq!((softer.kp, softer.ki), (0.3 * kp, 0.0));
    }
}

/// Begins a trial of new gains, which fail after `ms`. Returns the cause and the gains that the controller then uses.
/// `unstable` is `true` if joint 2 has an unstable control loop.
fn after(ms: u16, unstable: bool) -> Option<(StopKind, [PidGains; JOINTS])> {
    let mut trial = Trial::default();
    trial.begin(&scaled(0.5), &given());
    (0..ms).for_each(|_| trial.step(true));
    trial.fails(1 << 1, u8::from(unstable) << 1, &given(), 2)
}

#[test]
fn j66_j71_gains_that_fail_are_taken_back() {
    let softer = softer(&given(), 1 << 1, 2);
    let (back, soft) = (Some((StopKind::Gains, scaled(0.5))), Some((StopKind::Unstable, softer)));
    for (ms, unstable, becomes) in [
        (1, false, back),
        (2_000, false, back),
        (2_001, false, None),
        (2_001, true, back),
        (10_000, true, back),
        (10_001, true, soft),
    ] {
        assert_eq!(after(ms, unstable), becomes, "after {ms} ms, {unstable}");
    }
    assert_eq!((softer[1].kp, softer[1].ki, softer[1].kd), (0.3 * 8000.0, 0.0, 0.3 * 80.0));
    assert_eq!((softer[0], softer[2]), (given()[0], given()[2]), "the others keep theirs");
}

/// A host sends two sets of gains, and the second set fails. If the first set has held the arm for long enough, the
/// controller restores the first set. Otherwise it restores the gains before the first set.
#[test]
fn j71_of_several_gains_in_a_row_the_last_that_held_come_back() {
    for (ms, back) in [(100, 0.5), (2_000, 1.2)] {
        let mut trial = Trial::default();
        trial.begin(&scaled(0.5), &scaled(1.2));
        (0..ms).for_each(|_| trial.step(true));
        trial.begin(&scaled(1.2), &given());
        let fails = trial.fails(1, 0, &given(), 2);
        assert_eq!(fails, Some((StopKind::Gains, scaled(back))), "after {ms} ms");
    }
}

/// If a host sends gains that have already held the arm, no trial begins.
#[test]
fn j71_gains_that_held_are_not_on_trial() {
    let mut trial = Trial::default();
    trial.begin(&given(), &scaled(1.2));
    (0..100).for_each(|_| trial.step(true));
    assert!(trial.is_on());
    trial.begin(&scaled(1.2), &given());
    assert!(!trial.is_on() && trial.end().is_none());
    trial.begin(&scaled(1.2), &given());
    assert_eq!(trial.end(), Some(scaled(1.2)));
}

/// A trial of gains counts only the time in which all joints are held.
#[test]
fn j71_a_trial_waits_for_joints_that_are_not_held() {
    let mut trial = Trial::default();
    trial.begin(&scaled(0.5), &given());
    (0..20_000).for_each(|_| trial.step(false));
    assert!(trial.is_on());
    (0..2_001).for_each(|_| trial.step(true));
    assert!(!trial.is_on());
}

/// A joint that fails gets its previous gains at once. For the other joints, the controller blends back to the
/// previous gains.
#[test]
fn j71_gains_come_back_at_once_where_they_failed() {
    let mut trial = Trial::default();
    trial.begin(&scaled(0.5), &given());
    (0..1_000).for_each(|_| trial.step(true));
    let (_, back) = trial.fails(1 << 1, 0, &given(), 2).expect("on trial");
    let acting = trial.blended(&back).expect("they go over");
    assert!((acting[1].kp - 0.5 * 8000.0).abs() < 1e-3 && (acting[0].kp - 8000.0).abs() < 1e-3, "{acting:?}");
}

#[test]
fn j66_a_joint_that_is_unstable_again_within_half_a_second_is_known() {
    let mut trial = Trial::default();
    assert!(!trial.runs() && !trial.again(2));
    trial.fails(1 << 2, 1 << 2, &given(), 2);
    for ms in 0..600 {
        assert_eq!((trial.runs(), trial.again(2), trial.again(1)), (ms < 500, ms < 500, false), "{ms}");
        trial.step(true);
    }
}

/// For Kp = 1,000 N·m/rad and Kd = 100 N·m·s/rad, a delay of 2 ms requires 0.005 s · (0.75 · 100 + 2 · 1,000 · 0.0025) N·m·s/rad = 0.4 kg·m².
/// Without a delay, 0.003 s · (75 + 2 · 1,000 · 0.001) N·m·s/rad = 0.231 kg·m² are required.
#[test]
fn j71_the_required_inertia_follows_from_the_gains_and_the_delay() {
    let gains = PidGains { kp: 1_000.0, ki: 0.0, kd: 100.0, int_min: 0.0, int_max: 0.0 };
    for (delay_ticks, inertia) in [(2, 0.4), (0, 0.231)] {
        let needed = inertia_needed(&gains, delay_ticks);
        assert!((needed - inertia).abs() < 1e-9, "{delay_ticks} ticks: {needed} kg·m²");
    }
}

/// A joint with exactly the required inertia is accepted.
#[test]
fn j71_a_joint_with_the_required_inertia_is_accepted() {
    let config = Config::avena();
    let needed = given().map(|gains| inertia_needed(&gains, config.delay_ticks));
    assert!(FeltInertia { joints: needed }.bears(&given(), &config));
    for j in 0..JOINTS {
        let mut joints = needed;
        joints[j] = joints[j].next_down();
        assert!(!FeltInertia { joints }.bears(&given(), &config), "joint {}", j + 1);
    }
}

/// The position gain must produce 3 % of the torque limit at the position error limit. If the new gains allow less
/// integral torque than before, the position gain must supply the missing torque. This must deflect the joint by less
/// than a quarter of the position error limit.
#[test]
fn j71_a_held_joint_keeps_a_stiff_position_and_sags_little() {
    // At 0.5 rad, the position gain must produce 3 % of 100 N·m, which is 3 N·m. This requires 6 N·m/rad. With 8
    // N·m/rad, a position error of 0.125 rad, the largest permitted sag, produces 1 N·m.
    let limits = JointConfig { torque_max: 100.0, position_error_max: 0.5, ..Config::avena().joints[1] };
    let soft = |kp: f64| PidGains { kp, ki: 0.0, kd: 0.0, int_min: 0.0, int_max: 0.0 };
    // The integral bounds of these gains allow torques from −50 to 50 N·m. The largest permitted sag of 0.125 rad
    // produces 0.125 · 800 = 100 N·m.
    let kept = PidGains { kp: 800.0, ki: 100.0, kd: 0.0, int_min: -0.5, int_max: 0.5 };
    for (gains, p, i, holds) in [
        (soft(6.0), 0.0, 0.0, true),
        (soft(5.9375), 0.0, 0.0, false),
        (soft(8.0), 0.0, 0.9375, true),
        (soft(8.0), 0.0, -0.9375, true),
        (soft(8.0), 0.0, 1.0, false),
        (soft(8.0), 0.0, -1.0, false),
        (soft(8.0), 0.75, 0.5, false),
        (soft(8.0), 0.75, -0.5, true),
        (kept, 0.0, 149.0, true),
        (kept, 0.0, 150.0, false),
        (kept, 0.0, -149.0, true),
        (kept, 0.0, -150.0, false),
        (kept, 100.0, 60.0, false),
        (kept, 100.0, -60.0, true),
    ] {
        assert_eq!(hold_on(&gains, p, i, &limits), holds, "{gains:?}, {p} N·m, {i} N·m");
    }
}

/// If the controller is not allowed to restore the earlier gains, it discards them.
#[test]
fn j71_gains_that_may_not_return_are_discarded() {
    for may in [false, true] {
        let mut trial = Trial::default();
        trial.begin(&scaled(0.5), &given());
        trial.keep_if(|before| {
            assert_eq!(before, &scaled(0.5));
            may
        });
        assert_eq!(trial.end(), may.then(|| scaled(0.5)));
    }
}

/// The trial runs while the earlier gains may return, while gains are blended, or while an instability of a joint is
/// remembered.
#[test]
fn j71_a_trial_runs_until_its_last_time_has_passed() {
    assert!(!Trial::default().runs());
    assert!(Trial { before: Some(given()), ..Trial::default() }.runs());
    assert!(Trial { again_ms: 1, ..Trial::default() }.runs());
    assert!(Trial { blend_ms: 1, ..Trial::default() }.runs());
}

/// Joint 3 was unstable. A later failure of joint 1 without an unstable control loop does not clear this record of
/// joint 3.
#[test]
fn j66_a_joint_that_was_unstable_stays_known_after_a_tick_without_instability() {
    let mut trial = Trial::default();
    assert_eq!(trial.fails(0, 0, &given(), 2), None);
    assert!(!trial.runs());
    trial.fails(1 << 2, 1 << 2, &given(), 2);
    assert_eq!(trial.fails(1, 0, &given(), 2), None);
    assert!(trial.again(2) && !trial.again(0));
}
