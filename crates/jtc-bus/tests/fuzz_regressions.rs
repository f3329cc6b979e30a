//! Runs the function of the fuzz target on the stored inputs, on frames of every kind, and on some random frames.

use jtc_bus::fuzzing::bus_frame;
use proptest::prelude::*;

#[test]
fn kept_inputs() {
    test_kit::run_kept_inputs(&[("bus_frame", bus_frame)]);
}

/// Tests the identifier of every frame of the bus, with extreme payload bytes.
#[test]
fn every_frame_with_extreme_payloads() {
    for id in 0..0x800_u16 {
        for len in [0, 1, 6, 7, 8, 12, 16, 20, 24] {
            for byte in [0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF] {
                let mut data = id.to_be_bytes().to_vec();
                data.extend([byte].repeat(len));
                bus_frame(&data);
            }
        }
    }
}

/// Tests the number -32768, which a drive can report. This number is the only one below the negative full scale.
#[test]
fn the_lowest_numbers() {
    bus_frame(b"\x00\x00\x80\x00\x80\x00\x80\x00\x80\x00\x80\x00\x80\x00\xff\x00\x00\x00");
    bus_frame(b"\x02\x00\x80\x00\x00\x00\x80\x00\x80\x00\x00\x00\x00\x00\x00\x00\x00\x00");
}

#[test]
fn inputs_that_are_no_frames() {
    for len in 0..100 {
        bus_frame(&vec![0xFF; len]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..40)) {
        bus_frame(&data);
    }
}
