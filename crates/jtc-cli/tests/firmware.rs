//! Tests of `jtc firmware`, with folders as USB drives and boards on pseudo-terminals. The tests of the library cover the complete
//! behaviour of an ST-LINK.

#[cfg(unix)]
mod board;
use crate::common;

use std::fs;
use std::path::Path;
use std::process::Command;

use cli_kit::testing::{CommandOutput, run};
use common::{Dir, Sim, command};
use serde_json::Value;

const H745: &str = "nucleo-h745zi-q";
/// SHA-256 that does not match the image of 4096 bytes. The library computes the correct SHA-256 of the image.
const WRONG: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Returns an image for this board. The program in the image does nothing.
fn image(board: &str) -> Vec<u8> {
    let mut bytes = vec![0; 0x1000];
    bytes[0..4].copy_from_slice(&0x2001_2000u32.to_le_bytes());
    bytes[4..8].copy_from_slice(&0x0800_0601u32.to_le_bytes());
    bytes[0x400..0x40C].copy_from_slice(b"OPENJTC\0\x01\0\x60\0");
    for (at, text) in [(0x40C, "0.2.0"), (0x418, board), (0x430, "0123456789abc")] {
        bytes[at..at + text.len()].copy_from_slice(text.as_bytes());
    }
    bytes[0x458..0x45C].copy_from_slice(&115_200u32.to_le_bytes());
    bytes[0x600] = 1;
    bytes[0xFFF] = 1;
    if board.starts_with("nucleo-h745") {
        // For boards with two cores, the program of the second core begins at 1 MiB.
        bytes.resize(1024 * 1024, 0xFF);
        for word in [0x3004_8000u32].into_iter().chain([0x0810_0041; 15]).chain([0xE7FD_BF30]) {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes
}

/// Creates a USB drive with this label, an image, and a catalogue of images with a wrong digest. Returns the
/// directory of the test, the path of the drive and the path of the image.
fn desk(label: &str) -> (Dir, String, String) {
    let dir = Dir::new();
    fs::create_dir(dir.path(label)).unwrap();
    dir.file(&format!("{label}/DETAILS.TXT"), "Version: V3J13M4B5S1\n");
    fs::write(dir.path("new.bin"), image(H745)).unwrap();
    fs::create_dir(dir.path("installed")).unwrap();
    fs::write(dir.path("installed/new.bin"), image(H745)).unwrap();
    dir.file(
        "installed/firmware.json",
        &format!(
            r#"{{"version":"0.2.0","images":[{{"board":"{H745}","file":"new.bin","sha256":"{WRONG}","address":134217728,"bytes":4096}}]}}"#
        ),
    );
    let (drive, new) = (dir.path(label), dir.path("new.bin"));
    (dir, drive, new)
}

fn jtc(dir: &Dir, words: &[&str]) -> CommandOutput {
    let mut jtc: Command = command();
    jtc.env("OPENJTC_FIRMWARE", dir.path("installed"));
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
    // If no images are installed, `jtc firmware list` still succeeds.
    let empty = Dir::new();
    let listed = jtc(&empty, &["firmware", "list"]).ends(0);
    assert!(listed.err.contains("no firmware.json in"), "{}", listed.err);
}

#[test]
fn without_a_line_a_person_answers_for_the_arm_and_nothing_is_proved() {
    let (dir, drive, new) = desk("NOD_H745ZIQ");
    let words = [
        "--json",
        "firmware",
        "flash",
        "--image",
        &new,
        "--drive",
        &drive,
        "--no-read-back",
        "--wait",
        "1",
        "--accept-supply",
    ];
    let refused = json(&jtc(&dir, &words).ends(4));
    assert_eq!(refused["error"]["code"], "not-confirmed-by-person");
    let question = refused["error"]["message"].as_str().unwrap();
    assert!(question.contains("safety wires") && question.contains("file is complete"), "{question}");
    nothing_written(&drive);
    // The USB drive stays mounted, which means that the board has not accepted the image. Therefore the command
    // fails.
    let done = json(&jtc(&dir, &[&words[..], &["--yes"]].concat()).ends(5));
    assert_eq!(done["error"]["code"], "not-taken");
    assert_eq!(fs::read(Path::new(&drive).join("openjtc.bin")).unwrap(), image(H745));
}

#[test]
fn the_supply_of_a_silent_board_has_to_be_answered_for() {
    let (dir, drive, new) = desk("NOD_H745ZIQ");
    let words =
        ["--json", "firmware", "flash", "--image", &new, "--drive", &drive, "--no-read-back", "--yes"];
    let refused = json(&jtc(&dir, &words).ends(4));
    assert_eq!(refused["error"]["code"], "other-supply");
    nothing_written(&drive);
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
    assert_eq!(flash(&["--image", &dir.path("installed/new.bin")], 4), "damaged-image");
    fs::write(dir.path("cut.bin"), &image(H745)[..0x1000]).unwrap();
    assert_eq!(flash(&["--image", &dir.path("cut.bin")], 2), "no-image");
    assert_eq!(flash(&["--image", &new, "--port", "http://127.0.0.1:1"], 2), "usage");
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
    // A simulated controller has no flash memory, so it cannot report its program.
    let verified = sim.json(&["firmware", "verify", "--image", &new], 5);
    assert_eq!(verified["error"]["code"], "not-reported");
}

#[cfg(unix)]
mod with_a_board {
    use std::time::Duration;

    use cli_kit::testing::Terminal;
    use common::agent::Agent;
    use jtc_wire::ControllerState;

    use super::board::{Board, appear, program_of};
    use super::*;

    /// Returns the arguments of `jtc firmware flash` for this board, drive and image.
    fn words<'a>(board: &'a Board, drive: &'a str, new: &'a str) -> Vec<&'a str> {
        let image =
            ["firmware", "flash", "--image", new, "--drive", drive, "--accept-supply", "--wait", "60"];
        [&image[..], &["--port", &board.port]].concat()
    }

    #[test]
    fn j67_a_board_is_flashed_and_proves_it() {
        let (dir, drive, new) = desk("NOD_H745ZIQ");
        let board = Board::new(H745, Path::new(&drive), image(H745).len());
        let words = [&["--json"], &words(&board, &drive, &new)[..], &["--yes"]].concat();
        let crc32 = format!("{:08x}", program_of(&image(H745)).crc32);
        // In the second pass of the loop, the board already runs the image. The command must still write the image,
        // because it cannot determine whether the USB drive belongs to this board.
        for _ in 0..2 {
            let done = json(&jtc(&dir, &words).ends(0));
            assert_eq!((&done["written"], &done["proved"]), (&true.into(), &true.into()), "{done}");
            assert_eq!(done["program"]["crc32"], crc32.as_str());
            assert_eq!((&done["port"], &done["same_device"]), (&board.port.as_str().into(), &Value::Null));
            assert_eq!((&done["drive_after"], &done["stored_arm"]), (&"came_back".into(), &"kept".into()));
            assert_eq!(done["doubt"], Value::Null);
        }
        let verified = jtc(&dir, &["--json", "firmware", "verify", "--image", &new, "--port", &board.port]);
        assert_eq!(json(&verified.ends(0))["proved"], true);
        // With `--no-read-back`, the command ends without verification when the USB drive has appeared again.
        let done = json(&jtc(&dir, &[&words[..], &["--no-read-back"]].concat()).ends(0));
        assert_eq!((&done["proved"], &done["drive_after"]), (&false.into(), &"came_back".into()), "{done}");
    }

    #[test]
    fn what_changes_while_a_person_thinks_is_seen() {
        let (dir, drive, new) = desk("NOD_H745ZIQ");
        let board = Board::new(H745, Path::new(&drive), usize::MAX);
        let answer_after = |meanwhile: &dyn Fn(), says: &str| {
            let mut command = command();
            command.env("OPENJTC_FIRMWARE", dir.path("installed")).args(words(&board, &drive, &new));
            let mut terminal = Terminal::new(1_000, 30);
            let mut child = terminal.start(&command);
            terminal.until_it_shows("type yes to continue");
            meanwhile();
            std::thread::sleep(Duration::from_millis(200));
            terminal.press("yes\n");
            assert_eq!(terminal.ends(&mut child), 4, "{}", terminal.picture.text());
            assert!(terminal.picture.text().contains(says), "{}", terminal.picture.text());
            nothing_written(&drive);
        };
        answer_after(
            &|| board.set_status(|status| status.state = ControllerState::HoldPos.into()),
            "holds an arm",
        );
        board.set_status(|status| status.state = ControllerState::Init.into());
        answer_after(
            &|| {
                board.set_status(|status| {
                    status.gripper = Some(jtc_wire::GripperStatus { pump: 1, ..Default::default() });
                });
            },
            "the report of the board has changed in the meantime",
        );
        // Before the user answers, another USB drive is mounted at this folder, or the USB drive is unmounted and its
        // folder stays. The command must detect both changes.
        let page = Path::new(&drive).join("MBED.HTM");
        answer_after(&|| fs::write(&page, "code=0843").unwrap(), "another drive is at this place");
        fs::remove_file(page).unwrap();
        answer_after(
            &|| fs::remove_file(Path::new(&drive).join("DETAILS.TXT")).unwrap(),
            "the drive has disappeared",
        );
        appear(Path::new(&drive));
    }

    #[test]
    fn a_board_that_an_agent_owns_is_not_flashed() {
        let (dir, drive, new) = desk("NOD_H745ZIQ");
        let board = Board::new(H745, Path::new(&drive), usize::MAX);
        let agent = Agent::start(&["--port", &board.port]);
        for more in [&["--yes"][..], &["--yes", "--no-read-back"]] {
            let mut command = agent.command(&["--json", "firmware", "flash"], &board.port);
            command.env("OPENJTC_FIRMWARE", dir.path("installed"));
            let image = ["--image", &new, "--drive", &drive, "--accept-supply", "--wait", "1"];
            let refused = json(&run(command, &[&image[..], more].concat(), "").ends(4));
            assert_eq!(refused["error"]["code"], "not-asked");
            nothing_written(&drive);
        }
    }
}
