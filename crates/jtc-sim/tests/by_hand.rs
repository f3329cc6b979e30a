//! Tests in which a person pushes the arm and guides it by hand.
use jtc_bus::Joint;
use jtc_core::ControllerState;
use jtc_sim::{FaultPlan, HandPath, Operator, SimConfig, host};
use jtc_wire::FrameType;

const FROM: [f64; 6] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];

fn held(faults: FaultPlan) -> Operator {
    let mut operator = Operator::new(SimConfig { start: FROM, baud: None, faults, ..SimConfig::default() });
    operator.bring_up().unwrap();
    operator
}

/// Returns a path on which every joint moves by 0.4 rad and back, in 4 s.
fn path() -> HandPath {
    let at = |i: u32| {
        let s = (core::f64::consts::PI * f64::from(i) / 400.0).sin().powi(2);
        FROM.map(|q| q + 0.4 * s)
    };
    HandPath::new((0..=400).map(at).collect(), 0.01).unwrap()
}

/// Returns the largest distance of joint `j` from its first position over `ms` milliseconds, rad.
fn farthest(operator: &mut Operator, j: usize, ms: u64) -> f64 {
    (0..ms).fold(0.0, |far: f64, _| {
        operator.step();
        far.max((operator.world.truth().q[j] - FROM[j]).abs())
    })
}

#[test]
fn a_push_moves_the_joint_that_was_meant_and_the_arm_comes_back() {
    let mut operator = held(FaultPlan::default());
    operator.run(500);
    // A push of 30 N·m for 200 ms is too small to make the joint yield (J-68). The controller must return the joint
    // to its position.
    operator.world.push(Joint::ALL[2], 30.0, 200);
    let far = farthest(&mut operator, 2, 300);
    assert!((1e-3..0.05).contains(&far), "{far} rad");
    operator.run(1500);
    let q = operator.world.truth().q;
    assert!(q.iter().zip(&FROM).all(|(a, b)| (a - b).abs() < 1e-3), "{q:?}");
    assert_eq!((operator.state(), operator.world.telemetry().errors), (ControllerState::HoldPos, 0));
}

#[test]
fn a_push_of_a_fault_file_concerns_the_joint_counted_from_1() {
    let text = "format = 2\n[[fault]]\nkind = \"push\"\njoint = 3\ntorque_nm = 40\nin_state = \"hold\"\nafter_s = 5\nfor_s = 0.2";
    let mut operator = held(FaultPlan::from_toml(text).unwrap());
    let mut far = [0.0f64; 6];
    for _ in 0..2000 {
        operator.step();
        let q = operator.world.truth().q;
        (0..6).for_each(|j| far[j] = far[j].max((q[j] - FROM[j]).abs()));
    }
    assert!(far[2] > 1e-3 && far[0] < 1e-3 && far[5] < 1e-3, "{far:?}");
}

#[test]
fn j25_a_hand_leads_the_taught_arm_along_its_path_and_lets_go() {
    let mut operator = held(FaultPlan::default());
    operator.world.lead(path());
    // The arm must not move before Teaching begins, because the hand must wait.
    assert!(farthest(&mut operator, 0, 1000) < 1e-3);
    operator.teach().unwrap();
    let (mut led, mut fastest) = ([0.0f64; 6], 0.0f64);
    for _ in 0..4_600 {
        operator.step();
        let truth = operator.world.truth();
        (0..6).for_each(|j| led[j] = led[j].max(truth.q[j] - FROM[j]));
        fastest = truth.qd.iter().fold(fastest, |v, qd| v.max(qd.abs()));
    }
    assert_eq!((operator.state(), operator.world.telemetry().errors), (ControllerState::Teaching, 0));
    assert!(led.iter().all(|far| (0.35..0.45).contains(far)), "{led:?}");
    assert!(fastest < 1.0, "{fastest} rad/s");
    operator.ask(&host::frame(FrameType::TeachingModeDisable, &[])).unwrap();
    operator.run(500);
    assert_eq!(operator.state(), ControllerState::HoldPos);
}
