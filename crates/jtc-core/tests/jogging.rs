//! Jogs at the velocity limit, through the whole controller (J-58).
mod rig;

use jtc_core::{Config, ControllerState};
use jtc_wire::{DataStatus, FrameType, UrgentCommand};
use rig::{Rig, floats};

/// What ends a jog while the joint still accelerates.
#[derive(Clone, Copy, Debug)]
enum End {
    Silence,
    Stop,
    Pause,
    Rate(f32),
}

/// Jogs a joint at `rate` (rad/s) from zero for so long, ends that, and watches until the joint stands.
fn jogged(config: &Config, joint: usize, rate: f32, ms: usize, end: End) -> Result<(), String> {
    // The joints of the bench are where they were commanded a tick before.
    let mut rig = Rig::new(Config { delay_ticks: 1, ..config.clone() });
    rig.defaults();
    // The default one is made for slower joints.
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

/// Joint 1 of the shipped arm at 1.5 rad/s: each end between 599 and 695 ms has released the arm. So it was with other joints and arms.
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
    // The last two are no numbers of the wire: what a client sends is the next one above or below the limit.
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

/// A Stop, a Pause, a released key and silence end a jog as a Stop ends a motion on the path: within 520 ms, also from the limit.
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

/// A Stop on another line, while a key is held down: the arm comes to rest, and moves again only after the key was let go.
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
        // The end of a jog is taken, and says nothing of a key.
        rig.run(400);
        assert_eq!(rig.ask(FrameType::Jog, &body(0.0)), DataStatus::NoError);
        rig.run(110);
        assert_eq!(rig.ask(FrameType::Jog, &body(0.02)), DataStatus::NoError);
        rig.run(100);
        assert!(rig.controller.telemetry().joints[0].set_velocity > 0.0);
    }
}
