//! Tests of the gains and models that the controller accepts, and of the states in which it accepts these parameters.
//! Accepted parameters must not cause a sudden motion of a held arm (J-06).
use crate::rig;

use jtc_core::{Config, ControllerState, Parameters, TrajectoryState};
use jtc_dynamics::ArmModel;
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, UrgentCommand};
use proptest::prelude::*;
use rig::{Rig, floats, model_body, rest, segment_body};

/// Returns a rig in which gravity acts along y, so that the arm in its zero position has a large load.
fn on_a_wall() -> Rig {
    Rig::holding_with(Config { gravity: [0.0, 9.81, 0.0], ..Config::avena() })
}

fn gains_body(gains: [f32; 5]) -> Vec<u8> {
    floats((0..6).flat_map(|_| gains))
}

fn torques(rig: &Rig) -> [u64; 6] {
    rig.controller.telemetry().joints.map(|j| j.torque.to_bits())
}

/// Checks that the controller refuses the frame, and that the torques are then identical in every bit to the torques
/// without the frame.
fn refused_without_a_trace(frame_type: FrameType, body: &[u8], what: &str) {
    let (mut asked, mut quiet) = (on_a_wall(), on_a_wall());
    for rig in [&mut asked, &mut quiet] {
        rig.follow = false;
        rig.nodes[1].report.position = 0.0003;
    }
    asked.send(frame_type, body);
    for n in 0..200 {
        asked.tick();
        quiet.tick();
        assert_eq!(torques(&asked), torques(&quiet), "{what}, tick {n}");
    }
    let record = *asked.records().last().expect("a record");
    assert_eq!((record.frame_type, record.data), (frame_type as u8, DataStatus::IncorrectValue), "{what}");
    assert_eq!(asked.state(), ControllerState::HoldPos);
}

#[test]
fn j06_gains_that_would_throw_the_arm_are_refused_whole() {
    let good = [8000.0, 14000.0, 80.0, -120.0, 120.0];
    for (place, value) in [
        (0, -1.0),
        (1, -1.0),
        (2, -0.001),
        (0, 3e38),
        (0, 50_001.0),
        (1, 50_001.0),
        (2, 501.0),
        (3, -1001.0),
        (4, 1001.0),
        (3, 121.0),
        (4, -121.0),
        // 14 000 N·m/(rad·s) times 0.01 rad·s is 140 N·m, which is more than the torque limit of the joint.
        (3, 0.01),
        (4, -0.01),
        (0, f32::NAN),
        (4, f32::INFINITY),
    ] {
        let mut gains = good;
        gains[place] = value;
        // Only the last joint has a wrong value, but the gains of the other joints must not change either.
        let body = floats((0..6).flat_map(|j| if j == 5 { gains } else { [100.0, 0.0, 0.0, -1.0, 1.0] }));
        refused_without_a_trace(FrameType::PidParam, &body, &format!("{gains:?}"));
    }
}

#[test]
fn j06_gains_in_use_are_taken() {
    for gains in [
        [8000.0, 14000.0, 80.0, -120.0, 120.0],
        [4000.0, 24000.0, 60.0, -40.0, 40.0],
        [420.0, 160.0, 20.0, -10.0, 10.0],
        // The first of these integrals is switched off, because both bounds are 0. The second has a fixed value,
        // because both bounds are 0.5.
        [8000.0, 14000.0, 80.0, 0.0, 0.0],
        [8000.0, 10.0, 80.0, 0.5, 0.5],
    ] {
        let mut rig = Rig::holding();
        assert_eq!(rig.ask(FrameType::PidParam, &gains_body(gains)), DataStatus::NoError, "{gains:?}");
    }
    // For an arm with more joint inertia, the controller must accept these high gains.
    let mut config = Config::avena();
    config.joints.iter_mut().for_each(|joint| joint.rotor_inertia = 2.0);
    let mut rig = Rig::holding_with(config);
    let gains = gains_body([28000.0, 24000.0, 260.0, -100.0, 100.0]);
    assert_eq!(rig.ask(FrameType::PidParam, &gains), DataStatus::NoError);
}

#[test]
fn j06_models_that_would_throw_or_drop_the_arm_are_refused_whole() {
    let with = |change: &dyn Fn(&mut ArmModel)| {
        let mut model = Parameters::avena().model;
        change(&mut model);
        model_body(&model)
    };
    for (what, body) in [
        (
            "masses times 4: more than the joints can hold here",
            with(&|m| m.links.iter_mut().for_each(|l| l.mass *= 4.0)),
        ),
        ("masses times a million", with(&|m| m.links.iter_mut().for_each(|l| l.mass *= 1e6))),
        ("a base of 51 kg", with(&|m| m.links[0].mass = 51.0)),
        ("a flange of 51 kg", with(&|m| m.links[6].mass = 51.0)),
        ("a negative mass", with(&|m| m.links[3].mass = -0.1)),
        ("no mass in link 1", with(&|m| m.links[1].mass = 0.0)),
        ("no mass in link 5", with(&|m| m.links[5].mass = 0.0)),
        ("a negative moment", with(&|m| m.links[2].inertia[0] = -0.1)),
        ("products against the moments", with(&|m| m.links[2].inertia[1] = 5.0)),
        ("against the triangle inequality", with(&|m| m.links[2].inertia[0] = 3.0)),
        ("inertias of 101 kg·m²", with(&|m| m.links[2].inertia = [101.0, 0.0, 0.0, 101.0, 0.0, 101.0])),
        ("a centre of mass 10 m away", with(&|m| m.links[3].origin.xyz[0] = 10.0)),
        ("a forearm of 3e38 m", with(&|m| m.joints[3].xyz[0] = 3e38)),
    ] {
        refused_without_a_trace(FrameType::ArmModel, &body, what);
    }
}

#[test]
fn j06_links_without_mass_are_taken_at_the_ends() {
    let mut model = Parameters::avena().model;
    (model.links[0].mass, model.links[6].mass) = (0.0, 0.0);
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(FrameType::ArmModel, &model_body(&model)), DataStatus::NoError);
}

#[test]
fn j06_parameters_are_settable_in_init_holdpos_and_error_only() {
    let gains = gains_body([100.0, 0.0, 1.0, -1.0, 1.0]);
    let model = model_body(&Parameters::avena().model);
    let frames: [(FrameType, &[u8]); 6] = [
        (FrameType::PidParam, &gains),
        (FrameType::PidParamUseDefault, &[]),
        (FrameType::ArmModel, &model),
        (FrameType::ArmModelUseDefault, &[]),
        (FrameType::FrictionPolynomialUseDefault, &[]),
        (FrameType::FrictionTableUseDefault, &[]),
    ];
    let check = |rig: &mut Rig, state: ControllerState, expected: DataStatus| {
        for (frame_type, body) in frames {
            assert_eq!(rig.state(), state);
            assert_eq!(rig.ask(frame_type, body), expected, "{frame_type} in {state:?}");
        }
    };
    let mut rig = Rig::new(Config::avena());
    rig.run(100);
    // The controller leaves Init after the last of these three parameters. The test therefore sends only two of them.
    assert_eq!(rig.ask(frames[0].0, frames[0].1), DataStatus::NoError);
    assert_eq!(rig.ask(frames[4].0, frames[4].1), DataStatus::NoError);
    assert_eq!(rig.state(), ControllerState::Init);
    let mut rig = Rig::holding();
    check(&mut rig, ControllerState::HoldPos, DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    // Teaching begins only after the integral has released the load that it contained with the last model.
    rig.until(4_000, |r| r.state() == ControllerState::Teaching);
    check(&mut rig, ControllerState::Teaching, DataStatus::NotAllowed);
    rig.ask(FrameType::TeachingModeDisable, &[]);
    rig.run(300);
    rig.execute(&[rest(0); 200]);
    rig.run(10);
    check(&mut rig, ControllerState::Operate, DataStatus::NotAllowed);
    rig.safety_input = false;
    rig.run(2);
    check(&mut rig, ControllerState::Error, DataStatus::NoError);
}

#[test]
fn j30_a_segment_is_not_copied_on_after_an_error() {
    // The test causes an error at different stages of the copy.
    for ticks in [1, 5, 15, 25, 29, 33, 37] {
        let mut rig = Rig::holding();
        let points: Vec<RawPoint> = (0..1500).map(|_| rest(0)).collect();
        rig.send(FrameType::Trajectory, &segment_body(7, 0, 1, 10, &points));
        rig.run(ticks);
        assert_eq!(rig.waiting(), 1, "still at it after {ticks} ticks");
        rig.safety_input = false;
        rig.run(60);
        let record = *rig.records().last().unwrap();
        assert_eq!((record.frame_type, record.data), (4, DataStatus::NotAllowed));
        rig.safety_input = true;
        rig.clear(true, 0);
        rig.until(1500, |r| r.state() == ControllerState::HoldPos);
        assert_eq!(rig.trajectory(), TrajectoryState::Null);
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    }
}

#[test]
fn j24_nothing_of_a_trajectory_survives_an_error_or_init() {
    for error in [true, false] {
        for segments in [1, 2] {
            let mut rig = Rig::holding();
            let first = segment_body(7, 0, segments, 10, &[rest(0); 50]);
            assert_eq!(rig.ask(FrameType::Trajectory, &first), DataStatus::NoError);
            if error {
                rig.press_stop(5);
                rig.clear(true, 0);
            } else {
                rig.nodes[2].configured = false;
                rig.nodes[2].report.state = jtc_bus::NodeState::INIT;
                rig.run(2);
                assert_eq!(rig.state(), ControllerState::Init);
            }
            rig.until(1500, |r| r.state() == ControllerState::HoldPos);
            rig.run(600);
            assert_eq!((rig.state(), rig.trajectory()), (ControllerState::HoldPos, TrajectoryState::Null));
            assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
            let next = segment_body(7, 1, 2, 10, &[rest(0); 50]);
            assert_eq!(rig.ask(FrameType::Trajectory, &next), DataStatus::IncorrectSegmentOrder);
        }
    }
}

/// Returns an arm after an Execute was sent, while one of its drives needs a long time to enable.
fn waiting_for_a_drive() -> Rig {
    let mut rig = Rig::with_a_slow_drive(Config::avena());
    rig.run(50);
    let there_and_back = |n: i16| rest(if n < 25 { n } else { 50 - n });
    rig.upload(&(0..51).map(there_and_back).collect::<Vec<_>>(), 20);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.run(3000);
    let t = rig.controller.telemetry();
    assert_eq!(
        (t.trajectory, t.point, t.joints[0].set_position),
        (TrajectoryState::Execute, 0, 0.0),
        "shown, and nothing moves"
    );
    assert!(rig.status().trajectory == TrajectoryState::Execute);
    rig
}

#[test]
fn j16_an_execute_waits_for_drives_that_are_being_enabled() {
    let mut rig = waiting_for_a_drive();
    rig.nodes[2].slow_enable = false;
    rig.nodes[2].report.state = jtc_bus::NodeState::ENABLED;
    rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j16_stop_and_pause_cancel_an_execute_that_waits_for_a_drive() {
    for (command, to) in
        [(UrgentCommand::Stop, TrajectoryState::Stop), (UrgentCommand::Pause, TrajectoryState::Pause)]
    {
        for urgent in [true, false] {
            let mut rig = waiting_for_a_drive();
            if urgent {
                rig.urgent(0, command);
                rig.tick();
            } else {
                assert_eq!(rig.exec(command.into()), DataStatus::NoError);
            }
            assert_eq!(rig.trajectory(), to, "at once");
            rig.nodes[2].slow_enable = false;
            rig.nodes[2].report.state = jtc_bus::NodeState::ENABLED;
            for _ in 0..3000 {
                rig.tick();
                let t = rig.controller.telemetry();
                assert_eq!(
                    (t.trajectory, t.point, t.joints[0].set_position),
                    (to, 0, 0.0),
                    "nothing moves later"
                );
            }
            // The Stop or Pause has cancelled only the earlier Execute, so the controller executes the path now.
            assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
            rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
        }
    }
}

/// Checks that the arm is held during a change of parameters: without an error, without torque above the limits, and without a torque step.
/// A refused change of parameters must not have any effect.
fn holds(frame_type: FrameType, body: &[u8], error: f64) -> Result<(), TestCaseError> {
    let (mut asked, mut quiet) = (on_a_wall(), on_a_wall());
    for rig in [&mut asked, &mut quiet] {
        rig.follow = false;
        rig.nodes[1].report.position = error;
        rig.run(50);
    }
    let accepted = asked.ask(frame_type, body) == DataStatus::NoError;
    let mut last = asked.controller.telemetry().joints.map(|j| j.torque);
    for _ in 0..300 {
        asked.tick();
        let t = asked.controller.telemetry();
        prop_assert_eq!((t.state, t.errors), (ControllerState::HoldPos, 0), "{}", accepted);
        for (j, limits) in Config::avena().joints.iter().enumerate() {
            let torque = t.joints[j].torque;
            prop_assert!(torque.abs() <= limits.torque_max);
            // The torque changes smoothly over 100 ms. Its slope is at most 1.5 times the slope of a straight line
            // from one torque limit to the other.
            let step = (torque - last[j]).abs();
            prop_assert!(step <= 2.0 * limits.torque_max * 0.015 + 0.1, "joint {}: {} N·m", j + 1, step);
            last[j] = torque;
        }
    }
    if !accepted {
        quiet.run(300);
        // The two rigs may have executed different numbers of ticks before their response records arrived. The
        // torques of the position hold must be equal nevertheless.
        let (a, b) = (asked.controller.telemetry(), quiet.controller.telemetry());
        for j in 0..6 {
            prop_assert!((a.joints[j].torque_model - b.joints[j].torque_model).abs() < 1e-9);
            prop_assert!((a.joints[j].torque_p - b.joints[j].torque_p).abs() < 1e-9);
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..Default::default() })]

    #[test]
    fn j06_no_change_of_gains_throws_an_arm_that_is_held(
        decades in prop::array::uniform5(-2.0f64..6.0),
        signs in prop::array::uniform5(0u8..8),
    ) {
        let mut gains = decades.map(|decade| 10f64.powf(decade) as f32);
        for (gain, sign) in gains.iter_mut().zip(signs) {
            *gain *= if sign == 0 { -1.0 } else { 1.0 };
        }
        gains[3] = -gains[3];
        // The arm is at rest at its commanded position, so the new gains act on a position error of zero.
        holds(FrameType::PidParam, &gains_body(gains), 0.0)?;
    }

    #[test]
    fn j06_no_change_of_the_model_throws_an_arm_that_is_held(
        decades in prop::array::uniform7(-1.0f64..6.0),
        few in 0usize..7,
        shift in -1.0f64..1.0,
    ) {
        let mut model = Parameters::avena().model;
        for (link, decade) in model.links.iter_mut().zip(decades).skip(few) {
            let factor = 10f64.powf(decade / 3.0);
            link.mass *= factor;
            link.inertia = link.inertia.map(|i| i * factor);
            link.origin.xyz[0] += shift;
        }
        holds(FrameType::ArmModel, &model_body(&model), 0.0)?;
    }
}
