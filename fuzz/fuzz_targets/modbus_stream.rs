#![no_main]
// Includes only the modules that read Modbus bytes, so that the fuzzer does not need to build the agent with its web
// server.
#[path = "../../crates/jtc-agent/src/modbus/fuzzing.rs"]
mod fuzzing;
#[expect(dead_code, reason = "an agent has more to refuse")]
#[path = "../../crates/jtc-agent/src/modbus/pdu.rs"]
mod pdu;

libfuzzer_sys::fuzz_target!(|data: &[u8]| fuzzing::modbus_stream(data));
