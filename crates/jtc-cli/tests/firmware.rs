//! `jtc firmware` with drives that are folders; the ST-LINK and its board are in the tests of the library.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use cli_kit::trial::{CommandOutput, run};
use common::{Dir, Sim, command};
use serde_json::Value;

const H745: &str = "nucleo-h745zi-q";
/// SHA-256 of 4096 bytes is computed by the library; a wrong one is this.
const WRONG: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// An image of this board, which does nothing.
fn image(board: &str) -> Vec<u8> {
    let mut bytes = vec![0; 0x1000];
    bytes[0..4].copy_from_slice(&0x2001_2000u32.to_le_bytes());
    bytes[4..8].copy_from_slice(&0x0800_0601u32.to_le_bytes());
    bytes[0x400..0x40C].copy_from_slice(b"OPENJTC\0\x01\0\x60\0");
    for (at, text) in [(0x40C, "0.2.0"), (0x418, board), (0x430, "0123456789abc")] {
        bytes[at..at + text.len()].copy_from_slice(text.as_bytes());
    }
    bytes[0x600] = 1;
    bytes
}

/// A drive with this label, an image beside it, and a catalogue that lists the image with a wrong digest.
fn desk(label: &str) -> (Dir, String, String) {
    let dir = Dir::new();
    fs::create_dir(dir.path(label)).unwrap();
    dir.file(&format!("{label}/DETAILS.TXT"), "Version: V3J13M4B5S1\n");
    fs::write(dir.path("new.bin"), image(H745)).unwrap();
    dir.file(
        "firmware.json",
        &format!(
            r#"{{"version":"0.2.0","images":[{{"board":"{H745}","file":"new.bin","sha256":"{WRONG}","address":134217728,"bytes":4096}}]}}"#
        ),
    );
    let (drive, new) = (dir.path(label), dir.path("new.bin"));
    (dir, drive, new)
}

fn jtc(dir: &Dir, words: &[&str]) -> CommandOutput {
    let mut jtc: Command = command();
    jtc.env("OPENJTC_FIRMWARE", dir.path(""));
    run(jtc, words, "")
}

fn json(output: &CommandOutput) -> Value {
    serde_json::from_str(output.out.trim()).unwrap_or_else(|e| panic!("{e}: {}", output.out))
}

fn nothing_written(drive: &str) {
    assert!(!Path::new(drive).join("openjtc.bin").exists());
}

#[test]
fn images_and_drives_are_listed() {
    let (dir, ..) = desk("NOD_H745ZIQ");
    let listed = json(&jtc(&dir, &["--json", "firmware", "list"]).ends(0));
    assert_eq!((&listed["version"], &listed["images"][0]["board"]), (&"0.2.0".into(), &H745.into()));
    assert!(listed["drives"].is_array());
    let text = jtc(&dir, &["firmware", "list"]).ends(0).out;
    assert!(text.contains("nucleo-h745zi-q  new.bin, 4096 bytes"), "{text}");
    // None installed is no error of the list.
    let empty = Dir::new();
    let listed = jtc(&empty, &["firmware", "list"]).ends(0);
    assert!(listed.err.contains("no firmware.json in"), "{}", listed.err);
}

#[test]
fn without_a_line_a_person_answers_for_the_arm_and_nothing_is_proved() {
    let (dir, drive, new) = desk("NOD_H745ZIQ");
    let words =
        ["--json", "firmware", "flash", "--image", &new, "--drive", &drive, "--no-read-back", "--wait", "1"];
    let refused = json(&jtc(&dir, &words).ends(4));
    assert_eq!(refused["error"]["code"], "not-confirmed-by-person");
    nothing_written(&drive);
    let done = json(&jtc(&dir, &[&words[..], &["--yes"]].concat()).ends(0));
    assert_eq!(
        (&done["written"], &done["proved"], &done["board"]),
        (&true.into(), &false.into(), &H745.into())
    );
    assert_eq!(done["drive_after"], "stayed");
    assert_eq!(fs::read(Path::new(&drive).join("openjtc.bin")).unwrap(), image(H745));
}

#[test]
fn what_does_not_fit_is_refused_before_anything_is_written() {
    let (dir, drive, new) = desk("NOD_H743ZI2");
    let flash = |words: &[&str], code: i32| {
        let all = [
            &["--json", "firmware", "flash", "--drive", &drive, "--no-read-back", "--yes", "--wait", "1"],
            words,
        ]
        .concat();
        let output = jtc(&dir, &all).ends(code);
        nothing_written(&drive);
        json(&output)["error"]["code"].as_str().unwrap().to_owned()
    };
    assert_eq!(flash(&["--image", &new], 4), "other-board");
    assert_eq!(flash(&["--board", H745], 4), "damaged-image");
    assert_eq!(flash(&["--board", "nucleo-f401re"], 2), "no-board");
    assert_eq!(flash(&[], 2), "usage", "no installed image is for the board of this drive");
    assert_eq!(flash(&["--image", &dir.path("none.bin")], 2), "file");
    let text =
        dir.file("text.bin", "this is a text and no program, and long enough for a stack and an entry");
    assert_eq!(flash(&["--image", &text], 2), "no-image");
    fs::write(dir.path("ldo.bin"), image("nucleo-h745zi-q-ldo")).unwrap();
    assert_eq!(flash(&["--image", &dir.path("ldo.bin")], 4), "other-board");
    let folder = dir.path("");
    let words = ["--json", "firmware", "flash", "--image", &new, "--drive", &folder, "--no-read-back"];
    assert_eq!(json(&jtc(&dir, &words).ends(2))["error"]["code"], "no-drive");
}

#[test]
fn a_controller_that_holds_its_arm_or_is_another_one_is_not_reset() {
    let (_dir, drive, new) = desk("NOD_H745ZIQ");
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]);
    let words = [
        "firmware",
        "flash",
        "--image",
        &new,
        "--drive",
        &drive,
        "--yes",
        "--assume-board",
        "--accept-supply",
    ];
    let refused = sim.json(&words, 4);
    assert_eq!(refused["error"]["code"], "other-controller");
    nothing_written(&drive);
    let sim = sim.held();
    let refused = sim.json(&words, 4);
    assert_eq!(refused["error"]["code"], "has-torque");
    assert!(refused["error"]["hint"].as_str().unwrap().contains("jtc disable"));
    nothing_written(&drive);
    // A simulator has no flash.
    let verified = sim.json(&["firmware", "verify", "--image", &new], 5);
    assert_eq!(verified["error"]["code"], "not-reported");
}
