//! Runs the code of the fuzz targets with stored inputs, some handwritten inputs, and random inputs.

use proptest::prelude::*;
use test_kit::{Target, run_kept_inputs};
use ucom_host::files::fuzzing as files;
use ucom_host::master::fuzzing as master;

const TARGETS: [Target; 7] = [
    ("ucom_profile", files::profile),
    ("ucom_image", files::image),
    ("ucom_recording", files::recording),
    ("ucom_inventory", files::inventory),
    ("ucom_edges", files::edges),
    ("ucom_params", files::params),
    ("ucom_master", master::frames),
];

#[test]
fn kept_inputs() {
    run_kept_inputs(&TARGETS);
}

#[test]
fn profiles_that_are_none() {
    for text in
        ["", "endian = 'big'", "a.b.c = 1", "[[endian]]", "endian.x = 1", "prog = {}", "\"\" = 1", "x"]
    {
        files::profile(text.as_bytes());
    }
    files::profile(&[0xFF, 0xFE]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..400)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }
}
