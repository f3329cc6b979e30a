//! The bodies of the fuzz targets over the inputs that are kept, and over some at random.
use std::path::Path;

use jtc_host::fuzzing;
use proptest::prelude::*;

type Body = fn(&[u8]);

const TARGETS: [(&str, Body); 8] = [
    ("trajectory_csv", fuzzing::trajectory_csv),
    ("trajectory_table", fuzzing::trajectory_table),
    ("trajectory_json", fuzzing::trajectory_json),
    ("trajectory_yaml", fuzzing::trajectory_yaml),
    ("arm_toml", fuzzing::arm_toml),
    ("arm_urdf", fuzzing::arm_urdf),
    ("parameter_table", fuzzing::parameter_table),
    ("capture", fuzzing::capture),
];

#[test]
fn kept_inputs() {
    let fuzz = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz"));
    for (target, body) in TARGETS {
        for kind in ["corpus", "regressions"] {
            let Ok(files) = std::fs::read_dir(fuzz.join(kind).join(target)) else { continue };
            for file in files {
                let path = file.expect("a readable directory").path();
                println!("{}", path.display());
                body(&std::fs::read(path).expect("a readable file"));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn bytes_at_random(data in prop::collection::vec(any::<u8>(), 0..300)) {
        TARGETS.iter().for_each(|(_, body)| body(&data));
    }

    #[test]
    fn words_at_random(text in "[-0-9.,:e\n \\[\\]{}\"<>=/a-t]{0,200}") {
        TARGETS.iter().for_each(|(_, body)| body(text.as_bytes()));
    }
}
