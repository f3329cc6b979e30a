//! Test that the paths of the simulator's endurance run pass the check of the host. The check includes the ability to
//! stop at any point of the path.
use jtc_host::check::Checker;
use jtc_host::{Arm, Point, Trajectory};
use proptest::prelude::*;
use sim_checks::soak;

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]
    #[test]
    fn j33_each_path_of_the_soak_run_passes_the_check(
        from in prop::array::uniform6(-1.5..1.5f64),
        seed: u64,
    ) {
        let arm = Arm::avena();
        let config = arm.config();
        let points = soak::path(&from, seed).iter().map(Point::from).collect();
        let trajectory = Trajectory { step_ms: soak::PATH_STEP_MS, points };
        let friction = arm.friction();
        let checker = Checker { model: Some(&arm.model), friction: friction.as_ref(), ..Checker::new(&config) };
        let verdict = checker.check(&trajectory);
        prop_assert!(verdict.is_ok(), "{verdict}");
    }
}
