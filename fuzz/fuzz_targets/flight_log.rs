#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| jtc_host::fuzzing::flight_log(data));
