//! The bodies of the fuzz targets over the inputs that are kept, and over some at random.
use std::path::Path;

use jtc_wire::fuzzing::{frame_bodies, status_stream, stream_parser};
use proptest::prelude::*;

/// Runs `body` over every file of `fuzz/corpus/<target>` and `fuzz/regressions/<target>`.
fn kept(target: &str, body: fn(&[u8])) {
    let fuzz = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz"));
    let mut count = 0;
    for kind in ["corpus", "regressions"] {
        let Ok(files) = std::fs::read_dir(fuzz.join(kind).join(target)) else { continue };
        for file in files {
            let path = file.expect("a readable directory").path();
            println!("{}", path.display());
            body(&std::fs::read(path).expect("a readable file"));
            count += 1;
        }
    }
    println!("{target}: {count} kept inputs");
}

#[test]
fn stream_parser_on_kept_inputs() {
    kept("stream_parser", stream_parser);
}

#[test]
fn frame_bodies_on_kept_inputs() {
    kept("frame_bodies", frame_bodies);
}

#[test]
fn status_stream_on_kept_inputs() {
    kept("status_stream", status_stream);
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
