//! Runs the bodies of the fuzz targets on the stored inputs and on some random inputs.

use jtc_host::fuzzing;
use proptest::prelude::*;
use test_kit::Target;

const TARGETS: [Target; 9] = [
    ("trajectory_csv", fuzzing::trajectory_csv),
    ("trajectory_table", fuzzing::trajectory_table),
    ("trajectory_json", fuzzing::trajectory_json),
    ("trajectory_yaml", fuzzing::trajectory_yaml),
    ("arm_toml", fuzzing::arm_toml),
    ("arm_urdf", fuzzing::arm_urdf),
    ("parameter_table", fuzzing::parameter_table),
    ("capture", fuzzing::capture),
    ("flight_log", fuzzing::flight_log),
];

#[test]
fn kept_inputs() {
    test_kit::run_kept_inputs(&TARGETS);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn bytes_at_random(data in prop::collection::vec(any::<u8>(), 0..300)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }

    #[test]
    fn words_at_random(text in "[-0-9.,:e\n \\[\\]{}\"<>=/a-t]{0,200}") {
        TARGETS.iter().for_each(|(_, body)| body(text.as_bytes()));
    }
}
