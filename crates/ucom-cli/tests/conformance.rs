//! Tests of `ucom conformance` and `ucom status --raw` with `ucom sim`.
#![cfg(unix)]

use crate::common;

use common::{Sim, ended_by};
use serde_json::json;

/// D-T2, D-T5, D-T10, D-T11: simulated boards pass the tests that only send requests, in both byte orders.
#[test]
fn simulated_boards_conform() {
    for endian in ["little", "big"] {
        let profile = format!("endian = \"{endian}\"\n");
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("profile.toml");
        std::fs::write(&file, profile).unwrap();
        let file = file.to_str().unwrap();
        let sim = Sim::start(&["--boards", "2", "--profile", file]);
        let ucom = |words: &[&str]| sim.ucom(&[&["--json", "--profile", file], words].concat());
        ucom(&["init"]).ends(0);
        ucom(&["start", "1"]).ends(0);
        let output = ucom(&["conformance"]).ends(0).json();
        assert_eq!((&output["passed"], &output["failed"]), (&json!(5), &json!(0)), "{output}");
        let first = &output["tests"][0];
        assert_eq!(
            (&first["id"], &first["verdict"], &first["sent"][0]),
            (&json!("D-T2"), &json!("pass"), &json!("240#"))
        );
        let output = ucom(&["conformance", "2", "--run", "--only", "D-T12,d-t15"]).ends(0).json();
        assert_eq!(output["passed"], 2, "{output}");
        ucom(&["conformance", "--only", "D-T99"]).ends(2);
        ucom(&["conformance", "1", "--init"]).ends(2);
        // The user must select exactly one board, and this board must have the expected identity.
        let image = dir.path().join("image.bin");
        std::fs::write(&image, [0xA5; 256]).unwrap();
        let image = image.to_str().unwrap();
        ucom(&["conformance", "--program", image]).ends(2);
        ucom(&["conformance", "1,2", "--program", image]).ends(2);
        let output = ucom(&["conformance", "2", "--program", image, "--flash-id", "0xEEEE"]).ends(4).json();
        assert_eq!(output["error"]["code"], "wrong-board", "{output}");
    }
}

/// While a control loop runs, the conformance tests that change boards are refused, and no option overrides this.
#[test]
fn running_loops_are_stopped_first() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let run = sim.spawn(&["run", "1"]);
    sim.peer().wait("381#");
    let output = sim.json(&["conformance", "1", "--run", "--force"], 4);
    assert_eq!(output["error"]["code"], "running", "{output}");
    assert_eq!(
        output["error"]["hint"], "`ucom stop all` first; --force does not override this check",
        "{output}"
    );
    ended_by(run, "-INT").ends(0);
}

/// D-22: the formula for the new status also applies to value bits outside the mask. The command `status --raw` shows
/// the status that the rules require and the actual status.
#[test]
fn d22_raw_status_sets_bits_outside_the_mask() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let mut peer = sim.peer();
    let output = sim.json(&["status", "1", "--raw", "00:40"], 0);
    assert_eq!(
        output["boards"],
        json!([{ "number": 1, "before": 0x1B, "expected": 0x5B, "after": 0x5B, "as_expected": true }])
    );
    assert_eq!(peer.wait("1C1#"), "1C1#0040");
    // For `all`, the command sends a single broadcast frame.
    sim.ucom(&["status", "all", "--raw", "40:00"]).ends(0);
    let sent: Vec<String> = peer.all(100).into_iter().filter(|f| f.starts_with("1C")).collect();
    assert_eq!(sent, ["1C0#4000"]);
    // Without the bit INIT, the board loses its number. This result agrees with the rules.
    let output = sim.json(&["status", "2", "--raw", "0x08:0x00"], 0);
    assert_eq!(
        (&output["boards"][0]["after"], &output["boards"][0]["as_expected"]),
        (&json!(null), &json!(true))
    );
    sim.ucom(&["status", "1", "--raw", "0:0", "--set", "ASTART"]).ends(2);
    sim.ucom(&["status", "1", "--raw", "256:0"]).ends(2);
}
