//! Tests in the form of short stories of an operator and an arm.
use jtc_bus::Joint;
use jtc_core::{ControllerState, TrajectoryState};
use jtc_sim::{BusTap, DriveConfig, Fault, FaultKind, Operator, SimConfig, Support, Trigger, host};
use jtc_wire::{DataStatus, ExecCommand, FrameType};
use sim_checks::Invariants;

const FROM: [f64; 6] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];
const TO: [f64; 6] = [1.1, 0.4, -0.3, 1.2, 0.8, -0.9];

fn held() -> Operator {
    let mut operator = Operator::new(SimConfig { start: FROM, baud: None, ..SimConfig::default() });
    operator.bring_up().unwrap();
    operator
}

fn loaded() -> Operator {
    let mut operator = held();
    operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
    operator
}

#[test]
fn j33_pause_and_resume_stay_on_the_path() {
    let mut operator = loaded();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    operator.run(1500);
    operator.ask(&host::exec(ExecCommand::Pause)).unwrap();
    operator.wait("standstill", 1000, |w| w.telemetry().trajectory == TrajectoryState::Pause).unwrap();
    let point = operator.world.telemetry().point;
    assert!(point > 1000, "{point}");
    operator.run(500);
    let still = operator.world.truth().qd;
    assert!(still.iter().all(|v| v.abs() < 5e-3), "{still:?}");
    assert_eq!(operator.world.telemetry().point, point);
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let mut last = point;
    while operator.world.telemetry().trajectory == TrajectoryState::Execute {
        operator.step();
        let t = operator.world.telemetry();
        assert!(t.point >= last && t.errors == 0, "{t:?}");
        assert!(t.joints.iter().all(|j| j.position_error().abs() < 5e-3), "{t:?}");
        last = t.point;
    }
    assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Finish);
}

#[test]
fn j34_execute_away_from_the_start_is_refused_and_nothing_moves() {
    let mut operator = held();
    operator.upload(&host::there_and_back(&TO, &FROM, 3.0, 1, 10), 10).unwrap();
    // The controller must answer with IncorrectValue, because existing hosts do not know data statuses above 6
    // (J-51).
    let response = operator.response(&host::exec(ExecCommand::Execute)).unwrap();
    assert_eq!(response.data, DataStatus::IncorrectValue);
    operator.ask(&jtc_wire::fixed::GET_INFO).unwrap();
    operator.upload(&host::there_and_back(&TO, &FROM, 3.0, 1, 10), 10).unwrap();
    let response = operator.response(&host::exec(ExecCommand::Execute)).unwrap();
    assert_eq!(response.data, DataStatus::StartPositionMismatch);
    let before = operator.world.truth().q;
    operator.run(500);
    let moved = operator.world.truth().q.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 1e-3, "{moved}");
}

#[test]
fn j24_after_a_node_error_the_trajectory_is_not_resumed() {
    let mut operator = loaded();
    let silent = FaultKind::NodeSilent { node: 3 };
    operator.world.inject(Fault { kind: silent, trigger: Trigger::AtPoint(2000), duration_ms: Some(100) });
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    operator.wait("the error", 4000, |w| w.telemetry().state == ControllerState::Error).unwrap();
    operator.run(3000);
    assert_eq!(operator.state(), ControllerState::Error, "errors latch");
    operator.recover().unwrap();
    let held = operator.world.truth().q;
    operator.run(3000);
    assert_eq!(
        (operator.state(), operator.world.telemetry().trajectory),
        (ControllerState::HoldPos, TrajectoryState::Null)
    );
    let moved = operator.world.truth().q.iter().zip(&held).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 2e-3, "{moved}");
}

#[test]
fn j12_j21_a_stopped_tick_resets_the_controller_and_leaves_an_internal_error_latched() {
    let mut operator = loaded();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let at = Trigger::At(operator.world.now_us() / 1000 + 1000);
    operator.world.inject(Fault { kind: FaultKind::TickOverrun, trigger: at, duration_ms: Some(40) });
    operator.run(1500);
    assert!(operator.world.statistics().watchdog_resets >= 1);
    let internal = |operator: &Operator| operator.world.telemetry().errors & jtc_core::error::INTERNAL != 0;
    assert!(
        operator.state() == ControllerState::Error && internal(&operator),
        "{:?}",
        operator.world.telemetry()
    );
    assert!(!operator.world.safety_output(), "J-22: 0 while the internal error is latched");
    assert_eq!(operator.world.truth().torque, [0.0; 6]);
    // The error is latched, so new parameters alone do not enable the arm again.
    operator.world.host_write(&host::use_defaults());
    operator.run(1500);
    assert!(operator.state() == ControllerState::Error && internal(&operator));
    operator.recover().unwrap();
    assert!(operator.world.safety_output());
}

#[test]
fn j25_taught_by_hand_the_arm_floats() {
    let mut operator = held();
    operator.teach().unwrap();
    let before = operator.world.truth().q;
    operator.run(1000);
    let t = operator.world.telemetry();
    assert_eq!((t.state, t.errors), (ControllerState::Teaching, 0));
    // The model has wrong masses, so the arm drifts slowly, but it must not fall.
    let moved = operator.world.truth().q.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 0.2, "{moved}");
    operator.ask(&host::frame(FrameType::TeachingModeDisable, &[])).unwrap();
    operator.wait("HoldPos", 100, |w| w.telemetry().state == ControllerState::HoldPos).unwrap();
}

#[test]
fn gripper_holds_a_part() {
    let mut operator = held();
    operator.ask(&host::frame(FrameType::GripperControl, &[1, 0, 0, 0])).unwrap();
    operator.run(1000);
    let gripper = operator.listener.last.and_then(|s| s.gripper).unwrap();
    assert_eq!((gripper.pump, gripper.pressure1, gripper.pressure2), (1, 1, 1));
    operator.world.set_part_present(false);
    operator.run(1000);
    let gripper = operator.listener.last.and_then(|s| s.gripper).unwrap();
    assert_eq!((gripper.pump, gripper.pressure1), (1, 0), "the part fell off");
}

#[test]
fn without_brakes_an_error_lets_the_arm_fall() {
    let config = SimConfig { start: FROM, baud: None, support: Support::Stand, ..SimConfig::default() };
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    let at = Trigger::At(operator.world.now_us() / 1000 + 10);
    operator.world.inject(Fault { kind: FaultKind::SafetyInput, trigger: at, duration_ms: Some(5) });
    operator.run(3000);
    assert_eq!(operator.state(), ControllerState::Error);
    assert!((operator.world.truth().q[1] - FROM[1]).abs() > 0.3, "{:?}", operator.world.truth().q);
}

#[test]
fn others_on_the_bus_see_every_frame_and_take_part() {
    let hub = can_link::VirtualHub::new();
    let mut other = hub.join();
    let mut tap = BusTap::new(hub.join());
    let mut operator = held();
    let mut ids = std::collections::BTreeSet::new();
    for _ in 0..50 {
        operator.step();
        tap.exchange(&mut operator.world).unwrap();
        while let Some(frame) = can_link::CanBus::receive(&mut other, std::time::Duration::ZERO).unwrap() {
            ids.insert(frame.id().value());
        }
    }
    assert_eq!(ids.into_iter().collect::<Vec<_>>(), [0x000, 0x200, 0x201, 0x202, 0x203, 0x204, 0x205, 0x206]);
    // Another node on the bus sends a reset, so the drive reboots. The controller must detect the reboot.
    let reset = can_link::CanFrame::fd(can_link::Id::standard(0x1A2).unwrap(), &[]).unwrap();
    can_link::CanBus::send(&mut other, &reset).unwrap();
    for _ in 0..20 {
        tap.exchange(&mut operator.world).unwrap();
        operator.step();
    }
    assert_eq!((tap.taken, operator.state()), (1, ControllerState::Error));
}

#[test]
fn j07_a_friction_table_and_what_follows_it_at_once_are_taken_without_losing_a_tick() {
    for baud in [None, Some(3_000_000), Some(115_200)] {
        let config = SimConfig { start: FROM, baud, ..SimConfig::default() };
        let mut operator = Operator::new(config);
        operator.bring_up().unwrap();
        operator.listener.responses.clear();
        // The friction table is similar to a measured table: the torques increase with speed.
        let one = |_| {
            let axis = (0..20).map(|i| -1.9 + 0.2 * i as f32).chain((0..20).map(|i| 5.0 + 4.0 * i as f32));
            let torque = (0..400).map(|i| 3.0 * (-1.9 + 0.2 * (i / 20) as f32));
            axis.chain(torque).collect::<Vec<f32>>()
        };
        let body: Vec<u8> = (0..6).flat_map(one).flat_map(f32::to_be_bytes).collect();
        let mut bytes = host::frame(FrameType::FrictionTable, &body);
        bytes.extend(host::frame(FrameType::ClearOccurredErrors, &[]));
        bytes.extend(host::frame(FrameType::PidParamUseDefault, &[]));
        operator.world.host_write(&bytes);
        let tick = operator.world.telemetry().tick;
        operator.run(1500);
        assert_eq!(operator.world.telemetry().tick, tick + 1500);
        let responses: Vec<_> = operator.listener.responses.iter().map(|r| (r.frame_type, r.data)).collect();
        let expected =
            [(0x05, DataStatus::NoError), (0x02, DataStatus::NoError), (0x08, DataStatus::NoError)];
        assert_eq!(responses, expected, "at {baud:?} Bd");
        assert_eq!(operator.state(), ControllerState::HoldPos);
    }
}

#[test]
fn j11_j12_older_drives_run_with_their_scale_and_one_broadcast_a_tick() {
    let mut config = SimConfig { start: FROM, baud: None, ..SimConfig::default() };
    let older = DriveConfig::older();
    config.controller.velocity_full_scale = older.velocity_full_scale;
    config.drives = [older; 6];
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
    operator.execute(10_000).unwrap();
    // Another node sends a broadcast directly after a broadcast of the controller. From then on, an older drive
    // answers each request only when the next request arrives.
    let ask = jtc_bus::Request::ChangeFsm { target: [jtc_bus::Target::NoChange; 7] }.emit();
    operator.world.put_bus_frame(ask);
    operator.run(20);
    let answers = operator.world.bus_frames().iter().filter(|f| f.frame.id & 0x200 != 0).count();
    assert_eq!(answers, 7, "they answer what was asked a millisecond ago");
    assert_eq!(operator.state(), ControllerState::HoldPos);
}

#[test]
fn j12_the_first_frame_after_an_error_is_zero_torque_also_during_bring_up() {
    for at in 245..285 {
        let mut world = jtc_sim::World::new(SimConfig::default());
        world.host_write(&host::use_defaults());
        let kind = FaultKind::MotorFault { joint: Joint::ALL[4], bits: 4 };
        world.inject(Fault { kind, trigger: Trigger::At(at), duration_ms: Some(50) });
        let mut invariants = Invariants::default();
        for _ in 0..400 {
            world.step();
            invariants.check(&world).unwrap_or_else(|violation| panic!("fault at {at} ms: {violation}"));
        }
    }
}

/// The board skips every second tick, as if each tick needed too much time. The controller must report an internal
/// error.
#[test]
fn j12_ticks_that_go_on_missing_are_an_internal_error() {
    for missing in [9, 10] {
        let mut operator = held();
        let now = operator.world.now_us() / 1000;
        for tick in 0..missing {
            let trigger = Trigger::At(now + 5 + 2 * tick);
            operator.world.inject(Fault { kind: FaultKind::TickOverrun, trigger, duration_ms: Some(1) });
        }
        operator.run(40);
        let t = *operator.world.telemetry();
        if missing < 10 {
            assert_eq!((t.state, t.errors), (ControllerState::HoldPos, 0));
        } else {
            use jtc_core::error;
            assert_eq!(
                (t.state, t.errors),
                (ControllerState::Error, error::INTERNAL | error::EMERGENCY_OUTPUT)
            );
        }
    }
}

/// Sends a frame in two parts, `ticks` apart in virtual time, while the host is silent for `silence_us` µs of real
/// time. Returns the numbers of valid and invalid frames that the controller found.
fn in_two_pieces(ticks: u64, silence_us: Option<u64>) -> (u64, u64) {
    let mut operator = held();
    let before = operator.world.statistics();
    let frame = host::exec(ExecCommand::Stop);
    operator.world.host_write(&frame[..5]);
    operator.run(1);
    operator.world.limit_host_silence(silence_us);
    let start = operator.world.now_us();
    operator.run(ticks);
    assert_eq!(operator.world.now_us() - start, ticks * 1000, "the arm's time goes on");
    operator.world.host_write(&frame[5..]);
    operator.run(1);
    operator.world.limit_host_silence(None);
    operator.run(20);
    let after = operator.world.statistics();
    (after.good_frames - before.good_frames, (after.bad_frames - before.bad_frames).min(1))
}

#[test]
fn j03_a_gap_within_a_frame_is_as_long_as_it_was_for_the_host() {
    assert_eq!(in_two_pieces(3, None), (1, 0));
    assert_eq!(in_two_pieces(8, None), (0, 1));
    assert_eq!(in_two_pieces(200, Some(4_000)), (1, 0), "virtual time was faster than the host");
    assert_eq!(in_two_pieces(200, Some(6_000)), (0, 1));
    assert_eq!(in_two_pieces(3, Some(6_000)), (1, 0), "virtual time was slower");
}
