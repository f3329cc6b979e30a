//! Runs the functions of the fuzz targets on the stored inputs and on some random inputs.

use jtc_wire::fuzzing::{frame_bodies, status_stream, stream_parser};
use proptest::prelude::*;

#[test]
fn kept_inputs() {
    test_kit::run_kept_inputs(&[
        ("stream_parser", stream_parser),
        ("frame_bodies", frame_bodies),
        ("status_stream", status_stream),
    ]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_500, failure_persistence: None, ..Default::default() })]

    #[test]
    fn j03_the_parser_finds_what_the_reference_finds(data in prop::collection::vec(any::<u8>(), 0..400)) {
        stream_parser(&data);
    }

    #[test]
    fn j07_any_body_is_survived(data in prop::collection::vec(any::<u8>(), 0..400)) {
        frame_bodies(&data);
    }

    #[test]
    fn j08_statuses_are_found_in_any_stream(data in prop::collection::vec(any::<u8>(), 0..400)) {
        status_stream(&data);
    }
}
