#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| can_link::fuzzing::slcan_stream(data));
