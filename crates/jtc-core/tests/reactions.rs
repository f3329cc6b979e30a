//! Which error does what (J-21, J-66): the arm gives way or stops where the controller can still act, else its torque goes. The
//! table in docs/safety.md is what these runs show; `UPDATE_DOCS=1` writes it again.
mod rig;

use std::path::Path;

use jtc_core::{Config, ControllerState, TrajectoryState, joint_error};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use rig::{Rig, point, rad};

/// Joint 5 leads from 0 to 0.4 rad and back, at rest at both ends.
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

/// Held, or moving along the path; the torque of joint 4 has room for a position error.
fn bench(moving: bool) -> Rig {
    let mut config = Config::avena();
    config.joints[3].torque_max = 2_000.0;
    let mut rig = Rig::holding_with(config);
    // The load of joints that were just enabled may still be caught (J-43).
    rig.run(1_000);
    if moving {
        rig.move_along(&path(), 500);
    }
    rig
}

/// Somebody pushes joint 4 until its position error is over the limit; not faster than is plausible (J-35).
fn push(rig: &mut Rig, to: f64) {
    const TICKS: u32 = 50;
    rig.apart[3] = true;
    let here = rig.nodes[3].report.position;
    for k in 1..=TICKS {
        rig.nodes[3].report.position = here + (to - here) * f64::from(k) / f64::from(TICKS);
        rig.tick();
    }
}

#[test]
fn j66_a_position_error_lets_the_arm_give_way_and_the_path_can_go_on() {
    let mut rig = bench(true);
    push(&mut rig, 0.097);
    rig.run(2);
    let t = rig.controller.telemetry();
    assert_eq!((t.state, t.trajectory, t.errors), (ControllerState::HoldPos, TrajectoryState::Pause, 0));
    // Held where it is measured, to within the way of its deceleration.
    assert!((t.joints[3].set_position - rig.nodes[3].report.position).abs() < 0.04, "{:?}", t.joints[3]);
    assert!(t.joints[3].torque_i.abs() < 2.0, "the integral is cleared: {:?}", t.joints[3]);
    assert!(rig.last.safety_output, "no error, so none is shown");
    let status = rig.status();
    assert_eq!((status.errors, status.joints[3].internal), (0, 0));
    assert_eq!(status.joints[3].internal_occurred, joint_error::POSITION_ERROR);
    assert_ne!(status.occurred & jtc_core::error::INTERNAL_JOINTS, 0);
    assert_eq!(status.occurred & jtc_core::error::EMERGENCY_OUTPUT, 0);
    rig.run(400);

    // Beside the paused point it does not go on; back there it does, and approaches the path.
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::StartPositionMismatch);
    push(&mut rig, 0.012);
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

#[test]
fn j66_what_gives_way_adds_only_so_much_to_the_model() {
    let mut rig = bench(false);
    push(&mut rig, 0.097);
    let (most, mut used) = (0.3 * 2_000.0, 0.0_f64);
    for k in 1..=20 {
        rig.nodes[3].report.position += 0.004;
        rig.tick();
        let t = rig.controller.telemetry().joints[3];
        assert!((t.torque - t.torque_model).abs() <= most + 1e-9, "{k}: {t:?}");
        used = used.max((t.torque - t.torque_model).abs());
        assert_eq!(rig.state(), ControllerState::HoldPos);
    }
    assert!(used > 0.4 * most, "it still holds against the push: {used} N·m");
    // It fails when the arm is led away again.
    for _ in 0..20 {
        rig.nodes[3].report.position += 0.004;
        rig.tick();
    }
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(rig.status().joints[3].internal, joint_error::POSITION_ERROR);
    assert_eq!(rig.torque, [0.0; 6]);
}

#[test]
fn j66_a_command_of_the_host_makes_it_stand_firm_again() {
    let mut rig = bench(false);
    push(&mut rig, 0.097);
    rig.run(300);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(300);
    assert_eq!(rig.ask(FrameType::TeachingModeDisable, &[]), DataStatus::NoError);
    rig.run(300);
    // Another position error finds it firm: it gives way anew instead of an error.
    let here = rig.nodes[3].report.position;
    push(&mut rig, here + 0.097);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
}

/// What braking excuses is for the arm that cannot follow its path, not for one that is pushed away from where the path stands.
#[test]
fn j33_j66_an_arm_that_is_pushed_where_its_path_stands_gives_way_while_it_still_brakes() {
    let mut rig = bench(true);
    assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
    // It moves all the time, so braking goes on.
    rig.nodes[3].report.velocity = 0.5;
    rig.until(500, |r| r.trajectory() == TrajectoryState::Pause);
    push(&mut rig, 0.097);
    rig.run(2);
    let t = rig.controller.telemetry();
    assert_eq!((t.state, t.trajectory, t.errors), (ControllerState::HoldPos, TrajectoryState::Pause, 0));
    assert!((t.joints[3].set_position - rig.nodes[3].report.position).abs() < 0.04, "{:?}", t.joints[3]);
    assert_eq!(rig.status().joints[3].internal_occurred, joint_error::POSITION_ERROR);
}

/// A joint that is stuck had not followed what was commanded: where the arm is held because of it, and the next answers are missing, it
/// is not predicted to move back.
#[test]
fn j63_j66_a_stuck_joint_is_not_predicted_to_move_when_it_is_held() {
    let mut config = Config::avena();
    config.joints[4].torque_max = 2_000.0;
    let mut rig = Rig::holding_with(config);
    rig.run(1_000);
    rig.move_along(&path(), 100);
    rig.apart[4] = true;
    rig.until(1_500, |rig| rig.trajectory() != TrajectoryState::Execute);
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Pause, 0));
    let stuck = rig.nodes[4].report.position;
    for k in 1..=4 {
        // The answer to the Move of that tick was lost, too.
        rig.drop_answers(4);
        rig.tick();
        let t = rig.controller.telemetry().joints[4];
        assert!((t.position - stuck).abs() < 1e-5, "{k}: {} rad", t.position - stuck);
        assert!(t.velocity.abs() < 1e-3, "{k}: {} rad/s", t.velocity);
    }
}

struct Row {
    error: &'static str,
    cause: fn(&mut Rig),
}

const ROWS: [Row; 9] = [
    Row { error: "safety input (J-22)", cause: |rig| rig.safety_input = false },
    Row { error: "a node reports an error", cause: |rig| rig.nodes[1].fault() },
    Row { error: "a joint is silent (J-14)", cause: |rig| rig.nodes[1].silent = true },
    Row { error: "the controller is bus-off (J-14)", cause: |rig| rig.bus_off = true },
    Row {
        error: "joint bit 3: torque over its limit for more than 10 of 100 ms (J-43)",
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
    Row {
        error: "the same while the arm gives way",
        cause: |rig| {
            push(rig, 0.097);
            push(rig, 0.25);
            push(rig, 0.40);
        },
    },
    Row { error: "gripper silent or reset (J-23)", cause: |rig| rig.nodes[6].silent = true },
];

/// What the controller did, in words.
fn reaction(rig: &Rig) -> String {
    let t = rig.controller.telemetry();
    let torque = if t.joints.iter().all(|j| j.torque == 0.0) { "torque zero" } else { "torque stays" };
    let output = if rig.last.safety_output { "safety output 1" } else { "safety output 0" };
    let what = match (t.state, t.trajectory) {
        (ControllerState::Error, _) => "Error".into(),
        (ControllerState::HoldPos, TrajectoryState::Pause) => "HoldPos, Pause".into(),
        (ControllerState::HoldPos, _) => "HoldPos".into(),
        (state, _) => format!("{state:?}, it goes on"),
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
            rig.run(50);
            reaction(&rig)
        });
        table += &format!("| {} | {held} | {moving} |\n", row.error);
    }
    println!("{table}");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/safety.md");
    let text = std::fs::read_to_string(&path).expect("docs/safety.md is there");
    let mark = |mark: &str| text.find(mark).unwrap_or_else(|| panic!("safety.md has no mark {mark}"));
    let begin = mark("<!-- reactions begin -->\n") + "<!-- reactions begin -->\n".len();
    let end = mark("<!-- reactions end -->");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let new = format!("{}{table}{}", &text[..begin], &text[end..]);
        std::fs::write(&path, new).expect("docs/safety.md can be written");
    } else {
        assert!(
            text[begin..end] == table,
            "docs/safety.md differs from the code: look, then `cargo xtask docs`"
        );
    }
}
