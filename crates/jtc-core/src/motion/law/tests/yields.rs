//! Tests of the beginning and of the end of a yield in the control law (J-68, J-70), and of gains that change under torque (J-71).
use super::*;
use crate::DT;

/// Gains whose integral can hold any torque of these tests.
const WIDE: PidGains = PidGains { kp: 8_000.0, ki: 10.0, kd: 80.0, int_min: -100.0, int_max: 100.0 };

/// Returns the limits of joint 2, whose torque limit is 180 N·m.
fn limits() -> JointConfig {
    Config::avena().joints[1]
}

/// Returns the present torque of the integral, N·m.
fn integral(mut pid: Pid, gains: &PidGains) -> f64 {
    pid.step(gains, 0.0, true, None).i
}

/// The computed torque of 250 N·m is 70 N·m above the limit of 180 N·m. When the joint begins to yield, −70 N·m are
/// added to its blended torque, so that the sum begins at the commanded torque of 180 N·m.
#[test]
fn j68_a_joint_that_begins_to_yield_starts_from_its_commanded_torque() {
    for (model, blend, commanded, blended) in [
        (100.0, 16.0, 116.0, 16.0),
        (-100.0, -16.0, -116.0, -16.0),
        (250.0, 0.0, 180.0, -70.0),
        (234.0, 16.0, 180.0, -54.0),
        (-250.0, 16.0, -180.0, 70.0),
    ] {
        let mut law = ControlLaw::default();
        law.torque[1] = JointTorque { model, blend, ..JointTorque::default() };
        law.begin_yield(1, (false, false), 0.0, 5.0, &limits());
        assert_eq!((law.torque[1].sum(), law.torque[1].blend), (commanded, blended), "{model} {blend}");
    }
}

/// The integral of the joint contains 100 N·m. If the load of a pushed joint is unknown, the yield begins without a
/// load. After hand guiding, it begins with the torque of the integral. A lowered load begins with at most 0.3 · 180
/// N·m = 54 N·m of the integral.
#[test]
fn j68_j70_a_yield_begins_with_the_load_that_the_controller_knows() {
    for (lowers, led, learned, load) in [
        (false, false, None, 0.0),
        (false, false, Some(20.0), 20.0),
        (false, true, None, 100.0),
        (false, true, Some(20.0), 20.0),
        (true, false, None, 54.0),
        (true, true, None, 54.0),
        (true, false, Some(20.0), 20.0),
    ] {
        let mut law = ControlLaw::default();
        law.torque[1].pid.i = 100.0;
        if let Some(torque) = learned {
            law.loads[1].set(torque);
        }
        law.begin_yield(1, (lowers, led), 0.0, 5.0, &limits());
        let begun = law.yields[1].map(|yields| (yields.lowers(), yields.load()));
        assert_eq!(begun, Some((lowers, load)), "{lowers} {led} {learned:?}");
    }
}

#[test]
fn j70_a_joint_that_yields_already_lowers_its_load_only_if_it_is_overloaded() {
    let mut law = ControlLaw::default();
    let lowers = |law: &ControlLaw| law.yields[1].map(|yields| yields.lowers());
    for (overloaded, expected) in [(false, false), (false, false), (true, true), (false, true)] {
        law.begin_yield(1, (overloaded, false), 0.0, 5.0, &limits());
        assert_eq!(lowers(&law), Some(expected), "{overloaded}");
    }
    assert!((0..JOINTS).all(|j| law.yields(j) == (j == 1)));
}

/// Returns a yield whose load has been reduced. The joint carries a load of 40 N·m, moves along this load for 1.3 s,
/// and is then held for 0.6 s. During this motion, the load drives the joint against the spring. The controller
/// therefore reduces the load, because a part of it may not exist.
fn doubted() -> Yield {
    let (limits, mut position) = (limits(), 0.0);
    let mut yields = Yield::begin(false, false, 0.0, 5.0, 40.0);
    for ms in 0..1_900 {
        let velocity = if ms < 1_300 { 0.01 } else { 0.0 };
        position += velocity * DT;
        yields.drag(position);
        yields.step(&Joint {
            position,
            velocity,
            young_velocity: 0.0,
            fresh: true,
            model: -40.0,
            limits: &limits,
            range: (-2.9, 2.9),
            share: 0.3,
            lowering: 1,
        });
    }
    yields
}

/// After a yield, the integral takes over the load plus the torque of the spring. If the spring opposes the load, the
/// sum is smaller than the load. The larger of both values is stored as the learned load, because the opposed part of
/// the load may exist.
#[test]
fn j68_the_load_after_a_yield_is_the_larger_of_what_acts_and_what_is_left() {
    let yields = doubted();
    let load = yields.load();
    assert!(yields.is_over() && yields.has_learned() && load > 6.0 && load < 34.0, "{yields:?}");
    for (spring, left, learned) in [(5.0, load + 5.0, load + 5.0), (-5.0, load - 5.0, load)] {
        let mut law = ControlLaw::default();
        law.begin_yield(4, (false, false), 0.0, 5.0, &limits());
        (law.yields[1], law.torque[1].pid.p) = (Some(yields), spring);
        let ended = law.end_of_yields(&[WIDE; JOINTS]);
        assert_eq!(ended, [false, true, false, false, false, false]);
        assert!(!law.yields(1) && law.yields(4), "only a calm joint is held again");
        assert!((law.loads[1].known_torque() - learned).abs() < 1e-5, "{spring}: {:?}", law.loads[1]);
        assert!((integral(law.pid[1], &WIDE) - left).abs() < 1e-9, "{spring}");
    }
}

/// A joint whose load was unknown before the yield still has no known load after a yield without motion.
#[test]
fn j68_a_yield_without_motion_teaches_no_load() {
    let (limits, mut law) = (limits(), ControlLaw::default());
    let mut yields = Yield::begin(false, false, 0.0, 5.0, 0.0);
    for _ in 0..300 {
        yields.step(&Joint {
            position: 0.0,
            velocity: 0.0,
            young_velocity: 0.0,
            fresh: true,
            model: 0.0,
            limits: &limits,
            range: (-2.9, 2.9),
            share: 0.3,
            lowering: 1,
        });
    }
    law.yields[1] = Some(yields);
    assert!(law.end_of_yields(&[WIDE; JOINTS])[1]);
    assert!(!law.loads[1].is_known());
}

#[test]
fn j25_j68_no_joint_yields_in_teaching_or_without_torque() {
    for teaches in [true, false] {
        let mut arm = Arm::held(NONE);
        for j in [0, 3] {
            arm.motion.law.begin_yield(j, (j == 0, false), POSE[j], 5.0, &arm.config.joints[j]);
        }
        assert!(arm.motion.law.any_yields());
        if teaches {
            arm.motion.law.begin_teaching(&Nodes::enabled_at(POSE, [0.0; JOINTS]), &arm.config);
        } else {
            arm.motion.law.release();
        }
        assert!(!arm.motion.law.any_yields(), "{teaches}");
    }
}

/// Several joints that lower their loads share the damping rate of 40 1/s. With an inertia of 1 kg·m², the damping is
/// 40 N·m·s/rad for one joint, and 20 N·m·s/rad for each of two joints. In the first tick, a fifth of the damping
/// acts. For one joint this is 0.2 · 40 N·m·s/rad · 0.25 rad/s = 2 N·m.
#[test]
fn j70_joints_that_lower_their_loads_share_the_damping() {
    for (lowers, torque) in [([true, false], -2.0), ([true, true], -1.0)] {
        let mut arm = Arm::held(NONE);
        for (j, lowers) in lowers.into_iter().enumerate() {
            arm.motion.law.begin_yield(j, (lowers, false), POSE[j], 1.0, &arm.config.joints[j]);
        }
        arm.tick(ControlMode::Hold, false, 0.25);
        let d = arm.motion.law.torque[0].pid.d;
        assert!((d - torque).abs() < 1e-12, "{lowers:?}: {d} N·m");
    }
}

/// The integral of each joint holds 12 N·m with an integral gain of 10. The gain changes to 40. A held joint keeps
/// its 12 N·m. In a yielding joint, the position controller does not act, so its integral is not adapted and would
/// hold four times the torque.
#[test]
fn j71_new_gains_keep_the_torque_of_the_integral_of_held_joints() {
    let (mut law, steep) = (ControlLaw::default(), PidGains { ki: 40.0, ..WIDE });
    law.begin_yield(2, (false, false), 0.0, 5.0, &limits());
    for j in 0..JOINTS {
        law.pid[j].take_over(&WIDE, 12.0);
        law.torque[j].pid.i = 12.0;
    }
    law.change_gains(&[steep; JOINTS]);
    for j in 0..JOINTS {
        let expected = if j == 2 { 48.0 } else { 12.0 };
        assert!((integral(law.pid[j], &steep) - expected).abs() < 1e-9, "joint {}", j + 1);
    }
}

/// Without a position gain, a joint cannot be held, so the gains are refused. The position gain of an absent joint
/// does not matter.
#[test]
fn j53_j71_the_gains_of_an_absent_joint_need_not_hold() {
    let (law, mut config) = (ControlLaw::default(), Config::avena());
    let mut gains = [WIDE; JOINTS];
    assert!(law.hold_on(&gains, &config));
    gains[2].kp = 0.0;
    assert!(!law.hold_on(&gains, &config));
    config.absent[2] = true;
    assert!(law.hold_on(&gains, &config));
}

/// Joint 4 was disabled and is enabled again. Its old integral, load and yield are cleared, and no integral must
/// release a torque.
#[test]
fn j16_a_joint_that_is_enabled_again_begins_without_its_old_torques() {
    let begun = || {
        let mut law = ControlLaw { unwinds_ms: 100, ..ControlLaw::default() };
        for j in 0..JOINTS {
            law.pid[j].take_over(&WIDE, 12.0);
            law.loads[j].set(5.0);
            law.begin_yield(j, (false, false), 0.0, 5.0, &limits());
        }
        law
    };
    for enabled in [None, Some(3)] {
        let mut law = begun();
        law.latch(&Latched {
            held: core::array::from_fn(|j| Some(j) != enabled),
            just_enabled: core::array::from_fn(|j| Some(j) == enabled),
        });
        for j in 0..JOINTS {
            let held = Some(j) != enabled;
            let torque = if held { 12.0 } else { 0.0 };
            assert!((integral(law.pid[j], &WIDE) - torque).abs() < 1e-9, "{enabled:?}, joint {}", j + 1);
            assert_eq!((law.loads[j].is_known(), law.yields(j)), (held, held), "{enabled:?}, {j}");
        }
        assert_eq!(law.unwinds_ms, if enabled.is_some() { 0 } else { 100 }, "{enabled:?}");
    }
}
