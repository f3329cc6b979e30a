#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| can_link::fuzzing::socketcand_stream(data));
