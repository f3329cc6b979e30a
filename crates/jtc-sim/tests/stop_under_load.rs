//! Tests of Pause and Stop while a joint needs nearly its full torque (J-33). The tests measure time, distance and
//! speed until the arm is at rest.
use jtc_core::{Config, ControllerState, TrajectoryState};
use jtc_sim::{ModelError, Support};
use jtc_wire::ExecCommand;
use sim_checks::lowering::{LOADED, Lowering, angle_of, holding_torque, with_payload};

/// If the holding torque is 80 to 97 % of the torque limit, the remaining torque must be sufficient to stop the arm
/// within 0.5 s.
#[test]
fn j33_a_loaded_arm_stands_within_its_time() {
    for (share, speed) in [(0.8, 0.9), (0.9, 0.3), (0.9, 0.2), (0.95, 0.2), (0.95, 0.1), (0.97, 0.1)] {
        for command in [ExecCommand::Pause, ExecCommand::Stop] {
            for (model_error, support) in
                [(ModelError::NONE, Support::Brakes), (ModelError::default(), Support::Stand)]
            {
                let outcome = Lowering { command, model_error, support, ..Lowering::at_share(share, speed) }
                    .run()
                    .expect("it is lowered");
                println!("{share} {speed} {command:?}: {outcome:?}");
                let to = if command == ExecCommand::Pause {
                    TrajectoryState::Pause
                } else {
                    TrajectoryState::Stop
                };
                assert_eq!(
                    (outcome.state, outcome.trajectory, outcome.errors),
                    (ControllerState::HoldPos, to, 0)
                );
                assert!(outcome.commanded_ms <= 500 && outcome.standing_ms <= 520, "{outcome:?}");
                assert!(outcome.peak <= 1.03 * speed && outcome.error < 5e-3, "{outcome:?}");
                assert!(outcome.way <= 0.35 * speed, "{outcome:?}");
            }
        }
    }
}

/// The arm lowers a payload of 3.3 kg that the arm model contains. The controller must stop the arm in time at a pose
/// whose holding torque is 95 % of the torque limit.
#[test]
fn j33_a_known_payload_is_stopped_near_the_torque_limit() {
    let model = with_payload(3.3);
    let limit = Config::avena().joints[LOADED].torque_max;
    let shoulder = angle_of(&model, 0.95 * limit);
    println!("shoulder at {shoulder:.3} rad: {:.1} of {limit} N·m", holding_torque(&model, shoulder));
    for speed in [0.1, 0.2] {
        let outcome = Lowering::new(model, shoulder, speed).run().expect("it is lowered");
        println!("{speed}: {outcome:?}");
        assert_eq!(
            (outcome.state, outcome.trajectory, outcome.errors),
            (ControllerState::HoldPos, TrajectoryState::Stop, 0)
        );
        assert!(outcome.commanded_ms <= 500 && outcome.standing_ms <= 520, "{outcome:?}");
        assert!(outcome.peak <= 1.03 * speed && outcome.error < 5e-3, "{outcome:?}");
    }
}

/// If the torque margin is not sufficient, the controller brakes with the full torque limit. A joint that still moves
/// after the time for stopping must continue downwards at a decreasing speed.
#[test]
fn j33_the_full_limit_brakes_where_the_time_cannot_be_kept() {
    for (share, speed) in [(0.97, 0.4), (0.99, 0.2), (0.99, 0.4), (1.02, 0.2), (1.02, 0.4)] {
        let outcome = Lowering::at_share(share, speed).run().expect("it is lowered");
        println!("{share} {speed}: {outcome:?}");
        // The commanded positions must follow the motion that the arm can achieve. The speed may increase by more
        // than 3 %, up to 0.6 rad/s, only if the holding torque is 99 % of the limit or more.
        let peak = if share < 0.99 { 1.03 * speed } else { 0.6 };
        assert!(outcome.error < 5e-3 && outcome.peak <= peak, "{outcome:?}");
        // Friction also brakes the arm. The distance until standstill must therefore be short.
        assert!(outcome.way <= if share < 0.99 { 0.7 * speed } else { 1.0 }, "{outcome:?}");
        // At most one second after the command, the trajectory state must leave Execute, and the controller must hold
        // the arm (HoldPos).
        assert!(outcome.commanded_ms <= 1_002 && outcome.state == ControllerState::HoldPos, "{outcome:?}");
        assert!(outcome.standing_ms <= if share < 0.99 { 1_100 } else { 6_000 }, "{outcome:?}");
    }
}
