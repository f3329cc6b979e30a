//! Tests how accurately an arm follows its path if it differs slightly from the controller's model.
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState};
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

/// Returns the RMS of commanded minus measured position during a motion, rad.
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

/// Returns the RMS of commanded minus true position, rad. The true position is taken at the time at which the torque
/// of the tick takes effect.
fn true_error(config: SimConfig) -> [f64; 6] {
    let mut operator = Operator::new(SimConfig { start: FROM, baud: None, ..config });
    operator.bring_up().unwrap();
    operator.upload(&host::there_and_back(&FROM, &TO, 3.0, 1, 10), 10).unwrap();
    operator.ask(&host::exec(ExecCommand::Execute)).unwrap();
    let (mut sum, mut count) = ([0.0; 6], 0.0);
    loop {
        let truth = operator.world.truth().q;
        operator.step();
        let telemetry = operator.world.telemetry();
        if telemetry.trajectory != TrajectoryState::Execute {
            assert_eq!((telemetry.trajectory, telemetry.errors), (TrajectoryState::Finish, 0));
            return sum.map(|s: f64| (s / count).sqrt());
        }
        count += 1.0;
        for j in 0..6 {
            sum[j] += (telemetry.joints[j].set_position - truth[j]).powi(2);
        }
    }
}

/// The measurements of the simulated drives are two ticks old. With any other setting of the delay, the arm must
/// follow its path less accurately, by the distance that it moves during the time error.
#[test]
fn j62_the_simulated_arm_follows_best_with_a_delay_of_two_ticks() {
    let error = |delay_ticks: u8| {
        let controller = Config { delay_ticks, ..Config::avena() };
        true_error(SimConfig::new(controller, &Parameters::avena()))
    };
    let right = error(2);
    assert!(right.iter().all(|&x| x < 0.3e-3), "{right:?}");
    for wrong in [0, 1, 3] {
        let ticks = f64::from(2 - i32::from(wrong)).abs();
        for (j, (right, wrong)) in right.iter().zip(error(wrong)).enumerate() {
            // Each joint moves with an RMS speed of at least 0.2 rad/s. A delay that is wrong by one tick (1 ms)
            // therefore causes an error of about 0.2 mrad; the test requires 0.1 mrad.
            assert!(wrong > *right + 0.1e-3 * ticks, "joint {}: {right} and {wrong}, {ticks} off", j + 1);
        }
    }
}

/// If drives deliver less torque, the tracking must be worse. A torque gain must restore the usual tracking accuracy.
#[test]
fn j61_a_torque_gain_makes_up_for_drives_that_deliver_less() {
    let error = |delivers: f64, gain: f64| {
        let mut controller = Config::avena();
        controller.joints.iter_mut().for_each(|joint| joint.torque_gain = gain);
        let mut config = SimConfig::new(controller, &Parameters::avena());
        config.drives.iter_mut().for_each(|drive| drive.delivers = delivers);
        true_error(config)
    };
    let (ideal, without, with) = (error(1.0, 1.0), error(1.0 / 1.3, 1.0), error(1.0 / 1.3, 1.3));
    for j in 0..6 {
        assert!((with[j] / ideal[j] - 1.0).abs() < 0.03, "joint {}: {} for {}", j + 1, with[j], ideal[j]);
    }
    let worst = |all: &[f64; 6]| all.iter().fold(0.0, |most: f64, x| most.max(*x));
    assert!(worst(&without) > 1.5 * worst(&ideal), "{without:?} {ideal:?}");
}

/// For each setting of the delay, the tracking with late answers must be nearly as accurate as without late answers.
#[test]
fn j63_late_answers_are_as_good_as_those_in_time() {
    let error = |seed: u64, answer_jitter_ms: u8, delay_ticks: u8| {
        let controller = Config { delay_ticks, ..Config::avena() };
        let config = SimConfig::new(controller, &Parameters::avena());
        true_error(SimConfig { answer_jitter_ms, seed, ..config })
    };
    for (seed, delay_ticks) in [(1, 2), (2, 2), (3, 2), (1, 0), (1, 1), (1, 3)] {
        let in_time = error(seed, 0, delay_ticks);
        for most in [1, 3] {
            let late = error(seed, most, delay_ticks);
            let near = (0..6).all(|j| late[j] < 1.3 * in_time[j] + 0.05e-3);
            assert!(
                near,
                "seed {seed}, up to {most} ms late, delay {delay_ticks}: {late:?}, in time {in_time:?}"
            );
        }
    }
}
