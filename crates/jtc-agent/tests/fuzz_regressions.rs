//! Runs the body of the fuzz target `modbus_stream` with the stored inputs and with random inputs.
use jtc_agent::modbus::fuzzing::modbus_stream;
use proptest::prelude::*;

#[test]
fn kept_inputs() {
    test_kit::run_kept_inputs(&[("modbus_stream", modbus_stream)]);
}

/// Returns a Modbus request with its header.
fn request(pdu: Vec<u8>) -> Vec<u8> {
    let len = (pdu.len() + 1) as u16;
    [&[0xAB, 0xCD, 0, 0][..], &len.to_be_bytes(), &[7], &pdu].concat()
}

/// Returns random Modbus requests. Most of the random requests have addresses of the device and a
/// correct length.
fn requests() -> impl Strategy<Value = Vec<u8>> {
    let any_request = prop::collection::vec(any::<u8>(), 1..20);
    let write =
        (prop::sample::select(vec![15_u8, 16]), 0..20_u8, 1..17_u8, prop::collection::vec(any::<u8>(), 32));
    let write = write.prop_map(|(function, at, count, data)| {
        let len = if function == 15 { count.div_ceil(8) } else { 2 * count };
        [&[function, 0, at, 0, count, len][..], &data[..usize::from(len)]].concat()
    });
    let other = (1..7_u8, 0..20_u8, prop::sample::select(vec![[0_u8, 1], [0, 9], [0xFF, 0], [0, 0]]))
        .prop_map(|(function, at, value)| vec![function, 0, at, value[0], value[1]]);
    prop::collection::vec(prop_oneof![any_request, write, other], 1..20)
        .prop_map(|requests| requests.into_iter().flat_map(request).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]
    #[test]
    fn requests_at_random(data in requests()) {
        modbus_stream(&data);
    }

    #[test]
    fn random_inputs(data in prop::collection::vec(any::<u8>(), 0..300)) {
        modbus_stream(&data);
    }
}
