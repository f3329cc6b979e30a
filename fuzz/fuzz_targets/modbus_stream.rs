#![no_main]
// The agent has a web server and more, which a fuzzer need not build: this is all that reads the bytes.
#[path = "../../crates/jtc-agent/src/modbus/fuzzing.rs"]
mod fuzzing;
#[expect(dead_code, reason = "an agent has more to refuse")]
#[path = "../../crates/jtc-agent/src/modbus/pdu.rs"]
mod pdu;

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzzing::modbus_stream(data));
