//! The bodies of the fuzz targets over the inputs that are kept, and over some at random.
use std::path::Path;

use can_link::fuzzing::{slcan_stream, socketcand_stream};
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
fn socketcand_stream_on_kept_inputs() {
    kept("socketcand_stream", socketcand_stream);
}

#[test]
fn slcan_stream_on_kept_inputs() {
    kept("slcan_stream", slcan_stream);
}

/// Words of the protocols and rubbish, mixed.
fn words(words: &'static [&'static str]) -> impl Strategy<Value = Vec<u8>> {
    let word = prop_oneof![
        8 => prop::sample::select(words).prop_map(|word| word.as_bytes().to_vec()),
        1 => prop::collection::vec(any::<u8>(), 0..8),
        1 => (0..700_usize).prop_map(|len| vec![b'7'; len]),
    ];
    prop::collection::vec(word, 0..60).prop_map(|words| words.concat())
}

const SOCKETCAND: &[&str] = &[
    "< ",
    " >",
    "<",
    ">",
    " ",
    "  ",
    "send",
    "frame",
    "fdframe",
    "error",
    "open",
    "rawmode",
    "hi",
    "ok",
    "can0",
    "123",
    "00000123",
    "0",
    "2",
    "8",
    "11",
    "1122",
    "ff",
    "1.0",
    "12.000345",
    "01",
    "\n",
];

const SLCAN: &[&str] = &[
    "\r",
    "\u{7}",
    "S8",
    "Y5",
    "O",
    "L",
    "C",
    "F",
    "V",
    "Z1",
    "t",
    "T",
    "r",
    "R",
    "d",
    "D",
    "b",
    "B",
    "123",
    "00000123",
    "0",
    "2",
    "8",
    "F",
    "1122",
    "0011223344556677",
    "sb256256",
    "\n",
    "z",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_500, failure_persistence: None, ..Default::default() })]

    #[test]
    fn socketcand_streams_of_words(data in words(SOCKETCAND)) {
        socketcand_stream(&data);
    }

    #[test]
    fn slcan_streams_of_words(data in words(SLCAN)) {
        slcan_stream(&data);
    }
}
