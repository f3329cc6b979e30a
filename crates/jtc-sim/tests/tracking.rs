//! How well the arm follows when it is not quite the arm that the controller believes in.
use jtc_core::{ControllerState, TrajectoryState};
use jtc_sim::{ModelError, Operator, SimConfig, host};
use jtc_wire::{ExecCommand, RawPoint};

const FROM: [f64; 6] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];
const TO: [f64; 6] = [1.1, 0.4, -0.3, 1.2, 0.8, -0.9];

fn held(seed: u64) -> Operator {
    let config = SimConfig {
        start: FROM,
        seed,
        baud: None,
        model_error: ModelError::default(),
        ..SimConfig::default()
    };
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator
}

/// RMS of commanded minus measured position over a run, rad.
fn run(operator: &mut Operator) -> [f64; 6] {
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let (mut sum, mut count) = ([0.0; 6], 0.0);
    loop {
        operator.step();
        let telemetry = operator.world.telemetry();
        assert!(
            matches!(telemetry.state, ControllerState::Operate | ControllerState::HoldPos),
            "{telemetry:?}"
        );
        if telemetry.trajectory != TrajectoryState::Execute {
            break;
        }
        count += 1.0;
        for (sum, joint) in sum.iter_mut().zip(&telemetry.joints) {
            *sum += joint.position_error().powi(2);
        }
    }
    sum.map(|s| (s / count).sqrt())
}

#[test]
fn j40_tracking_within_two_milliradians_rms_with_wrong_masses_and_friction() {
    for seed in [1, 2, 3] {
        let mut operator = held(seed);
        operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
        let rms = run(&mut operator);
        println!("seed {seed}: {:?} mrad RMS", rms.map(|x| (x * 1e6).round() / 1e3));
        assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Finish);
        assert!(rms.iter().all(|&x| x <= 2e-3), "seed {seed}: {rms:?}");
    }
}

#[test]
fn j32_the_recorded_trajectory_is_followed_within_two_milliradians_rms() {
    let Some(points) = test_kit::existing::points("TrajectoryInt.csv") else { return };
    let raw =
        |[position, velocity, acceleration]: [[i16; 6]; 3]| RawPoint { position, velocity, acceleration };
    let points: Vec<RawPoint> = points.into_iter().map(raw).collect();
    for seed in [1, 2, 3] {
        let config = SimConfig { start: points[0].position_rad(), seed, baud: None, ..SimConfig::default() };
        let mut operator = Operator::new(config);
        operator.bring_up().unwrap();
        operator.upload(&points, 10).unwrap();
        let rms = run(&mut operator);
        let telemetry = operator.world.telemetry();
        println!("seed {seed}: {:?} mrad RMS", rms.map(|x| (x * 1e6).round() / 1e3));
        assert_eq!((telemetry.trajectory, telemetry.errors), (TrajectoryState::Finish, 0));
        assert!(rms.iter().all(|&x| x <= 2e-3), "seed {seed}: {rms:?}");
    }
}
