//! Runs the functions of the fuzz targets with the stored inputs, with some handwritten inputs, and with random inputs.

use proptest::prelude::*;
use test_kit::{Target, run_kept_inputs};
use ucom::fuzzing::frame;

const TARGETS: [Target; 1] = [("ucom_frame", frame)];

#[test]
fn kept_inputs() {
    run_kept_inputs(&TARGETS);
}

/// Decoding and encoding work for frames with every identifier and every length, with extreme byte values such as
/// 0x00, 0x7F and 0xFF.
#[test]
fn every_frame_with_extreme_payloads() {
    for id in 0..0x800_u16 {
        for len in 0..=9 {
            for byte in [0x00, 0x01, 0x02, 0x7F, 0x80, 0xFF] {
                let mut data = id.to_be_bytes().to_vec();
                data.extend([byte].repeat(len));
                frame(&data);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..400)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }
}
