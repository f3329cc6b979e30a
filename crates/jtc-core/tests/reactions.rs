//! Tests of the reaction to each error or finding (J-21, J-66, J-68, J-69). The arm yields or stops if the controller can still act. In all
//! other cases, the controller switches the torque of the arm off. The table in docs/safety.md shows the results of these tests.
//! `UPDATE_DOCS=1` updates this table.
use crate::rig;

use jtc_core::{Config, ControllerState, TrajectoryState, error, joint_error};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, StopKind};
use rig::{Rig, floats, point, rad};

/// Returns a path in which joint 5 moves from 0 to 0.4 rad and back, at rest at both ends.
fn path() -> Vec<RawPoint> {
    let n = 401;
    (0..n)
        .map(|i| {
            let u = f64::from(i) / f64::from(n - 1);
            let (w, t) = (std::f64::consts::TAU, 4.0);
            let (sin, cos) = ((w * u).sin(), (w * u).cos());
            point(4, 0.2 * (1.0 - cos), 0.2 * w / t * sin, 0.2 * w * w / (t * t) * cos)
        })
        .collect()
}

/// Returns a rig whose arm is held, or moves along the path. The torque limit of joint 4 is so high that the torque
/// of a position error does not reach it.
fn bench(moving: bool) -> Rig {
    bench_with(Config::avena(), moving)
}

fn bench_with(mut config: Config, moving: bool) -> Rig {
    config.joints[3].torque_max = 2_000.0;
    let mut rig = Rig::holding_with(config);
    // In the first second after enabling, the controller may still be catching the load of the joints (J-43).
    rig.run(1_000);
    if moving {
        rig.move_along(&path(), 500);
    }
    rig
}

/// Pushes joint 4 until its position error exceeds the limit, but not faster than is plausible according to J-35.
fn push(rig: &mut Rig, to: f64) {
    const TICKS: u32 = 50;
    rig.apart[3] = true;
    let here = rig.nodes[3].report.position;
    for k in 1..=TICKS {
        rig.nodes[3].report.position = here + (to - here) * f64::from(k) / f64::from(TICKS);
        rig.tick();
    }
}

/// Simulates an arm at rest at its present position until the held stop can be cleared, and clears this stop.
fn settle(rig: &mut Rig) {
    rig.run(600);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j66_j69_a_position_error_is_a_held_stop_and_the_path_can_go_on() {
    let mut rig = bench(true);
    push(&mut rig, 0.097);
    rig.run(2);
    // While joint 4 yields, the host cannot clear the held stop, and the other joints stop on the path.
    assert_eq!(rig.clear(true, 0), DataStatus::NotAllowed);
    rig.run(400);
    let t = rig.controller.telemetry();
    assert_eq!((t.state, t.trajectory), (ControllerState::HoldPos, TrajectoryState::Pause));
    assert!((t.joints[3].set_position - rig.nodes[3].report.position).abs() < 0.02, "{:?}", t.joints[3]);
    assert!(rig.last.safety_output, "it is held");
    let status = rig.status();
    assert_eq!(
        (status.errors, status.joints[3].internal),
        (error::INTERNAL_JOINTS, joint_error::POSITION_ERROR)
    );
    assert_eq!(status.joints[3].internal_occurred, joint_error::POSITION_ERROR);
    assert_eq!(status.occurred & error::EMERGENCY_OUTPUT, 0);

    // Until the host has cleared the stop, the controller must refuse every motion.
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    assert_eq!(rig.ask(FrameType::Jog, &floats([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])), DataStatus::NotAllowed);
    settle(&mut rig);
    // If the arm is not at the paused point, the controller must refuse to continue the path. If the arm is near this
    // point again, the path continues after an approach.
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::StartPositionMismatch);
    push(&mut rig, 0.012);
    settle(&mut rig);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    let mut last = rig.nodes[3].report.position;
    rig.apart[3] = false;
    while rig.trajectory() == TrajectoryState::Execute {
        rig.tick();
        let set = rig.controller.telemetry().joints[3].set_position;
        assert!((set - last).abs() < 3e-4, "a step from {last} to {set}");
        last = set;
    }
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Finish, 0));
    assert_eq!(rig.controller.telemetry().joints[4].set_position, rad(path()[400].position[4]));
}

/// When a joint begins to yield, its feedback torque falls within 10 ms to at most a share (0.3) of the torque limit.
/// Afterwards the torque stays within this share at any position of the joint, and has no step.
#[test]
fn j68_a_joint_that_yields_adds_only_a_share_to_the_model() {
    let mut rig = bench(false);
    push(&mut rig, 0.097);
    rig.until(50, |rig| rig.errors() != 0);
    rig.run(11);
    let most = 0.3 * 2_000.0;
    let mut last = rig.controller.telemetry().joints[3].torque;
    for k in 0..2_000 {
        rig.nodes[3].report.position += 0.0002;
        rig.nodes[3].report.velocity = 0.2;
        rig.tick();
        let t = rig.controller.telemetry().joints[3];
        // The torque of the joint also contains the load that the integral has learned.
        assert!((t.torque - t.torque_model - t.torque_i).abs() <= most + 1.0, "{k}: {t:?}");
        assert!((t.torque - last).abs() < 0.1 * most, "{k}: from {last} to {}", t.torque);
        last = t.torque;
        assert_eq!(rig.state(), ControllerState::HoldPos);
    }
    // The spring of a yielding joint is as stiff as is stable with the inertia of the joint, so the joint still
    // resists the push.
    assert!(last < -10.0, "it still holds against the push: {last} N·m");
}

/// When a joint has calmed down after a push, the controller must hold it at its present position, without a torque
/// step. After the third push, the joint yields until the host clears the stop.
#[test]
fn j68_a_joint_is_held_again_when_it_is_calm_and_the_third_time_the_host_decides() {
    let mut rig = bench(false);
    for time in 1..=3 {
        let here = rig.nodes[3].report.position;
        push(&mut rig, here + 0.2);
        rig.nodes[3].report.velocity = 0.0;
        let mut last = rig.controller.telemetry().joints[3].torque;
        for _ in 0..1_000 {
            rig.tick();
            let torque = rig.controller.telemetry().joints[3].torque;
            assert!((torque - last).abs() < 250.0, "a step from {last} to {torque}");
            last = torque;
        }
        // A yielding joint has a spring that pulls it back with more than 10 N·m. A joint that is held at its present
        // position has no such torque.
        let yields = rig.controller.telemetry().joints[3].torque < -10.0;
        assert_eq!(yields, time == 3, "time {time}: {} N·m", rig.controller.telemetry().joints[3].torque);
    }
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    rig.run(400);
    let torque = rig.controller.telemetry().joints[3].torque;
    assert!(torque > -5.0 && rig.errors() == 0, "{torque} N·m");
}

/// Tests the commands that the controller accepts in a held stop, and the events that end it.
#[test]
fn j69_a_latched_stop_outlasts_teaching_and_not_a_release() {
    for latches in [true, false] {
        let config = Config { protective_stop_latches: latches, ..Config::avena() };
        let mut rig = bench_with(config, false);
        let shown = if latches { error::INTERNAL_JOINTS } else { 0 };
        push(&mut rig, 0.097);
        rig.run(700);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, shown));
        let jog = floats([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let refused = if latches { DataStatus::NotAllowed } else { DataStatus::NoError };
        assert_eq!(rig.ask(FrameType::Jog, &jog), refused, "{latches}");
        rig.run(500);
        for (frame, state) in [
            (FrameType::TeachingModeEnable, ControllerState::Teaching),
            (FrameType::TeachingModeDisable, ControllerState::HoldPos),
        ] {
            assert_eq!(rig.ask(frame, &[]), DataStatus::NoError);
            rig.run(500);
            assert_eq!((rig.state(), rig.errors()), (state, shown), "{frame:?}");
        }
        assert_eq!(rig.exec(ExecCommand::Stop), DataStatus::NotAllowed, "there is nothing to stop");
        rig.press_stop(5);
        assert_eq!((rig.state(), rig.errors() & error::INTERNAL_JOINTS), (ControllerState::Error, 0));
    }
}

/// The cause of a held stop contains the measured value, with its sign, and the limit of the joint.
#[test]
fn j69_a_cause_has_the_value_that_was_found_and_its_limit() {
    let config = Config::avena();
    let mut pulled = bench(false);
    push(&mut pulled, 0.097);
    pulled.run(20);
    let cause = pulled.controller.reactions().stop.expect("a held stop").0;
    assert_eq!((cause.kind, cause.joint), (StopKind::PositionError, 4));
    assert_eq!(cause.limit, config.joints[3].position_error_max as f32);
    // The joint moves by 2 mrad in each millisecond, so the value exceeds the limit only slightly when the error is
    // detected.
    assert!((cause.limit..cause.limit + 0.01).contains(&-cause.value), "{cause:?}");

    let mut pushed = bench(false);
    (ROWS[4].cause)(&mut pushed);
    let cause = pushed.controller.reactions().stop.expect("a held stop").0;
    assert_eq!((cause.kind, cause.joint), (StopKind::Push, 6));
    assert_eq!(cause.limit, (config.yield_torque_share * config.joints[5].torque_max) as f32);
    // The value in the cause is the feedback torque against the push, before the limit is applied.
    assert!((cause.limit..10.0 * cause.limit).contains(&-cause.value), "{cause:?}");
}

/// A client clears a held stop, but does not know that a jog key of another client is still pressed. This key must
/// not move the arm.
#[test]
fn j58_j69_a_key_that_is_held_down_through_a_held_stop_moves_nothing_when_it_is_cleared() {
    let mut rig = bench(false);
    let jog = floats([0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
    push(&mut rig, 0.097);
    let held = |rig: &mut Rig, ms: usize| {
        for _ in 0..ms / 50 {
            assert_eq!(rig.ask(FrameType::Jog, &jog), DataStatus::NotAllowed);
            rig.run(49);
        }
    };
    held(&mut rig, 800);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    held(&mut rig, 1_000);
    // The operator releases the jog key and presses it again.
    rig.run(210);
    assert_eq!(rig.ask(FrameType::Jog, &jog), DataStatus::NoError);
}

/// While the arm brakes, it need not follow its path exactly. If path time is at rest and a person pushes the arm
/// away from this point of the path, the controller must nevertheless detect the push.
#[test]
fn j33_j66_an_arm_that_is_pushed_where_its_path_stands_yields_while_it_still_brakes() {
    let mut rig = bench(true);
    assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
    // The simulated joint moves all the time, so the braking continues.
    rig.nodes[3].report.velocity = 0.5;
    rig.until(500, |r| r.trajectory() == TrajectoryState::Pause);
    push(&mut rig, 0.097);
    rig.run(20);
    let t = rig.controller.telemetry();
    assert_eq!((t.state, t.trajectory), (ControllerState::HoldPos, TrajectoryState::Pause));
    assert!((t.joints[3].set_position - rig.nodes[3].report.position).abs() < 0.04, "{:?}", t.joints[3]);
    assert_eq!(rig.status().joints[3].internal_occurred, joint_error::POSITION_ERROR);
}

/// A joint is stuck and does not follow its command, so the controller holds the arm. If the next answers of the
/// joint are missing, the predicted position must stay at the true position of the joint.
#[test]
fn j63_j66_a_stuck_joint_is_not_predicted_to_move_when_it_is_held() {
    let mut config = Config::avena();
    config.joints[4].torque_max = 2_000.0;
    let mut rig = Rig::holding_with(config);
    rig.run(1_000);
    rig.move_along(&path(), 100);
    rig.apart[4] = true;
    rig.until(1_500, |rig| rig.errors() != 0);
    let stuck = rig.nodes[4].report.position;
    for k in 1..=4 {
        // The answer to the Move of this tick was also lost.
        rig.drop_answers(4);
        rig.tick();
        let t = rig.controller.telemetry().joints[4];
        assert!((t.position - stuck).abs() < 1e-5, "{k}: {} rad", t.position - stuck);
        assert!(t.velocity.abs() < 1e-3, "{k}: {} rad/s", t.velocity);
    }
    rig.until(600, |rig| rig.trajectory() == TrajectoryState::Pause);
}

struct Row {
    error: &'static str,
    cause: fn(&mut Rig),
}

const ROWS: [Row; 8] = [
    Row { error: "safety input (J-22)", cause: |rig| rig.safety_input = false },
    Row { error: "a node reports an error", cause: |rig| rig.nodes[1].fault() },
    Row { error: "a joint is silent (J-14)", cause: |rig| rig.nodes[1].silent = true },
    Row { error: "the controller is bus-off (J-14)", cause: |rig| rig.bus_off = true },
    Row {
        error: "joint bit 3: a joint is pushed, or its torque is over its limit for more than 10 of 100 ms (J-43)",
        cause: |rig| {
            rig.apart[5] = true;
            let here = rig.nodes[5].report.position;
            for k in 0..30 {
                rig.nodes[5].report.position = here + 0.003 * f64::from(k.min(5));
                rig.tick();
            }
        },
    },
    Row {
        error: "joint bit 1: measured speed over 1.2 times the limit for 5 ms (J-35)",
        cause: |rig| {
            for _ in 0..6 {
                rig.nodes[5].report.velocity = 1.9;
                rig.tick();
            }
        },
    },
    Row { error: "joint bit 4: position error over its limit (J-43)", cause: |rig| push(rig, 0.097) },
    Row { error: "gripper silent or reset (J-23)", cause: |rig| rig.nodes[6].silent = true },
];

/// Returns the reaction of the controller, as text for docs/safety.md.
fn reaction(rig: &Rig) -> String {
    let t = rig.controller.telemetry();
    let torque = if t.joints.iter().all(|j| j.torque == 0.0) { "torque zero" } else { "torque stays" };
    let output = if rig.last.safety_output { "safety output 1" } else { "safety output 0" };
    let what = match (t.state, t.trajectory) {
        (ControllerState::Error, _) => "Error".into(),
        (ControllerState::HoldPos, TrajectoryState::Pause) if t.errors != 0 => "held stop, Pause".into(),
        (ControllerState::HoldPos, _) if t.errors != 0 => "held stop".into(),
        (ControllerState::HoldPos, _) => "HoldPos".into(),
        (state, _) => format!("{state:?}, the motion continues"),
    };
    format!("{what}; {torque}, {output}")
}

#[test]
fn j21_j66_which_error_does_what_is_what_the_table_says() {
    let mut table = String::from("| error | while the arm is held | while it moves |\n|---|---|---|\n");
    for row in &ROWS {
        let [held, moving] = [false, true].map(|moving| {
            let mut rig = bench(moving);
            (row.cause)(&mut rig);
            rig.run(400);
            reaction(&rig)
        });
        table += &format!("| {} | {held} | {moving} |\n", row.error);
    }
    println!("{table}");
    test_kit::page::part("safety.md", "reactions", &table);
}
