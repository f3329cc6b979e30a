//! Runs the functions of the fuzz targets with the stored inputs, and with some random inputs.

use can_link::fuzzing::{slcan_stream, socketcand_stream};
use proptest::prelude::*;

#[test]
fn kept_inputs() {
    test_kit::run_kept_inputs(&[("socketcand_stream", socketcand_stream), ("slcan_stream", slcan_stream)]);
}

/// Words of the protocols, mixed with random bytes. `words` contains the words, separated by bars.
fn words(words: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let word = prop_oneof![
        8 => prop::sample::select(words.split('|').collect::<Vec<_>>()).prop_map(|word| word.as_bytes().to_vec()),
        1 => prop::collection::vec(any::<u8>(), 0..8),
        1 => (0..700_usize).prop_map(|len| vec![b'7'; len]),
    ];
    prop::collection::vec(word, 0..60).prop_map(|words| words.concat())
}

const SOCKETCAND: &str = "< | >|<|>| |  |send|frame|fdframe|error|open|rawmode|hi|ok|can0|123|00000123|0|2|8|11|1122|ff|1.0|12.000345|01|\n";

const SLCAN: &str =
    "\r|\u{7}|S8|Y5|O|L|C|F|V|Z1|t|T|r|R|d|D|b|B|123|00000123|0|2|8|F|1122|0011223344556677|sb256256|\n|z";

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
