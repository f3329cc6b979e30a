//! The bodies of the fuzz targets over the inputs that are kept, over some made by hand, and over some at random.

use proptest::prelude::*;
use test_kit::{Target, run_kept_inputs};
use ucom::files::fuzzing as files;
use ucom::fuzzing::{frame, node, profile};
use ucom::master::fuzzing as master;

const TARGETS: [Target; 9] = [
    ("ucom_frame", frame),
    ("ucom_profile", profile),
    ("ucom_node", node),
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

/// Every identifier with every length, with the payload bytes that are most different.
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

/// A number, a start and a run, then the same once more with frames that are too short.
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

#[test]
fn profiles_that_are_none() {
    for text in
        ["", "endian = 'big'", "a.b.c = 1", "[[endian]]", "endian.x = 1", "prog = {}", "\"\" = 1", "x"]
    {
        profile(text.as_bytes());
    }
    profile(&[0xFF, 0xFE]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..400)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }
}
