//! Tests of motions and of events that end them: Disable, silent hosts, jogs and torque gains (J-53, J-58, J-59, J-61).
use super::*;

#[test]
fn j53_disable_is_for_an_arm_that_is_held_at_rest_or_not_held() {
    for (state, speed, taken) in [
        (ControllerState::HoldPos, 0.0, true),
        (ControllerState::HoldPos, 0.019, true),
        (ControllerState::HoldPos, 0.1, false),
        (ControllerState::Operate, 0.0, false),
        (ControllerState::Teaching, 0.0, false),
        (ControllerState::Init, 0.0, true),
        (ControllerState::Init, 0.1, true),
        (ControllerState::Error, 0.1, true),
    ] {
        let mut bench = Bench::new();
        bench.use_defaults();
        bench.force(state);
        bench.controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0, 0.0, speed, 0.0, 0.0, 0.0]);
        let expected = if taken { DataStatus::NoError } else { DataStatus::NotAllowed };
        assert_eq!(bench.at_once(Command::Disable), expected, "{state:?} {speed}");
        let all = missing_parameter::FRICTION | missing_parameter::PID | missing_parameter::MODEL;
        assert_eq!(bench.controller.parameters.missing(), if taken { all } else { 0 });
        if taken {
            let errors = state == ControllerState::Error;
            if errors {
                bench.controller.errors.raise_device();
            }
            bench.controller.choose_state();
            let next = if errors { ControllerState::Error } else { ControllerState::Init };
            assert_eq!(bench.controller.state, next);
        }
    }
    // During a jog the arm does not count as at rest, so Disable is refused.
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.force(ControllerState::HoldPos);
    bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
    assert_eq!(bench.at_once(Command::Disable), DataStatus::NotAllowed);
}

#[test]
fn j59_hosts_that_are_silent_end_teaching_and_pause_the_path() {
    use crate::execution::phase::Phase;
    for (limit, silent, ends) in [(0, 60_000, false), (500, 499, false), (500, 500, true)] {
        let mut bench = Bench::new();
        bench.controller.config.host_timeout_ms = limit;
        bench.controller.extensions.hosts_silent_ms = silent - 1;
        (bench.controller.teaching, bench.controller.trajectory) = (true, TrajectoryState::Execute);
        bench.controller.phase = Phase::Running { leave: None };
        bench.controller.watch_hosts(&Inputs::QUIET, 0);
        assert_eq!(bench.controller.teaching, !ends, "{limit} {silent}");
        let leave = ends.then_some(TrajectoryState::Pause);
        assert_eq!(bench.controller.phase, Phase::Running { leave }, "{limit} {silent}");
    }
    // A valid frame of any host ends the silence of the hosts. Noise does not end this silence.
    let frame = FrameRef::new_checked(&fixed::GET_INFO).expect("a good frame");
    let noise = LinkEvent::Noise(Response::bad(0, FrameStatus::IncorrectHeader, 0));
    for (event, left) in [(LinkEvent::Frame(frame), 0), (noise, 78)] {
        let mut bench = Bench::new();
        bench.controller.extensions.hosts_silent_ms = 77;
        let host = [HostEvent { line: 1, overtaken: false, plain: false, event }];
        bench.controller.watch_hosts(&Inputs { host: &host, ..Inputs::QUIET }, 1);
        assert_eq!(bench.controller.extensions.hosts_silent_ms, left);
    }
}

#[test]
fn j61_drives_are_asked_for_the_joint_torque_times_the_gain() {
    let mut bench = Bench::new();
    for (j, joint) in bench.controller.config.joints.iter_mut().enumerate() {
        joint.torque_gain = 1.0 + 0.1 * j as f64;
    }
    bench.force(ControllerState::HoldPos);
    let torque = [10.0, -20.0, 5.0, -1.0, 30.0, 8.0];
    let frame = bench.controller.frame(ControllerState::HoldPos, torque);
    let Ok(jtc_bus::Request::Move { torque: asked, .. }) = jtc_bus::Request::parse(&frame) else {
        panic!("{frame:?} is no Move: {:?}", Target::NoChange)
    };
    for j in 0..JOINTS {
        let expected = torque[j] * (1.0 + 0.1 * j as f64);
        assert!((asked[j] - expected).abs() < 0.02, "{} {expected}", asked[j]);
    }
    // The controller converts the torque that a drive reports to the torque of the joint before it sends the torque to the host.
    let status = bench.controller.status(Response::NONE);
    let report = bench.controller.nodes.node(2).report.torque;
    assert!((f64::from(status.joints[2].torque) * 1.2 - report).abs() < 1e-6);
}

/// J-04, J-58: a Stop or a Pause also ends a jog. A Jog that was sent before the Stop or Pause has no effect.
#[test]
fn j04_j58_a_stop_or_a_pause_ends_a_jog_and_cancels_those_before_it() {
    for command in [UrgentCommand::Stop, UrgentCommand::Pause] {
        let mut bench = Bench::new();
        bench.force(ControllerState::HoldPos);
        bench.controller.motion.set.hold_for_test();
        let mut frame = [0; 30];
        jtc_wire::floats(&mut frame, jtc_wire::FrameType::Jog, [0.3; JOINTS]).expect("it fits");
        let jog = FrameRef::new_checked(&frame).expect("a good frame");
        let event = LinkEvent::Frame(jog);
        let host = |overtaken| [HostEvent { line: 0, overtaken, plain: false, event }];
        bench.controller.serve_host(&Inputs { host: &host(false), ..Inputs::QUIET });
        assert!(bench.controller.motion.set.jogging());
        let mut position = [0.0; JOINTS];
        let hold = |controller: &mut crate::controller::Controller<_>| {
            if controller.motion.set.jog_ends() {
                controller.begin_braking();
            }
            controller.motion.hold(&Config::avena());
        };
        (0..50).for_each(|_| hold(&mut bench.controller));
        let mut urgent = [jtc_wire::UrgentCommands::NONE; 2];
        urgent[1].push(command);
        bench.controller.serve_host(&Inputs { urgent, host: &host(true), ..Inputs::QUIET });
        let before = bench.controller.motion.set.point.velocity[2];
        for _ in 0..520 {
            hold(&mut bench.controller);
            position = bench.controller.motion.set.point.position;
            // After the Stop or Pause, the joint may become faster by up to 0.1 rad/s, because its acceleration needs
            // some time to change its sign.
            assert!(bench.controller.motion.set.point.velocity[2] <= before + 0.1, "{before}");
        }
        assert!(!bench.controller.motion.set.jogging() && position[2] > 0.0);
    }
}

/// J-06: during a jog, the controller refuses commands that change the torque.
#[test]
fn j58_parameters_and_resets_wait_for_the_end_of_a_jog() {
    let mut bench = Bench::new();
    bench.force(ControllerState::HoldPos);
    bench.controller.motion.set.hold_for_test();
    bench.controller.motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &Config::avena());
    for command in [
        Command::FrictionPolynomialUseDefault,
        Command::FrictionTableUseDefault,
        Command::PidParamUseDefault,
        Command::ArmModelUseDefault,
        Command::ResetCanDevices { nodes: 1 },
        Command::TrajSetExecStatus(jtc_wire::ExecCommand::Execute),
    ] {
        let event =
            HostEvent { line: 0, overtaken: false, plain: false, event: LinkEvent::Noise(Response::NONE) };
        let outcome = bench.controller.carry_out(&event, command);
        assert!(matches!(outcome, SliceOutcome::Refused(DataStatus::NotAllowed)), "{command}");
    }
}
