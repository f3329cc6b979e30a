//! Compares the simulated controller with a second board that receives equal inputs. Tests the plant with torques
//! instead of a bus.
use jtc_core::{Config, ControllerState, Parameters};
use jtc_sim::{Board, Fault, FaultKind, FaultPlan, Operator, Pins, Plant, SimConfig, Support, Trigger};

/// A second board that receives the inputs of the simulated board must produce bit-identical outputs. The test
/// includes missed ticks and a reset by the watchdog.
#[test]
fn a_board_with_the_inputs_of_the_worlds_has_its_outputs() {
    let overrun =
        |at, ms| Fault { kind: FaultKind::TickOverrun, trigger: Trigger::At(at), duration_ms: Some(ms) };
    let faults = FaultPlan { faults: vec![overrun(1_000, 3), overrun(8_000, 12)], ..FaultPlan::default() };
    let config = SimConfig { faults, ..SimConfig::default() };
    let mut board =
        Board::new(config.controller.clone(), None, config.inter_byte_timeout_us, config.watchdog_ms);
    let mut operator = Operator::new(config);
    operator.world.watch_board();
    operator.world.host_write(&jtc_sim::host::use_defaults());
    let mut held = 0;
    for _ in 0..9_000 {
        let now = operator.world.now_us();
        operator.step();
        let exchange = operator.world.exchange().expect("it is watched");
        board.receive(now, &exchange.host);
        if !exchange.ticked {
            board.miss();
            continue;
        }
        let outputs = board.tick(&Pins {
            bus: &exchange.bus,
            bus_state: exchange.bus_state,
            safety_input: exchange.safety_input,
            status_free: exchange.status_free,
        });
        assert_eq!(outputs.bus, exchange.sent, "{now} µs");
        assert_eq!(outputs.safety_output, exchange.safety_output, "{now} µs");
        assert_eq!(board.bytes_to_host(&outputs), exchange.to_host, "{now} µs");
        assert_eq!(
            format!("{:?}", board.telemetry()),
            format!("{:?}", operator.world.telemetry()),
            "{now} µs"
        );
        held += u32::from(board.telemetry().state == ControllerState::HoldPos);
    }
    assert!(held > 1_000, "it held for {held} ms only");
    assert_eq!(board.watchdog_resets, 1);
}

/// With gravity compensation the arm must stay at its position, and with zero torque it must fall. Torques above the
/// limits of the drives are clipped.
#[test]
fn a_plant_without_its_bus_moves_under_the_torques_that_it_is_given() {
    let start = [0.0, 0.6, -1.0, 0.3, 0.4, 0.0];
    let config = SimConfig { start, model_error: jtc_sim::ModelError::NONE, ..SimConfig::default() };
    let model = Parameters::avena().model;
    let dynamics = jtc_dynamics::Dynamics::new(&model, Config::avena().gravity);
    let mut held = Plant::new(&config);
    let mut falls = Plant::new(&SimConfig { support: Support::Brakes, ..config.clone() });
    let mut pushed = Plant::new(&config);
    for _ in 0..300 {
        held.step_free(&dynamics.gravity_torque(&held.truth().q));
        falls.step_free(&[0.0; 6]);
        pushed.step_free(&[f64::NAN, 1e9, 0.0, 0.0, -1e9, 0.0]);
    }
    let far = |plant: &Plant| {
        let moved = plant.truth().q.iter().zip(&start).map(|(a, b)| (a - b).abs());
        moved.fold(0.0, f64::max)
    };
    assert!(far(&held) < 1e-3, "{}", far(&held));
    assert!(far(&falls) > 0.05, "{}", far(&falls));
    assert_eq!(pushed.truth().torque, [0.0, 364.0, 0.0, 0.0, -79.0, 0.0]);
    assert!(pushed.truth().q.iter().all(|q| q.is_finite()));
}
