//! Runs the code of the fuzz targets with stored inputs, some handwritten inputs, and random inputs.

use proptest::prelude::*;
use test_kit::{Target, run_kept_inputs};
use ucom_sim::fuzzing::node;

const TARGETS: [Target; 1] = [("ucom_node", node)];

#[test]
fn kept_inputs() {
    run_kept_inputs(&TARGETS);
}

/// The input assigns a number to the board, starts its application and its control loop, and contains a frame that is
/// too short. The test also runs all truncations of this input.
#[test]
fn a_history() {
    let mut history = Vec::new();
    for (step, id, data) in [
        (0x20, 0x281_u16, &[][..]),
        (0x20, 0x301, &[]),
        (0x60, 0x541, &[]),
        (0x64, 0x601, &[1, 1, 1, 1]),
        (0x62, 0x1C1, &[0x08, 0x00]),
        (0x61, 0x601, &[1]),
    ] {
        history.push(step);
        history.extend(id.to_be_bytes());
        history.extend(data);
    }
    for cut in 0..=history.len() {
        node(&history[..cut]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..400)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }
}
