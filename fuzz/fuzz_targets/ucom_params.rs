#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| ucom_host::files::fuzzing::params(data));
