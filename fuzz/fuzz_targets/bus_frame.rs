#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| jtc_bus::fuzzing::bus_frame(data));
