//! Tests of jogs at the velocity limit, with the whole controller (J-58).
use crate::{plant, rig};

use jtc_core::{Config, ControllerState, Parameters, Payload, TrajectoryState};
use jtc_wire::{DataStatus, FrameType, UrgentCommand};
use plant::{LuGre, Plant, Random, highest, loaded, pose, shares};
use rig::{Rig, floats};

/// Number of random poses in a test.
const TRIALS: usize = 500;

/// Event that ends a jog while the joint still accelerates.
#[derive(Clone, Copy, Debug)]
enum End {
    Silence,
    Stop,
    Pause,
    Rate(f32),
}

/// Jogs a joint at `rate` (rad/s) from standstill for `ms`, ends the jog, and runs until the joint is at rest.
fn jogged(config: &Config, joint: usize, rate: f32, ms: usize, end: End) -> Result<(), String> {
    // In each tick, the joints of the rig are at the commanded positions of the previous tick.
    let mut rig = Rig::new(Config { delay_ticks: 1, ..config.clone() });
    rig.defaults();
    // The default friction is valid only for slower joints, so the test uses zero friction.
    rig.send(FrameType::FrictionPolynomial, &floats([0.0; 24]));
    rig.run(700);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    let body = |rate: f32| {
        let mut rates = [0.0f32; 6];
        rates[joint] = rate;
        floats(rates)
    };
    assert_eq!(rig.ask(FrameType::Jog, &body(rate)), DataStatus::NoError, "{rate} rad/s");
    for tick in 0..ms + 400 {
        if tick < ms && tick % 50 == 0 {
            rig.send(FrameType::Jog, &body(rate));
        }
        if tick == ms {
            match end {
                End::Silence => {}
                End::Stop => rig.urgent(0, UrgentCommand::Stop),
                End::Pause => rig.urgent(1, UrgentCommand::Pause),
                End::Rate(rate) => rig.send(FrameType::Jog, &body(rate)),
            }
        }
        rig.tick();
        let telemetry = rig.controller.telemetry();
        if rig.state() != ControllerState::HoldPos {
            return Err(format!("{end:?} after {ms} ms: {:?}", telemetry.joints[joint]));
        }
    }
    Ok(())
}

/// In an earlier version, a jog of joint 1 of the default arm at 1.5 rad/s could release the arm. This happened if
/// the jog ended between 599 and 695 ms. Other joints and arms also had this fault. A jog must never release the arm.
#[test]
fn j58_a_jog_at_the_velocity_limit_that_ends_while_it_accelerates_releases_no_arm() {
    let fast = |velocity_max: f64, acceleration_max: f64| {
        let mut config = Config::avena();
        for joint in &mut config.joints {
            (joint.velocity_max, joint.acceleration_max) = (velocity_max, acceleration_max);
            (joint.position_min, joint.position_max) = (-2.9, 2.9);
        }
        config
    };
    // The wire format cannot represent the velocity limits 3.15 and 3.2 rad/s exactly. A client sends the nearest
    // value, which is slightly above or below the limit.
    for (config, first, last) in
        [(Config::avena(), 590, 700), (fast(3.15, 20.0), 735, 850), (fast(3.2, 20.0), 735, 850)]
    {
        for joint in [0, 5] {
            let limit = config.joints[joint].velocity_max as f32;
            for (n, ms) in (first..last).step_by(9).enumerate() {
                let ends = [
                    End::Stop,
                    End::Silence,
                    End::Pause,
                    End::Rate(0.0),
                    End::Rate(limit / 3.0),
                    End::Rate(-limit),
                ];
                let rate = [limit, -limit, limit * 0.9991][n % 3];
                assert_eq!(
                    jogged(&config, joint, rate, ms, ends[n % ends.len()]),
                    Ok(()),
                    "joint {}",
                    joint + 1
                );
            }
        }
    }
}

/// A Stop, a Pause, a released key or missing Jog frames must bring a jog to rest within 520 ms, even at the velocity
/// limit. This time limit also applies to a Stop on a path.
#[test]
fn j33_j58_a_jog_stands_within_the_time_of_a_stop() {
    for share in [0.1, 0.7, 1.0] {
        for (end, wait) in [(End::Stop, 0), (End::Pause, 0), (End::Rate(0.0), 0), (End::Silence, 200)] {
            let config = Config { delay_ticks: 1, ..Config::avena() };
            let rate = share * config.joints[0].velocity_max as f32;
            let mut rig = Rig::new(config);
            rig.defaults();
            rig.run(700);
            let body = |rate: f32| floats([rate, 0.0, 0.0, 0.0, 0.0, 0.0]);
            for tick in 0..900 {
                if tick % 50 == 0 {
                    rig.send(FrameType::Jog, &body(rate));
                }
                rig.tick();
            }
            let speed = rig.controller.telemetry().joints[0].set_velocity;
            assert!((speed - f64::from(rate)).abs() < 1e-6, "{speed}");
            match end {
                End::Silence => {}
                End::Stop => rig.urgent(0, UrgentCommand::Stop),
                End::Pause => rig.urgent(1, UrgentCommand::Pause),
                End::Rate(rate) => rig.send(FrameType::Jog, &body(rate)),
            }
            let ticks = rig.until(wait + 520, |r| r.controller.telemetry().joints[0].set_velocity == 0.0);
            rig.run(200);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{end:?} {share}");
            println!("{end:?} from {rate} rad/s: {ticks} ms");
        }
    }
}

/// A Stop or Pause arrives while a jog key is pressed. The arm must come to rest, and may move again only after the
/// operator has released the key.
#[test]
fn j58_a_key_that_is_held_down_moves_nothing_after_a_stop() {
    for (line, command) in [(0, UrgentCommand::Stop), (1, UrgentCommand::Stop), (1, UrgentCommand::Pause)] {
        let mut rig = Rig::new(Config { delay_ticks: 1, ..Config::avena() });
        rig.defaults();
        rig.run(700);
        let body = |rate: f32| floats([rate, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for tick in 0..500 {
            if tick % 50 == 0 {
                rig.send(FrameType::Jog, &body(0.02));
            }
            rig.tick();
        }
        rig.urgent(line, command);
        rig.run(1);
        for ms in 0..1_500 {
            if ms % 50 == 10 {
                assert_eq!(rig.ask(FrameType::Jog, &body(0.02)), DataStatus::NotAllowed, "{ms} ms");
            }
            rig.tick();
            let speed = rig.controller.telemetry().joints[0].set_velocity;
            assert!(ms < 520 || speed == 0.0, "{ms} ms: {speed} rad/s");
        }
        // A Jog with rate 0 ends a jog. The controller accepts it and does not treat it as a pressed key, so the next
        // Jog moves the joint.
        rig.run(400);
        assert_eq!(rig.ask(FrameType::Jog, &body(0.0)), DataStatus::NoError);
        rig.run(110);
        assert_eq!(rig.ask(FrameType::Jog, &body(0.02)), DataStatus::NoError);
        rig.run(100);
        assert!(rig.controller.telemetry().joints[0].set_velocity > 0.0);
    }
}

/// A simulated arm with a load that the controller knows is jogged in random poses. Either one joint moves, at any
/// rate up to its velocity limit, or all joints move. No torque may reach its limit, and the arm must come to rest
/// within the permitted time. The controller may refuse a jog only if little torque remains for a motion.
#[test]
fn j58_a_jog_never_takes_all_the_torque_in_any_pose() {
    let seed = 11;
    println!("seed {seed}");
    let mut random = Random(seed);
    let (mut refused, mut most) = (0, 0.0_f64);
    for trial in 0..TRIALS {
        let mass = [0.0, 2.0, 4.0][trial % 3];
        let (pose, standing) = pose(&mut random, mass, 0.95);
        let config = Config { payload: Payload { mass, ..Payload::NONE }, ..Config::avena() };
        let limits = config.joints;
        let mut arm = Plant::new(&loaded(Parameters::avena().model, mass), LuGre::of_avena_times(1.0), pose);
        let mut rig = arm.holding(config);
        arm.brakes = false;
        arm.run(&mut rig, 500);
        let single = random.next() < 0.6;
        let chosen = (random.between(0.0, 6.0) as usize).min(5);
        let rates: [f32; 6] = core::array::from_fn(|j| {
            let rate = limits[j].velocity_max * random.between(-1.0, 1.0);
            match single {
                true if j == chosen => (limits[j].velocity_max.copysign(rate)) as f32,
                true => 0.0,
                false => rate as f32,
            }
        });
        let (ms, stops) = (random.between(200.0, 1_600.0) as usize, random.next() < 0.5);
        let about = format!("trial {trial}: {mass} kg, {rates:.2?} for {ms} ms from {pose:.2?}");
        let mut highest_torque = 0.0_f64;
        let mut tick = |arm: &mut Plant, rig: &mut Rig| {
            arm.tick(rig);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}");
            highest_torque = highest_torque.max(highest(&shares(&rig.torque)));
        };
        if rig.ask(FrameType::Jog, &floats(rates)) != DataStatus::NoError {
            refused += 1;
            assert!(highest(&standing) > 0.8, "{about}: refused at {standing:.2?}");
            continue;
        }
        for k in 0..ms {
            if k % 50 == 0 {
                rig.send(FrameType::Jog, &floats(rates));
            }
            tick(&mut arm, &mut rig);
        }
        rig.send(FrameType::Jog, &floats([0.0; 6]));
        if stops {
            rig.urgent(0, UrgentCommand::Stop);
        }
        for k in 0..900 {
            tick(&mut arm, &mut rig);
            let set = rig.controller.telemetry().joints.map(|joint| joint.set_velocity);
            assert!(k < 520 || set == [0.0; 6], "{about}: {set:?} after {k} ms");
        }
        assert!(highest_torque < 0.995, "{about}: {highest_torque} of a limit; {standing:.2?} at rest");
        most = most.max(highest_torque);
    }
    println!("{refused} of {TRIALS} refused; at most {:.0} % of a torque limit", 100.0 * most);
}

/// Joint 2 needs nearly all of its torque limit to hold its load. The controller must refuse each jog that increases
/// this load: upwards, downwards to a pose with a higher load, and joint 3 outwards. The controller must accept a jog
/// downwards that reduces the load. If half of the torque limit remains, it must execute every jog.
#[test]
fn j58_a_jog_that_loads_a_joint_with_nothing_left_is_refused_and_one_that_unloads_it_is_taken() {
    let model = Parameters::avena().model;
    let hold = |q: [f64; 6]| plant::standing(&model, &q)[1];
    let moved =
        |q: [f64; 6], j: usize, way: f64| core::array::from_fn(|k| if k == j { q[k] + way } else { q[k] });
    // In the first pose, the arm is stretched out above the horizontal. In the second pose, the arm is bent below the horizontal, so a
    // motion downwards reduces the load of joint 2.
    let (above, below) = ([0.0, 1.2, 0.2, 0.0, 0.0, 0.0], [0.0, 1.4, -1.6, 0.0, 0.0, 0.0]);
    let down = |q: [f64; 6]| -hold(q).signum();
    assert!(hold(moved(above, 1, 0.1 * down(above))).abs() > hold(above).abs());
    assert!(hold(moved(below, 1, 0.1 * down(below))).abs() < hold(below).abs());
    let outwards = if hold(moved(above, 2, 0.1)).abs() > hold(above).abs() { 1.0 } else { -1.0 };
    for (pose, share, joint, sign, moves) in [
        (above, 0.999, 1, -down(above), false),
        (above, 0.999, 1, down(above), false),
        (above, 0.999, 2, outwards, false),
        (below, 0.999, 1, -down(below), false),
        (below, 0.999, 1, down(below), true),
        (above, 0.5, 1, -down(above), true),
        (above, 0.5, 2, outwards, true),
    ] {
        let mut config = Config { delay_ticks: 1, ..Config::avena() };
        config.joints[1].torque_max = hold(pose).abs() / share;
        let mut rig = Rig::held_at(config, pose);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        let mut rates = [0.0f32; 6];
        rates[joint] = 0.3 * sign as f32;
        let about = format!("{share} of the limit, joint {} at {}", joint + 1, rates[joint]);
        let answer = if moves { DataStatus::NoError } else { DataStatus::NotAllowed };
        assert_eq!(rig.ask(FrameType::Jog, &floats(rates)), answer, "{about}");
        for tick in 0..1_000 {
            if tick % 50 == 0 && moves {
                rig.send(FrameType::Jog, &floats(rates));
            }
            rig.tick();
        }
        let speed = rig.controller.telemetry().joints[joint].set_velocity * sign;
        assert_eq!(speed > 0.0, moves, "{about}: {speed}");
        assert!(share > 0.9 || speed > 0.29, "{about}: {speed}");
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}");
    }
}

/// When the next jog begins, the Stop or the end of the last jog counts as completed, even if a person touches a
/// joint. The controller must not treat the motion of the new jog as a stop that has failed.
#[test]
fn j33_j58_a_jog_behind_a_stop_is_no_stop_that_failed() {
    let body = |rate: f32| floats([rate, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for (torque_release, jogs_before) in [(false, false), (true, false), (false, true), (true, true)] {
        let mut rig = Rig::holding_with(Config { torque_release, delay_ticks: 1, ..Config::avena() });
        if jogs_before {
            for tick in 0..500 {
                if tick % 50 == 0 {
                    rig.send(FrameType::Jog, &body(0.5));
                }
                rig.tick();
            }
            rig.send(FrameType::Jog, &body(0.0));
            rig.run(30);
        } else {
            rig.move_along(&rig::pieces(1, &[(0.5, 40), (0.0, 300), (-0.5, 40)]), 1_000);
            rig.urgent(0, UrgentCommand::Stop);
            rig.until(600, |rig| rig.trajectory() == TrajectoryState::Stop);
        }
        // The speed of the touched joint is below the over-speed that releases the arm.
        rig.nodes[4].report.velocity = 0.03;
        for tick in 0..1_500 {
            if tick == 400 {
                rig.nodes[4].report.velocity = 0.0;
            }
            if tick % 50 == 0 {
                rig.send(FrameType::Jog, &body(0.5));
            }
            rig.tick();
            let about = format!("{torque_release} {jogs_before}, {tick} ms");
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}");
        }
        assert!(rig.controller.telemetry().joints[0].set_velocity > 0.49);
    }
}

/// An arm carries 3.5 or 4 kg. An operator holds down a key that moves joint 2 outwards, until the controller stops
/// the joint. No error may occur, and enough torque must remain for the motion back.
#[test]
fn j58_a_held_key_takes_no_joint_to_where_it_cannot_come_back_from() {
    for (mass, seconds) in [(3.5, 20), (4.0, 20)] {
        let model = loaded(Parameters::avena().model, mass);
        let mut arm = Plant::new(&model, LuGre::of_avena_times(1.0), [0.0, 0.6, 0.2, 0.0, 0.0, 0.0]);
        let mut rig = arm.holding(Config { payload: Payload { mass, ..Payload::NONE }, ..Config::avena() });
        arm.brakes = false;
        arm.run(&mut rig, 1_000);
        let jog = |arm: &mut Plant, rig: &mut Rig, rate: f32, seconds: usize| {
            for k in 0..1_000 * seconds {
                if k % 50 == 0 {
                    rig.send(FrameType::Jog, &floats([0.0, rate, 0.0, 0.0, 0.0, 0.0]));
                }
                arm.tick(rig);
                let about = format!("{mass} kg, {rate} rad/s, {k} ms, {:?}", arm.q);
                assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}");
            }
        };
        jog(&mut arm, &mut rig, 0.2, seconds);
        let (out, share) = (arm.q[1], shares(&plant::standing(&model, &arm.q))[1]);
        assert!(share > 0.85 && share < 0.95, "{mass} kg: {share}");
        arm.run(&mut rig, 1_000);
        jog(&mut arm, &mut rig, -0.2, 15);
        assert!(arm.q[1] < out - 0.3, "{mass} kg: from {out} to {}", arm.q[1]);
    }
}

/// The controller needs time to compute the torque that remains for a jog. The controller therefore processes only one
/// Jog frame per tick, even if it refuses this frame.
#[test]
fn j58_one_jog_is_served_in_a_tick_also_where_it_is_refused() {
    let pose = [0.0, 1.2, 0.2, 0.0, 0.0, 0.0];
    let held = plant::standing(&Parameters::avena().model, &pose)[1];
    for (share, answer) in [(0.999, DataStatus::NotAllowed), (0.5, DataStatus::NoError)] {
        let mut config = Config { delay_ticks: 1, ..Config::avena() };
        config.joints[1].torque_max = held.abs() / share;
        let mut rig = Rig::held_at(config, pose);
        rig.run(1_000);
        // The jog moves the arm upwards.
        let rate = 0.3 * held.signum() as f32;
        let jog = floats([0.0, rate, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(rig.ask(FrameType::Jog, &jog), answer, "{share}");
        (0..8).for_each(|_| rig.send(FrameType::Jog, &jog));
        for _ in 0..8 {
            rig.tick();
            assert_eq!(rig.last.host_done, 1, "{share}");
        }
    }
}

/// A joint that is declared absent holds no load, for any model. An absent joint therefore does not prevent a jog of
/// another joint.
#[test]
fn j53_j58_an_absent_joint_keeps_no_other_from_being_jogged() {
    let pose = [0.0, 1.4, 0.2, 0.0, 0.0, 0.0];
    let held = plant::standing(&Parameters::avena().model, &pose)[1];
    let mut config = Config { delay_ticks: 1, absent_position: pose, ..Config::avena() };
    config.absent[1] = true;
    config.joints[1].torque_max = held.abs() / 1.2;
    let mut rig = Rig::new(config);
    rig.follow = false;
    for (node, q) in rig.nodes.iter_mut().zip(pose) {
        node.report.position = q;
    }
    rig.nodes[1].silent = true;
    rig.defaults();
    rig.run(1_500);
    rig.follow = true;
    rig.run(500);
    for joint in [0, 2, 5] {
        let mut rates = [0.0f32; 6];
        rates[joint] = 0.2;
        assert_eq!(rig.ask(FrameType::Jog, &floats(rates)), DataStatus::NoError, "joint {}", joint + 1);
        rig.run(900);
    }
}

/// An operator presses, changes and releases keys of several joints in random poses. The flange must never exceed the
/// tool speed limit, and must reach this limit if a single joint moves. The test computes the speed of the flange
/// from its poses in consecutive ticks.
#[test]
fn j58_a_jog_keeps_to_the_tool_speed_limit() {
    const LIMIT: f64 = 0.25;
    let seed = 23;
    println!("seed {seed}");
    let mut random = Random(seed);
    let model = Parameters::avena().model;
    let dynamics = jtc_dynamics::Dynamics::new(&model, Config::avena().gravity);
    let flange = |q: &[f64; 6]| dynamics.forward_kinematics(q)[6].position;
    let (mut fastest, mut alone) = (0.0f64, 0.0f64);
    for trial in 0..90 {
        let config = Config { tool_speed_max: LIMIT, delay_ticks: 1, ..Config::avena() };
        let mut rig = Rig::new(config);
        rig.follow = false;
        for (node, q) in rig.nodes.iter_mut().zip(pose(&mut random, 0.0, 0.6).0) {
            node.report.position = q;
        }
        rig.defaults();
        rig.run(700);
        rig.follow = true;
        let set = |rig: &Rig| rig.controller.telemetry().joints.map(|joint| joint.set_position);
        let (mut keys, mut last) = ([0.0f32; 6], flange(&set(&rig)));
        let single = trial % 3 == 0;
        let again = [20, 50, 199][trial % 3];
        let mut change = 0;
        for ms in 0..4_000 {
            let changes = ms == change;
            if changes {
                change += if single { 1_000 } else { random.between(40.0, 900.0) as usize };
                keys = core::array::from_fn(|j| {
                    let on = if single { j == trial / 3 % 3 } else { random.next() < 0.5 };
                    if on { random.between(-1.5, 1.5) as f32 } else { 0.0 }
                });
            }
            if changes || ms % again == 0 {
                rig.send(FrameType::Jog, &floats(keys));
            }
            rig.tick();
            assert_eq!(
                rig.state(),
                ControllerState::HoldPos,
                "trial {trial}: {:?}",
                rig.controller.telemetry()
            );
            let here = flange(&set(&rig));
            let way: f64 = (0..3).map(|k| (here[k] - last[k]).powi(2)).sum();
            let speed = way.sqrt() / 0.001;
            fastest = fastest.max(speed);
            if single {
                alone = alone.max(speed);
            }
            assert!(speed < 1.01 * LIMIT, "trial {trial} after {ms} ms: {speed} m/s with keys {keys:.2?}");
            last = here;
        }
    }
    println!("fastest {fastest:.4} m/s, by one joint alone {alone:.4} m/s");
    assert!(alone > 0.97 * LIMIT, "{alone} m/s");
}
