//! Runs the fuzz targets with inputs that the fuzzers found or that the repository stores, with the stable toolchain.

use std::path::Path;

fn kept(target: &str, body: fn(&[u8])) {
    for kind in ["corpus", "regressions"] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz").join(kind).join(target);
        for file in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let bytes = std::fs::read(file.path()).unwrap();
            body(&bytes);
            // The stored texts are short, so the test tries each prefix, and each text without one of its bytes.
            for at in 0..bytes.len().min(600) {
                body(&bytes[..at]);
                body(&[&bytes[..at], &bytes[at + 1..]].concat());
            }
        }
    }
    // The random bytes are the same in every run of the test.
    let mut state = 0x2545_F491_u32;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    for _ in 0..300 {
        let length = next() % 120;
        let bytes: Vec<u8> = (0..length).map(|_| next() as u8).collect();
        body(&bytes);
    }
}

#[test]
fn fuzz_targets_of_files_and_master() {
    kept("ucom_image", ucom_host::files::fuzzing::image);
    kept("ucom_recording", ucom_host::files::fuzzing::recording);
    kept("ucom_inventory", ucom_host::files::fuzzing::inventory);
    kept("ucom_edges", ucom_host::files::fuzzing::edges);
    kept("ucom_params", ucom_host::files::fuzzing::params);
    kept("ucom_master", ucom_host::master::fuzzing::frames);
}
